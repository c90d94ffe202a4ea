"""Evaluation of objectives and conditions: names become quantities of a mechanism, measures become numbers."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.design.objectives.arguments import MAX_DERIVATIVE, Arguments
from jounce.design.objectives.dimensions import check_dimensions
from jounce.design.objectives.language import (
    EXERTED,
    MEASURES,
    Node,
    Relation,
    operated,
    parsed,
    parsed_relations,
    varying_message,
)
from jounce.design.objectives.measures import (
    NO_KNOTS,
    Cells,
    PrescribedPath,
    at_instants,
    derivative,
    environment,
    gaps,
    integral,
    largest,
    safe_root,
    square,
    value,
)
from jounce.design.objectives.quantities import Quantities, Quantity, naming_errors
from jounce.errors import ExpressionError, did_you_mean
from jounce.jet.derivatives import taylor_coefficients
from jounce.kinematics.position_analysis.solve import HIGHEST_ORDER
from jounce.mechanism import Mechanism
from jounce.mechanism.laws.output_drivers import with_outputs

BEYOND = 5  # derivatives beyond the requested ones, for the values between instants

Numbers = Callable[[Mapping[str, Any], Any, Any], Any]
"""A number of a design as a function of its parameters, the extremes of quantities, and other measures."""


@dataclasses.dataclass(frozen=True, eq=False)
class Condition:
    """A condition in numbers: ``number <= 0``, or ``number == 0``.

    Parameters
    ----------
    relation : Relation
        The condition as stated by the user.
    number : callable
        Left side minus right side.
    left, right : callable
    """

    relation: Relation
    number: Numbers
    left: Numbers
    right: Numbers


class Goals:
    """Objective and conditions as functions of the motion of a mechanism.

    Measures are of two kinds. An extreme is the largest of the values in cells of time; if a goal increases with it, an
    optimizer may replace it by a variable that bounds these values, so that the goal stays smooth where the cell of the
    largest value changes. All other measures are smooth themselves.

    Parameters
    ----------
    mechanism : Mechanism
    minimize : str
        The objective.
    subject_to : sequence of str
        The conditions.
    varied : sequence of str
        Parameters that differ from design to design.
    curves : dict of str to PrescribedPath
        Points for paths, by name.
    instants : array of shape (time,)
        Instants, s.
    knots : array of shape (knots,), optional
        Instants at which derivatives of motion laws jump in all designs, s.

    Attributes
    ----------
    mechanism : Mechanism
        The mechanism with the required outputs.
    instants : array of shape (time,)
        The given instants with those of measures.
    order : int
        Order of the motion.
    objective : callable
        The function that an optimizer minimizes.
    objective_value : callable
        The objective as stated; `objective` may be its square, which is smooth at zero.
    conditions : list of Condition
    bounded : list of bool
        Whether a goal increases with each extreme.
    gaps : range, optional
        Indices of the smooth measures whose mean square is the objective: the distances by coordinate.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        minimize: str,
        subject_to: Sequence[str],
        varied: Sequence[str],
        curves: Mapping[str, PrescribedPath],
        instants: Float[np.ndarray, " time"],
        knots: Float[np.ndarray, " knots"] = NO_KNOTS,
    ):
        self._original, self._curves, self._knots = mechanism, curves, knots
        self.quantities = Quantities(mechanism, set(varied))
        self._extremes: list[Callable[[Mapping[str, Any], Cells], Any]] = []
        self._windows: list[tuple[float | None, float | None]] = []
        self._smooth: list[Callable[[Mapping[str, Any]], Any]] = []
        self._smooth_count = 0
        self.gaps: range | None = None
        self.bounded: list[bool] = []
        self.order = 0
        self._arguments = Arguments(self.quantities.fixed, (float(instants[0]), float(instants[-1])))
        with naming_errors("minimize", whole=True):
            self.quantities.text = minimize
            node = parsed(minimize)
            self.objective_value = self._number(node, 1)
            self.objective = self._squared(node) or self.objective_value
        self.conditions = [condition for text in subject_to for condition in self._conditions(text)]
        self.order = min(self.order + BEYOND, HIGHEST_ORDER)
        self.set_instants(instants)
        used_outputs = {
            name: x for name, x in mechanism.outputs.items() if name in {a[0] for a in self.quantities.atoms.values()}
        }
        self.mechanism = with_outputs(mechanism, {**used_outputs, **self.quantities.added})

    def set_instants(self, instants: Float[np.ndarray, " time"]) -> None:
        """Replace the grid of instants."""
        self.instants = at_instants(self._arguments.instants, instants, self._knots)
        self._cells = [Cells.of(self.instants, *window) for window in self._windows]
        self._whole = Cells.of(self.instants)

    def series(self, outputs: Mapping[str, Any]) -> dict[str, Any]:
        """Return the Taylor coefficients of the quantities, (order + 1, time), from outputs of a motion."""
        series = {}
        for text, (name, component, lost_orders) in self.quantities.atoms.items():
            values = outputs[name] if component is None else outputs[name][..., component]
            series[text] = taylor_coefficients(jnp.moveaxis(jnp.asarray(values), 1, 0)[lost_orders:])
        return series

    def measured(self, parameters: Mapping[str, Any], outputs: Mapping[str, Any]) -> tuple[list[Any], Any]:
        """Return the values of each extreme, of which it is the largest, and the smooth measures, (measures,).

        Parameters
        ----------
        parameters : dict of str to number
            Parameters that are varied.
        outputs : dict of str to array of shape (time, derivative) or (time, derivative, component)
            Outputs of a motion.
        """
        names = environment(self.instants, self._values(parameters), self.series(outputs), self.order)
        rows = [extreme(names, cells) for extreme, cells in zip(self._extremes, self._cells, strict=True)]
        smooth = [jnp.asarray(measure(names), float).reshape(-1) for measure in self._smooth]
        return rows, jnp.concatenate([*smooth, jnp.zeros(0)])

    def numbers(self, parameters: Mapping[str, Any], extremes: Any, smooth: Any, *, as_stated: bool = False) -> Any:
        """Return the objective, then the conditions as numbers that must be zero, or at most zero, (goals,)."""
        names = self._values(parameters)
        objective = self.objective_value if as_stated else self.objective
        numbers = [objective(names, extremes, smooth), *(c.number(names, extremes, smooth) for c in self.conditions)]
        return jnp.stack([jnp.asarray(x, float) for x in numbers])

    def sides(self, parameters: Mapping[str, Any], extremes: Any, smooth: Any) -> list[tuple[float, float]]:
        """Return the values of both sides of each condition."""
        names = self._values(parameters)
        return [
            (float(c.left(names, extremes, smooth)), float(c.right(names, extremes, smooth))) for c in self.conditions
        ]

    def _values(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """Return the values of all parameters, including dependent ones."""
        return self._original.with_parameters(**parameters).parameter_values

    def _series(self, node: Node, order: int) -> Callable[[Mapping[str, Any]], Any]:
        """Return the Taylor coefficients of a derivative of a quantity, (order + 1, time)."""
        quantity = self.quantities.jet(node)
        lost_orders = max(
            (self.quantities.atoms[name][2] for name in node.names() if name in self.quantities.atoms), default=0
        )
        if order + lost_orders > MAX_DERIVATIVE:
            message = f"derivatives go up to the order {MAX_DERIVATIVE}, got {order + lost_orders} of '{node.text}'"
            raise ExpressionError(message)
        self.order = max(self.order, order + lost_orders)

        def series(names: Mapping[str, Any]) -> Any:
            jet = quantity(names)
            if not hasattr(jet, "coefficients"):  # a constant
                jet = names["t"] * 0.0 + jet
            return derivative(jet, order)

        return series

    # numbers

    def _number(self, node: Node, sign: int | None) -> Numbers:
        """Return a number; goals increase with it (`sign` 1), decrease (-1), or neither is known (None)."""
        if node.kind == "number":
            return lambda *_: float(node.word)
        if node.kind == "name":
            self.quantities.check_meaning(node.word)
            if self.quantities.known.get(node.word) == "parameters":
                return lambda names, *_: names[node.word]
            if node.word == "t" or node.word in self.quantities.known:
                raise varying_message(node.text)
            self.quantities.atom(node.word)  # a derivative of a quantity, or refused
            raise varying_message(node.text)
        if node.word in MEASURES:
            return self._measure(node, sign)
        if node.word in EXERTED:
            raise varying_message(node.text)
        operands = [self._number(part, trend) for part, trend in zip(node.parts, self._signs(node, sign), strict=True)]
        return lambda names, extremes, smooth: operated(node.word, [part(names, extremes, smooth) for part in operands])

    def _signs(self, node: Node, sign: int | None) -> Sequence[int | None]:
        """Return the signs with which goals depend on the operands of an operation; None where values decide."""
        if sign is None:
            return [None] * len(node.parts)
        match node.word:
            case "+" | "pos" | "exp" | "sqrt" | "log" | "atan" | "tanh" | "sinh":
                return [sign] * len(node.parts)
            case "-" | "neg":
                return [sign, -sign][-len(node.parts) :]
            case "*":
                constants = [self._arguments.constant(part) for part in node.parts]
                return [None if x is None else int(sign * np.sign(x)) or None for x in constants[::-1]]
            case "/":
                divisor = self._arguments.constant(node.parts[1])
                return [None if divisor is None else int(sign * np.sign(divisor)) or None, None]
        return [None] * len(node.parts)

    def _measure(self, node: Node, sign: int | None) -> Numbers:
        kind, (quantity, *arguments) = node.word, node.parts
        if kind.startswith("path"):
            return self._path(node, sign)
        if kind == "at":
            order = self._arguments.derivative(arguments[0]) if len(arguments) == 2 else 0
            instant = self._arguments.instant(arguments[-1])
            series = self._series(quantity, order)

            def value_at(names: Mapping[str, Any]) -> Any:
                index, shift = self._whole.at(instant)
                return value(series(names)[:, index : index + 1], jnp.asarray([shift]))[0]

            return self._smooth_number(value_at)
        order = self._arguments.derivative(arguments[0]) if arguments else 0
        window = self._arguments.window(arguments)
        series = self._series(quantity, order)
        if kind in ("mean", "rms"):
            return self._smooth_number(self._mean(series, window, root=kind == "rms"))
        return self._extreme(kind, series, window, sign)

    def _mean(
        self, series: Callable[..., Any], window: tuple[Any, Any], *, root: bool, squared: bool = False
    ) -> Quantity:
        def mean_value(names: Mapping[str, Any]) -> Any:
            cells, values = Cells.of(self.instants, *window), series(names)
            length = float(np.sum(cells.high - cells.low))
            mean = integral(square(values) if root else values, cells) / length
            return safe_root(mean) if root and not squared else mean

        return mean_value

    def _smooth_number(self, measure: Quantity) -> Numbers:
        (index,) = self._smooth_block(measure, 1)
        return lambda *arguments: arguments[2][index]

    def _smooth_block(self, measure: Quantity, count: int) -> range:
        """Add smooth measures that are evaluated together, and return their indices."""
        self._smooth.append(measure)
        self._smooth_count += count
        return range(self._smooth_count - count, self._smooth_count)

    def _extreme(self, kind: str, series: Callable[..., Any], window: tuple[Any, Any], sign: int | None) -> Numbers:
        def upper(names: Mapping[str, Any], cells: Cells) -> Any:
            return largest(series(names), cells)

        def lower(names: Mapping[str, Any], cells: Cells) -> Any:
            return largest(-series(names), cells)

        def both_signs(names: Mapping[str, Any], cells: Cells) -> Any:
            values = series(names)
            return jnp.concatenate([largest(values, cells), largest(-values, cells)])

        if kind == "peak":
            return self._added_extreme(both_signs, window, sign)
        if kind == "maximum":
            return self._added_extreme(upper, window, sign)
        lowest = self._added_extreme(lower, window, None if sign is None else sign * (-1 if kind == "minimum" else 1))
        if kind == "minimum":
            return lambda names, extremes, smooth: -lowest(names, extremes, smooth)
        highest = self._added_extreme(upper, window, sign)
        return lambda names, extremes, smooth: highest(names, extremes, smooth) + lowest(names, extremes, smooth)

    def _added_extreme(
        self, rows: Callable[[Mapping[str, Any], Cells], Any], window: tuple[Any, Any], sign: int | None
    ) -> Numbers:
        index = len(self._extremes)
        self._extremes.append(rows)
        self._windows.append(window)
        self.bounded.append(sign == 1)
        return lambda *arguments: arguments[1][index]

    def _path(self, node: Node, sign: int | None) -> Numbers:
        """Return the error of a path: the root mean square or the largest distance of points from it."""
        deviation, _ = self._gaps(node)

        def squares(names: Mapping[str, Any]) -> Any:
            return jnp.sum(deviation(names) ** 2, axis=0)

        if node.word == "path_error":
            return self._smooth_number(lambda names: safe_root(jnp.mean(squares(names))))
        return self._added_extreme(lambda names, _: safe_root(squares(names)), (None, None), sign)

    def _gaps(self, node: Node) -> tuple[Quantity, int]:
        """Return the vectors from points of a curve to the path of a point, (component, point), and their count."""
        point, curve = (part.word for part in node.parts)
        output = self._original.outputs.get(point) if isinstance(point, str) else None
        labels = () if output is None else output.component_labels(self._original)
        points = [x for x in self._original.outputs if self._original.outputs[x].unit == "m" and self._is_point(x)]
        if point not in points:
            message = f"'{node.parts[0].text}' in {node.text} must be an output that is a point"
            raise ExpressionError(f"{message}; {did_you_mean(point, points)}")
        if curve not in self._curves:
            message = f"no points have the name '{node.parts[1].text}' in {node.text}; give them by curves"
            raise ExpressionError(f"{message}; {did_you_mean(curve, self._curves)}")
        target = self._curves[curve]
        if target.points.shape[1] != len(labels):
            message = (
                f"the points of '{curve}' have {target.points.shape[1]} coordinates, and '{point}' has {len(labels)}"
            )
            raise ExpressionError(message)
        if target.times is not None:
            for instant in (target.times.min(), target.times.max()):
                self._arguments.instant(Node("number", float(instant)))
            self._arguments.instants.extend(target.times.tolist())
        names = [f"{point}_{label}" for label in labels]
        quantities = [self._series(Node("name", name), 0) for name in names]

        def gap_vectors(values: Mapping[str, Any]) -> Any:
            path = jnp.stack([quantity(values) for quantity in quantities], axis=1)
            return gaps(path, target.points, target.times, self._whole)

        return gap_vectors, len(target.points)

    def _is_point(self, name: str) -> bool:
        return bool(self._original.outputs[name].component_labels(self._original))

    def _squared(self, node: Node) -> Numbers | None:
        """Return the square of an objective that is a root, which is smooth at zero; None for other objectives."""
        if node.kind != "call" or node.word not in ("rms", "path_error"):
            return None
        subject, *arguments = node.parts
        if node.word == "path_error":
            deviation, count = self._gaps(node)
            size = len(self._original.outputs[subject.word].component_labels(self._original))
            block = self.gaps = self._smooth_block(deviation, size * count)
            return lambda *values: jnp.sum(values[2][block.start : block.stop] ** 2) / count
        series = self._series(subject, self._arguments.derivative(arguments[0]) if arguments else 0)
        return self._smooth_number(self._mean(series, self._arguments.window(arguments), root=True, squared=True))

    # conditions

    def _conditions(self, text: str) -> list[Condition]:
        conditions = []
        with naming_errors("subject_to", whole=True):
            self.quantities.text = text
            for relation in parsed_relations(text):
                check_dimensions(relation, self.quantities)
                left_sign = None if relation.equal else 1
                left = self._number(relation.left, left_sign)
                right = self._number(relation.right, None if relation.equal else -1)
                conditions.append(Condition(relation, _difference(left, right), left, right))
        return conditions


def _difference(left: Numbers, right: Numbers) -> Numbers:
    return lambda names, extremes, smooth: left(names, extremes, smooth) - right(names, extremes, smooth)
