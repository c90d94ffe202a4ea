"""Wrenches on links as functions of time and state, for simulations."""

import inspect
from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np

from jounce.base.modules import Module, field
from jounce.base.shapes import by_component
from jounce.errors import RobotError
from jounce.jet.programs.composition import SampleFunction
from jounce.robot.algorithms.wrenches import Wrench, check_wrenches
from jounce.robot.model.arguments import floats
from jounce.robot.model.tree import Frame
from jounce.robot.recursions.kinematics import frame_at
from jounce.robot.robot import Robot

STATE = 3  # arguments of a function of time, coordinates and rates


class WrenchPart(Module):
    """The force, or the torque, of a wrench."""

    constant: Any
    function: SampleFunction | None
    of_state: bool = field(static=True)

    def __call__(self, time: Any, q: Any, rate: Any) -> Any:
        """Return three components at states, the batch last."""
        if self.function is None:
            return jnp.broadcast_to(jnp.asarray(self.constant)[:, None], (3, time.shape[-1]))
        arguments = (time, q, rate) if self.of_state else (time,)
        return self.function(*arguments)

    def at(self, *state: Any) -> Any:
        """Return three components at one state, or at one time, from the function as it was when read."""
        assert self.function is not None
        return self.function.at(*state)


class WrenchLaws(Module):
    """External wrenches as functions of time and state; see `wrench_laws`."""

    parts: tuple[tuple[WrenchPart, WrenchPart], ...]

    @property
    def changing(self) -> bool:
        """Whether a wrench depends on anything but the pose of its link."""
        return any(part.function is not None for pair in self.parts for part in pair)

    def __call__(self, time: Any, q: Any, rate: Any) -> tuple[Any, ...]:
        """Return the force and torque of each wrench, (6, batch)."""
        return tuple(jnp.concatenate([part(time, q, rate) for part in pair]) for pair in self.parts)


def wrench_laws(
    robot: Robot, wrenches: Sequence[Wrench], *, free: bool
) -> tuple[WrenchLaws, tuple[Frame, ...], tuple[bool, ...]]:
    """Return the laws of wrenches, the frames in which they act, and whether each is in the axes of the scene.

    Parameters
    ----------
    robot : Robot
        The robot.
    wrenches : sequence of Wrench
        Wrenches with constant forces and torques, or functions of time, or of time, coordinates and rates.
    free : bool
        Whether the base is free, so that wrenches may act on it.

    Raises
    ------
    RobotError
        If an entry is not a Wrench, a link does not exist or does not move, or a force is neither constant nor such a
        function.
    """
    check_wrenches(robot, wrenches, free=free)
    laws, n = [], len(robot.joint_names)
    for k, wrench in enumerate(wrenches):
        kinds = ("force", "torque")
        laws.append(tuple(_part(f"wrenches[{k}].{name}", getattr(wrench, name), n) for name in kinds))
    frames = tuple(frame_at(robot, wrench.link, wrench.point) for wrench in wrenches)
    return WrenchLaws(tuple(laws)), frames, tuple(wrench.frame == "base" for wrench in wrenches)


def _part(location: str, form: Any, n: int) -> WrenchPart:
    if not callable(form):
        value = np.asarray(floats(location, by_component(location, form, RobotError)))
        if value.shape != (3,) or not np.isfinite(value).all():
            message = "must be three finite numbers, or a function of time, or of time, q and rates"
            raise RobotError(message, name=location, value=value.tolist())
        return WrenchPart(value, None, False)
    of_state = len(inspect.signature(form).parameters) == STATE
    state = (jnp.zeros(()), jnp.zeros(n), jnp.zeros(n)) if of_state else (jnp.zeros(()),)
    try:
        sampled = SampleFunction.of(form, *state)
    except TypeError as error:
        message = f"must be a function of time, or of time, q and rates, by operations of JAX: {error}"
        raise RobotError(message.splitlines()[0], name=location) from error
    if sampled.shape != (3,):
        raise RobotError(f"the function must return three components, not the shape {sampled.shape}", name=location)
    return WrenchPart(np.zeros(3), sampled, of_state)
