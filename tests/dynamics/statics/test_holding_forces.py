"""The range of forces that hold a mechanism with friction at rest: closed forms, friction circles, and a search."""

import dataclasses
import itertools

import numpy as np
import pytest
from scipy.optimize import minimize

import jounce as jn
from tests.dynamics.inverse.test_friction import ORIGIN, UP, screw_jack, slider_crank, vars_of, wedge
from tests.dynamics.inverse.test_gear_friction import (
    BASIC,
    LEAD,
    friction_of_worm,
    pair,
    planetary,
    torques_of_mueller,
    worm,
)
from tests.oracles import friction_circles
from tests.oracles.friction_circles import CIRCLES, COUPLER, CRANK, GROUND, ROCKER

pytestmark = pytest.mark.long


def held(mechanism, name, time=0.0):
    """Return least, frictionless and greatest force of a driver at an instant."""
    return jn.dynamics.holding_forces(jn.solve(mechanism, [time], order=0))[name].values[0]


def sled(mu=0.3, angle=0.4, turned=0.0, load="0*t"):
    """A sled of 2 kg on a slope, everything turned in the plane."""
    up = angle + turned
    along = [np.cos(up), np.sin(up)]
    return jn.Mechanism(
        space="planar",
        gravity=[10 * np.sin(turned), -10 * np.cos(turned)],
        parameters={"mu": mu},
        bodies={"sled": jn.Body([0, 0], angle=up, mass=2.0)},
        joints={
            "guide": jn.planar.Prismatic(
                ("ground", "sled"), [0, 0], [0, 0], along, [1, 0], friction=jn.joints.Friction("mu", 0.05)
            )
        },
        drivers={"push": jn.drivers.SlideDriver(("ground", "sled"), [0, 0], [0, 0], along, "3*t")},
        forces={"wind": jn.forces.PointForce("sled", [0, 0], [load, "0"])},
    )


@pytest.mark.parametrize("mu", [0.0, 0.3, np.tan(0.4), 0.6])
@pytest.mark.parametrize("turned", [0.0, 2.0])
def test_a_sled_on_a_slope_stays_by_itself_where_its_slope_is_less_than_friction(mu, turned):
    found = held(sled(mu, turned=turned), "push")
    expected = 20 * (np.sin(0.4) + mu * np.cos(0.4) * np.array([-1, 0, 1]))
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)
    assert (found[0] <= 1e-12) == (mu >= np.tan(0.4))


@pytest.mark.slow
def test_the_range_is_that_of_each_position_and_of_the_loads_there():
    found = jn.dynamics.holding_forces(jn.solve(sled(load="5*t*t"), [0.0, 2.0], order=0))["push"]
    size = [20 * np.cos(0.4), 20 * np.cos(0.4) + 20 * np.sin(0.4)]
    plain = [20 * np.sin(0.4), 20 * np.sin(0.4) - 20 * np.cos(0.4)]
    np.testing.assert_allclose(found, np.array([plain]).T + 0.3 * np.outer(size, [-1, 0, 1]), rtol=1e-12)
    assert found.dims == ("time", "bound")
    assert found.attrs == {"units": "N"}
    assert list(found["bound"].values) == ["least", "frictionless", "greatest"]


def test_values_of_parameters_are_followed_and_an_equilibrium_has_a_range_too():
    changing = sled()
    for mu in (0.3, np.float64(0.5), np.array(0.2)):
        found = jn.dynamics.holding_forces(jn.equilibrium(changing.with_parameters(mu=mu)).motion)["push"].values[0]
        np.testing.assert_allclose(found, 20 * (np.sin(0.4) + mu * np.cos(0.4) * np.array([-1, 0, 1])), rtol=1e-12)


@pytest.mark.parametrize("mu", [0.2, 1.0, 1.9, 2.0, 2.5, 40.0])
def test_a_wedge_locks_where_friction_grows_as_fast_as_what_presses(mu):
    found = held(
        wedge(mu), "push"
    )  # the lift presses its guide with the half of what carries it, 30 N without friction
    push = 15 / (1 - 0.5 * mu) if mu < 2 else np.inf
    np.testing.assert_allclose(found, [-push, -15, -15 / (1 + 0.5 * mu)], rtol=1e-11)


@pytest.mark.slow
def test_where_friction_locks_the_comment_says_so_also_without_a_load():
    found = jn.dynamics.holding_forces(jn.solve(wedge(2.5), [0.0, 1.0], order=0))["push"]
    assert found.attrs["comment"] == "friction locks, no force moves it one way, at t = 0 s, 1 s"
    parts = {**vars_of(wedge(2.5)), "gravity": None}
    idle = jn.Mechanism(**parts, joints=wedge(2.5).joints)
    np.testing.assert_array_equal(held(idle, "push"), [-np.inf, 0, np.inf])
    parts = {**vars_of(wedge(1.5)), "gravity": None}
    np.testing.assert_array_equal(held(jn.Mechanism(**parts, joints=wedge(1.5).joints), "push"), [0, 0, 0])


@pytest.mark.slow
def test_a_wedge_that_friction_locks_one_way_moves_the_other_way():
    parts = vars_of(wedge(2.5))
    down = jn.drivers.CoordinateDriver(("ground", "wedge"), "x", motion="0.3*t")
    falling = jn.Mechanism(**parts | {"drivers": {"push": down}}, joints=wedge(2.5).joints)
    np.testing.assert_allclose(
        jn.solve(falling, [0.0], order=1).outputs["force"], [[-15 / 2.25, 0]], rtol=1e-12, atol=1e-12
    )


@pytest.mark.parametrize("mu", [0.05, 0.12])
@pytest.mark.slow
def test_a_screw_jack_holds_its_load_by_itself_where_friction_exceeds_the_lead(mu):
    rise, angle = np.arctan(0.005 / (2 * np.pi * 0.01)), np.arctan(mu)
    found = held(screw_jack(mu, "2*t"), "turn")  # lifts where it turns backward
    expected = -1000 * 0.01 * np.tan([rise + angle, rise, rise - angle])
    np.testing.assert_allclose(found, expected, rtol=1e-10)
    assert (found[0] < 0 < found[2]) == (mu > np.tan(rise))


def four_bar(angle, moment):
    """A four-bar of bodies without weight, a moment on its rocker, held by its crank; mu is 0.2."""
    pins = {name: jn.joints.Friction(0.2, 1e-3, size / 0.2) for name, size in CIRCLES.items()}
    return jn.Mechanism(
        space="planar",
        bodies={
            "crank": jn.Body([0, 0], angle=angle),
            "coupler": jn.Body([CRANK * np.cos(angle), CRANK * np.sin(angle)], angle=0.6),
            "rocker": jn.Body([GROUND, 0], angle=1.5),
        },
        joints={
            "A": jn.planar.Revolute(("ground", "crank"), [0, 0], [0, 0], friction=pins["A"]),
            "B": jn.planar.Revolute(("crank", "coupler"), [CRANK, 0], [0, 0], friction=pins["B"]),
            "C": jn.planar.Revolute(("rocker", "coupler"), [ROCKER, 0], [COUPLER, 0], friction=pins["C"]),
            "D": jn.planar.Revolute(("ground", "rocker"), [GROUND, 0], [0, 0], friction=pins["D"]),
        },
        drivers={"turn": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", motion=angle)},
        forces={"load": jn.forces.Torque(("ground", "rocker"), moment)},
    )


@pytest.mark.parametrize("angle", [0.4, 1.9, 4.0])
@pytest.mark.parametrize("moment", [3.0, -2.0])
def test_a_four_bar_by_friction_circles(angle, moment):
    found, torques = held(four_bar(angle, moment), "turn"), friction_circles.torques(angle, moment)
    np.testing.assert_allclose(found[[0, 2]], [torques.min(), torques.max()], rtol=1e-11)


def torque_at_rest(crank):
    """Return the torque of the slider-crank of `slider_crank` at rest, and its reactions, linear in its friction.

    Columns: without friction, for a moment of one in the pins O, A and B, and for a force of one in the guide, each
    against slip in the sense of the second body; rows: the torque, the components in O, A and B, and of the guide.
    """
    rod = -np.arcsin(0.1 * np.sin(crank) / 0.3)
    matrix, load = np.zeros((8, 8)), np.zeros((8, 5))
    matrix[0, 1] = matrix[1, 2] = 1  # crank: O - A carries its weight
    matrix[0, 3] = matrix[1, 4] = -1
    load[1, 0] = 9.81
    matrix[2, 0], matrix[2, 3], matrix[2, 4] = 1, 0.1 * np.sin(crank), -0.1 * np.cos(crank)
    load[2, 1], load[2, 2] = 1, -1
    matrix[3, 3] = matrix[4, 4] = 1  # rod: A - B carries its weight
    matrix[3, 5] = matrix[4, 6] = -1
    load[4, 0] = 0.7 * 9.81
    matrix[5, 3], matrix[5, 4] = 0.12 * np.sin(rod), -0.12 * np.cos(rod)
    matrix[5, 5], matrix[5, 6] = 0.18 * np.sin(rod), -0.18 * np.cos(rod)
    load[5, 2], load[5, 3] = 1, -1
    matrix[6, 5] = matrix[7, 6] = matrix[7, 7] = 1  # piston
    load[7, 0] = 2 * 9.81
    load[6, 4] = 1
    return np.linalg.solve(matrix, load)


def by_search(crank, mu, sign):
    """Return the largest, or least, torque over all friction within its cones, by sequential quadratic programs."""
    whole = torque_at_rest(crank)
    radii = np.array([0.012, 0.012, 0.012, 1.0])

    def room(f):  # f in newtons, in each joint
        found = whole @ np.array([1.0, *(f * radii)])
        pressed = np.hypot(found[[1, 3, 5]], found[[2, 4, 6]])
        return (mu * np.array([*pressed, abs(found[7])])) ** 2 - f**2

    def torque(f):
        return -sign * (whole @ np.array([1.0, *(f * radii)]))[0]

    best = -np.inf
    for start in itertools.product((0.9, -0.9), repeat=4):
        first = mu * np.array(start) * 20.0
        found = minimize(
            torque, first, method="SLSQP", constraints={"type": "ineq", "fun": room}, options={"ftol": 1e-15}
        )
        if room(found.x).min() > -1e-7:
            best = max(best, -found.fun)
    return sign * best


@pytest.mark.slow
@pytest.mark.parametrize("crank", [0.9, np.pi / 2, np.pi / 2 + 0.01, np.pi])
@pytest.mark.parametrize("mu", [0.1, 0.5])
def test_a_slider_crank_by_a_search_of_all_friction_also_where_a_joint_does_not_slip(crank, mu):
    free = slider_crank(mu)
    driver = jn.drivers.CoordinateDriver(("ground", "crank"), "angle", motion=crank)
    mechanism = jn.Mechanism(
        **vars_of(free) | {"drivers": {"turn": driver}, "outputs": {}}, joints=free.joints, parameters=free.parameters
    )
    found = held(mechanism, "turn")
    np.testing.assert_allclose(found[1], torque_at_rest(crank)[0, 0], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(found[[0, 2]], [by_search(crank, mu, -1), by_search(crank, mu, 1)], rtol=2e-7)


@pytest.mark.slow
def test_a_press_is_held_between_what_slow_strokes_take_both_ways():
    press = jn.load("examples/press_with_friction.yaml").with_parameters(slow=1e-12)
    instants = [0.2, 0.7, 1.1]
    held_by = jn.dynamics.holding_forces(jn.solve(press, instants, order=0))["motor"].values
    angles = jn.solve(press, instants, order=0).driver("motor").values[:, 0]
    blank = dict(press.forces)
    blank["blank"] = jn.forces.SlideForce(("ground", "ram"), [0, 0.162], [0, 0], [0, -1], press.forces["blank"].law)
    for angle, bounds in zip(angles, held_by, strict=True):
        slow = []
        for way in (-1e-6, 1e-6):
            driver = jn.drivers.CoordinateDriver(("ground", "flywheel"), "angle", motion=f"{angle} + {way}*t")
            moved = jn.Mechanism(
                space="planar", gravity=press.gravity, parameters=press.parameter_values, bodies=press.bodies,
                joints=press.joints, drivers={"motor": driver}, forces=blank,
            )  # fmt: skip
            slow.append(float(jn.driver_force(jn.solve(moved, [0.0], order=2), "motor")[0, 0]))
        np.testing.assert_allclose(bounds[[0, 2]], sorted(slow), rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("coefficient", [0.0, 0.05, 0.12])
def test_a_worm_holds_between_the_formulas_of_its_thread(coefficient):
    """Of 0.12 it holds by itself, and its wheel moves it no way against its load."""
    rho = np.arctan(coefficient)
    found = held(worm("0.7 + 2*t", "-60", friction_of_worm(coefficient)), "turn")
    expected = 60.0 / 30.0 * np.tan([LEAD - rho, LEAD, LEAD + rho]) / np.tan(LEAD)
    np.testing.assert_allclose(np.sort(found * np.sign(found[1])), expected, rtol=1e-11, atol=1e-12)
    assert (found[0] <= 0 <= found[2]) == (coefficient > 0.1)
    pushed = held(worm("0.3*t", "-0.5", friction_of_worm(coefficient), drives="wheel"), "turn")
    pushed = np.sort(pushed * np.sign(pushed[1]))
    back = np.tan(LEAD - rho) / np.tan(LEAD)
    most = 15.0 / back if back > 0 else np.inf
    np.testing.assert_allclose(pushed, [15.0 * np.tan(LEAD) / np.tan(LEAD + rho), 15.0, most], rtol=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("fixed, driven", [("ring", "sun"), ("carrier", "ring"), ("sun", "carrier")])
def test_a_planetary_train_holds_between_what_it_takes_to_turn_it_both_ways(fixed, driven):
    train = planetary(fixed, driven)
    for (one, two), load in itertools.product(BASIC, (5.0, -5.0)):
        found = held(train.with_parameters(one=one, two=two, load=load), f"{driven}_driven")
        ways = [torques_of_mueller(one * two, fixed, driven, load, speed)[driven] for speed in (3.0, -3.0)]
        np.testing.assert_allclose(found[[0, 2]], np.sort(ways), rtol=1e-11)
        np.testing.assert_allclose(found[1], torques_of_mueller(1.0, fixed, driven, load)[driven], rtol=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("load", ["-10", "7"])
@pytest.mark.parametrize("rubs", [False, True])
def test_gears_hold_between_slow_motions_also_with_friction_in_their_bearings(load, rubs):
    def made(law):
        gears = pair(law, load, jn.joints.GearFriction(speed=1e-12, efficiency=0.9, backward=0.65))
        pins = {n: dataclasses.replace(gears.joints[n], friction=jn.joints.Friction(0.2, 1e-12, 0.01)) for n in "AB"}
        return dataclasses.replace(gears, joints={**gears.joints, **pins}) if rubs else gears

    found = held(made("0.4 + 0*t"), "turn")
    slow = [float(jn.solve(made(f"0.4 + {v}*t"), [0.0], order=1).outputs["torque"][0, 0]) for v in (-1e-6, 1e-6)]
    np.testing.assert_allclose(found[[0, 2]], np.sort(slow), rtol=1e-9)
    frictionless = dataclasses.replace(pair("0.4 + 0*t", load, jn.joints.GearFriction(speed=1.0, efficiency=1.0)))
    np.testing.assert_allclose(found[1], held(frictionless, "turn")[1], rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("weight", [30.0, pytest.param(-30.0, marks=pytest.mark.slow)])
def test_a_rack_and_a_belt_hold_between_their_efficiencies(weight):
    """A rack on a disc of 0.05 m, which a belt turns from a pulley of a third of its size: 0.5 N m at the disc."""
    o, loss = [0, 0], {"speed": 1.0, "efficiency": 0.8, "backward": 0.7}
    machine = jn.Mechanism(
        space="planar",
        bodies={"motor": jn.Body([0, 0.5]), "disc": jn.Body([0, 0]), "rack": jn.Body([0, 0.05], mass=1.0)},
        joints={
            "M": jn.planar.Revolute(("ground", "motor"), [0, 0.5], o),
            "D": jn.planar.Revolute(("ground", "disc"), o, o),
            "R": jn.planar.Prismatic(("ground", "rack"), [0, 0.05], o, [1, 0], [1, 0]),
            "belt": jn.planar.Belt(("motor", "disc"), o, o, 0.02, 0.06, friction=jn.joints.GearFriction(**loss)),
            "teeth": jn.planar.Rolling(("rack", "disc"), o, o, [1, 0], 0.05, friction=jn.joints.GearFriction(**loss)),
        },
        forces={"pull": jn.forces.PointForce("rack", o, [f"{weight}", "0"])},
        drivers={"turn": jn.drivers.CoordinateDriver(("ground", "motor"), "angle", "0*t")},
    )
    found = np.sort(np.abs(held(machine, "turn")))
    np.testing.assert_allclose(found, 0.5 * np.array([0.7**2, 1.0, 1 / 0.8**2]), rtol=1e-11)


def ball_and_sleeve():
    rubbing = jn.joints.Friction(0.2, 0.5, 0.05)
    x, y = [1.0, 0, 0], [0, 1.0, 0]
    return jn.Mechanism(
        space="spatial",
        gravity=[0, 0, -10.0],
        bodies={
            "ball": jn.Body(ORIGIN, mass=3.0, inertia=[0.2] * 3),
            "rod": jn.Body(ORIGIN, mass=2.0, inertia=[0.1] * 3),
            "puck": jn.Body(ORIGIN, mass=4.0, inertia=[0.1] * 3),
        },
        joints={
            "socket": jn.spatial.Spherical(("ground", "ball"), ORIGIN, ORIGIN, friction=rubbing),
            "level": jn.spatial.Dot1(("ground", "ball"), UP, x),
            "square": jn.spatial.Dot1(("ground", "ball"), UP, y),
            "sleeve": jn.spatial.Cylindrical(("ground", "rod"), ORIGIN, ORIGIN, x, x, friction=rubbing),
            "table": jn.spatial.PlaneOnPlane(
                ("ground", "puck"), ORIGIN, ORIGIN, UP, UP, friction=jn.joints.Friction(0.3, 0.1)
            ),
        },
        drivers={
            "turn": jn.drivers.RotationDriver(("ground", "ball"), UP, "3*t + t**2"),
            "roll": jn.drivers.RotationDriver(("ground", "rod"), x, "4*t"),
            "push": jn.drivers.SpatialSlideDriver(("ground", "rod"), ORIGIN, ORIGIN, x, "0.3*t + 0.1*t**2"),
            "aside": jn.drivers.SpatialSlideDriver(("ground", "puck"), ORIGIN, ORIGIN, [1, 1, 0], "t"),
            "along": jn.drivers.SpatialSlideDriver(("ground", "puck"), ORIGIN, ORIGIN, [1, -1, 0], "t"),
            "spin": jn.drivers.RotationDriver(("ground", "puck"), UP, "t"),
        },
    )


@pytest.mark.slow
def test_friction_of_two_directions_does_all_it_can_in_one_of_them():
    found = jn.dynamics.holding_forces(jn.solve(ball_and_sleeve(), [0.0, 0.3], order=0))
    expected = {"turn": 0.05 * 0.2 * 30, "roll": 0.05 * 0.2 * 20, "push": 0.2 * 20, "aside": 0.3 * 40, "spin": 0.0}
    for name, most in (expected | {"along": 12.0}).items():
        np.testing.assert_allclose(found[name], [[-most, 0, most]] * 2, rtol=1e-10, atol=1e-12, err_msg=name)
        assert "comment" not in found[name].attrs
        assert found[name].attrs["units"] == ("N*m" if name in ("turn", "roll", "spin") else "N")


@pytest.mark.slow
def test_friction_of_two_directions_that_a_motion_joins():
    """A puck on a slope, held along a line across the slope: friction helps along the line alone, and all of it."""
    slope, mu, line = 0.5, 0.4, 0.7
    tilted = [0.0, -np.sin(slope), np.cos(slope)]
    side, uphill = np.array([1.0, 0, 0]), np.array([0.0, np.cos(slope), np.sin(slope)])
    along, across = np.cos(line) * side + np.sin(line) * uphill, -np.sin(line) * side + np.cos(line) * uphill
    mechanism = jn.Mechanism(
        space="spatial",
        gravity=[0, 0, -10.0],
        bodies={"puck": jn.Body(ORIGIN, orientation={"axis": [1, 0, 0], "angle": slope}, mass=4.0, inertia=[0.1] * 3)},
        joints={
            "table": jn.spatial.PlaneOnPlane(
                ("ground", "puck"), ORIGIN, ORIGIN, tilted, UP, friction=jn.joints.Friction(mu, 0.1)
            ),
            "rail": jn.spatial.Dot2(("ground", "puck"), ORIGIN, ORIGIN, across.tolist()),
        },
        drivers={
            "push": jn.drivers.SpatialSlideDriver(("ground", "puck"), ORIGIN, ORIGIN, along.tolist(), "0*t"),
            "spin": jn.drivers.RotationDriver(("ground", "puck"), tilted, "0*t"),
        },
    )
    normal, down = 40 * np.cos(slope), 40 * np.sin(slope)
    found = held(mechanism, "push")
    np.testing.assert_allclose(found, np.sin(line) * down + mu * normal * np.array([-1, 0, 1]), rtol=1e-10)


@pytest.mark.slow
def test_what_has_no_range_is_refused_by_name():
    parts = {"space": "planar", "gravity": [0, -10], "parameters": {"mu": 0.3}, "bodies": sled().bodies}
    single = jn.Mechanism(**parts, joints=sled().joints)
    with pytest.raises(jn.errors.MechanismError, match="holding forces are those of drivers, and there are none"):
        jn.dynamics.holding_forces(jn.simulate(single, [0.0, 0.1]))
    parts["bodies"] = {**parts["bodies"], "other": jn.Body([5, 0], mass=1.0)}
    swing = {**single.joints, "pin": jn.planar.Revolute(("ground", "other"), [5, 0], [0.5, 0])}
    loose = jn.Mechanism(**parts, joints=swing, drivers=sled().drivers)
    with pytest.raises(jn.errors.UnsupportedError, match=r"joints\.guide\.friction: .* drivers do not hold all"):
        jn.dynamics.holding_forces(jn.simulate(loose, [0.0, 0.1]))
    twice = {**single.joints, "again": jn.planar.Parallel1(("ground", "sled"), [1, 0], [np.cos(0.4), -np.sin(0.4)])}
    held_twice = jn.Mechanism(**{**parts, "bodies": sled().bodies}, joints=twice, drivers=sled().drivers)
    with pytest.raises(jn.errors.UnsupportedError, match="friction follows reactions, and redundant constraints"):
        jn.dynamics.holding_forces(jn.solve(held_twice, [0.0], order=0))


def test_a_mechanism_without_friction_has_one_force():
    single = dataclasses.replace(sled().joints["guide"], friction=None)
    found = held(jn.Mechanism(**{**vars_of(sled()), "joints": {"guide": single}}), "push")
    np.testing.assert_allclose(found, 20 * np.sin(0.4) * np.ones(3), rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("load", [10.0, -10.0])
def test_flanks_do_not_change_what_gears_lose(load):
    gears = toothed(friction=jn.joints.GearFriction(1e-3, 0.9, 0.8), load=load)
    least, middle, most = held(gears, "turn")
    np.testing.assert_allclose([least, middle, most], np.sort([load / 2 * 0.8, load / 2, load / 2 / 0.9]))


def toothed(pin=None, friction=None, load=0.0):
    """A pair of gears of 0.1 and 0.2 m with a pressure angle, which the first drives."""
    return jn.Mechanism(
        space="planar",
        bodies={"a": jn.Body([0, 0], mass=1.0, inertia=0.1), "b": jn.Body([0.3, 0], mass=1.0, inertia=0.1)},
        joints={
            "A": jn.planar.Revolute(("ground", "a"), [0, 0], [0, 0], friction=pin),
            "B": jn.planar.Revolute(("ground", "b"), [0.3, 0], [0, 0]),
            "mesh": jn.planar.Gear(
                ("a", "b"),
                point_i=[0, 0],
                point_j=[0, 0],
                radius_i=0.1,
                radius_j=0.2,
                pressure_angle=0.35,
                friction=friction,
            ),
        },
        drivers={"turn": jn.drivers.CoordinateDriver(("ground", "a"), "angle", motion="t")},
        forces={"load": jn.forces.Torque(("ground", "b"), load)},
    )


@pytest.mark.slow
def test_teeth_that_press_on_either_flank_have_no_range_with_friction():
    with pytest.raises(jn.errors.UnsupportedError, match=r"joints\.A\.friction: .* teeth press on either flank"):
        held(toothed(pin=jn.joints.Friction(0.1, 1e-3, 0.01)), "turn")


def test_a_gradient_is_refused():
    import jax

    def least(mu):
        return jn.dynamics.holding_forces(jn.solve(sled().with_parameters(mu=mu), [0.0], order=0))["push"].values[0, 0]

    with pytest.raises(jn.errors.UnsupportedError, match="they are not differentiated by JAX"):
        jax.grad(least)(0.3)
