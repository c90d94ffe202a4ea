"""The forms of the equations of motion of a driven mechanism, in the coordinates of its drivers."""

import dataclasses
import functools

import numpy as np
import pytest

import jounce as jn
from jounce.dynamics import (
    gibbs_appell,
    gravity_forces,
    higher_order,
    lagrange,
    mangeron_nielsen,
    newton_euler,
    virtual_work,
)

TIMES = np.array([0.1, 0.7])
PIN = ("ground", "arm")


def arm_on_a_sled(push="0.3 + 0.2*t**2", turn="0.5*t + 0.1*t**3"):
    """Return a sled with an arm on it, both driven; nothing weighs."""
    return jn.Mechanism(
        space="planar",
        bodies={
            "sled": jn.Body([0, 0], mass=2.0, inertia=0.1),
            "arm": jn.Body([0, 0], mass=0.7, inertia=0.05, center_of_mass=[0.4, 0.1]),
        },
        joints={
            "rail": jn.planar.Prismatic(("ground", "sled"), [0, 0], [0, 0], [1, 0], [1, 0]),
            "pin": jn.planar.Revolute(("sled", "arm"), [0, 0], [0, 0]),
        },
        drivers={
            "push": jn.drivers.SlideDriver(("ground", "sled"), [0, 0], [0, 0], [1, 0], push),
            "turn": jn.drivers.CoordinateDriver(("sled", "arm"), "angle", motion=turn),
        },
    )


@functools.cache
def sled():
    return jn.solve(arm_on_a_sled(), TIMES, order=3)


def robot():
    """Return the same in joint coordinates."""
    load = jn.Inertia(0.7, [0.4, 0.1, 0.0], [0.03, 0.03, 0.05])
    links = [jn.Link("base"), jn.Link("sled", jn.Inertia(2.0)), jn.Link("arm", load)]
    joints = [jn.Joint("push", "base", "sled", "prismatic", axis=[1, 0, 0]), jn.Joint("turn", "sled", "arm")]
    return jn.Robot("sled", links, joints, gravity=[0, 0, 0])


def laws():
    t = TIMES
    push = [0.3 + 0.2 * t**2, 0.4 * t, 0.4 + 0 * t, 0 * t, 0 * t, 0 * t]
    turn = [0.5 * t + 0.1 * t**3, 0.5 + 0.3 * t**2, 0.6 * t, 0.6 + 0 * t, 0 * t, 0 * t]
    return np.moveaxis(np.array([push, turn]), (0, 1, 2), (2, 1, 0))


FORMS = {  # the others, and their rates, are judged with the closed loop
    "lagrange": lambda system, *q: lagrange(system, *q),
    "mangeron": lambda system, *q: mangeron_nielsen(system, *q),
    "energy_slope": lambda system, *q: jn.energy.energy_slope(system, *q, m=1, order=2),
}


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
def test_an_open_chain_agrees_with_the_robot(form):
    found, right = FORMS[form](sled()), FORMS[form](robot(), laws())
    assert found.coords["driver"].values.tolist() == ["push", "turn"]
    over = {"energy_slope": "/s^3"}.get(form, "")  # dE_2/dq': J/s^4 by m/s or rad/s
    assert found.coords["unit"].values.tolist() == [f"N{over}", f"N*m{over}"]
    np.testing.assert_allclose(found.values, right, rtol=0, atol=1e-12 * np.abs(right).max())


def four_bar():
    """Return the linkage of Sommer's first problem with masses that weigh nothing."""
    return jn.Mechanism(
        space="planar",
        bodies={
            "crank": jn.Body([0, 0], angle=0.5, mass=0.4, inertia=0.02, center_of_mass=[0.02, 0.01]),
            "rocker": jn.Body([0.1321, 0], angle=1.7, mass=1.5, inertia=0.09, center_of_mass=[0.1, -0.02]),
        },
        joints={
            "A": jn.planar.Revolute(("ground", "crank"), [0, 0], [0, 0]),
            "D": jn.planar.Revolute(("ground", "rocker"), [0.1321, 0], [0, 0]),
            "BC": jn.planar.DoubleRevolute(("crank", "rocker"), [0.04, 0], [0.2031, 0], 0.1423),
        },
        drivers={"theta": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", motion="0.6 + sin(3*t)")},
    )


@pytest.mark.slow
def test_a_closed_loop_agrees_with_the_force_of_its_driver():
    motion = jn.solve(four_bar(), TIMES, order=3)
    force = jn.driver_force(motion, "theta").values[:, :1]  # by multipliers
    bound = 1e-12 * np.abs(force).max()
    assert (np.abs(lagrange(motion)[..., 0] - force) <= bound).all()
    assert (np.abs(gibbs_appell(motion)[..., 0] - force) <= bound).all()
    assert (np.abs(higher_order(motion, k=1) - force) <= 10 * bound).all()


@pytest.mark.slow
def test_a_loop_in_space_agrees_with_the_force_of_its_driver():
    from tests.dynamics.energy.test_energies import with_masses

    masses = {"coupler": {"mass": 0.8, "inertia": [0.02, 0.03, 0.04], "center_of_mass": [0.02, 0.05, 0.01]}}
    masses["rocker"] = {"mass": 0.6, "inertia": 0.03, "center_of_mass": [0.05, 0.0, 0.01]}
    motion = jn.solve(with_masses("rsur", masses), TIMES, order=2)
    (name,) = motion.mechanism.drivers
    force = jn.driver_force(motion, name).values
    scale = np.abs(force).max(axis=0)
    assert (np.abs(lagrange(motion)[..., 0] - force[:, :1]) <= 1e-11 * scale[:1]).all()


@pytest.mark.slow
def test_balances_of_a_closed_loop():
    mechanism = dataclasses.replace(
        four_bar(),
        gravity=[0, -9.81],
        forces={"spring": jn.forces.Spring(("ground", "rocker"), [0, 0], [0.1, 0], stiffness=50.0, length=0.1)},
    )
    heavy, light = jn.solve(mechanism, TIMES, order=4), jn.solve(four_bar(), TIMES, order=4)
    inertia = jn.driver_force(light, "theta").values
    scale = np.abs(jn.driver_force(heavy, "theta").values).max(axis=0)
    for function in (newton_euler, virtual_work):
        assert (np.abs(function(heavy, rates=2)[..., 0] - inertia) <= 1e-12 * scale).all()
    weight = gravity_forces(heavy, rates=2)[..., 0]
    power = jn.energy.potential_energy(heavy)[:, 1]  # gravity takes what the driver gives to lift
    np.testing.assert_allclose(weight[:, 0] * 3 * np.cos(3 * TIMES), power, rtol=0, atol=1e-12)
    with pytest.raises(jn.errors.MechanismError, match="order 5"):
        newton_euler(heavy, rates=3)


@pytest.mark.slow
def test_numbers_are_refused_as_those_of_a_mechanism():
    for call in (
        lambda: jn.energy.acceleration_energy(sled(), order=-1),
        lambda: jn.energy.energy_terms(sled(), order=99),
        lambda: jn.energy.energy_slope(sled(), m=-1),
        lambda: lagrange(sled(), rates=-1),
        lambda: newton_euler(sled(), rates=-1),
    ):
        with pytest.raises(jn.errors.MechanismError, match="whole number"):
            call()


@pytest.mark.slow
def test_what_is_refused():
    for form in (lagrange, newton_euler, virtual_work, gravity_forces):
        with pytest.raises(jn.errors.MechanismError, match="coordinates already"):
            form(sled(), np.zeros((3, 2)))
    with pytest.raises(jn.errors.RobotError, match="q"):
        lagrange(robot())
