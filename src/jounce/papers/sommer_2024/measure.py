"""All that is measured of one simulation: its errors at nominal settings and in sweeps, and the lag of differences."""

import dataclasses
from collections.abc import Callable

import numpy as np

from jounce.papers.sommer_2024.lag import STEPS as LAG_STEPS, Lag, lags
from jounce.papers.sommer_2024.simulations import (
    STEPS,
    TOLERANCES,
    Cycle,
    Simulation,
    nominal_cycle,
    step_errors,
    tolerance_error,
)

RUNS = 1 + len(TOLERANCES) + len(STEPS) + len(LAG_STEPS)  # of each simulation


@dataclasses.dataclass(frozen=True)
class Results:
    """All that is measured of one simulation.

    Attributes
    ----------
    cycle : Cycle
        At nominal settings.
    by_tolerance : array of shape (tolerances, 4)
        Normalised RMSE of velocity to jounce for each of `TOLERANCES`.
    by_step : dict of str to array of shape (steps, 2)
        Normalised RMSE of jerk and jounce for each of `STEPS`: of the simulation, and of the differences of second
        and fourth order of its acceleration.
    lags : list of Lag
        Jerk and jounce by backward differences, for each of the steps of `lag`.
    """

    cycle: Cycle
    by_tolerance: np.ndarray
    by_step: dict[str, np.ndarray]
    lags: list[Lag]


def measure(simulation: Simulation, advanced: Callable[[], None] = lambda: None) -> Results:
    """Run a simulation at nominal settings, over all tolerances, over all time steps, and for the lag of differences.

    Parameters
    ----------
    simulation : Simulation
        What to run.
    advanced : callable, optional
        Called after each of the `RUNS` runs.
    """
    mechanism = simulation.load()
    cycle = nominal_cycle(simulation, mechanism)
    advanced()
    by_tolerance = []
    for tolerance in TOLERANCES:
        by_tolerance.append(tolerance_error(simulation, mechanism, tolerance))
        advanced()
    by_step = []
    for step in STEPS:
        by_step.append(step_errors(simulation, mechanism, step))
        advanced()
    methods = {name: np.stack([errors[name] for errors in by_step]) for name in by_step[0]}
    late: list[Lag] = []
    for step in LAG_STEPS:
        late += lags(simulation, mechanism, step)
        advanced()
    return Results(cycle, np.stack(by_tolerance), methods, late)
