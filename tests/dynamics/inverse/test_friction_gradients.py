"""Gradients through friction of every joint that has it, beside differences; families of mechanisms with friction."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce.kinematics import Status
from tests.dynamics.inverse.test_friction import vars_of, wedge

O2, O3, X, Y, Z = [0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]
TURNING = jn.joints.Friction("mu", "v", "r")
SLIDING = jn.joints.Friction("mu", "v")
VALUES = {"mu": 0.2, "v": 0.4, "r": 0.05, "m": 2.0, "c": 0.3}  # all change the force, the speeds are about v
LAW = "0.4 + 0.7*t + 0.5*t**2"


def planar(joints, driver, **parts):
    body = jn.Body([0, 0], angle=0.4, mass="m", inertia=0.1, center_of_mass=["c", 0])
    return jn.Mechanism(
        space="planar", gravity=[0, -10.0], parameters=VALUES, bodies={"b": body}, joints=joints,
        drivers={"d": driver}, **parts,
    )  # fmt: skip


def spatial(joints, drivers):
    body = jn.Body(O3, mass="m", inertia=[0.1, 0.12, 0.14], center_of_mass=["c", 0, 0])
    return jn.Mechanism(
        space="spatial", gravity=[0, -3.0, -10.0], parameters=VALUES, bodies={"b": body}, joints=joints, drivers=drivers
    )


def slot():
    """A wedge whose lift slides in a slot of it."""
    parts = wedge(0.2)
    joints = dict(parts.joints)
    joints["slope"] = jn.planar.Parallel2(("wedge", "lift"), [0, 0], [0, 0], [1, "c"], friction=SLIDING)
    joints["guide"] = jn.planar.Prismatic(("ground", "lift"), [0, 0], [0, 0], [0, 1], [0, 1])
    bodies = {**parts.bodies, "lift": jn.Body([0, 0], mass="m")}
    driver = jn.drivers.CoordinateDriver(("ground", "wedge"), "x", motion="-0.3*t - 0.1*t**2")
    changed = {"bodies": bodies, "drivers": {"d": driver}, "outputs": {}}
    return jn.Mechanism(**vars_of(parts) | changed, joints=joints, parameters=VALUES)


def mechanisms():
    two = ("ground", "b")
    turn, roll = jn.drivers.RotationDriver(two, Y, LAW), jn.drivers.RotationDriver(two, X, "0.3*t + 0.4*t**2")
    slide = jn.drivers.SpatialSlideDriver(two, O3, O3, X, "0.2*t + 0.3*t**2")
    level = {"level": jn.spatial.Dot1(two, Y, X), "square": jn.spatial.Dot1(two, Y, Z)}
    nut = jn.spatial.Screw(two, O3, O3, Z, Z, 0.02, friction=TURNING)
    return {
        "planar revolute": planar(
            {"j": jn.planar.Revolute(two, O2, O2, friction=TURNING)}, jn.drivers.CoordinateDriver(two, "angle", LAW)
        ),
        "planar prismatic": planar(
            {"j": jn.planar.Prismatic(two, O2, O2, [1, "c"], [1, 0], friction=SLIDING)},
            jn.drivers.SlideDriver(two, O2, O2, [1, "c"], LAW),
        ),
        "parallel2": slot(),
        "revolute": spatial({"j": jn.spatial.Revolute(two, O3, O3, Y, Y, friction=TURNING)}, {"d": turn}),
        "spherical": spatial({"j": jn.spatial.Spherical(two, O3, O3, friction=TURNING), **level}, {"d": turn}),
        "cylindrical": spatial(
            {"j": jn.spatial.Cylindrical(two, O3, O3, X, X, friction=TURNING)}, {"d": slide, "e": roll}
        ),
        "prismatic": spatial({"j": jn.spatial.Prismatic(two, O3, O3, X, X, Y, Y, friction=SLIDING)}, {"d": slide}),
        "planar": spatial(
            {"j": jn.spatial.PlaneOnPlane(two, O3, O3, Z, Z, friction=SLIDING)},
            {
                "d": slide,
                "e": jn.drivers.SpatialSlideDriver(two, O3, O3, Y, "0.1*t"),
                "f": jn.drivers.RotationDriver(two, Z, LAW),
            },
        ),
        "screw": spatial({"j": nut}, {"d": jn.drivers.RotationDriver(two, Z, "3*t + t**2")}),
    }


@pytest.mark.slow
@pytest.mark.parametrize("kind", mechanisms())
def test_forces_of_drivers_with_rates_beside_differences(kind):
    mechanism = mechanisms()[kind]
    names = [name for name in VALUES if name in str(mechanism.joints) or name in "mc"]

    def forces(values):
        changed = mechanism.with_parameters(**dict(zip(names, values, strict=True)))
        motion = jn.solve(changed, [0.3], order=3 if mechanism.space == "planar" else 2)
        return jnp.concatenate([jn.driver_force(motion, name).data[0] for name in mechanism.drivers])

    values = np.array([VALUES[name] for name in names])
    found = np.asarray(jax.jacobian(forces)(values))
    for k in range(len(values)):
        step = np.eye(len(values))[k] * 1e-4 * values[k]
        far, near = (np.asarray(forces(values + n * step) - forces(values - n * step)) for n in (2, 1))
        difference = (8 * near - far) / (12 * step[k])
        np.testing.assert_allclose(found[:, k], difference, rtol=1e-7, atol=1e-7 * np.abs(difference).max() + 1e-9)
    assert np.abs(found[:, names.index("mu")]).max() > 1e-3


@pytest.mark.slow
def test_a_family_has_the_friction_of_each_design():
    parts = wedge(0.2)
    guide = jn.planar.Prismatic(
        ("ground", "lift"), [0, 0], [0, 0], [0, 1], [0, 1], friction=jn.joints.Friction("mu", 1e-3)
    )
    family = jn.Mechanism(**vars_of(parts), joints={**parts.joints, "guide": guide}, parameters={"mu": 0.2})
    found = jn.solve_batch(family, {"mu": [0.2, 1.0, 1.9]}, [0.0, 1.0], order=2)["force"]
    for k, mu in enumerate((0.2, 1.0, 1.9)):
        push = -(0.2 + 0.5 * 30.3 / (1 - 0.5 * mu))
        np.testing.assert_allclose(found[k], [[push, 0, 0]] * 2, rtol=1e-12, atol=1e-12)
    locked = jn.solve_batch(family, {"mu": [1.0, 2.5]}, [0.0, 1.0], order=2)
    np.testing.assert_array_equal(locked["status"], [[Status.OK] * 2, [Status.LOCKED] * 2])
    np.testing.assert_array_equal(np.isnan(locked["force"]).all(axis=2), [[False] * 2, [True] * 2])
    with pytest.raises(jn.errors.SolveError, match=r"joints\.guide\.friction: friction locks at t = 0 s"):
        _ = jn.solve(family.with_parameters(mu=2.5), [0.0, 1.0], order=2).outputs["force"]
