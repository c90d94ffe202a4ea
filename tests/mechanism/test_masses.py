"""Masses of bodies and initial conditions: read in numbers, checked, with the place named."""

import dataclasses

import jax
import numpy as np
import pytest

import jounce as jn
from jounce import planar
from jounce.mechanism import build
from jounce.mechanism.masses import body_mass
from tests.problems.small import crank

ROD = jn.Inertia.solid("rod", length=0.6, mass=2.0, axis="x", center_of_mass=[0.3, 0.1, 0])


def test_an_inertia_gives_mass_and_center_of_mass_too():
    plane, space = jn.Body([0, 0], inertia=ROD), jn.Body([0, 0, 0], inertia=ROD)
    assert (plane.mass, plane.inertia, plane.center_of_mass.tolist()) == (2.0, 0.06, [0.3, 0.1])
    mass, center, tensor = body_mass("a", space, {}, 3)
    assert (mass, center.tolist()) == (2.0, [0.3, 0.1, 0])
    np.testing.assert_allclose(tensor, np.diag([0, 0.06, 0.06]), rtol=1e-15)
    moved = dataclasses.replace(plane, angle=1.0)
    assert (moved.mass, moved.inertia) == (2.0, 0.06)
    for given in ({"mass": 1.0}, {"center_of_mass": [0, 0]}):
        with pytest.raises(jn.errors.MechanismError, match="inertia: an Inertia contains the mass"):
            jn.Body([0, 0], inertia=ROD, **given)


def test_values_by_expressions():
    body = jn.Body([0, 0, 0], mass="m", inertia=["m*r**2/2", "J", "J"], center_of_mass=[0, "r", 0])
    mass, center, tensor = body_mass("a", body, {"m": 2.0, "r": 3.0, "J": 7.0}, 3)
    assert (mass, center.tolist(), tensor.diagonal().tolist()) == (2.0, [0, 3, 0], [9, 7, 7])
    rows = jn.Body([0, 0, 0], mass=1, inertia=[["J", "p", 0], ["p", "J", 0], [0, 0, "J"]])
    _, _, tensor = body_mass("a", rows, {"J": 7.0, "p": -0.5}, 3)
    np.testing.assert_array_equal(tensor, [[7, -0.5, 0], [-0.5, 7, 0], [0, 0, 7]])


def test_what_is_not_given_is_zero():
    for components, shape in ((2, ()), (3, (3, 3))):
        mass, center, inertia = body_mass("a", jn.Body([0.0] * components), {}, components)
        assert mass == 0
        assert center.tolist() == [0.0] * components
        assert np.shape(inertia) == shape
        assert not np.any(inertia)


def test_a_traced_mass_passes():
    found = jax.jit(lambda m: body_mass("a", jn.Body([0, 0], mass="m", inertia="m/2"), {"m": m}, 2)[2])(3.0)
    assert float(found) == 1.5


@pytest.mark.parametrize(
    "given, message",
    [
        ({"mass": -1.0}, r"bodies\.a\.mass: must not be negative, got -1\.0"),
        ({"mass": np.nan}, r"bodies\.a\.mass: must be finite"),
        ({"mass": [1.0]}, r"bodies\.a\.mass: must be one number"),
        ({"mass": "n"}, r"bodies\.a\.mass: unknown name 'n'"),
        ({"inertia": [1, 2]}, r"bodies\.a\.inertia: must be a vector of 3 numbers, got \[1\.0, 2\.0\]"),
        ({"inertia": 1.0}, r"bodies\.a\.inertia: must be a vector of 3 numbers, got 1\.0"),
        ({"inertia": [1, 1, np.inf]}, r"bodies\.a\.inertia: must be finite"),
        ({"inertia": [-1, 1, 1]}, r"bodies\.a\.inertia: has a negative principal moment"),
        ({"inertia": [1, 1, 3]}, r"bodies\.a\.inertia: breaks the triangle inequality"),
        ({"inertia": [[1, 2, 0], [0, 1, 0], [0, 0, 1]]}, r"bodies\.a\.inertia: must be symmetric"),
        ({"center_of_mass": [0, 0]}, r"bodies\.a\.center_of_mass: must be a vector of 3 numbers"),
    ],
)
def test_what_no_body_has(given, message):
    with pytest.raises(jn.JounceError, match=message):
        body_mass("a", jn.Body([0, 0, 0], **given), {}, 3)


def test_no_negative_moment_in_the_plane():
    with pytest.raises(jn.errors.MechanismError, match=r"bodies\.a\.inertia: .*negative, got -2\.0"):
        body_mass("a", jn.Body([0, 0], inertia=-2.0), {}, 2)


START = jn.drivers.CoordinateDriver(("ground", "crank"), "angle", "1 + 2*t")
PIN = planar.Revolute(("ground", "crank"), [0, 0], [0, 0])


def with_initial(**initial):
    return dataclasses.replace(crank("t"), initial=initial)


def test_initial_conditions_do_not_bear_on_prescribed_motion():
    plain, given = crank("t"), with_initial(start=START)
    assert given.elements["initial"] == {"start": START}
    assert build(given).rows == build(plain).rows
    np.testing.assert_array_equal(
        jn.solve(given, [0.0, 1.0]).outputs["angle"], jn.solve(plain, [0.0, 1.0]).outputs["angle"]
    )


@pytest.mark.parametrize(
    "initial, message",
    [
        ({"start": PIN}, r"initial\.start: an initial condition is given by a driver, got 'revolute'"),
        (dict.fromkeys(crank("t").drivers, START), r"initial\..*: a driver and an initial condition have the same"),
        (dict.fromkeys(crank("t").joints, START), r"initial\..*: a joint and an initial condition have the same"),
        (
            {"start": jn.drivers.CoordinateDriver(("ground", "crunk"), "angle", "t")},
            r"initial\.start\.bodies: no body has this name, got 'crunk'; did you mean 'crank'",
        ),
    ],
    ids=["joint", "driver", "name", "body"],
)
def test_what_no_initial_condition_is(initial, message):
    with pytest.raises(jn.errors.MechanismError, match=message):
        with_initial(**initial)


@pytest.mark.slow
def test_forces_do_not_bear_on_prescribed_motion_and_joint_names_may_be_used_again():
    brake = jn.forces.Torque(("ground", "crank"), "-v")
    given = dataclasses.replace(crank("t"), forces=dict.fromkeys(crank("t").joints, brake))
    assert build(given).forces == (tuple(crank("t").joints),)
    np.testing.assert_array_equal(
        jn.solve(given, [0.0, 1.0]).outputs["angle"], jn.solve(crank("t"), [0.0, 1.0]).outputs["angle"]
    )
