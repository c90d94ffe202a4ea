"""Joint coordinates that bring a tool to poses, within the limits of the joints."""

from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from jounce.base.shapes import ArrayLike, by_component
from jounce.dynamics.limits.shared_followers import SharedFollowers
from jounce.errors import RobotError
from jounce.kinematics import Status
from jounce.planning.tool_paths.joint_poses import JointPoses
from jounce.planning.tool_paths.pose_solver import FollowerRanges, solve_poses
from jounce.planning.tool_paths.task_rank import (
    CONFIGURATIONS,
    SINGULAR,
    random_coordinates,
    reachable_rows,
    task_columns,
)
from jounce.planning.tool_paths.tool_tasks import Tool, rotation_matrices, tool_of, unit_vectors
from jounce.robot.model.abstract_robot import AbstractRobot
from jounce.robot.model.arguments import checked_position, floats, whole_number
from jounce.robot.recursions.kinematics import forward_kinematics
from jounce.robot.robot import Robot

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

STATIONARY = 1e-5  # relative slope of the error at a stationary point
WIDTHS = {"position": (3,), "rotation": (3, 3), "direction": (3,)}
SOON = 16  # steps that reach most poses; the others continue with twice as many, and so on
NEAR = 1e-9  # rad, or sizes of the robot: distance from a limit at which a joint is reported as limited
FINER = 1e-3  # fraction of the tolerance at which steps end


def inverse_kinematics(
    robot: Robot,
    link: str,
    position: ArrayLike | None = None,
    orientation: "ArrayLike | Rotation | None" = None,
    *,
    direction: ArrayLike | None = None,
    axis: ArrayLike = (0.0, 0.0, 1.0),
    point: ArrayLike = (0.0, 0.0, 0.0),
    start: ArrayLike | None = None,
    starts: int = 8,
    limits: bool = True,
    tolerance: float = 1e-10,
    most_steps: int = 200,
    seed: int = 0,
) -> JointPoses:
    """Return joint coordinates that bring a tool to poses, many at once.

    The method is damped least squares (Levenberg-Marquardt, with the damping of Fan and Yuan 2005) within the limits of
    the joints, with exact Jacobians. Poses not reached from the first start are tried from further starts.

    Parameters
    ----------
    robot : Robot
        The robot.
    link : str
        The link that carries the tool.
    position : array_like of shape (..., 3), optional
        Goal of `point` in the frame of the base, m; anywhere unless given.
    orientation : array_like of shape (..., 4) or (..., 3, 3), or scipy Rotation, optional
        Orientation of the link in the frame of the base: unit quaternions, scalar first, or rotation matrices.
    direction : array_like of shape (..., 3), optional
        Goal of the direction of `axis` in the frame of the base, instead of an orientation; rotations about it are
        free.
    axis, point : array_like of shape (3,)
        Axis and point (m) of the tool in the frame of the link.
    start : array_like of shape (..., n), optional
        Initial coordinates, rad or m; the middle of the ranges of the joints unless given.
    starts : int, default 8
        Number of starts if the first fails; further starts are random within the limits. Of several solutions, the
        nearest to the first start counts.
    limits : bool, default True
        Whether to keep the limits of the joints, including those of followers.
    tolerance : float, default 1e-10
        Tolerance of the errors, in rad, or relative to the size of the robot.
    most_steps : int, default 200
        Limit on the steps from each start.
    seed : int, default 0
        Seed of the random starts.

    Returns
    -------
    JointPoses
        Coordinates with a status and errors for each pose.

    Raises
    ------
    RobotError
        If an argument does not fit the robot, or the tool has no goal, or both an orientation and a direction.

    Notes
    -----
    A redundant robot takes coordinates near the start. Along a path, `follow_tool_path` keeps to one branch.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0])
    >>> links = [jn.Link("base"), jn.Link("upper", rod), jn.Link("lower", rod)]
    >>> joints = [jn.Joint("a", "base", "upper"), jn.Joint("b", "upper", "lower", position=[1, 0, 0])]
    >>> arm = jn.Robot("arm", links, joints)
    >>> found = jn.inverse_kinematics(arm, "lower", [1.0, 1.0, 0.0], point=[1, 0, 0], start=[0.2, 1.0])
    >>> abs(found.q.round(9)).tolist()
    [0.0, 1.570796327]
    """
    tool = tool_of(robot, link, point, axis)
    goal, lead = _checked_goal(position, orientation, direction)
    lower, upper = joint_ranges(robot) if limits else (np.full(len(robot.joint_names), x) for x in (-np.inf, np.inf))
    guess = middle(lower, upper) if start is None else np.asarray(checked_position(robot, start, "start"))[..., 0, :]
    if not np.isfinite(guess).all():
        raise RobotError("must be finite", name="start")
    starts, most_steps = whole_number("starts", starts, 1), whole_number("most_steps", most_steps, 1)
    bound = float(floats("tolerance", tolerance)) if np.ndim(tolerance) == 0 else np.nan
    if not bound > 0:
        raise RobotError("must be greater than zero", name="tolerance", value=tolerance)
    try:
        lead = np.broadcast_shapes(lead, guess.shape[:-1])
    except ValueError:
        message = f"does not fit the poses, of shape {lead}: its shape is {guess.shape}"
        raise RobotError(message, name="start") from None
    scale = coordinate_scale(robot, tool)
    count, n = int(np.prod(lead)), len(lower)
    if not count:
        raise RobotError("there is no pose to reach; give at least one", value=f"shape {lead}")
    guess = np.broadcast_to(guess, (*lead, n)).reshape(count, n)
    goal = {kind: np.broadcast_to(x, (*lead, *WIDTHS[kind])).reshape(count, *WIDTHS[kind]) for kind, x in goal.items()}
    followers = follower_ranges(robot, tool, limits)
    result = poses_within(robot, tool, goal, (lower, upper, scale), followers, guess, starts, bound, most_steps, seed)
    anywhere = random_coordinates(lower, upper, scale, CONFIGURATIONS, seed)
    basis = task_columns(robot, tool, anywhere, tuple(goal), scale)
    return _result(
        robot, link, point, result, goal, lead, bound, (lower, upper, scale), followers, reachable_rows(basis)[1], tool
    )


def poses_within(
    robot: Robot,
    tool: Tool,
    goal: dict[str, Any],
    ranges: tuple[Any, Any, Any],
    followers: FollowerRanges,
    guess: Float[np.ndarray, "count n"],
    starts: int = 8,
    bound: float = 1e-10,
    most_steps: int = 200,
    seed: int = 0,
) -> list[np.ndarray]:
    """Return the results of `solve_poses` within ranges of the coordinates, from the first start or further starts."""
    lower, upper, scale = ranges
    constants = (tool, lower / scale, upper / scale, scale, followers, np.float64(bound * FINER))

    def solutions(guess: np.ndarray, chosen: Any) -> list[np.ndarray]:
        targets = [x[chosen] for x in goal.values()]
        result = _marched(robot, guess, targets, constants, tuple(goal), min(most_steps, SOON))
        steps, slow = SOON, np.flatnonzero(result[3] > 0)
        while slow.size and steps < most_steps:  # fewer and fewer poses continue
            steps_left = min(steps, most_steps - steps)
            continued = _marched(robot, result[0][slow], [x[slow] for x in targets], constants, tuple(goal), steps_left)
            for array, chunk in zip(result, continued, strict=True):
                array[slow] = chunk
            steps, slow = steps + steps_left, slow[continued[3] > 0]
        return result

    result = solutions(guess, slice(None))
    failures = np.flatnonzero(~(result[1] <= bound**2))
    if failures.size and starts > 1:
        guesses = random_coordinates(lower, upper, scale, (starts - 1) * len(failures), seed)
        retries = solutions(guesses, np.repeat(failures, starts - 1))
        trials = [x.reshape(len(failures), starts - 1, *x.shape[1:]) for x in retries]
        distance = (np.abs(trials[0] - guess[failures][:, None]) / scale).max(axis=-1)
        valid = trials[1] <= bound**2
        choice = np.where(valid.any(1), np.argmin(np.where(valid, distance, np.inf), 1), np.argmin(trials[1], 1))
        rows = np.arange(len(failures))
        nearer = trials[1][rows, choice] < result[1][failures]
        for array, chunk in zip(result, trials, strict=True):
            array[failures[nearer]] = chunk[rows, choice][nearer]
    return result


def _marched(robot: Robot, guess: Any, targets: Any, constants: Any, kinds: tuple[str, ...], steps: int) -> list[Any]:
    arrays = (guess[:, None], *(x[:, None] for x in targets))
    return [np.asarray(x)[:, 0] for x in solve_poses(robot, arrays, (*constants, np.int64(steps)), (kinds,))]


def _result(
    robot: Robot,
    link: str,
    point: Any,
    solved: Any,
    goal: Any,
    lead: Any,
    bound: float,
    ranges: Any,
    followers: FollowerRanges,
    rank: int,
    tool: Tool,
) -> JointPoses:
    q, square, level, _, values, shares = solved
    lower, upper, scale = ranges
    status = np.where(level <= STATIONARY, int(Status.NOT_ASSEMBLED), int(Status.NOT_CONVERGED))
    status = np.where(square <= bound**2, int(Status.OK), status)
    distance, angle = _away(robot, link, point, q, goal, tool)
    values, shares = values[:, :rank], shares[:, max(rank - 1, 0)]
    singular = values[:, -1] <= SINGULAR * values[:, 0] if rank else np.ones(len(q), bool)
    x = q / scale
    place = x @ followers.weights.T + followers.offset
    limited = np.concatenate(
        [_at_ends(x, lower / scale, upper / scale), _at_ends(place, followers.lower, followers.upper)], 1
    )
    q_reached = np.where((status == Status.OK)[:, None], q, np.nan)
    arrays = (q_reached, status, q, distance, angle, singular, values, shares)
    shaped = [x.reshape((*lead, *x.shape[1:])) for x in arrays]
    names = ("q", "status", "closest", "distance", "angle", "singular", "singular_values", "shares")
    solved = dict(zip(names, shaped, strict=True))
    limited_names = (*robot.joint_names, *(SharedFollowers.of(robot).names if len(followers.offset) else ()))
    limited = limited.reshape((*lead, len(limited_names)))
    return JointPoses(**solved, joint_names=robot.joint_names, limited=limited, limited_names=limited_names)


def _at_ends(x: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    return (x <= lower + NEAR) | (x >= upper - NEAR)


def _away(robot: Robot, link: str, point: Any, q: Any, goal: Any, tool: Tool) -> tuple[Any, Any]:
    """Return the position errors of tools, m, and their orientation errors, rad."""
    motion = forward_kinematics(robot, q[:, None], link, point)
    position, rotation = np.asarray(motion.position)[:, 0], np.asarray(motion.rotation)[:, 0]
    distance = np.linalg.norm(position - goal["position"], axis=-1) if "position" in goal else np.zeros(len(q))
    chord = np.zeros(len(q))
    if "rotation" in goal:
        chord = np.linalg.norm(rotation - goal["rotation"], axis=(1, 2)) / np.sqrt(2.0)
    if "direction" in goal:
        chord = np.linalg.norm(rotation @ tool.axes[:, 2] - goal["direction"], axis=-1)
    return distance, 2 * np.arcsin(np.minimum(0.5 * chord, 1.0))


def _checked_goal(position: Any, orientation: Any, direction: Any) -> tuple[dict[str, Any], tuple[int, ...]]:
    """Return the goals of a tool by kind, and the shape of the batch."""
    if orientation is not None and direction is not None:
        raise RobotError("give an orientation or a direction, not both", name="direction")
    goal: dict[str, Any] = {}
    if position is not None:
        goal["position"] = np.asarray(floats("position", by_component("position", position, RobotError)))
        if goal["position"].ndim < 1 or goal["position"].shape[-1] != 3:
            raise RobotError(f"must have the shape (..., 3), not {goal['position'].shape}", name="position")
        if not np.isfinite(goal["position"]).all():
            raise RobotError("must be finite", name="position")
    if orientation is not None:
        goal["rotation"] = rotation_matrices("orientation", orientation)
    if direction is not None:
        goal["direction"] = unit_vectors("direction", direction)
    if not goal:
        raise RobotError("no goal for the tool: give a position, an orientation or a direction")
    leads = {kind: x.shape[: x.ndim - len(WIDTHS[kind])] for kind, x in goal.items()}
    try:
        return goal, np.broadcast_shapes(*leads.values())
    except ValueError:
        message = f"positions and orientations are not of the same number: {', '.join(map(str, leads.values()))}"
        raise RobotError(message, name="orientation") from None


def follower_ranges(robot: Robot, tool: Tool, limits: bool = True) -> FollowerRanges:
    """Return the ranges of joints that follow several, in scaled coordinates; of none without `limits`."""
    followers = SharedFollowers.of(robot)
    turns = np.array([joint.turning for joint in followers.joints], bool)
    scale, (lower, upper) = np.where(turns, 1.0, float(tool.length)), followers.ranges
    weights = followers.weights * coordinate_scale(robot, tool) / scale[:, None]
    ranges = FollowerRanges(weights, followers.offset / scale, lower / scale, upper / scale)
    return ranges if limits else FollowerRanges(*(x[:0] for x in ranges))


def joint_ranges(robot: AbstractRobot) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return the ranges of the coordinates, infinite without limits."""
    limits = robot.limits.values()
    lower = np.array([-np.inf if limit.lower is None else limit.lower for limit in limits], float)
    upper = np.array([np.inf if limit.upper is None else limit.upper for limit in limits], float)
    return lower, upper


def middle(lower: np.ndarray, upper: np.ndarray) -> Float[np.ndarray, " n"]:
    """Return the middle of ranges; for an unbounded range zero, or the end nearest to zero."""
    is_bounded = np.isfinite(lower) & np.isfinite(upper)
    ends = np.where(is_bounded, (lower, upper), 0.0)
    return np.where(is_bounded, 0.5 * ends[0] + 0.5 * ends[1], np.clip(0.0, lower, upper))


def coordinate_scale(robot: AbstractRobot, tool: Tool) -> Float[np.ndarray, " n"]:
    """Return the unit of each coordinate: 1 rad, or the size of the robot."""
    turns = np.array([robot.joints[name].turning for name in robot.joint_names])
    return np.where(turns, 1.0, float(tool.length))
