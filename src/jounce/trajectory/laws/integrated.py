"""Motion laws given by a derivative, such as the speed of a motor during run-up."""

import functools
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.polynomial import chebyshev

from jounce.base.modules import field
from jounce.base.shapes import Numbers
from jounce.errors import TrajectoryError
from jounce.jet import Jet
from jounce.jet.pieces import last_begun
from jounce.trajectory.beyond import SLACK
from jounce.trajectory.checks import whole_number
from jounce.trajectory.laws.composed import CompositeLaw, Law, with_values
from jounce.trajectory.laws.piecewise import PiecewiseMotion
from jounce.trajectory.laws.segment_pieces import Value, number_or_expression, parsed_value
from jounce.trajectory.laws.user_laws import read_laws
from jounce.trajectory.motion import AbstractMotion, SplineMotion
from jounce.units.expression import Expression

HIGHEST = 4  # highest derivative that may be given: jounce
PANELS = 1200  # number of panels on either side of the start, each with a polynomial
DEGREE = 15  # degree of the polynomial through the derivative on a panel
RESOLVED = 2e-14  # fraction of the largest value so far: largest error of the polynomial
FIRST, WIDENED = 1e-3, 0.1  # length of the first panel, s, and growth of panels relative to the distance from the start
NARROWED = tuple(2.0**-k for k in range(16))  # factors of the length that are tried for the next panel
ROUNDING = 1e-9  # fraction of the largest value: an error that may be rounding if no shorter panel is better
STEEPER = 10.0  # largest ratio of values on the shortest panel to those on the longest at a jump; more at a pole
SHORTEST = 1e-13  # fraction of the distance from the start: length of a panel that is accepted unchecked

_NODES = np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1))
_BETWEEN = np.cos(np.pi * np.arange(1, DEGREE + 1) / (DEGREE + 1))
_ABSCISSAS = np.concatenate([_NODES, _BETWEEN])[None]
_FITTED = np.linalg.inv(chebyshev.chebvander(_NODES, DEGREE))  # from values at the nodes to Chebyshev coefficients
_SEEN = chebyshev.chebvander(_BETWEEN, DEGREE)
_RAISED = np.stack([chebyshev.chebint(row, lbnd=-1) for row in np.eye(DEGREE + 1)], axis=1)


class IntegratedMotion(CompositeLaw):
    """A motion law of which a derivative is given as another law, for example a known speed.

    Its derivatives from the given one on are exactly those of the law. Lower ones follow by integration over panels so
    short that a polynomial of degree 15 equals the law to rounding.

    Parameters
    ----------
    law : AbstractMotion, Expression or str
        Law of the derivative, m or rad per s to the power of `derivative`; an expression of ``t`` and of parameters.
    derivative : int, default 1
        Order of the derivative: 1 velocity, 2 acceleration, 3 jerk, 4 jounce.
    initial : sequence of float, str or Expression, optional
        The law and its derivatives below `derivative` at the start, lowest first; zero by default.
    start : float, str or Expression, default 0
        Instant of the initial values, s.

    Raises
    ------
    TrajectoryError
        If something is no law or no number, or there are too many initial values.

    Examples
    --------
    >>> import jounce as jn
    >>> run_up = jn.laws.IntegratedMotion("100*(1 - exp(-t/0.2))")  # rad/s
    >>> [round(float(x), 4) for x in run_up(jn.Jet.variable(0.5, order=2)).derivatives()]
    [31.6417, 91.7915, 41.0425]
    """

    initial: Any
    start: Any
    breakpoints: Any
    halves: Any
    coefficients: Any
    derivative: int = field(static=True)

    def __init__(self, law: Law, derivative: int = 1, initial: Sequence[Value] = (), start: Value = 0.0):
        order = self.derivative = whole_number("derivative", derivative, 1, HIGHEST)
        if isinstance(initial, str) or not isinstance(initial, Sequence) or len(initial) > order:
            message = f"must be a list of at most {order} values: the law and its derivatives below that one"
            raise TrajectoryError(message, name="initial", value=initial)
        values = [*initial, *(0.0,) * (order - len(initial))]
        initials = [number_or_expression(f"initial[{k}]", x) for k, x in enumerate(values)]
        start_value = number_or_expression("start", start)
        inner = law if order == 1 else IntegratedMotion(law, order - 1, initials[1:], start_value)
        self._take([inner], law, tuple(initials), start_value)
        waiting = any(isinstance(x, Expression) for x in (*initials, start_value)) or not self.parts
        self.initial, self.start = (None, None) if waiting else (initials[0], start_value)
        self.breakpoints = self.halves = self.coefficients = None
        if waiting:
            self.parts = ()
            return
        start_value = jnp.asarray(start_value, float)
        begins, halves, powers = _panels(read_laws(self.parts[0]), jax.lax.stop_gradient(start_value))
        self.breakpoints, self.halves, self.coefficients = begins, halves, powers
        self.initial = initials[0] - _at(begins, halves, powers, start_value)  # zero but for its slope by the start

    @property
    def is_open(self) -> bool:
        """Whether the start or an initial value is an expression of parameters without values."""
        return self.initial is None

    def resolved(self, parameters: Mapping[str, Any]) -> "IntegratedMotion":
        """Return the law with numbers in the place of parameters."""
        if not self.is_open:
            return self
        _, law, initial, start = self.recipe.value
        numbers = [x.evaluate(parameters) if isinstance(x, Expression) else x for x in (*initial, start)]
        if isinstance(law, str | Expression):
            law = with_values(parsed_value(law), parameters)
        else:
            law = law.resolved(parameters)
        return IntegratedMotion(law, self.derivative, numbers[:-1], numbers[-1])

    def check_instants(self, first: float, last: float) -> None:
        """Raise MechanismError if the derivative is not defined between the start and the requested instants."""
        if self.is_open:
            return
        start = float(self.start)
        self.parts[0].check_instants(min(first, start), max(last, start))
        ends = float(self.breakpoints[0]), float(self.breakpoints[-1] + 2 * self.halves[-1])
        slack = SLACK * (last - first)
        for instant, lower, upper in ((first, ends[0] - slack, np.inf), (last, -np.inf, ends[1] + slack)):
            if not lower <= instant <= upper:
                message = (
                    f"the law with this derivative is integrated from {ends[0]:.6g} to {ends[1]:.6g} s only, "
                    "as it varies so finely or has no value beyond; choose another start"
                )
                raise TrajectoryError(message, value=instant)

    def __call__(self, time: Jet) -> Jet:
        """Return the jet of the law at the instants of the time jet; parameters need values, see `resolved`."""
        (law,) = self._known_parts()
        value = self._integral(time.coefficients[0]) + self.initial
        if time.order == 0:
            return Jet([value])
        rate = law(time.truncate(time.order - 1)) * time.differentiate()
        return rate.integrate(value)

    def _integral(self, instants: Any) -> Any:
        """Return the integral from the start to given instants; NaN beyond the panels."""
        begins, halves, table = self.breakpoints, self.halves, self.coefficients
        if np.ndim(begins) > 1:  # several stacked laws of one kind, along an axis before the batch
            rows = jnp.broadcast_to(instants, (begins.shape[1], jnp.shape(instants)[-1]))
            return jax.vmap(_at, in_axes=(1, 1, 2, 0))(begins[..., 0], halves[..., 0], table[..., 0], rows)
        return _at(begins, halves, table, instants)


def _at(begins: Any, halves: Any, table: Any, instants: Any) -> Any:
    index = last_begun(begins, instants)
    start, half, powers = (x.at[..., index].get(mode="promise_in_bounds") for x in (begins, halves, table))
    u = (instants - start) / half - 1.0
    b1 = b2 = jnp.zeros_like(u)  # Clenshaw recurrence
    for c in powers[:0:-1]:
        b1, b2 = c + 2.0 * u * b1 - b2, b1
    is_inside = jnp.abs(u) <= 1.0 + 1e-6
    return jnp.where(is_inside, powers[0] + u * b1 - b2, jnp.nan)


@jax.jit
def _panels(law: AbstractMotion, start: Any) -> tuple[Numbers, Numbers, Numbers]:
    """Return panels on both sides of a start, and the integral of a law from the start on each panel.

    Returns
    -------
    begins : array of shape (panels,)
        Beginnings of the panels, s, not decreasing.
    halves : array of shape (panels,)
        Half lengths of the panels, s.
    coefficients : array of shape (degree + 2, panels)
        Coefficients of Chebyshev polynomials on the panels.
    """
    lengths, constant_law = jnp.asarray(NARROWED), jax.tree.map(jax.lax.stop_gradient, law)

    def values(law: AbstractMotion, instants: Any) -> Any:
        flat = law(Jet([instants.reshape(-1)])).dense().coefficients[0]
        return jnp.broadcast_to(flat, instants.size).reshape(instants.shape)

    def panel(sign: Any, state: Any, _: Any) -> tuple[Any, Any]:
        border, length, max_value, total = state
        distance = jnp.abs(border - start)
        min_length = SHORTEST * jnp.maximum(jnp.abs(border), distance) + 1e-300
        to_border = sign * (_next_border(constant_law, border, sign, min_length) - border)
        trials = jnp.minimum(jnp.minimum(2.0 * length, FIRST + WIDENED * distance) * lengths, to_border)
        trials = jax.lax.stop_gradient(jnp.maximum(trials, min_length))
        half = trials / 2.0
        middle = border + sign * half
        nodes = middle[:, None] + half[:, None] * _ABSCISSAS
        samples = values(constant_law, nodes)
        fitted = samples[:, : DEGREE + 1] @ _FITTED.T
        sizes = jnp.maximum(max_value, jnp.max(jnp.abs(samples), axis=1))
        errors = jnp.max(jnp.abs(samples[:, DEGREE + 1 :] - fitted @ _SEEN.T), axis=1)
        finite = jnp.isfinite(errors)
        noise = 4.0 * jnp.min(jnp.where(finite, errors, jnp.inf))  # not resolved by shorter panels, either
        fine = errors <= jnp.maximum(RESOLVED * sizes, jnp.minimum(noise, ROUNDING * sizes))
        peaks = jnp.max(jnp.abs(samples), axis=1)
        jumps = (trials <= min_length) & finite & (peaks <= STEEPER * jnp.maximum(peaks[0], max_value))  # not a pole
        fine = finite & (fine | jumps)
        any_fine = jnp.any(fine)
        pick = jnp.where(any_fine, jnp.argmax(fine), len(NARROWED) - 1)
        # only the accepted panel has slopes by parameters: others may have unbounded values
        chosen = values(law, jnp.where(any_fine, nodes[pick, : DEGREE + 1], start))
        raised = (_FITTED @ chosen) @ _RAISED.T * half[pick]
        gain = jnp.sum(raised)  # at the right end, where every polynomial is 1
        panel_start = jnp.where(sign > 0, border, border - trials[pick])
        start_integral = jnp.where(sign > 0, total, total - gain)
        end = jnp.where(any_fine, border + sign * trials[pick], border)
        next_total = jnp.where(any_fine, total + sign * gain, total)
        panel_values = jnp.where(any_fine, raised.at[0].add(start_integral), 0.0), jnp.where(any_fine, half[pick], 0.0)
        size = jnp.where(any_fine, sizes[pick], max_value)
        return (end, trials[pick], size, next_total), (jnp.where(any_fine, panel_start, border), *panel_values)

    state = start, jnp.asarray(FIRST), jnp.zeros(()), jnp.zeros(())

    def side(sign: Any) -> Any:
        return jax.lax.scan(functools.partial(panel, sign), state, None, length=PANELS)[1]

    sides = jax.vmap(side)(jnp.array([-1.0, 1.0]))
    begins, powers, halves = (jnp.concatenate([x[0, ::-1], x[1]]) for x in sides)
    return jax.lax.stop_gradient(begins), jax.lax.stop_gradient(halves), powers.T


def _next_border(law: AbstractMotion, instant: Any, sign: Any, min_distance: Any) -> Any:
    """Return the next instant at which pieces of a law meet; infinite if none is known."""
    if isinstance(law, IntegratedMotion):
        return _next_border(law.parts[0], instant, sign, min_distance)
    if isinstance(law, PiecewiseMotion):
        ends = [*([] if law.start is None else [law.start]), *law.until]
        borders, repeats = jnp.stack([jnp.asarray(x, float) for x in ends]) if ends else None, law.beyond
        inner = [_next_border(piece, instant, sign, min_distance) for piece in law.parts if law.beyond == "continue"]
    elif isinstance(law, SplineMotion):
        borders = jnp.append(jnp.asarray(law.breakpoints, float), jnp.asarray(law.stop, float))
        repeats, inner = law.beyond, []
    else:
        return sign * jnp.inf
    candidates = [sign * x for x in inner]
    if borders is not None:
        shift = 0.0
        if repeats in ("repeat", "advance"):
            period = borders[-1] - borders[0]
            shift = jnp.floor((instant + sign * 2 * min_distance - borders[0]) / period) * period
            borders = jnp.concatenate([borders[:1] - period, borders, borders[-1:] + period])
        distances = sign * (borders + shift - instant)
        candidates.append(jnp.min(jnp.where(distances > 2 * min_distance, distances, jnp.inf)) + sign * instant)
    return sign * functools.reduce(jnp.minimum, candidates, jnp.inf)
