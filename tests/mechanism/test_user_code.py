"""Elements of users whose methods decide by words: any word, also one that NumPy takes for a type of numbers."""

import numpy as np
import pytest

import jounce as jn

TIME = np.linspace(0.0, 1.0, 5)
OFFSETS = {"low": 0.25}  # of the module, read at each call


class Shelf(jn.joints.AbstractConstraint, space="planar"):
    """A height that depends on a word."""

    height: jn.joints.Scalar
    side: str = "d"

    def residual(self, body_i, body_j, time):
        sign = {"d": -1.0, "f": 1.0, "int": 2.0, "left": 3.0}[self.side]
        return body_j.position[1] - sign * (self.height + OFFSETS["low"])


class Push(jn.forces.AbstractForce, space="planar"):
    """A force along x that depends on a word."""

    size: jn.joints.Scalar
    sense: str

    def displacement(self, body_i, body_j, time):
        return body_j.position[0] - body_i.position[0]

    def force(self, displacement, velocity, time):
        return self.size * time if self.sense == "b" else -self.size * time


def held(joint, **forces):
    return jn.Mechanism(
        space="planar",
        gravity=[0.0, 0.0],
        bodies={"a": jn.Body([0.0, 0.5], mass=1.0, inertia=0.1)},
        joints={"shelf": joint},
        drivers={
            "x": jn.drivers.CoordinateDriver(("ground", "a"), "x", 0.0),
            "turn": jn.drivers.CoordinateDriver(("ground", "a"), "angle", "t"),
        },
        forces=forces,
        outputs={"place": jn.outputs.PointOutput("a", [0.0, 0.0])},
    )


@pytest.mark.parametrize("side, sign", [("d", -1.0), ("f", 1.0), ("int", 2.0), ("left", 3.0)])
def test_a_joint_decides_by_a_word(side, sign, monkeypatch):
    for offset in (0.25, 0.75):
        monkeypatch.setitem(OFFSETS, "low", offset)
        motion = jn.solve(held(Shelf(("ground", "a"), 0.5, side)), TIME, order=2)
        np.testing.assert_allclose(motion.dataset["place"].values[:, 0, 1], sign * (0.5 + offset), rtol=1e-14)


@pytest.mark.parametrize("sense, sign", [("b", 1.0), ("away", -1.0)])
def test_a_force_decides_by_a_word(sense, sign):
    mechanism = held(Shelf(("ground", "a"), 0.5), push=Push(("ground", "a"), 3.0, sense))
    force = jn.driver_force(jn.solve(mechanism, TIME, order=3), "x")
    np.testing.assert_allclose(force.values[:, 0], -sign * 3.0 * TIME, rtol=0, atol=1e-13)
    np.testing.assert_allclose(force.values[:, 1], -sign * 3.0, rtol=1e-13)


class Listed(jn.joints.AbstractConstraint, space="planar"):
    """Equations in a list, which is no jet."""

    def residual(self, body_i, body_j, time):
        return [body_j.position[0], body_j.position[1]]


class Steady(Push, space="planar"):
    """A constant, which is no jet."""

    def force(self, displacement, velocity, time):
        return self.size


class Twice(Push, space="planar"):
    """Two forces on one displacement."""

    def force(self, displacement, velocity, time):
        return jn.joints.rows(displacement, velocity)


def test_a_residual_that_is_no_jet_is_named():
    words = r"joints\.shelf: the residual of Listed must return a jet, .* jn\.joints\.rows\(first, second\), not a list"
    with pytest.raises(jn.errors.MechanismError, match=words):
        jn.solve(held(Listed(("ground", "a"))), TIME)


class Numeric(jn.joints.AbstractConstraint, space="planar"):
    """A function of NumPy, which takes no jets."""

    def residual(self, body_i, body_j, time):
        del body_i, time
        return np.sqrt(body_j.angle)


class Deciding(jn.joints.AbstractConstraint, space="planar"):
    """A residual that decides by the position of its bodies."""

    def residual(self, body_i, body_j, time):
        del body_i, time
        return body_j.angle if body_j.angle.coefficients[0] > 0 else body_j.position[0]


@pytest.mark.parametrize("kind", [Numeric, Deciding])
def test_a_residual_that_cannot_be_evaluated_on_jets_is_named(kind):
    words = (
        rf"joints\.shelf: the residual of {kind.__name__} cannot be evaluated \(.*operators and functions of jounce.jet"
    )
    with pytest.raises(jn.errors.MechanismError, match=words) as caught:
        jn.solve(held(kind(("ground", "a"))), TIME)
    assert caught.value.__cause__ is not None


@pytest.mark.parametrize("kind", [Steady, Twice])
def test_a_force_that_is_no_jet_of_the_shape_of_its_displacement_is_named(kind):
    mechanism = held(Shelf(("ground", "a"), 0.5), push=kind(("ground", "a"), 3.0, "b"))
    words = rf"forces\.push: the force of {kind.__name__} must return a jet of the shape of its displacement"
    with pytest.raises(jn.errors.MechanismError, match=words):
        jn.driver_force(jn.solve(mechanism, TIME, order=3), "x")


class Between(jn.joints.AbstractConstraint, space="planar"):
    """A residual of three bodies, in a class that does not say so."""

    def residual(self, body_i, body_j, body_m, time):
        return body_i.angle + body_j.angle - 2 * body_m.angle


def test_a_residual_of_another_number_of_bodies_than_its_class_says_is_named():
    words = r"joints\.shelf: the residual of Between must take the poses of 2 bodies .* states body_count"
    with pytest.raises(jn.errors.MechanismError, match=words):
        jn.solve(held(Between(("ground", "a"))), TIME)
    with pytest.raises(jn.errors.MechanismError, match="Between joins 2 bodies, as its class says by body_count"):
        Between(("ground", "a", "b"))
