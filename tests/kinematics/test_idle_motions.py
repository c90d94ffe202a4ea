"""Struts and rods that may spin about their own axes: held at rest with a warning, and no output may depend on it."""

import dataclasses
import warnings

import jax
import numpy as np
import pytest
from mpmath import mp

import jounce as jn

BALL, CYLINDER = jn.spatial.Spherical, jn.spatial.Cylindrical
TOP, KNUCKLE = [-0.04, 0.70, 0.85], [-0.014, 0.83, 0.4275]
STRUT = [-0.026, -0.13, 0.4225]
OUTER = [0.15, 0.8, 0.275]
pytestmark = pytest.mark.slow


def strut(**changes):
    """Return a McPherson strut with a strut and a tie rod that may spin."""
    spatial = jn.spatial
    joints = {
        "axis": spatial.Revolute(("ground", "arm"), [0.25, 0.4, 0.2], [0.25, 0.4, 0.2], [-10, 1, 0], [-10, 1, 0]),
        "ball": BALL(("arm", "upright"), [0, 0.9, 0.2], [0, 0.9, 0.2]),
        "top": BALL(("ground", "strut"), TOP, TOP),
        "damper": CYLINDER(("upright", "strut"), KNUCKLE, TOP, STRUT, STRUT),
        "inner": BALL(("ground", "rod"), [0.05, 0.2, 0.25], [0.05, 0.2, 0.25]),
        "outer": BALL(("rod", "upright"), OUTER, OUTER),
    }
    hub = [-0.02, 0.95, 0.3134]
    bump = jn.drivers.SpatialSlideDriver(("ground", "upright"), [0, 0, hub[2]], hub, [0, 0, 1], "0.05*t")
    outputs = {
        "wheel": jn.outputs.PointOutput("upright", hub),
        "travel": jn.outputs.DistanceOutput(("upright", "strut"), KNUCKLE, TOP),
        "pin": jn.outputs.PointOutput("rod", [0.1, 0.5, 0.2625]),
    }
    made = jn.Mechanism(
        space="spatial",
        bodies={name: jn.Body([0, 0, 0]) for name in ("arm", "upright", "strut", "rod")},
        joints={**joints, **changes.pop("joints", {})},
        drivers={"bump": bump},
        outputs=outputs,
    )
    return dataclasses.replace(made, **changes)


@pytest.fixture(scope="module")
def held():
    with pytest.warns(jn.errors.IdleMotionWarning, match=r"strut about \[-0.05872, -0.2936, 0.9541\] of strut; rod"):
        return jn.solve(strut(), [-1.0, -0.2, 0.4, 1.0])


def test_what_does_not_depend_on_a_spin_is_as_with_joints_that_hold_it(held):
    """Universal joints in place of ball joints, and a massless rod, leave no spin."""
    cross = jn.spatial.Universal(("ground", "strut"), TOP, TOP, [0.4225, 0, 0.026], [0, 0.4225, 0.13])
    direction = np.array(OUTER) - [0.05, 0.2, 0.25]
    side = np.cross(direction, [0, 0, 1.0])
    second = np.cross(direction, side)
    inner = jn.spatial.Universal(("ground", "rod"), [0.05, 0.2, 0.25], [0.05, 0.2, 0.25], side, second)
    other = jn.solve(strut(joints={"top": cross, "inner": inner}), held.time)
    for name in other.outputs:
        np.testing.assert_allclose(held.outputs[name], other.outputs[name], rtol=0, atol=1e-10)


def test_results_do_not_depend_on_the_grid_and_the_order(held):
    with pytest.warns(jn.errors.IdleMotionWarning):
        fine = jn.solve(strut(), np.linspace(-1.0, 1.0, 11), order=6)
    for name in held.outputs:
        np.testing.assert_allclose(fine.outputs[name][[0, 4, 7, 10], :5], held.outputs[name], rtol=0, atol=1e-10)


def test_what_depends_on_a_spin_is_refused_by_name(held):
    off = jn.outputs.PointOutput("strut", [0, 0, 0])
    with pytest.raises(jn.errors.MechanismError, match=r"outputs\.off: .*strut.* about \[.* a universal joint"):
        jn.solve(strut(outputs={"off": off}), [0.0, 0.5])
    with pytest.raises(jn.errors.MechanismError, match="may spin"):
        held.evaluate(off, "later")
    with pytest.raises(jn.errors.MechanismError, match="may spin"):
        held.angular_velocity("rod")
    assert np.isfinite(held.point("strut", TOP).values).all()


def test_families_have_them(held):
    made = strut(parameters={"rise": 0.05})
    bump = dataclasses.replace(made.drivers["bump"], motion="rise*t")
    with pytest.warns(jn.errors.IdleMotionWarning):
        found = jn.solve_batch(dataclasses.replace(made, drivers={"bump": bump}), {"rise": [0.03, 0.05]}, held.time)
    assert not found["status"].any()
    np.testing.assert_allclose(found["wheel"][1], held.outputs["wheel"], rtol=0, atol=1e-10)


def test_gradients_are_refused():
    def travel(z):
        top = [TOP[0], TOP[1], z]
        return jn.solve(strut(joints={"top": BALL(("ground", "strut"), top, top)}), [0.4]).outputs["travel"][0]

    with pytest.raises(jn.errors.UnsupportedError, match="strut; rod"):
        jax.jacfwd(travel)(TOP[2])


def test_a_strut_that_is_off_its_axis_is_not_idle():
    """The body swings as it spins, so that its spin is a degree of freedom like any other."""
    top = [TOP[0], TOP[1] + 1e-3, TOP[2]]
    with pytest.raises(jn.errors.MobilityError, match="add 2 drivers"):
        jn.solve(strut(joints={"top": BALL(("ground", "strut"), top, top)}), [0.4])


def test_degrees_of_freedom_that_move_more_are_refused_as_before():
    with pytest.raises(jn.errors.MobilityError, match="3 degrees of freedom are left"):
        jn.solve(strut(drivers={}), [0.0, 0.5])
    # a crank at the dead point of a rod without a body moves alone at first, and not for long
    o, x = [0, 0, 0], [1, 0, 0]
    joints = {
        "pin": jn.spatial.Revolute(("ground", "crank"), [0, 0, 0], [0, 0, 0], [0, 0, 1], [0, 0, 1]),
        "guide": jn.spatial.Prismatic(("ground", "slide"), o, o, x, x, [0, 1, 0], [0, 1, 0]),
        "rod": jn.spatial.DoubleSpherical(("crank", "slide"), [0.1, 0, 0], [0, 0, 0], 0.3),
        "other": jn.spatial.Revolute(("ground", "wheel"), [0, 0, 1], [0, 0, 1], [0, 0, 1], [0, 0, 1]),
    }
    bodies = {"crank": jn.Body([0, 0, 0]), "slide": jn.Body([0.4, 0, 0]), "wheel": jn.Body([0, 0, 0])}
    turn = jn.drivers.RotationDriver(("ground", "wheel"), [0, 0, 1], "t")
    made = jn.Mechanism(space="spatial", bodies=bodies, joints=joints, drivers={"turn": turn})
    with pytest.raises(jn.errors.MobilityError):
        jn.solve(made, [0.0, 0.1])


def leg(inertia=(0.02, 0.02, 0.001)):
    """Return a leg between two balls, of a barrel and a rod that may spin as one, which moves a table on a slope."""
    spatial, z = jn.spatial, [0, 0, 1]
    bodies = {
        "barrel": jn.Body([0, 0, 0], mass=2, inertia=list(inertia)),
        "rod": jn.Body([0, 0, 0], mass=1, inertia=[0.01, 0.01, 0.001]),
        "table": jn.Body([0, 0, 1], mass=10, inertia=[1, 1, 1]),
    }
    joints = {
        "foot": BALL(("ground", "barrel"), [0, 0, 0], [0, 0, 0]),
        "ram": spatial.Prismatic(("barrel", "rod"), [0, 0, 0], [0, 0, 0], z, z, [1, 0, 0], [1, 0, 0]),
        "head": BALL(("rod", "table"), z, [0, 0, 0]),
        "guide": spatial.Prismatic(("ground", "table"), z, [0, 0, 0], [1, 0, 1], [1, 0, 1], [0, 1, 0], [0, 1, 0]),
    }
    stroke = jn.drivers.SpatialSlideDriver(("barrel", "rod"), [0, 0, 0], [0, 0, 0], z, "0.1*t + 0.05*t**2")
    outputs = {"table": jn.outputs.PointOutput("table", [0, 0, 0]), "F": jn.outputs.DriverForceOutput("stroke")}
    parts = {"bodies": bodies, "joints": joints, "drivers": {"stroke": stroke}, "outputs": outputs}
    return jn.Mechanism(space="spatial", gravity=[0, 0, -9.81], **parts)


def test_the_force_of_a_leg_that_may_spin_is_that_of_its_power():
    with pytest.warns(jn.errors.IdleMotionWarning, match="barrel and rod as one"):
        motion = jn.solve(leg(), [0.0, 0.5, 1.0], order=3)

    def energy(t):
        def place(t):
            length = 1 + t / 10 + t * t / 20
            u = (mp.sqrt(2 * length**2 - 1) - 1) / 2
            return length, u, mp.atan2(u, 1 + u)

        length, u, angle = place(t)
        rates = [mp.diff(lambda s, k=k: place(s)[k], t) for k in range(3)]
        swing = mp.mpf("0.03") + (length - 1) ** 2
        kinetic = 10 * rates[1] ** 2 + (swing * rates[2] ** 2 + rates[0] ** 2) / 2
        return kinetic + mp.mpf("9.81") * (10 * (1 + u) + (length - 1) * mp.cos(angle))

    with mp.workdps(60):
        for k, t in enumerate(map(mp.mpf, motion.time.tolist())):
            expected = mp.diff(energy, t) / (mp.mpf("0.1") + t / 10)
            assert abs(motion.outputs["F"][k, 0] - expected) < 1e-9 * abs(expected)


def test_inertia_that_would_spin_a_leg_is_refused():
    spun = leg(inertia=[[0.02, 0.003, 0.004], [0.003, 0.01, 0.002], [0.004, 0.002, 0.012]])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", jn.errors.IdleMotionWarning)
        with pytest.raises(jn.errors.MechanismError, match="would spin this body"):
            _ = jn.solve(spun, [0.0, 0.5]).outputs["F"]
