"""Curves and surfaces fixed in a body, by expressions or through samples, as functions on jets of parameters."""

import dataclasses
from collections.abc import Mapping, Sequence
from functools import lru_cache, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Float

from jounce.base.modules import Module, field
from jounce.base.shapes import ArrayLike, by_component, real_numbers
from jounce.errors import JounceError, MechanismError, whole_number
from jounce.jet import Jet, stack
from jounce.trajectory.curve_checks import check_curve, check_points, derivatives_at, refuses_without_ends
from jounce.trajectory.motion import SplineMotion
from jounce.units.expression import Expression

HALF_WINDOW = 2 * np.pi  # of a parameter, checked on either side of the start if no range is given
LOOKS = 65  # samples of a curve for its speed


@dataclasses.dataclass(frozen=True)
class ParametricCurve:
    """A curve given by expressions of its parameter ``s``, or a surface by expressions of ``u`` and ``v``.

    Parameters
    ----------
    expressions : sequence of str or Expression
        One for each coordinate in the frame of the body, m; they may contain parameters of the mechanism.
    range : sequence of two numbers, optional
        First and last value of the parameter: the ends of the curve, or one lap of a closed curve; two pairs for a
        surface. Without it, the curve is as long as its expressions are defined.
    closed : bool, default False
        Whether the curve returns to its beginning and continues smoothly there.

    Raises
    ------
    MechanismError
        If a closed curve has no range.

    Examples
    --------
    >>> import jounce as jn
    >>> jn.joints.ParametricCurve(["0.2*cos(s)", "0.1*sin(s)"], range=[0, "2*pi"], closed=True).closed
    True
    """

    expressions: Any  # a tuple
    range: Any = None
    closed: bool = False

    def __post_init__(self) -> None:
        expressions = self.expressions
        if isinstance(expressions, str) or not isinstance(expressions, Sequence):
            raise MechanismError("must be a list of expressions, one for each coordinate", value=expressions)
        object.__setattr__(self, "expressions", tuple(expressions))
        if self.range is not None:
            object.__setattr__(self, "range", tuple(tuple(x) if isinstance(x, list) else x for x in self.range))
        if not isinstance(self.closed, bool):
            raise MechanismError("must be true or false", name="closed", value=self.closed)
        if self.closed and self.range is None:
            message = "a closed curve states the range of its parameter that is one lap, such as [0, 2*pi]"
            raise MechanismError(message, name="range")


class SampledCurve(Module):
    """A smooth curve through points; its parameter is the length along their chords, m.

    Parameters
    ----------
    points : array_like of shape (points, components)
        Points in the frame of the body, m, in order along the curve; a closed curve need not repeat the first one at
        the end.
    closed : bool, default False
        Whether the curve continues from the last point to the first.
    degree : int, default 5
        Degree of the spline, odd; derivatives by the parameter are continuous up to the order below it.

    Raises
    ------
    MechanismError
        If the points are too few, are not finite, are repeated, or form a corner or a gap.

    Examples
    --------
    >>> import numpy as np
    >>> import jounce as jn
    >>> angle = 2 * np.pi * np.arange(60) / 60
    >>> circle = jn.joints.SampledCurve(np.stack([np.cos(angle), np.sin(angle)], axis=1), closed=True)
    >>> round(circle.length, 2)
    6.28
    """

    parameter: Any
    points: Any
    closed: bool = field(static=True)
    degree: int = field(static=True)

    def __init__(self, points: ArrayLike, closed: bool = False, degree: int = 5):
        samples = real_numbers("points", by_component("points", points, MechanismError), MechanismError)
        self.degree = whole_number("degree", degree, 1, 11, error=MechanismError)
        if not isinstance(closed, bool):
            raise MechanismError("must be true or false", name="closed", value=closed)
        if closed and self.degree % 2 == 0:
            raise MechanismError("a closed curve needs a spline of odd degree", name="degree", value=degree)
        samples = check_points(samples, closed=closed, least=self.degree + 1)
        chords = np.linalg.norm(np.diff(samples, axis=0), axis=1)
        self.parameter, self.points, self.closed = np.concatenate([[0.0], np.cumsum(chords)]), samples, closed

    @property
    def length(self) -> float:
        """Length of all chords, m: the end of the parameter, or its period."""
        return float(self.parameter[-1])


class CurveLaw(Module):
    """A curve or a surface in numbers, which maps jets of its parameters to the jet of a point, (components, ...), m.

    Parameters
    ----------
    components : tuple
        Coordinates as functions of the parameters.
    ends : tuple of numbers, optional
        Least and greatest value of each parameter, in turn; None without ends.
    unit : float
        Length, m, by which the point moves per unit of the parameters, for the scale of carriages.
    lap : float, optional
        Period of the parameter of a closed curve.
    """

    components: tuple[Any, ...]
    ends: tuple[Any, ...] | None
    unit: Any
    lap: Any = None

    def __call__(self, *parameters: Jet) -> Float[Jet, "component *batch"]:
        """Return the point on the curve or surface."""
        return stack([component(*parameters) for component in self.components])


class _Formula(Module):
    """A coordinate as an expression of the parameters."""

    expression: Expression = field(static=True)
    names: tuple[str, ...] = field(static=True)
    known: dict[str, Any]

    def __call__(self, *parameters: Jet) -> Jet:
        value = self.expression.evaluate({**self.known, **dict(zip(self.names, parameters, strict=True))})
        if isinstance(value, Jet):
            return value
        first = parameters[0]
        return Jet.constant(jnp.zeros_like(first.coefficients[0]) + value, first.order)


def resolve_curve(
    curve: Any, names: tuple[str, ...], components: int, start: Any, parameters: Mapping[str, Any]
) -> CurveLaw:
    """Return the curve or surface of a list of expressions or a curve, checked unless values are traced.

    Parameters
    ----------
    curve : ParametricCurve, SampledCurve or sequence
        Curve as a user gives it.
    names : tuple of str
        Names of its parameters: ``("s",)`` for a curve, ``("u", "v")`` for a surface.
    components : int
        2 in the plane, 3 in space.
    start : array, or None
        Guess of the parameters.
    parameters : mapping
        Values of the other names in expressions.

    Raises
    ------
    MechanismError
        If it is neither, or is not smooth: a corner, a gap or a cusp, with its location.
    """
    if isinstance(curve, SampledCurve):
        return _through_points(curve, names, components)
    if not isinstance(curve, ParametricCurve):
        curve = ParametricCurve(curve)
    if len(curve.expressions) != components:
        raise MechanismError(
            f"must be {components} expressions, one for each coordinate", value=list(curve.expressions)
        )
    if curve.closed and len(names) > 1:
        raise MechanismError("a surface is not closed; it goes on as far as its expressions do", name="closed")
    formulas = tuple(_formula(entry, names, parameters) for entry in curve.expressions)
    ends = None if curve.range is None else _range(curve.range, len(names), parameters)
    if ends is None and (noun := refuses_without_ends(formulas)):
        message = f"{noun} may have kinks or ends; give the range of {' and '.join(names)} in which the curve is smooth"
        raise MechanismError(message, name="range")
    traced = any(isinstance(x, Tracer) for x in (*parameters.values(), *(ends or ())))
    window = ends or tuple(x + sign * HALF_WINDOW for x in _near(start, len(names)) for sign in (-1, 1))
    if not traced:
        _checked(formulas, tuple(map(float, window)), bool(ends), curve.closed, len(names))
    lap = ends[1] - ends[0] if curve.closed and ends else None
    return CurveLaw(formulas, None if curve.closed else ends, _unit(formulas, window), lap)


def _near(start: Any, count: int) -> Float[np.ndarray, " parameter"]:
    if start is None or any(isinstance(x, Tracer) for x in start):
        return np.zeros(count)
    return np.array(start, float)


def _formula(entry: Any, names: tuple[str, ...], parameters: Mapping[str, Any]) -> _Formula:
    expression = _expression(entry)
    for name in sorted(expression.names & set(names) & set(parameters)):
        message = f"the parameter '{name}' has the name of the parameter of a curve; give it another name"
        raise MechanismError(message, value=expression.text)
    expression.check({*parameters, *names})
    return _Formula(expression, names, {name: parameters[name] for name in sorted(expression.names - {*names})})


def _expression(entry: Any) -> Expression:
    return entry if isinstance(entry, Expression) else Expression(entry if isinstance(entry, str) else repr(entry))


def _range(entry: Any, count: int, parameters: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return the least and the greatest value of each parameter, in turn."""
    pairs = [entry] if count == 1 else list(entry)
    if len(pairs) != count or not all(isinstance(pair, tuple | list) and len(pair) == 2 for pair in pairs):
        expected = "[first, last]" if count == 1 else "[[first, last], [first, last]], of u and of v"
        raise MechanismError(f"must be {expected}", name="range", value=entry)
    limits = []
    for pair in pairs:
        try:
            low, high = (_expression(x).evaluate(parameters) for x in pair)
        except JounceError as error:
            raise error.located(name="range") from None
        if not isinstance(low, Tracer) and not isinstance(high, Tracer) and not low < high:
            raise MechanismError(
                "the first value must be below the last", name="range", value=[float(low), float(high)]
            )
        limits += [low, high]
    return tuple(limits)


@lru_cache(maxsize=200)
def _checked_once(formulas: Any, window: tuple[float, ...], stated: bool, closed: bool) -> None:
    names, expressions = formulas
    curve = tuple(_Formula(expression, names, dict(parameters)) for expression, parameters in expressions)
    check_curve(curve, window, stated=stated, closed=closed)


def _checked(formulas: tuple[_Formula, ...], window: tuple[float, ...], stated: bool, closed: bool, count: int) -> None:
    """Check the smoothness of a curve, once for the same numbers; surfaces are not checked."""
    if count > 1:
        return
    expressions = tuple((f.expression, tuple((k, float(v)) for k, v in f.known.items())) for f in formulas)
    _checked_once((formulas[0].names, expressions), window, stated, closed)


def _unit(formulas: tuple[_Formula, ...], window: tuple[Any, ...]) -> Any:
    """Return the distance that a point moves per unit of the parameters, m; the geometric mean of two."""
    count, shares, lengths = len(window) // 2, np.linspace(0.05, 0.95, LOOKS), []
    traced = any(isinstance(x, Tracer) for x in jax.tree.leaves((formulas, window)))
    for varied in range(count):
        turn = (varied, 1 - varied)[:count]
        spread = (shares, (shares * 7.3) % 1.0)[:count]
        samples = [window[2 * k] + (window[2 * k + 1] - window[2 * k]) * u for k, u in zip(turn, spread, strict=True)]
        if traced:
            jets = [Jet.variable(jnp.asarray(samples[0]), 1), *(Jet.constant(jnp.asarray(x), 1) for x in samples[1:])]
            speed = sum(f(*(jets[k] for k in turn)).dense().coefficients[1] ** 2 for f in formulas)
        else:
            ordered = [partial(_turned, f, turn) for f in formulas]
            speed = (derivatives_at(ordered, *map(np.asarray, samples))[1] ** 2).sum(axis=0)
        namespace = jnp if traced else np
        lengths.append(namespace.sqrt(namespace.mean(namespace.where(namespace.isfinite(speed), speed, 0.0))))
    unit = lengths[0] if count == 1 else (lengths[0] * lengths[1]) ** 0.5
    if isinstance(unit, Tracer):
        return unit
    return float(unit) if float(unit) > 0 else 1.0


def _turned(formula: _Formula, turn: tuple[int, ...], *jets: Jet) -> Jet:
    """Return a coordinate from jets of its parameters in another order."""
    return formula(*(jets[k] for k in turn))


def _through_points(curve: SampledCurve, names: tuple[str, ...], components: int) -> CurveLaw:
    if len(names) > 1:
        raise MechanismError("a surface is given by expressions of u and v", name="surface")
    points: Any = curve.points
    if points.shape[1] != components:
        message = f"points of this curve have {components} coordinates"
        raise MechanismError(message, name="samples", value=int(points.shape[1]))
    extrapolation = "repeat" if curve.closed else "continue"
    laws = tuple(SplineMotion(curve.parameter, column, curve.degree, extrapolation) for column in points.T)
    length = curve.length
    return CurveLaw(laws, None if curve.closed else (0.0, length), 1.0, length if curve.closed else None)
