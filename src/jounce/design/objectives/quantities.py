"""Names in expressions as time-dependent quantities of a mechanism: outputs, components, rates, forces."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from jounce.design.objectives.language import EXERTED, MEASURES, Node, operated, refuse_name
from jounce.dynamics import DriverForceOutput, DriverTorqueOutput, JointForceOutput, JointTorqueOutput
from jounce.errors import ExpressionError, JounceError, MechanismError
from jounce.mechanism import AbstractQuantity, Mechanism
from jounce.mechanism.laws.driver_outputs import is_turning
from jounce.trajectory import Expression

Quantity = Callable[[Mapping[str, Any]], Any]
"""Function from the values of names to a time-dependent quantity, a jet along the grid."""


class Quantities:
    """Resolution of names in expressions of a mechanism, with the quantities in use.

    Parameters
    ----------
    mechanism : Mechanism
    varied : set of str
        Parameters that differ from design to design.

    Attributes
    ----------
    fixed : dict of str to float
        Parameters that are the same in all designs.
    known : dict of str to str
        Kind of each name.
    atoms : dict of str to (str, int or None, int)
        Quantities in use: output, component, and order of the derivative.
    added : dict of str to AbstractQuantity
        Outputs that the mechanism does not have, by name.
    text : str
        The expression that is being read, for messages.
    """

    def __init__(self, mechanism: Mechanism, varied: set[str]):
        self.mechanism = mechanism
        self.fixed = _independent(mechanism, varied)
        self.atoms: dict[str, tuple[str, int | None, int]] = {}
        self.added: dict[str, AbstractQuantity] = {}
        self.known = self._known_kinds()
        self.text = ""

    def _known_kinds(self) -> dict[str, str]:
        """Return the kinds of names: a quantity, a parameter, a driver or a joint."""
        dimensions: dict[str, str] = {}
        for name, output in self.mechanism.outputs.items():
            labels = output.component_labels(self.mechanism)
            dimensions |= {f"{name}_{label}": "quantities" for label in labels} or {name: "quantities"}
            if labels:
                dimensions[name] = "points and vectors"
        dimensions |= dict.fromkeys(self.mechanism.parameters, "parameters")
        return dimensions

    def check_meaning(self, name: str) -> None:
        """Raise ExpressionError if a name has several meanings, as a choice could be wrong."""
        stem, order = _derivative_name(name)
        meanings = ["the time"] * (name == "t") + ["a parameter"] * (name in self.mechanism.parameters)
        meanings += ["an output"] * (name in self.mechanism.outputs)
        for output, quantity in self.mechanism.outputs.items():
            labels = [f"{output}_{label}" for label in quantity.component_labels(self.mechanism)]
            meanings += [f"a component of {output}"] * (name in labels)
            differentiated = order and (stem in labels or (stem == output and not labels))
            meanings += [f"a derivative of {stem}"] * bool(differentiated)
        if len(meanings) > 1:
            listed = f"{', '.join(meanings[:-1])} and {meanings[-1]}"
            raise ExpressionError(f"'{name}' is {listed} of this mechanism; give one of them another name")

    def atom(self, text: str) -> Quantity:
        """Return a quantity of the mechanism by its name, which may have a suffix such as ``_d2``."""
        name, lost_orders = (text, 0) if text in self.known else _derivative_name(text)
        if self.known.get(name) == "points and vectors":
            labels = self.mechanism.outputs[name].component_labels(self.mechanism)
            message = f"'{name}' has components; take {' or '.join(f'{name}_{label}' for label in labels)}"
            raise ExpressionError(message)
        if self.known.get(name) != "quantities":
            raise refuse_name(text, self.known, self.text)
        output, component = self.output_of(name)
        self.atoms[text] = (output, component, lost_orders)
        return lambda names: names[text]

    def output_of(self, name: str) -> tuple[str, int | None]:
        """Return the output of a quantity, and the number of its component."""
        if name in self.mechanism.outputs:
            return name, None
        stem, _, label = name.rpartition("_")
        return stem, self.mechanism.outputs[stem].component_labels(self.mechanism).index(label)

    def _exerted(self, node: Node) -> Quantity:
        """Return the force or torque of a driver or a joint."""
        (subject,) = node.parts
        kind, _, component = node.word.partition("_")
        mechanism = self.mechanism
        elements = {**dict.fromkeys(mechanism.drivers, "drivers"), **dict.fromkeys(mechanism.joints, "joints")}
        if subject.kind != "name" or subject.word not in elements:
            raise refuse_name(subject.text, elements, self.text)
        output = _exerted_by(mechanism, subject.word, kind, component)
        name = f"{kind}({subject.word})"
        with naming_errors(name):
            output.check(mechanism)
        self.added[name] = output
        labels = output.component_labels(mechanism)
        if not component and labels:
            component_names = [self._component(name, k, label) for k, label in enumerate(labels)]
            squares = [Node("call", "**", (Node("name", x), Node("number", 2.0))) for x in component_names]
            square_sum = squares[0]
            for x in squares[1:]:
                square_sum = Node("call", "+", (square_sum, x))
            return self.jet(Node("call", "sqrt", (square_sum,)))
        if component and component not in labels:
            message = f"'{node.text}' does not exist; {name} has {'components ' if labels else 'no components '}"
            raise ExpressionError(f"{message}{', '.join(labels)}".rstrip())
        text = self._component(name, labels.index(component) if component else None, component)
        return lambda names: names[text]

    def _component(self, output: str, index: int | None, label: str) -> str:
        text = f"{output}_{label}" if label else output
        self.atoms[text] = (output, index, 0)
        return text

    def jet(self, node: Node) -> Quantity:
        """Return an expression as a time-dependent quantity."""
        if node.kind == "number":
            return lambda _: float(node.word)
        if node.kind == "name":
            self.check_meaning(node.word)
            if node.word in self.atoms or node.word == "t":
                return lambda names: names[node.word]
            if node.word in self.mechanism.parameters and self.known[node.word] == "parameters":
                return lambda names: names[node.word]
            return self.atom(node.word)
        if node.word in MEASURES:
            message = f"'{node.text}' is one number and cannot stand within another measure; write two measures"
            raise ExpressionError(message)
        if node.word in EXERTED:
            return self._exerted(node)
        operands = [self.jet(part) for part in node.parts]
        return lambda names: operated(node.word, [part(names) for part in operands])


def _derivative_name(text: str) -> tuple[str, int]:
    """Return the quantity and the order of the derivative in a name such as ``psi_d2``."""
    stem, _, digits = text.rpartition("_d")
    return (stem, int(digits)) if stem and digits.isdecimal() and len(digits) < 4 else (text, 0)


def _independent(mechanism: Mechanism, varied: set[str]) -> dict[str, float]:
    """Return the values of the parameters that are the same in all designs."""
    changing, count = set(varied), -1
    while len(changing) > count:
        count = len(changing)
        for name, form in mechanism.parameters.items():
            expression = Expression(form) if isinstance(form, str) else form
            if isinstance(expression, Expression) and expression.names & changing:
                changing.add(name)
    return {name: x for name, x in mechanism.parameter_values.items() if name not in changing}


def _exerted_by(mechanism: Mechanism, name: str, kind: str, component: str) -> AbstractQuantity:
    """Return the output of the force of a driver along its coordinate, or of a joint on its second body."""
    driver = mechanism.drivers.get(name)
    if driver is None or component:
        return JointForceOutput(name) if kind == "force" else JointTorqueOutput(name)
    if is_turning(driver) != (kind == "torque"):
        effort, other_effort = ("torque", "force") if is_turning(driver) else ("force", "torque")
        raise MechanismError(f"the driver '{name}' exerts a {effort}, not a {other_effort}; write {effort}({name})")
    return DriverTorqueOutput(name) if kind == "torque" else DriverForceOutput(name)


@contextmanager
def naming_errors(name: str, whole: bool = False) -> Iterator[None]:
    """Prefix the location of errors with a name, or replace it by the name."""
    try:
        yield
    except JounceError as error:
        error.name = name if error.name is None or whole else f"{name}.{error.name}"
        raise
