"""Closures of the loops of a robot: the wrenches that they bear, and those that the joints of the tree bear already.

In a loop of hinges with parallel axes, a closure constrains some directions that the hinges constrain too. These
equations are redundant: their reactions have no unique value. The rank of the closure velocities in the coordinates of
the tree, in the closed position and near it, finds the redundant equations, and the mechanism omits them.
"""

import math
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from typing_extensions import TypeAliasType

from jounce.base.modules import field
from jounce.base.shapes import ArrayLike, Numbers
from jounce.constraints import AbstractConstraint, Scalar, Vector
from jounce.constraints.base import Wrenches
from jounce.errors import MechanismError, RobotError
from jounce.jet import Jet, cross, dot, stack
from jounce.jet.algebra import stacked
from jounce.rigid import SpatialPose
from jounce.rigid.inertia import finite_numbers
from jounce.robot.model.abstract_robot import AbstractRobot
from jounce.robot.model.links_and_joints import Closure
from jounce.robot.model.tree import Frame, Tree, axes_with_z_along
from jounce.robot.recursions.batches import Batched
from jounce.robot.recursions.kinematics import body_frames, frame_at
from jounce.robot.recursions.tree_scan import Series
from jounce.trajectory.labels import in_order

GivenCoordinates = TypeAliasType("GivenCoordinates", Mapping[str, float] | ArrayLike | None)
"""Coordinates in order, or by name of the joint; coordinates not given are the start positions of the joints."""

RANK_TOLERANCE = 1e-5  # rad, or sizes of the robot: files give axes with six digits
MAX_STEPS = 100
SWAY = 0.05  # rad, or sizes of the robot: distance of a position in general from the one given


class LinkClosure(AbstractConstraint, type="closure", space="spatial"):
    """Two links held together in some directions, each given by a wrench that the closure can bear.

    With the offset d of the points and the rotation error e, both in axes of body i, the rows are
    ``force . d + moment . e``.
    """

    point_i: Vector  # m, in the frame of body i
    point_j: Vector
    wrenches: Wrenches  # (rows, 6): force and moment, in axes of body i
    vector_part: Vector = None  # of the Euler parameters of the frame of body j in that of body i, when closed
    scalar_part: Scalar = None
    sense: Any = field(default=None, init=False)  # 1 or -1, found from the starting guess

    dimensions = {"vector_part": "ratio", "scalar_part": "ratio"}

    def __check_init__(self):
        if (self.vector_part is None) != (self.scalar_part is None):
            raise MechanismError("Euler parameters have a vector_part and a scalar_part", name="vector_part")
        if self.vector_part is None and np.any(np.asarray([row[3:] for row in self.wrenches]) != 0):
            message = "a closure that bears moments needs vector_part and scalar_part, the attitude when closed"
            raise MechanismError(message, name="vector_part")

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, _time: Jet) -> Jet:
        """Return the rows, shape (rows, ...)."""
        offset = body_i.to_body(body_j.point(self.point_j) - body_i.point(self.point_i))
        force, moment = self.wrenches[:, :3], self.wrenches[:, 3:]
        rows = offset.map(lambda d: jnp.sum(force * d[None], axis=1))
        if self.vector_part is None:
            return rows
        e0, e = body_i.relative_quaternion(body_j.quaternion)
        turn = 2.0 * (self.scalar_part * e - e0 * self.vector_part - cross(e, self.vector_part))
        turn = turn if self.sense is None else turn * self.sense
        return rows + turn.map(lambda x: jnp.sum(moment * x[None], axis=1))

    def sense_at(self, body_i: SpatialPose, body_j: SpatialPose) -> Float[Numbers, "..."] | None:
        """Return the sign of the Euler parameters at a pose, (...), as either sign gives the same attitude; or None.

        The sign matters to a row with both force and moment. It stays constant along a motion: choosing it anew would
        switch it, and the Jacobian with it, where a body passes half a turn in a pin.
        """
        if self.vector_part is None:
            return None
        e0, e = body_i.relative_quaternion(body_j.quaternion)
        cosine = self.scalar_part * e0 + dot(self.vector_part, e)
        return jnp.where(cosine.coefficients[0] < 0, -1.0, 1.0)


def constraint_wrenches(closure: Closure) -> np.ndarray:
    """Return the wrenches that a closure can bear, (rows, 6): force and moment in the frame of its first link."""
    everything = np.eye(6)
    if closure.type == "connect":
        return everything[:3]
    if closure.type == "weld":
        return everything
    axes = np.kron(np.eye(2), axes_with_z_along(closure.axis).T)
    return axes[[0, 1, 2, 3, 4]] if closure.type == "pin" else axes[[0, 1, 3, 4, 5]]


@Batched
def _placed(
    tree: Tree, arrays: tuple[Series], link_frames: tuple[Frame, Frame]
) -> Float[Numbers, "order 4 3 closure batch"]:
    """Return the offset of the points, and the axes of the second link, of each closure, in axes of its first link."""
    frames = body_frames(tree, arrays[0])

    def point_and_axes(link_frame: Frame) -> tuple[Jet, list[Jet]]:
        frame = jax.tree.map(lambda c: jnp.take(c, link_frame.body, axis=1), frames)
        local = (link_frame.position, *jnp.moveaxis(link_frame.rotation, 2, 0))
        point, *axes = (jnp.moveaxis(x, 0, -1)[:, :, None] for x in local)
        return frame.point(point), [frame.direction(axis) for axis in axes]

    (origin, axes), (point_j, axes_j) = map(point_and_axes, link_frames)
    vectors = [stack([axis.dot(vector) for axis in axes]) for vector in (point_j - origin, *axes_j)]
    return jnp.stack([stacked(jet) for jet in vectors], axis=1)


def _missing_turn(closure: Closure, rotation: np.ndarray) -> np.ndarray:
    """Return the rotation of the second link of a closure from its closed attitude, a rotation vector, rad.

    Its length is the angle, up to half a turn, as the sine would vanish for links that are half a turn apart. A
    rotation about the axis of a pin does not count.
    """
    if closure.type != "pin":
        from scipy.spatial.transform import Rotation  # importing SciPy takes half a second

        return Rotation.from_matrix(rotation).as_rotvec()
    axis = np.asarray(closure.axis)
    closing_axis = rotation @ axis
    normal = np.cross(axis, closing_axis)
    sine = float(np.linalg.norm(normal))
    normal = normal / sine if sine > 1e-12 else axes_with_z_along(axis)[:, 0]
    return math.atan2(sine, float(axis @ closing_axis)) * normal


class Loops:
    """The closures of a robot as functions of the coordinates of its tree.

    Parameters
    ----------
    robot : Robot
        A robot with closures.
    """

    def __init__(self, robot: AbstractRobot):
        self.tree, self.size = robot.opened(), size_of(robot)
        self.names, self.closures = tuple(robot.closures), tuple(robot.closures.values())
        turning = [robot.joints[name].turning for name in robot.joint_names]
        self.scale = np.where(turning, 1.0, self.size)  # of the coordinates
        self.wrenches = [constraint_wrenches(closure) for closure in self.closures]
        sides: list[list[Frame]] = [[], []]
        for closure in self.closures:
            first, second = (frame_at(robot, link, p) for link, p in zip(closure.links, closure.points, strict=True))
            sides[0].append(first)
            sides[1].append(second._replace(rotation=second.rotation @ closure.rotation.T))
        self.frames = tuple(jax.tree.map(lambda *xs: np.stack(xs), *side) for side in sides)

    def gaps(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the scaled gaps of all closures, (closures, 6), and their velocities by the scaled coordinates.

        The velocities of rotations are angular velocities, which are the rates of the gaps near the closed position.
        """
        count = len(q)
        directions = np.diag(self.scale) if count else np.zeros((1, 0))
        states = np.stack([np.broadcast_to(q, directions.shape), directions], axis=1)
        placements = _placed(self.tree, (states,), self.frames)  # (coordinates, 2, 4, 3, closures)
        gap_vectors, rates = placements[0, 0], placements[:count, 1]
        gaps, slopes = [], []
        for k, closure in enumerate(self.closures):
            rotation, omega = gap_vectors[1:, :, k].T, np.swapaxes(rates[:, 1:, :, k], 1, 2) @ gap_vectors[1:, :, k]
            gaps.append(np.concatenate([gap_vectors[0, :, k] / self.size, _missing_turn(closure, rotation)]))
            spins = 0.5 * (omega - np.swapaxes(omega, 1, 2))[:, [2, 0, 1], [1, 2, 0]]  # angular velocities
            slopes.append(np.concatenate([rates[:, 0, :, k] / self.size, spins], axis=1).T)
        return np.array(gaps), np.array(slopes)

    def closed(self, q: Float[np.ndarray, " joint"], free: Any = slice(None)) -> Float[np.ndarray, " joint"]:
        """Return coordinates near the given ones at which the loops are closed, by damped Gauss-Newton iteration.

        Only free coordinates change.

        Raises
        ------
        RobotError
            If the iteration does not close the loops.
        """
        q = np.array(q, float)

        def state(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            gaps, slopes = self.gaps(q)
            gap = np.concatenate([w @ g for w, g in zip(self.wrenches, gaps, strict=True)])
            return gap, np.concatenate([w @ s for w, s in zip(self.wrenches, slopes, strict=True)])[:, free]

        gap, slope = state(q)
        for _ in range(MAX_STEPS):
            step = -np.linalg.lstsq(slope, gap, rcond=RANK_TOLERANCE)[0]
            length = float(np.max(np.abs(step), initial=0.0))
            step *= min(1.0, 0.5 / max(length, 1e-300))
            for _halving in range(12):
                trial = q.copy()
                trial[free] += step * self.scale[free]
                trial_state = state(trial)
                if np.linalg.norm(trial_state[0]) < np.linalg.norm(gap) or length < 1e-12:
                    break
                step *= 0.5
            else:
                break
            q, (gap, slope) = trial, trial_state
            if length < 1e-12:
                break
        self._check_closed(q)
        return q

    def opening(self, q: Float[np.ndarray, " joint"]) -> float:
        """Return by how much the loops are open, rad or sizes of the robot."""
        return max(np.abs(w @ g).max() for w, g in zip(self.wrenches, self.gaps(q)[0], strict=True))

    def _check_closed(self, q: np.ndarray) -> None:
        gaps, _ = self.gaps(q)
        sizes = [np.abs(w @ g).max() for w, g in zip(self.wrenches, gaps, strict=True)]
        worst = int(np.argmax(sizes))
        if not sizes[worst] <= 10 * RANK_TOLERANCE:
            message = (
                f"the loops cannot be closed from the coordinates given: {self.names[worst]} stays open by about "
                f"{sizes[worst]:.2g} (rad, or sizes of the robot); give coordinates q nearer to a closed position, and "
                "check points and driven joints"
            )
            raise RobotError(message, name=f"closures.{self.names[worst]}")

    def independent(self, q: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return for each closure the wrenches that it alone bears, (k, 6), and those that other constraints bear too.

        Wrenches redundant only in this position, as at a dead point, count as independent: nearby positions decide.
        """
        initial = self._split(q)
        best = initial
        random = np.random.default_rng(1)  # arbitrary but reproducible directions
        for _ in range(2):
            slopes = np.concatenate([w @ s for (w, _), s in zip(best, self.gaps(q)[1], strict=True)])
            motions = _null_space(slopes)
            if not motions.shape[1]:
                break
            sway = motions @ random.normal(size=motions.shape[1])
            try:
                nearby = self._split(self.closed(q + SWAY * self.scale * sway / np.abs(sway).max()))
            except RobotError:
                continue
            if sum(len(chosen) for chosen, _ in nearby) > sum(len(chosen) for chosen, _ in best):
                best = nearby
        unscaled = np.repeat([1.0, self.size], 3)
        return [(chosen * unscaled, rest * unscaled) for chosen, rest in best]

    def _split(self, q: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        _, slopes = self.gaps(q)
        motions = np.eye(len(q))  # motions that the closures so far allow
        groups = []
        for wrenches, slope in zip(self.wrenches, slopes, strict=True):
            rows = wrenches @ slope @ motions
            left, sizes, right = np.linalg.svd(rows)
            rank = int(np.sum(sizes > RANK_TOLERANCE))
            groups.append(tuple(_aligned(basis) @ wrenches for basis in (left[:, :rank], left[:, rank:])))
            motions = motions @ right[rank:].T
        return groups


def _aligned(basis: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis, as rows, of the space of orthonormal columns, along the axes where possible."""
    projector = basis @ basis.T
    rows = []
    for _ in range(basis.shape[1]):
        lengths = np.linalg.norm(projector, axis=0)
        row = projector[:, int(np.argmax(lengths > 0.999 * lengths.max()))]
        row = row / np.linalg.norm(row)
        row = np.where(np.abs(row) < 1e-12, 0.0, row)
        projector = projector - np.outer(row, row @ projector)
        rows.append(row)
    return np.reshape(rows, (-1, len(basis)))


def _null_space(matrix: np.ndarray) -> np.ndarray:
    _, sizes, right = np.linalg.svd(matrix)
    return right[int(np.sum(sizes > RANK_TOLERANCE)) :].T


def given_coordinates(robot: AbstractRobot, q: GivenCoordinates) -> Float[np.ndarray, " joint"]:
    """Return coordinates from an array, or from values by name of the joint, with start positions for the others."""
    if q is None or isinstance(q, Mapping):
        return robot.coordinates(**{**{name: robot.joints[name].start for name in robot.joint_names}, **(q or {})})
    return np.array(finite_numbers("q", in_order("q", q, robot.joint_names, RobotError), (len(robot.joint_names),)))


def size_of(robot: AbstractRobot) -> float:
    """Return the size of the robot, m: the largest distance from a joint to the next or to a closure, or 1 m."""
    lengths = [float(np.linalg.norm(joint.position)) for joint in robot.joints.values()]
    lengths += [float(np.linalg.norm(p)) for closure in robot.closures.values() for p in closure.points]
    return max(lengths, default=0.0) or 1.0


def closure_wrenches(
    robot: AbstractRobot, q: GivenCoordinates = None
) -> dict[str, tuple[Float[np.ndarray, "wrench 6"], Float[np.ndarray, "redundant 6"]]]:
    """Return the wrenches that each closure of a robot bears, and its redundant wrenches, which the joints bear too.

    The mechanism of the robot has one equation for each wrench borne. The equations of redundant wrenches follow from
    the others; their reactions would have no unique value, and are zero in the mechanism.

    Parameters
    ----------
    robot : Robot
        A robot with closures.
    q : array_like of shape (n,) or dict of str to float, optional
        Coordinates near which the loops are closed; by default the start positions of the joints.

    Returns
    -------
    dict of str to tuple of array
        By name of the closure: wrenches borne (k, 6) and redundant ones (m, 6), each a force and a moment about the
        point of the closure, in the frame of its first link.

    Raises
    ------
    RobotError
        If the loops cannot be closed near q.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])
    >>> links = [jn.Link("base"), *(jn.Link(name, rod) for name in ("crank", "rod", "rocker"))]
    >>> joints = [jn.Joint("A", "base", "crank"), jn.Joint("B", "crank", "rod", position=[1, 0, 0])]
    >>> joints.append(jn.Joint("D", "base", "rocker", position=[1, 1, 0]))
    >>> tip = jn.robot.Closure("C", ("rod", "rocker"), points=[[1, 0, 0], [1, 0, 0]])
    >>> four_bar = jn.Robot("four-bar", links, joints, closures=[tip])
    >>> borne, redundant = jn.robot.closure_wrenches(four_bar, {"A": 0.1, "B": 0.4})["C"]
    >>> abs(redundant).tolist()  # forces along the axes of the hinges
    [[0.0, 0.0, 1.0, 0.0, 0.0, 0.0]]
    """
    if not robot.closures:
        return {}
    loops = Loops(robot)
    position = loops.closed(given_coordinates(robot, q))
    return dict(zip(loops.names, loops.independent(position), strict=True))
