"""The arguments of measures after their quantity: derivatives, instants and windows of time."""

from collections.abc import Mapping, Sequence

from jounce.design.objectives.language import EXERTED, MEASURES, Node, operated
from jounce.errors import ExpressionError
from jounce.kinematics.position_analysis.solve import HIGHEST_ORDER

MAX_DERIVATIVE = HIGHEST_ORDER - 2  # of goals, which also need its first and second rate


class Arguments:
    """Reader of the arguments of measures, which are the same in all designs.

    Parameters
    ----------
    fixed : dict of str to float
        Parameters that do not vary.
    interval : tuple of float
        First and last instant of the motion, s.

    Attributes
    ----------
    instants : list of float
        Instants that measures name, s.
    """

    def __init__(self, fixed: Mapping[str, float], interval: tuple[float, float]):
        self.fixed, self.interval = fixed, interval
        self.instants: list[float] = []

    def constant(self, node: Node) -> float | None:
        """Return the value of an expression that is the same in all designs; None if it may vary."""
        if node.kind == "number":
            return float(node.word)
        if node.kind == "name":
            return self.fixed.get(node.word)
        if node.word in MEASURES or node.word in EXERTED:
            return None
        operands = [self.constant(operand) for operand in node.parts]
        return None if None in operands else float(operated(node.word, operands))

    def argument(self, node: Node, role: str) -> float:
        """Return the value of an argument, which must be the same in all designs."""
        value = self.constant(node)
        if value is None:
            message = f"{role} '{node.text}' must be a number that is the same in all designs"
            raise ExpressionError(message)
        return value

    def derivative(self, node: Node) -> int:
        """Return the order of a derivative."""
        order = self.argument(node, "the derivative")
        if order != int(order) or not 0 <= order <= MAX_DERIVATIVE:
            message = f"the derivative must be a whole number from 0 to {MAX_DERIVATIVE}, got {order:g}"
            raise ExpressionError(message)
        return int(order)

    def instant(self, node: Node) -> float:
        """Return an instant of the motion, s, and add it to `instants`."""
        instant = self.argument(node, "the instant")
        first, last = self.interval
        if not first <= instant <= last:
            message = f"the instant {instant:g} s is not within the motion, which is from {first:g} to {last:g} s"
            raise ExpressionError(message)
        self.instants.append(instant)
        return instant

    def window(self, arguments: Sequence[Node]) -> tuple[float | None, float | None]:
        """Return the window of time of a measure, s, from two arguments after the derivative."""
        if len(arguments) < 3:
            return None, None
        start, stop = self.instant(arguments[1]), self.instant(arguments[2])
        if not start < stop:
            raise ExpressionError(f"the window must end after it begins, got {start:g} to {stop:g} s")
        return start, stop
