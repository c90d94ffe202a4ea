"""Which formulas may bend, and kinks of laws that are seen."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce.trajectory.law_checks.observed import may_bend, observed_jumps


@pytest.mark.parametrize(
    "text, expected",
    [
        ("(t**3 - 2*t)/3 + cos(t)**2/2**0.5", False),
        ("sqrt(2)*exp(-t)*tanh(t)/abs(a)", False),
        ("t**+2", False),
        ("sqrt(t)", True),
        ("t**0.5", True),
        ("t**-1", True),
        ("t**a", True),
        ("2**t", True),
        ("a/t", True),
        ("tan(t)", True),
        ("log(t)", True),
        ("sin(abs(t))", True),
    ],
)
def test_formulas_without_singular_operations_cannot_bend(text, expected):
    assert may_bend(jn.laws.ExpressionMotion(jn.laws.Expression(text), {"a": 2.0} if "a" in text else {})) is expected


def test_functions_without_rules_are_looked_at_to_a_lower_order():
    """A loop until a condition is differentiated by nesting: its kink is found all the same."""

    def law(t):
        return jax.lax.while_loop(lambda x: x > 0.25, lambda x: x - 0.25, t)

    found = observed_jumps([jn.laws.FunctionMotion(law)], 0.0, 0.9, 1)
    np.testing.assert_allclose(found.instants, [0.25, 0.5, 0.75], atol=1e-10)
    np.testing.assert_allclose(found.sizes[:, 0, 0], -0.25)


def test_laws_of_several_joints_are_looked_at_together():
    laws = [jn.laws.FunctionMotion(lambda t: jnp.abs(t - 0.2)), jn.laws.ExpressionMotion("sin(t)")]
    found = observed_jumps(laws, 0.0, 1.0, 3)
    np.testing.assert_allclose(found.sizes[0, 1], [2.0, 0.0])
    np.testing.assert_allclose(found.instants, [0.2], atol=1e-11)
