"""Tooth forces of gears in space: formulas of textbooks, planar gears, equilibrium, and what is refused."""

import dataclasses
import math

import jax
import mpmath
import numpy as np
import pytest

import jounce as jn
from jounce import drivers, forces, spatial
from tests.dynamics.test_gears import planetary, rates

X, Y, Z, ZERO = np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), np.array([0, 0, 1.0]), [0, 0, 0]
TURNED = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]
TURNED = TURNED * np.linalg.det(TURNED)  # so that nothing lies along an axis of the ground
ALPHA, BETA = math.radians(20), math.radians(35)
SLOPE = math.tan(ALPHA)


def load(t):
    return 7 + 2 * mpmath.sin(5 * t)


def pair(axes, centers, pitch_point, ratio, sign=1.0, turned=TURNED, friction=None, **values):
    """Gears without mass on hinges of the ground, the first driven; the load is on the second, about its axis."""
    axes, centers, pitch_point = (
        [turned @ np.array(x, float) for x in group] for group in (axes, centers, [pitch_point])
    )
    mesh = {"point_i": ZERO, "point_j": ZERO, "point_m": pitch_point[0], "pressure_angle": ALPHA} | values
    return jn.Mechanism(
        space="spatial",
        bodies={name: jn.Body(center) for name, center in zip("ij", centers, strict=True)},
        joints={
            "A": spatial.Revolute(("ground", "i"), centers[0], ZERO, axes[0], axes[0], friction=friction),
            "B": spatial.Revolute(("ground", "j"), centers[1], ZERO, axes[1], axes[1], friction=friction),
            "mesh": spatial.Gear(("i", "j", "ground"), *axes, ratio, **mesh),
        },
        drivers={"motor": drivers.RotationDriver(("ground", "i"), axes[0], "2*t + t**2")},
        forces={"load": forces.SpatialTorque(("ground", "j"), axes[1], f"{sign}*(7 + 2*sin(5*t))")},
    )


CONE = math.atan2(0.2, 0.1)  # pitch angle of the first bevel gear
GEARS = {  # axes, centers, pitch point, ratio, radius of the second gear; what bearing A does for a tooth force of one
    "spur": (([0, 0, 1], [0, 0, 1]), (ZERO, [0.3, 0, 0.2]), [0.1, 0, 0.05], -1 / 2, 0.2, {}, [0, 1, 0], [SLOPE, 0, 0]),
    "right-handed": (
        ([0, 0, 1], [0, 0, 1]), (ZERO, [0.3, 0, 0]), [0.1, 0, 0], -1 / 2, 0.2, {"helix_angle": BETA},
        [0, 1, -math.tan(BETA)], [SLOPE / math.cos(BETA), 0, 0],
    ),
    "ring": (([0, 0, 1], [0, 0, 1]), ([0.2, 0, 0], ZERO), [0.3, 0, 0], 1 / 3, 0.3, {}, [0, -1, 0], [SLOPE, 0, 0]),
    "bevel": (
        ([0, 0, 1], [1, 0, 0]), ([0, 0, 0.3], [-0.1, 0, 0]), [0.2, 0, 0.1], -2, 0.1, {},
        [0, 1, 0], [SLOPE * math.cos(CONE), 0, -SLOPE * math.sin(CONE)],
    ),
    "spiral bevel": (
        ([0, 0, 1], [1, 0, 0]), (ZERO, ZERO), [0.2, 0, 0.1], -2, 0.1, {"helix_angle": BETA},
        [-math.tan(BETA) * math.sin(CONE), 1, -math.tan(BETA) * math.cos(CONE)],
        [SLOPE / math.cos(BETA) * math.cos(CONE), 0, -SLOPE / math.cos(BETA) * math.sin(CONE)],
    ),
    "worm": (  # of a lead angle of which the tangent is a tenth
        ([1, 0, 0], [0, 1, 0]), ([0.1, 0, 0.05], ZERO), [0, 0, 0.04], 1 / 40, 0.04, {},
        [-1, -0.1, 0], [0, 0, -SLOPE / math.cos(math.atan(0.1))],
    ),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("name", GEARS)
def test_bearings_bear_tooth_forces_as_textbooks_have_them(name, sign):
    """Niemann and Winter, Maschinenelemente 2 and 3; which way a right-handed gear is thrust follows from its thread.

    What is along the flank changes its sign with the load; what separates the gears does not.
    """
    axes, centers, pitch_point, ratio, radius, values, along, apart = GEARS[name]
    time = [0.1, 0.8]
    motion = jn.solve(pair(axes, centers, pitch_point, ratio, sign, **values), time, order=6)
    reaction, other = jn.joint_reaction(motion, "A", "i"), jn.joint_reaction(motion, "B", "j")
    motor = jn.driver_force(motion, "motor").values
    for k, t in enumerate(time):
        expected = np.outer(rates(load, t), sign * np.array(along) + apart) / radius @ TURNED.T
        size = np.abs(expected).max(axis=1, keepdims=True)
        assert (np.abs(reaction.force.values[k, :5] - expected) <= 1e-11 * size).all()
        assert (np.abs(other.force.values[k, :5] + expected) <= 1e-11 * size).all()
        # of the first gear: the tooth force at the pitch point, the bearing and the motor
        moment = np.cross(TURNED @ (np.array(pitch_point) - centers[0]), -expected)
        moment += reaction.torque.values[k, :5] + np.outer(motor[k, :5], TURNED @ axes[0])
        assert (np.abs(moment) <= 1e-11 * size).all()
        np.testing.assert_allclose(motor[k, :5], -ratio * sign * rates(load, t), rtol=1e-11, atol=1e-10)
    assert np.abs(jn.dynamics.ground_reaction(motion).force.values).max() < 1e-9 * size.max()


@pytest.mark.slow
def test_planetary_gears_in_space_load_pins_and_bearings_as_planar_ones():
    """Whose carrier is the frame, and moves; the ring is a gear that stands still."""
    flat = jn.solve(planetary("-7 - 2*sin(5*t)"), [0.1, 0.9], 6)
    mesh = {"pressure_angle": ALPHA, "point_i": ZERO, "point_j": ZERO}
    hinges = {"S": ("ground", "sun", ZERO), "C": ("ground", "carrier", ZERO), "P": ("carrier", "planet", [0.042, 0, 0])}
    train = jn.Mechanism(
        space="spatial",
        bodies={"sun": jn.Body(ZERO), "carrier": jn.Body(ZERO), "planet": jn.Body([0.042, 0, 0])},
        joints={
            **{n: spatial.Revolute((a, b), place, ZERO, Z, Z) for n, (a, b, place) in hinges.items()},
            "sp": spatial.Gear(("sun", "planet", "carrier"), Z, Z, -24 / 18, point_m=[0.024, 0, 0], **mesh),
            "pr": spatial.Gear(("planet", "ground", "carrier"), Z, Z, 18 / 60, point_m=[0.06, 0, 0], **mesh),
        },
        drivers={"m": drivers.RotationDriver(("ground", "sun"), Z, "20*t + 3*sin(6*t)")},
        forces={"load": forces.SpatialTorque(("ground", "carrier"), Z, "-7 - 2*sin(5*t)")},
    )
    motion = jn.solve(train, [0.1, 0.9], 6)
    for name, body in (("S", "sun"), ("P", "planet"), ("C", "carrier")):
        found, expected = (jn.joint_reaction(each, name, body).force.values for each in (motion, flat))
        size = np.abs(expected).max(axis=2, keepdims=True).max(axis=0)
        assert (np.abs(found[..., :2] - expected) <= 1e-10 * np.maximum(size, 1e-6)).all(), name
        assert np.abs(found[..., 2]).max() <= 1e-10 * size.max()


@pytest.mark.slow
@pytest.mark.parametrize("torque", [10.0, -30.0])
def test_bearings_with_friction_are_pressed_in_simulations_as_of_planar_gears(torque):
    """A force across the axes is the same in the plane and in space, and so is the friction that it causes."""
    pin = jn.joints.Friction(coefficient=0.2, radius=0.05, speed=1e-3)
    given = pair(*GEARS["spur"][:4], friction=pin)
    heavy = {name: dataclasses.replace(body, mass=1.0, inertia=[0.01] * 3) for name, body in given.bodies.items()}
    axis = TURNED[:, 2]
    loads = {
        "m": forces.SpatialTorque(("ground", "i"), axis, 6.0),
        "load": forces.SpatialTorque(("ground", "j"), axis, torque),
    }
    start = {"start": drivers.RotationDriver(("ground", "i"), axis, "10*t")}
    changed = {"bodies": heavy, "drivers": {}, "forces": loads, "initial": start, "gravity": ZERO}
    run = jn.simulate(dataclasses.replace(given, **changed), [0.0, 0.01], order=3)
    sign, moment = np.sign(torque), 0.2 * 0.05 / math.cos(ALPHA)
    _, acceleration = np.linalg.solve([[0.1 + sign * moment, 0.01], [-(0.2 - sign * moment), 0.005]], [6.0, -torque])
    spin = run.angular_velocity("i").values[:, 1] @ axis
    np.testing.assert_allclose(spin, acceleration, rtol=1e-10)


@pytest.mark.slow
def test_forces_are_differentiated_by_the_pressure_angle():
    given = pair(*GEARS["spur"][:4], pressure_angle="alpha")
    given = dataclasses.replace(given, parameters={"alpha": ALPHA})

    def separating(alpha):
        motion = jn.solve(given.with_parameters(alpha=alpha), [0.1], order=2)
        return jn.joint_reaction(motion, "A", "i").force.data[0, 0] @ TURNED[:, 0]

    np.testing.assert_allclose(jax.grad(separating)(ALPHA), float(load(0.1)) / 0.2 / math.cos(ALPHA) ** 2, rtol=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name, changes, words",
    [
        (
            "spur",
            {"point_m": TURNED @ [0.11, 0, 0]},
            r"mesh.points: at the third point the pitch radii are 0.11 m and 0.19 m",
        ),
        ("spur", {"ratio": 1 / 2}, "slide by 0.2 m per rad"),
        ("spur", {"point_m": ZERO}, "lies on the axis of the first gear"),
        ("spur", {"point_j": TURNED @ [0, 0.01, 0]}, "this point of 'j' is 0.01 m from the axis of its hinge"),
        ("worm", {"helix_angle": 0.1}, "mesh.helix_angle: teeth of gears on crossed axes"),
        (
            "worm",
            {
                "friction": jn.joints.GearFriction(
                    1.0, coefficient=0.06, lead_angle=math.radians(5), pressure_angle=ALPHA
                )
            },
            "mesh.friction.lead_angle: the lead angle of the first gear is 5.711 deg",
        ),
        (
            "worm",
            {"point_m": TURNED @ [0, 0, 40.0]},
            "from axes that are 0.05 m apart.*a number without a unit is in m",
        ),
        ("worm", {"point_m": TURNED @ [0, 0, 0.05]}, "lies on the axis of the first gear"),
    ],
)
def test_gears_that_do_not_mesh_are_refused(name, changes, words):
    mechanism = pair(*GEARS[name][:4])
    mesh = dataclasses.replace(mechanism.joints["mesh"], **changes)
    mechanism = dataclasses.replace(mechanism, joints={**mechanism.joints, "mesh": mesh})
    with pytest.raises(jn.errors.MechanismError, match=words):
        jn.joint_reaction(jn.solve(mechanism, [0.1], order=2), "A", "i")


@pytest.mark.slow
def test_a_gear_that_is_welded_to_its_shaft_presses_on_the_bearing_of_the_shaft():
    """As a spur gear of one piece with it; its point is checked against the hinge of the shaft."""
    axes, centers, *others = GEARS["spur"][:4]
    whole, end = pair(axes, centers, *others), [0.05, -0.2, 0.1]  # the origin of the gear, in the frame of the shaft
    bearing = dataclasses.replace(whole.joints["B"], bodies=("ground", "shaft"))
    key = spatial.Fixed(("shaft", "j"), end, ZERO, [1, 2, 0], [1, 2, 0], Z, Z)

    def keyed(point):
        mesh = dataclasses.replace(whole.joints["mesh"], point_j=point)
        bodies = {**whole.rigid_bodies, "shaft": whole.bodies["j"], "j": jn.Body(TURNED @ centers[1] + end)}
        return dataclasses.replace(
            whole, bodies=bodies, joints={**whole.joints, "B": bearing, "key": key, "mesh": mesh}
        )

    motion = jn.solve(keyed((-np.array(end)).tolist()), [0.1, 0.8], order=2)
    expected = [-float(load(t)) / 0.2 * (TURNED @ [SLOPE, 1, 0]) for t in (0.1, 0.8)]
    force = jn.joint_reaction(motion, "B", "shaft").force.values[:, 0]
    np.testing.assert_allclose(force, expected, rtol=0, atol=1e-11 * 40)
    with pytest.raises(jn.errors.MechanismError, match=r"this point of 'j' is .* m from the axis of its hinge"):
        jn.solve(keyed(ZERO), [0.1])


@pytest.mark.slow
def test_a_crown_wheel_has_no_hand_of_its_own():
    slanted = [math.sqrt(15) / 4, 0, 1 / 4]
    crown = pair(([0, 0, 1], slanted), (ZERO, ZERO), [0.2, 0, 0], 4, helix_angle=0.1, turned=np.eye(3))
    with pytest.raises(jn.errors.MechanismError, match="the first gear is a crown wheel"):
        jn.joint_reaction(jn.solve(crown, [0.1], order=2), "A", "i")


@pytest.mark.parametrize(
    "values, words",
    [
        ({"point_i": ZERO, "point_j": ZERO, "point_m": X}, "pressure_angle: the force of teeth needs"),
        ({"helix_angle": 0.3}, "point_i: the force of teeth needs"),
        ({"pressure_angle": 0.3}, "point_i: the force of teeth needs"),
    ],
)
def test_teeth_are_given_as_a_whole(values, words):
    with pytest.raises(jn.errors.MechanismError, match=words):
        spatial.Gear(("a", "b", "c"), Z, Z, 1, **values)


def test_a_helix_angle_is_less_than_a_right_angle():
    with pytest.raises(jn.errors.MechanismError, match=r"mesh.helix_angle: must be between -90 and 90 deg"):
        jn.solve(pair(*GEARS["spur"][:4], helix_angle=20.0), [0.1], order=2)
