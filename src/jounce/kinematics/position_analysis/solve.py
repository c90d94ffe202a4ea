"""Position analysis: the motion of a driven mechanism over a time grid."""

import numbers
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from jounce.base.activity import Count
from jounce.errors import AssemblyError, MechanismError, MobilityError, SolveError
from jounce.execution.backends import joined
from jounce.execution.background import prepare_later
from jounce.execution.store.programs import expect
from jounce.execution.threads import thread_count
from jounce.kinematics.assembly.assemble import assemble
from jounce.kinematics.continuation.path_following import FollowedPath, follow, history_of
from jounce.kinematics.continuation.solver import NO_GRID, Solver
from jounce.kinematics.curves.choice import chosen
from jounce.kinematics.position_analysis.chunked_motion import ChunkedMotion
from jounce.kinematics.position_analysis.curve_ends import beyond_end, cut_at_ends, ends_of
from jounce.kinematics.position_analysis.grid_blocks import LONG_GRID
from jounce.kinematics.position_analysis.grid_storage import solve_grid
from jounce.kinematics.position_analysis.idle_holding import holding_idle
from jounce.kinematics.position_analysis.limit_position_messages import dead_end_words
from jounce.kinematics.results.actuation import actuated
from jounce.kinematics.results.motion import Motion
from jounce.kinematics.results.output_programs import prepare_outputs
from jounce.kinematics.sensitivity.sensitivities import differentiable_motion, given_instants
from jounce.kinematics.sensitivity.traced_motion import TracedMotion
from jounce.kinematics.status import Status
from jounce.mechanism import Mechanism, Model, build, check_mechanism, time_grid, with_output_drivers
from jounce.mechanism.building.belts import check_room
from jounce.mechanism.building.builder import group_rows
from jounce.mechanism.building.preconditions import check_holonomic, concrete, concrete_or
from jounce.mechanism.laws.cam_laws import check_turns
from jounce.mechanism.laws.law_checks import check_laws
from jounce.mechanism.laws.output_drivers import output_laws
from jounce.mechanism.outputs.base import lost_orders
from jounce.mechanism.time import Instants, TimeLike, instants_of
from jounce.mechanism.transmissions.axis_angles import lost_count

LOWEST_ORDER = 4  # of the internal jets: predictions need derivatives even if the user wants positions only
HIGHEST_ORDER = 30  # of derivatives of outputs
HIGHEST_OF_MOTION = HIGHEST_ORDER + 2  # forces are two derivatives shorter than the motion
LARGEST_TOLERANCE = 1e-2


def _differentiated(solve: Callable[..., Motion], given: Mapping[str, Any]) -> Motion:
    """Solve a mechanism with values that JAX traces."""
    mechanism = given["mechanism"]
    check_mechanism(mechanism)
    options = {name: value for name, value in given.items() if name not in ("mechanism", "time", "order", "strict")}
    order = checked_settings(mechanism, given.get("order", 4), options.get("tolerance", 1e-12))
    instants = given_instants(mechanism, given.get("time"), time_grid)
    levels = max(order + lost_orders(mechanism.outputs.values()), LOWEST_ORDER) + 1

    def solved(mechanism: Mechanism, known: bool) -> Motion:
        return solve(mechanism, instants, order, **options, strict=known and given.get("strict", True))

    arrays, models = differentiable_motion(mechanism, instants, levels, solved)
    return TracedMotion(mechanism, models, instants, order, arrays)


@holding_idle(lambda: solve)
@concrete_or(_differentiated)
def solve(
    mechanism: Mechanism,
    time: TimeLike | None = None,
    order: int = 4,
    *,
    tolerance: float = 1e-12,
    refine: bool = True,
    strict: bool = True,
    progress: Callable[[int, int], None] | None = None,
    threads: int | None = None,
    keep: bool | None = None,
) -> Motion:
    """Return the motion of a driven mechanism and its time derivatives up to any order, exact to rounding.

    Positions are found by Newton-Raphson; all derivatives at an instant follow from one factorization of the
    Jacobian (Sommer 2024, equations 1-8 and all orders beyond).

    Parameters
    ----------
    mechanism : Mechanism
        Joints and drivers must leave no degree of freedom; redundant constraints must agree.
    time : array_like of shape (time,), optional
        Strictly increasing instants, s; those of the mechanism by default.
    order : int, default 4
        Highest derivative of the outputs: 0 position, 3 jerk, 4 jounce, up to 30.
    tolerance : float, default 1e-12
        Largest Newton correction of an accepted position, in rad, or in sizes of the mechanism.
    refine : bool, default True
        Whether to correct accepted positions once more, to rounding. Otherwise their errors may reach the tolerance.
    strict : bool, default True
        Whether to raise if an instant fails. Otherwise its results are NaN and `Motion.status` says why.
    progress : callable, optional
        Called with the number of instants done and their total.
    threads : int, optional
        Number of threads for grids of more than a thousand instants. The default is the environment variable
        ``JOUNCE_THREADS`` or the number of cores of the process. Results do not depend on it.
    keep : bool, optional
        Whether to store the motion of all bodies in addition to the outputs, for later requests of points, energies or
        reactions; by default, for up to 65,536 instants. A motion that is not stored is computed again on request.

    Returns
    -------
    Motion
        Outputs, their derivatives and the status of every instant.

    Raises
    ------
    MechanismError
        If the mechanism, the time grid or the order is not valid.
    AssemblyError
        If the bodies cannot be assembled at the first instant.
    MobilityError
        If degrees of freedom are left, or the start is a singular position.
    SolveError
        If the motion cannot be followed to an instant (with `strict`); the error holds the motion so far.
    UnsupportedError
        If JAX traces anything but values of the mechanism. Outputs can be differentiated by those values.

    Examples
    --------
    >>> import jounce as jn
    >>> motion = jn.solve(jn.load("examples/four_bar.yaml"), order=6)
    >>> motion.dataset["psi"].dims
    ('time', 'derivative')
    """
    order = checked_settings(mechanism, order, tolerance)
    count = thread_count(threads)
    instants = time_grid(mechanism.time if time is None else time, mechanism.parameter_values)
    with Count("solving", report=progress) as report:
        solver, path = _followed(mechanism, instants, order, tolerance, refine=refine)
        solution = solve_grid(solver, path, instants, report, count, keep=keep)
    state = solution.coordinates, solution.outputs
    outcome = solution.status, solution.faults, path.change_points
    backend = _backend(solver, path, instants)
    _check_count(solver.model, path)
    history: Any = partial(history_of, path.anchors)  # made when turns are requested
    motion = actuated(Motion(mechanism, solver.model, instants, order, state, *outcome, history, backend))
    check_room(motion)
    if strict:
        raise_for_status(motion)
    return motion


@holding_idle(lambda: solve)
@concrete
def solve_in_chunks(
    mechanism: Mechanism,
    time: TimeLike | None = None,
    order: int = 4,
    *,
    tolerance: float = 1e-12,
    refine: bool = True,
    progress: Callable[[int, int], None] | None = None,
    threads: int | None = None,
) -> ChunkedMotion:
    """Follow a motion as `jounce.solve` does, and solve its instants chunk by chunk, as the caller iterates.

    Memory holds one chunk of 65,536 instants at a time, and the anchors of the motion, whose number grows with the
    distance that the mechanism moves, not with the number of instants.

    Parameters
    ----------
    mechanism, time, order, tolerance, refine, progress, threads
        As those of `jounce.solve`.

    Returns
    -------
    ChunkedMotion
        An iterable of motions; an instant that fails is NaN in its chunk, and nothing is raised for it.

    Raises
    ------
    MechanismError, AssemblyError, MobilityError, SolveError
        As `jounce.solve`, for errors found before the first chunk.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.kinematics import solve_in_chunks
    >>> fine = jn.TimeGrid(start=0, stop=2, count=100_001)
    >>> motion = solve_in_chunks(jn.load("examples/four_bar.yaml"), fine, order=1)
    >>> [(len(part.time), round(float(part.outputs["psi"][:, 0].max()), 4)) for part in motion]
    [(65536, 2.6022), (34465, 2.6436)]
    """
    order = checked_settings(mechanism, order, tolerance)
    count = thread_count(threads)
    instants = instants_of(mechanism.time if time is None else time, mechanism.parameter_values)
    solver, path = _followed(mechanism, instants, order, tolerance, refine=refine)
    backend = _backend(solver, path, instants)
    return ChunkedMotion(mechanism, (solver, path), instants, order, progress, count, backend)


def checked_settings(mechanism: Mechanism, order: Any, tolerance: float) -> int:
    """Return the order as an int, or raise MechanismError if mechanism, order or tolerance is invalid."""
    check_mechanism(mechanism)
    check_holonomic(mechanism, "a motion that is solved")
    order = checked_order(order)
    for name, output in mechanism.outputs.items():
        if order + output.lost_orders > HIGHEST_OF_MOTION:
            message = f"needs the motion to order {order + output.lost_orders}, and {HIGHEST_OF_MOTION} is the highest"
            raise MechanismError(
                f"{message}: ask for derivatives of a lower order", name=f"outputs.{name}", value=order
            )
    if not (isinstance(tolerance, numbers.Real) and 0 < tolerance <= LARGEST_TOLERANCE):
        message = f"the tolerance must be a number above zero and at most {LARGEST_TOLERANCE:g}"
        raise MechanismError(message, name="tolerance", value=tolerance)
    return order


def _followed(
    mechanism: Mechanism, instants: Instants, order: int, tolerance: float, *, refine: bool
) -> tuple[Solver, FollowedPath]:
    """Return the solver of a grid, and the motion followed from its first instant to its last."""
    first, last = float(instants[0]), float(instants[-1])
    extra_order = lost_orders(mechanism.outputs.values())
    of_forces = any(output.of_forces for output in mechanism.outputs.values())
    check_laws(mechanism, np.array([first, last]), order + extra_order, forces=of_forces)
    guessed = build(chosen(with_output_drivers(mechanism), first))
    expect(len(instants))
    settings = max(order + extra_order, LOWEST_ORDER), float(tolerance), refine, order
    if not guessed.system.rank_is_open:  # otherwise the program depends on the assembled bodies
        prepare_later(Solver(guessed, *settings).prepare, "take_steps", guessed.system, settings[0])
    try:
        model, coordinates = assemble(guessed, first, tolerance)
    except (AssemblyError, MobilityError) as error:
        for name, motion in output_laws(mechanism).items():
            error.message += f"; the driver {name} follows from the output {motion.output}, which must determine it"
        raise
    curves = ends_of(model)
    if fault := beyond_end(curves, coordinates):
        raise SolveError(_failure(first, Status.END_OF_CURVE, fault), status=Status.END_OF_CURVE)
    check_turns(mechanism, model, coordinates, first)
    solver = Solver(model, *settings)
    prepare_outputs(mechanism, model, solver.order)
    start = solver.run_at(coordinates, first)
    solved_instants = np.asarray(instants) if len(instants) <= LONG_GRID else NO_GRID
    path = follow(solver, start, last, last - first, grid=solved_instants)
    if path.anchors:
        path = cut_at_ends(path, curves, solved_instants)
    else:
        raise SolveError(_failure(first, path.status, path.fault), status=path.status)
    return solver, path


def _check_count(model: Model, path: FollowedPath) -> None:
    """Raise SolveError where spatial gears have lost count of their turns on the way."""
    groups = [group for group in model.system.groups if getattr(group.element, "whole", None) is not None]
    history = history_of(path.anchors) if groups else None
    miscount = None if history is None else lost_count(model.system.groups, history)
    if miscount is not None:
        group, instance, instant = miscount
        name = model.rows[group_rows(model)[group]][instance]
        message = (
            f"{name} has lost count of its turns before t = {instant:g} s: solve to a higher order, or use a ratio"
        )
        raise SolveError(f"{message} of smaller whole numbers", status=Status.BRANCH_JUMP)


def _backend(solver: Solver, path: FollowedPath, instants: Instants) -> str:
    """Return the backends that followed a motion and that solve the instants of a long grid."""
    return joined({*path.backends, *([solver.backend] if len(instants) > LONG_GRID else [])})


def raise_for_status(motion: Any) -> None:
    """Raise SolveError, with the first failed instant and a remedy, unless all instants were solved."""
    failed = np.flatnonzero(motion.status)  # OK is zero
    if not failed.size:
        return
    first = int(failed[0])
    status = Status(int(motion.status[first]))
    message = _failure(float(motion.time[first]), status, motion.faults.get(first, ""))
    total = len(motion.time)
    if isinstance(motion, Motion) and (hint := dead_end_words(motion, first)):
        message += f"; {hint}"
    solved = f"{total - failed.size} of {total} instants were solved"
    raise SolveError(f"{message} ({solved})", motion=motion, status=status)


def checked_order(order: Any) -> int:
    """Return the order of derivatives as an int, or raise MechanismError if it is invalid."""
    is_integer = isinstance(order, numbers.Integral) and not isinstance(order, bool)
    if not is_integer or not 0 <= int(order) <= HIGHEST_ORDER:
        message = f"the order of derivatives must be a whole number from 0 to {HIGHEST_ORDER}"
        raise MechanismError(message, name="order", value=order)
    return int(order)


def _failure(instant: float, status: Status, fault: str) -> str:
    """Return a message with the instant of a failure, its kind, and a remedy."""
    place = f"t = {instant:g} s" + (f", {fault}" if fault else "")
    return f"{place}: {status.name.lower().replace('_', ' ')}: {status.advice}"
