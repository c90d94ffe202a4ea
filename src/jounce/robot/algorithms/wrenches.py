"""External wrenches: forces and torques on links, as functions of time."""

import dataclasses
from collections.abc import Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jounce.base.shapes import ArrayLike, Refused, by_component, is_traced, seconds
from jounce.errors import MechanismError, RobotError, check_choice, check_name
from jounce.jet import Jet, compose
from jounce.rigid.inertia import vector_numbers
from jounce.robot.model.arguments import floats
from jounce.robot.robot import Robot
from jounce.trajectory.laws.user_laws import shape_of_result

FRAMES = ("base", "link")


@dataclasses.dataclass(frozen=True, eq=False)
class Wrench:
    """An external force and torque on a link, for example of a contact or a tool.

    Parameters
    ----------
    link : str
        Name of the link.
    force, torque : array_like or callable, default zero
        N and N m. Shape (3,): constant. Shape (..., order - 1, 3): values and time derivatives for each sample, as many
        as the requested torques have. A callable maps the time, a scalar in s, to three components, by JAX functions.
    point : array_like of shape (3,), default zero
        Point of application, in the frame of the link, m.
    frame : {"base", "link"}, default "base"
        Axes of the components; those of the link turn with it. Where the base moves (`BaseMotion`), "base" means the
        axes of the scene, in which the pose of the base is given.

    Raises
    ------
    RobotError
        If the frame is unknown, or the point is not three finite numbers.
    """

    link: str
    force: Any = (0.0, 0.0, 0.0)
    torque: Any = (0.0, 0.0, 0.0)
    point: Any = (0.0, 0.0, 0.0)
    frame: str = "base"

    def __post_init__(self) -> None:
        check_choice("frame", self.frame, FRAMES, RobotError, name="wrench.frame")
        object.__setattr__(self, "point", vector_numbers("wrench.point", self.point, (3,)))


def wrench_arrays(
    robot: Robot,
    wrenches: Sequence[Wrench],
    lead: tuple[int, ...],
    levels: int,
    time: ArrayLike | None,
    *,
    free: bool = False,
) -> tuple[Any, ...]:
    """Return the wrenches as arrays of plain derivatives, of shape (..., levels, 6): force, then torque.

    Wrenches may act on the base only if it is free.

    Raises
    ------
    RobotError
        If an entry is not a Wrench, a link does not exist, a wrench acts on a fixed base, a shape does not fit the
        samples, or a force is a function of time and `time` is missing.
    """
    check_wrenches(robot, wrenches, free=free)
    arrays = []
    for k, wrench in enumerate(wrenches):
        location = f"wrenches[{k}]"
        pair = [
            _derivatives(f"{location}.{name}", getattr(wrench, name), lead, levels, time)
            for name in ("force", "torque")
        ]
        arrays.append(jnp.concatenate(pair, axis=-1) if is_traced(pair) else np.concatenate(pair, axis=-1))
    return tuple(arrays)


def check_wrenches(robot: Robot, wrenches: Sequence[Wrench] | Refused, *, free: bool) -> None:
    """Raise RobotError unless all are wrenches on links that move, or on the base if it is free."""
    if not isinstance(wrenches, Sequence) or isinstance(wrenches, str):
        raise RobotError("must be a list of jn.robot.Wrench", name="wrenches", value=type(wrenches).__name__)
    for k, wrench in enumerate(wrenches):
        location = f"wrenches[{k}]"
        if not isinstance(wrench, Wrench):
            raise RobotError("must be a jn.robot.Wrench", name=location, value=type(wrench).__name__)
        check_name("link", wrench.link, robot.frames, RobotError, name=f"{location}.link")
        if robot.frames[wrench.link].body < 0 and not free:
            message = "this link is fixed to the base: nothing moves it"
            raise RobotError(message, name=f"{location}.link", value=wrench.link)


def _derivatives(location: str, value: Any, lead: tuple[int, ...], levels: int, time: Any) -> Any:
    shape = (*lead, levels, 3)
    if callable(value):
        if time is None:
            raise RobotError("is a function of time: give the instants of the samples as `time`", name=location)
        instants = jnp.asarray(floats("time", time, seconds))
        if instants.shape != lead:
            raise RobotError(
                f"must have one instant for each sample, the shape {lead}, not {instants.shape}", name="time"
            )
        advice = "it must map a scalar time to three components with functions of jax.numpy"
        try:
            result_shape = shape_of_result("function", advice, lambda t: jnp.asarray(value(t), float), np.zeros(()))
        except MechanismError as error:
            raise RobotError(error.message, name=location) from error
        if result_shape != (3,):
            raise RobotError(f"the function must return three components, not the shape {result_shape}", name=location)
        jet = Jet.variable(instants, levels - 1)
        rows = [compose(partial(_component, value, i), jet).derivatives() for i in range(3)]
        return jnp.moveaxis(jnp.stack(rows, axis=1), (0, 1), (-2, -1))
    array = floats(location, by_component(location, value, RobotError))
    if array.shape == (3,):
        level = np.zeros((levels, 1))
        level[0] = 1.0
        library = jnp if isinstance(array, jax.Array) else np
        return library.broadcast_to(level * array[None], shape)
    if array.shape != shape:
        raise RobotError(f"must have the shape (3,) or {shape}, not {array.shape}", name=location)
    return array


def _component(function: Any, index: int, time: Any) -> Any:
    return jnp.asarray(function(time)[index], float)
