"""Rate at which a motion approaches a singular position: the largest eigenvalue of ``J^-1 J'``.

To first order in a step s the determinant is ``det(J) det(1 + s J^-1 J')``. Minus the inverse of that eigenvalue is
thus the time to its nearest zero, which may be complex. All zeros count, including those without a change of sign, as
when two loops pass their dead points together.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.jax_internals import by_certain_entries
from jounce.base.shapes import Numbers, Real
from jounce.jet import Jet
from jounce.kinematics.continuation.jacobian_factors import Factor, factored
from jounce.linear_algebra.frontal import FrontalFactor
from jounce.mechanism.system import System
from jounce.rigid.body_arrays import each_jet
from jounce.rigid.pose import Pose

SQUARINGS = 4  # of the matrix whose largest eigenvalue is sought
PROBES = 8  # random vectors that estimate the norm of a power of a large matrix


def det_rate_of(system: System, pose: Pose, factor: Factor, instant: Float[Numbers, " batch"]) -> Float[Numbers, " 1"]:
    """Return the eigenvalue of ``J^-1 J'`` of largest size with the sign of its real part, 1/s, for the first lane.

    Parameters
    ----------
    system : System
        The mechanism.
    pose : Pose
        The pose with its first derivatives.
    factor : Factor
        Factors of the Jacobian at the pose.
    instant : array of shape (batch,)
        Instants of the lanes, s.
    """
    slope = _slope(system, each_jet(lambda jet: jet.map(lambda c: c[..., :1]), pose), instant[:1])
    if isinstance(factor, FrontalFactor):

        def product(vectors: Any) -> Any:
            return factor.applied_inverse(system.pattern.product(slope, vectors) * system.row_scale)

        return _of_products(product, system.shape[1])
    with by_certain_entries():  # many columns do not change
        return _of_matrix(factor.applied_inverse(system.pattern.dense(slope)[..., 0] * system.row_scale))


def det_rate_at(
    system: System, pose_type: type[Pose], coordinates: dict[str, Numbers], instant: Float[Numbers, " batch"]
) -> Float[Numbers, " 1"]:
    """Return the result of `det_rate_of`, from the jets of the coordinates alone."""
    pose = pose_type.from_coordinates({name: Jet(tuple(x[:2, ..., :1])) for name, x in coordinates.items()})
    return det_rate_of(system, pose, factored(system, pose.truncate(0), Jet([instant[None, :1]])), instant)


def det_rates_of(
    system: System, pose: Pose, factor: Factor, instant: Float[Numbers, " batch"]
) -> Float[Numbers, " batch"]:
    """Return the result of `det_rate_of` for all lanes."""
    relative = system.pattern.dense(_slope(system, pose, instant)) * system.row_scale[:, :, None]
    relative = jax.vmap(partial(factor.solve, refined=False), in_axes=1, out_axes=1)(relative)
    return jax.vmap(_of_matrix, in_axes=-1, out_axes=-1)(relative)[0]


def _slope(system: System, pose: Pose, instant: Float[Numbers, " batch"]) -> Float[Numbers, "entry batch"]:
    """Return the time derivatives of the entries of the Jacobian."""
    static_pose, moving_pose = pose.truncate(0), pose.truncate(1)
    rates = each_jet(lambda jet: Jet([jet.dense().coefficients[1]]) if jet.order else None, moving_pose)

    def entries(static_pose: Any, time: Any) -> Any:
        return system.entries(static_pose, Jet([time[None]]))

    return jax.jvp(entries, (static_pose, instant), (rates, jnp.ones_like(instant)))[1]


def _of_matrix(relative: Float[Numbers, "column column"]) -> Float[Numbers, " 1"]:
    """Return the eigenvalue of a dense matrix, from a power: the root of its norm is an upper bound that converges."""

    @by_certain_entries()
    def squared(k: Any, carry: Any) -> Any:
        power, log_growth = carry
        size = jnp.maximum(jnp.sqrt(jnp.sum(power * power)), 1e-300)
        scaled = power / size
        return jax.lax.map(by_certain_entries()(lambda row: row @ scaled), scaled), log_growth + jnp.log(size) * 0.5**k

    power, log_growth = jax.lax.fori_loop(0, SQUARINGS, squared, (relative, np.zeros(())))
    size = jnp.exp(log_growth + jnp.log(jnp.maximum(jnp.sqrt(jnp.sum(power * power)), 1e-300)) / 2**SQUARINGS)
    numerator, trace = jnp.sum(power * relative.T), jnp.trace(power)
    return _leading(numerator / jnp.where(trace == 0, 1.0, trace), size, numerator, size)[None]


def _of_products(
    product: Callable[[Float[Numbers, "column probe"]], Float[Numbers, "column probe"]], columns: int
) -> Float[Numbers, " 1"]:
    """Return the eigenvalue of a matrix given by its products with vectors.

    The same power is applied to random vectors, whose mean square estimates that of its norm (Hutchinson 1990). The
    estimate is too small only if all vectors miss the direction that the power stretches most. With eight vectors, the
    root of the norm is below 0.8 of its true value with a probability under 1e-11; the result is divided by 0.8. Random
    vectors are independent of the mechanism, and the sixteenth root reduces errors.
    """

    def multiplied(_: Any, carry: Any) -> Any:
        vectors, log_growth = carry
        size = jnp.maximum(jnp.sqrt(jnp.mean(jnp.sum(vectors * vectors, axis=0))), 1e-300)
        return product(vectors / size), log_growth + jnp.log(size)

    start = np.random.default_rng(0).standard_normal((columns, PROBES))
    power = 2**SQUARINGS
    vectors, log_growth = jax.lax.fori_loop(0, power, multiplied, (start / np.sqrt(columns), np.zeros(())))
    square = jnp.sum(vectors * vectors)
    norm = jnp.log(jnp.maximum(jnp.sqrt(square / PROBES * columns), 1e-300))
    size = jnp.exp((log_growth + norm) / power)
    numerator = jnp.sum(vectors * product(vectors))
    return _leading(numerator / jnp.where(square == 0, 1.0, square), size, numerator, size / 0.8)[None]


def _leading(eigenvalue: Real, size: Real, numerator: Real, bound: Real) -> Any:
    """Return the eigenvalue if it is real and dominant, as near a singular position; else a bound with its sign."""
    dominates = (jnp.abs(eigenvalue) > 0.7 * size) & (jnp.abs(eigenvalue) <= bound)
    return jnp.where(dominates, eigenvalue, jnp.where(numerator < 0, -bound, bound))
