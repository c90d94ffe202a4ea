"""The state of a robot, as numbers and as polynomials in time."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jounce.base.shapes import is_traced
from jounce.errors import RobotError
from jounce.integrate.steps.methods import Lanes
from jounce.robot.algorithms.motion_series import MotionSeries
from jounce.robot.model.arguments import checked_state
from jounce.robot.robot import Robot


class RobotState(NamedTuple):
    """Positions and velocities of a robot, or their coefficients, order first; the batch is last.

    Attributes
    ----------
    coordinates, rates : array of shape (n, batch)
        rad or m, and by s.
    position, quaternion, twist : array of shape (3 or 4 or 6, batch), or None
        Pose and twist of a free base, as in `BaseMotion`.
    """

    coordinates: Any
    rates: Any
    position: Any = None
    quaternion: Any = None
    twist: Any = None


def start_levels(robot: Robot, state: Any) -> Any:
    """Return the coordinates and rates at the start, (2, n), by default at rest at zero; JAX may trace them.

    Raises
    ------
    RobotError
        If a name is not that of a joint, or the values are not finite or have another shape.
    """
    names = robot.joint_names
    if isinstance(state, Mapping):
        numbers = {name: 0.0 if is_traced(x) else x for name, x in state.items()}
        q = robot.coordinates(**numbers)  # checks the names and values
        state = [[state.get(name, x) for name, x in zip(names, q, strict=True)], np.zeros(len(names))]
    shape = 2, len(names)
    if is_traced(state):
        return checked_state(robot, jnp.asarray(state, float))
    levels = np.zeros(shape) if state is None else np.array(checked_state(robot, state))
    if levels.shape != shape or not np.isfinite(levels).all():
        raise RobotError(f"must hold finite q and q', the shape {shape}", name="state", value=levels.tolist())
    return levels


def polynomial_of(series: MotionSeries) -> RobotState:
    """Return the coefficients of a motion series as a state."""
    return RobotState(series.coordinates, series.rates, series.position, series.quaternion, series.twist)


def at(polynomial: RobotState, elapsed: Lanes) -> RobotState:
    """Return the values of polynomials, with a normalized quaternion, at times from their beginnings."""
    state = jax.tree.map(lambda c: _value(c, elapsed), polynomial)
    if state.quaternion is None:
        return state
    return state._replace(quaternion=state.quaternion / jnp.sqrt(jnp.sum(state.quaternion**2, axis=0, keepdims=True)))


def rates_at(polynomial: RobotState, elapsed: Lanes) -> RobotState:
    """Return the values of the derivatives of polynomials."""

    def rate(c: Any) -> Any:
        return _value(c[1:] * jnp.arange(1.0, len(c))[:, None, None], elapsed)

    return jax.tree.map(rate, polynomial)


def _value(coefficients: Any, elapsed: Any) -> Any:
    """Return values of polynomials by a loop over the orders, which keeps the compiled code small."""
    count = len(coefficients)
    shape = (coefficients.shape[1], jnp.broadcast_shapes(coefficients.shape[2:], elapsed.shape)[0])

    def added(k: Any, value: Any) -> Any:
        c = jax.lax.dynamic_index_in_dim(coefficients, count - 1 - k, 0, keepdims=False)
        return value * elapsed[None] + c

    return jax.lax.fori_loop(0, count, added, jnp.zeros(shape))
