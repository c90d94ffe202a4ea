"""Wheels that roll without slip: closed forms of a disc and of a robot, the benchmark bicycle, refusals by name."""

import dataclasses
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import jounce as jn
from jounce import drivers, spatial

ORIGIN, X, Y, Z = [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]
DISC = "examples/rolling_disc_in_space.yaml"


def roll(body, radius, **changes):
    values = {"point_j": ORIGIN, "axis_j": Y, "radius": radius, "point_i": ORIGIN, "normal_i": Z}
    return spatial.Wheel(("ground", body), **{**values, **changes})


def contact_velocity(simulation):
    """Velocity of the point of the disc that touches the table, by the columns of its attitude."""
    center = simulation.point("disc", ORIGIN).values
    axes = np.stack([simulation.point("disc", axis).values - center for axis in (X, Y, Z)], axis=-1)
    normal = axes[:, 0, :, 2]
    down = normal * normal[:, 2:] - np.array(Z)
    local = np.einsum("tcb,tc->tb", axes[:, 0], down / np.linalg.norm(down, axis=1)[:, None])
    return center[:, 1] + 0.2 * np.einsum("tcb,tb->tc", axes[:, 1], local)


@pytest.mark.slow
def test_a_tilted_disc_rolls_in_a_circle():
    """Steady rolling: (C + m r^2) spin turn sin = A turn^2 sin cos - m g r cos of the tilt; to order 4."""
    disc = jn.load(DISC)
    found = jn.simulate(disc, np.linspace(0, 4, 9))
    p = {name: float(value) for name, value in disc.parameter_values.items()}
    away = p["radius"] * p["spin"] / p["turn"]
    time = found.time[:, None]
    turned = p["turn"] * time + np.pi / 2 + np.arange(5) * np.pi / 2
    rates = p["turn"] ** np.arange(5)
    expected = np.stack([away * rates * np.cos(turned), away * rates * np.sin(turned)], axis=-1)
    np.testing.assert_allclose(found.outputs["center"][..., :2], expected, rtol=0, atol=1e-10 * rates.max())
    np.testing.assert_allclose(found.outputs["center"][:, 0, 2], p["radius"] * np.sin(p["tilt"]), rtol=0, atol=1e-11)
    assert np.abs(contact_velocity(found)).max() < 1e-12
    assert np.ptp(found.energy) < 1e-12 * abs(found.energy[0])
    # what the table exerts: weight, and the force that holds the center on its circle, m turn^2 away toward its middle
    force = found.outputs["table_force"]
    assert np.allclose(force[:, 0, 2], 1.5 * 9.81, rtol=1e-10)
    assert np.allclose(force[:, 0, :2], -1.5 * p["turn"] ** 2 * expected[:, 0], rtol=0, atol=1e-9)
    assert np.allclose(force[:, 1, :2], -1.5 * p["turn"] ** 2 * expected[:, 1], rtol=0, atol=1e-8)


@pytest.mark.slow
def test_a_disc_that_wobbles_keeps_its_energy_and_does_not_slip():
    disc = jn.load(DISC)
    disc = dataclasses.replace(disc, outputs={"center": jn.outputs.PointOutput("disc", ORIGIN)}).with_parameters(
        turn=4.0
    )
    rim = dataclasses.replace(disc.initial["rim"], motion="radius*spin/turn + 0.3*t")
    disc = dataclasses.replace(disc, initial={**disc.initial, "rim": rim})
    found = jn.simulate(disc, np.linspace(0, 2, 9))
    assert np.ptp(found.outputs["center"][:, 0, 2]) > 1e-3
    assert np.ptp(found.energy) < 1e-12 * abs(found.energy[0])
    assert np.abs(contact_velocity(found)).max() < 1e-12


def robot(left, right):
    """Return a robot of two driven wheels on an axle, held level by a ball that slides: the wheels repeat a row."""
    r, half = 0.1, 0.25
    bodies = {
        "hull": jn.Body([0, 0, r], mass=8, inertia=[0.3, 0.3, 0.4]),
        "left": jn.Body([0, half, r], mass=1, inertia=[0.003, 0.005, 0.003]),
        "right": jn.Body([0, -half, r], mass=1, inertia=[0.003, 0.005, 0.003]),
    }
    joints: dict[str, Any] = {"caster": spatial.Dot2(("ground", "hull"), ORIGIN, [0.3, 0, -r], Z)}
    motors = {}
    for name, law, side in (("left", left, half), ("right", right, -half)):
        joints[f"{name}_axle"] = spatial.Revolute(("hull", name), [0, side, 0], ORIGIN, Y, Y)
        joints[f"{name}_roll"] = roll(name, r)
        motors[name] = drivers.RotationDriver(("hull", name), Y, law)
    outputs = {"place": jn.outputs.PointOutput("hull", ORIGIN), "torque": jn.outputs.DriverTorqueOutput("left")}
    return jn.Mechanism(
        space="spatial", gravity=[0, 0, -9.81], bodies=bodies, joints=joints, drivers=motors, outputs=outputs
    )


@pytest.mark.slow
def test_a_robot_goes_where_its_wheels_drive_it():
    """Speed and yaw rate follow from the wheels; the position is their integral, here with Fresnel integrals."""
    found = jn.simulate(robot("5*t - 0.4*t**2", "5*t + 0.4*t**2"), np.linspace(0, 3, 7))
    rate = 0.1 / 0.5 * 1.6  # of the rate of turn: radius over track times the rate of the difference of the wheels

    def heading(t):
        return rate * t * t / 2

    quad: Any = mp.quad
    with mp.workdps(30):
        for k, t in enumerate(found.time.tolist()):
            x, y = (float(quad(lambda s, f=f: 0.5 * f(heading(s)), [0, t])) for f in (mp.cos, mp.sin))
            place = found.outputs["place"][k]
            np.testing.assert_allclose(place[0], [x, y, 0.1], rtol=0, atol=1e-10)
            speed, turn = [0.5 * np.cos(heading(t)), 0.5 * np.sin(heading(t)), 0], rate * t
            np.testing.assert_allclose(place[1], speed, rtol=0, atol=1e-10)
            np.testing.assert_allclose(place[2], [-turn * speed[1], turn * speed[0], 0], rtol=0, atol=1e-9)


PRINTED = {  # Meijaard, Papadopoulos, Ruina and Schwab 2007, section 5: of lean and steer
    "mass": [[80.81722, 2.31941332208709], [2.31941332208709, 0.29784188199686]],
    "damping": [[0.0, 33.86641391492494], [-0.85035641456978, 1.68540397397560]],  # times the speed
    "weight": [[-80.95, -2.59951685249872], [-2.59951685249872, -0.80329488458618]],  # times 9.81
    "turning": [[0.0, 76.59734589573222], [0.0, 2.65431523794604]],  # times the square of the speed
}
EIGENVALUES = (-14.0783896927982, -0.775341882195845 + 4.46486771378823j, -0.322866429004087)  # at 5 m/s
COORDINATES = ["frame.x", "frame.turn_x", "steer"]


def riding(speed):
    bicycle = jn.load("examples/bicycle.yaml").with_parameters(speed=speed, push=0.0)
    return jn.linearize(jn.simulate(bicycle, [0.0]), 0.0, coordinates=COORDINATES)


@pytest.mark.slow
def test_the_benchmark_bicycle_has_the_published_equations_and_eigenvalues():
    """Steering is about the upward axis here, and about the downward axis in the benchmark."""
    small, sign = riding(5.0), np.array([[1, -1], [-1, 1]])
    printed = {name: np.array(matrix) for name, matrix in PRINTED.items()}
    stiffness = 9.81 * printed["weight"] + 25 * printed["turning"]
    for found, expected in (
        (small.mass, printed["mass"]),
        (small.damping, 5 * printed["damping"]),
        (small.stiffness, stiffness),
    ):
        np.testing.assert_allclose(sign * found[1:, 1:], expected, rtol=0, atol=2e-13 * np.abs(stiffness).max())
        assert max(np.abs(found[0, 1:]).max(), np.abs(found[1:, 0]).max()) < 1e-10  # the speed is apart
    found = small.modes.eigenvalues
    for value in EIGENVALUES:
        assert np.abs(found - value).min() < 2e-12 * abs(value)
    assert len(found) == 4


@pytest.mark.slow
@pytest.mark.parametrize("speed, swings", [(4.292382536341, True), (6.024262015388, False)])
def test_weave_and_capsize_begin_at_the_published_speeds(speed, swings):
    """The real part crosses zero at that speed, with a slope of order one."""
    parts = sorted(abs(x.real) for x in riding(speed).modes.eigenvalues if (abs(x.imag) > 1e-9) == swings)
    assert parts[0 if swings else 1] < 1e-11  # one of those that do not swing is the speed, which nothing changes


@pytest.mark.slow
def test_a_batch_has_each_ride():
    bicycle, time = jn.load("examples/bicycle.yaml"), [0.0, 0.4]
    found = jn.simulate_batch(bicycle, {"speed": [3.0, 5.0]}, time, order=2)
    for k, speed in enumerate((3.0, 5.0)):
        single = jn.simulate(bicycle.with_parameters(speed=speed), time, order=2)
        np.testing.assert_allclose(found.outputs["seat"][k], single.outputs["seat"], rtol=0, atol=1e-10)


@pytest.mark.slow
def test_small_motions_that_depend_on_the_heading_are_refused():
    bicycle = jn.load("examples/bicycle.yaml")
    run = jn.simulate(bicycle, [0.0, 0.5])
    assert np.ptp(run.energy) < 1e-12 * abs(run.energy[0])
    tilted = dataclasses.replace(bicycle, gravity=[1.0, 0.5, -9.7])  # uphill it matters which way it heads
    with pytest.raises(jn.errors.MechanismError, match="do not depend on the places"):
        jn.linearize(jn.simulate(tilted.with_parameters(push=0.0), [0.0]), 0.0, coordinates=COORDINATES)


def test_where_only_positions_count_a_wheel_is_refused_by_name():
    one = robot("t", "t")
    for ask in (jn.solve, jn.mobility, jn.equilibrium, jn.assemblies):
        with pytest.raises(jn.errors.UnsupportedError, match=r"joints\.left_roll.*simulate"):
            ask(one)
    with pytest.raises(jn.errors.UnsupportedError, match=r"joints\.roll"):
        jn.solve_batch(jn.load(DISC), {"turn": [3.0, 4.0]}, [0.0, 1.0])


@pytest.mark.parametrize(
    "changes, words",
    [
        ({"normal_i": [0.0, 0.0, -1.0]}, r"joints\.roll\.plane\.normal: the center of the wheel is 0.178.* m behind"),
        ({"axis_j": [0.0, np.sin(1.1), np.cos(1.1)]}, r"joints\.roll\.axis: the wheel lies flat on its plane"),
    ],
)
def test_a_wheel_behind_its_plane_or_flat_on_it_is_named(changes, words):
    disc = jn.load(DISC)
    changed = dataclasses.replace(disc.joints["roll"], **changes)
    with pytest.raises(jn.errors.MechanismError, match=words):
        jn.simulate(dataclasses.replace(disc, joints={"roll": changed}), [0.0, 0.1])


@pytest.mark.slow
def test_a_wheel_on_a_plane_of_a_body_that_moves_rolls_as_it_does_seen_from_there():
    """A disc upright on a cart that goes along: driven at w, it goes w r farther than the cart, and does not slip."""
    level = {"mass": 2.0, "inertia": [0.1, 0.1, 0.1]}
    bodies = {"cart": jn.Body(ORIGIN, **level), "wheel": jn.Body([0, 0, 0.7], **level)}
    turn = [0.0, 0.6, 0.8]  # upward in the frame of the cart, which is drawn askew
    half = np.array([1 + turn[2], turn[1], 0.0, 0.0])
    bodies["cart"] = dataclasses.replace(bodies["cart"], orientation=(half / np.linalg.norm(half)).tolist())
    joints = {
        "rail": spatial.Prismatic(("ground", "cart"), ORIGIN, ORIGIN, X, X, Z, turn),
        "level": spatial.Dot1(("ground", "wheel"), X, Y),
        "upright": spatial.Dot1(("ground", "wheel"), Z, Y),
        "lane": spatial.Dot2(("ground", "wheel"), ORIGIN, ORIGIN, Y),
        "roll": spatial.Wheel(("cart", "wheel"), ORIGIN, Y, 0.2, [0.5 * x for x in turn], turn),
    }
    motors = {
        "haul": drivers.SpatialSlideDriver(("ground", "cart"), ORIGIN, ORIGIN, X, "0.3*t + 0.1*t**3"),
        "spin": drivers.RotationDriver(("ground", "wheel"), Y, "2*t**2"),
    }
    outputs = {"place": jn.outputs.PointOutput("wheel", ORIGIN)}
    made = jn.Mechanism(
        space="spatial", gravity=[0, 0, -9.81], bodies=bodies, joints=joints, drivers=motors, outputs=outputs
    )
    found = jn.simulate(made, [0.0, 0.4, 1.0]).outputs["place"]
    t = np.array([0.0, 0.4, 1.0])
    expected = [0.3 * t + 0.1 * t**3 + 0.4 * t**2, 0.3 + 0.3 * t**2 + 0.8 * t, 0.6 * t + 0.8]
    np.testing.assert_allclose(found[:, :3, 0], np.transpose(expected), rtol=0, atol=1e-11)
    np.testing.assert_allclose(found[:, 0, 2], 0.7, rtol=0, atol=1e-12)


def test_a_file_has_the_plane_as_one_key(tmp_path):
    made = jn.load(DISC)
    wheel = made.joints["roll"]
    assert (list(wheel.point_i), list(wheel.normal_i)) == ([0, 0, 0], [0, 0, 1])
    path = tmp_path / "again.yaml"
    jn.write_mechanism(made, path)
    assert "plane:" in path.read_text()
    assert jn.load(path).joints["roll"] == wheel
    text = path.read_text()
    path.write_text(text.replace("normal:", "up:"))
    with pytest.raises(jn.errors.MechanismFileError, match="point and normal"):
        jn.load(path)


def sleigh(turned=None):
    """A body of 3 kg, level, whose center of mass is 0.25 m ahead of its one wheel; the whole may be turned."""
    turned = Rotation.identity() if turned is None else turned
    x, y, z = turned.apply(np.eye(3)).tolist()
    start = {"position": [0.1 * c for c in z], "orientation": turned.as_quat(scalar_first=True).tolist()}
    return jn.Mechanism(
        space="spatial",
        gravity=[-9.81 * c for c in z],
        bodies={
            "body": jn.Body(**start, mass=3.0, inertia=[0.3, 0.4, 0.5], center_of_mass=[0.25, 0, 0.02]),
            "wheel": jn.Body(**start, mass=0.4, inertia=[0.001, 0.002, 0.001]),
        },
        joints={
            "pitch": spatial.Dot1(("ground", "body"), x, Z),
            "roll": spatial.Dot1(("ground", "body"), y, Z),
            "axle": spatial.Revolute(("body", "wheel"), ORIGIN, ORIGIN, Y, Y),
            "track": spatial.Wheel(("ground", "wheel"), ORIGIN, Y, 0.1, ORIGIN, z),
        },
        initial={
            "go": drivers.SpatialSlideDriver(("ground", "body"), ORIGIN, ORIGIN, x, "-0.4*t"),
            "turn": drivers.RotationDriver(("ground", "body"), z, "2*t", x, X),
        },
        outputs={
            "place": jn.outputs.PointOutput("body", ORIGIN),
            "heading": jn.outputs.PointOutput("body", X),
            "center": jn.outputs.PointOutput("body", [0.25, 0, 0.02]),
            "hub": jn.outputs.PointOutput("wheel", ORIGIN),
            "ground": jn.outputs.GroundForceOutput(),
        },
    )


def sleigh_in_closed_form(t):
    """Return the speed, the rate of turn, the heading and the place of the wheel at a time, by mpmath.

    Of Chaplygin's sleigh, ``M u' = m a w^2`` and ``K w' = -m a u w``: the wheel adds its mass and that of its spin.
    """
    mass, reach = mp.mpf(3) + mp.mpf("0.4") + mp.mpf("0.002") / mp.mpf("0.01"), mp.mpf("0.25")
    moment = mp.mpf("0.5") + 3 * reach**2 + mp.mpf("0.001")
    speed, turning = mp.mpf("-0.4"), mp.mpf(2)
    energy = mass * speed**2 + moment * turning**2
    fastest, most = mp.sqrt(energy / mass), mp.sqrt(energy / moment)
    rate = 3 * reach * fastest / moment
    phase = mp.atanh(speed / fastest)

    def heading(s):
        return most / rate * 2 * (mp.atan(mp.tanh((rate * s + phase) / 2)) - mp.atan(mp.tanh(phase / 2)))

    def along(s):
        return fastest * mp.tanh(rate * s + phase)

    place = [mp.quad(lambda s, f=f: along(s) * f(heading(s)), mp.linspace(0, t, 5)) for f in (mp.cos, mp.sin)]
    return along(t), most * mp.sech(rate * t + phase), heading(t), place


@pytest.mark.slow
@pytest.mark.parametrize("turned", [None, Rotation.from_rotvec([0.7, -1.1, 0.4])])
def test_the_sleigh_of_chaplygin_turns_round_and_runs_ahead(turned):
    """It starts backward and turning, and ends straight on; in any frame, with rates, energy and reactions."""
    time = np.linspace(0.0, 2.0, 5)
    found = jn.simulate(sleigh(turned), time)
    back = np.eye(3) if turned is None else turned.as_matrix()
    place, ahead = (found.outputs[name] @ back for name in ("place", "heading"))
    ahead = ahead - place
    for k, t in enumerate(time):
        speed, turning, heading, (x, y) = sleigh_in_closed_form(mp.mpf(float(t)))
        cos, sin = float(mp.cos(heading)), float(mp.sin(heading))
        np.testing.assert_allclose(place[k, 0], [float(x), float(y), 0.1], rtol=0, atol=1e-10)
        np.testing.assert_allclose(ahead[k, 0], [cos, sin, 0], rtol=0, atol=1e-10)
        np.testing.assert_allclose(place[k, 1], float(speed) * np.array([cos, sin, 0]), rtol=0, atol=1e-10)
        np.testing.assert_allclose(ahead[k, 1], float(turning) * np.array([-sin, cos, 0]), rtol=0, atol=1e-10)
        acceleration = np.array([0.75 * float(turning) ** 2 / 3.6, float(speed * turning)])
        np.testing.assert_allclose(place[k, 2, :2], acceleration @ [[cos, sin], [-sin, cos]], rtol=0, atol=1e-9)
    assert np.ptp(found.energy) < 1e-12 * abs(found.energy[0])
    weight = 3.4 * np.array(sleigh(turned).gravity)
    inertia = 3.0 * found.outputs["center"][:, 2] + 0.4 * found.outputs["hub"][:, 2]
    np.testing.assert_allclose(found.outputs["ground"][:, 0], weight - inertia, rtol=0, atol=1e-9)
