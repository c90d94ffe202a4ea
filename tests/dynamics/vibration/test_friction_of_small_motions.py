"""Small motions of joints with friction, which is viscous at rest: closed forms, frames, and what is refused."""

import dataclasses

import numpy as np
import pytest

import jounce as jn


def sled(turned=0.0, mu=0.3):
    """Return a sled of 2 kg on a spring, in a guide on a slope; everything is turned in the plane."""
    up = 0.4 + turned
    along = [np.cos(up), np.sin(up)]
    return jn.Mechanism(
        space="planar",
        gravity=[10 * np.sin(turned), -10 * np.cos(turned)],
        bodies={"sled": jn.Body([0, 0], angle=up, mass=2.0)},
        joints={
            "guide": jn.planar.Prismatic(
                ("ground", "sled"), [0, 0], [0, 0], along, [1, 0], friction=jn.joints.Friction(mu, 0.5)
            )
        },
        forces={"spring": jn.forces.SlideSpring(("ground", "sled"), [0, 0], [0, 0], along, 50.0, 0.0)},
    )


@pytest.mark.parametrize("turned", [0.0, 2.0])
def test_a_sled_swings_with_the_friction_of_its_guide_over_the_speed(turned):
    rest = jn.equilibrium(sled(turned))
    small = jn.linearize(rest)
    damping = 0.3 * 20 * np.cos(0.4) / 0.5
    np.testing.assert_allclose(small.damping / small.mass, damping / 2.0, rtol=1e-12)
    np.testing.assert_allclose(small.stiffness / small.mass, 25.0, rtol=1e-12)
    root = max(np.roots([2.0, damping, 50.0]), key=np.imag)
    np.testing.assert_allclose(small.modes.eigenvalues, [root], rtol=1e-11)
    assert rest.cautions[0].startswith("friction of joints.guide does not stick")
    assert not np.any(jn.linearize(sled(turned, mu=0.0)).damping)


@pytest.mark.slow
def test_what_a_sled_does_in_small_motions_a_simulation_does():
    """From a tenth of a thousandth of the speed of friction: the first half swing, by its closed form."""
    free = dataclasses.replace(sled(), initial={"go": jn.drivers.SlideDriver(
        ("ground", "sled"), [0, 0], [0, 0], [np.cos(0.4), np.sin(0.4)], "rest + 1e-5*t"
    )}, parameters={"rest": -20 * np.sin(0.4) / 50})  # fmt: skip
    found = jn.simulate(free, np.linspace(0.0, 0.4, 5))
    decay = 0.3 * 20 * np.cos(0.4) / 0.5 / 4.0
    swing = np.sqrt(25.0 - decay**2)
    place = np.einsum("tc,c->t", found.point("sled", [0, 0]).values[:, 0], [np.cos(0.4), np.sin(0.4)])
    expected = 1e-5 * np.exp(-decay * found.time) * np.sin(swing * found.time) / swing
    np.testing.assert_allclose(place + 20 * np.sin(0.4) / 50, expected, atol=1e-14, rtol=1e-5)


@pytest.mark.slow
def test_a_pendulum_has_the_moment_of_its_pin():
    pin = jn.joints.Friction(0.2, 0.05, radius=0.01)
    pendulum = jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        bodies={"rod": jn.Body([0, 0], angle=-1.0, mass=3.0, inertia=0.02, center_of_mass=[0.4, 0])},
        joints={"O": jn.planar.Revolute(("ground", "rod"), [0, 0], [0, 0], friction=pin)},
    )
    small = jn.linearize(pendulum)
    inertia = 0.02 + 3.0 * 0.4**2
    np.testing.assert_allclose(small.damping / small.mass, 0.2 * 0.01**2 * 3.0 * 9.81 / 0.05 / inertia, rtol=1e-12)
    np.testing.assert_allclose(small.stiffness / small.mass, 3.0 * 9.81 * 0.4 / inertia, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("load", [6.0, -6.0])
def test_gears_resist_by_the_mean_of_what_they_lose_forward_and_backward(load):
    """A load on the wheel is held by a spring on the pinion: T is a third of it."""
    loss = jn.joints.GearFriction(speed=2.0, efficiency=0.8, backward=0.7)
    bodies = {"pinion": jn.Body([0, 0], inertia=0.01, mass=1.0), "wheel": jn.Body([0.4, 0], inertia=0.3, mass=1.0)}
    gears = jn.Mechanism(
        space="planar",
        bodies=bodies,
        joints={
            "A": jn.planar.Revolute(("ground", "pinion"), [0, 0], [0, 0]),
            "B": jn.planar.Revolute(("ground", "wheel"), [0.4, 0], [0, 0]),
            "mesh": jn.planar.Gear(
                ("pinion", "wheel"), point_i=[0, 0], point_j=[0, 0], radius_i=0.1, radius_j=0.3, friction=loss
            ),
        },
        forces={
            "spring": jn.forces.TorsionalSpring(("ground", "pinion"), 40.0, 0.0),
            "load": jn.forces.Moment("wheel", f"{load}"),
        },
    )
    small = jn.linearize(gears, coordinates=["pinion.angle"])
    resistance = 0.5 * (1 / 0.8 - 1 + 1 - 0.7) * abs(load) / 3 / 2.0
    np.testing.assert_allclose(small.damping, resistance, rtol=1e-11)
    np.testing.assert_allclose(small.mass, 0.01 + 0.3 / 9, rtol=1e-12)
    np.testing.assert_allclose(small.stiffness, 40.0, rtol=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("load", [12.0, -7.0])
def test_teeth_press_pins_that_resist(load):
    """Both pins bear the tooth force: a third of the load at 0.1 m, over the cosine of the pressure angle."""
    pin = jn.joints.Friction(coefficient=0.3, radius=0.02, speed=0.4)
    gears = jn.Mechanism(
        space="planar",
        gravity=[0, 0],
        bodies={"pinion": jn.Body([0, 0], inertia=0.01, mass=1.0), "wheel": jn.Body([0.4, 0], inertia=0.3, mass=1.0)},
        joints={
            "A": jn.planar.Revolute(("ground", "pinion"), [0, 0], [0, 0], friction=pin),
            "B": jn.planar.Revolute(("ground", "wheel"), [0.4, 0], [0, 0], friction=pin),
            "mesh": jn.planar.Gear(("pinion", "wheel"), None, None, [0, 0], [0, 0], 0.1, 0.3, pressure_angle=0.5),
        },
        forces={
            "spring": jn.forces.TorsionalSpring(("ground", "pinion"), 40.0, 0.0),
            "load": jn.forces.Moment("wheel", f"{load}"),
        },
    )
    small = jn.linearize(gears, coordinates=["pinion.angle"])
    bearing = abs(load) / 0.3 / np.cos(0.5)
    np.testing.assert_allclose(small.damping, 0.3 * bearing * 0.02**2 / 0.4 * (1 + 1 / 9), rtol=1e-11)
    np.testing.assert_allclose(small.stiffness, 40.0, rtol=1e-10)


@pytest.mark.slow
def test_small_motions_about_a_motion_are_refused_by_name():
    driver = jn.drivers.SlideDriver(("ground", "sled"), [0, 0], [0, 0], [np.cos(0.4), np.sin(0.4)], "0.3*t")
    motion = jn.simulate(dataclasses.replace(sled(), initial={"go": driver}), [0.0])
    with pytest.raises(jn.errors.UnsupportedError, match=r"joints\.guide\.friction: small motions about a motion"):
        jn.linearize(motion, 0.0)
