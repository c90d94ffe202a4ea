"""Laws of frames: how the frames of the bodies are drawn changes nothing that can be seen of a mechanism."""

import dataclasses
import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import jounce as jn
from jounce import drivers, forces, planar, spatial
from jounce.constraints.base import ROLES, catalogue, field_kind, value_fields
from jounce.dynamics import CamForceOutput, CamTorqueOutput, DriverTorqueOutput, GroundTorqueOutput, JointTorqueOutput
from jounce.io.mechanisms.schema.output_types import output_types
from jounce.mechanism import build
from jounce.mechanism.building.starting_guess import pose_at
from jounce.mechanism.transmissions.axis_angles import with_datums
from jounce.robot import CoupledJoints, LinkClosure, SlideOutput
from jounce.testing.samples import group_of, pose_of, random_motion
from tests.constraints.test_wheels import sleigh
from tests.problems.drawings import (
    as_drawn,
    assert_same,
    at,
    counted,
    random_drawings,
    redrawn,
    shifts,
    with_all_outputs,
)

ORDER = 3
INSTANTS = [0.0, 0.3, 0.8]
DRAWINGS = {
    "as the ground": [1, 0, 0, 0],
    "x along the axle": [0.5**0.5, 0, -(0.5**0.5), 0],
    "y along the axle": [0.5**0.5, 0.5**0.5, 0, 0],
    "half a turn": [0, 1, 0, 0],
}
LAW = "0.4 + 0.7*t + 0.4*sin(2*t)"
TURNED = Rotation.from_rotvec([0.7, -1.1, 0.4])
LOSING = jn.joints.GearFriction(speed=0.7, efficiency=0.9, backward=0.6)


def rates_of_law():
    """Derivatives 2 and 3 of the law, at the instants, from its closed form."""
    t = np.array(INSTANTS)
    return np.stack([0.4 * 2**k * np.sin(2 * t + k * np.pi / 2) for k in (2, 3)], axis=-1)


def law_at_instants():
    return 0.4 + 0.7 * np.array(INSTANTS) + 0.4 * np.sin(2 * np.array(INSTANTS))


def rotor(quaternion, vectors=None, tilt=0.0):
    """A symmetric rotor on a hinge along z of the ground, driven, with its frame drawn at will."""
    attitude = Rotation.from_quat(quaternion, scalar_first=True)
    axle = attitude.inv().apply([0, 0, 1])
    inertia = 1.3 * np.eye(3) + (2.0 - 1.3) * np.outer(axle, axle)
    guess = (Rotation.from_rotvec([tilt, -tilt, 0]) * attitude).as_quat(scalar_first=True)
    z, o, bodies = [0, 0, 1], [0, 0, 0], ("ground", "rotor")
    if vectors is not None:
        vectors = vectors[0], attitude.inv().apply(vectors[1]).tolist()
    return jn.Mechanism(
        space="spatial",
        bodies={"rotor": jn.Body(o, orientation=guess.tolist(), mass=1.0, inertia=inertia.tolist())},
        joints={"axle": spatial.Revolute(bodies, o, o, z, axle.tolist())},
        drivers={"motor": drivers.RotationDriver(bodies, z, LAW, *(vectors or ()))},
        outputs={
            "bearing": JointTorqueOutput("axle"),
            "motor": DriverTorqueOutput("motor"),
            "on_rotor": JointTorqueOutput("motor"),
            "angle": jn.outputs.RelativeAngleOutput(bodies, z, *(vectors or ())),
        },
    )


@pytest.mark.slow
@pytest.mark.parametrize("tilt", [0.0, 0.2], ids=["guess assembled", "guess tilted"])
@pytest.mark.parametrize("quaternion", DRAWINGS.values(), ids=DRAWINGS)
def test_the_bearing_of_a_driven_rotor_carries_nothing(quaternion, tilt):
    found = jn.solve(rotor(quaternion, tilt=tilt), INSTANTS, order=1).outputs
    torque = 2.0 * rates_of_law()
    scale = np.abs(torque).max(axis=0)
    assert (np.abs(found["motor"] - torque) <= 1e-13 * scale).all()
    assert (np.abs(found["bearing"]).max(axis=-1) <= 1e-13 * scale).all()
    assert (np.abs(found["on_rotor"][..., 2] - torque) <= 1e-13 * scale).all()
    assert (np.abs(found["on_rotor"][..., :2]).max(axis=-1) <= 1e-13 * scale).all()
    np.testing.assert_allclose(found["angle"][:, 0], law_at_instants(), atol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("tilt", [0.0, 0.2], ids=["guess assembled", "guess tilted"])
def test_nor_does_it_where_a_vector_of_the_driver_points_beside_the_plane_of_the_turn(tilt):
    driven = rotor(DRAWINGS["x along the axle"], ([1, 0, 0.4], [0.6, 0.8, 1.5]), tilt)
    found = jn.solve(driven, INSTANTS, order=1).outputs
    torque = 2.0 * rates_of_law()
    scale = np.abs(torque).max(axis=0)
    assert (np.abs(found["motor"] - torque) <= 1e-13 * scale).all()
    assert (np.abs(found["bearing"]).max(axis=-1) <= 1e-13 * scale).all()
    np.testing.assert_allclose(found["angle"][:, 0], law_at_instants(), atol=1e-14)


def solid(random):
    """Mass, center of mass and inertia of a body in space."""
    spread = random.normal(size=(3, 3))
    spread = 0.05 * spread @ spread.T + 0.05 * np.eye(3)
    tensor = (np.trace(spread) * np.eye(3) - spread).tolist()
    return {
        "mass": random.uniform(0.5, 3.0),
        "center_of_mass": random.uniform(-0.1, 0.1, 3).tolist(),
        "inertia": tensor,
    }


def wave(start, rate, swing, frequency):
    """A law of a driver; all of them are one formula, and what moves by it is compiled once."""
    values = (float(value) for value in (start, rate, swing, frequency))
    parameters = dict(zip(("start", "rate", "swing", "frequency"), values, strict=True))
    return jn.laws.ExpressionMotion("start + rate*t + swing*sin(frequency*t)", parameters)


def in_space(seed, bodies, **elements):
    """A mechanism in space, with masses and gravity, its bodies near to how they go together."""
    random = np.random.default_rng(seed)
    near = [1.0, 0.05, -0.04, 0.03]
    bodies = {name: jn.Body(place, orientation=near, **solid(random)) for name, place in bodies.items()}
    return jn.Mechanism(space="spatial", gravity=[0.4, -0.7, -9.81], bodies=bodies, **elements)


ZERO, A, B, C, Z = [0.0, 0.0, 0.0], [1.0, 0.2, -0.1], [-0.2, 1.0, 0.1], [0.3, 0.5, 0.4], [0.1, -0.2, 1.0]


def arm():
    """A rotor on a hinge with a tube that turns and slides on it."""
    return in_space(
        5,
        {"rotor": [0, 0, 0], "tube": [0.9, 0.2, 0.3]},
        joints={
            "axle": spatial.Revolute(("ground", "rotor"), ZERO, ZERO, Z, Z),
            "sleeve": spatial.Cylindrical(("rotor", "tube"), [0.7, 0.1, 0.2], ZERO, B, B),
        },
        drivers={
            "spin": drivers.RotationDriver(("ground", "rotor"), Z, wave(0.4, 0.7, 0.4, 2.0), A, [1.0, 0.3, 0.5]),
            "roll": drivers.RotationDriver(("tube", "rotor"), B, wave(0.1, -0.3, 0.2, 1.5)),
            "extend": drivers.SpatialSlideDriver(("rotor", "tube"), [0.7, 0.1, 0.2], ZERO, B, wave(0.1, 0, 0.05, 3.0)),
        },
        forces={
            "slide_spring": forces.SlideSpring(("ground", "tube"), ZERO, C, B, 5.0, 0.1, 0.2),
            "torque": forces.SpatialTorque(("ground", "tube"), Z, "2*sin(x) - 0.3*v"),
        },
        outputs={
            "angle": jn.outputs.RelativeAngleOutput(("ground", "rotor"), Z),
            "tilted": jn.outputs.RelativeAngleOutput(("ground", "tube"), Z),
            "between": jn.outputs.RelativeAngleOutput(("ground", "tube"), Z, A, B),
            "rate": jn.outputs.AngularVelocityOutput("tube"),
            "own_rate": jn.outputs.AngularVelocityOutput("tube", "body"),
        },
    )


def cross():
    """A cross on a universal joint, turned about two axes that tilt against it."""
    return in_space(
        6,
        {"cross": [0, 2, 0]},
        joints={"hooke": spatial.Universal(("ground", "cross"), [0, 2, 0], ZERO, [1, 0, 0.1], [0, 1, 0.2])},
        drivers={
            "pitch": drivers.RotationDriver(("ground", "cross"), [0, 1, 0], wave(0.2, 0.1, 0.4, 1.0)),
            "yaw": drivers.RotationDriver(("ground", "cross"), [1, 0.1, 0.2], wave(0.3, -0.2, 0.1, 2.0)),
        },
        forces={
            "twist": forces.SpatialTorsionalSpring(("ground", "cross"), Z, 3.0, 0.1, 0.2),
            "moment": forces.SpatialMoment("cross", ["0.3 + t", "0.2*wx - 0.1*t", "-0.4*wy*wz"]),
            "own_moment": forces.SpatialMoment("cross", ["0.5 - wz", "t**2", "0.2*wx*wy"], "body"),
        },
    )


def linkage():
    """A ram on a guide that carries a link, held by rods and on a plane."""
    along = [1, 0, 0.1]
    return in_space(
        7,
        {"ram": [0.4, 3.0, 1.0], "link": [0.8, 3.4, 1.3]},
        joints={
            "guide": spatial.Prismatic(("ground", "ram"), [0, 3, 1], ZERO, along, along, [0, 1, 0], [0, 1, 0]),
            "ball": spatial.Spherical(("ram", "link"), [0.4, 0.4, 0.3], ZERO),
            "rod": spatial.DoubleSpherical(("ground", "link"), [0.9, 4.4, 2.0], [0.3, 0.1, 0.2], 1.05),
            "second_rod": spatial.DoubleSpherical(("ram", "link"), [0.3, 0.9, -0.6], [0, 0.5, 0.1], 1.0),
            "plane": spatial.Dot2(("ground", "link"), [1.5, 3.5, 1.45], [0.5, 0.1, 0.1], [0.1, 1.0, 0.2]),
        },
        drivers={"reach": drivers.SpatialDistanceDriver(("ground", "ram"), [0, 2, 0.5], ZERO, wave(1.3, 0, 0.1, 1.0))},
        forces={
            "spring": forces.Spring(("ram", "link"), C, A, 12.0, 0.8, 0.3),
            "distance_force": forces.DistanceForce(("ground", "link"), ZERO, C, "3*x - v + t"),
            "wind": forces.SpatialPointForce("link", A, ["x + t - vy", "0.2*cos(y)", "-0.7*z*vx"]),
            "thrust": forces.SpatialPointForce("link", C, ["1 + t - vx", "0.2*x*vz", "-0.7*z"], "body"),
        },
        outputs={
            "distance": jn.outputs.DistanceOutput(("ram", "link"), C, A),
            "slide": SlideOutput(("ram", "link"), C, A, B),
            "caster": jn.outputs.ProjectedAngleOutput(("ram", "link", "link"), B, A, ZERO, C),
            "center": jn.outputs.SpatialInstantCenterOutput(("ram", "link"), C, B),
            "own_center": jn.outputs.SpatialInstantCenterOutput(("ram", "link"), C, B, "body"),
            "roll_center": jn.outputs.RollCenterOutput(("ground", "ram", "link"), A, B, C),
        },
    )


def screw():
    """A nut on a screw, a wheel that stands on its own, and a lid that follows the nut as it screws on the wheel."""
    upright, closed = [0.1, 0.2, 1.0], Rotation.from_rotvec([0.2, -0.1, 0.3])
    scalar, *vector = closed.as_quat(scalar_first=True).tolist()
    side = [1.0, 0.3, -0.2]
    socket = [[1, 0, 0.1, 0, 0, 0], [0.2, 1, 0, 0, 0, 0], [0, -0.1, 1, 0, 0, 0]]
    bearing = [[*x, 0, 0, 0] for x in ([10, 0, -1], [0, 5, -1])] + [[0, 0, 0, *x] for x in ([10, 0, -1], [0, 5, -1])]
    return in_space(
        8,
        {"nut": [2, 0, 0.1], "wheel": [0, 2, 0], "lid": [0.3, 2.1, 0.4]},
        joints={
            "thread": spatial.Screw(("ground", "nut"), [2, 0, 0], ZERO, Z, Z, 0.3),
            "socket": LinkClosure(("ground", "wheel"), [0, 2, 0], ZERO, socket),
            "level": spatial.Dot1(("ground", "wheel"), [1, 0, 0], [0.1, 0, 1]),
            "upright": spatial.Dot1(("ground", "wheel"), [0, 1, 0], [0, 0.2, 1]),
            "lid_thread": LinkClosure(
                ("wheel", "lid"), [0.3, 0.1, 0.4], ZERO, [*bearing, [*upright, 0.05, 0.1, 0.5]], vector, scalar
            ),
            "follow": CoupledJoints(
                ("ground", "nut", "wheel", "lid"), "ijmn", "slide-turn",
                *([2, 0, 0], Z, side, side),
                *([0.3, 0.1, 0.4], upright, side, closed.inv().apply(side).tolist()),
                weight_1=2.0, weight_2=1.0, offset=0.1, period=2 * np.pi,
            ),
        },
        drivers={
            "feed": drivers.SpatialDistanceDriver(("ground", "nut"), [2, 0, -1], ZERO, wave(1.1, 0.2, 0, 1)),
            "crank": drivers.SpatialDistanceDriver(
                ("ground", "wheel"), [0.8, 2.5, 0.3], [0.5, 0.1, 0], wave(0.55, 0, 0.05, 1.0)
            ),
        },
        forces={
            "slide_force": forces.SlideForce(("nut", "lid"), C, ZERO, A, "sin(x) - 0.2*v"),
            "torsion": forces.SpatialTorsionalSpring(("ground", "wheel"), A, 7.0, 0.2, 0.1, [0, 1, 0.3], B),
            "torque": forces.SpatialTorque(("lid", "ground"), Z, "2*sin(x) - 0.3*v", A, C),
        },
    )  # fmt: skip


def couplings():
    """Shafts behind one another, joined by couplings, the last on a plane, and a body welded to the first."""
    along, up = [0.1, -0.2, 1.0], [0.0, 0.0, 1.0]
    return in_space(
        9,
        {"first": [0, 0, 0], "second": [0, 0, 1], "third": [0.05, 0.02, 2], "fourth": [0, 0, 2.5], "plate": [1, 0, 0]},
        joints={
            "axle": spatial.Revolute(("ground", "first"), ZERO, ZERO, along, along),
            "ball": spatial.ConstantVelocity(("first", "second"), up, ZERO, up, [0.1, 0, 1]),
            "disc": spatial.Oldham(("second", "third"), up, ZERO, up, up, [1, 0.1, 0.2], [0.1, 1, 0]),
            "tripod": spatial.Tripod(("third", "fourth"), [0, 0, 0.5], ZERO, up, up, [1, 0, 0.1], [1, 0.1, 0], 0.2),
            "table": spatial.PlaneOnPlane(("ground", "fourth"), [0, 0, 2.5], ZERO, along, along),
            "weld": spatial.Fixed(("first", "plate"), A, ZERO, Z, Z, A, A),
        },
        drivers={
            "spin": drivers.RotationDriver(("ground", "first"), along, wave(0.1, 0.7, 0.4, 2.0)),
            "tilt": drivers.SpatialDistanceDriver(("ground", "second"), [1, 0, 2], up, wave(1.0, 0, 0.1, 1.0)),
            "lean": drivers.SpatialDistanceDriver(("ground", "second"), [0, 1, 2], up, wave(0.95, 0, 0.05, 2.0)),
            "aside": drivers.SpatialSlideDriver(("second", "third"), up, ZERO, [1, 0, 0], wave(0.05, 0, 0.02, 2.0)),
            "away": drivers.SpatialSlideDriver(("second", "third"), up, ZERO, [0, 1, 0], wave(0.02, 0, 0.03, 1.0)),
        },
    )


def tracks():
    """A rotor with a curve and a surface, on which a bead and a puck are moved that keep their attitudes to it."""
    x, y, z = np.eye(3).tolist()
    held = {
        f"{body}_{k}": spatial.Dot1(("rotor", body), a, b)
        for body in ("bead", "puck")
        for k, (a, b) in enumerate(((x, y), (y, z), (z, x)))
    }
    curve, surface = ["0.6*cos(s)", "0.5*sin(s)", "0.3*s"], ["0.4*u", "0.5*v", "1 + 0.2*u**2 - 0.1*u*v"]
    return in_space(
        10,
        {"rotor": [0, 0, 0], "bead": [0.5, 0.2, 0.1], "puck": [0.2, 0.2, 1]},
        joints={
            "axle": spatial.Revolute(("ground", "rotor"), ZERO, ZERO, Z, Z),
            "groove": spatial.SpatialCurve(("rotor", "bead"), curve, [0.1, 0.05, 0.0], start=0.5),
            "bowl": spatial.Surface(("rotor", "puck"), surface, [0.0, 0.05, 0.1], start_u=0.5, start_v=0.4),
            **held,
        },
        drivers={
            "spin": drivers.RotationDriver(("ground", "rotor"), Z, wave(0.1, 0.7, 0.4, 2.0)),
            "up": drivers.SpatialSlideDriver(("rotor", "bead"), ZERO, ZERO, z, wave(0.15, 0.1, 0.05, 2.0)),
            "along": drivers.SpatialSlideDriver(("rotor", "puck"), ZERO, ZERO, x, wave(0.2, 0.1, 0.05, 2.0)),
            "across": drivers.SpatialSlideDriver(("rotor", "puck"), ZERO, ZERO, y, wave(0.2, 0.1, 0.05, 1.0)),
        },
        outputs={"place": jn.outputs.ParameterOutput("groove"), "places": jn.outputs.ParametersOutput("bowl")},
    )


def shafts():
    """A cage that turns, with a shaft on it about another axis that rolls on a gear beside it, and this on a rack."""
    across, along, x = [0.3, 1.0, -0.2], [1.0, 0.5, 0.0], [1.0, 0.0, 0.0]
    line = np.array([0, 0.5, 0.2]) - 0.3 * np.cross(along, Z) / np.linalg.norm(np.cross(along, Z))
    return in_space(
        9,
        {
            "cage": [0, 1, 0],
            "sun": [0, 1.5, 0.2],
            "planet": [0.5, 1.2, 0.1],
            "idler": [0.1, 1.3, -0.3],
            "rack": [0, 1.8, 0.2],
        },
        joints={
            "C": spatial.Revolute(("ground", "cage"), [0, 1, 0], ZERO, Z, Z),
            "S": spatial.Revolute(("cage", "sun"), [0, 0.5, 0.2], ZERO, Z, Z),
            "P": spatial.Revolute(("cage", "planet"), [0.5, 0.2, 0.1], ZERO, across, across),
            "mesh": spatial.Gear(
                ("sun", "planet", "cage"), Z, [0.6, 2.0, -0.4], -3 / 7, None, LOSING, ZERO, ZERO, [0.3, 0.35, 0.1], 0.3
            ),
            "I": spatial.Revolute(("cage", "idler"), [0.1, 0.3, -0.3], ZERO, x, x),
            "by_ratio": spatial.Gear(("sun", "idler", "cage"), Z, x, 2 / 5),
            "guide": spatial.Prismatic(("cage", "rack"), line.tolist(), ZERO, along, along, x, x),
            "teeth": spatial.Rolling(("rack", "sun"), [0.42, 0.16, 0.2], ZERO, along, Z, Z, 0.3, None, 0.35, LOSING),
        },
        drivers={
            "turn": drivers.RotationDriver(("ground", "cage"), Z, wave(0.3, 0.2, 0.4, 1.5), A, [1.0, 0.3, 0.5]),
            "spin": drivers.RotationDriver(("ground", "sun"), Z, wave(0.4, 0.7, 0.4, 2.0), A, [1.0, 0.3, 0.5]),
        },
    )


def teeth():
    """A sun, a planet on an arm, a ring, and a rack that the ring drives, unbalanced, with pressure angles."""
    o, x, angle = [0.0, 0.0], [1.0, 0.0], 0.35
    massive = {"mass": 1.3, "inertia": 0.2, "center_of_mass": [0.1, -0.05]}
    places = {"sun": o, "arm": o, "planet": [0.5, 0], "ring": o, "rack": [0.4, 0.7]}
    return jn.Mechanism(
        space="planar",
        gravity=[0.3, -9.81],
        bodies={body: jn.Body(at, **massive) for body, at in places.items()},
        joints={
            "S": planar.Revolute(("ground", "sun"), o, o),
            "A": planar.Revolute(("ground", "arm"), o, o),
            "P": planar.Revolute(("arm", "planet"), [0.5, 0], o),
            "R": planar.Revolute(("ring", "ground"), o, o),
            "inner": planar.Gear(("sun", "planet"), None, None, o, o, 0.3, 0.2, angle, LOSING),
            "outer": planar.Gear(("ring", "planet"), None, None, o, o, -0.7, 0.2, angle, LOSING),
            "guide": planar.Prismatic(("ground", "rack"), [0, 0.7], o, x, x),
            "teeth": planar.Rolling(("rack", "ring"), o, o, x, 0.7, None, angle, LOSING),
        },
        drivers={
            "turn": drivers.CoordinateDriver(("ground", "arm"), "angle", "0.5*t + 0.3*sin(2*t)"),
            "spin": drivers.CoordinateDriver(("ground", "sun"), "angle", "2*t + sin(3*t)"),
        },
        forces={"wind": forces.PointForce("rack", [0.1, 0.2], ["t - x", "0.3 - vx"])},
    )


def lines():
    """Belts on a swinging arm and to a wheel that slides away, and a rope over a crank to a weight, unbalanced."""
    o, x = [0.0, 0.0], [1.0, 0.0]
    massive = {"mass": 1.3, "inertia": 0.2, "center_of_mass": [0.1, -0.05]}
    places = {"arm": o, "motor": o, "tool": [1.0, 0], "sled": [-1.5, 0.2], "weight": [2.0, -1.0], "pulley": [-1.5, 0.2]}
    return jn.Mechanism(
        space="planar",
        gravity=[0.3, -9.81],
        bodies={body: jn.Body(at, **massive) for body, at in places.items()},
        joints={
            "A": planar.Revolute(("ground", "arm"), o, o),
            "M": planar.Revolute(("ground", "motor"), o, o),
            "T": planar.Revolute(("arm", "tool"), x, o),
            "guide": planar.Prismatic(("ground", "sled"), [0, 0.2], o, x, x),
            "P": planar.Revolute(("sled", "pulley"), o, o),
            "post": planar.Prismatic(("ground", "weight"), [2.0, 0], o, [0, 1], [0, 1]),
            "open": planar.Belt(("motor", "tool"), o, o, 0.3, 0.2, friction=LOSING),
            "wide": planar.Belt(("motor", "pulley"), o, o, 0.4, 0.1, crossed=True, friction=LOSING),
            "rope": jn.joints.Rope(("tool", "ground", "weight"), [[0.1, 0.05], [2.0, 1.5], [0.1, 0.2]], 4.5),
        },
        drivers={
            "swing": drivers.CoordinateDriver(("ground", "arm"), "angle", "0.5*t + 0.3*sin(2*t)"),
            "spin": drivers.CoordinateDriver(("ground", "motor"), "angle", "2*t + sin(3*t)"),
            "slide": drivers.SlideDriver(("ground", "sled"), [0, 0.2], o, x, "-1.5 + 0.2*sin(2*t)"),
        },
        forces={"wind": forces.PointForce("pulley", [0.1, 0.2], ["t - x", "0.3 - vx"])},
    )


def rubbing():
    """A slider-crank, and a block that a pin of the rod takes along in a slot, with friction in all joints."""
    o, x, y = [0.0, 0.0], [1.0, 0.0], [0.0, 1.0]
    massive = {"mass": 1.3, "inertia": 0.2, "center_of_mass": [0.1, -0.05]}
    pin, guide = jn.joints.Friction(0.2, 0.03, 0.05), jn.joints.Friction(0.15, 0.02)
    return jn.Mechanism(
        space="planar",
        gravity=[0.3, -9.81],
        bodies={
            "crank": jn.Body(o, 0.5, **massive),
            "rod": jn.Body([0.35, 0.19], -0.2, **massive),
            "piston": jn.Body([1.35, 0.0], **massive),
            "block": jn.Body([0.85, -1.0], **massive),
        },
        joints={
            "O": planar.Revolute(("ground", "crank"), o, o, friction=pin),
            "A": planar.Revolute(("crank", "rod"), [0.4, 0], o, friction=pin),
            "B": planar.Revolute(("piston", "rod"), o, x, friction=pin),
            "guide": planar.Prismatic(("ground", "piston"), o, o, x, x, friction=guide),
            "track": planar.Prismatic(("ground", "block"), [0, -1], o, x, x, friction=guide),
            "slot": planar.Parallel2(("block", "rod"), o, [0.5, 0.1], y, friction=guide),
        },
        drivers={"turn": drivers.CoordinateDriver(("ground", "crank"), "angle", LAW)},
    )


def rubbing_in_space():
    """A chain of bodies, each driven in all that its joint leaves it, with friction in all joints."""
    turning, sliding = jn.joints.Friction(0.2, 0.03, 0.05), jn.joints.Friction(0.15, 0.02)
    x, y, up = [1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]
    chain = ("ground", "hinge", "tube", "sled", "nut", "plate", "ball")
    pairs = dict(zip(chain[1:], itertools.pairwise(chain), strict=True))
    places = {name: [0.3 * k, 0.1 * k, 0.05 * k] for k, name in enumerate(chain) if k}
    step, turn = [0.3, 0.1, 0.05], wave(0.1, 0.5, 0.2, 2.0)
    return in_space(
        9,
        places,
        joints={
            "hinge": spatial.Revolute(pairs["hinge"], step, ZERO, Z, Z, friction=turning),
            "sleeve": spatial.Cylindrical(pairs["tube"], step, ZERO, B, B, friction=turning),
            "guide": spatial.Prismatic(pairs["sled"], step, ZERO, A, A, up, up, friction=sliding),
            "thread": spatial.Screw(pairs["nut"], step, ZERO, B, B, 0.3, friction=turning),
            "table": spatial.PlaneOnPlane(pairs["plate"], step, ZERO, up, up, friction=sliding),
            "socket": spatial.Spherical(pairs["ball"], step, ZERO, friction=turning),
            "level": spatial.Dot1(pairs["ball"], x, up),
            "square": spatial.Dot1(pairs["ball"], y, up),
        },
        drivers={
            "turn": drivers.RotationDriver(pairs["hinge"], Z, turn),
            "roll": drivers.RotationDriver(pairs["tube"], B, turn),
            "extend": drivers.SpatialSlideDriver(pairs["tube"], step, ZERO, B, wave(0.0, 0.2, 0.05, 3.0)),
            "slide": drivers.SpatialSlideDriver(pairs["sled"], step, ZERO, A, wave(0.0, 0.2, 0.05, 3.0)),
            "screw": drivers.RotationDriver(pairs["nut"], B, turn),
            "along": drivers.SpatialSlideDriver(pairs["plate"], step, ZERO, x, wave(0.0, 0.2, 0.05, 3.0)),
            "across": drivers.SpatialSlideDriver(pairs["plate"], step, ZERO, y, wave(0.0, 0.1, 0.05, 2.0)),
            "twist": drivers.RotationDriver(pairs["plate"], up, turn),
            "spin": drivers.RotationDriver(pairs["ball"], up, turn),
        },
    )


def cams():
    """Shafts behind one another, a sled and a flap, each after what moves before it by the law of a cam."""
    shaft, rocker = ("ground", "shaft"), ("shaft", "rocker")
    up, side = [0, 0, 1.0], [1.0, 0, 0]
    turning = drivers.RotationDriver(shaft, Z, 0.0)
    nodding = drivers.RotationDriver(rocker, B, "0.3*t + 0.1*cos(2*t)")
    sliding = drivers.SpatialSlideDriver(("ground", "sled"), [1, 0, 0], ZERO, A, "1.1 + 0.1*sin(t)")
    folding = drivers.RotationDriver(("sled", "flap"), B, "0.3 + (t - 1)**2 - 0.2*t", A, [1.0, 0.3, 0.5])
    lean = drivers.RotationDriver(rocker, B, 0.0, A, [1.0, 0.3, 0.5])
    return in_space(
        11,
        {"shaft": ZERO, "rocker": [0.3, 0.5, 0.4], "sled": [2.1, 0.2, -0.1], "flap": [2.3, 0.2, 0.2]},
        joints={
            "axle": spatial.Revolute(shaft, ZERO, ZERO, Z, Z),
            "pivot": spatial.Revolute(rocker, C, ZERO, B, B),
            "guide": spatial.Prismatic(("ground", "sled"), [1, 0, 0], ZERO, A, A, up, up),
            "hinge": spatial.Revolute(("sled", "flap"), [0.2, 0, 0.3], ZERO, B, B),
            "nod": jn.joints.Cam(nodding, turning),
            "lift": jn.joints.Cam(sliding, lean),
            "fold": jn.joints.Cam(folding, sliding),
        },
        drivers={"motor": drivers.RotationDriver(shaft, Z, wave(0.2, 0.7, 0.4, 2.0), side, side)},
        outputs={"on_rocker": CamTorqueOutput("nod"), "on_sled": CamForceOutput("lift")},
    )


def ropes():
    """A lever in space that lifts a weight by a rope through two rings of the ground."""
    return in_space(
        6,
        {"lever": ZERO, "weight": [1.0, 1.0, -0.6]},
        joints={
            "A": spatial.Revolute(("ground", "lever"), ZERO, ZERO, Z, Z),
            "post": spatial.Prismatic(
                ("ground", "weight"), [1, 1, 0], ZERO, [0, 0, 1], [0, 0, 1], [1, 0, 0], [1, 0, 0]
            ),
            "rope": jn.joints.Rope(("lever", "ground", "weight"), [C, [1.0, 1.1, 0.5], [0.1, 0.2, 0.1]], 2.0),
        },
        drivers={"motor": drivers.RotationDriver(("ground", "lever"), Z, wave(0.2, 0.3, 0.2, 2.0))},
    )


def all_in_the_plane():
    """The same in the plane."""
    o, x, y = [0.0, 0.0], [1.0, 0.1], [-0.1, 1.0]
    massive = {"mass": 1.3, "inertia": 0.2, "center_of_mass": [0.1, -0.05]}

    def body(at, angle):
        return jn.Body(at, angle, **massive)

    return jn.Mechanism(
        space="planar",
        gravity=[0.3, -9.81],
        bodies={
            "crank": body([0, 0], 0.5),
            "rocker": body([2, 0], 1.4),
            "gear": body([0.4, 0.2], 0.3),
            "planet": body([-2, 0], 0.1),
            "block": body([1.0, -1.0], 0.1),
            "pin": body([1.2, -2.0], 0.2),
            "disc": body([3.0, 1.0], 0.0),
            "wheel": body([5.0, 1.0], 0.4),
            "second": body([6.0, 1.0], 0.3),
            "plate": body([7.0, 1.4], 0.7),
            "bead": body([0.53, 0.38], 0.2),
        },
        joints={
            "A": planar.Revolute(("ground", "crank"), o, o),
            "D": planar.Revolute(("ground", "rocker"), [2, 0], o),
            "BC": planar.DoubleRevolute(("crank", "rocker"), [0.6, 0], [1.2, 0], 1.9),
            "G": planar.Revolute(("crank", "gear"), [0.4, 0], o),
            "mesh": planar.Gear(("rocker", "gear", "crank"), -1.5, friction=LOSING),
            "P": planar.Revolute(("ground", "planet"), [-2, 0], o),
            "pair": planar.Coordinate(("crank", "planet"), "angle", -2.0),
            "guide": planar.Prismatic(("ground", "block"), [0, -1], o, x, x),
            "level": planar.Parallel1(("block", "pin"), y, y),
            "slot": planar.Parallel2(("block", "pin"), [0.2, 0], o, y),
            "line": planar.Parallel2(("ground", "disc"), [3.0, 1.0], o, x),
            "rolling": planar.Rolling(("ground", "disc"), [3.0, 1.3], o, x, 0.3),
            "axle": planar.Revolute(("disc", "wheel"), [2.0, 0], o),
            "W": planar.Revolute(("wheel", "second"), [1.0, 0], o),
            "weld": planar.Fixed(("second", "plate"), x, [-0.1, 0.2]),
            "track": planar.PlanarCurve(("crank", "bead"), ["0.3*cos(s) + 0.5", "0.2*sin(s)"], [0.1, 0.05], start=0.5),
        },
        drivers={
            "turn": drivers.CoordinateDriver(("ground", "crank"), "angle", LAW),
            "push": drivers.SlideDriver(("ground", "block"), [0, -1], o, x, "1 + 0.2*sin(2*t)"),
            "reach": drivers.DistanceDriver(("ground", "pin"), [0.5, 0.3], o, "2.4 + 0.1*t"),
            "roll": drivers.SlideDriver(("ground", "disc"), [0, 0.7], o, x, "3 + 0.5*t"),
            "swing": drivers.CoordinateDriver(("disc", "wheel"), "angle", "0.3*t**2"),
            "fold": drivers.CoordinateDriver(("wheel", "second"), "angle", "sin(t)", 0.5),
            "tilt": drivers.CoordinateDriver(("ground", "bead"), "angle", "0.2 + 0.3*t"),
            "along": drivers.SlideDriver(("crank", "bead"), o, [0.1, 0.05], [1.0, 0.0], "0.76 - 0.1*t"),
        },
        forces={
            "spring": forces.Spring(("crank", "pin"), x, o, 10.0, 0.5, 0.2),
            "slide_spring": forces.SlideSpring(("ground", "rocker"), o, x, y, 5.0, 0.1, 0.2),
            "torsion": forces.TorsionalSpring(("crank", "rocker"), 3.0, 0.2, 0.1),
            "distance_force": forces.DistanceForce(("disc", "pin"), o, o, "3*x - v + t"),
            "slide_force": forces.SlideForce(("crank", "block"), x, o, y, "sin(x) - 0.2*v"),
            "torque": forces.Torque(("ground", "planet"), "2*sin(x) - 0.3*v"),
            "moment": forces.Moment("wheel", "0.3*x**2 - v"),
            "wind": forces.PointForce("second", y, ["x - vx*t", "0.2*cos(y) - vy"]),
            "thrust": forces.PointForce("second", x, ["1 + t - 0.1*vx", "0.2*cos(x)*vy"], "body"),
        },
        outputs={
            "angle": jn.outputs.AngleOutput("gear"),
            "between": jn.outputs.PlanarRelativeAngleOutput(("rocker", "gear")),
            "distance": jn.outputs.DistanceOutput(("planet", "pin"), x, y),
            "slide": SlideOutput(("planet", "pin"), x, y, y),
            "rate": jn.outputs.AngularVelocityOutput("rocker"),
            "own_rate": jn.outputs.AngularVelocityOutput("rocker", "body"),
            "place": jn.outputs.ParameterOutput("track"),
            "centrode": jn.outputs.InstantCenterOutput(("crank", "rocker")),
            "own_centrode": jn.outputs.InstantCenterOutput(("crank", "rocker"), "body"),
        },
    )


def drawn(motion, frames):
    """The quaternions of a random motion of bodies, with each frame turned: products with constant quaternions."""
    p, q = np.moveaxis(motion["quaternion"], 1, 0), np.moveaxis(frames, 1, 0)
    turned = [
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] + p[2] * q[0] + p[3] * q[1] - p[1] * q[3],
        p[0] * q[3] + p[3] * q[0] + p[1] * q[2] - p[2] * q[1],
    ]
    return {**motion, "quaternion": np.stack(turned, axis=1)}


@pytest.mark.parametrize("seed", range(5))
def test_an_angle_between_bodies_in_any_motion_changes_by_a_constant_with_their_frames(seed):
    """The axis tilts by far; from order 1 on nothing changes, and the value by that of the frames at the datum."""
    random = np.random.default_rng(seed)
    axis = random.normal(size=3)
    first = random_motion(random, "spatial", ORDER)
    frames = Rotation.random(2, random_state=random)
    turned = np.ones((5, 1))[None, None] * np.array([1.0, 0, 0, 0])[None, :, None, None]
    for body, frame in zip((1, 2), frames, strict=True):
        turned[0, :, body, 0] = frame.as_quat(scalar_first=True)
    found = []
    for motion, around in ((first, axis), (drawn(first, turned), frames[0].inv().apply(axis))):
        pose = pose_of(motion)
        output = jn.outputs.RelativeAngleOutput(("one", "two"), around.tolist())
        start = {"quaternion": np.array(pose.quaternion.coefficients[0])}
        (group,) = with_datums([group_of([output], "spatial")], start)
        plain = group_of([output], "spatial").evaluate(pose.truncate(0)).coefficients[0]
        result = np.array(group.evaluate(pose).dense().coefficients).reshape(ORDER + 1)
        turns = (result[0] - float(np.squeeze(plain))) / (2 * np.pi)
        assert turns == pytest.approx(np.round(turns), abs=1e-12)
        found.append(result)
    np.testing.assert_allclose(found[1][1:], found[0][1:], rtol=1e-11, atol=1e-11)
    assert np.abs(found[0][1:]).min() > 1e-4


ORDERS = {"plane": 2, "cross": 2, "linkage": 1}  # rates of forces; of the others forces alone, which compile long
MECHANISMS = {
    "plane": all_in_the_plane,
    "arm": arm,
    "cross": cross,
    "linkage": linkage,
    "screw": screw,
    "couplings": couplings,
    "tracks": tracks,
}
MECHANISMS |= {
    "shafts": shafts,
    "teeth": teeth,
    "lines": lines,
    "ropes": ropes,
    "cams": cams,
    "rubbing": rubbing,
    "rubbing_in_space": rubbing_in_space,
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", [arm, screw])
def test_an_attitude_is_the_same_with_either_sign_of_its_euler_parameters(kind):
    mechanism = kind()
    gaps = residual(mechanism)
    for name, body in mechanism.bodies.items():
        other = dataclasses.replace(body, orientation=[-part for part in body.orientation])
        found = residual(dataclasses.replace(mechanism, bodies={**mechanism.bodies, name: other}))
        np.testing.assert_allclose(found, gaps, rtol=0, atol=1e-14)


def residual(mechanism):
    """Return by how much all joints and drivers are open at the guess."""
    model = build(mechanism)
    pose, instant = pose_at(model.guess, model.pose_type), jn.Jet([np.zeros((1, 1))])
    return np.array(model.system.residual(pose, instant).coefficients[0])


@pytest.mark.slow
@pytest.mark.parametrize("name", MECHANISMS)
def test_no_quantity_depends_on_how_frames_are_drawn(name):
    """Every body and the ground with other random frames: the same motion and the same forces, with their rates.

    Their powers balance the rates of the energies, which share no code with the forces but the motion.
    """
    mechanism, random = with_all_outputs(MECHANISMS[name]()), np.random.default_rng(2)
    same, order = dict.fromkeys(counted(mechanism), 0.0), ORDERS.get(name, 0)
    kept = jn.solve(redrawn(mechanism, as_drawn(mechanism), same), INSTANTS, order)
    balance = jn.energy.power_balance(kept)
    assert float(balance["scale"].min()) > 0
    assert (np.abs(balance["residual"]) <= 1e-12 * balance["scale"].max("time")).all(), balance["residual"].values
    for _ in range(2):
        drawings = random_drawings(mechanism, random)
        moved = shifts(mechanism, kept.poses[1], drawings)
        found = jn.solve(redrawn(at(mechanism, kept.poses[1]), drawings, moved), INSTANTS, order)
        assert_same(mechanism, kept.outputs, found.outputs, drawings, moved)


@pytest.mark.slow
def test_wheels_roll_the_same_however_frames_are_drawn():
    """The sleigh of Chaplygin on a plane that lies askew, from its start on: all that can be asked of it."""
    made, random = with_all_outputs(sleigh(TURNED)), np.random.default_rng(4)
    assert not counted(made)
    kept = jn.simulate(redrawn(made, as_drawn(made), {}), [0.0, 0.4, 1.1], order=2)
    for _ in range(2):
        drawings = random_drawings(made, random)
        found = jn.simulate(redrawn(made, drawings, {}), [0.0, 0.4, 1.1], order=2)
        assert_same(made, kept.outputs, found.outputs, drawings, {})


def optional_fields(kind):
    """Return the names of the vectors, words and the like of a joint, driver, force or output that may be left out."""
    fields = value_fields(kind).items()
    scalars = {name for name, field in fields if field_kind(field) == "scalar"} | {"friction"}  # whose numbers are, too
    return [name for name, field in fields if field.default is None and name not in scalars]


def forms(kind):
    """Return the forms that elements of a class can have: with what may be left out and without, in either frame."""
    given = {"without", "with"} if optional_fields(kind) else {"without"}
    return given | ({"global", "body"} if "frame" in value_fields(kind) else set())


def forms_of(element):
    """Return the forms that an element has."""
    given = [name for name in optional_fields(type(element)) if getattr(element, name) is not None]
    return {"with" if given else "without", getattr(element, "frame", "global")}


@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_every_joint_driver_force_and_output_has_its_frames_drawn_otherwise(space):
    """What is added to the catalogue, or to the outputs of files, must come into a mechanism here, in all its forms."""
    kinds = [kind for role in ROLES for kind in catalogue(space, role).values()]
    missing = {kind: forms(kind) for kind in (*kinds, *(kind for _, kind in output_types(space).values()))}
    for mechanism in (with_all_outputs(kind()) for kind in MECHANISMS.values()):
        for elements in mechanism.elements.values() if mechanism.space == space else ():
            for element in elements.values():
                missing[type(element)] = missing.get(type(element), set()) - forms_of(element)
    # a derivative is made of other outputs, tests/mechanism/outputs/test_linkage_outputs.py, a cam in the plane of
    # coordinates as they are, tests/dynamics/test_cams.py
    missing[jn.outputs.DerivativeOutput] -= {"without"}
    for kind in (CamForceOutput, CamTorqueOutput) if space == "planar" else ():
        missing[kind] -= {"without"}
    missing.pop(jn.outputs.SymmetricRollCenterOutput, None)  # its image is in a plane through the origin of the ground
    missing[GroundTorqueOutput] -= {"without"}  # about the origin, which is another point of the ground then
    missing.pop(jn.spatial.Wheel, None)  # positions alone do not hold it: it is simulated above
    assert {kind.__name__: left for kind, left in missing.items() if left} == {}
