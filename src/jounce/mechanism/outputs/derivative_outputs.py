"""Derivatives of outputs with respect to other outputs: bump steer, motion ratios, mechanical advantages, rates.

Along a motion ``dy/dx = y' / x'``, and higher derivatives follow by repeating this quotient of series.
"""

from collections import Counter
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.modules import belongs_to_package, field, unchecked, with_fields
from jounce.base.shapes import Numbers
from jounce.constraints.base import Nested, Whole
from jounce.errors import MechanismError, no_such, whole_number
from jounce.jet import Jet
from jounce.jet.algebra import stacked
from jounce.jet.rounding import nan_where_rounding, rates_of
from jounce.mechanism.outputs.base import AbstractMotionOutput, AbstractOutput, AbstractQuantity

HIGHEST = 10  # order of a derivative with respect to an output
OFF_ZERO = 1e-3  # least size of a vanishing length, relative to the size of the mechanism
MOST_NAMED = 4  # instants in a remark
RATES = ("derivative", "rate", "second rate", "third rate", "fourth rate")


class Operand(NamedTuple):
    """An output, or one of its components."""

    output: Any
    component: int


class DerivativeOutput(AbstractMotionOutput):
    """Derivative of an output with respect to another along the motion, ``d^n of / d by^n``.

    Bump steer is the derivative of a toe angle with respect to the wheel height, a motion ratio that of a spring
    length, a wheel rate that of a force. The derivative is undefined where `by` stands still.

    Parameters
    ----------
    of, by : str
        Names of outputs of the mechanism, or of components of outputs, such as ``C_y``.
    order : int, default 1
        n, from 1 to 10.
    """

    of: str = field(static=True)
    by: str = field(static=True)
    order: Whole = field(static=True, default=1)
    bound_operands: Any = field(default=None, init=False)  # set when the output becomes one of a mechanism

    source: ClassVar[str] = "of"
    rate_names = RATES

    def __check_init__(self):
        whole_number("order", self.order, 1, HIGHEST, error=MechanismError)

    @property
    def operands(self) -> tuple[Operand, Operand]:
        """The outputs `of` and `by` of the mechanism."""
        if self.bound_operands is None:
            message = "its outputs are found when it is an output of a mechanism, and `evaluate` is given one"
            raise MechanismError(message, name="of", value=self.of)
        return self.bound_operands

    @property
    def unit(self) -> str:  # type: ignore[override] - of an instance, as it depends on the outputs
        """Unit in SI."""
        return _unit(self.operands, int(self.order))

    @property
    def lost_orders(self) -> int:  # type: ignore[override] - of an instance, as it depends on the order
        """Derivatives by which the output is shorter than the motion."""
        return int(self.order) + max(operand.output.lost_orders for operand in self.operands)

    @property
    def of_forces(self) -> bool:  # type: ignore[override] - of an instance
        """Whether the output depends on applied forces."""
        return any(operand.output.of_forces for operand in self.operands)

    def coefficients(self, motion: Any) -> Numbers:
        """Return the Taylor coefficients of the derivative, (levels, 1, time)."""
        y, x = (_series(motion, operand) for operand in self.operands)
        scale = _scale(x, self.operands[1].output.unit, motion.model.length)
        return stacked(derivative_by(y, x, int(self.order), scale))[:, None]

    def remark(self, motion: Any, values: Float[np.ndarray, "time derivative"]) -> str:
        """Return why values are NaN at solved instants, and at which instants."""
        missing = ~np.isfinite(values).all(axis=1) & (np.asarray(motion.status) == 0)
        if not missing.any():
            return ""
        times = ", ".join(f"{t:.6g} s" for t in motion.time[missing][:MOST_NAMED])
        ellipsis = ", ..." if missing.sum() > MOST_NAMED else ""
        return f"undefined at t = {times}{ellipsis}, where '{self.by}' stands still or '{self.of}' is undefined"


class PosedDerivativeOutput(AbstractOutput):
    """A `DerivativeOutput` of outputs that are functions of poses, within a mechanism."""

    of: str = field(static=True)
    by: str = field(static=True)
    order: Whole = field(static=True)
    first: Nested
    second: Nested
    components: tuple[int, int] = field(static=True)
    count: int = field(static=True)  # number of bodies of the first output

    form: ClassVar[type] = DerivativeOutput
    rate_names = RATES

    @property
    def operands(self) -> tuple[Operand, Operand]:
        """The outputs `of` and `by`."""
        return Operand(self.first, self.components[0]), Operand(self.second, self.components[1])

    @property
    def unit(self) -> str:  # type: ignore[override] - of an instance, as it depends on the outputs
        """Unit in SI."""
        return _unit(self.operands, int(self.order))

    @property
    def lost_orders(self) -> int:  # type: ignore[override] - of an instance, as it depends on the order
        """Derivatives by which the output is shorter than the motion."""
        return int(self.order) + max(operand.output.lost_orders for operand in self.operands)

    def evaluate(self, *bodies: Any) -> Jet:
        y = _component(self.first.evaluate(*bodies[: self.count]), self.components[0])
        x = _component(self.second.evaluate(*bodies[self.count :]), self.components[1])
        reach = [jnp.sqrt(jnp.sum(body.position.coefficients[0] ** 2, axis=0)) for body in bodies]
        return derivative_by(y, x, int(self.order), _scale(x, self.second.unit, jnp.max(jnp.stack(reach), axis=0)))


def _unit(operands: tuple[Operand, Operand], order: int) -> str:
    of, by = operands
    return quotient_unit(of.output.unit, by.output.unit, order)


def derivative_by(y: Jet, x: Jet, order: int, scale: Any) -> Jet:
    """Return the derivative of one series with respect to another, NaN where rounding decides it.

    Parameters
    ----------
    y, x : Jet
        Series of shape (...).
    order : int
        Order of the derivative.
    scale : array of shape (...)
        Size of x.
    """
    speed = x.differentiate()
    nearness, rate = rates_of(speed, scale, jnp.ndim(scale))
    for _ in range(order):
        y = y.differentiate() / speed
    return nan_where_rounding(y, nearness, rate, lost=order - 1)


def _scale(x: Jet, unit: str, reach: Any) -> Any:
    """Return the size of a quantity: 1 for an angle; for a length, at least a fraction of the size of the mechanism."""
    size = jnp.abs(x.coefficients[0])
    return jnp.ones_like(size) if unit == "rad" else size + (OFF_ZERO * reach if unit == "m" else 0.0)


def _component(jet: Jet, component: int) -> Jet:
    return jet if component < 0 else jet[component]


def _series(motion: Any, operand: Operand) -> Jet:
    """Return the series of an output of a motion, or of its component, of shape (time,)."""
    series = motion.series(operand.output)
    return Jet(tuple(series[:, max(operand.component, 0)]))


def bound(outputs: Mapping[str, AbstractQuantity], mechanism: Any) -> Mapping[str, AbstractQuantity]:
    """Return outputs of a mechanism, with the operands of the derivatives among them.

    A derivative whose operands are not among the outputs keeps those that it has: outputs may be requested alone.

    Raises
    ------
    MechanismError
        If an operand of a derivative does not exist, is no scalar, or is the derivative itself.
    """
    if not any(form_of(output) is DerivativeOutput for output in outputs.values()):
        return outputs
    bound_outputs: dict[str, AbstractQuantity] = {}
    for name in outputs:
        _bind(name, outputs, mechanism, bound_outputs, ())
    return {name: bound_outputs[name] for name in outputs}


def bound_output(output: AbstractQuantity, mechanism: Any) -> AbstractQuantity:
    """Return an output that the mechanism need not contain; a derivative gets operands from the mechanism."""
    return _with_operands(output, mechanism.outputs, mechanism) if form_of(output) is DerivativeOutput else output


def form_of(output: AbstractQuantity) -> type[Any]:
    """Return the class by which an output is given, and which files name."""
    form: Any = getattr(type(output), "form", type(output))
    return form


def _bind(
    name: str,
    outputs: Mapping[str, AbstractQuantity],
    mechanism: Any,
    bound_outputs: dict[str, AbstractQuantity],
    ancestors: tuple[str, ...],
) -> AbstractQuantity:
    """Return an output, bound to its operands, which are added to `bound_outputs`."""
    output: Any = outputs[name]
    if name in bound_outputs or form_of(output) is not DerivativeOutput:
        return bound_outputs.setdefault(name, output)
    if name in ancestors:
        raise MechanismError("this derivative is one of itself", name=f"outputs.{name}.of", value=output.of)
    stems = [_base_output(given, outputs, mechanism) for given in (output.of, output.by)]
    if all(stems) or getattr(output, "bound_operands", output) is None:
        operands = {stem: _bind(stem, outputs, mechanism, bound_outputs, (*ancestors, name)) for stem in stems if stem}
        try:
            output = _with_operands(output, {**outputs, **operands}, mechanism)
        except MechanismError as error:
            error.name = f"outputs.{name}.{error.name}"
            raise
    return bound_outputs.setdefault(name, output)


def _base_output(name: str, outputs: Mapping[str, AbstractQuantity], mechanism: Any) -> str:
    """Return the name of the output to which a name of an output or a component belongs; empty if there is none."""
    if name in outputs:
        return name
    stem, _, label = name.rpartition("_")
    return stem if stem in outputs and label in outputs[stem].component_labels(mechanism) else ""


def _with_operands(output: Any, outputs: Mapping[str, AbstractQuantity], mechanism: Any) -> AbstractQuantity:
    """Return a derivative with its operands."""
    of, by = (_operand(key, getattr(output, key), outputs, mechanism) for key in ("of", "by"))
    fields = {"of": output.of, "by": output.by, "order": output.order}
    if not (_posed(of.output) and _posed(by.output)):
        return with_fields(DerivativeOutput(**fields), bound_operands=(of, by))
    values = {
        "bodies": (*of.output.bodies, *by.output.bodies),
        "first": of.output,
        "second": by.output,
        "components": (of.component, by.component),
        "count": len(of.output.bodies),
    }
    return unchecked(PosedDerivativeOutput, fields | values)


def _operand(key: str, name: str, outputs: Mapping[str, AbstractQuantity], mechanism: Any) -> Operand:
    """Return the output or component with a given name."""
    stem = _base_output(name, outputs, mechanism)
    if not stem:
        labels = {other: output.component_labels(mechanism) for other, output in outputs.items()}
        valid_names = [
            item for other, components in labels.items() for item in ([f"{other}_{x}" for x in components] or [other])
        ]
        raise MechanismError(no_such("output", name, valid_names), name=key, value=name)
    labels = outputs[stem].component_labels(mechanism)
    if labels and stem == name:
        raise MechanismError(f"this output has components; name one, such as {name}_{labels[0]}", name=key, value=name)
    return Operand(outputs[stem], labels.index(name.rpartition("_")[2]) if labels else -1)


def _posed(output: Any) -> bool:
    """Return whether an output is a function of poses alone, without a reference position."""
    if not isinstance(output, AbstractOutput) or not belongs_to_package(type(output)):
        return False
    return not hasattr(output, "datum") or output.vector_i is not None


def quotient_unit(of: str, by: str, order: int) -> str:
    """Return the unit of a derivative with respect to a quantity, with seconds last.

    Examples
    --------
    >>> quotient_unit("rad", "m", 2), quotient_unit("m", "m", 1), quotient_unit("m", "m", 2)
    ('rad/m^2', '1', '1/m')
    >>> quotient_unit("N*m", "rad", 1), quotient_unit("rad/s", "m", 1), quotient_unit("1", "rad/s", 2)
    ('N*m/rad', 'rad/m/s', 's^2/rad^2')
    """
    powers: Counter[str] = Counter()
    for unit, power in ((of, 1), (by, -order)):
        first, *denominators = unit.split("/")
        powers[first] += power
        for part in denominators:
            base, _, exponent = part.partition("^")
            powers[base] -= power * int(exponent or 1)
    del powers["1"]

    def written(base: str, power: int) -> str:
        return base if power == 1 else f"({base})^{power}" if "*" in base else f"{base}^{power}"

    numerator = "*".join(written(base, power) for base, power in powers.items() if power > 0)
    denominators = [(part, -power) for base, power in powers.items() if power < 0 for part in base.split("*")]
    denominators.sort(key=lambda pair: pair[0] == "s")
    return (numerator or "1") + "".join(f"/{written(*pair)}" for pair in denominators)
