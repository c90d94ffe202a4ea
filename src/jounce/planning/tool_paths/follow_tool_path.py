"""Joint motion along a path of a tool, with all derivatives, also for redundant robots: Negrean 2025, equation 60."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from jounce.base.shapes import ArrayLike
from jounce.dynamics.limits.shared_followers import SharedFollowers
from jounce.errors import JounceError, RobotError, SingularityError, check_name
from jounce.jet.derivatives import taylor_coefficients
from jounce.kinematics import Status
from jounce.planning.tool_paths.inverse_kinematics import (
    coordinate_scale,
    follower_ranges,
    joint_ranges,
    middle,
    poses_within,
)
from jounce.planning.tool_paths.path_equations import PathEquations
from jounce.planning.tool_paths.path_marching import Nodes, followed
from jounce.planning.tool_paths.task_rank import CONFIGURATIONS, random_coordinates, reachable_rows, task_columns
from jounce.planning.tool_paths.tool_path import ToolPath
from jounce.planning.tool_paths.tool_path_motion import ToolPathMotion
from jounce.planning.tool_paths.tool_tasks import tool_of
from jounce.robot.model.arguments import floats
from jounce.robot.robot import Robot
from jounce.trajectory.joint_trajectory import JointTrajectory
from jounce.trajectory.labels import in_order

REACHED = 1e-10  # rad, or relative to the size of the robot


def follow_tool_path(
    robot: Robot,
    link: str,
    path: ToolPath,
    time: ArrayLike | None = None,
    order: int = 4,
    *,
    axis: ArrayLike = (0.0, 0.0, 1.0),
    point: ArrayLike = (0.0, 0.0, 0.0),
    start: ArrayLike | None = None,
    hold: Mapping[str, Any] | None = None,
    posture: ArrayLike | None = None,
    weights: ArrayLike | None = None,
    limits: bool = True,
    strict: bool = True,
) -> ToolPathMotion:
    """Return the joint coordinates that lead a tool along a path, with derivatives of any order.

    At each instant one factored matrix gives all derivatives, order after order. The motion follows the branch of the
    start: the coordinates cannot change to another branch over any interval.

    Parameters
    ----------
    robot : Robot
        The robot.
    link : str
        The link that carries the tool.
    path : ToolPath
        Path of the tool.
    time : array_like of shape (time,), optional
        Instants within the path, s; 201 evenly spaced ones unless given.
    order : int, default 4
        Highest derivative.
    axis, point : array_like of shape (3,)
        Axis and point (m) of the tool in the frame of the link. The path gives the direction of the axis.
    start : array_like of shape (n,), optional
        Coordinates near those at the first instant, rad or m, which select the branch; from `inverse_kinematics` unless
        given.
    hold : mapping of str to law, optional
        Joints with a law of their own: a number, an expression of ``t``, or a motion.
    posture : array_like of shape (n,), optional
        Posture of a redundant robot, to which the coordinates are as near as the task allows. The coordinates then
        depend on the path only, so that a closed path ends where it began. The middle of the ranges of the joints
        unless given.
    weights : array_like of shape (n,), optional
        Weights of the squared distances of the joints from the posture; 1 unless given.
    limits : bool, default True
        Whether coordinates outside the ranges of the joints are failures.
    strict : bool, default True
        Whether to raise an error if the tool cannot follow the path; otherwise those instants are NaN.

    Returns
    -------
    ToolPathMotion
        Coordinates with derivatives, and a status for each instant.

    Raises
    ------
    RobotError
        If an argument does not fit the robot, the start cannot be reached, or a joint leaves its range (with `strict`).
    SingularityError
        If the path runs into a singular position (with `strict`); the message has the joints that lose a motion.
    TrajectoryError
        If an instant is outside the path, or the path has no derivative of this order.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0])
    >>> links = [jn.Link("base"), jn.Link("upper", rod), jn.Link("lower", rod)]
    >>> joints = [jn.Joint("a", "base", "upper"), jn.Joint("b", "upper", "lower", position=[1, 0, 0])]
    >>> arm = jn.Robot("arm", links, joints)
    >>> path = jn.planning.ToolPath(["1 + 0.2*sin(t)", "0.2*cos(t)", 0.0], start=0.0, stop=6.0)
    >>> motion = jn.planning.follow_tool_path(arm, "lower", path, order=3, point=[1, 0, 0], start=[-0.8, 1.7])
    >>> there = jn.forward_kinematics(arm, motion.q[:1], "lower", [1, 0, 0]).position[0, :, 0]
    >>> abs(there.round(9)).tolist()  # 1 + 0.2 sin(t) at t = 0, to jerk
    [1.0, 0.2, 0.0, 0.2]
    """
    if not isinstance(path, ToolPath):
        raise RobotError("must be a jn.planning.ToolPath", name="path", value=type(path).__name__)
    tool, n = tool_of(robot, link, point, axis), len(robot.joint_names)
    scale = coordinate_scale(robot, tool)
    ranges, followers = joint_ranges(robot), SharedFollowers.of(robot)
    laws = _fixed_joint_laws(robot, hold, path)
    fixed_joints = tuple(robot.joint_names.index(name) for name in laws.names) if laws else ()
    values = _numbers(robot, "posture", posture)
    rest_posture = middle(*ranges) if values is None else values
    weight = _numbers(robot, "weights", weights)
    weight = np.ones(n) if weight is None else weight
    if (weight <= 0).any():
        raise RobotError("must be greater than zero", name="weights", value=weight.tolist())
    kinds = tuple(kind for kind in ("position", "rotation", "direction") if kind in path.kinds)
    columns = task_columns(robot, tool, random_coordinates(*ranges, scale, CONFIGURATIONS, 0), kinds, scale)
    if fixed_joints:
        units = np.broadcast_to(np.eye(n)[list(fixed_joints)], (len(columns), len(fixed_joints), n))
        columns = np.concatenate([columns, units], axis=1)
    basis, rank = reachable_rows(columns)
    equations = PathEquations(robot.tree, tool, basis, scale, weight, fixed_joints, kinds, n)
    if rank < min(basis.shape[1], n):
        message = "the held joints and the tool do not determine the other joints; hold others, or fewer"
        raise RobotError(message, name="hold", value=list(laws.names) if laws else None)

    def target(instants: np.ndarray, levels: int) -> dict[str, Any]:
        goal = path.series(instants, levels)
        if laws:
            jet = laws.derivatives(instants, levels)
            goal["held"] = _coefficients(jet) / scale[list(fixed_joints)][:, None]
        if equations.has_posture:
            states = np.zeros((levels + 1, n, len(instants)))
            states[0] = (rest_posture / scale)[:, None]
            goal["posture"] = states
        return goal

    ends = tuple(np.concatenate(x) for x in zip(ranges, followers.ranges, strict=True)) if limits else None
    start_q = _start(robot, tool, path, ends, laws, start, scale, kinds, link)
    u = np.concatenate([start_q / scale, np.zeros(equations.size - n)])
    if equations.has_posture:
        u = _to_posture(equations, u, target, path.start, link)
    nodes = followed(equations, u, target, path.start, path.stop, path.highest)
    motion = ToolPathMotion(robot, link, path, equations, nodes, target, rank, ends, time, order)
    if strict:
        _raise_for(motion, nodes)
    return motion


def _start(
    robot: Robot, tool: Any, path: ToolPath, ranges: Any, laws: Any, start: Any, scale: Any, kinds: Any, link: str
) -> np.ndarray:
    """Return coordinates of the tool at the beginning of the path."""
    n = len(robot.joint_names)
    lower, upper = (np.full(n, -np.inf), np.full(n, np.inf)) if ranges is None else (x[:n].copy() for x in ranges)
    if laws:
        for name, value in zip(laws.names, laws.derivatives([path.start], 0)[0, 0], strict=True):
            k = robot.joint_names.index(name)
            lower[k] = upper[k] = value
    given_start = _numbers(robot, "start", start)
    goal = {kind: np.moveaxis(x[0], -1, 0) for kind, x in path.series(np.array([path.start]), 0).items()}
    guess = middle(*joint_ranges(robot)) if given_start is None else given_start
    goals, starts = {kind: goal[kind] for kind in kinds}, 8 if given_start is None else 1
    followers = follower_ranges(robot, tool, limits=ranges is not None)
    result = poses_within(robot, tool, goals, (lower, upper, scale), followers, guess[None], starts)
    if not result[1][0] <= REACHED**2:
        missed = float(np.sqrt(result[1][0]))
        message = (
            f"the beginning of the path is not reached: {missed:.3g} rad, or sizes of the robot, are left; move the "
            "path, or give another start"
        )
        raise RobotError(message, name=link, value=goal["position"][0].tolist() if "position" in goal else None)
    return result[0][0]


def _to_posture(equations: PathEquations, u: np.ndarray, target: Any, instant: float, link: str) -> np.ndarray:
    """Return the unknowns nearest to a posture, by continuation from given unknowns as the posture moves."""
    first = target(np.array([instant]), 0)
    coordinates, posture = u[: equations.count], first["posture"][0, :, 0]

    def moving_target(shares: np.ndarray, levels: int) -> dict[str, Any]:
        goal = {}
        for kind, values in first.items():
            goal[kind] = np.zeros((levels + 1, *values.shape[1:-1], len(shares)))
            goal[kind][0] = values[0]
        goal["posture"][0] = coordinates[:, None] + (posture - coordinates)[:, None] * shares
        if levels:
            goal["posture"][1] = (posture - coordinates)[:, None]
        return goal

    nodes = followed(equations, u, moving_target, 0.0, 1.0, 30)
    if nodes.failed is not None:
        message = (
            "the coordinates nearest to the posture are not reached from the start: on the way, these "
            "coordinates cease to exist; give another posture, or a start nearer to it"
        )
        raise SingularityError(message, name=link)
    return nodes.series[-1, 0]


def _raise_for(motion: ToolPathMotion, nodes: Nodes) -> None:
    failures = np.flatnonzero(motion.status != Status.OK)
    if nodes.failed is None and not failures.size:
        return
    reason = motion.explain(int(failures[0])) if failures.size else motion.ending
    status = int(motion.status[failures[0]]) if failures.size else int(Status.SINGULAR)
    error: type[JounceError] = SingularityError if status in (Status.SINGULAR, Status.NOT_REACHED) else RobotError
    raise error(reason, name=motion.link)


def _fixed_joint_laws(robot: Robot, hold: Any, path: ToolPath) -> JointTrajectory | None:
    if hold is None or (isinstance(hold, Mapping) and not hold):
        return None
    if not isinstance(hold, Mapping):
        raise RobotError("must be a mapping of joints to laws", name="hold", value=hold)
    for name in hold:
        check_name("moving joint", name, robot.joint_names, RobotError, name="hold")
    try:
        return JointTrajectory(hold, path.start, path.stop)
    except JounceError as error:
        raise RobotError(error.message, name=(error.name or "").replace("laws", "hold"), value=error.value) from None


def _numbers(robot: Robot, name: str, value: Any) -> np.ndarray | None:
    if value is None:
        return None
    n = len(robot.joint_names)
    array = np.asarray(floats(name, in_order(name, value, robot.joint_names, RobotError)))
    if array.shape != (n,) or not np.isfinite(array).all():
        raise RobotError(f"must hold {n} finite numbers, one for each joint", name=name, value=array.tolist())
    return array


def _coefficients(derivatives: np.ndarray) -> np.ndarray:
    """Return Taylor coefficients, joints first and instants last, from (time, derivative, joint)."""
    return np.asarray(taylor_coefficients(np.moveaxis(derivatives, 0, -1)))
