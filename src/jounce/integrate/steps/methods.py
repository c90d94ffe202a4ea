"""Integration methods: how far a step may go, where it arrives, how well, and its polynomial in between."""

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
# response to a gap of one, in largest masses: 30 and more where rounding hides coefficients, else below 26
BRACED = 20.0
NEAR = 1e-6  # near a pole: how far a body moves within the radius of a series, rad or sizes of the mechanism
ROUGH = 1e-11  # tolerance of a step where rounding hides coefficients, rad or sizes of the mechanism
MARGIN = 10.0  # an error estimate up to this many times the tolerance is accepted, since estimates are rough
ROUNDING = 1e-14  # relative error of an acceleration that does not show that a step is too long


class AbstractMethod(Module):
    """A one-step method on Taylor expansions of the constrained motion.

    Every step starts from the expansion of the motion at its beginning, ends on the constraints, and is accepted where
    the accelerations of the equations there agree with those of its polynomial.
    """

    @property
    def controlled(self) -> bool:
        """Whether steps are chosen by their error, and shortened where a force on the way would stay unseen."""
        return getattr(self, "step", None) is None

    @abc.abstractmethod
    def expansion_order(self, tolerance: float) -> int:
        """Return the order of the expansions that the method needs."""

    @abc.abstractmethod
    def longest_step(self, sizes: Sizes, tolerance: Number) -> Lanes:
        """Return how far a step may go, s.

        Parameters
        ----------
        sizes : array of shape (order + 1, batch)
            Sizes of the Taylor coefficients 1 to order + 1 of the positions, rad or sizes of the mechanism.
        tolerance : float
            Of the error of a step, in the same measure.
        """

    def prepared(
        self, expansion: Expansion, length: Number, tolerance: Number, singular: Flags, usual: Lanes
    ) -> tuple[Expansion, Lanes, Lanes]:
        """Return the expansion as the step shall use it, how far that may go, s, and by which tolerance to judge it.

        Steps that are shorter than usual, as those from a jump of a force on, may leave out less (`in_proportion`): a
        place that is wrong by so much means a velocity that is wrong by as much by the time of the step, and that goes
        on to the end of the run.

        Parameters
        ----------
        expansion : Expansion
            At the beginning of the step.
        length : float
            Size of the mechanism, m.
        tolerance : float
            Of the error of the step, rad or sizes of the mechanism.
        singular : array of bool, shape (batch,)
            Whether the equations of motion are near to singular there, as `near_singular` tells.
        usual : array of shape (batch,)
            Length of a step that is not short, s; zero where none is known.
        """
        step = self.longest_step(coefficient_sizes(expansion, length), tolerance)
        return expansion, step, in_proportion(jnp.full(step.shape, tolerance), step, usual)

    @abc.abstractmethod
    def arrive(self, equations: Equations, expansion: Expansion, time: Lanes, step: Lanes) -> State:
        """Return the state at the end of a step, not yet on the constraints; `time` is that of its beginning.

        Angles about axes that forces measure have, in the equations, the turns of the end of the step.
        """

    @abc.abstractmethod
    def polynomial(self, start: Expansion, end: Expansion, step: Lanes) -> State:
        """Return the coefficients of the step's polynomial in the time from its beginning, order first."""

    @abc.abstractmethod
    def error(self, start: Expansion, end: Expansion, step: Lanes, length: Number) -> Lanes:
        """Return an estimate of the error of a step, rad or sizes of the mechanism."""


def evaluated(polynomial: State, step: Lanes) -> State:
    """Return the values of the polynomials of a state a time `step` away."""
    return polynomial.map(lambda c: _horner(c, step))


def _horner(
    coefficients: Float[Numbers, "order component body #batch"], step: Lanes
) -> Float[Numbers, "component body batch"]:
    def added(value: Any, coefficient: Any) -> tuple[Any, None]:
        return value * step[None, None] + coefficient, None

    if traces_one_instant():  # one turn is written there, instead of all of them
        return jax.lax.scan(added, coefficients[-1], coefficients[:-1], reverse=True)[0]
    value = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        value, _ = added(value, coefficient)
    return value


def near_singular(equations: Equations, inverse: Inverse) -> Flags:
    """Tell where rows of the constraints are about to depend on each other, from the inverse of the matrix."""
    return inverse.responses(equations.system.shape[1])[1] > BRACED


def _is_growing_rounding(sizes: Sizes) -> Flags:
    """Tell where the upper coefficients may be rounding that grows geometrically.

    A force of which only the foot has been met grows so too: near a singular position alone is it rounding.

    Where the motion itself would hardly get on within the radius that they show, there is a pole in the way, whose
    series grow faintly too: it must not be passed.
    """
    count = len(sizes)
    middle, top = (jnp.log(jnp.maximum(jnp.max(sizes[max(k - 4, 0) : k], axis=0), 1e-300)) for k in (count // 2, count))
    growth = (top - middle) / (count - count // 2)
    faint = middle - (count // 2) * growth < math.log(FAINT)
    return (growth > 0) & faint & (sizes[0] * jnp.exp(-growth) > NEAR)


def coefficient_sizes(expansion: Expansion, length: Number) -> Sizes:
    """Return the sizes of the Taylor coefficients 1 to order + 1 of positions, rad or sizes of the mechanism.

    Those that are no finite numbers are infinite.
    """
    velocity, spin = (jnp.max(jnp.abs(c), axis=(1, 2)) for c in expansion.state[2:])
    sizes = jnp.maximum(velocity / length, spin) / jnp.arange(1.0, len(velocity) + 1)[:, None]
    attitude = expansion.state.attitude
    if attitude.shape[1] == 1:
        return _finite_or_infinite(sizes)
    # Euler parameters of a body that spins evenly go on where its angular velocity has no more terms
    turned = 2.0 * jnp.max(jnp.abs(attitude[1:]), axis=(1, 2))
    return _finite_or_infinite(jnp.concatenate([jnp.maximum(sizes[:-1], turned), sizes[-1:]]))


def _finite_or_infinite(sizes: Sizes) -> Sizes:
    return jnp.where(jnp.isfinite(sizes), sizes, jnp.inf)


def reach(sizes: Sizes, first: int) -> Lanes:
    """Return the time in which no Taylor term from the order `first` on exceeds one.

    All of them count: the last two may vanish together, as those of a body at rest or at a turning point do.
    """
    orders = jnp.arange(1.0, len(sizes) + 1)[first - 1 :]
    roots = jnp.power(jnp.maximum(sizes[first - 1 :], 1e-300), -1.0 / orders[:, None])
    return jnp.min(roots, axis=0)


def in_proportion(allowed: Lanes, step: Lanes, usual: Lanes) -> Lanes:
    """Return the error that is allowed of steps, less of those that are shorter than usual."""
    return allowed * jnp.minimum(step / jnp.maximum(usual, 1e-300), 1.0)


def furthest(
    sizes: Sizes, allowed: Lanes, usual: Lanes | None = None, duration: Number | None = None
) -> tuple[Bool[Numbers, "order batch"], Lanes]:
    """Return which coefficients of series to keep, from order zero on, so that they carry furthest, and how far, s.

    Parameters
    ----------
    sizes : array of shape (order + 1, batch)
        Of the coefficients from order one on.
    allowed : array of shape (batch,)
        Error of a step.
    usual : array of shape (batch,), optional
        Length of steps, s, below which the error is allowed by the square of the proportion: rounding beside a jump
        grows from term to term, so that all that is allowed is left out.
    duration : float, optional
        Of the run, s, to whose end a velocity moves on that the step leaves wrong by the error of its accelerations.
    """
    orders = np.arange(1.0, len(sizes) + 1)
    roots = -jnp.log(jnp.maximum(sizes, 1e-300)) / orders[:, None]  # logarithms: powers would cost far more
    cuts = np.arange(LOWEST_ORDER, len(sizes))[:, None]
    counted = (slice((k + 1) // 2 - 1, k + 1) for k in cuts[:, 0])  # the upper half of what is kept, and the next
    reaches = jnp.stack([jnp.min(roots[part], axis=0) for part in counted])
    steps = reaches + jnp.log(allowed)[None] / (cuts + 1.0)
    if duration is not None:
        highest = cuts.astype(float)
        lasting = (highest + 1.0) * steps - np.log(highest * (highest + 1.0)) - jnp.log(duration)
        steps = jnp.minimum(steps, lasting / highest)
    if usual is not None:
        shorter = (cuts + 1.0) * steps - 2.0 * jnp.log(jnp.maximum(usual, 1e-300))[None]
        steps = jnp.minimum(steps, shorter / (cuts - 1.0))
    best = jnp.argmax(steps, axis=0)
    used = np.arange(len(sizes))[:, None] <= best[None] + LOWEST_ORDER
    return used, jnp.exp(jnp.max(steps, axis=0))


class Taylor(AbstractMethod):
    """Taylor series of the constrained motion, of a chosen order or one that suits the tolerance.

    Parameters
    ----------
    order : int, optional
        From 4 to 40; from the tolerance unless given.
    step : float, optional
        The length of all steps, s; by a control of the error unless given.

    Examples
    --------
    >>> import jounce as jn
    >>> jn.Taylor().expansion_order(1e-12)
    21
    """

    order: int | None = field(static=True, default=None)
    step: float | int | None = None

    def __check_init__(self):
        if self.order is not None and not (isinstance(self.order, int) and 4 <= self.order <= MAX_ORDER):
            message = f"the order of Taylor series is a whole number from 4 to {MAX_ORDER}"
            raise JounceError(message, name="order", value=self.order)
        check_step(self.step)

    def expansion_order(self, tolerance: float) -> int:
        """Return the order: of all, the one that takes the fewest terms for a unit of time, at this tolerance."""
        return self.order or min(max(round(-0.75 * math.log(tolerance)), 6), 28)

    def longest_step(self, sizes: Sizes, tolerance: Number) -> Lanes:
        """Return the step at which the terms of the upper half of the orders point to an error within tolerance."""
        if self.step is not None:
            return jnp.full(sizes.shape[1], self.step, float)
        count = len(sizes)
        return reach(sizes, count // 2) * tolerance ** (1.0 / count)

    def prepared(
        self, expansion: Expansion, length: Number, tolerance: Number, singular: Flags, usual: Lanes
    ) -> tuple[Expansion, Lanes, Lanes]:
        """Return the series cut where it carries furthest, and how far that is.

        Near a singular position the higher coefficients drown in rounding: the cut series is then much the better one.
        Its error may be larger, so that the step passes over the singular position: rounding grows with the inverse of
        the distance from there, and steps that keep it small would come near, and nearer.
        """
        if self.step is not None:
            return super().prepared(expansion, length, tolerance, singular, usual)
        sizes = coefficient_sizes(expansion, length)
        allowed = jnp.where(singular & _is_growing_rounding(sizes), jnp.maximum(tolerance, ROUGH), tolerance)
        used, step = furthest(sizes, allowed, usual)

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
        """Return what accelerations at the end depart by from the series, as the displacement that is left out."""
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
    """Refuse a length of steps that is no positive number; None leaves it to the control of the error."""
    if step is None or isinstance(step, jax.Array):
        return
    if isinstance(step, bool) or not isinstance(step, (int, float)) or not (step > 0 and math.isfinite(step)):
        raise JounceError("the length of steps must be a positive number of seconds", name="step", value=step)
