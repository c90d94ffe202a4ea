"""From a mechanism and a time grid to its motion."""

import numbers
from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.errors import MechanismError, SolveError
from jounce.kinematics.assembly import assemble
from jounce.kinematics.grid import LONG_GRID
from jounce.kinematics.long_grids import solve_grid
from jounce.kinematics.motion import Motion
from jounce.kinematics.path_following import NO_GRID, PASSABLE, Anchor, Solver, follow
from jounce.kinematics.status import Status
from jounce.kinematics.threads import thread_count
from jounce.mechanism import Mechanism, build, check_mechanism, time_grid
from jounce.mechanism.axis_angles import measures_angle
from jounce.mechanism.law_checks import check_laws
from jounce.mechanism.preconditions import concrete
from jounce.mechanism.system import Group

LOWEST_ORDER = 4  # of the jets inside: predictions need some, also where the user wants positions only
HIGHEST_ORDER = 30
LARGEST_TOLERANCE = 1e-2


@concrete
def solve(
    mechanism: Mechanism,
    time: Any = None,
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

    Positions are found by Newton-Raphson; all derivatives of an instant follow from one factorisation of the
    Jacobian there (Sommer 2024, equations 1-8 and all orders beyond).

    Parameters
    ----------
    mechanism : Mechanism
        Drivers and joints must leave no degree of freedom, and none may be redundant.
    time : array_like of shape (time,), optional
        Strictly increasing instants, s; those of the mechanism unless given.
    order : int, default 4
        Highest derivative of the outputs: 0 position, 3 jerk, 4 jounce, up to 30.
    tolerance : float, default 1e-12
        Largest Newton correction of an accepted position, in rad, or in sizes of the mechanism.
    refine : bool, default True
        Correct accepted positions once more, to rounding. Without, they stay as far off as the tolerance lets them.
    strict : bool, default True
        Raise if an instant fails. Otherwise it is NaN and `Motion.status` says why.
    progress : callable, optional
        Called with the number of instants done and their total.
    threads : int, optional
        That solve a grid of more than a thousand instants: as many as the process has cores, or as the environment
        variable ``JOUNCE_THREADS`` says, unless given. Results do not depend on it.
    keep : bool, optional
        Whether to keep the motion of all bodies beside the outputs, for points, energies or reactions asked for later;
        unless given, up to 65,536 instants. What is not kept is computed again when it is asked for.

    Returns
    -------
    Motion
        Outputs, their derivatives and the status of every instant.

    Raises
    ------
    MechanismError
        If the mechanism, the time grid or the order is not valid.
    AssemblyError
        If the bodies cannot be put together at the first instant.
    MobilityError
        If degrees of freedom are left, or constraints are redundant.
    SolveError
        If the motion cannot be followed to an instant (with `strict`); it holds the motion up to there.

    Examples
    --------
    >>> import jounce as jn
    >>> motion = jn.solve(jn.load("examples/four_bar.yaml"), order=6)
    >>> motion.dataset["psi"].dims
    ('time', 'derivative')
    """
    check_mechanism(mechanism)
    order = checked_order(order)
    if not (isinstance(tolerance, numbers.Real) and 0 < tolerance <= LARGEST_TOLERANCE):
        message = f"the tolerance must be a number above zero and at most {LARGEST_TOLERANCE:g}"
        raise MechanismError(message, name="tolerance", value=tolerance)
    count = thread_count(threads)
    instants = time_grid(mechanism.time if time is None else time, mechanism.parameter_values)
    lost = max((output.lost_orders for output in mechanism.outputs.values()), default=0)
    check_laws(mechanism, instants, order + lost, forces=any(output.of_forces for output in mechanism.outputs.values()))
    model, coordinates = assemble(build(mechanism), instants[0], tolerance)
    solver = Solver(model, max(order + lost, LOWEST_ORDER), float(tolerance), refine, order)
    first = _first(solver, coordinates, instants[:1])
    on_the_way = instants if len(instants) <= LONG_GRID else NO_GRID
    path = follow(solver, first, instants[-1], instants[-1] - instants[0], grid=on_the_way)
    found = solve_grid(solver, path, instants, progress, count, keep=keep)
    change_points = np.array([point.instant for point in path.change_points])
    state, outcome = (found.coordinates, found.outputs), (found.status, found.faults)
    motion = Motion(mechanism, model, instants, order, state, *outcome, change_points, path.history())
    if strict:
        raise_for_status(motion)
    return motion


def raise_for_status(motion: Motion) -> None:
    """Raise SolveError, with the first instant that failed and what to do, unless all were solved."""
    failed = np.flatnonzero(motion.status != Status.OK)
    if not failed.size:
        return
    first = int(failed[0])
    status = Status(int(motion.status[first]))
    fault = motion.faults.get(first, "")
    where = f"t = {motion.time[first]:g} s" + (f", {fault}" if fault else "")
    total = len(motion.time)
    message = f"{where}: {_words(status)}: {status.advice}"
    solved = f"{total - failed.size} of {total} instants were solved"
    raise SolveError(f"{message} ({solved})", motion=motion, status=status)


def checked_order(order: Any) -> int:
    """Return the order of derivatives, or raise MechanismError."""
    whole = isinstance(order, numbers.Integral) and not isinstance(order, bool)
    if not whole or not 0 <= int(order) <= HIGHEST_ORDER:
        message = f"the order of derivatives must be a whole number from 0 to {HIGHEST_ORDER}"
        raise MechanismError(message, name="order", value=order)
    return int(order)


def _first(solver: Solver, coordinates: dict[str, np.ndarray], instant: Float[np.ndarray, " 1"]) -> Anchor:
    """Solve the first instant with its derivatives, from its assembled position."""
    levels = solver.order + 1
    still = {name: np.stack([x, *[np.zeros_like(x)] * (levels - 1)]) for name, x in coordinates.items()}
    angles = tuple(_known_angles(group, levels) for group in solver.model.system.outputs)
    arrival = solver((still, angles, np.zeros(1)), np.zeros(1), instant, survey=True)
    status = Status(int(arrival.status[0]))
    if status not in PASSABLE:
        where = f"t = {instant[0]:g} s, {solver.fault(arrival, 0)}"
        raise SolveError(f"{where}: {_words(status)}: {status.advice}", status=status)
    return Anchor.of(arrival, instant[0])


def _known_angles(group: Group, levels: int) -> Float[np.ndarray, "order 1 instance 1"]:
    """Return what is known of angles at the first instant: whole turns, where the assembly counted them."""
    known = np.zeros((levels, 1, group.instances, 1))
    if measures_angle(group):
        known[0, 0] = group.element.datum.angle
    return known


def _words(status: Status) -> str:
    return status.name.lower().replace("_", " ")
