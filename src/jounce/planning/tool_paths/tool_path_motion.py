"""The joint motion along a path of a tool: coordinates with derivatives of any order, and a status of each instant."""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from jounce.base.display import Displayed
from jounce.base.shapes import ArrayLike, seconds
from jounce.dynamics.limits.shared_followers import SharedFollowers
from jounce.errors import TrajectoryError
from jounce.execution.chunks import in_chunks
from jounce.jet.derivatives import plain_derivatives
from jounce.kinematics import Status
from jounce.linear_algebra.linear import singular_values
from jounce.planning.tool_paths.joint_laws import followed_closely
from jounce.planning.tool_paths.path_equations import PathEquations
from jounce.planning.tool_paths.path_marching import Nodes, predicted
from jounce.planning.tool_paths.task_rank import SINGULAR, losing_joints, task_columns
from jounce.planning.tool_paths.tool_path import ToolPath
from jounce.planning.tool_paths.tool_tasks import task_rows
from jounce.robot.model.arguments import whole_number
from jounce.robot.model.tree import Tree
from jounce.robot.recursions.batches import Batched
from jounce.robot.robot import Robot
from jounce.trajectory import HermiteMotion
from jounce.trajectory.joint_trajectory import MAX_ORDER, JointTrajectory
from jounce.units.instants import time_text

INSTANTS = 201
BLOCKS = (256, 1024)  # instants per call, so that few programs are compiled
LEAST = 3  # least order of the derivatives that laws of joints interpolate
MET = 1e-9  # rad, or sizes of the robot: largest error of the pose
RATES = 1e-6  # largest error of a derivative, relative to that of the path
WEAK = 0.05  # fraction of the largest singular value: a smaller least value explains the end of a path
JUMP = 1e-3  # m or rad within the shortest interval
LIMIT = 1e-9  # largest permitted excess of a coordinate over its range


@Batched
def _along(
    tree: Tree, arrays: tuple[Any, ...], constants: Any, names: tuple[str, ...], static: tuple[Any, ...], order: int
) -> Any:
    """Return the series of the coordinates and of the errors, the corrections, and singular values of the task."""
    guess, *series = arrays
    target = dict(zip(names, series, strict=True))
    tool, basis, scale, weights = constants
    equations = PathEquations(tree, tool, basis, scale, weights, *static)
    corrected = equations.corrected(guess[0], target)
    u = equations.series(corrected.u, corrected.factor, target, order)
    x, scale = u[:, : equations.count], jnp.asarray(scale)[None, :, None]
    goal = {kind: target[kind] for kind in equations.kinds}
    _, values, shares = singular_values(corrected.factor.matrix[: equations.rows, : equations.count])
    missed = task_rows(tree, tool, x * scale, goal)
    return (
        x * scale,
        missed,
        corrected.first[None],
        corrected.last[None],
        values[None],
        jnp.swapaxes(shares, 0, 1)[None],
    )


class ToolPathMotion(Displayed):
    """Joint coordinates along a path of a tool.

    Attributes
    ----------
    robot : Robot
        The robot.
    link : str
        The link that carries the tool.
    path : ToolPath
        The path of the tool.
    time : numpy.ndarray of shape (time,)
        Instants, s.
    q : numpy.ndarray of shape (time, order + 1, n)
        Coordinates and their derivatives, rad or m by s; NaN where the status is not OK.
    status : numpy.ndarray of shape (time,)
        A `Status` for each instant: SINGULAR where the path runs into a singular position, BRANCH_JUMP where it jumps,
        NOT_REACHED after either, NOT_ASSEMBLED where the tool cannot keep to the path, INADMISSIBLE where a joint
        leaves its range.
    residual : numpy.ndarray of shape (time, order + 1)
        Largest error of the tool and of its derivatives: rad, or sizes of the robot, by s.
    singular_values : numpy.ndarray of shape (time, rank)
        Singular values of the task, the largest first, with lengths in sizes of the robot.
    singular : numpy.ndarray of bool, shape (time,)
        Whether the least singular value is near zero, so that derivatives are large and lose digits.
    ending : str
        Reason why the path could not be followed to its end; empty if it was.
    """

    def __init__(
        self,
        robot: Robot,
        link: str,
        path: ToolPath,
        equations: PathEquations,
        nodes: Nodes,
        target: Callable[[np.ndarray, int], dict[str, Any]],
        rank: int,
        ranges: Any,
        time: ArrayLike | None,
        order: int,
    ):
        self.robot, self.link, self.path = robot, link, path
        self._parts = (equations, nodes, target, rank, ranges)
        self.order = whole_number("order", order, 0, MAX_ORDER)
        self.time = _instants(path, time)
        path.judge(min(self.order, path.highest))
        end_status, self.ending = (Status.OK, "") if nodes.failed is None else self._why()
        end_time = nodes.time[-1] if nodes.failed is not None else np.inf
        is_reached = self.time <= end_time
        clipped = np.where(is_reached, self.time, nodes.time[-1])
        series = target(clipped, self.order)
        names = tuple(series)
        arrays = (predicted(nodes, clipped)[:, None], *(_by_instant(series[name]) for name in names))
        constants = (equations.tool, equations.basis, equations.scale, equations.weights)
        static = (equations.fixed_joints, equations.kinds, equations.count)
        results = [np.asarray(x) for x in _along(robot, arrays, constants, (names, static, self.order))]
        self.q, missed, _, corrections, values, shares = results
        self.residual: Float[np.ndarray, "time derivative"] = np.abs(missed).max(axis=-1)
        self.singular_values = values[:, 0, :rank]
        self._shares = shares[:, 0, max(rank - 1, 0)]
        self.singular = self.singular_values[:, -1] <= SINGULAR * self.singular_values[:, 0]
        self.status: Int[np.ndarray, " time"] = self._judged(series, is_reached, corrections[:, 0], end_status)
        for array in (self.q, self.residual, self.singular_values):
            array[~is_reached] = np.nan
        self.q[(self.status != Status.OK) & (self.status != Status.INADMISSIBLE)] = np.nan

    def _judged(
        self, series: dict[str, Any], is_reached: np.ndarray, corrections: np.ndarray, end_status: Status
    ) -> np.ndarray:
        equations, nodes, _, _, ranges = self._parts
        status = np.full(len(self.time), int(Status.OK))
        if ranges is not None:
            followers = SharedFollowers.of(self.robot)
            sizes = [1.0 if joint.turning else float(equations.tool.length) for joint in followers.joints]
            slack = LIMIT * np.concatenate([equations.scale, sizes])
            self._places = followers.with_followers(self.q[:, :1])[:, 0]
            self._outside = (self._places < ranges[0] - slack) | (self._places > ranges[1] + slack)
            status[self._outside.any(axis=1)] = int(Status.INADMISSIBLE)
        sizes = [
            np.abs(_by_instant(series[kind])).reshape(len(self.time), self.order + 1, -1) for kind in equations.kinds
        ]
        size = np.concatenate(sizes, axis=-1).max(axis=-1) / min(1.0, float(equations.tool.length))
        is_off = self.residual > RATES * (np.maximum.accumulate(size, axis=1) + 1.0) * self._factorials()
        is_off[:, 0] = self.residual[:, 0] > MET
        status[is_off.any(axis=1)] = int(Status.NOT_ASSEMBLED)
        status[~(corrections <= MET)] = int(Status.NOT_CONVERGED)
        status[~np.isfinite(self.q).all(axis=(1, 2))] = int(Status.SINGULAR)
        status[~is_reached] = int(Status.NOT_REACHED)
        if nodes.failed is not None and (~is_reached).any():
            status[np.flatnonzero(~is_reached)[np.argmin(self.time[~is_reached])]] = int(end_status)
        return status

    def _factorials(self) -> np.ndarray:
        import math

        return np.array([float(math.factorial(k)) for k in range(self.order + 1)])

    def _why(self) -> tuple[Status, str]:
        """Return the reason why the path could not be followed to its end: a singular position, or a jump."""
        equations, nodes, target, rank, _ = self._parts
        time, u = nodes.time[-1], nodes.series[-1, 0]
        gap = 2.0**-16 * (self.path.stop - self.path.start)
        ends = target(np.array([time, min(time + gap, self.path.stop)]), 0)
        jump = max(float(np.abs(ends[kind][0, ..., 1] - ends[kind][0, ..., 0]).max()) for kind in equations.kinds)
        values, shares = _singular(self.robot, equations, u[: equations.count])
        names = ", ".join(losing_joints(self.robot.joint_names, shares[rank - 1]))
        if values[rank - 1] <= WEAK * values[0]:
            return Status.SINGULAR, (
                f"the path runs into a singular position at t = {time_text(time)} s, where the "
                f"motions of {names} cancel at "
                f"the tool (singular values from {values[0]:.2g} down to {values[rank - 1]:.2g}); let the path "
                "avoid it, or begin on another branch"
            )
        if jump > JUMP:
            return Status.BRANCH_JUMP, f"the path jumps at t = {time_text(time)} s; its laws must be continuous"
        if equations.has_posture or equations.fixed_joints:
            kind, remedy = (
                ("posture", "posture, other weights") if equations.has_posture else ("joints held", "law of them")
            )
            return Status.SINGULAR, (
                f"the path is singular with the {kind} at t = {time_text(time)} s: the coordinates reverse there; give "
                f"another {remedy}, or another start"
            )
        return Status.SINGULAR, (
            f"the path could not be followed beyond t = {time_text(time)} s: no motion of the joints continues it there"
        )

    def __repr__(self) -> str:
        count = int((self.status == Status.OK).sum())
        return f"<ToolPathMotion of {self.robot.name}: {count} of {len(self.time)} instants to order {self.order}>"

    def explain(self, index: int) -> str:
        """Return the result at an instant in words: the failure and its cause, and the joints that lose a motion."""
        status, time, phrases = Status(int(self.status[index])), float(self.time[index]), []
        if status in (Status.SINGULAR, Status.BRANCH_JUMP, Status.NOT_REACHED):
            return self.ending or f"singular at t = {time_text(time)} s"
        if status == Status.NOT_ASSEMBLED:
            phrases.append(
                f"the joints cannot keep the tool on the path at t = {time_text(time)} s: the pose misses it by "
                f"{self.residual[index, 0]:.3g} rad, or sizes of the robot, or a derivative does; prescribe less, such "
                "as a direction instead of an orientation"
            )
        if status == Status.NOT_CONVERGED:
            phrases.append(f"not converged at t = {time_text(time)} s")
        if status == Status.INADMISSIBLE:
            k = int(np.argmax(self._outside[index]))
            name = (*self.robot.joint_names, *SharedFollowers.of(self.robot).names)[k]
            phrases.append(
                f"{name} leaves its range at t = {time_text(time)} s, where it is {self._places[index, k]:.6g}; choose "
                "another start, posture or path, or limits=False"
            )
        if self.singular[index]:
            names = ", ".join(losing_joints(self.robot.joint_names, self._shares[index]))
            phrases.append(f"nearly singular at t = {time_text(time)} s: the motions of {names} cancel at the tool")
        return "; ".join(phrases) or "followed"

    def at(self, time: ArrayLike, order: int | None = None) -> "ToolPathMotion":
        """Return the motion at other instants, without following the path again.

        Parameters
        ----------
        time : array_like of shape (time,)
            Instants within the path, s.
        order : int, optional
            Highest derivative; by default that of this motion.
        """
        equations, nodes, target, rank, ranges = self._parts
        order = self.order if order is None else order
        return ToolPathMotion(self.robot, self.link, self.path, equations, nodes, target, rank, ranges, time, order)

    def trajectory(self) -> JointTrajectory:
        """Return the motion as a trajectory of joint laws.

        The laws are polynomials between the instants of this motion, at which they have its derivatives. They are
        compared with the exact motion at eight places of each interval, and instants are added where the error exceeds
        1e-9 rad or m (or that fraction of the largest coordinate). At a corner of the path, the velocities of the laws
        jump like that of the tool, which `retime` refuses as a kink. `at` is exact everywhere.

        Raises
        ------
        TrajectoryError
            If an instant has no coordinates, the instants do not increase, or the path has a jump or a spike that is
            too narrow to be followed; the message names the instant.
        """
        if (self.status != Status.OK).any():
            index = int(np.argmax(self.status != Status.OK))
            raise TrajectoryError(f"there are no coordinates: {self.explain(index)}", name=f"time[{index}]")
        order = max(self.order, min(LEAST, self.path.highest))
        times, q = followed_closely(self._exact(order), self.time, self.path.knots)
        laws = {name: HermiteMotion(times, q[:, :, k]) for k, name in enumerate(self.robot.joint_names)}
        return JointTrajectory(laws, float(times[0]), float(times[-1]), np.unique(times))

    def _exact(self, order: int) -> Callable[[np.ndarray], np.ndarray]:
        """Return the function from instants to coordinates and their derivatives."""

        def exact(instants: np.ndarray) -> np.ndarray:
            return in_chunks(lambda chunk: checked(instants[chunk]), len(instants), BLOCKS, axis=0)

        def checked(instants: np.ndarray) -> np.ndarray:
            motion = self.at(instants, order)
            if (motion.status != Status.OK).any():
                index = int(np.argmax(motion.status != Status.OK))
                raise TrajectoryError(f"there are no coordinates: {motion.explain(index)}", name="time")
            return motion.q

        return exact


def _instants(path: ToolPath, time: Any) -> np.ndarray:
    values = np.linspace(path.start, path.stop, INSTANTS) if time is None else time
    instants = np.atleast_1d(seconds("time", values, TrajectoryError))
    slack = 1e-9 * (path.stop - path.start)
    is_outside = ~((instants >= path.start - slack) & (instants <= path.stop + slack))
    if instants.ndim != 1 or is_outside.any():
        value = float(instants[np.argmax(is_outside)]) if instants.ndim == 1 else f"shape {instants.shape}"
        message = f"must be instants from {path.start:.9g} to {path.stop:.9g} s"
        raise TrajectoryError(message, name="time", value=value)
    return np.clip(instants, path.start, path.stop)


def _by_instant(series: np.ndarray) -> np.ndarray:
    """Return plain derivatives, instants first, from Taylor coefficients, instants last."""
    return np.moveaxis(np.asarray(plain_derivatives(series)), -1, 0)


def _singular(robot: Robot, equations: PathEquations, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the singular values and right singular vectors of a task at coordinates that fulfill it."""
    columns = task_columns(robot, equations.tool, (x * equations.scale)[None], equations.kinds, equations.scale)[0]
    columns = equations.basis.T @ np.concatenate([columns, np.eye(equations.count)[list(equations.fixed_joints)]])
    _, values, shares = np.linalg.svd(columns, full_matrices=False)
    return values, shares
