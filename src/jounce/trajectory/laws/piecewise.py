"""Motion laws that consist of consecutive laws, possibly repeated."""

from collections.abc import Mapping, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Float

from jounce.base.modules import field
from jounce.base.shapes import is_traced
from jounce.errors import MechanismError, TrajectoryError, check_choice
from jounce.jet import Jet
from jounce.trajectory.beyond import CLOSED, check_within, continued, not_before
from jounce.trajectory.knots import SMOOTH, derivative_sizes
from jounce.trajectory.laws.composed import CompositeLaw, Law
from jounce.trajectory.laws.segment_pieces import Value, number_or_expression, parsed_value
from jounce.units.expression import Expression

BEYOND = ("refuse", "hold", "repeat", "advance")


class PiecewiseMotion(CompositeLaw):
    """A motion law that consists of consecutive laws, each until a given instant.

    Where two laws meet, derivatives are those from the right; `jumps` returns the discontinuous ones.

    Parameters
    ----------
    laws : sequence of AbstractMotion, Expression or str
        Laws in order; expressions of ``t``, the time since zero, and of the parameters of a mechanism.
    until : sequence of float, str or Expression
        Increasing instants at which the laws end, s, possibly expressions of parameters. If the last law has no end, it
        continues forever, and the first one continues backward.
    start : float, str or Expression, optional
        Beginning of the first law, s, if the last one ends; 0 by default.
    beyond : {"refuse", "hold", "repeat", "advance"}, default "refuse"
        The law before its beginning and after its end: an error; the value of the end, at rest; a repetition, for laws
        that end where they began; or a repetition that advances from where the laws ended.

    Raises
    ------
    TrajectoryError
        If the instants do not increase, are too few or too many, or laws to be repeated are not closed.

    Examples
    --------
    >>> import jounce as jn
    >>> law = jn.laws.PiecewiseMotion(["t**2", "2*t - 1"], until=[1.0])
    >>> [float(x) for x in law(jn.Jet.variable(3.0, order=2)).derivatives()]
    [5.0, 2.0, 0.0]
    >>> instants, jumps = law.jumps(2)
    >>> instants.tolist(), jumps[:, 0].tolist()  # acceleration goes from 2 to 0 at 1 s
    ([1.0], [0.0, 0.0, -2.0])
    >>> table = jn.laws.PiecewiseMotion(["t", "1"], until=[1.0, 3.0], beyond="advance")  # goes on by 1 every 3 s
    >>> [float(x) for x in table(jn.Jet.variable(6.5, order=1)).derivatives()]
    [2.5, 1.0]
    """

    until: Any
    start: Any
    advance: Any
    beyond: str = field(static=True)

    def __init__(self, laws: Sequence[Law], until: Sequence[Value], start: Value | None = None, beyond: str = "refuse"):
        check_choice("beyond", beyond, BEYOND, TrajectoryError)
        if isinstance(laws, str) or not isinstance(laws, Sequence) or not laws:
            raise TrajectoryError("must be a list of laws", name="laws", value=laws)
        ends = [number_or_expression(f"until[{k}]", x) for k, x in enumerate(until)]
        if len(ends) not in (len(laws) - 1, len(laws)):
            message = f"{len(laws)} laws need {len(laws) - 1} instants, at which all but the last end, or one more"
            raise TrajectoryError(message, name="until", value=len(ends))
        bounded = len(ends) == len(laws)
        if not bounded and (start is not None or beyond != BEYOND[0]):
            name, value = ("beyond", beyond) if beyond != BEYOND[0] else ("start", start)
            raise TrajectoryError("the last law has no end; say until when it goes", name=name, value=value)
        first = number_or_expression("start", 0.0 if start is None else start) if bounded else None
        borders = [first, *ends] if bounded else ends
        self.beyond = beyond if bounded else "continue"
        self._take(laws, tuple(ends), start, beyond)
        if any(isinstance(x, Expression) for x in borders):
            self.parts, self.until, self.start, self.advance = (), (), None, None
            return
        if not any(isinstance(x, Tracer) for x in borders) and (np.diff(borders) <= 0).any():
            if bounded and ends[0] <= first and (np.diff(ends) > 0).all():
                message = "the first law must end after it begins; give start, which is 0 unless given"
                raise TrajectoryError(message, name="until[0]", value=ends[0])
            raise TrajectoryError("must increase", name="until", value=ends)
        self.until, self.start = tuple(ends), first
        self.advance = self._gain() if bounded and self.parts and beyond in ("repeat", "advance") else None

    def _gain(self) -> Any:
        """Return the gain of the law over a repetition."""
        start_value, end_value = (
            law(Jet([jnp.asarray(instant, float)])).coefficients[0]
            for law, instant in ((self.parts[0], self.start), (self.parts[-1], self.until[-1]))
        )
        gain = end_value - start_value
        if self.beyond == "advance" or is_traced(gain):
            return gain if self.beyond == "advance" else jnp.zeros_like(gain)
        gain = float(gain)
        peak = float(np.max([size[0] for size in self._sizes(0)]))
        if not abs(gain) <= CLOSED * peak:
            message = f"do not end where they begin, but {gain:.6g} from there; close them, or choose beyond: advance"
            raise TrajectoryError(message, name="laws", value=float(end_value))
        return 0.0

    @property
    def is_open(self) -> bool:
        """Whether instants are expressions of parameters without values."""
        return any(isinstance(x, Expression) for x in (*self.recipe.value[1], parsed_value(self.recipe.value[2])))

    def resolved(self, parameters: Mapping[str, Any]) -> "PiecewiseMotion":
        """Return the law with numbers in the place of parameters."""
        _, ends, start, beyond = self.recipe.value
        numbers = [x.evaluate(parameters) if isinstance(x, Expression) else x for x in (*ends, parsed_value(start))]
        return PiecewiseMotion(self._resolved_parts(parameters), numbers[:-1], numbers[-1], beyond)

    def check_instants(self, first: float, last: float) -> None:
        """Raise MechanismError if a law is not defined at the requested instants within its piece, or no law is."""
        if not self.parts:
            return
        if self.beyond != "continue":
            start, stop = float(self.start), float(self.until[-1])
            if self.beyond == "refuse":
                check_within(first, last, start, stop, "laws")
            repeats = self.beyond == "repeat" or self.beyond == "advance"
            first, last = (start, stop) if repeats else np.clip((first, last), start, stop).tolist()
        begins, ends = self._borders()
        for law, begin, end in zip(self.parts, begins, ends, strict=True):
            if first < end and last >= begin:
                law.check_instants(max(first, begin), min(last, end))

    def _borders(self) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
        """Return the beginning and the end of each law; the first and the last are unbounded."""
        inner = self.until[: len(self.parts) - 1]
        return (-np.inf, *inner), (*inner, np.inf)

    def __call__(self, time: Jet) -> Jet:
        """Return the jet of the law at the instants of the time jet; parameters need values, see `resolved`."""
        self._known_parts()
        values = self.until, self.start, time.coefficients[0]
        if self.beyond == "refuse" and np.ndim(self.start) == 0 and not is_traced(values) and np.size(values[2]):
            self.check_instants(float(np.min(values[2])), float(np.max(values[2])))
        mode = "repeat" if self.beyond == "advance" else self.beyond
        stop = self.until[-1] if self.beyond != "continue" else None
        return continued(self._within, time, self.start, stop, mode, 0.0 if self.advance is None else self.advance)

    def _within(self, time: Jet, choosing: Any) -> Jet:
        instants = time.coefficients[0]
        begins, ends = self._borders()
        value: tuple[Any, ...] = ()
        for law, start, end in zip(self.parts, begins, ends, strict=True):
            is_own = (choosing >= start) & (choosing < end)
            # outside its piece, a law may be undefined: it is evaluated at an instant of the piece
            inner = jnp.clip(instants, start, jnp.where(jnp.isinf(start), end, start))
            own = jnp.where(is_own, not_before(start, instants), inner)
            coefficients = law(Jet((own, *time.coefficients[1:]))).dense().coefficients
            value = tuple(jnp.where(is_own, f, v) for f, v in zip(coefficients, value or coefficients, strict=True))
        return Jet(value)

    def jumps(self, order: int = 4) -> tuple[Float[np.ndarray, " knots"], Float[np.ndarray, "{order}+1 knots"]]:
        """Return the instants at which laws meet, with the ends if there are any, and the jumps of derivatives there.

        Parameters
        ----------
        order : int, default 4
            Highest derivative.

        Returns
        -------
        instants : ndarray of shape (knots,)
            Instants, s; for laws that repeat, the beginning represents the end, too.
        jumps : ndarray of shape (order + 1, knots)
            Values from the right minus those from the left, m or rad per s to the power of the order; rounding is zero.

        Examples
        --------
        >>> import jounce as jn
        >>> jn.laws.PiecewiseMotion(["t**3", "0"], until=[0.0]).jumps(3)[1][:, 0].tolist()
        [0.0, 0.0, 0.0, -6.0]
        """
        laws = self._known_parts()
        pairs = list(zip(self.until, laws, laws[1:], strict=False))
        sizes = self._sizes(order) if self.until else []
        zeros = np.zeros(order + 1)
        instants = [time for time, *_ in pairs]
        jumps = [
            _jump(_derivatives(left, time, order), _derivatives(right, time, order), np.maximum(*sizes[k : k + 2]))
            for k, (time, left, right) in enumerate(pairs)
        ]
        if self.beyond in ("hold", "repeat", "advance"):
            first, last = _derivatives(laws[0], self.start, order), _derivatives(laws[-1], self.until[-1], order)
            held = zeros.copy()
            held[0] = first[0]
            if self.beyond == "hold":
                held_end = zeros.copy()
                held_end[0] = last[0]
                instants = [self.start, *instants, self.until[-1]]
                jumps = [_jump(held, first, sizes[0]), *jumps, _jump(last, held_end, sizes[-1])]
            else:
                last[0] -= float(self.advance)
                instants, jumps = [self.start, *instants], [_jump(last, first, np.maximum(sizes[0], sizes[-1])), *jumps]
        return np.array(instants, float), np.stack(jumps, axis=-1) if jumps else np.zeros((order + 1, 0))

    def _sizes(self, order: int) -> list[Float[np.ndarray, " levels"]]:
        """Return the size of the derivatives of each law; unbounded laws count for the length of their neighbors."""
        ends = [float(x) for x in self.until]
        if self.beyond != "continue":
            borders = [float(self.start), *ends]
        else:
            lengths = np.diff(ends) if len(ends) > 1 else [abs(ends[0]) or 1.0]
            borders = [ends[0] - lengths[0], *ends, ends[-1] + lengths[-1]]
        sizes = []
        for law, start, end in zip(self._known_parts(), borders, borders[1:], strict=False):
            try:
                sizes.append(derivative_sizes(law, start, end, order))
            except MechanismError:  # samples that end before: the derivatives at the knot are known
                instant = start if start == ends[-1] else end
                sizes.append(derivative_sizes(law, instant, instant, order))
        return sizes


def _derivatives(law: Any, instant: Any, order: int) -> Float[np.ndarray, " levels"]:
    return np.array(law(Jet.variable(np.asarray(instant, float), order)).dense().derivatives(), float)


def _jump(left: np.ndarray, right: np.ndarray, sizes: np.ndarray) -> Float[np.ndarray, " levels"]:
    """Return right minus left; zero if it is rounding relative to the sizes of the derivatives."""
    change = right - left
    return np.where(np.abs(change) <= SMOOTH * sizes, 0.0, change)
