"""Motion of a free base: its pose, without singular orientations, and its velocities in its own axes."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Float

from jounce.base.shapes import Numbers, by_component
from jounce.errors import RobotError
from jounce.jet import Jet, cross
from jounce.jet.algebra import stacked
from jounce.rigid.inertia import Inertia
from jounce.rigid.spatial import body_axes
from jounce.robot.model.abstract_robot import AbstractRobot
from jounce.robot.model.arguments import floats
from jounce.robot.recursions.tree_equations import BaseBody

UNIT = 1e-6  # allowed deviation of the length of a quaternion from one, as files round; quaternions are normalized
TwistSeries = Float[Numbers, "levels 6 batch"]


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True, eq=False)
class BaseMotion:
    """Pose and twist of a free base, with derivatives of any order.

    Parameters
    ----------
    position : array_like of shape (..., 3)
        Position of the origin of the base link, in the axes of the scene, m.
    quaternion : array_like of shape (..., 4)
        Unit Euler parameters ``[e0, e1, e2, e3]``, scalar first, from the base to the scene.
    twist : array_like of shape (..., levels, 6)
        Velocity of the origin, m/s, then angular velocity, rad/s, in the axes of the base, and the time derivatives of
        these components. The first derivative is not the acceleration, which is ``v' + w x v``.

    Examples
    --------
    >>> import jounce as jn
    >>> jn.robot.BaseMotion([0, 0, 0.3], [1, 0, 0, 0], [[0.1, 0, 0, 0, 0, 2.0]]).twist
    [[0.1, 0, 0, 0, 0, 2.0]]
    """

    position: Any
    quaternion: Any
    twist: Any


def base_arrays(base: BaseMotion, lead: tuple[int, ...], levels: int) -> tuple[Any, Any]:
    """Return the checked pose, (..., 1, 7), and twist, (..., levels, 6), of a base.

    Raises
    ------
    RobotError
        If shapes do not fit the samples, or a quaternion has no unit length.
    """
    if not isinstance(base, BaseMotion):
        raise RobotError("must be a jn.robot.BaseMotion", name="base", value=type(base).__name__)
    arrays = []
    for name, shape in (("position", (3,)), ("quaternion", (4,)), ("twist", (levels, 6))):
        array = floats(f"base.{name}", by_component(f"base.{name}", getattr(base, name), RobotError))
        if name == "twist" and array.ndim == len(lead) + 2 and array.shape[-2] > levels:
            array = array[..., :levels, :]
        if array.shape != (*lead, *shape):
            message = f"must have the shape {(*lead, *shape)}, as the coordinates have, not {array.shape}"
            raise RobotError(message, name=f"base.{name}")
        arrays.append(array)
    position, quaternion, twist = arrays
    library = jnp if any(isinstance(x, jax.Array) for x in arrays) else np
    length = library.sqrt(library.sum(quaternion * quaternion, axis=-1, keepdims=True))
    if not isinstance(length, Tracer) and (errors := np.abs(np.asarray(length) - 1)).size and errors.max() > UNIT:
        value = float(np.ravel(length)[errors.argmax()])
        raise RobotError("must be of unit length, scalar first; its length is", name="base.quaternion", value=value)
    return library.concatenate([position, quaternion / length], axis=-1)[..., None, :], twist


def base_body(robot: AbstractRobot) -> BaseBody:
    """Return the inertia of the base, zero where a massless frame carries the robot."""
    inertia = robot.base_inertia or Inertia(0.0, strict=False)
    mass = inertia.mass if isinstance(inertia.mass, Tracer) else np.float64(inertia.mass)
    return BaseBody(mass, inertia.center_of_mass, inertia.tensor)


def scene_axes(quaternion: Float[Numbers, "4 batch"], twist: TwistSeries) -> tuple[Jet, Jet, Jet]:
    """Return the axes of the scene in the axes of the base, ``u' = -w x u``, to one order more than the twist."""
    axes = body_axes(quaternion)
    coefficients = []
    for i in range(3):
        axis = Jet([jnp.stack([column[i] for column in axes])])
        for k in range(len(twist)):
            rate = cross(axis, Jet(tuple(twist[: k + 1, 3:])))
            axis = axis.append(rate.dense().coefficients[k] / (k + 1))
        coefficients.append(axis)
    return coefficients[0], coefficients[1], coefficients[2]


def in_base(axes: tuple[Jet, Jet, Jet], vector: Jet | Numbers) -> Jet:
    """Return a vector in the axes of the base from its components in the axes of the scene."""
    coordinates = [vector[i : i + 1] for i in range(3)]
    rotated = axes[0] * coordinates[0] + axes[1] * coordinates[1] + axes[2] * coordinates[2]
    return rotated.dense()


def free_fall_velocity(axes: tuple[Jet, Jet, Jet], gravity: Numbers, levels: int) -> Float[Numbers, "level 3 batch"]:
    """Return the velocity, zero now, of a base that accelerates against gravity, in base axes, (levels, 3, batch)."""
    fall = stacked(in_base(axes, -jnp.asarray(gravity)[:, None]))[: levels - 1]
    return jnp.concatenate([jnp.zeros_like(fall[:1]), fall])
