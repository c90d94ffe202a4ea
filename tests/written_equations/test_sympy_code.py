"""Equations as expressions of SymPy, turned into numbers and differentiated by SymPy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce.errors import MechanismError
from tests.dynamics.test_racks import rack
from tests.problems.bank import cases
from tests.problems.mechanisms import example
from tests.problems.written import at, between_free_bodies, coordinates, from_one, random_states, run
from tests.written_equations.test_code import worm

pytestmark = pytest.mark.long

sympy = pytest.importorskip("sympy")

QUICK = "planar-joint-double_revolute"
CASES = [
    pytest.param(case, id=str(case), marks=[] if str(case) == QUICK else pytest.mark.slow)
    for case in cases()
    if case.kind not in (jn.spatial.Gear, jn.spatial.Rolling)  # other joints hold their axes: see below
]


def numbers(module, name, *values):
    """Return the values of the expressions of a function."""
    given = [module[x] for x in ("t", "q", "velocities", "multipliers")[: len(values)]]
    expressions = module[name](*given)
    return np.array(sympy.lambdify(given, expressions, cse=True)(*values), float)


def assert_same(code, equations, time):
    """Compare expressions of SymPy with equations as numbers, at their first instant."""
    q, v = coordinates(equations)[0], np.nan_to_num(from_one(equations.velocities)[0])
    for name, found in (
        ("residual", numbers(code, "residual", time, q)[:, 0]),
        ("jacobian", numbers(code, "jacobian", time, q)),
        ("right_side", numbers(code, "right_side", time, q, v)[..., 0]),
    ):
        expected = from_one(equations.right_side)[0] if name == "right_side" else equations[name].values[0]
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * max(1.0, np.abs(expected).max()))


@pytest.mark.parametrize("case", CASES)
def test_every_joint_and_driver(case):
    random = np.random.default_rng(7)
    mechanism = between_free_bodies(case.element(random), case.space)
    equations = jn.constraint_equations(mechanism, state := random_states(mechanism, 2, random), 0.3)
    code = run(jn.equations(at(mechanism, state, 0.3), format="sympy", order=3))
    assert_same(code, equations, 0.3)


@pytest.mark.slow
@pytest.mark.parametrize("mechanism", [worm(), rack(law="0.6*t + 0.3*sin(t)")], ids=["worm", "rack"])
def test_joints_whose_axes_are_held_by_others(mechanism):
    motion = jn.solve(mechanism, [0.3], order=3)
    assert_same(run(jn.equations(motion, format="sympy", order=3)), jn.constraint_equations(motion), 0.3)


def test_sympy_differentiates_the_residual_to_the_same_jacobian_and_right_sides():
    """Of the four-bar, along coordinates that are functions of time: nothing of jets is used."""
    code = run(jn.equations(jn.load(example("four_bar")), "BC", format="sympy", order=3))
    t = code["t"]
    moving = [sympy.Function(str(x))(t) for x in code["q"]]
    phi = code["residual"](t, moving)[0]
    velocities = [[x.diff(t, k) for x in moving] for k in (1, 2, 3)]
    jacobian = code["jacobian"](t, moving)
    for x, entry in zip(moving, jacobian, strict=True):
        assert largest(phi.diff(x) - entry) < 1e-15
    for k, side in enumerate(code["right_side"](t, moving, velocities), 1):
        left = sum(a * b for a, b in zip(jacobian, velocities[k - 1], strict=True))
        assert largest(phi.diff(t, k) - left + side[0]) < 1e-14


def largest(expression):
    """Return the size of the largest coefficient of an expression: zero up to rounding of the numbers in it."""
    return max(map(abs, sympy.expand(expression).as_coefficients_dict().values()))


class Tilted(jn.joints.AbstractConstraint):
    def residual(self, body_i, body_j, time):
        d = body_j.position - body_i.position
        return jn.jet.atan2(d[1], d[0]) - body_j.angle


def test_an_angle_of_ones_own():
    mechanism = between_free_bodies(Tilted(("one", "two")), "planar")
    text = jn.equations(mechanism, format="sympy", order=2)
    assert "Piecewise" not in text
    q, v = np.array([0.1, 0.2, 0.3, 0.7, -0.4, 0.5]), np.arange(6.0).reshape(1, 6) - 2
    for name, values in (("residual", (0.0, q)), ("jacobian", (0.0, q)), ("right_side", (0.0, q, v.repeat(2, 0)))):
        expected = run(jn.equations(mechanism, order=2))[name](*values)
        np.testing.assert_allclose(numbers(run(text), name, *values).reshape(expected.shape), expected, atol=1e-14)


class Steps(jn.joints.AbstractConstraint):
    def residual(self, body_i, body_j, time):
        d = body_j.position - body_i.position
        return d[1] - jn.jet.Jet.constant(jnp.round(d[0].coefficients[0]), d.order)


class Sawtooth(jn.joints.AbstractConstraint):
    def residual(self, body_i, body_j, time):
        d = body_j.position - body_i.position
        return d[1] - jn.jet.Jet.constant(jax.lax.rem(d[0].coefficients[0], 0.7), d.order)


@pytest.mark.parametrize("x", [-1.5, -0.2, 0.0, 0.5, 2.5])
def test_remainders_have_the_sign_of_what_is_divided(x):
    code = run(jn.equations(between_free_bodies(Sawtooth(("one", "two")), "planar"), format="sympy", order=1))
    q = np.array([0.0, 0, 0, x, 0, 0])
    for found in (numbers(code, "residual", 0.0, q)[0, 0], code["residual"](0.0, q.tolist())[0]):
        assert float(found) == pytest.approx(-np.fmod(x, 0.7), abs=1e-15)


@pytest.mark.parametrize("x", [-2.5, -1.5, -0.5, -0.2, 0.0, 0.5, 1.2, 1.5, 2.5])
def test_halves_are_rounded_to_even_numbers(x):
    mechanism = between_free_bodies(Steps(("one", "two")), "planar")
    q = np.array([0.0, 0, 0, x, 0, 0])
    for written in (numbers(run(jn.equations(mechanism, format="sympy", order=1)), "residual", 0.0, q)[:, 0],
                    run(jn.equations(mechanism, order=1))["residual"](0.0, q)):  # fmt: skip
        assert written.tolist() == [-np.round(x)]


def test_forces_and_mass_matrix():
    mechanism = jn.load(example("double_pendulum"))
    code, plain = (
        run(jn.equations(mechanism, format=word, order=3, quantities=("forces", "constraints")))
        for word in ("sympy", "python")
    )
    random = np.random.default_rng(2)
    values = 0.0, random.normal(size=6), random.normal(size=(3, 6)), random.normal(size=(1, 4))
    found = numbers(code, "forces", *values)[..., 0]
    np.testing.assert_allclose(found, plain["forces"](*values), rtol=0, atol=1e-13)
    np.testing.assert_allclose(numbers(code, "mass_matrix", *values[:2]), plain["mass_matrix"](*values[:2]), atol=1e-14)


@pytest.mark.filterwarnings("ignore::jounce.errors.SampleWarning")
def test_tables_are_refused():
    law = jn.laws.SplineMotion(np.linspace(0, 2, 30), np.sin(3 * np.linspace(0, 2, 30)))
    crank = jn.planar.Revolute(("ground", "crank"), [0, 0], [0, 0])
    driver = jn.drivers.CoordinateDriver(("ground", "crank"), "angle", motion=law)
    parts = {"bodies": {"crank": jn.Body([0, 0])}, "joints": {"O": crank}, "drivers": {"it": driver}}
    with pytest.raises(MechanismError, match="it: reads a table of numbers, which SymPy"):
        jn.equations(jn.Mechanism(space="planar", **parts), format="sympy")
