"""The mechanisms of the gallery run to their end, and move as their closed forms say, to the jounce."""

import importlib.util
import pathlib

import numpy as np
import pytest
from mpmath import mp

import jounce as jn
from tests.examples import closed_forms
from tests.oracles import mp_robot

EXAMPLES = pathlib.Path(__file__).parents[2] / "examples"
ORDER = 4


@pytest.fixture(autouse=True)
def _many_digits():
    with mp.workdps(30):
        yield


def solved(name):
    """Return the motion at all instants of the file; what is not solved at one of them is an error."""
    return jn.solve(jn.load(EXAMPLES / f"{name}.yaml"), order=ORDER)


def places(motion, time):
    """Return the indices of the instants nearest to some."""
    return [int(np.argmin(np.abs(motion.time - t))) for t in time]


def exact(closed_form, time, output, order=ORDER):
    """Return derivatives of a closed form, (time, order + 1) or (time, order + 1, components)."""
    rows = []
    for t in time:
        found = closed_form(closed_forms.at(t, order))[output]
        parts = found if isinstance(found, list) else [found]
        columns = [[float(d) for d in part.derivatives()] for part in parts]
        rows.append(np.transpose(columns) if isinstance(found, list) else columns[0])
    return np.array(rows)


def near(found, expected, tolerance=1e-12):
    """Assert that derivatives agree, each to a tolerance of the largest value of its order."""
    found, expected = np.asarray(found), np.asarray(expected)
    assert found.shape == expected.shape
    for k in range(found.shape[1]):
        assert np.abs(found[:, k] - expected[:, k]).max() <= tolerance * np.abs(expected[:, k]).max(), f"derivative {k}"


def agrees(name, closed_form, time, *outputs, tolerance=1e-12):
    motion = solved(name)
    some = places(motion, time)
    for output in outputs:
        near(motion.outputs[output][some], exact(closed_form, motion.time[some], output), tolerance)
    return motion


@pytest.mark.slow
def test_peaucelliers_point_draws_a_straight_line():
    time = np.linspace(0.0, 1.9, 20)
    motion = agrees("peaucellier", closed_forms.peaucellier, time, "P", "B")
    P = motion.outputs["P"]
    size = np.ptp(P[:, 0, 1])
    assert size > 0.2
    assert np.abs(P[:, 0, 0] - 0.224).max() < 1e-12 * size
    for k in range(1, ORDER + 1):
        assert np.abs(P[:, k, 0]).max() < 1e-12 * np.abs(P[:, k, 1]).max()


@pytest.mark.slow
def test_pantograph_enlarges_by_its_ratio_in_every_derivative():
    time = np.linspace(0.0, 1.9, 20)
    motion = solved("pantograph")
    near(motion.outputs["Q"], 2.5 * motion.outputs["P"])
    some = places(motion, time)
    stylus = exact(
        lambda t: {"P": [0.22 + 0.04 * closed_forms.sin(mp.pi * t), 0.04 + 0.03 * closed_forms.sin(2 * mp.pi * t)]},
        motion.time[some],
        "P",
    )
    near(motion.outputs["P"][some], stylus)


@pytest.mark.slow
def test_jansens_foot_is_where_circles_meet():
    agrees("jansen_leg", closed_forms.jansen, [0.0, 0.31, 0.7, 1.2, 1.77], "foot")


@pytest.mark.slow
def test_klanns_foot_is_where_circles_meet():
    agrees("klann_leg", closed_forms.klann, [0.0, 0.31, 0.7, 1.2, 1.77], "foot", "knee")


@pytest.mark.slow
def test_stephenson_six_bar_dwells():
    motion = agrees("six_bar_stephenson", closed_forms.stephenson, [0.05, 0.67, 1.28, 1.67], "P", "F", "output_angle")
    crank = np.degrees(motion.outputs["crank_angle"][:, 0])
    output = np.degrees(motion.outputs["output_angle"][:, 0])
    assert np.ptp(output) > 25
    assert np.ptp(output[(crank >= 120) & (crank <= 240)]) < 0.25


@pytest.mark.slow
def test_pistons_of_the_radial_engine():
    strokes = [f"stroke{k}" for k in range(1, 6)]
    agrees("radial_engine", closed_forms.radial_engine, [0.0, 0.013, 0.037, 0.06, 0.088], *strokes)


@pytest.mark.slow
def test_wolfrom_train_by_willis():
    time = [0.2, 0.9, 1.6]
    motion = agrees("wolfrom_train", closed_forms.wolfrom, time, "sun_angle", "carrier_angle", "output_angle")
    near(motion.outputs["output_angle"] * 76, motion.outputs["sun_angle"])


@pytest.mark.slow
def test_epicyclic_gear_by_willis():
    time = [0.0, 0.2, 0.9, 1.6]
    motion = solved("epicyclic")
    some = places(motion, time)
    for output, start in (("ring", 5), ("planet", 10)):
        angle = motion.outputs[f"{output}_angle"][some]
        angle[:, 0] -= np.radians(start)  # where the guess of the file has it
        near(angle, exact(closed_forms.epicyclic, motion.time[some], output))


@pytest.mark.slow
def test_valve_follows_the_lift_law_of_its_cam():
    spec = importlib.util.spec_from_file_location("valve_train", EXAMPLES / "valve_train.py")
    spec.loader.exec_module(importlib.util.module_from_spec(spec))
    time = [0.0, 0.025, 0.03, 0.033, 0.038]
    agrees("own_joint/valve_train", closed_forms.valve_train, time, "tappet", "valve")


@pytest.mark.slow
def test_excavator_and_the_power_of_its_cylinders():
    time = [0.0, 1.7, 3.9, 6.2]
    motion = solved("excavator")
    some = places(motion, time)
    time = motion.time[some]
    near(motion.outputs["teeth"][some], exact(lambda t: closed_forms.excavator(t)[0], time, "teeth"))
    forces = [motion.outputs[f"{name}_force"][some] for name in ("boom", "stick", "bucket")]
    power, expected = [], []
    for n, t in enumerate(time):
        _, energy, lengths = closed_forms.excavator(closed_forms.at(t, ORDER))
        expected.append([float(d) for d in energy.derivatives()[1:4]])
        rates = [[float(d) for d in x.derivatives()[1:]] for x in lengths]
        pairs = [(force[n], rate) for force, rate in zip(forces, rates, strict=True)]
        power.append(
            [
                sum(F[0] * v[0] for F, v in pairs),
                sum(F[1] * v[0] + F[0] * v[1] for F, v in pairs),
                sum(F[2] * v[0] + 2 * F[1] * v[1] + F[0] * v[2] for F, v in pairs),
            ]
        )
    near(power, expected, 1e-11)


@pytest.mark.slow
def test_double_cardan_shaft_turns_evenly_at_its_ends():
    time = [0.0, 0.3, 0.8, 1.4, 1.9]
    agrees("double_cardan", closed_forms.double_cardan, time, "theta", "psi", "middle_angle", tolerance=1e-11)


@pytest.mark.slow
def test_delta_robot_meets_three_spheres_and_stays_level():
    time = [0.0, 0.2, 0.45, 0.6, 0.9]
    motion = agrees("delta_robot", closed_forms.delta, time, "platform", tolerance=1e-11)
    speed = np.abs(motion.outputs["platform"][:, 1:]).max(axis=(0, 2))
    spin = np.abs(motion.outputs["spin"][:, :ORDER]).max(axis=(0, 2))
    assert (spin < 1e-11 * speed[:ORDER] / 0.05).all()


@pytest.mark.slow
def test_motors_of_the_delta_robot_follow_its_platform():
    angles = ("motor1", "motor2", "motor3")
    agrees("delta_pick", closed_forms.delta_pick, [0.04, 0.1, 0.15], *angles, tolerance=1e-11)


@pytest.mark.slow
def test_torques_of_the_human_arm_by_virtual_work():
    robot = jn.load_robot(EXAMPLES / "robots" / "human_arm.xml")
    reach = jn.load_trajectory(EXAMPLES / "trajectories" / "human_arm_reach.yaml")
    assert list(robot.joint_names) == list(reach.names)
    q = np.asarray(reach.derivatives([0.2, 0.55], order=4))
    frame = {"type": "revolute"}
    flat = [("0.02307", "0.00555"), ("0.00719", "0.00115"), ("0.00142", "0.00054")]
    segments = [
        {"mass": mass, "center": [0, 0, center], "inertia": [[across, 0, 0], [0, across, 0], [0, 0, along]]}
        for mass, center, (across, along) in zip(
            ("2.1", "1.2", "0.45"), ("-0.1419", "-0.1099", "-0.0956"), flat, strict=True
        )
    ]
    places = [[0, "-0.2", "1.43"], None, None, [0, 0, "-0.3255"], None, [0, 0, "-0.2555"], None]
    axes = [[-1, 0, 0], [0, -1, 0], [0, 0, 1], [0, -1, 0], [0, 0, 1], [0, -1, 0], [1, 0, 0]]
    carried = {2: segments[0], 4: segments[1], 6: segments[2]}
    bodies = [
        frame | {"parent": k - 1, "axis": axis, "position": place or [0, 0, 0]} | carried.get(k, {})
        for k, (axis, place) in enumerate(zip(axes, places, strict=True))
    ]
    arm = mp_robot.from_numbers(bodies)
    expected = []
    for sample in q:
        found = mp_robot.State(arm, [mp_robot.motion(column) for column in sample.T]).forces()
        expected.append(np.array([[float(d) for d in torque.derivatives()] for torque in found]).T)
    near(jn.inverse_dynamics(robot, q), expected)


@pytest.mark.slow
def test_the_pin_of_a_barrel_cam_takes_the_power_of_its_motor():
    """Of the slide at a cos(2 w t): its spring and its inertia, times the slope of the groove, are the torque."""
    motion = solved("barrel_cam")
    speed, half = 4 * np.pi, 0.025
    angle = 2 * speed * motion.time
    push = 2000.0 * (0.2 + half * np.cos(angle) - 0.15) - 3.0 * half * (2 * speed) ** 2 * np.cos(angle)
    torque = -push * 2 * half * np.sin(angle)
    np.testing.assert_allclose(motion.outputs["pin"][:, 0, 0], half * np.cos(angle), rtol=0, atol=1e-14)
    np.testing.assert_allclose(motion.outputs["press"][:, 0, 0], push, rtol=1e-11)
    np.testing.assert_allclose(motion.outputs["torque"][:, 0], torque, rtol=0, atol=1e-11 * np.abs(torque).max())


@pytest.mark.slow
def test_planets_share_their_load_by_least_norm():
    """90 N m at 54 mm, and what accelerates the carrier; a third of it on each pin, along its path."""
    motion = solved("planetary_train")
    arm, made = 0.054, motion.mechanism
    pins = {f"pin{k}": jn.outputs.JointForceOutput(f"pin{k}", f"planet{k}") for k in (1, 2, 3)}
    sizes = [np.linalg.norm(motion.evaluate(pin, name).values[0, 0]) for name, pin in pins.items()]
    assert made.redundant_reactions == "least_norm"
    speed = np.asarray(motion.outputs["carrier_angle"])
    assert speed[0, 2] == 0
    np.testing.assert_allclose(sizes, 90 / 3 / arm, rtol=1e-9)
    np.testing.assert_allclose(motion.outputs["drive"][0, 0], 90 * 2 / 9, rtol=1e-9)


@pytest.mark.slow
def test_the_garage_door_lifts_its_weight():
    """The force of the lift is what its work is: weights, cable and kinetic energy, by the positions alone."""
    motion = solved("garage_door")
    lift = np.asarray(motion.outputs["bottom_roller"])[:, 1, 1]
    balance = jn.energy.power_balance(motion)
    assert lift.max() > 0.5
    assert (np.abs(balance["residual"]) <= 1e-9 * balance["scale"].max("time")).all()
