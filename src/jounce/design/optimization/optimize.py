"""Optimization of a mechanism for an objective under conditions."""

import dataclasses
import math
import numbers
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.base.activity import Count
from jounce.base.moved_names import old_keyword
from jounce.base.shapes import ArrayLike, by_component, real_numbers, seconds
from jounce.design.objectives.measures import PrescribedPath
from jounce.design.optimization.result import OptimizedDesign
from jounce.design.optimization.study import DesignRequest, Study
from jounce.errors import UNSET, DesignError, JounceError, MechanismError, check_name, whole_number
from jounce.kinematics import assemblies as all_assemblies
from jounce.mechanism import Mechanism, build, check_mechanism, time_grid, with_output_drivers
from jounce.mechanism.building.preconditions import concrete
from jounce.mechanism.time import TimeLike


@concrete
@old_keyword("minimise", "minimize")
def optimize(
    mechanism: Mechanism,
    minimize: str,
    vary: Mapping[str, Any],
    subject_to: Sequence[str] = (),
    *,
    time: TimeLike | None = None,
    curves: Mapping[str, ArrayLike | tuple[ArrayLike, ArrayLike]] | None = None,
    assemblies: str | Sequence[int] | None = None,
    starts: int = 8,
    samples: int | None = None,
    seed: int = 0,
    clearance: float = 1e-2,
    iterations: int = 100,
    progress: Callable[[int, int, float], None] | None = None,
) -> OptimizedDesign:
    """Return the design of a mechanism with the least objective that fulfills all conditions.

    Objective and conditions are expressions of measures: ``peak(psi, 4)`` is the largest magnitude of the jounce of the
    output ``psi``; ``maximum``, ``minimum``, ``span``, ``mean`` and ``rms`` take the same arguments: a quantity, a
    derivative (0 unless given) and two instants, the window of time; ``at(psi, 1, 0.5)`` is a rate at 0.5 s. Quantities
    are outputs, components ``C_x``, derivatives ``psi_d2``, ``torque(DRIVER)``, ``force(DRIVER)``, ``force_x(JOINT)``,
    parameters, ``t``, and expressions of these. ``path_error(C, NAME)`` is the root mean square distance of points from
    the path of an output, ``path_deviation(C, NAME)`` the largest distance. Peaks between instants count.

    The designs of a low-discrepancy sample are solved side by side. Searches by SciPy's SLSQP, with exact slopes, start
    from the best of them and from the given mechanism. An extreme with which goals increase is replaced by a variable
    that bounds its values, so that the objective stays smooth where the instant of the extreme jumps.

    Parameters
    ----------
    mechanism : Mechanism
        A mechanism for `jounce.solve`, without redundant constraints.
    minimize : str
        The objective; to maximize, use a minus sign, as in ``"-span(psi)"``.
    vary : dict of str to (low, high)
        Bounds of the parameters to vary, SI or text with a unit; ``"12cm:16cm"`` gives both.
    subject_to : sequence of str, optional
        Conditions by ``<=``, ``>=`` and ``==``, such as ``"span(psi) == 60 deg"``; a number may have a unit.
    time : array_like of shape (time,), optional
        Instants, s, the same in all designs; by default those of the mechanism.
    curves : dict of str to array_like, optional
        Points for paths, (points, components), m; or pairs of times (points,), s, and points.
    assemblies : sequence of int, or "all", optional
        Numbers of the assemblies to try, as `jounce.assemblies` numbers those of the given mechanism; by default only
        that of the mechanism.
    starts : int, default 8
        Number of searches, one of them from the given mechanism.
    samples : int, optional
        Number of designs from which starts are chosen, rounded up to a power of two; by default 64, or 16 for each
        parameter.
    seed : int, default 0
        Seed of the sample.
    clearance : float, default 1e-2
        Lower bound of the smallest singular value of the scaled Jacobian at every instant; the singular value vanishes
        where a design locks. Zero removes the bound.
    iterations : int, default 100
        Largest number of iterations of a search between two changes of its region.
    progress : callable, optional
        Called with the number of searches done, their total, and the least objective so far.

    Returns
    -------
    OptimizedDesign
        The best design found, compared with the given one, and checked on a finer grid.

    Raises
    ------
    MechanismError, ExpressionError, UnitError
        If a name does not exist, bounds are not two increasing numbers, a bound is not admissible, an expression cannot
        be read, or instants differ from design to design.
    DesignError
        If no design can be assembled and moved, or conditions cannot be fulfilled; the message names them with their
        violations, and the error contains the design nearest to fulfilling them.

    References
    ----------
    Kraft, D. (1988). A software package for sequential quadratic programming. DFVLR-FB 88-28.

    Examples
    --------
    >>> import jounce as jn
    >>> mechanism = jn.load("examples/four_bar.yaml")
    >>> found = jn.optimize(mechanism, "peak(psi, 2)", {"BC": (0.13, 0.15)}, starts=1, time=[0.0, 0.1, 0.2])
    >>> found.status, round(found.parameters["BC"], 4)
    ('optimal', 0.15)
    """
    check_mechanism(mechanism)
    bounds = _bounds(mechanism, vary)
    starts = whole_number("starts", starts, 1, error=MechanismError)
    seed = whole_number("seed", seed, 0, error=MechanismError)
    iterations = whole_number("iterations", iterations, 1, error=MechanismError)
    if not (isinstance(clearance, numbers.Real) and 0 <= clearance < math.inf):
        raise MechanismError("must be a number, zero or greater", name="clearance", value=clearance)
    instants = _instants(mechanism, time, bounds)
    targets = {name: _curve(name, points) for name, points in (curves or {}).items()}
    if isinstance(subject_to, str):
        raise MechanismError("must be a list of conditions", name="subject_to", value=subject_to)
    request = DesignRequest(minimize, tuple(subject_to), bounds, targets, instants)
    best, first_error = None, None
    chosen = _assemblies(mechanism, assemblies)
    with Count("optimizing", report=progress) as tell:
        for number, variant in chosen:
            study = Study(variant, request, clearance, iterations, seed, tell)
            try:
                best_result = study.best(starts, samples)
            except DesignError as error:
                if len(chosen) == 1:
                    raise
                first_error = first_error or error
                continue
            design = study.result(mechanism, best_result, assembly=number)
            if best is None or (design.success, -design.objective) > (best.success, -best.objective):
                best = design
    if best is None:
        assert first_error is not None
        raise first_error
    return best


def _bounds(mechanism: Mechanism, vary: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """Return the bounds of parameters as numbers.

    Raises
    ------
    MechanismError, UnitError, ExpressionError
        If a parameter does not exist, or its bounds are not two increasing numbers or not admissible.
    """
    if not isinstance(vary, Mapping) or not vary:
        raise MechanismError("must be the bounds of at least one parameter, by its name", name="vary", value=vary)
    bounds = {}
    for name, pair in vary.items():
        check_name("parameter", name, mechanism.parameters, MechanismError, name="vary")
        try:
            low, high = (_bound(mechanism, name, x) for x in (pair.split(":") if isinstance(pair, str) else pair))
        except (TypeError, ValueError):
            raise MechanismError("must be a lower and an upper bound", name=f"vary.{name}", value=pair) from None
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            message = "bounds must be two finite numbers, the lower one first"
            raise MechanismError(message, name=f"vary.{name}", value=pair)
        bounds[name] = low, high
    return bounds


def _bound(mechanism: Mechanism, name: str, entry: Any) -> float:
    """Return a bound of a parameter, a value that must be admissible for the mechanism."""
    try:
        changed = mechanism.with_parameters(**{name: entry})
        value = float(changed.parameter_values[name])
        build(with_output_drivers(changed))
    except JounceError as error:
        message = f"no mechanism can have this bound: {error}"
        raise type(error)(message, name=f"vary.{name}", value=UNSET if error.value == entry else entry) from None
    return value


def _instants(
    mechanism: Mechanism, time: TimeLike | None, bounds: Mapping[str, tuple[float, float]]
) -> Float[np.ndarray, " time"]:
    """Return the instants, which must be the same in all designs."""
    grid = mechanism.time if time is None else time
    instants = time_grid(grid, mechanism.parameter_values)
    for name, pair in bounds.items():
        for bound in pair:
            varied = time_grid(grid, mechanism.with_parameters(**{name: bound}).parameter_values)
            if varied.shape != instants.shape or (varied != instants).any():
                message = "the instants depend on this parameter, and must be the same in all designs; give time"
                raise MechanismError(message, name=f"vary.{name}", value=pair)
    if len(instants) < 2:
        raise MechanismError("an optimization needs at least two instants", name="time", value=grid)
    return instants


def _curve(name: str, entry: Any) -> PrescribedPath:
    """Return a prescribed path: points, with times if given."""
    timed = isinstance(entry, tuple) and len(entry) == 2 and np.ndim(entry[0]) == 1 and np.ndim(entry[1]) == 2
    location, expected = f"curves.{name}", "points, (points, components), or a pair of times and points, all finite"
    times = seconds(location, entry[0], MechanismError, expected) if timed else None
    points = by_component(location, entry[1] if timed else entry, MechanismError)
    points = real_numbers(location, points, MechanismError, expected)
    is_valid = points.ndim == 2 and len(points) and np.isfinite(points).all()
    if not is_valid or (times is not None and (times.shape != points.shape[:1] or not np.isfinite(times).all())):
        raise MechanismError(f"must be {expected}", name=location, value=entry)
    return PrescribedPath(points, times)


def _assemblies(mechanism: Mechanism, selection: Any) -> list[tuple[int | None, Mechanism]]:
    """Return the assemblies to try, each as its number and a mechanism with it as starting guess."""
    if selection is None:
        return [(None, mechanism)]
    assemblies = all_assemblies(mechanism, circuits=False)
    numbers = range(1, len(assemblies) + 1) if selection == "all" else selection
    if isinstance(numbers, str) or not all(isinstance(n, int) for n in numbers) or not numbers:
        raise MechanismError("must be numbers of assemblies, or 'all'", name="assemblies", value=selection)
    return [(n, dataclasses.replace(assemblies.number(n).mechanism, assembly=None)) for n in numbers]
