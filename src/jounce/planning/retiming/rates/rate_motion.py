"""The motion of the parameter of a path over time, from the square of its rate: exact to rounding, to any order."""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.shapes import ArrayLike
from jounce.errors import TrajectoryError
from jounce.jet import Jet
from jounce.jet.pieces import last_begun
from jounce.trajectory import AbstractMotion
from jounce.trajectory.beyond import SLACK

NODES = 16  # nodes of Gauss quadrature on a piece
NEWTON = 8  # steps: the time over a piece is smooth and increases everywhere
EXACT = 1e-13  # fraction of the time over a piece by which the sum over its halves may differ
HALVINGS = 12


class RateMotion(AbstractMotion):
    """A parameter u over time, whose rate is the root of a piecewise polynomial z(u).

    The time ``integral du / sqrt(z)`` is inverted by Newton's method; derivatives follow from ``u'' = z'(u) / 2``.

    Parameters
    ----------
    begins : array_like of shape (pieces + 1,)
        Start of each piece, and the end of the last one.
    pieces : array_like of shape (powers, pieces)
        Coefficients of z, 1/s^2, in powers of u minus the start of the piece, lowest first.
    exact : bool, default True
        Halve pieces on which the quadrature is not exact to rounding.

    Raises
    ------
    TrajectoryError
        If z is not positive.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.planning.retiming.rates.rate_motion import RateMotion
    >>> motion = RateMotion([0.0, 1.0], [[1.0], [2.0]])  # z = 1 + 2 u: u' = 1 + t
    >>> [round(float(x), 12) for x in motion(jn.Jet.variable(0.5, order=3)).derivatives()]
    [0.625, 1.5, 1.0, 0.0]
    """

    instants: Any
    begins: Any
    pieces: Any

    def __init__(self, begins: ArrayLike, pieces: ArrayLike, *, exact: bool = True):
        begins, pieces = np.asarray(begins, float), np.asarray(pieces, float)
        begins, pieces = _halved(begins, pieces) if exact else (begins, pieces)
        times = _times(pieces, np.diff(begins))
        self.instants, self.begins, self.pieces = np.append(0.0, np.cumsum(times)), begins, pieces

    @property
    def duration(self) -> float:
        """Time from the start of u to its end, s."""
        return float(np.asarray(self.instants)[-1])

    def slower(self, factor: float) -> "RateMotion":
        """Return the same motion, slower by a factor."""
        return RateMotion(self.begins, np.asarray(self.pieces) / factor**2)

    def check_instants(self, first: float, last: float) -> None:
        """Raise TrajectoryError if an instant is before the start or after the end."""
        stop = self.duration
        if first < -SLACK * stop or last > (1 + SLACK) * stop:
            message = f"the law is defined from 0 to {stop:.9g} s only; choose instants within"
            raise TrajectoryError(message, value=float(first if first < 0 else last))

    def __call__(self, time: Jet) -> Jet:
        """Return the jet of u at the instants of the time jet; NaN outside."""
        instant, order = time.coefficients[0], time.order
        instants, begins, pieces = map(jnp.asarray, (self.instants, self.begins, self.pieces))
        if instants.ndim == 1:
            series = _series(instants, begins, pieces, instant, order)
        else:  # several laws of one kind, stacked along an axis before the batch: (pieces, laws, 1)
            shared_instants = jnp.broadcast_to(instant, (instants.shape[1], instant.shape[-1]))
            stacked = jax.vmap(_series, in_axes=(1, 1, 2, 0, None), out_axes=0)
            series = stacked(instants[..., 0], begins[..., 0], pieces[..., 0], shared_instants, order)
        rates = time.coefficients[1:]
        if all(c is None for c in rates[1:]):  # time at a constant rate
            rate = 1.0 if not rates else 0.0 if rates[0] is None else rates[0]
            return Jet(a * rate**k for k, a in enumerate(series))
        local = Jet((jnp.zeros_like(instant), *rates))
        value = Jet.constant(series[-1], order)
        for a in series[-2::-1]:
            value = value * local + a
        return value


@partial(jax.jit, static_argnames="order")  # otherwise each call would compile the loop
def _series(instants: Any, begins: Any, pieces: Any, instant: Any, order: int) -> tuple[Any, ...]:
    """Return the Taylor coefficients of u at instants."""
    slack = SLACK * instants[-1]
    clipped = jnp.clip(instant, 0.0, instants[-1])
    index = last_begun(instants[:-1], clipped)
    c, start = pieces[:, index], begins[index]
    length, elapsed = begins[index + 1] - start, clipped - instants[index]
    nodes, weights = np.polynomial.legendre.leggauss(NODES)

    def step(_: int, v: Any) -> Any:
        points = v[None] * jnp.reshape((nodes + 1) / 2, (NODES, *(1,) * v.ndim))
        time = v / 2 * jnp.tensordot(weights, 1 / jnp.sqrt(_value(c[:, None], points)), axes=1)
        return jnp.clip(v + (elapsed - time) * jnp.sqrt(_value(c, v)), 0.0, length)

    v = jax.lax.fori_loop(0, NEWTON, step, length * elapsed / (instants[index + 1] - instants[index]))
    shifted = _shifted(c, v)
    series = [start + v]
    if order:
        series.append(jnp.sqrt(shifted[0]))
    # coefficients of the powers of u - u(t), which follow one after the other like those of u
    powers: list[list[Any]] = [[None] for _ in range(max(len(shifted) - 2, 1))]
    for k in range(order - 1):
        slope = shifted[1] * (1.0 if k == 0 else 0.0)
        if k:
            powers[0].append(series[k])
            for m in range(1, len(powers)):
                powers[m].append(sum((series[i] * powers[m - 1][k - i] for i in range(1, k)), jnp.zeros_like(v)))
            slope = sum((j * shifted[j] * powers[j - 2][k] for j in range(2, len(shifted))), slope)
        series.append(slope / (2 * (k + 1) * (k + 2)))
    is_outside = (instant < -slack) | (instant > instants[-1] + slack)
    return tuple(jnp.where(is_outside, jnp.nan, a) for a in series)


def _value(coefficients: Any, v: Any) -> Any:
    value = coefficients[-1] + 0 * v
    for c in coefficients[-2::-1]:
        value = value * v + c
    return value


def _shifted(coefficients: Any, v: Any) -> list[Any]:
    """Return the coefficients of a polynomial in powers of its argument minus v, by repeated Horner schemes."""
    shifted = list(coefficients)
    for k in range(len(shifted) - 1):
        for j in range(len(shifted) - 2, k - 1, -1):
            shifted[j] = shifted[j] + v * shifted[j + 1]
    return shifted


def _times(
    pieces: Float[np.ndarray, "powers piece"], lengths: Float[np.ndarray, " piece"], count: int = 1
) -> Float[np.ndarray, " piece"]:
    """Return the time over each piece."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    points = (np.arange(count)[:, None] + (nodes + 1) / 2).reshape(-1, 1) / count * lengths
    z = _value(pieces, points)
    if not (z > 0).all():
        raise TrajectoryError("the square of a rate must be positive", value=float(z.min()))
    return np.tile(weights, count) @ (1 / np.sqrt(z)) * lengths / 2 / count


def _halved(begins: np.ndarray, pieces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the pieces, halved where the quadrature is not exact to rounding."""
    for _ in range(HALVINGS):
        lengths = np.diff(begins)
        times, halves = _times(pieces, lengths), _times(pieces, lengths, 2)
        coarse = np.abs(times - halves) > EXACT * halves
        if not coarse.any():
            break
        ends = begins[-1]
        middle = np.stack(_shifted(pieces[:, coarse], lengths[coarse] / 2))
        starts = np.concatenate([begins[:-1], begins[:-1][coarse] + lengths[coarse] / 2])
        order = np.argsort(starts, kind="stable")
        begins = np.append(starts[order], ends)
        pieces = np.concatenate([pieces, middle], axis=1)[:, order]
    return begins, pieces
