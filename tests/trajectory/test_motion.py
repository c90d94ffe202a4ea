"""Motion laws: expressions, Python functions and splines of samples, on jets."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

import jounce as jn
from jounce.jet import Jet
from tests.oracles import sommer_planar
from tests.problems.small import crank

INSTANTS = jnp.asarray([[0.1, 0.5, 0.93]])


def derivatives(law, order=4, at=INSTANTS):
    return np.array(law(Jet.variable(at, order)).derivatives())


class TestExpressionMotion:
    def test_values_and_derivatives(self):
        found = derivatives(jn.laws.ExpressionMotion("a*t**3 + cos(w*t)", {"a": 2.0, "w": 3.0}), 2)
        t = np.array(INSTANTS)
        np.testing.assert_allclose(found[0], 2 * t**3 + np.cos(3 * t), rtol=1e-15)
        np.testing.assert_allclose(found[1], 6 * t**2 - 3 * np.sin(3 * t), rtol=1e-14)
        np.testing.assert_allclose(found[2], 12 * t - 9 * np.cos(3 * t), rtol=1e-14)

    def test_equation_056_of_sommer_2024(self):
        law = jn.laws.ExpressionMotion("30*deg + 60*deg*sin(2*pi*t/tau)", {"tau": 2.0})
        right = sommer_planar.equation_056(np.array(INSTANTS), np.radians(30), np.radians(60), 2.0)
        np.testing.assert_allclose(derivatives(law), right, rtol=1e-13, atol=1e-12)

    @pytest.mark.parametrize("text", ["0.3", "a", "2*a - 1"])
    def test_constant_law(self, text):
        found = derivatives(jn.laws.ExpressionMotion(text, {"a": 0.65}), 2)
        np.testing.assert_allclose(found[0], np.full((1, 3), 0.65 if text == "a" else 0.3))
        np.testing.assert_array_equal(found[1:], 0)

    def test_name_without_a_value(self):
        with pytest.raises(jn.errors.ExpressionError, match="tua"):
            jn.laws.ExpressionMotion("sin(2*pi*t/tua)", {"tau": 2.0})


class TestFunctionMotion:
    def test_any_traceable_function(self):
        found = derivatives(jn.laws.FunctionMotion(lambda t: jnp.where(t < 0.5, t**2, jnp.sin(t))), 1)
        t = np.array(INSTANTS)
        np.testing.assert_allclose(found[0], np.where(t < 0.5, t**2, np.sin(t)), rtol=1e-15)
        np.testing.assert_allclose(found[1], np.where(t < 0.5, 2 * t, np.cos(t)), rtol=1e-15)

    @pytest.mark.slow
    def test_plain_function_and_expression_drive_alike(self):
        by_function = jn.solve(crank(lambda t: 0.3 + jnp.sin(2 * t) * t), [0.0, 0.7]).outputs["angle"]
        by_expression = jn.solve(crank("0.3 + sin(2*t)*t"), [0.0, 0.7]).outputs["angle"]
        np.testing.assert_allclose(by_function, by_expression, rtol=1e-13, atol=1e-14)

    @pytest.mark.slow
    def test_number_is_a_constant_law(self):
        np.testing.assert_allclose(jn.solve(crank(0.4), [0.0], order=1).outputs["angle"], [[0.4, 0.0]])


class TestSplineMotion:
    times = np.linspace(0.0, 1.0, 21)

    @pytest.mark.parametrize("degree", [1, 3, 5, 7])
    def test_polynomial_of_the_degree_is_itself(self, degree):
        polynomial = np.polynomial.Polynomial(np.random.default_rng(degree).uniform(-1, 1, degree + 1))
        found = derivatives(jn.laws.SplineMotion(self.times, polynomial(self.times), degree), degree + 1)
        t = np.array(INSTANTS)
        for k in range(degree + 1):
            expected = polynomial.deriv(k)(t) if k else polynomial(t)
            np.testing.assert_allclose(found[k], expected, atol=1e-14 * 60.0**k)
        np.testing.assert_array_equal(found[degree + 1], 0)

    def test_samples_of_any_kind_against_scipy(self):
        times = np.sort(np.random.default_rng(1).uniform(0, 1, 15))
        values = np.sin(7 * times)
        spline = make_interp_spline(times, values, k=5)
        at = jnp.asarray(np.linspace(times[0], times[-1], 11))[None]
        found = derivatives(jn.laws.SplineMotion(times, values, 5), 4, at)
        for k in range(5):
            expected = spline.derivative(k)(np.array(at)) if k else spline(np.array(at))
            np.testing.assert_allclose(found[k], expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())

    @pytest.mark.slow
    def test_it_goes_through_its_samples(self):
        values = np.cos(5 * self.times)
        law = jn.laws.SplineMotion(self.times, values)
        found = derivatives(law, 0, jnp.asarray(self.times)[None])
        np.testing.assert_allclose(found[0, 0], values, atol=1e-14)

    @pytest.mark.parametrize("degree", [1, 3, 5, 7])
    @pytest.mark.parametrize("held", [0.3, -1e6 / 3])
    def test_samples_that_all_agree_are_at_rest_exactly(self, degree, held):
        """Friction takes its sign from the velocity: rounding in its place would be all of the friction."""
        times = np.cumsum(np.random.default_rng(1).uniform(0.5, 1.5, 60)) / 7
        found = derivatives(
            jn.laws.SplineMotion(times, np.full(60, held), degree), 3, jnp.linspace(times[0], times[-1], 97)
        )
        assert (found[0] == held).all()
        assert (found[1:] == 0).all()

    def test_outside_the_samples_the_end_pieces_go_on_where_they_are_to(self):
        law = jn.laws.SplineMotion(self.times, self.times**3, 3, beyond="continue")
        np.testing.assert_allclose(derivatives(law, 0, jnp.asarray([[-0.5, 1.5]])), [[[-0.125, 3.375]]], rtol=1e-11)

    def test_jets_of_the_law_agree_with_its_values_nearby(self):
        law = jn.laws.SplineMotion(self.times, np.sin(3 * self.times), 5)
        jet = law(Jet.variable(INSTANTS, 5))
        step = 1e-3
        np.testing.assert_allclose(jet.evaluate(step), derivatives(law, 0, INSTANTS + step)[0], rtol=1e-14)

    @pytest.mark.slow
    def test_two_splines_drive_two_bodies(self):
        """Drivers of a kind are stacked: each must take its own samples."""
        one, two = (jn.laws.SplineMotion(self.times, a * self.times**2, 3) for a in (1.0, -2.0))
        mechanism = jn.Mechanism(
            space="planar",
            bodies={"a": jn.Body([0, 0]), "b": jn.Body([1, 0])},
            joints={n: jn.planar.Revolute(("ground", n), [x, 0], [0, 0]) for n, x in (("a", 0.0), ("b", 1.0))},
            drivers={
                f"d{n}": jn.drivers.CoordinateDriver(("ground", n), "angle", law) for n, law in (("a", one), ("b", two))
            },
            outputs={n: jn.outputs.AngleOutput(n) for n in "ab"},
        )
        time = np.array([0.0, 0.33, 0.71, 1.0])
        motion = jn.solve(mechanism, time, order=2)
        for name, a in (("a", 1.0), ("b", -2.0)):
            expected = np.stack([a * time**2, 2 * a * time, np.full(4, 2 * a)], axis=1)
            np.testing.assert_allclose(motion.outputs[name], expected, atol=1e-11)

    @pytest.mark.parametrize(
        "times, values, degree, message",
        [
            ([0.0, 1.0], [0.0, 1.0], 5, "needs at least 6 samples"),
            ([0.0, 1.0, 1.0], [0.0, 1.0, 2.0], 1, r"times\[2\]: .* must increase"),
            ([0.0, 1.0, np.nan], [0.0, 1.0, 2.0], 1, r"times\[2\]: samples must be finite"),
            ([0.0, 1.0, 2.0], [0.0, np.inf, 2.0], 1, r"values\[1\]: samples must be finite"),
            ([0.0, 1.0], [0.0, 1.0, 2.0], 1, "equal length"),
            ([0.0, 1.0, 2.0], [0.0, 1.0, 2.0], 0, "degree: must be a whole number from 1 to 11"),
            ([], [], 1, "samples"),
        ],
    )
    def test_wrong_samples(self, times, values, degree, message):
        with pytest.raises(jn.errors.MechanismError, match=message):
            jn.laws.SplineMotion(times, values, degree)
