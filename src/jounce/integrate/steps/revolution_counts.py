"""Revolutions of the angles about axes that forces measure, counted along the steps of a simulation.

An attitude determines such an angle only up to whole revolutions. Each step begins with a known angle, which is
followed along the path at points less than half a turn apart.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from numpy.polynomial.polynomial import polyval

from jounce.base.shapes import Numbers
from jounce.dynamics.forward.accelerations import Equations, Lanes, State
from jounce.dynamics.forward.ground import turns_with_ground
from jounce.integrate.steps.methods import evaluated
from jounce.jet import Jet
from jounce.mechanism.transmissions.axis_angles import measures_angle

POINTS_IN_STEP = 16  # a series converges over at most about one turn


AnglesOfForces = tuple[Float[Numbers, "_ batch"], ...]
"""For each group of forces that measures an angle about an axis, the angles of its instances, rad."""


class Angles(NamedTuple):
    """The angles that forces measure along a step.

    Parameters
    ----------
    samples : tuple of array of shape (points, instances, batch)
        For each group of forces that measures an angle about an axis, the angles at equal parts of the step, rad.
    step : array of shape (batch,)
        Length of the step, s.
    """

    samples: tuple[Float[Numbers, "point _ batch"], ...]
    step: Lanes

    def at(self, elapsed: Lanes) -> AnglesOfForces:
        """Return the angles at a time from the beginning, (instances, batch) each, to within half a turn."""
        if not self.samples:
            return ()
        fraction = jnp.clip(elapsed / jnp.where(self.step == 0.0, 1.0, self.step), 0.0, 1.0)
        distance = jnp.abs(fraction[None] * POINTS_IN_STEP - jnp.arange(POINTS_IN_STEP + 1.0)[:, None])
        weights = jnp.maximum(1.0 - distance, 0.0)[:, None]
        return tuple(jnp.sum(weights * angles, axis=0) for angles in self.samples)


def measured(equations: Equations, state: State) -> AnglesOfForces:
    """Return the angles about axes that forces measure in a state, (instances, batch) each, rad.

    Their revolutions are those of the reference angles in the equations.
    """
    groups = [group for group in equations.system.forces if measures_angle(group)]
    if not groups:
        return ()
    pose, clock = equations.pose_at_rest(state.position, state.attitude), Jet([jnp.zeros_like(state.position[:1, 0])])
    shape = state.position.shape[-1:]
    angles = [group.displacement(pose, clock).coefficients[0][0] for group in groups]
    return tuple(jnp.broadcast_to(angle, angle.shape[:1] + shape) for angle in angles)


def followed(equations: Equations, angles: AnglesOfForces, path: State, step: Lanes) -> Angles:
    """Return the angles along a step.

    Parameters
    ----------
    equations : Equations
        Equations of motion of the mechanism.
    angles : tuple of array of shape (instances, batch)
        Angles at the beginning.
    path : State
        Coefficients in the time from the beginning, (order + 1, components, bodies, batch).
    step : array of shape (batch,)
        Length of the step, s.
    """
    if not angles:
        return Angles((), step)

    def follow_angles(previous: Any, fraction: Any) -> tuple[Any, Any]:
        current = measured(equations.near(previous), evaluated(path, fraction * step))
        return current, current

    _, current = jax.lax.scan(follow_angles, angles, jnp.arange(1.0, POINTS_IN_STEP + 1) / POINTS_IN_STEP)
    return Angles(tuple(jnp.concatenate([a[None], b]) for a, b in zip(angles, current, strict=True)), step)


def attitudes_at(
    series: Float[Numbers, "place order 4 bodies"], elapsed: Float[np.ndarray, " place"]
) -> Float[np.ndarray, "4 bodies+1 place"]:
    """Return the Euler parameters of all bodies, the ground first, at times into steps given by Taylor coefficients."""
    attitudes = polyval(elapsed[:, None, None], np.swapaxes(series, 0, 1), tensor=False)
    return np.asarray(turns_with_ground(np.moveaxis(attitudes, 0, -1)))


def attitudes_along(
    series: Float[Numbers, "step order 4 bodies"], length: Float[np.ndarray, " step"], points: int
) -> Float[np.ndarray, "4 bodies+1 place"]:
    """Return the Euler parameters of all bodies, the ground first, at equal parts of steps and at the end of the last.

    The steps are consecutive, and given by Taylor coefficients.
    """
    flat = np.asarray(series).reshape(*series.shape[:2], -1)
    with np.errstate(over="ignore"):  # powers of long steps, in which bodies turn uniformly
        powers = length[:, None, None] ** np.arange(series.shape[1])[:, None]
    terms = np.multiply(flat, powers, where=flat != 0, out=np.zeros_like(flat))
    fractions = (np.arange(points)[:, None] / points) ** np.arange(series.shape[1])
    attitudes = np.concatenate([(fractions @ terms).reshape(-1, flat.shape[-1]), terms[-1:].sum(axis=1)])
    return np.asarray(turns_with_ground(np.moveaxis(attitudes.reshape(-1, *series.shape[2:]), 0, -1)))
