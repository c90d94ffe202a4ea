"""Friction that follows reactions, in driven mechanisms: against balances by hand, and by the power that it takes."""

import numpy as np
import pytest
from mpmath import mp

import jounce as jn
from tests.oracles import mp_friction as by_hand


def slider_crank(mu=None, *, speed=0.02, outputs=None):
    pin = {} if mu is None else {"friction": jn.joints.Friction(mu, speed, radius="r")}
    guide = {} if mu is None else {"friction": jn.joints.Friction(mu, speed)}
    return jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        parameters={"r": 0.012},
        bodies={
            "crank": jn.Body([0, 0], angle=0.5, mass=1.0, inertia=0.01),
            "rod": jn.Body([0.0877, 0.048], angle=-0.16, mass=0.7, inertia=0.004, center_of_mass=[0.12, 0.0]),
            "piston": jn.Body([0.38, 0], mass=2.0, inertia=0.001),
        },
        joints={
            "O": jn.planar.Revolute(("ground", "crank"), [0, 0], [0, 0], **pin),
            "A": jn.planar.Revolute(("crank", "rod"), [0.1, 0], [0, 0], **pin),
            "B": jn.planar.Revolute(("piston", "rod"), [0, 0], [0.3, 0], **pin),
            "G": jn.planar.Prismatic(("ground", "piston"), [0, 0], [0, 0], [2, 0], [1, 0], **guide),
        },
        drivers={"turn": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", motion="0.5 + 20*t + 3*sin(7*t)")},
        outputs={"torque": jn.outputs.DriverTorqueOutput("turn")} if outputs is None else outputs,
    )


@pytest.mark.slow
@pytest.mark.parametrize("instant", [0.033, 0.21])
def test_driver_torque_and_rates_against_balances_by_hand(instant):
    motion = jn.solve(slider_crank(0.1), [instant], order=4)
    found, expected = motion.outputs["torque"][0], by_hand.driver_torque(instant, 4)
    scale = np.maximum(np.abs(expected), np.abs(expected[0]) * 20.0 ** np.arange(5))
    np.testing.assert_array_less(np.abs(found - expected) / scale, 1e-10)


@pytest.mark.slow
def test_reactions_show_friction_and_the_whole_is_in_equilibrium():
    instant, bodies = 0.033, ("crank", "rod", "piston")
    motion = jn.solve(slider_crank(0.1), [instant], order=4)
    torque = jn.joint_reaction(motion, "A").torque.values[0, 0]  # of the pin on the rod, about its center
    pressed = np.hypot(*jn.joint_reaction(motion, "A").force.values[0, 0])
    assert abs(torque / (0.012 * pressed)) == pytest.approx(0.1, rel=1e-9)  # the slip is far above the speed
    assert torque == pytest.approx(-jn.joint_reaction(motion, "A", "crank").torque.values[0, 0])
    guide = jn.joint_reaction(motion, "G").force.values[0, 0]
    assert abs(guide[0] / guide[1]) == pytest.approx(0.1, rel=1e-9)
    by_ground = [jn.joint_reaction(motion, name, "ground") for name in ("O", "G", "turn")]
    shaking = jn.dynamics.ground_reaction(motion)
    np.testing.assert_allclose(sum(r.force.values for r in by_ground), shaking.force.values, rtol=1e-12)
    momentum = 0.0
    for body in bodies:  # weights less the force on the ground is what the momentum changes by
        place = jn.outputs.PointOutput(body, [0.12 if body == "rod" else 0.0, 0.0])
        found = motion.evaluate(place, body).values[0, 2:5]
        momentum = momentum + {"crank": 1.0, "rod": 0.7, "piston": 2.0}[body] * found
    weight = np.array([[0.0, -9.81 * 3.7]] + [[0.0, 0.0]] * 2)
    np.testing.assert_allclose(momentum, weight - shaking.force.values[0, :3], rtol=1e-9, atol=1e-7)


@pytest.mark.slow
def test_what_the_driver_puts_in_is_gained_or_taken_by_friction():
    balance = jn.energy.power_balance(jn.solve(slider_crank(0.3), np.linspace(0.0, 0.3, 7), order=5))
    assert (abs(balance["residual"]) <= 1e-12 * balance["scale"]).all()
    assert (balance["friction"].sel(derivative=0) < -1.0).all()


@pytest.mark.slow
def test_no_friction_is_none_and_a_little_changes_forces_in_proportion():
    time = np.linspace(0.0, 0.3, 7)
    bare, none, little = (jn.solve(slider_crank(mu), time, order=2).outputs["torque"] for mu in (None, 0.0, 1e-7))
    np.testing.assert_allclose(none, bare, rtol=1e-13)
    twice = jn.solve(slider_crank(2e-7), time, order=2).outputs["torque"]
    np.testing.assert_allclose((twice - bare)[:, 0], 2 * (little - bare)[:, 0], rtol=1e-5)


@pytest.mark.slow
def test_a_gradient_by_the_radius_is_a_difference():
    import jax

    def torque(r):
        return jn.solve(slider_crank(0.1).with_parameters(r=r), [0.033], order=2).outputs["torque"][0, 1]

    step = 1e-5
    assert float(jax.grad(torque)(0.012)) == pytest.approx((torque(0.012 + step) - torque(0.012 - step)) / (2 * step))


def wedge(mu, slope=0.5):
    """A block on a slide, pushed along x by a driver through a slot across an incline, which presses it down."""
    friction = jn.joints.Friction(mu, 1e-3)
    return jn.Mechanism(
        space="planar",
        bodies={"wedge": jn.Body([0, 0], mass=1.0), "lift": jn.Body([0, 0], mass=3.0)},
        joints={
            "floor": jn.planar.Prismatic(("ground", "wedge"), [0, 0], [0, 0], [1, 0], [1, 0]),
            "guide": jn.planar.Prismatic(("ground", "lift"), [0, 0], [0, 0], [0, 1], [0, 1], friction=friction),
            "slope": jn.planar.Parallel2(("wedge", "lift"), [0, 0], [0, 0], [1, slope]),
        },
        drivers={"push": jn.drivers.CoordinateDriver(("ground", "wedge"), "x", motion="-0.3*t - 0.1*t**2")},
        outputs={"force": jn.outputs.DriverForceOutput("push")},
        gravity=[0, -10.0],
    )


@pytest.mark.parametrize("mu", [0.2, 1.0, 1.9])
def test_a_wedge_needs_the_force_of_the_closed_form(mu):
    found = jn.solve(wedge(mu), [0.0, 1.0], order=1).outputs["force"]
    # lift: N (normal to the slope, per unit of x) carries the load and the friction of the guide, which bears slope N
    normal = 3.0 * (10.0 + 0.1) / (1.0 - 0.5 * mu)
    np.testing.assert_allclose(found, [[-(0.2 + 0.5 * normal), 0.0]] * 2, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("mu", [2.0, 2.5, 40.0])
def test_friction_that_locks_is_reported(mu):
    with pytest.raises(jn.errors.SolveError, match=r"friction locks at t = 0 s: no force of the drivers"):
        _ = jn.solve(wedge(mu), [0.0, 1.0], order=1).outputs["force"]


@pytest.mark.slow
def test_reactions_that_are_open_have_no_friction():
    twice = wedge(0.1)
    joints = dict(twice.joints) | {"again": jn.planar.Parallel1(("ground", "lift"), [0, 1], [0, 1])}
    with pytest.raises(jn.errors.UnsupportedError, match="friction follows reactions, and redundant constraints"):
        _ = jn.solve(jn.Mechanism(**{**vars_of(twice), "joints": joints}), [0.0], order=1).outputs["force"]


def vars_of(mechanism):
    return {name: getattr(mechanism, name) for name in ("space", "bodies", "drivers", "outputs", "gravity")}


@pytest.mark.slow
def test_rates_are_open_where_what_presses_passes_zero():
    free = wedge(0.3)
    driver = jn.drivers.CoordinateDriver(("ground", "wedge"), "x", motion="-0.3*t - (t - 1)**3")
    parts = vars_of(free) | {"joints": free.joints, "gravity": None, "drivers": {"push": driver}}
    motion = jn.solve(jn.Mechanism(**parts), [0.9, 1.0, 1.1], order=1)
    assert np.isfinite(motion.outputs["force"]).tolist() == [[True, True], [True, False], [True, True]]
    comment = motion.dataset["force"].attrs["comment"]
    assert "what presses guide passes zero at t = 1 s: rates of its friction are not determined" in comment


ORIGIN, UP = [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]


def screw_jack(mu, law, lead=0.005, radius=0.01):
    """A nut of 100 kg that is kept from turning, on a screw that turns; the lead angle is 4.55 degrees."""
    thread = jn.joints.Friction(mu, 1e-6, radius)
    light = {"mass": 0.1, "inertia": [1e-9] * 3}
    return jn.Mechanism(
        space="spatial",
        gravity=[0, 0, -10.0],
        bodies={"screw": jn.Body(ORIGIN, **light), "nut": jn.Body(ORIGIN, mass=100.0, inertia=[1.0] * 3)},
        joints={
            "axle": jn.spatial.Revolute(("ground", "screw"), ORIGIN, ORIGIN, UP, UP),
            "thread": jn.spatial.Screw(("screw", "nut"), ORIGIN, ORIGIN, UP, UP, lead, friction=thread),
            "key": jn.spatial.Dot1(("ground", "nut"), [1, 0, 0], [0, 1, 0]),
        },
        drivers={"turn": jn.drivers.RotationDriver(("ground", "screw"), UP, law)},
        outputs={"torque": jn.outputs.DriverTorqueOutput("turn")},
    )


@pytest.mark.parametrize(
    "mu", [pytest.param(0.05, marks=pytest.mark.slow), 0.12]
)  # below and above the slope of the thread, 0.0796
@pytest.mark.slow
def test_a_screw_lifts_and_lowers_by_the_formulas_of_the_square_thread(mu):
    rise, angle = np.arctan(0.005 / (2 * np.pi * 0.01)), np.arctan(mu)
    lift = jn.solve(screw_jack(mu, "-2*t"), [0.0, 0.7], order=1).outputs["torque"]
    lower = jn.solve(screw_jack(mu, "2*t"), [0.0, 0.7], order=1).outputs["torque"]
    np.testing.assert_allclose(lift[:, 0], -1000 * 0.01 * np.tan(rise + angle), rtol=1e-11)
    np.testing.assert_allclose(lower[:, 0], -1000 * 0.01 * np.tan(rise - angle), rtol=1e-10)
    assert (lower[:, 0] > 0).all() == (mu > 0.08)  # above, it must be turned down too: it locks itself


@pytest.mark.slow
def test_a_ball_and_a_sleeve_resist_along_their_slip():
    ball = jn.joints.Friction(0.2, 0.5, 0.05)
    x, y = [1.0, 0, 0], [0, 1.0, 0]
    mechanism = jn.Mechanism(
        space="spatial",
        gravity=[0, 0, -10.0],
        bodies={
            "ball": jn.Body(ORIGIN, mass=3.0, inertia=[0.2] * 3),
            "rod": jn.Body(ORIGIN, mass=2.0, inertia=[0.1] * 3),
        },
        joints={
            "socket": jn.spatial.Spherical(("ground", "ball"), ORIGIN, ORIGIN, friction=ball),
            "level": jn.spatial.Dot1(("ground", "ball"), UP, x),
            "square": jn.spatial.Dot1(("ground", "ball"), UP, y),
            "sleeve": jn.spatial.Cylindrical(("ground", "rod"), ORIGIN, ORIGIN, x, x, friction=ball),
        },
        drivers={
            "turn": jn.drivers.RotationDriver(("ground", "ball"), UP, "3*t + t**2"),
            "roll": jn.drivers.RotationDriver(("ground", "rod"), x, "4*t"),
            "push": jn.drivers.SpatialSlideDriver(("ground", "rod"), ORIGIN, ORIGIN, x, "0.3*t + 0.1*t**2"),
        },
        outputs={
            "turn": jn.outputs.DriverTorqueOutput("turn"),
            "roll": jn.outputs.DriverTorqueOutput("roll"),
            "push": jn.outputs.DriverForceOutput("push"),
        },
    )
    time = np.array([0.0, 0.5, 1.0])
    found = jn.solve(mechanism, time, order=2).outputs
    with mp.workdps(30):
        for k, t in enumerate(time):

            def turn(t):
                return 0.4 + 0.2 * 0.05 * 30 * mp.tanh((3 + 2 * t) * 0.05 / 0.5)

            def sleeve(t, part):
                slip = mp.mpf("0.3") + mp.mpf("0.2") * t, mp.mpf("0.2")
                size = mp.sqrt(slip[0] ** 2 + slip[1] ** 2)
                return 0.2 * 20 * mp.tanh(size / 0.5) * slip[part] / size

            expected = {"turn": turn, "roll": lambda t: 0.05 * sleeve(t, 1), "push": lambda t: 0.4 + sleeve(t, 0)}
            for name, law in expected.items():
                rates = [float(x) for x in mp.diffs(law, mp.mpf(t), 2)]
                np.testing.assert_allclose(found[name][k], rates, rtol=1e-12, atol=1e-12, err_msg=name)


def ladder(law="0.3 + 0.4*t", start=0.3):
    """A ladder of 1 m, pushed along the floor, lifts 3 kg in a guide: it locks where the tangent of its slope is mu."""
    guide = jn.joints.Friction("mu", 1e-3)
    return jn.Mechanism(
        space="planar",
        gravity=[0, -10.0],
        parameters={"mu": 0.1},
        bodies={"foot": jn.Body([np.sqrt(1 - start**2), 0]), "top": jn.Body([0, start], mass=3.0)},
        joints={
            "floor": jn.planar.Prismatic(("ground", "foot"), [0, 0], [0, 0], [1, 0], [1, 0]),
            "wall": jn.planar.Prismatic(("ground", "top"), [0, 0], [0, 0], [0, 1], [0, 1], friction=guide),
            "ladder": jn.planar.DoubleRevolute(("foot", "top"), [0, 0], [0, 0], 1.0),
        },
        drivers={"push": jn.drivers.CoordinateDriver(("ground", "foot"), "x", f"sqrt(1 - ({law})**2)")},
        outputs={"force": jn.outputs.DriverForceOutput("push")},
    )


@pytest.mark.slow
def test_designs_and_instants_whose_friction_locks_fail_alone_with_their_status():
    made = ladder()
    mu, time = np.array([0.1, 1.0, 0.2]), np.array([0.0, 0.6, 1.5])
    found = jn.solve_batch(made, {"mu": mu}, time, order=2)
    height = 0.3 + 0.4 * time
    slope = height / np.sqrt(1 - height**2)
    np.testing.assert_array_equal(found["status"], np.where(slope > mu[:, None], 0, 12))
    expected = np.where(slope > mu[:, None], -30.0 / (slope - mu[:, None]), np.nan)
    np.testing.assert_allclose(found["force"][..., 0], expected, rtol=1e-10)
    motion = jn.solve(made.with_parameters(mu=1.0), time, order=2)
    with pytest.raises(jn.errors.SolveError, match="friction locks at t = 0 s") as caught:
        motion.outputs["force"]
    assert (caught.value.status, caught.value.motion.status.tolist()) == (12, [12, 12, 0])


@pytest.mark.slow
def test_a_sweep_keeps_which_designs_lock_and_the_statistics_of_the_others(tmp_path):
    time = np.array([0.0, 0.6, 1.5])
    found = jn.sweep(ladder(), {"mu": [0.1, 1.0, 0.2]}, tmp_path / "s.zarr", time, 2, workers=0, histories=True).load()
    assert found["first_status"].values.tolist() == [0, jn.Status.LOCKED, 0]
    assert found["failed_instants"].values.tolist() == [0, 2, 0]
    assert found["status"].values.tolist() == [[0, 0, 0], [12, 12, 0], [0, 0, 0]]
    slope, mu = 0.3 / np.sqrt(0.91), np.array([0.1, 0.2])
    np.testing.assert_allclose(found["force_peak"].values[[0, 2], 0], 30.0 / (slope - mu), rtol=1e-10)
    for name in ("peak", "rms", "min", "max"):
        assert np.isnan(found[f"force_{name}"].values[1]).all()
