"""Laws of several joints together, beside each of them alone."""

import jax
import numpy as np
import pytest

from jounce.jet import Jet
from jounce.trajectory import ExpressionMotion, SplineMotion
from jounce.trajectory.laws import stacking
from jounce.trajectory.laws.stacking import evaluate_laws, law_derivatives

TIMES = np.linspace(0.0, 2.0, 70)


def laws():
    knots = np.linspace(0.0, 2.0, 9)
    return [
        SplineMotion(knots, np.sin(knots)),
        ExpressionMotion("0.3*sin(2*t)"),
        SplineMotion(knots, np.cos(knots)),
        ExpressionMotion("0.7*sin(5*t)"),
        ExpressionMotion("0.2"),
    ]


@pytest.mark.parametrize("count", [0, 1, 70])
def test_laws_together_are_each_alone(count):
    together = law_derivatives(laws(), TIMES[:count], 3)
    assert together.shape == (4, 5, count)
    for k, law in enumerate(laws()):
        alone = np.broadcast_to(law(Jet.variable(TIMES[:count], 3)).derivatives(), (4, count))
        np.testing.assert_allclose(together[:, k], alone, rtol=0, atol=1e-13 * max(1.0, np.abs(alone).max(initial=0)))


def test_other_numbers_of_instants_have_the_same_program():
    law_derivatives(laws(), TIMES, 2)
    programs = len(stacking._derivatives.machine_code)
    for count in (1, 3, 69):
        law_derivatives(laws(), TIMES[:count], 2)
    assert len(stacking._derivatives.machine_code) == programs


def test_laws_that_are_traced():
    def last(size):
        law = ExpressionMotion("size*t**3", {"size": size})
        return evaluate_laws([law, law], Jet.variable(TIMES, 1)).coefficients[1][1, -1]

    assert float(jax.grad(last)(2.0)) == pytest.approx(12.0, rel=1e-14)
