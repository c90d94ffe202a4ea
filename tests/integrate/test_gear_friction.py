"""Friction of gears that follows the torque they pass on, in simulations: closed forms."""

import numpy as np
import pytest

import jounce as jn

TIME = np.linspace(0.0, 2.0, 5)


def pair(efficiency=0.9, backward=0.8, *, speed=1e-3, torque="0", load="0", begun=2.0, inertia=4.0):
    """Two gears that turn freely; what is behind the second counts a quarter at the first, and half of its load."""
    friction = jn.joints.GearFriction(speed, efficiency, backward)
    places = {"first": [0.0, 0.0], "second": [0.3, 0.0]}
    return jn.Mechanism(
        space="planar",
        parameters={"push": 1.0},
        bodies={
            "first": jn.Body(places["first"], mass=1.0, inertia=1.0),
            "second": jn.Body(places["second"], mass=1.0, inertia=inertia),
        },
        joints={
            **{name: jn.planar.Revolute(("ground", name), place, [0, 0]) for name, place in places.items()},
            "mesh": jn.planar.Gear(
                ("first", "second"), point_i=[0, 0], point_j=[0, 0], radius_i=0.1, radius_j=0.2, friction=friction
            ),
        },
        forces={
            "motor": jn.forces.Torque(("ground", "first"), torque),
            "load": jn.forces.Torque(("ground", "second"), load),
        },
        initial={"turn": jn.drivers.CoordinateDriver(("ground", "first"), "angle", f"{begun}*t")},
        outputs={"first": jn.outputs.AngleOutput("first")},
    )


def wheels_on_and_off(t, push=1.0):
    """Speed where a motor of ``push cos(3t)`` speeds up a wheel behind the gears, and is sped up by it."""
    found, begun = 2.0, 0.0
    for k, end in enumerate([np.pi / 6, np.pi / 2, 5 * np.pi / 6]):
        inertia = 1.0 + (0.8 if k % 2 else 1.0 / 0.9)
        until = min(t, end)
        found += push * (np.sin(3 * until) - np.sin(3 * begun)) / 3 / inertia
        begun = until
    return found


@pytest.mark.slow
def test_a_load_that_reverses_is_passed_on_by_either_efficiency():
    simulated = jn.simulate(pair(torque="push*cos(3*t)"), TIME)
    expected = [wheels_on_and_off(t) for t in TIME]
    np.testing.assert_allclose(simulated.outputs["first"][:, 1], expected, rtol=0, atol=1e-11)
    assert len(simulated.dense_output.start) < 60  # kinks, where the load reverses, are no obstacle


@pytest.mark.slow
def test_a_batch_has_the_speeds_of_its_motors():
    found = jn.simulate_batch(pair(torque="push*cos(3*t)"), {"push": [0.5, 1.0]}, TIME)
    for k, push in enumerate((0.5, 1.0)):
        expected = [wheels_on_and_off(t, push) for t in TIME]
        np.testing.assert_allclose(found.outputs["first"][k, :, 1], expected, rtol=0, atol=1e-11)


@pytest.mark.slow
def test_gears_that_lock_themselves_hold_a_load_but_for_a_creep():
    onward, back = 1 / 0.5 - 1, 1.3
    simulated = jn.simulate(pair(0.5, -0.3, speed=0.05, load="3", begun=0.0), TIME)
    # what friction of this speed takes is all that the load passes on: c_mean x + (c_back - c_onward) / 2 x^2 = 1
    a, b = (back - onward) / 2, (back + onward) / 2
    creep = 0.05 * np.arctanh((np.sqrt(b * b + 4 * a) - b) / (2 * a))
    assert simulated.outputs["first"][-1, 1] == pytest.approx(-creep, rel=1e-9)


@pytest.mark.slow
def test_gears_that_lock_themselves_slow_down_under_the_load_that_pushes_them():
    # (J + I) a = load - back |p| and J a = load - |p| at the first gear, of I = 1
    def found(inertia):
        simulated = jn.simulate(pair(0.5, -0.3, load="-3", inertia=inertia), TIME[:2])
        return simulated.outputs["first"][-1, 2]

    passed = 1.5 / (1 - 0.3)
    assert found(4.0) == pytest.approx(1.5 - passed, rel=1e-9)


@pytest.mark.slow
def test_gears_that_jam_with_what_is_behind_them_are_reported_with_the_instant():
    with pytest.raises(jn.errors.SolveError, match=r"friction locks at t = 0 s: joints\.mesh"):
        jn.simulate(pair(0.5, -2.3, load="-3"), TIME)


@pytest.mark.slow
def test_power_is_in_balance_at_what_was_simulated():
    simulated = jn.simulate(pair(speed=0.3, torque="2*cos(3*t)", load="0.5*sin(5*t)"), np.linspace(0, 2, 9), order=5)
    balance = jn.energy.power_balance(simulated)
    assert (abs(balance["residual"]) <= 1e-11 * balance["scale"]).all()
    assert (balance["friction"].sel(derivative=0) <= 0).all()


def test_at_rest_there_is_none_so_that_an_equilibrium_is_that_without_friction():
    found = jn.equilibrium(pair(load="1 - 3*sin(x)"))
    assert found.poses["first"]["angle"] == pytest.approx(-2 * np.arcsin(1 / 3), abs=1e-12)
