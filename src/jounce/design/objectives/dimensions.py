"""Check of dimensions of the sides of a condition: a span of an angle is not a length."""

from jounce.design.objectives.language import EXERTED, MEASURES, OVER_TIME, Node, Relation
from jounce.design.objectives.quantities import Quantities
from jounce.errors import UnitError
from jounce.units.dimensions import LENGTH, TIME, Dimension, describe_dimension, times
from jounce.units.values import parse_unit


def check_dimensions(relation: Relation, quantities: Quantities) -> None:
    """Raise UnitError if one side has a unit that the other cannot have."""
    sides = relation.left, relation.right
    left, right = (x or _dimension(side, quantities) for x, side in zip(relation.dimensions, sides, strict=True))
    if any(relation.dimensions) and left is not None and right is not None and left != right:
        measured, stated = zip(sides, (left, right), strict=True)
        if not relation.dimensions[1]:
            measured, stated = stated, measured
        message = f"{measured[0].text} is {describe_dimension(measured[1])}"
        other = f"{describe_dimension(stated[1])}, {stated[0].text} in SI units"
        raise UnitError(f"{message}, and is compared with {other}")


def _dimension(node: Node, quantities: Quantities) -> Dimension | None:
    """Return the dimension of a parameter or of a measure of one quantity; None if unknown."""
    if node.kind == "name":
        return next(iter(quantities.mechanism.dimensions.get(node.word, ())), None)
    if node.kind != "call" or not node.parts:
        return None
    if node.word in ("*", "/") and node.parts[1].kind == "number":
        return _dimension(node.parts[0], quantities)
    if node.word == "*" and node.parts[0].kind == "number":
        return _dimension(node.parts[1], quantities)
    if node.word.startswith("path"):
        return LENGTH
    if node.word not in MEASURES:
        dimensions = [_dimension(part, quantities) for part in node.parts]
        return dimensions[0] if node.word in ("+", "-", "neg", "pos") and len({*dimensions}) == 1 else None
    arguments = node.parts[1:]
    steps = arguments[0] if node.word in OVER_TIME and arguments else arguments[0] if len(arguments) == 2 else None
    if steps is not None and steps.kind != "number":
        return None
    order = 0 if steps is None else int(steps.word)
    subject = node.parts[0]
    if subject.kind == "call" and subject.word in EXERTED:
        unit = "N" if subject.word.startswith("force") else "N*m"
    elif subject.kind == "name" and quantities.known.get(subject.word) == "quantities":
        unit = quantities.mechanism.outputs[quantities.output_of(subject.word)[0]].unit
    else:
        return None
    return times(parse_unit(unit)[1], TIME, -order) if unit else None
