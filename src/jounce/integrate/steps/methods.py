"""Integration methods: the length, end, error and polynomial of a step."""

import abc
import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jounce.base.modules import Module, field
from jounce.base.shapes import Numbers
from jounce.dynamics.forward.accelerations import Equations, Expansion, Flags, Inverse, Lanes, State
from jounce.errors import JounceError
from jounce.execution.translated import traces_one_instant

Number = float | Float[Numbers, ""]
Sizes = Float[Numbers, "order batch"]

MAX_ORDER = 40
LOWEST_ORDER = 4
# coefficients that must be finite; beside a jump of a force higher ones are rounding errors, or not finite
NEEDED = LOWEST_ORDER + 2
# near a singular position: upper coefficients that grow geometrically from less than this are rounding errors
FAINT = 1e-10
# response to a unit gap, in largest masses: 30 and more if rounding hides coefficients, otherwise below 26
BRACED = 20.0
NEAR = 1e-6  # near a pole: least motion within the radius of a series, rad or sizes of the mechanism
ROUGH = 1e-11  # tolerance of a step if rounding hides coefficients, rad or sizes of the mechanism
MARGIN = 10.0  # an error estimate up to this many times the tolerance is accepted, since estimates are rough
ROUNDING = 1e-14  # relative error of an acceleration that does not show that a step is too long


class AbstractMethod(Module):
    """A one-step method on Taylor expansions of the constrained motion.

    Every step starts from the expansion of the motion at its beginning, ends on the constraints, and is accepted if the
    accelerations of the equations of motion at its end agree with those of its polynomial.
    """

    @property
    def controlled(self) -> bool:
        """Whether steps are chosen by their error, and shortened by the lookahead."""
        return getattr(self, "step", None) is None

    @abc.abstractmethod
    def expansion_order(self, tolerance: float) -> int:
        """Return the order of the expansions that the method needs."""

    @abc.abstractmethod
    def longest_step(self, sizes: Sizes, tolerance: Number) -> Lanes:
        """Return the longest step within the tolerance, s.

        Parameters
        ----------
        sizes : array of shape (order + 1, batch)
            Sizes of the Taylor coefficients 1 to order + 1 of the positions, rad or sizes of the mechanism.
        tolerance : float
            Error of a step, in the same units.
        """

    def prepared(
        self, expansion: Expansion, length: Number, tolerance: Number, singular: Flags, usual: Lanes
    ) -> tuple[Expansion, Lanes, Lanes]:
        """Return the expansion for the step, the longest step with it, s, and the allowed error.

        Steps shorter than usual, such as those after a jump of a force, are allowed smaller errors (`in_proportion`): a
        position error divided by the short time of the step is a velocity error, which acts until the end of the run.

        Parameters
        ----------
        expansion : Expansion
            Expansion at the beginning of the step.
        length : float
            Size of the mechanism, m.
        tolerance : float
            Error of the step, rad or sizes of the mechanism.
        singular : array of bool, shape (batch,)
            Whether the equations of motion are nearly singular, from `near_singular`.
        usual : array of shape (batch,)
            Length of a step that is not short, s; zero if not known.
        """
        step = self.longest_step(coefficient_sizes(expansion, length), tolerance)
        return expansion, step, in_proportion(jnp.full(step.shape, tolerance), step, usual)

    @abc.abstractmethod
    def arrive(self, equations: Equations, expansion: Expansion, time: Lanes, step: Lanes) -> State:
        """Return the state at the end of a step, before projection; `time` is that of its beginning.

        In `equations`, angles about axes that forces measure have the revolutions of the end of the step.
        """

    @abc.abstractmethod
    def polynomial(self, start: Expansion, end: Expansion, step: Lanes) -> State:
        """Return the coefficients of the step's polynomial in the time from its beginning, order first."""

    @abc.abstractmethod
    def error(self, start: Expansion, end: Expansion, step: Lanes, length: Number) -> Lanes:
        """Return an estimate of the error of a step, rad or sizes of the mechanism."""


def evaluated(polynomial: State, step: Lanes) -> State:
    """Return the values of the polynomials of a state at a time `step` from their beginning."""
    return polynomial.map(lambda c: _horner(c, step))


def expanded_about(polynomial: State, step: Lanes, order: int) -> State:
    """Return the Taylor coefficients of the polynomials of a state about a time `step` from their beginning."""

    def shifted(coefficients: Any) -> Any:  # Horner's scheme for the value and its derivatives at once
        def added(levels: Any, coefficient: Any) -> tuple[Any, None]:
            return levels * step[None, None, None] + jnp.concatenate([coefficient[None], levels[:-1]]), None

        start = jnp.zeros((order + 1, *coefficients.shape[1:]))
        return jax.lax.scan(added, start, coefficients, reverse=True)[0]

    return polynomial.map(shifted)


def _horner(
    coefficients: Float[Numbers, "order component body #batch"], step: Lanes
) -> Float[Numbers, "component body batch"]:
    def added(value: Any, coefficient: Any) -> tuple[Any, None]:
        return value * step[None, None] + coefficient, None

    if traces_one_instant():  # a loop has one iteration in the code instead of all of them
        return jax.lax.scan(added, coefficients[-1], coefficients[:-1], reverse=True)[0]
    value = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        value, _ = added(value, coefficient)
    return value


def near_singular(equations: Equations, inverse: Inverse) -> Flags:
    """Return whether constraint rows are nearly dependent, from the inverse of the matrix of the equations."""
    return inverse.responses(equations.system.shape[1])[1] > BRACED


def _is_growing_rounding(sizes: Sizes) -> Flags:
    """Return whether the upper coefficients may be rounding that grows geometrically.

    Coefficients also grow at the foot of a force; only near a singular position are they rounding. If the motion hardly
    advances within their radius of convergence, a pole lies ahead, whose series grow from faint terms as well, and the
    step must not pass it.
    """
    count = len(sizes)
    middle, top = (jnp.log(jnp.maximum(jnp.max(sizes[max(k - 4, 0) : k], axis=0), 1e-300)) for k in (count // 2, count))
    growth = (top - middle) / (count - count // 2)
    faint = middle - (count // 2) * growth < math.log(FAINT)
    return (growth > 0) & faint & (sizes[0] * jnp.exp(-growth) > NEAR)


def coefficient_sizes(expansion: Expansion, length: Number) -> Sizes:
    """Return the sizes of the Taylor coefficients 1 to order + 1 of positions, rad or sizes of the mechanism.

    Values that are not finite become infinite.
    """
    velocity, spin = (jnp.max(jnp.abs(c), axis=(1, 2)) for c in expansion.state[2:])
    sizes = jnp.maximum(velocity / length, spin) / jnp.arange(1.0, len(velocity) + 1)[:, None]
    attitude = expansion.state.attitude
    if attitude.shape[1] == 1:
        return _finite_or_infinite(sizes)
    # the series of Euler parameters of a body with constant angular velocity does not end
    turned = 2.0 * jnp.max(jnp.abs(attitude[1:]), axis=(1, 2))
    return _finite_or_infinite(jnp.concatenate([jnp.maximum(sizes[:-1], turned), sizes[-1:]]))


def _finite_or_infinite(sizes: Sizes) -> Sizes:
    return jnp.where(jnp.isfinite(sizes), sizes, jnp.inf)


def reach(sizes: Sizes, first: int) -> Lanes:
    """Return the time within which no Taylor term from the order `first` on exceeds one.

    All terms count, since the last two may vanish together, as for a body at rest or at a turning point.
    """
    orders = jnp.arange(1.0, len(sizes) + 1)[first - 1 :]
    roots = jnp.power(jnp.maximum(sizes[first - 1 :], 1e-300), -1.0 / orders[:, None])
    return jnp.min(roots, axis=0)


def in_proportion(allowed: Lanes, step: Lanes, usual: Lanes) -> Lanes:
    """Return the allowed error of steps, reduced in proportion for steps shorter than usual."""
    return allowed * jnp.minimum(step / jnp.maximum(usual, 1e-300), 1.0)


def furthest(
    sizes: Sizes, allowed: Lanes, usual: Lanes | None = None, duration: Number | None = None, power: Any = 2.0
) -> tuple[Bool[Numbers, "order batch"], Lanes]:
    """Return the coefficients of series to keep, from order zero on, for the longest step, and its length, s.

    Parameters
    ----------
    sizes : array of shape (order + 1, batch)
        Sizes of the coefficients from order one on.
    allowed : array of shape (batch,)
        Allowed error of a step.
    usual : array of shape (batch,), optional
        Usual length of steps, s; shorter steps are allowed an error reduced by a power of the ratio.
    duration : float, optional
        Duration of the run, s; the velocity error of a step, from its accelerations, acts until the end of the run.
    power : float or array of shape (batch,), default 2.0
        The power: a square, since rounding beside a jump grows from term to term and uses up the whole allowance.
    """
    orders = np.arange(1.0, len(sizes) + 1)
    roots = -jnp.log(jnp.maximum(sizes, 1e-300)) / orders[:, None]  # logarithms: powers would cost far more
    cuts = np.arange(LOWEST_ORDER, len(sizes))[:, None]
    counted = (slice((k + 1) // 2 - 1, k + 1) for k in cuts[:, 0])  # the upper half of the kept terms, and the next
    reaches = jnp.stack([jnp.min(roots[part], axis=0) for part in counted])
    steps = reaches + jnp.log(allowed)[None] / (cuts + 1.0)
    if duration is not None:
        highest = cuts.astype(float)
        lasting = (highest + 1.0) * steps - np.log(highest * (highest + 1.0)) - jnp.log(duration)
        steps = jnp.minimum(steps, lasting / highest)
    if usual is not None:
        powers = jnp.broadcast_to(jnp.asarray(power, float), usual.shape)[None]
        shorter = (cuts + 1.0) * steps - powers * jnp.log(jnp.maximum(usual, 1e-300))[None]
        steps = jnp.minimum(steps, shorter / (cuts + 1.0 - powers))
    best = jnp.argmax(steps, axis=0)
    used = np.arange(len(sizes))[:, None] <= best[None] + LOWEST_ORDER
    return used, jnp.exp(jnp.max(steps, axis=0))


class Taylor(AbstractMethod):
    """Taylor series of the constrained motion, with a given order or one that fits the tolerance.

    Parameters
    ----------
    order : int, optional
        From 4 to 40; by default from the tolerance.
    step : float, optional
        Length of all steps, s; by default from error control.

    Examples
    --------
    >>> import jounce as jn
    >>> jn.Taylor().expansion_order(1e-12)
    23
    """

    order: int | None = field(static=True, default=None)
    step: float | int | None = None

    def __check_init__(self):
        if self.order is not None and not (isinstance(self.order, int) and 4 <= self.order <= MAX_ORDER):
            message = f"the order of Taylor series is a whole number from 4 to {MAX_ORDER}"
            raise JounceError(message, name="order", value=self.order)
        check_step(self.step)

    def expansion_order(self, tolerance: float) -> int:
        """Return the given order, or one that takes little time for a unit of time at this tolerance."""
        return self.order or min(round(9.0 - 0.5 * math.log(tolerance)), 28)

    def longest_step(self, sizes: Sizes, tolerance: Number) -> Lanes:
        """Return the step at which the terms of the upper half of the orders predict the tolerated error."""
        if self.step is not None:
            return jnp.full(sizes.shape[1], self.step, float)
        count = len(sizes)
        return reach(sizes, count // 2) * tolerance ** (1.0 / count)

    def prepared(
        self, expansion: Expansion, length: Number, tolerance: Number, singular: Flags, usual: Lanes
    ) -> tuple[Expansion, Lanes, Lanes]:
        """Return the series truncated for the longest step, the length of the step, and its allowed error.

        Near a singular position the higher coefficients are rounding, and the truncated series is much better. Its
        allowed error is larger, so that the step passes the singular position: rounding grows with the inverse of the
        distance from it, and steps that keep the error small would only approach it. If the step is short, its allowed
        error is reduced in proportion, which bounds that of the velocities.
        """
        if self.step is not None:
            return super().prepared(expansion, length, tolerance, singular, usual)
        sizes = coefficient_sizes(expansion, length)
        passing = singular & _is_growing_rounding(sizes)
        allowed = jnp.where(passing, jnp.maximum(tolerance, ROUGH), tolerance)
        used, step = furthest(sizes, allowed, usual, power=jnp.where(passing, 1.0, 2.0))

        def cut(part: Any) -> Any:
            return jnp.where(used[:, None, None], part, 0.0)

        return expansion._replace(state=expansion.state.map(cut)), step, in_proportion(allowed, step, usual)

    def arrive(self, equations: Equations, expansion: Expansion, time: Lanes, step: Lanes) -> State:
        """Return the value of the series."""
        return evaluated(expansion.state, step)

    def polynomial(self, start: Expansion, end: Expansion, step: Lanes) -> State:
        """Return the series."""
        return start.state

    def error(self, start: Expansion, end: Expansion, step: Lanes, length: Number) -> Lanes:
        """Return the error of the accelerations of the series at the end, converted to a displacement."""
        if self.step is not None:
            return jnp.zeros_like(step)
        order = len(start.state.position) - 1
        series = jnp.concatenate(list(start.state[2:]), axis=1)
        rates = series[1:] * jnp.arange(1.0, order + 1)[:, None, None, None]
        acceleration = end.acceleration[0]
        departure = (
            jnp.abs(_horner(rates, step) - acceleration)
            - ROUNDING * jnp.max(jnp.abs(acceleration), axis=(0, 1))[None, None]
        )
        shifts = start.state.velocity.shape[1]
        size = jnp.maximum(_largest(departure[:shifts]) / length, _largest(departure[shifts:]))
        return jnp.maximum(size, 0.0) * step**2 / (order * (order + 1))


def _largest(x: Float[Numbers, "component body batch"]) -> Lanes:
    return jnp.max(x, axis=(0, 1))


def check_step(step: object) -> None:
    """Raise JounceError unless the length of steps is a positive number, or None for error control."""
    if step is None or isinstance(step, jax.Array):
        return
    if isinstance(step, bool) or not isinstance(step, (int, float)) or not (step > 0 and math.isfinite(step)):
        raise JounceError("the length of steps must be a positive number of seconds", name="step", value=step)
