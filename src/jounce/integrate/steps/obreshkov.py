"""Two-point Obreshkov formulas with derivatives of the same order at both ends of a step. Sommer 2024, section 7.

With the Taylor coefficients c of ``y = (position, attitude, velocity, spin)`` at the two ends of a step h,
``y_1 = y_0 + sum_j p! (2p-j)! / ((2p)! (p-j)!) h^j (c_0[j] - (-1)^j c_1[j])``, j = 1..p, has order 2p. The formula is
implicit, and solved by iteration. For velocities it uses accelerations with p = 1, jerk with p = 2, jounce with p = 3.
"""

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.modules import field
from jounce.base.shapes import Numbers
from jounce.dynamics.forward.accelerations import Equations, Expansion, Flags, Lanes, State, expand
from jounce.errors import JounceError
from jounce.integrate.steps.methods import ROUNDING, AbstractMethod, Number, Sizes, check_step, evaluated, reach
from jounce.jet.algebra import total

MOST_ITERATIONS = 80
CONVERGED = 1e-15  # change in an iteration, rad or sizes of the mechanism
STALLED = 1e-13  # a change below this that no longer shrinks is rounding
HIGHER_COEFFICIENTS = 4  # beyond the first one of the error: some vanish at rest and at turning points


class Obreshkov(AbstractMethod):
    """Implicit two-point formula on accelerations, jerk, jounce and crackle of both ends of a step.

    It is symmetric in time, and uses derivatives up to half its order.

    Parameters
    ----------
    order : int, default 6
        4 (with jerk), 6 (with jounce) or 8; 2 is the trapezoidal rule, with accelerations alone.
    step : float, optional
        Length of all steps, s; by default from error control.

    Raises
    ------
    JounceError
        If there is no formula of this order.

    Examples
    --------
    >>> import jounce as jn
    >>> jn.Obreshkov(4, step=0.01).expansion_order(1e-8)
    2
    """

    order: int = field(static=True, default=6)
    step: float | int | None = None

    def __check_init__(self):
        if isinstance(self.order, bool) or self.order not in (2, 4, 6, 8):
            raise JounceError("there are Obreshkov formulas of order 2, 4, 6 and 8", name="order", value=self.order)
        check_step(self.step)

    @property
    def derivatives_used(self) -> int:
        """Highest derivative of positions and velocities in the formula."""
        return self.order // 2

    def expansion_order(self, tolerance: float) -> int:
        """Return the order of the expansions, higher than that of the formula if the step is to be chosen."""
        return self.derivatives_used if self.step is not None else self.order + HIGHER_COEFFICIENTS

    def longest_step(self, sizes: Sizes, tolerance: Number) -> Lanes:
        """Return the step at which the leading nonvanishing term of the error equals the tolerance."""
        if self.step is not None:
            return jnp.full(sizes.shape[1], self.step, float)
        first = self.order + 1
        constant = (self.order + 2) * math.factorial(self.derivatives_used) ** 2 / math.factorial(self.order)
        return reach(sizes, first) * (tolerance / constant) ** (1.0 / first)

    def arrive(self, equations: Equations, expansion: Expansion, time: Lanes, step: Lanes) -> State:
        """Return the end that satisfies the formula, NaN if the iteration does not converge."""
        measure = _measure(equations.system.column_scale[0], step)
        end_time = (time + step)[None]
        known = _known(expansion, step, self.derivatives_used)

        def improved(end: State) -> State:
            state = expand(equations, end, end_time, self.derivatives_used).state
            return State(*(a - _terms(c, -step, self.derivatives_used) for a, c in zip(known, state, strict=True)))

        def iterate(carry: Any) -> Any:
            end, before, _, count = carry
            new = improved(end)
            change = _size(State(*(a - b for a, b in zip(new, end, strict=True))), measure)
            return new, change, before, count + 1

        def unfinished(carry: Any) -> Any:
            _, change, before, count = carry
            return jnp.any(~_has_converged(change, before)) & (count < MOST_ITERATIONS)

        start = evaluated(expansion.state, step)
        infinite = jnp.full(step.shape, jnp.inf)
        end, change, before, _ = jax.lax.while_loop(unfinished, iterate, (start, infinite, infinite, 0))
        converged = _has_converged(change, before) & jnp.isfinite(change)
        return end.map(lambda x: jnp.where(converged, x, jnp.nan))

    def polynomial(self, start: Expansion, end: Expansion, step: Lanes) -> State:
        """Return the polynomial of degree order + 1 with the derivatives of the formula at both ends."""
        upper = jnp.asarray(_hermite(self.derivatives_used))
        length = jnp.where(step == 0.0, 1.0, step)  # runs that have arrived have steps of zero length

        def joined(c0: Any, c1: Any) -> Any:
            count = self.derivatives_used + 1
            power = length[None, None, None] ** jnp.arange(2.0 * count)[:, None, None, None]
            low, high = c0[:count] * power[:count], c1[:count] * power[:count]
            ends = jnp.concatenate([(high - low)[:1], low[1:], high[1:]])
            upper_terms = jnp.sum(upper.reshape(*upper.shape, 1, 1, 1) * ends[None], axis=1)
            return jnp.concatenate([c0[:count], upper_terms / power[count:]])

        return State(*map(joined, start.state, end.state))

    def error(self, start: Expansion, end: Expansion, step: Lanes, length: Number) -> Lanes:
        """Return the departure of the end from the formula of the next order."""
        if self.step is not None:
            return jnp.zeros_like(step)
        p, measure = self.derivatives_used + 1, _measure(length, step)
        known = _known(start, step, p)
        parts = zip(end.state, known, start.state, strict=True)
        departure = State(*(jnp.abs(c[0] + _terms(c, -step, p) - a) - ROUNDING * jnp.abs(c0[0]) for c, a, c0 in parts))
        return _size(departure.map(lambda x: jnp.maximum(x, 0.0)), measure)


def _known(expansion: Expansion, step: Lanes, max_derivative: int) -> State:
    """Return the part of the formula from the start of a step."""
    return State(*(c[0] + _terms(c, step, max_derivative) for c in expansion.state))


def _terms(
    coefficients: Float[Numbers, "order component body batch"], step: Lanes, max_derivative: int
) -> Float[Numbers, "component body batch"]:
    """Return the derivative terms of one end in the formula; for the other end the step is negative."""
    p = max_derivative
    weights = {j: math.perm(p, j) / math.perm(2 * p, j) for j in range(1, p + 1)}
    return total(w * step[None, None] ** j * coefficients[j] for j, w in weights.items())


def _hermite(p: int) -> np.ndarray:
    """Return the Hermite matrix from the ends to the upper coefficients, in units of the step.

    Rows: coefficients p + 1 .. 2p + 1. Columns: the difference of the values, the coefficients 1..p of the start, and
    those of the end. At the end, ``c_1[j] = sum_k binomial(k, j) a[k]``.
    """
    lower, upper = np.arange(p + 1), np.arange(p + 1, 2 * p + 2)

    def at_end(orders: np.ndarray) -> np.ndarray:
        return np.array([[math.comb(k, j) for k in orders] for j in range(p + 1)], float)

    inverse = np.rint(np.linalg.inv(at_end(upper)))  # the determinant is one, so entries are whole numbers
    start = inverse @ at_end(lower)[:, 1:]  # the value itself is part of the difference
    return np.concatenate([inverse[:, :1], -start, inverse[:, 1:]], axis=1)


def _measure(length: Number, step: Lanes) -> tuple[Any, ...]:
    """Return the factors that turn positions, attitudes, velocities and spins into rad or sizes of the mechanism."""
    duration = jnp.abs(step)
    return 1.0 / length, 1.0, duration[None, None] / length, duration[None, None]


def _size(change: State, measure: tuple[Any, ...]) -> Lanes:
    """Return the largest component of a change of state."""
    sizes = [jnp.max(jnp.abs(x) * m, axis=(0, 1)) for x, m in zip(change, measure, strict=True)]
    return jnp.max(jnp.stack(sizes), axis=0)


def _has_converged(change: Lanes, before: Lanes) -> Flags:
    """Return whether an iteration has converged, or has failed with nonfinite values."""
    return (
        (change <= CONVERGED) | ((change <= STALLED) & (change >= before)) | ~jnp.isfinite(change) & (change != jnp.inf)
    )
