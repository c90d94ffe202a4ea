"""Measurements of one simulation: its errors at nominal settings and in sweeps, and the lag of differences."""

import dataclasses
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.errors import JounceError, check_choice
from jounce.papers.sommer_2024.cases import (
    STEPS,
    TOLERANCES,
    Cycle,
    ValidationCase,
    nominal_cycle,
    step_errors,
    tolerance_error,
)
from jounce.papers.sommer_2024.phase_lag import STEPS as LAG_STEPS, Lag, lags
from jounce.papers.sommer_2024.residual_stop import ResidualStop

STOPS = ("correction", "residual")
RUNS = 1 + len(TOLERANCES) + len(STEPS) + len(LAG_STEPS)  # of each simulation


@dataclasses.dataclass(frozen=True)
class Results:
    """The measurements of one simulation.

    Attributes
    ----------
    cycle : Cycle
        Cycle at nominal settings.
    by_tolerance : array of shape (tolerances, 4)
        Normalized RMSE of velocity to jounce for each of `TOLERANCES`.
    by_step : dict of str to array of shape (steps, 2)
        Normalized RMSE of jerk and jounce for each of `STEPS`: of the simulation, and of the differences of second
        and fourth order of its acceleration.
    lags : list of Lag
        Jerk and jounce by backward differences, for each of their time steps.
    stop : {"correction", "residual"}
        Quantity that the tolerances of `by_tolerance` bound.
    """

    cycle: Cycle
    by_tolerance: Float[np.ndarray, "tolerances 4"]
    by_step: dict[str, Float[np.ndarray, "steps 2"]]
    lags: list[Lag]
    stop: str = "correction"


def measure(case: ValidationCase, advanced: Callable[[], None] = lambda: None, *, stop: str = "correction") -> Results:
    """Run a simulation at nominal settings, over all tolerances, over all time steps, and for the lag of differences.

    Parameters
    ----------
    case : ValidationCase
        The simulation.
    advanced : callable, optional
        Function called after each of the `RUNS` runs.
    stop : {"correction", "residual"}, default "correction"
        Quantity that the tolerances of the sweep bound: the next Newton-Raphson correction, as in `jounce.solve` with
        ``refine=False``, or the largest residual with lengths in cm.

    Raises
    ------
    JounceError
        If `stop` is another word.
    """
    check_choice("rule", stop, STOPS, JounceError, name="stop")
    mechanism = case.load()

    def each(run: Callable[..., Any], settings: Iterable[float]) -> list[Any]:
        results = []
        for value in settings:
            results.append(run(case, mechanism, value))
            advanced()
        return results

    cycle = nominal_cycle(case, mechanism)
    advanced()
    stopped = tolerance_error
    if stop == "residual":
        sweep = ResidualStop(case)
        stopped = lambda *run: sweep.error(run[-1])  # noqa: E731 - the sweep has the case and its mechanism
    by_tolerance, by_step = each(stopped, TOLERANCES), each(step_errors, STEPS)
    methods = {name: np.stack([errors[name] for errors in by_step]) for name in by_step[0]}
    lag_pairs = each(lags, LAG_STEPS)
    return Results(cycle, np.stack(by_tolerance), methods, [lag for pair in lag_pairs for lag in pair], stop)
