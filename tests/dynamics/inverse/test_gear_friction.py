"""Friction of gears that follows the torque they pass on, in driven mechanisms: closed forms and balances by hand."""

import itertools

import numpy as np
import pytest
from mpmath import mp, mpf

import jounce as jn
from tests.oracles import mp_gear_friction as by_hand

ORIGIN, X, Y, Z = [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]


def pair(law="3*t", load="-10", friction=None, *, ring=False, ratio=False, **values):
    """Two gears on the ground, of 0.1 and 0.2 m, of which the first is driven and the second loaded."""
    distance = 0.1 if ring else 0.3
    friction = friction or jn.joints.GearFriction(speed=1e-3, efficiency=0.9, backward=0.8)
    radii = {"radius_i": 0.1, "radius_j": -0.2 if ring else 0.2}
    toothed = {"point_i": [0, 0], "point_j": [0, 0], **radii, **values}
    bodies = ("first", "second", "ground") if ratio else ("first", "second")
    mesh = jn.planar.Gear(bodies, friction=friction, **({"ratio": 0.5 if ring else -0.5} if ratio else toothed))
    return jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        parameters={"speed": 3.0, "load": 10.0},
        bodies={
            "first": jn.Body([0, 0], mass=1.0, inertia=0.02, center_of_mass=[0.03, 0.01]),
            "second": jn.Body([distance, 0], mass=3.0, inertia=0.09, center_of_mass=[-0.02, 0.05]),
        },
        joints={
            "A": jn.planar.Revolute(("ground", "first"), [0, 0], [0, 0]),
            "B": jn.planar.Revolute(("ground", "second"), [distance, 0], [0, 0]),
            "mesh": mesh,
        },
        forces={"load": jn.forces.Torque(("ground", "second"), load)},
        drivers={"turn": jn.drivers.CoordinateDriver(("ground", "first"), "angle", law)},
        outputs={"torque": jn.outputs.DriverTorqueOutput("turn")},
    )


@pytest.mark.parametrize(
    "kind",
    [
        {},
        pytest.param({"ring": True}, marks=pytest.mark.slow),
        pytest.param({"ratio": True}, marks=pytest.mark.slow),
        pytest.param({"pressure_angle": 0.35}, marks=pytest.mark.slow),
    ],
)
def test_power_that_leaves_is_power_that_enters_times_the_efficiency(kind):
    """Both directions of turning and of power; the loads of weights vary, those of inertia are none at one speed."""
    mechanism, ratio = pair("speed*t", "load", **kind), 0.5 if kind.get("ring") else -0.5
    for speed, load in itertools.product((3.0, -3.0), (10.0, -10.0)):
        motion = jn.solve(mechanism.with_parameters(speed=speed, load=load), np.linspace(0.0, 2.0, 9), order=1)
        angle, first = ratio * speed * motion.time, speed * motion.time
        moment = 3.0 * 9.81 * (-0.02 * np.cos(angle) - 0.05 * np.sin(angle))  # of the weight of the second
        power = (load - moment) * ratio * speed  # that the load puts in
        own = 1.0 * 9.81 * (0.03 * np.cos(first) - 0.01 * np.sin(first)) * speed
        expected = np.where(power < 0, -power / 0.9, -power * 0.8) + own
        np.testing.assert_allclose(motion.outputs["torque"][:, 0] * speed, expected, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("instant", [0.04, 0.31])
@pytest.mark.parametrize("kind", ["wheels", "ring"])
def test_torque_and_rates_against_balances_by_hand(instant, kind):
    friction = jn.joints.GearFriction(speed=2.0, efficiency=0.9, backward=0.7)  # rates have a share of the smoothing
    motion = jn.solve(pair(by_hand.LAW, "-4 + 6*sin(5*t)", friction, ring=kind == "ring"), [instant], order=4)
    found = motion.outputs["torque"][0]
    expected = by_hand.driver_torque(mpf(instant), 4, ring=kind == "ring")
    scale = np.maximum(np.abs(expected), np.abs(expected[0]) * 9.0 ** np.arange(5))
    np.testing.assert_array_less(np.abs(found - expected) / scale, 1e-10)


@pytest.mark.parametrize("forward, backward", [(1.0, 0.8), (0.9, 1.0), (1.0, 1.0)])
def test_gears_that_lose_nothing_one_way_lock_neither_way(forward, backward):
    friction = jn.joints.GearFriction(speed=0.1, efficiency=forward, backward=backward)
    mechanism = pair("speed*t", "load", friction, ratio=True)
    light = {name: jn.Body(body.position) for name, body in mechanism.bodies.items()}
    names = ("space", "joints", "forces", "drivers", "outputs", "parameters")
    bare = jn.Mechanism(**{name: getattr(mechanism, name) for name in names}, bodies=light)
    for speed, load in itertools.product((1.8, -1.8), (7.0, -7.0)):  # at 1.8 the smoothing leaves rounding of friction
        motion = jn.solve(bare.with_parameters(speed=speed, load=load), [0.0, 0.5, 1.0], order=1)
        share = 1 / forward if load * speed > 0 else backward
        np.testing.assert_allclose(motion.outputs["torque"][:, 0], 0.5 * load * share, rtol=1e-12)


@pytest.mark.slow
def test_reactions_are_in_equilibrium_and_bearings_bear_the_tooth_force():
    motion = jn.solve(pair("3*t + sin(2*t)", pressure_angle=0.35), [0.4], order=3)
    by_ground = [jn.joint_reaction(motion, name, "ground").force.values for name in ("A", "B")]
    shaking = jn.dynamics.ground_reaction(motion)
    np.testing.assert_allclose(sum(by_ground), shaking.force.values, rtol=1e-11, atol=1e-11)
    of_mesh = {name: jn.joint_reaction(motion, "mesh", name) for name in ("first", "second")}
    forces = [r.force.values for r in of_mesh.values()]
    np.testing.assert_allclose(forces[0], -forces[1], rtol=1e-12, atol=1e-12)
    torques = [r.torque.values for r in of_mesh.values()]  # about the centers, 0.3 m apart
    np.testing.assert_allclose(sum(torques) + 0.3 * forces[1][..., 1], 0.0, atol=1e-11)
    assert abs(torques[1][0, 0] / torques[0][0, 0]) == pytest.approx(2 / 0.8, rel=1e-12)  # the load drives


@pytest.mark.slow
@pytest.mark.parametrize("crossed", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_belt_passes_on_its_share(crossed):
    friction = jn.joints.GearFriction(speed=1e-3, efficiency=0.96, backward=0.94)
    o, ratio = [0.0, 0.0], -0.5 if crossed else 0.5
    mechanism = jn.Mechanism(
        space="planar",
        parameters={"speed": 3.0, "load": 10.0},
        bodies={"first": jn.Body(o), "second": jn.Body([0.5, 0])},
        joints={
            "A": jn.planar.Revolute(("ground", "first"), o, o),
            "B": jn.planar.Revolute(("ground", "second"), [0.5, 0], o),
            "belt": jn.planar.Belt(("first", "second"), o, o, 0.1, 0.2, crossed, friction=friction),
        },
        forces={"load": jn.forces.Torque(("ground", "second"), "load")},
        drivers={"turn": jn.drivers.CoordinateDriver(("ground", "first"), "angle", "speed*t")},
        outputs={"torque": jn.outputs.DriverTorqueOutput("turn")},
    )
    for speed, load in itertools.product((3.0, -3.0), (10.0, -10.0)):
        found = jn.solve(mechanism.with_parameters(speed=speed, load=load), [0.0, 1.0], order=1).outputs["torque"]
        share = 1 / 0.96 if load * ratio * speed < 0 else 0.94
        np.testing.assert_allclose(found[:, 0], -load * ratio * share, rtol=1e-12)


@pytest.mark.slow
def test_a_pinion_drives_its_rack_and_is_driven_by_it_with_their_efficiencies():
    friction = jn.joints.GearFriction(speed=1e-3, efficiency=0.95, backward=0.85)
    o, x = [0.0, 0.0], [1.0, 0.0]
    mechanism = jn.Mechanism(
        space="planar",
        parameters={"speed": 3.0, "load": 10.0},
        bodies={"pinion": jn.Body(o), "rack": jn.Body([0, 0.05])},
        joints={
            "axle": jn.planar.Revolute(("ground", "pinion"), o, o),
            "guide": jn.planar.Prismatic(("ground", "rack"), [0, 0.05], o, x, x),
            "teeth": jn.planar.Rolling(("rack", "pinion"), o, o, x, 0.05, pressure_angle=0.35, friction=friction),
        },
        forces={"load": jn.forces.PointForce("rack", o, ["load", "0"])},
        drivers={"turn": jn.drivers.CoordinateDriver(("ground", "pinion"), "angle", "speed*t")},
        outputs={"torque": jn.outputs.DriverTorqueOutput("turn"), "place": jn.outputs.PointOutput("rack", o)},
    )
    for speed, load in itertools.product((3.0, -3.0), (10.0, -10.0)):
        motion = jn.solve(mechanism.with_parameters(speed=speed, load=load), [0.0, 1.0], order=2)
        rate = motion.outputs["place"][1, 1, 0]
        assert abs(rate) == pytest.approx(0.15)
        power = load * rate  # that the load puts in
        expected = np.where(power < 0, -power / 0.95, -power * 0.85)
        np.testing.assert_allclose(motion.outputs["torque"][:, 0] * speed, expected, rtol=1e-12)
        whole = sum(jn.joint_reaction(motion, name, "ground").force.values for name in ("axle", "guide"))
        np.testing.assert_allclose(whole[:, 0], [[load, 0.0]] * 2, atol=1e-11)


@pytest.mark.slow
def test_a_pinion_in_space_drives_its_rack_and_is_driven_by_it_with_their_efficiencies():
    friction = jn.joints.GearFriction(speed=1e-3, efficiency=0.95, backward=0.85)
    light = {"mass": 0.1, "inertia": [1e-3] * 3}
    mechanism = jn.Mechanism(
        space="spatial",
        parameters={"speed": 3.0, "load": 10.0},
        bodies={"pinion": jn.Body(ORIGIN, **light), "rack": jn.Body([0, 0.05, 0], **light)},
        joints={
            "axle": jn.spatial.Revolute(("ground", "pinion"), ORIGIN, ORIGIN, Z, Z),
            "guide": jn.spatial.Prismatic(("ground", "rack"), [0, 0.05, 0], ORIGIN, X, X, Y, Y),
            "teeth": jn.spatial.Rolling(("rack", "pinion"), ORIGIN, ORIGIN, X, Z, Z, 0.05, friction=friction),
        },
        forces={"load": jn.forces.SpatialPointForce("rack", ORIGIN, ["load", "0", "0"])},
        drivers={"turn": jn.drivers.RotationDriver(("ground", "pinion"), Z, "speed*t")},
        outputs={"torque": jn.outputs.DriverTorqueOutput("turn"), "place": jn.outputs.PointOutput("rack", ORIGIN)},
    )
    for speed, load in itertools.product((3.0, -3.0), (10.0, -10.0)):
        motion = jn.solve(mechanism.with_parameters(speed=speed, load=load), [0.0, 1.0], order=2)
        rate = motion.outputs["place"][1, 1, 0]
        assert abs(rate) == pytest.approx(0.15)
        power = load * rate  # that the load puts in
        expected = np.where(power < 0, -power / 0.95, -power * 0.85)
        np.testing.assert_allclose(motion.outputs["torque"][:, 0] * speed, expected, rtol=1e-11)


BASIC = [(0.97, 0.95), (1.0, 0.9), (0.6, 0.7)]


def planetary(fixed, driven, speed=3.0, sun=0.03, planet=0.02):
    ring, turning = sun + 2 * planet, jn.drivers.CoordinateDriver
    (third,) = {"sun", "ring", "carrier"} - {fixed, driven}
    first, second = (jn.joints.GearFriction(speed=1e-3, efficiency=e) for e in ("one", "two"))
    places = {"sun": [0, 0], "carrier": [0, 0], "ring": [0, 0], "planet": [sun + planet, 0]}
    o = [0.0, 0.0]
    return jn.Mechanism(
        space="planar",
        parameters={"one": 1.0, "two": 1.0, "load": 0.0},
        bodies={name: jn.Body(place, mass=0.1, inertia=0.01) for name, place in places.items()},
        joints={
            **{f"{name}_axle": jn.planar.Revolute(("ground", name), o, o) for name in ("sun", "carrier", "ring")},
            "pin": jn.planar.Revolute(("carrier", "planet"), [sun + planet, 0], o),
            "inner": jn.planar.Gear(
                ("sun", "planet"), point_i=o, point_j=o, radius_i=sun, radius_j=planet, friction=first
            ),
            "outer": jn.planar.Gear(
                ("planet", "ring"), point_i=o, point_j=o, radius_i=planet, radius_j=-ring, friction=second
            ),
        },
        forces={"load": jn.forces.Torque(("ground", third), "load")},
        drivers={
            f"{fixed}_held": turning(("ground", fixed), "angle", "0"),
            f"{driven}_driven": turning(("ground", driven), "angle", f"{speed}*t"),
        },
        outputs={
            fixed: jn.outputs.DriverTorqueOutput(f"{fixed}_held"),
            driven: jn.outputs.DriverTorqueOutput(f"{driven}_driven"),
        },
    )


def torques_of_mueller(basic, fixed, driven, load, speed=3.0, sun=0.03, planet=0.02):
    """Torques on the three shafts by the basic ratio and efficiency: Mueller, Die Umlaufgetriebe; Pennestri 2012."""
    ratio = -(sun + 2 * planet) / sun
    speeds, weights = {fixed: 0.0, driven: speed}, {"sun": 1.0, "ring": -ratio, "carrier": ratio - 1.0}
    (third,) = {*weights} - {*speeds}
    speeds[third] = -weights[driven] * speed / weights[third]
    for rolling in (1, -1):  # power rolls from the sun, or toward it
        share = {"sun": 1.0, "ring": -ratio * basic**rolling, "carrier": ratio * basic**rolling - 1.0}
        torques = {name: load / share[third] * part for name, part in share.items()}
        if np.sign(torques["sun"] * (speeds["sun"] - speeds["carrier"])) == rolling:
            return torques
    raise AssertionError("power rolls one way or the other")


@pytest.mark.slow
@pytest.mark.parametrize("fixed, driven", [*itertools.permutations(("sun", "ring", "carrier"), 2)])
def test_a_planetary_train_has_the_efficiency_of_mueller(fixed, driven):
    train = planetary(fixed, driven)
    for (one, two), load in itertools.product(BASIC, (5.0, -5.0)):
        expected = torques_of_mueller(one * two, fixed, driven, load)
        found = jn.solve(train.with_parameters(one=one, two=two, load=load), [0.0, 0.3], order=1).outputs
        for name in (fixed, driven):
            np.testing.assert_allclose(found[name][:, 0], expected[name], rtol=1e-12)


def worm(law, load, friction, *, drives="screw", ratio="1/30", frame="ground", **values):
    """A worm about x and its wheel about y, on a frame that may move; what is not driven is loaded."""
    light = {"mass": 0.1, "inertia": [1e-3, 2e-3, 3e-3]}
    (other,) = {"screw", "wheel"} - {drives}
    axes = {"screw": X, "wheel": Y}
    place = {"screw": ORIGIN, "wheel": [0.0, 0.0, -0.06]}
    bodies = {name: jn.Body(place[name], **light) for name in axes}
    joints = {name: jn.spatial.Revolute((frame, name), place[name], ORIGIN, axes[name], axes[name]) for name in axes}
    joints["mesh"] = jn.spatial.Gear(("screw", "wheel", frame), X, Y, ratio, friction=friction)
    drivers = {"turn": jn.drivers.RotationDriver((frame, drives), axes[drives], law)}
    if frame != "ground":
        bodies[frame] = jn.Body(ORIGIN, mass=2.0, inertia=[0.1] * 3)
        joints["swivel"] = jn.spatial.Revolute(("ground", frame), ORIGIN, ORIGIN, [1.0, 2.0, 0.5], [1.0, 2.0, 0.5])
        drivers["swing"] = jn.drivers.RotationDriver(("ground", frame), [1.0, 2.0, 0.5], "0.7*sin(2*t)")
    return jn.Mechanism(
        space="spatial",
        bodies=bodies,
        joints=joints,
        forces={"load": jn.forces.SpatialTorque((frame, other), axes[other], load)},
        drivers=drivers,
        outputs={"torque": jn.outputs.DriverTorqueOutput("turn")},
        **values,
    )


LEAD = np.arctan(0.1)  # 5.7 deg


def friction_of_worm(coefficient, speed=1e-3, **values):
    return jn.joints.GearFriction(speed=speed, coefficient=coefficient, lead_angle=float(LEAD), **values)


@pytest.mark.slow
@pytest.mark.parametrize("coefficient, pressure", [(0.05, None), (0.12, None), (0.05, 0.35), (0.099, 0.2)])
def test_a_worm_drives_and_is_held_by_the_formulas_of_its_thread(coefficient, pressure):
    angle = np.arctan(coefficient / np.cos(pressure or 0.0))
    friction = friction_of_worm(coefficient, **({} if pressure is None else {"pressure_angle": pressure}))
    lifting = jn.solve(worm("3*t", "-60", friction), [0.0, 0.7], order=1).outputs["torque"][:, 0]
    lowering = jn.solve(worm("-3*t", "-60", friction), [0.0, 0.7], order=1).outputs["torque"][:, 0]
    lifted = -60.0 / 30.0  # at the worm, without friction
    signs = np.sign(lifting)
    np.testing.assert_allclose(lifting, signs * abs(lifted) * np.tan(LEAD + angle) / np.tan(LEAD), rtol=1e-10)
    np.testing.assert_allclose(lowering, signs * abs(lifted) * np.tan(LEAD - angle) / np.tan(LEAD), rtol=1e-9)


@pytest.mark.slow
def test_a_wheel_drives_its_worm():
    mechanism = worm("2*t", "-0.5", friction_of_worm(0.05), drives="wheel")
    found = jn.solve(mechanism, [0.0, 0.7], order=1).outputs["torque"][:, 0]
    efficiency = np.tan(LEAD - np.arctan(0.05)) / np.tan(LEAD)
    np.testing.assert_allclose(abs(found), 0.5 * 30.0 / efficiency, rtol=1e-9)


@pytest.mark.slow
def test_a_wheel_locks_on_a_worm_whose_friction_exceeds_its_lead():
    mechanism = worm("2*t", "-0.5", friction_of_worm(0.12), drives="wheel")
    with pytest.raises(jn.errors.SolveError, match=r"friction locks at t = 0 s") as caught:
        _ = jn.solve(mechanism, [0.0, 0.7], order=1).outputs["torque"]
    assert "mesh.friction" in str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize("varied, values", [("mu", [0.05, 0.12, 0.08, 0.0]), ("lead", [0.2, 0.05, 0.12])])
def test_designs_whose_worm_holds_its_wheel_fail_alone(varied, values):
    friction = jn.joints.GearFriction(speed=1e-3, coefficient="mu", lead_angle="lead")
    parameters = {"mu": 0.1, "lead": float(LEAD)}
    driven = worm("2*t", "-0.5", friction, drives="wheel", parameters={**parameters, varied: values[0]})
    found = jn.solve_batch(driven, {varied: values}, [0.0, 0.7], order=1)
    mu, lead = (np.array(values) if name == varied else parameters[name] for name in ("mu", "lead"))
    efficiency = np.tan(lead - np.arctan(mu)) / np.tan(lead)
    status = np.where(efficiency > 0, jn.Status.OK, jn.Status.LOCKED)
    assert set(status.tolist()) == {jn.Status.OK, jn.Status.LOCKED}
    np.testing.assert_array_equal(found["status"], np.stack([status, status], axis=1))
    expected = np.where(efficiency > 0, 0.5 * 30.0 / efficiency, np.nan)
    np.testing.assert_allclose(abs(found["torque"][..., 0]), np.stack([expected, expected], axis=1), rtol=1e-9)


@pytest.mark.slow
def test_a_worm_that_pushes_its_driven_wheel_is_no_lock():
    found = jn.solve(worm("2*t", "0.5", friction_of_worm(0.12), drives="wheel"), [0.0, 0.7], order=1)
    forward = np.tan(LEAD) / np.tan(LEAD + np.arctan(0.12))
    np.testing.assert_allclose(abs(found.outputs["torque"][:, 0]), 0.5 * 30.0 * forward, rtol=1e-10)


@pytest.mark.slow
def test_what_gears_on_a_moving_frame_lose_is_the_balance_of_power():
    friction = jn.joints.GearFriction(speed=0.5, efficiency=0.85, backward=0.6)
    mechanism = worm("3*t + sin(4*t)", "2*sin(5*t)", friction, frame="box", ratio="3/5", gravity=[1.0, 2.0, -9.0])
    balance = jn.energy.power_balance(jn.solve(mechanism, np.linspace(0.0, 1.0, 9), order=5))
    assert (abs(balance["residual"]) <= 1e-12 * balance["scale"]).all()
    assert (balance["friction"].sel(derivative=0) < 0).all()


@pytest.mark.slow
def test_rates_are_open_where_the_torque_passes_zero():
    motion = jn.solve(pair("3*t", "t - 1", ratio=True), [0.5, 1.0, 1.5], order=2)
    still = pair("3*t", "t - 1", ratio=True)
    parts = {name: getattr(still, name) for name in ("space", "joints", "forces", "drivers", "outputs")}
    light = {name: jn.Body(body.position, mass=1.0, inertia=0.1) for name, body in still.bodies.items()}
    motion = jn.solve(jn.Mechanism(**parts, bodies=light), [0.5, 1.0, 1.5], order=2)
    assert np.isfinite(motion.outputs["torque"]).all(axis=1).tolist() == [True, False, True]
    np.testing.assert_allclose(motion.outputs["torque"][:, 0], [0.5 * -0.5 * 0.8, 0.0, 0.25 / 0.9], atol=1e-12)
    assert "what presses mesh passes zero at t = 1 s" in motion.dataset["torque"].attrs["comment"]


@pytest.mark.slow
def test_gradients_by_efficiency_and_coefficient_are_those_of_the_closed_forms():
    import jax

    def torque(x, mechanism):
        return jn.solve(mechanism.with_parameters(x=x), [0.5], order=1).outputs["torque"][0, 0]

    by_parameter = jn.joints.GearFriction(speed=1e-3, efficiency="x")
    parts = pair("3*t", "10", by_parameter, ratio=True)
    values = {name: getattr(parts, name) for name in ("space", "joints", "forces", "drivers", "outputs", "bodies")}
    mechanism = jn.Mechanism(**values, parameters={"x": 0.9})
    assert float(jax.grad(torque)(0.9, mechanism)) == pytest.approx(-(10 * 0.5) / 0.9**2, rel=1e-10)
    thread = jn.joints.GearFriction(speed=1e-3, coefficient="x", lead_angle=float(LEAD))
    values |= {"joints": pair("3*t", "10", thread, ratio=True).joints, "parameters": {"x": 0.05}}
    slope = 5.0 / 0.1 * (1 + 0.1**2) / (1 - 0.1 * 0.05) ** 2  # of 5 N m * (0.1 + x) / (0.1 * (1 - 0.1 x))
    assert float(jax.grad(torque)(0.05, jn.Mechanism(**values))) == pytest.approx(slope, rel=1e-9)


@pytest.mark.parametrize(
    "values, words",
    [
        ({}, "either an efficiency, or a coefficient"),
        ({"efficiency": 0.9, "coefficient": 0.1, "lead_angle": 0.1}, "either an efficiency, or a coefficient"),
        ({"coefficient": 0.1}, "lead_angle"),
        ({"coefficient": 0.1, "lead_angle": 0.1, "backward": 0.5}, "does not go with coefficient"),
        ({"efficiency": 0.9, "pressure_angle": 0.3}, "does not go with efficiency"),
    ],
)
def test_friction_of_gears_that_is_not_whole_is_refused(values, words):
    with pytest.raises(jn.errors.MechanismError, match=words):
        jn.joints.GearFriction(speed=1.0, **values)


@pytest.mark.parametrize(
    "values, words",
    [
        ({"efficiency": 0.0}, "efficiency: must be above 0 and at most 1"),
        ({"efficiency": 1.01}, "efficiency: must be above 0 and at most 1"),
        ({"efficiency": 0.9, "backward": 1.1}, "backward: must be at most 1"),
        ({"coefficient": -0.1, "lead_angle": 0.1}, "coefficient: must not be negative"),
        ({"coefficient": 0.1, "lead_angle": 1.6}, "lead_angle: must be above 0 and below 90 deg"),
        ({"coefficient": 0.3, "lead_angle": 1.4}, "friction: the worm cannot drive its wheel"),
        ({"efficiency": 0.9, "speed": 0.0}, "speed: must be greater than zero"),
    ],
)
def test_values_that_cannot_be_are_refused_by_name(values, words):
    friction = jn.joints.GearFriction(**{"speed": 1.0, **values})
    with pytest.raises(jn.errors.MechanismError, match=words):
        jn.solve(pair(friction=friction, ratio=True), [0.0], order=1)


def test_a_gear_has_friction_of_gears_and_a_pin_that_of_pins():
    with pytest.raises(jn.errors.MechanismError, match=r"must be a jn\.joints\.GearFriction"):
        pair(friction=jn.joints.Friction(0.1, 1e-3))
    gears = jn.joints.GearFriction(speed=1.0, efficiency=0.9)
    with pytest.raises(jn.errors.MechanismError, match=r"must be a jn\.joints\.Friction"):
        jn.planar.Revolute(("ground", "crank"), [0, 0], [0, 0], friction=gears)


def test_the_efficiency_of_a_worm_in_many_digits():
    with mp.workdps(30):
        rise, angle = mp.atan(mpf("0.1")), mp.atan(mpf("0.07") / mp.cos(mpf("0.35")))
        expected = mp.tan(rise) / mp.tan(rise + angle), mp.tan(rise - angle) / mp.tan(rise)
    found = friction_of_worm(0.07, pressure_angle=0.35).efficiencies
    np.testing.assert_allclose(np.array(found, float), np.array(expected, float), rtol=1e-13)
