"""Laws of forces: numbers, expressions, functions and splines on jets; refusals name the location."""

import math

import jax.numpy as jnp
import numpy as np
import pytest
from mpmath import mp

import jounce as jn
from jounce import forces
from jounce.forces import ExpressionLaw, FunctionLaw, TimeLaw, VectorLaw
from jounce.mechanism import build
from tests.forces.motions import system_of

ORDER = 4


def jets(motion, instant=0.3):
    """Return the jets of displacement, velocity and time of a displacement given as a function for mpmath."""
    x = jn.Jet([jnp.full((1, 1), float(c)) for c in mp.taylor(motion, instant, ORDER + 1)])
    return x.truncate(ORDER), x.differentiate(), jn.Jet.variable(jnp.full((1, 1), instant), ORDER)


@pytest.mark.parametrize(
    "text, parameters, formula",
    [
        ("-k*x**3 - c*v", {"k": 2.0, "c": 0.5}, lambda x, v, t: -2 * x**3 - v / 2),
        ("exp(-x)*cos(5*t) + v**2", {}, lambda x, v, t: mp.exp(-x) * mp.cos(5 * t) + v**2),
        ("c*tanh(v/2)", {"c": 0.5}, lambda x, v, t: mp.tanh(v / 2) / 2),
        ("k*t**2", {"k": 2.0}, lambda x, v, t: 2 * t**2),
        ("k", {"k": 2.0}, lambda x, v, t: mp.mpf(2)),
    ],
)
def test_rates_of_an_expression_are_those_of_what_it_says(text, parameters, formula):
    def place(t):
        return mp.sin(2 * t) + 1.5

    with mp.workdps(40):
        exact = mp.taylor(lambda t: formula(place(t), 2 * mp.cos(2 * t), t), 0.3, ORDER)
        found = ExpressionLaw(text, parameters)(*jets(place))
    exact = [float(c * mp.factorial(k)) for k, c in enumerate(exact)]
    assert found.shape == (1, 1)
    np.testing.assert_allclose(found.derivatives()[:, 0, 0], exact, rtol=0, atol=1e-13 * np.abs(exact).max())


def test_laws_of_components_by_their_names():
    law = VectorLaw([ExpressionLaw(text, {}, ("x", "y"), ("vx", "vy")) for text in ("x*vy", "y - 2*t")])
    place = jn.Jet([jnp.array([1.0, 2.0])[:, None, None], jnp.array([3.0, 4.0])[:, None, None]])
    velocity = place.differentiate()
    found = law(place, velocity, jn.Jet.variable(jnp.full((1, 1), 0.5), 1))
    np.testing.assert_array_equal(found.coefficients[0][:, 0, 0], [4.0, 1.0])


def test_functions_and_motion_laws():
    x, v, t = jets(lambda t: t**2)
    damped = FunctionLaw(lambda x, v, t: -v * abs(x.coefficients[0]))
    np.testing.assert_allclose(damped(x, v, t).derivatives()[:, 0, 0], [-0.6 * 0.09, -2 * 0.09, 0, 0, 0], atol=1e-15)
    np.testing.assert_array_equal(FunctionLaw(lambda x, v, t: 7.0)(x, v, t).derivatives()[:, 0, 0], [7, 0, 0, 0, 0])
    times = np.linspace(0, 1, 11)
    spline = TimeLaw(jn.laws.SplineMotion(times, times**3, degree=5))
    np.testing.assert_allclose(spline(x, v, t).derivatives()[:4, 0, 0], [0.027, 0.27, 1.8, 6], rtol=1e-11)


def test_numbers_are_stacked_and_expressions_of_one_text_too():
    made = {
        "one": forces.Torque(("a", "b"), 1.0),
        "two": forces.Torque(("ground", "b"), 2),
        "first": forces.Torque(("a", "b"), "-k*v"),
        "second": forces.Torque(("b", "a"), jn.laws.Expression("-k*v")),
        "other": forces.Torque(("a", "b"), "-k*x"),
    }
    system, model = system_of(made, 2, {"k": 3.0})
    assert model.forces == (("one", "two"), ("first", "second"), ("other",))
    pose = jn.rigid.PlanarPose.from_jets(
        jn.Jet.constant(jnp.zeros((2, 3, 1)), 1), jn.Jet([jnp.zeros((3, 1)), jnp.array([[0.0], [1.0], [5.0]])])
    )
    time = jn.Jet.variable(jnp.zeros((1, 1)), 1)
    found = [np.asarray(group.force(pose, time).coefficients[0])[0, :, 0].tolist() for group in system.forces]
    assert found == [[1.0, 2.0], [-12.0, 12.0], [0.0]]
    load = system.applied_forces(pose, time).coefficients[0][2, :, 0]
    np.testing.assert_allclose(load[1:], [-1 + 12 + 12, 1 + 2 - 12 - 12], rtol=1e-15)


def test_other_values_of_parameters_reach_the_laws():
    mechanism = jn.Mechanism(
        space="planar",
        bodies={"a": jn.Body([0, 0])},
        joints={},
        forces={"brake": forces.Torque(("ground", "a"), "-c*v")},
        parameters={"c": 1.0},
    )
    laws = [build(m).system.forces[0].element.law for m in (mechanism, mechanism.with_parameters(c=4.0))]
    assert [float(law.parameters["c"][0, 0]) for law in laws] == [1.0, 4.0]
    assert laws[0].expression is laws[1].expression or laws[0].expression == laws[1].expression


def built(force, space="planar", parameters=()):
    size = 2 if space == "planar" else 3
    mechanism = jn.Mechanism(
        space=space,
        bodies={"a": jn.Body([0.0] * size), "b": jn.Body([0.0] * size)},
        joints={},
        forces={"F": force},
        parameters=dict(parameters),
    )
    (group,) = build(mechanism).system.forces
    return group.element


BOTH, LINE = ("a", "b"), ([0, 0], [0, 0])


@pytest.mark.parametrize(
    "wrong, message",
    [
        (
            lambda: forces.Torque(BOTH, "-c*v"),
            r"forces\.F\.law: unknown name 'c' at column 2 of '-c\*v'; valid: .*v, x",
        ),
        (lambda: forces.Torque(BOTH, "vx"), r"forces\.F\.law: unknown name 'vx'"),
        (lambda: forces.Torque(BOTH, math.nan), r"forces\.F\.law: must be finite, got nan"),
        (lambda: forces.Torque(BOTH, None), r"forces\.F\.law: a law is a number, .*got nothing"),
        (lambda: forces.Torque(BOTH, True), r"forces\.F\.law: a law is a number, .*got true"),
        (lambda: forces.Torque(BOTH, [1.0]), r"forces\.F\.law: a law is a number, .*got \[1\.0\]"),
        (lambda: forces.Torque(BOTH, lambda x: x), r"forces\.F\.law: the law cannot be used: .*jets of displacement"),
        (lambda: forces.Torque(BOTH, lambda x, v, t: jn.Jet([jnp.zeros(3)])), r"law cannot be used.*shape"),
        (lambda: forces.Torque(BOTH, lambda x, v, t: x.y), r"forces\.F\.law: the law cannot be used: .*'y'"),
        (lambda: forces.PointForce("a", [0, 0], 1.0), r"forces\.F\.law: must be a list of 2 laws or numbers, got 1\.0"),
        (lambda: forces.PointForce("a", [0, 0], "t"), r"forces\.F\.law: must be a list of 2 laws or numbers, got 't'"),
        (lambda: forces.PointForce("a", [0, 0], [1, 2, 3]), r"forces\.F\.law: must be a list of 2 laws"),
        (lambda: forces.PointForce("a", [0, 0, 0], [1, 2]), r"forces\.F\.point: must be a vector of 2 numbers"),
        (lambda: forces.Spring(BOTH, *LINE, stiffness=math.inf, length=1), r"forces\.F\.stiffness: must be finite"),
        (lambda: forces.Spring(BOTH, *LINE, stiffness="k", length=1), r"forces\.F\.stiffness: unknown name 'k'"),
        (
            lambda: forces.Spring(BOTH, *LINE, stiffness=1, length=-1),
            r"forces\.F\.length: must not be negative, got -1",
        ),
        (lambda: forces.Spring(BOTH, *LINE, stiffness=[1, 2], length=1), r"forces\.F\.stiffness: must be one number"),
        (lambda: forces.SlideForce(BOTH, *LINE, [0, 0], 1.0), r"forces\.F\.vector_i: must not be of zero length"),
    ],
)
def test_what_no_law_or_value_is(wrong, message):
    with pytest.raises(jn.JounceError, match=message):
        built(wrong())


def test_values_that_are_allowed():
    """A stiffness may be negative, a free length zero, or of any sign for a slide; a vector of laws may be an array."""
    spring = built(forces.Spring(BOTH, *LINE, stiffness=-3.0, length=0.0, damping=-1.0))
    assert [float(x.item()) for x in (spring.stiffness, spring.length, spring.damping)] == [-3.0, 0.0, -1.0]
    slide = built(forces.SlideSpring(BOTH, *LINE, [1, 0], stiffness=0.0, length=-2.0))
    assert [float(x.item()) for x in (slide.stiffness, slide.length)] == [0.0, -2.0]
    x, v, t = (jn.Jet([jnp.array([[[a]], [[b]]])]) for a, b in ((0.3, 0.4), (1.5, -2.5), (0.7, 0.7)))
    for law, expected in (
        (np.array([1.0, 2.0]), [1.0, 2.0]),
        (lambda x, v, t: -v, [-1.5, 2.5]),
        ([jn.laws.FunctionMotion(jnp.sin), "t"], [np.sin(0.7), 0.7]),
    ):
        force = built(forces.PointForce("a", [0, 0], law)).force(x, v, t[0])
        np.testing.assert_allclose(np.ravel(force.coefficients[0]), expected, rtol=1e-15)


def test_a_parameter_may_not_hide_a_variable_of_a_law():
    with pytest.raises(jn.errors.MechanismError, match=r"forces\.F\.law: .*'x' .*variable"):
        built(forces.Torque(BOTH, "-x"), parameters={"x": 1.0})
    built(forces.Torque(BOTH, "-v"), parameters={"x": 1.0})


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: forces.Torque(("a", "b", "c"), 1.0), r"bodies: torque acts on 2 bodies, got \['a', 'b', 'c'\]"),
        (lambda: forces.Moment(("a", "b"), 1.0), r"bodies: moment acts on 1 body, got \['a', 'b'\]"),
        (lambda: forces.Torque(("a", "a"), 1.0), r"bodies: torque must act between different bodies"),
        (
            lambda: forces.PointForce("a", [0, 0], [1, 2], frame="local"),
            r"frame: unknown frame, got 'local'; .*valid: body, global",
        ),
        (
            lambda: forces.SpatialTorque(("a", "b"), [0, 0, 1], 1.0, vector_i=[1, 0, 0]),
            r"vectors: torque takes two vectors, one on each body, or none",
        ),
        (lambda: built(forces.Torque(BOTH, 1.0), "spatial"), r"forces\.F: is planar, in a spatial mechanism"),
        (lambda: built(forces.Moment("ground", 1.0)), r"forces\.F\.bodies: acts on the ground alone, which never"),
        (
            lambda: built(forces.Moment("c", 1.0)),
            r"forces\.F\.bodies: no body has this name, got 'c'; valid: a, b, gr",
        ),
    ],
)
def test_structure_of_forces(make, message):
    with pytest.raises(jn.errors.MechanismError, match=message):
        make()


def test_a_force_of_ones_own_joins_the_catalogue():
    class Magnet(jn.forces.AbstractForce, type="magnet"):
        """Attraction of two points."""

        point_i: jn.joints.Vector
        point_j: jn.joints.Vector
        strength: jn.joints.Scalar

        def displacement(self, body_i, body_j, time):
            d = body_j.point(self.point_j) - body_i.point(self.point_i)
            return d.dot(d)

        def force(self, displacement, velocity, time):
            return -self.strength / displacement**2

    for space in ("planar", "spatial"):
        assert forces.force_catalogue(space)["magnet"] is Magnet
    for kind in (jn.joints.Scalar, jn.forces.Law, jn.forces.Laws):
        assert kind.__metadata__
    built(Magnet(BOTH, *LINE, strength="2*s"), parameters={"s": 1.0})
    assert "magnet" not in forces.force_catalogue("neither")
