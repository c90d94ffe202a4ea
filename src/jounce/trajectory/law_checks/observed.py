"""Which laws may jump or bend where nothing says so, and where they are seen to."""

from typing import Any

import jax
import numpy as np
from jaxtyping import Float

from jounce.jet.programs.composition import Composed, has_rules
from jounce.trajectory.law_checks.seen_jumps import SeenJumps, seen_jumps
from jounce.trajectory.laws.composed import FollowingMotion
from jounce.trajectory.laws.profiles import AbstractProfile
from jounce.trajectory.laws.stacking import law_derivatives
from jounce.trajectory.laws.user_laws import read_laws
from jounce.trajectory.motion import AbstractMotion, ExpressionMotion, SplineMotion
from jounce.units.expression import Expression

SMOOTH = frozenset("+ - * pos neg sin cos exp sinh cosh tanh atan".split())  # operations without kinks, jumps and poles
HIGHEST_SEEN = 5  # highest derivative whose jumps are sought, that above jounce: rounding hides those of higher ones
TERMS = 3  # number of terms of series above that derivative


def may_bend(law: Any) -> bool:
    """Tell whether a law may have a kink that is not known: one that is no spline, profile or smooth expression.

    Kinks of its leader are looked for there.

    Examples
    --------
    >>> import jounce as jn
    >>> def law(text):
    ...     return jn.laws.ExpressionMotion(jn.laws.Expression(text), {})
    >>> may_bend(law("t**3/2 + sin(t)")), may_bend(law("atan(1/t)")), may_bend(law("(t**2)**0.5"))
    (False, True, True)
    """
    if members := getattr(law, "parts", ()):
        return any(map(may_bend, members[:1] if isinstance(law, FollowingMotion) else members))
    if isinstance(law, ExpressionMotion):
        return _has_singularities(law.expression)
    return not isinstance(law, SplineMotion | AbstractProfile)


def _has_singularities(expression: Expression) -> bool:
    """Tell whether an operation on something that moves with time has places where it is not analytic.

    Each operand is folded to its value if that is a number, whether it moves, and whether it has such places.
    """

    def operation(symbol: str, operands: list[Any]) -> Any:
        moves = [operand[1] for operand in operands]
        smooth = symbol in SMOOTH or not any(moves)
        if symbol == "/":
            smooth = not moves[1]
        if symbol == "**" and not moves[1]:
            exponent = operands[1][0]
            smooth = not moves[0] or (exponent is not None and exponent >= 0 and float(exponent).is_integer())
        value = operands[0][0] if symbol == "pos" else None
        return value, any(moves), not smooth or any(operand[2] for operand in operands)

    return expression.folded(lambda x: (x, False, False), lambda name: (None, name == "t", False), operation)[2]


def observed_jumps(laws: list[AbstractMotion], first: float, last: float, order: int) -> SeenJumps:
    """Return the observed jumps of derivatives of laws up to an order, at most the fifth.

    Examples
    --------
    >>> import jounce as jn
    >>> law = jn.laws.FunctionMotion(lambda t: abs(t - 0.3))
    >>> found = observed_jumps([law], 0.0, 1.0, 1)
    >>> found.instants.round(9).tolist(), found.sizes[..., 0].round(9).tolist()
    ([0.3], [[0.0, 2.0]])
    """
    order = min(order, HIGHEST_SEEN)
    programs = read_laws(laws)
    leaves = jax.tree.leaves(programs, is_leaf=lambda x: isinstance(x, Composed))
    has_all = all(has_rules(x.program) for x in leaves if isinstance(x, Composed))  # others take twice as long an order
    levels = order + (TERMS if has_all else 1)

    def evaluate(times: Float[np.ndarray, " time"]) -> Float[np.ndarray, "time level joint"]:
        return np.moveaxis(law_derivatives(programs, times, levels), -1, 0).copy()

    return seen_jumps(evaluate, first, last, order)
