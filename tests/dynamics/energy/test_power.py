"""The power balance: judged by the products that enter it, and able to see an error. What is not finite is named."""

import math

import numpy as np
import pytest

import jounce as jn
from jounce import drivers, planar
from jounce.dynamics.inverse.motion_forces import MotionForces
from jounce.errors import MechanismError

SLOPE, RADIUS, MASS = 0.3, 0.1, 2.0
TIME = np.array([0.0, 0.3, 1.0, 7.0])


def disc(share):
    """A disc that rolls down an incline, driven at a share of the acceleration that its weight gives it."""
    c, s = math.cos(SLOPE), math.sin(SLOPE)
    return jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        parameters={"share": share, "slope": SLOPE},
        bodies={"disc": jn.Body([-RADIUS * s, RADIUS * c], mass=MASS, inertia=MASS * RADIUS**2 / 2)},
        joints={
            "contact": planar.Parallel2(("ground", "disc"), [-RADIUS * s, RADIUS * c], [0, 0], [c, s]),
            "roll": planar.Rolling(("ground", "disc"), [0, 0], [0, 0], [-c, -s], RADIUS, 0.0),
        },
        drivers={
            "go": drivers.SlideDriver(("ground", "disc"), [0, 0], [0, 0], [c, s], "-share*9.81*sin(slope)/3*t**2")
        },
    )


@pytest.mark.slow
@pytest.mark.parametrize("share", [1.0, 0.5])
def test_power_that_grows_evenly_balances_at_every_order(share):
    balance = jn.energy.power_balance(jn.solve(disc(share), TIME, order=6))
    assert (abs(balance["residual"]) <= 1e-14 * balance["scale"]).all()
    acceleration = -share * 9.81 * math.sin(SLOPE) * 2 / 3
    expected = 1.5 * MASS * acceleration**2 * TIME  # of kinetic energy: 3/4 m v^2
    np.testing.assert_allclose(balance["kinetic"][:, 0], expected, rtol=1e-14)
    np.testing.assert_allclose(balance["kinetic"][:, 1], expected[2], rtol=1e-13)


@pytest.mark.slow
def test_a_force_bent_by_a_billionth_shows(monkeypatch):
    motion = jn.solve(disc(0.5), TIME, order=6)
    exact = MotionForces.driver_force
    monkeypatch.setattr(MotionForces, "driver_force", lambda self, name: exact(self, name) * (1 + 1e-9))
    balance = jn.energy.power_balance(motion)
    share = (abs(balance["residual"]) / balance["scale"].where(balance["scale"] > 0, 1.0)).values
    assert (share[1:, :2] > 1e-12).all()  # hundred times rounding; the rates above are zero


@pytest.mark.slow
def test_drivers_that_hold_the_same_number_give_no_power():
    """Their law has one instance for all of them."""
    names = {"a": 0.0, "b": 1.0}
    held = jn.Mechanism(
        space="planar",
        bodies={name: jn.Body([x, 0], mass=1.0, inertia=0.1) for name, x in names.items()},
        joints={f"pin_{name}": planar.Revolute(("ground", name), [x, 0], [0, 0]) for name, x in names.items()},
        drivers={f"at_{name}": drivers.CoordinateDriver(("ground", name), "angle", "0.5") for name in names},
        forces={"load": jn.forces.Torque(("ground", "b"), "3*t")},
    )
    balance = jn.energy.power_balance(jn.solve(held, TIME, order=2))
    assert (balance["drivers"] == 0).all()
    assert (balance["residual"] == 0).all()


def arm(**applied):
    return jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        bodies={"arm": jn.Body([0, 0], mass=2.0, inertia=0.3, center_of_mass=[0.5, 0])},
        joints={"pin": planar.Revolute(("ground", "arm"), [0, 0], [0, 0])},
        drivers={"turn": drivers.CoordinateDriver(("ground", "arm"), "angle", "t")},
        forces=applied,
    )


ASKED = {
    "driver": lambda motion: jn.driver_force(motion, "turn"),
    "reaction": lambda motion: jn.joint_reaction(motion, "pin"),
    "force": lambda motion: jn.dynamics.applied_force(motion, "f"),
    "power": jn.energy.power_balance,
}


@pytest.mark.slow
@pytest.mark.parametrize("asked", ASKED)
@pytest.mark.parametrize(
    "force, words",
    [
        (jn.forces.Torque(("ground", "arm"), "2/(t - 0.3)"), r"has no finite value at t = 0\.3 s"),
        (jn.forces.Torque(("ground", "arm"), "sqrt(t)"), r"its derivative 1 has no finite value at t = 0 s"),
        (jn.forces.Spring(("ground", "arm"), [1, 0], [1, 0], 3.0, 0.5), r"has no finite value at t = 0 s"),
    ],
)
def test_what_is_not_finite_is_named_with_its_time(force, words, asked):
    motion = jn.solve(arm(f=force), TIME[:3], order=4)
    with pytest.raises(MechanismError, match=rf"forces\.f: {words}"):
        ASKED[asked](motion)
