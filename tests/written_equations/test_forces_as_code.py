"""Mass matrix, forces and outputs as code, against motions: nothing of them was computed by what is written."""

import dataclasses

import numpy as np
import pytest

import jounce as jn
from jounce.errors import MechanismError, UnsupportedError
from jounce.written_equations.models import mechanism_equations
from tests.contracts.test_frames import INSTANTS, MECHANISMS
from tests.problems.mechanisms import example
from tests.problems.own_types import taken_back
from tests.problems.written import coordinates, from_one, imbalances, run
from tests.written_equations.test_code import COMPILER, compiled

EVERYTHING = ("constraints", "forces", "outputs")


def bank(name):
    """Return a motion of a mechanism of the bank, which together have every joint, driver and force there is."""
    return jn.solve(dataclasses.replace(MECHANISMS[name](), redundant_reactions="least_norm"), INSTANTS, order=5)


FRICTION = tuple(
    name for name, make in MECHANISMS.items() if any(getattr(x, "friction", None) for x in make().joints.values())
)


@pytest.mark.slow
@pytest.mark.parametrize("name", [x for x in MECHANISMS if x not in FRICTION])
def test_every_joint_and_force_balances_what_moves(name, tmp_path):
    motion = bank(name)
    equations = jn.constraint_equations(motion)
    code = run(jn.equations(motion, order=5, quantities=("constraints", "forces")))
    assert imbalances(code, equations).max() < 1e-11
    if COMPILER:
        text = jn.equations(motion, format="c", order=5, quantities=("constraints", "forces"))
        call = compiled(text, tmp_path)
        q, v = coordinates(equations)[0], from_one(equations.velocities)[0]
        known = equations.multipliers.values[0][:2]
        expected = code["forces"](motion.time[0], q, v, known)
        found = call("forces", expected.shape, motion.time[0], q, v, known)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13 * np.abs(expected).max())
        mass = code["mass_matrix"](motion.time[0], q)
        np.testing.assert_allclose(call("mass_matrix", mass.shape, motion.time[0], q), mass, rtol=0, atol=1e-14)


@pytest.mark.parametrize("name", [x if x == "lines" else pytest.param(x, marks=pytest.mark.slow) for x in FRICTION])
def test_friction_is_refused_by_name(name, monkeypatch):
    """It follows from the multipliers of the same instant; the constraints do not depend on it."""
    mechanism = MECHANISMS[name]()
    with monkeypatch.context() as before_computing:
        before_computing.setattr(mechanism_equations, "model_of_equations", None)
        with pytest.raises(UnsupportedError, match=r"^joints\.\w+\.friction: forces as code of a mechanism whose"):
            jn.equations(mechanism, order=2, quantities=("constraints", "forces"))
    assert "def residual" in jn.equations(mechanism, order=1)


@pytest.mark.slow
def test_accelerations_and_multipliers_follow_from_one_matrix():
    """Of a double pendulum: those of a simulation, and their rates to order 2."""
    motion = jn.simulate(jn.load(example("double_pendulum")), [0.0, 0.3])
    equations = jn.constraint_equations(motion).isel(time=[1])
    code = run(jn.equations(motion, quantities=("constraints", "forces")))
    t, q = 0.3, coordinates(equations)[0]
    velocities, multipliers = from_one(equations.velocities)[0, :1], np.zeros((0, 4))
    jacobian = code["jacobian"](t, q)
    matrix = np.block([[code["mass_matrix"](t, q), jacobian.T], [jacobian, np.zeros((4, 4))]])
    for k in range(3):
        known = np.concatenate(
            [code["forces"](t, q, velocities, multipliers)[k], code["right_side"](t, q, velocities)[k + 1]]
        )
        solution = np.linalg.solve(matrix, known)
        velocities, multipliers = np.vstack([velocities, solution[:6]]), np.vstack([multipliers, solution[6:]])
    expected = from_one(equations.velocities)[0]
    np.testing.assert_allclose(velocities, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    np.testing.assert_allclose(multipliers, equations.multipliers.values[0, :3], rtol=0, atol=1e-10)


@pytest.mark.slow
def test_forces_of_ones_own():
    """A magnet between two free bodies, with a law of tables, against its closed form."""
    with taken_back():

        class Magnet(jn.forces.AbstractForce, space="planar"):
            strength: jn.joints.Scalar

            def displacement(self, body_i, body_j, time):
                d = body_j.position - body_i.position
                return jn.jet.sqrt(d.dot(d))

            def force(self, displacement, velocity, time):
                return self.strength / displacement**3

        bodies = {name: jn.Body([k, 0], mass=2.0 + k, inertia=0.3) for k, name in enumerate("ab")}
        mechanism = jn.Mechanism(space="planar", bodies=bodies, joints={}, forces={"m": Magnet(("a", "b"), 0.7)})
        code = run(jn.equations(mechanism, quantities="forces", order=3))
    q, v = np.array([0, 0, 0.1, 3, 4, 0.2]), np.array([[0.1, -0.2, 3, 1, 1.5, 5], np.zeros(6)])
    force, rate = 0.7 / 5**3, -3 * 0.7 / 5**4
    d, along = np.array([3, 4]) / 5, np.array([0.9, 1.7])
    speed = d @ along
    turned = (along - speed * d) / 5
    found = code["forces"](0.0, q, v, np.zeros((1, 0)))
    np.testing.assert_allclose(found[0], [*-force * d, 0, *force * d, 0], rtol=0, atol=1e-15)
    second = rate * speed * d + force * turned
    np.testing.assert_allclose(found[1], [*-second, 0, *second, 0], rtol=0, atol=1e-15)


@pytest.mark.parametrize("name", ["four_bar", pytest.param("rsur", marks=pytest.mark.slow)])
def test_outputs_are_those_of_motions(name):
    motion = jn.solve(jn.load(example(name)), [0.1, 0.2], order=4)
    equations = jn.constraint_equations(motion)
    code = run(jn.equations(motion, quantities="outputs"))
    q, v = coordinates(equations), from_one(equations.velocities)
    for k, t in enumerate(motion.time):
        found = code["outputs"](t, q[k], v[k])
        for label, values in zip(code["OUTPUTS"], found.T, strict=True):
            output, _, part = label.partition(".")
            expected = motion.outputs[output][k][: len(values)]
            expected = expected[:, "xyz".index(part)] if part else expected
            np.testing.assert_allclose(values, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


@pytest.mark.parametrize(
    "options, words",
    [
        ({"quantities": "weights"}, "constraints, forces"),
        ({"quantities": EVERYTHING, "joint": "BC"}, "is of the whole mechanism, got .forces.; leave out"),
        ({"quantities": "forces", "format": "latex"}, "is not written as LaTeX"),
        ({"quantities": "forces"}, "forces need masses, and no body has one"),
    ],
)
def test_what_is_not_written(options, words):
    with pytest.raises(MechanismError, match=words):
        jn.equations(jn.load(example("four_bar")), **options)


def test_orders_and_outputs_that_are_missing():
    pendulum = jn.load(example("double_pendulum"))
    with pytest.raises(MechanismError, match="order: must be 2 or more: forces give accelerations"):
        jn.equations(pendulum, quantities="forces", order=1)
    bare = dataclasses.replace(pendulum, outputs={})
    with pytest.raises(MechanismError, match="outputs: no output of this mechanism follows from places"):
        jn.equations(bare, quantities="outputs")
