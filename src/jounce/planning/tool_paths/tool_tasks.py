"""Tasks of a tool - a position, an orientation or a direction - as rows on jets that vanish when fulfilled."""

from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.shapes import ArrayLike, Numbers, by_component
from jounce.errors import RobotError, check_name
from jounce.jet import Jet, concatenate, cross, dot
from jounce.jet.algebra import stacked, total
from jounce.rigid.inertia import vector_numbers
from jounce.rigid.orientation import check_rotation
from jounce.robot.model.abstract_robot import AbstractRobot
from jounce.robot.model.arguments import floats, joints_of
from jounce.robot.model.robot_size import robot_size
from jounce.robot.model.tree import Frame, Tree, axes_with_z_along
from jounce.robot.recursions.kinematics import frame_at, link_frame

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

UNIT = 1e-6  # largest deviation of the length of a quaternion from one: printed digits

Goal = dict[str, Any]
"""Series of the goals: "position" and "direction" (order, 3, batch), "rotation" (order, 3, 3, batch)."""


class Tool(NamedTuple):
    """Frame of the tool on its link, and scale of its errors.

    Attributes
    ----------
    frame : Frame
        Frame at the point of the tool, on the moving body.
    axes : array of shape (3, 3)
        Axes of the tool in the frame of the link; the last column is the axis of a direction.
    length : float
        Length that is equivalent to 1 rad, m: the size of the robot.
    """

    frame: Frame
    axes: Any
    length: Any


def tool_of(robot: AbstractRobot, link: str, point: ArrayLike, axis: ArrayLike) -> Tool:
    """Return the tool on a link that moves.

    Raises
    ------
    RobotError
        If the link does not exist or does not move, or the point or the axis is not valid.
    """
    joints_of(robot)
    check_name("link", link, robot.frames, RobotError, name="link")
    if robot.frames[link].body < 0:
        raise RobotError("this link is fixed to the base: no joint moves it", name="link", value=link)
    axis = vector_numbers("axis", axis, (3,))
    norm = float(np.linalg.norm(axis))
    if not norm:
        raise RobotError("must not be zero", name="axis", value=axis.tolist())
    frame = frame_at(robot, link, point)
    return Tool(frame, axes_with_z_along(axis / norm), np.float64(robot_size(robot)))


def task_rows(tree: Tree, tool: Tool, q: Any, goal: Goal) -> Float[Numbers, "order row batch"]:
    """Return the series of the errors of a tool; if all are zero, and the tool is near its goal, the task is fulfilled.

    Rows of a position are in sizes of the robot. Rows of an orientation are the sine of the remaining angle times its
    axis; rows of a direction are its two components perpendicular to the axis of the tool.
    """
    frame = link_frame(tree, q, tool.frame)
    rows = []
    if "position" in goal:
        rows.append((frame.position - Jet(tuple(goal["position"]))) * (1.0 / tool.length))
    if "rotation" in goal:
        targets = [Jet(tuple(goal["rotation"][:, :, j])) for j in range(3)]
        rows.append(total(cross(d, a) for d, a in zip(targets, frame.axes, strict=True)) * 0.5)
    if "direction" in goal:
        targets = Jet(tuple(goal["direction"]))
        rows += [dot(frame.direction(tool.axes[:, j]), targets)[None] for j in range(2)]
    return stacked(concatenate(rows))


def misses(tree: Tree, tool: Tool, q: Any, goal: Goal) -> Float[Numbers, "row batch"]:
    """Return the errors of a tool at any distance, whose sum of squares grows with the angle up to half a turn.

    They are differences of axes; for an orientation, their squares add up to that of ``2 sin(angle / 2)``.
    """
    frame = link_frame(tree, q[None], tool.frame)
    rows = []
    if "position" in goal:
        rows.append((frame.position.coefficients[0] - goal["position"][0]) / tool.length)
    if "rotation" in goal:
        axes = jnp.stack([axis.coefficients[0] for axis in frame.axes], axis=1)
        difference = (axes - goal["rotation"][0]) / np.sqrt(2.0)
        rows.append(jnp.reshape(difference, (9, difference.shape[-1])))
    if "direction" in goal:
        rows.append(frame.direction(tool.axes[:, 2]).coefficients[0] - goal["direction"][0])
    return jnp.concatenate(rows)


def columns_of(function: Any, point: Float[Numbers, "column batch"]) -> Float[Numbers, "row column batch"]:
    """Return the Jacobian of a function of coordinates, batch last, by forward differentiation along each."""
    units = jnp.broadcast_to(jnp.eye(len(point))[..., None], (len(point), *point.shape))
    return jax.vmap(lambda unit: jax.jvp(function, (point,), (unit,))[1], out_axes=1)(units)


def rotation_matrices(name: str, value: "ArrayLike | Rotation") -> Float[np.ndarray, "*batch 3 3"]:
    """Return rotation matrices from matrices, unit quaternions with the scalar first, or SciPy rotations.

    Raises
    ------
    RobotError
        If the values are not rotations.
    """
    from scipy.spatial.transform import Rotation

    if (matrices := getattr(value, "as_matrix", None)) is not None:
        return np.asarray(matrices(), float)
    array = np.asarray(floats(name, by_component(name, value, RobotError)))
    if array.ndim >= 2 and array.shape[-2:] == (3, 3):
        flat = array.reshape(-1, 3, 3)
        check_rotation(np.moveaxis(flat, 0, -1), name)
        return Rotation.from_matrix(flat).as_matrix().reshape(array.shape)  # orthonormalizes printed digits
    if array.ndim >= 1 and array.shape[-1] == 4:
        rotations = Rotation.from_quat(np.roll(_units(name, array.reshape(-1, 4)), -1, axis=-1))
        return rotations.as_matrix().reshape(*array.shape[:-1], 3, 3)
    message = f"must be unit quaternions, (..., 4), scalar first, or matrices, (..., 3, 3), not {array.shape}"
    raise RobotError(message, name=name)


def unit_vectors(name: str, value: ArrayLike) -> Float[np.ndarray, "*batch 3"]:
    """Return directions normalized to unit length.

    Raises
    ------
    RobotError
        If the values are not finite vectors, or a vector is zero.
    """
    array = np.asarray(floats(name, by_component(name, value, RobotError)))
    if array.ndim < 1 or array.shape[-1] != 3:
        raise RobotError(f"must have the shape (..., 3), not {array.shape}", name=name)
    norm = np.linalg.norm(array, axis=-1, keepdims=True)
    if not np.isfinite(norm).all() or not norm.all():
        raise RobotError("must be finite and not zero", name=name)
    return array / norm


def _units(name: str, array: np.ndarray) -> np.ndarray:
    norm = np.linalg.norm(array, axis=-1, keepdims=True)
    is_far = ~(np.abs(norm[:, 0] - 1.0) <= UNIT)
    if is_far.any():
        first = int(np.argmax(is_far))
        message = "a quaternion must be of unit length, scalar first; its length is"
        raise RobotError(message, name=f"{name}[{first}]", value=float(norm[first, 0]))
    return array / norm
