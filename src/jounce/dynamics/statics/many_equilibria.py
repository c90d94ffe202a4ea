"""Equilibria of a mechanism or a robot from many starts: a multistart Newton search."""

from collections.abc import Mapping, Sequence

import numpy as np

from jounce.base.shapes import Real, Refused
from jounce.dynamics.statics.equilibrium_search import load_scale, rest_point, search
from jounce.dynamics.statics.operating_point import OperatingPoint
from jounce.dynamics.statics.static_equilibrium import Equilibrium, as_mechanism, at_rest_from, equilibrium_of
from jounce.errors import MechanismError, whole_number
from jounce.kinematics.assembly.axis_directions import axis_signs
from jounce.kinematics.assembly.initial_revolutions import Coordinates
from jounce.mechanism import Mechanism, build
from jounce.mechanism.building.preconditions import concrete
from jounce.robot import Robot
from jounce.robot.closed_loops.closures import GivenCoordinates, given_coordinates

SAME = 1e-6  # rad, or multiples of the size of the mechanism: positions this close count as one


@concrete
def equilibria(
    mechanism: Mechanism | Robot,
    time: Real | Refused | None = None,
    *,
    starts: int | Refused = 100,
    seed: int | Refused = 0,
    without: Sequence[str] = (),
    q: GivenCoordinates = None,
    hold: str | Sequence[str] = (),
    torques: Mapping[str, float] | None = None,
    drives: bool = True,
) -> tuple[Equilibrium, ...]:
    """Return all equilibria that Newton's method finds from many starts, of every assembly of the mechanism.

    Each start is a random position of all bodies, then assembled, or random joint coordinates of a robot within their
    limits. Equilibria within 1e-6 rad and 1e-6 of the size of the mechanism count as one; an indifferent equilibrium
    represents a family. Assemblies in which a body is reversed in a hinge or a guide are excluded.

    Parameters
    ----------
    mechanism, time, without, q, hold, torques, drives
        As for `equilibrium`.
    starts : int, default 100
        Number of random positions in addition to the starting guess.
    seed : int, default 0
        Seed of the random positions.

    Returns
    -------
    tuple of Equilibrium
        Stable ones first, then in the order in which they were found; empty if none was found.

    Raises
    ------
    MechanismError, AssemblyError, SolveError
        As for `equilibrium`, except that no error is raised if none exists.

    Examples
    --------
    >>> import jounce as jn
    >>> pendulum = jn.load("examples/simple_pendulum.yaml")
    >>> [found.stability for found in jn.dynamics.equilibria(pendulum, starts=5)]
    ['stable', 'unstable']
    """
    count = whole_number("starts", starts, error=MechanismError)
    random = np.random.default_rng(whole_number("seed", seed, error=MechanismError))
    robot = mechanism if isinstance(mechanism, Robot) else None
    start = at_rest_from(as_mechanism(mechanism, q, hold, torques, drives), time, without, "newton")
    points = (
        _closed(start, _random_poses(start, random))
        if robot is None
        else _closed(start, _random_coordinates(robot, start, random, q, hold, drives))
        for _ in range(count)
    )
    results: list[Equilibrium] = []
    for point in (start, *points):
        if point is None:
            continue
        for settle in (True, False):
            outcome = search(point, settle=settle)
            if outcome.balanced and not any(_same(outcome.point, result.point) for result in results):
                results.append(equilibrium_of(outcome, start, of_robot=robot is not None))
    order = ("stable", "held", "indifferent", "undetermined", "unstable")
    return tuple(sorted(results, key=lambda one: order.index(one.stability)))


def _random_coordinates(
    robot: Robot,
    start: OperatingPoint,
    random: np.random.Generator,
    q: GivenCoordinates,
    hold: str | Sequence[str],
    drives: bool,
) -> Coordinates:
    """Return the positions of the bodies of a robot for random coordinates of the joints that are not held."""
    values, limits = given_coordinates(robot, q), robot.limits
    held_joints = robot.joint_names if hold == "all" else (hold,) if isinstance(hold, str) else hold
    for k, name in enumerate(robot.joint_names):
        joint = robot.joints[name]
        reach = np.pi if joint.turning else start.model.length
        ends = (limits[name].lower, limits[name].upper)
        low, high = (limit if limit is not None else reach * sign for limit, sign in zip(ends, (-1, 1), strict=True))
        if name not in held_joints:
            values[k] = random.uniform(low, high)
    opened = robot.opened().mechanism(values, drives=drives)
    return {name: np.asarray(x) for name, x in build(opened).guess.items()}


def _random_poses(start: OperatingPoint, random: np.random.Generator) -> Coordinates:
    """Return random poses of all bodies."""
    model = start.model
    shape = (len(model.bodies), 1)
    shift = random.uniform(-1.0, 1.0, (model.pose_type.shifts, *shape)) * model.length
    turn = random.uniform(-np.pi, np.pi, (model.pose_type.turns, *shape))
    return start.displaced(np.pad(np.concatenate([shift, turn]), ((0, 0), (1, 0), (0, 0))))


def _closed(start: OperatingPoint, coordinates: Coordinates) -> OperatingPoint | None:
    """Return the mechanism assembled from a position, or None if that fails or reverses a part."""
    system, assembled = start.model.system, start.closed(coordinates)
    if assembled is None or not np.array_equal(axis_signs(system, assembled), axis_signs(system, start.place)):
        return None
    return rest_point(start.mechanism, start.model, assembled, start.instant)


def _same(first: OperatingPoint, second: OperatingPoint) -> bool:
    """Return whether two positions are equal up to rounding; revolutions count only if a force depends on them."""
    a, b = first.coordinates, second.coordinates
    if np.abs(a["position"][0] - b["position"][0]).max() > SAME * first.model.length:
        return False
    if "angle" in a:
        is_turned = np.abs(np.sin((a["angle"][0] - b["angle"][0]) / 2)).max() > SAME
    else:
        is_turned = (1 - np.abs((a["quaternion"][0] * b["quaternion"][0]).sum(axis=0))).max() > SAME**2
    return not is_turned and bool(np.abs(first.loads - second.loads).max() <= SAME * load_scale(first))
