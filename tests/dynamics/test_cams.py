"""Cams as joints: force on the follower, and what it does to the shaft, with rates, against closed forms in mpmath."""

import dataclasses
import shutil

import jax
import mpmath
import numpy as np
import pytest

import jounce as jn
from jounce import drivers, planar
from jounce.io.mechanisms.writing.writer import write_mechanism

SPRING, LENGTH, MASS, INERTIA, SPEED = 5000.0, 0.03, 1.3, 0.004, 20.0
FILE = """
space: planar
gravity: [0, -9.81]
parameters: {k: 5 kN/m, m: 1.3 kg, w: 20 rad/s, rise: 15 mm}
units: {length: mm}
bodies:
  shaft: {position: [0, 0], mass: 1 kg, inertia: 0.004 kg*m^2}
  follower: {position: [0, 46 mm], mass: m, inertia: 0.001 kg*m^2}
joints:
  axle: {type: revolute, bodies: [ground, shaft], points: [[0, 0], [0, 0]]}
  guide: {type: prismatic, bodies: [ground, follower], points: [[0, 0], [0, 0]], vectors: [[0, 1], [0, 1]]}
  cam: {type: coordinate, bodies: [ground, follower], coordinate: y, offset: 46 mm, motion: {MOTION, of: LEADER}}
drivers:
  shaft: {type: coordinate, bodies: [ground, shaft], coordinate: angle, motion: w*t + 0.3*sin(5*t)}
forces:
  spring: {type: slide_spring, bodies: [ground, follower], points: [[0, 0], [0, 0]], vector: [0, 1], stiffness: k,
    length: 30 mm}
outputs:
  theta: {body: shaft, quantity: angle}
  contact: {joint: cam, quantity: contact}
  torque: {driver: shaft, quantity: torque}
time: {start: 0, stop: 0.3, count: 31}
"""
IN_SPACE = """
space: spatial
gravity: [0, -9.81, 0]
bodies:
  shaft: {position: [0, 0, 0], orientation: {axis: [0, 1, 0], angle: -90 deg}, mass: 1 kg, inertia: [0.004, 1, 1]}
  follower: {position: [0, 46 mm, 0], mass: 1.3 kg, inertia: [0.1, 0.1, 0.1]}
  rocker: {position: [0.2, 0, 0], orientation: {axis: [1, 1, 0], angle: 50 deg}, mass: 1 kg,
    inertia: [0.02, 0.02, 0.02]}
joints:
  axle: {type: revolute, bodies: [ground, shaft], points: [[0, 0, 0], [0, 0, 0]], axes: [[0, 0, 1], [1, 0, 0]]}
  guide: {type: prismatic, bodies: [ground, follower], points: [[0, 0, 0], [0, 0, 0]], axes: [[0, 1, 0], [0, 1, 0]],
    normals: [[1, 0, 0], [1, 0, 0]]}
  pivot: {type: revolute, bodies: [ground, rocker], points: [[0.2, 0, 0], [0, 0, 0]], axes: [[0, 0, 1], [1, -1, 0]]}
  cam: {type: slide, bodies: [ground, follower], points: [[0, 46 mm, 0], [0, 0, 0]], vector: [0, 1, 0],
    motion: {MOTION, of: LEADER}}
  swing: {type: rotation, bodies: [ground, rocker], axis: [0, 0, 1], motion: {expression: t + 0.1*sin(2*t), of: LEADER}}
drivers:
  shaft: {type: rotation, bodies: [ground, shaft], axis: [0, 0, 1], vectors: [[1, 0, 0], [0.3, 0, -1]],
    motion: 20*t + 0.3*sin(5*t)}
forces:
  spring: {type: slide_spring, bodies: [ground, follower], points: [[0, 0, 0], [0, 0, 0]], vector: [0, 1, 0],
    stiffness: 5 kN/m, length: 30 mm}
outputs:
  theta: {bodies: [ground, shaft], quantity: angle, axis: [0, 0, 1], vectors: [[1, 0, 0], [0.3, 0, -1]]}
  rocker: {bodies: [ground, rocker], quantity: angle, axis: [0, 0, 1]}
  contact: {joint: cam, quantity: contact}
  turning: {joint: swing, quantity: contact_torque}
  torque: {driver: shaft, quantity: torque}
"""
OF_PARTS = IN_SPACE.replace(
    "swing: {type: rotation, bodies: [ground, rocker]",
    """weld: {type: fixed,
    bodies: [rocker, lever], points: [[0, 0, 0], [0, 0, 0]], axes: [[1, 1, 0], [1, 1, 0]],
    normals: [[0, 0, 1], [0, 0, 1]]}
  swing: {type: rotation, bodies: [ground, lever]""",
).replace(
    "joints:",
    """
  lever: {position: [0.2, 0, 0], orientation: {axis: [1, 1, 0], angle: 50 deg}}
joints:""",
)
SMOOTH = "expression: rise*(1 - cos(t))/2 + 0.001*sin(3*t)"
RISES = (
    "profile: [{profile: cycloidal, duration: 120 deg, to: rise}, {profile: dwell, duration: 60 deg}, "
    "{profile: cycloidal, duration: 120 deg, to: 0}, {profile: dwell, duration: 60 deg}], beyond: repeat"
)


def load(tmp_path, motion=SMOOTH, leader="shaft", text=FILE):
    path = tmp_path / "cam.yaml"
    path.write_text(text.replace("MOTION", motion).replace("LEADER", leader))
    return jn.load(path)


def smooth(t):
    return mpmath.mpf("0.015") * (1 - mpmath.cos(t)) / 2 + mpmath.mpf("0.001") * mpmath.sin(3 * t)


def expected(law, instants):
    """Force on the follower, and torque of the shaft, with four rates: D'Alembert, and the slope of the law."""

    def angle(t):
        return 20 * t + mpmath.mpf("0.3") * mpmath.sin(5 * t)

    def place(t):
        return mpmath.mpf("0.046") + law(angle(t))

    def force(t):
        spring = 5000 * (place(t) - mpmath.mpf("0.03"))
        return mpmath.mpf("1.3") * (mpmath.diff(place, t, 2) + mpmath.mpf("9.81")) + spring

    def torque(t):
        return mpmath.mpf("0.004") * mpmath.diff(angle, t, 2) + force(t) * mpmath.diff(law, angle(t))

    with mpmath.workdps(80):
        return [np.array([[mpmath.diff(f, x, k) for k in range(5)] for x in instants], float) for f in (force, torque)]


@pytest.mark.slow
@pytest.mark.parametrize("leader", ["shaft", pytest.param("theta", marks=pytest.mark.slow)])
def test_contact_and_shaft_torque_with_rates(tmp_path, leader):
    instants = [-0.4, 0.02, 0.13, 1.07]
    found = jn.solve(load(tmp_path, SMOOTH, leader), instants, order=4).outputs
    for name, exact in zip(("contact", "torque"), expected(smooth, instants), strict=True):
        sizes = np.abs(exact).max(axis=0)
        np.testing.assert_allclose(found[name] / sizes, exact / sizes, rtol=0, atol=1e-11, err_msg=name)


@pytest.mark.slow
@pytest.mark.parametrize("leader, text", [("shaft", IN_SPACE), ("theta", IN_SPACE), ("shaft", OF_PARTS)])
def test_cams_in_space_know_angles_about_hinges(tmp_path, leader, text):
    """A tappet on the shaft, and a rocker that goes a turn with each of it: frames askew, many turns."""
    law = SMOOTH.replace("rise", "0.015")
    instants = [-0.4, 0.02, 0.13, 1.07]
    motion = jn.solve(load(tmp_path, law, leader, text), instants, order=4)

    def angle(t):
        return 20 * t + mpmath.mpf("0.3") * mpmath.sin(5 * t)

    def swing(theta):
        return theta + mpmath.mpf("0.1") * mpmath.sin(2 * theta)

    def turning(t):
        return mpmath.mpf("0.02") * mpmath.diff(lambda x: swing(angle(x)), t, 2)

    def more(t):  # on the shaft, by the rocker
        return turning(t) * mpmath.diff(swing, angle(t))

    force, torque = expected(smooth, instants)
    with mpmath.workdps(80):
        turned, added = (
            np.array([[mpmath.diff(f, x, k) for k in range(5)] for x in instants], float) for f in (turning, more)
        )
    for name, exact in zip(("contact", "turning", "torque"), (force, turned, torque + added), strict=True):
        sizes = np.abs(exact).max(axis=0)
        np.testing.assert_allclose(motion.outputs[name] / sizes, exact / sizes, rtol=0, atol=1e-10, err_msg=name)
    bearing = jn.joint_reaction(motion, "swing", body="shaft", point=[0, 0, 0])
    assert float(abs(bearing.force).max()) == 0


@pytest.mark.parametrize(
    "motion, leader, words",
    [
        ("piecewise: [{until: 9000 deg, expression: 0.01}]", "shaft", r"joints.cam.motion: its leader goes from 2000"),
        ("expression: sin(t)", "slanted", r"joints.cam.motion.of: the body does not turn about this axis"),
    ],
)
@pytest.mark.filterwarnings("ignore::jounce.errors.UnitWarning")  # 2000 rad are meant
def test_laws_and_axes_that_tell_no_angle_in_space_are_named_before_any_computing(tmp_path, motion, leader, words):
    text = IN_SPACE.replace("motion: 20*t", "motion: 2000 + 20*t")
    slanted = "\n  slanted: {type: rotation, bodies: [ground, shaft], axis: [0.3, 0, 1], motion: t}"
    with pytest.raises(jn.errors.MechanismError, match=words):
        jn.solve(load(tmp_path, motion, leader, text.replace("drivers:", f"drivers:{slanted}")), [0.0])


STEPS = "profile: [{profile: polynomial_4_5_6_7, duration: 360 deg, to: 2 mm}], beyond: "


@pytest.mark.slow
@pytest.mark.parametrize(
    "motion, turn",
    [
        ("expression: 0.015*(1 - cos(0.3*t))/2 + 0.0001*t", lambda x: 0.015 * (1 - mpmath.cos(0.3 * x)) / 2 + 1e-4 * x),
        (STEPS + "advance", lambda x: 0.002 * (mpmath.floor(x / mpmath.pi / 2) + rise(x))),
        (STEPS + "hold", lambda x: 0.002 * (0 if x < 0 else rise(x) if x < 2 * mpmath.pi else 1)),
    ],
    ids=["expression", "advance", "hold"],
)
@pytest.mark.filterwarnings("ignore::jounce.errors.UnitWarning")
def test_laws_in_space_go_on_from_turn_to_turn(tmp_path, motion, turn):
    """Contact and shaft torque with rates where the law does not come back: it starts 8 turns on, and goes on for 3."""
    text = IN_SPACE.replace("motion: 20*t", "motion: 50 - 20*t").replace(
        "expression: t + 0.1*sin(2*t)", "expression: t"
    )
    instants = [0.1, 1.37, 2.2, 2.65]
    motion = jn.solve(load(tmp_path, motion, "shaft", text), instants, order=4)

    def angle(t):
        return 50 - 20 * t + mpmath.mpf("0.3") * mpmath.sin(5 * t)

    def place(t):
        return mpmath.mpf("0.046") + turn(angle(t))

    def force(t):
        spring = 5000 * (place(t) - mpmath.mpf("0.03"))
        return mpmath.mpf("1.3") * (mpmath.diff(place, t, 2) + mpmath.mpf("9.81")) + spring

    def torque(t):  # the rocker turns with the shaft
        return mpmath.mpf("0.024") * mpmath.diff(angle, t, 2) + force(t) * mpmath.diff(turn, angle(t))

    with mpmath.workdps(60):
        for name, function in (("contact", force), ("torque", torque)):
            exact = np.array([[mpmath.diff(function, x, k) for k in range(3)] for x in instants], float)
            sizes = np.abs(exact).max(axis=0) + 1e-9
            np.testing.assert_allclose(motion.outputs[name][:, :3] / sizes, exact / sizes, atol=1e-10, err_msg=name)


def rise(angle):
    """A rise of one within a turn by the polynomial of degree 7."""
    x = angle / mpmath.pi / 2
    x -= mpmath.floor(x)
    return 35 * x**4 - 84 * x**5 + 70 * x**6 - 20 * x**7


@pytest.mark.slow
def test_gradients_of_cams_in_space_know_all_turns(tmp_path):
    text = IN_SPACE.replace("gravity:", "parameters: {rate: 0.5}\ngravity:", 1)
    cam = load(tmp_path, "expression: 0.01*sin(rate*t)", "shaft", text)
    place = {"place": jn.outputs.PointOutput("follower", [0, 0, 0])}
    angle = 20 * 1.5 + 0.3 * np.sin(7.5)

    def height(rate):
        moved = dataclasses.replace(cam, outputs=place, parameters={**cam.parameters, "rate": rate})
        return jn.solve(moved, [0.0, 1.5], 1).outputs["place"][1, 0, 1]

    assert float(jax.grad(height)(0.5)) == pytest.approx(0.01 * angle * np.cos(0.5 * angle), rel=1e-10)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::jounce.errors.UnitWarning")
def test_a_shaft_that_is_driven_too_far_from_the_guess_is_refused(tmp_path):
    """Two shafts that turn unlike each other: turns are followed one by one, and no more than 100."""
    other = "\n  other: {type: rotation, bodies: [ground, rocker], axis: [0, 0, 1], motion: 2828 + t}"
    text = IN_SPACE.replace("motion: 20*t", "motion: 2000 + 20*t").replace("drivers:", f"drivers:{other}")
    swing = next(line for line in text.splitlines() if line.lstrip().startswith("swing:")) + "\n"
    text = text.replace(swing, "").replace("  turning: {joint: swing, quantity: contact_torque}\n", "")
    with pytest.raises(jn.errors.MechanismError, match=r"joints\.cam\.motion\.of: its leader starts at 2000 rad"):
        jn.solve(load(tmp_path, "expression: 0.00001*t", "shaft", text), [0.0, 0.1], 1)


ROLLER = """
space: planar
gravity: [0, -9.81]
parameters: {h: sqrt((18 + 8)**2 - 2**2)*1e-3}
bodies:
  shaft: {position: [0, 0], mass: 1, inertia: 0.001}
  follower: {position: [0, h], mass: 0.3, inertia: 0.001}
joints:
  axle: {type: revolute, bodies: [ground, shaft], points: [[0, 0], [0, 0]]}
  guide: {type: prismatic, bodies: [ground, follower], points: [[-2 mm, 0], [-2 mm, 0]], vectors: [[0, 1], [0, 1]]}
  roller: {type: curve, bodies: [shaft, follower], curve: {cam: CAM}, point: [-2 mm, 0]}
drivers:
  motor: {type: coordinate, bodies: [ground, shaft], coordinate: angle, motion: -80*t}
forces:
  spring: {type: slide_spring, bodies: [ground, follower], points: [[0, 0], [0, 0]], vector: [0, 1], stiffness: 20 N/mm,
    length: 15 mm}
outputs:
  on_roller: {joint: roller, quantity: reaction, body: follower}
  bearing: {joint: axle, quantity: reaction, body: shaft}
  torque: {driver: motor, quantity: torque}
"""


@pytest.mark.slow
def test_a_roller_on_the_path_of_a_cam_file_loads_its_bearing_and_its_guide(tmp_path):
    """The force of the law, and beside it as the pressure angle says; the torque of the shaft is its power."""
    profile = jn.cams.load_cam("examples/cams/intake.yaml")
    angle = np.radians([130.0, 155.0, 200.0])
    shutil.copy("examples/cams/intake.yaml", tmp_path)
    found = jn.solve(load(tmp_path, text=ROLLER.replace("CAM", "intake.yaml")), angle / 80, order=2).outputs
    there = profile.at(angle)
    rates = profile.law(jn.Jet.variable(angle, 2)).derivatives()
    lift, slope, bend = (np.asarray(x) for x in rates)
    height = np.sqrt(0.026**2 - 0.002**2) + lift
    force = 0.3 * (bend * 80**2 + 9.81) + 20e3 * (height - 0.015)
    np.testing.assert_allclose(found["on_roller"][:, 0, 1], force, rtol=1e-6)
    aside = found["on_roller"][:, 0, 0] / found["on_roller"][:, 0, 1]
    np.testing.assert_allclose(np.abs(aside), np.abs(np.tan(there.pressure_angle)), rtol=1e-6)
    np.testing.assert_allclose(found["torque"][:, 0], -force * slope, rtol=1e-5)
    np.testing.assert_allclose(found["bearing"][:, 0], found["on_roller"][:, 0] + [0, 9.81], rtol=1e-9)


def test_a_flat_face_has_no_path_and_is_named(tmp_path):
    shutil.copy("examples/cams/indexing_rocker.yaml", tmp_path)
    with pytest.raises(jn.errors.MechanismFileError, match=r"joints.roller.curve.cam: the contact point moves"):
        load(tmp_path, text=ROLLER.replace("CAM", "indexing_rocker.yaml"))


@pytest.mark.slow
def test_a_driver_names_what_follows_it_as_a_signal(tmp_path):
    (follows,) = (line for line in FILE.splitlines() if line.startswith("  cam:"))
    text = FILE.replace(f"{follows}\n", "").replace("drivers:", f"drivers:\n{follows}")
    text = text.replace("joint: cam, quantity: contact", "driver: cam, quantity: force")
    found = jn.solve(load(tmp_path, text=text), [0.02, 0.13], order=2).dataset
    assert "cam follows it without loading it" in found["torque"].attrs["comment"]


@pytest.mark.slow
def test_the_exercise_of_the_forum(tmp_path):
    """Spring of 15 N/mm compressed by 2.5 mm, 1.8 kg, 1000 rpm, rise of 10 mm: 61.69 N and 0.1473 N m at 100 deg."""
    text = FILE.replace("5 kN/m", "15 N/mm").replace("1.3 kg", "1.8 kg").replace("15 mm", "10 mm")
    text = text.replace("46 mm", "0").replace("length: 30 mm", "length: -2.5 mm").replace("-9.81", "0")
    text = text.replace("w*t + 0.3*sin(5*t)", "1000 rpm").replace("1000 rpm", "w*t").replace("20 rad/s", "1000 rpm")
    found = jn.solve(load(tmp_path, RISES, text=text), [1 / 60], order=0)
    np.testing.assert_allclose(found.outputs["contact"], [[-61.6881]], rtol=1e-6)
    np.testing.assert_allclose(found.outputs["torque"], [[-0.14726944]], rtol=1e-6)
    assert "lifts off" not in str(found.dataset["contact"].attrs.get("comment", ""))


def test_the_reactions_of_a_cam_balance_on_shaft_follower_and_ground(tmp_path):
    motion = jn.solve(load(tmp_path), [0.02, 0.13], order=4)
    parts = [jn.joint_reaction(motion, "cam", body=b, point=[0, 0]) for b in ("follower", "shaft")]
    ground = jn.joint_reaction(motion, "cam", body="ground", point=[0, 0])
    size = float(abs(parts[0].force).max())
    assert float(abs(sum(p.force for p in parts) + ground.force).max()) <= 1e-12 * size
    assert float(abs(parts[1].force).max()) == 0  # a law of coordinates: the shaft bears a torque alone
    torque = jn.driver_force(motion, "shaft").values[:, :3] - INERTIA * motion.outputs["theta"][:, 2:5]
    found = parts[1].torque.values[:, :3]
    np.testing.assert_allclose(found, -torque, rtol=0, atol=1e-12 * np.abs(torque).max())


@pytest.mark.slow
def test_what_is_written_reads_the_same(tmp_path):
    leader = "theta"
    mechanism = load(tmp_path, RISES, leader)
    write_mechanism(mechanism, tmp_path / "written.yaml")
    again = jn.load(tmp_path / "written.yaml")
    assert again.joints["cam"].of == leader
    assert jn.solve(again, [0.13], order=1).outputs["torque"] == pytest.approx(
        jn.solve(mechanism, [0.13], order=1).outputs["torque"], rel=1e-12
    )


@pytest.mark.parametrize(
    "motion, leader, words",
    [
        (SMOOTH, "shft", "no leader has this coordinate; did you mean 'shaft'"),
        (SMOOTH, "cam", "a cam cannot follow itself"),
        (SMOOTH, "2*t", "must be the name of a driver, a joint, or an output"),
        ("output: theta, law: 1", "shaft", "a cam states its own law"),
        ("profile: [{profile: dwell, duration: 1 s}]", "shaft", "an angle"),
    ],
)
def test_what_cannot_lead_a_cam_is_named(tmp_path, motion, leader, words):
    with pytest.raises(jn.errors.MechanismFileError, match=words):
        load(tmp_path, motion, leader)


def test_a_joint_without_a_leader_and_a_driver_of_what_moves_freely_are_named(tmp_path):
    with pytest.raises(jn.errors.MechanismFileError, match=r"joints.cam.motion.of: a law under joints is a cam"):
        load(tmp_path, text=FILE.replace(", of: LEADER", ""))
    text = FILE.replace("motion: w*t + 0.3*sin(5*t)", "motion: {expression: t, of: theta}")
    with pytest.raises(jn.errors.MechanismFileError, match=r"drivers.shaft.motion.of: is not a driver"):
        load(tmp_path, text=text)


def test_a_law_that_ends_before_its_leader_is_named_before_any_computing(tmp_path):
    mechanism = load(tmp_path, "piecewise: [{until: 90 deg, expression: rise}]")
    with pytest.raises(jn.errors.MechanismError, match=r"joints.cam.motion: its leader goes from 0 to "):
        jn.solve(mechanism, [0.0, 1.0])


def test_breaks_of_a_cam_are_found_where_its_shaft_passes_them(tmp_path):
    from jounce.mechanism.laws.law_breaks import breaks_of_laws

    text = FILE.replace("w*t + 0.3*sin(5*t)", "w*t")
    found = breaks_of_laws(load(tmp_path, RISES, text=text), 0.0, 0.3, 4)
    np.testing.assert_allclose(found, np.radians([0, 120, 180, 300]) / 20, atol=1e-9)


def test_what_is_no_cam_is_refused():
    pin = planar.Revolute(("ground", "a"), [0, 0], [0, 0])
    with pytest.raises(jn.errors.MechanismError, match="must be a driver, whose law is that of the cam"):
        jn.joints.Cam(pin, pin)
    lift = drivers.CoordinateDriver(("ground", "b"), "y", "t")
    with pytest.raises(jn.errors.MechanismError, match="has no coordinate that a cam could follow"):
        jn.joints.Cam(lift, planar.DoubleRevolute(("a", "b"), [0, 0], [0, 0], 1.0))
    renamed = dataclasses.replace(jn.joints.Cam(lift, pin), bodies=("ground", "c", "d"))
    assert (renamed.follower.bodies, renamed.leader.bodies) == (("ground", "c"), ("ground", "d"))


@pytest.mark.slow
def test_the_least_preload_that_keeps_contact_at_a_dwell(tmp_path):
    """At 200 rpm the least force is that at rest, below: the spring and the weight of 1 kg balance at 46 mm."""
    found = jn.dynamics.contact_spring(jn.load("examples/camshaft.yaml"), "cam", "spring", np.linspace(0, 0.3, 31))
    np.testing.assert_allclose([found.free, found.margin], [0.046 + 9.81 / 5000, 5000 * 0.016 + 9.81], rtol=1e-9)


@pytest.mark.slow
def test_a_cam_in_space_repeats_its_law_from_turn_to_turn(tmp_path):
    """Two turns back to three ahead: rises, a dwell and falls, as the shaft turns on."""
    third, instants = 2 * mpmath.pi / 3, [-0.4, 0.05, 0.35, 1.1, 1.2]

    def law(angle):
        turned = angle - 2 * mpmath.pi * mpmath.floor(angle / (2 * mpmath.pi))
        falls = turned > mpmath.pi
        share = min((turned - mpmath.pi if falls else turned) / third, 1)
        rise = mpmath.mpf("0.015") * (share - mpmath.sin(2 * mpmath.pi * share) / (2 * mpmath.pi))
        return mpmath.mpf("0.015") - rise if falls else rise

    made = load(tmp_path, RISES.replace("rise", "15 mm"), "theta", IN_SPACE)
    found = jn.solve(made, instants, order=4).outputs["contact"]
    exact = expected(law, instants)[0]
    sizes = np.abs(exact).max(axis=0)
    np.testing.assert_allclose(found / sizes, exact / sizes, rtol=0, atol=1e-10)


@pytest.mark.parametrize("grid", [[0, 90, 180, 270, 360], [45, 90], [90, 100], [180], [720, 810, 900]])
def test_corners_of_a_cam_on_the_grid_are_those_of_the_segment_that_begins(grid):
    """A modified sine begins with the jerk 16 pi^3 h / (4 + pi) / T^3: the rate of the force on a follower of 1 kg."""
    camshaft = jn.load("examples/camshaft.yaml")
    speed, degrees = camshaft.parameter_values["speed"], np.array(grid)
    jerk = 16 * np.pi**3 / (4 + np.pi) * 0.015 * (speed / (np.pi / 2)) ** 3
    motion = jn.solve(camshaft, np.deg2rad(degrees) / speed, order=3)
    corners = degrees % 90 == 0
    expected = np.select([degrees % 360 == 0, degrees % 360 == 180], [jerk, -jerk], 0.0)
    np.testing.assert_allclose(motion.outputs["contact"][corners, 1], expected[corners], rtol=1e-9, atol=1e-6)
