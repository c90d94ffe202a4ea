"""Laws of frames: how the frames of the bodies are drawn changes nothing that can be seen of a mechanism."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import jounce as jn
from jounce import drivers, forces, planar, spatial
from jounce.dynamics import (
    AppliedForceOutput,
    AppliedTorqueOutput,
    DriverForceOutput,
    DriverTorqueOutput,
    JointForceOutput,
    JointTorqueOutput,
)
from jounce.jet import Jet
from jounce.kinematics.assembly import _moved, assemble
from jounce.mechanism import build
from jounce.mechanism.builder import pose_at
from jounce.mechanism.datums import with_datums
from jounce.rigid import PlanarPose, SpatialPose
from tests.problems.bank import group_of, pose_of, random_motion
from tests.problems.drawings import Drawing, at, matrix, redrawn, rotation, shifts

ORDER = 4
INSTANTS = [0.0, 0.3, 0.8]
DRAWINGS = {
    "as the ground": [1, 0, 0, 0],
    "x along the axle": [0.5**0.5, 0, -(0.5**0.5), 0],
    "y along the axle": [0.5**0.5, 0.5**0.5, 0, 0],
    "half a turn": [0, 1, 0, 0],
}
LAW = "0.4 + 0.7*t + 0.4*sin(2*t)"


def rates_of_law():
    """Derivatives 2 to 6 of the law, at the instants, from its closed form."""
    t = np.array(INSTANTS)
    return np.stack([0.4 * 2**k * np.sin(2 * t + k * np.pi / 2) for k in range(2, 3 + ORDER)], axis=-1)


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
            "angle": jn.RelativeAngleOutput(bodies, z, *(vectors or ())),
        },
    )


@pytest.mark.parametrize("tilt", [0.0, 0.2], ids=["guess assembled", "guess tilted"])
@pytest.mark.parametrize("quaternion", DRAWINGS.values(), ids=DRAWINGS)
def test_the_bearing_of_a_driven_rotor_carries_nothing(quaternion, tilt):
    found = jn.solve(rotor(quaternion, tilt=tilt), INSTANTS, ORDER).outputs
    torque = 2.0 * rates_of_law()
    scale = np.abs(torque).max(axis=0)
    assert (np.abs(found["motor"] - torque) <= 1e-13 * scale).all()
    assert (np.abs(found["bearing"]).max(axis=-1) <= 1e-13 * scale).all()
    assert (np.abs(found["on_rotor"][..., 2] - torque) <= 1e-13 * scale).all()
    assert (np.abs(found["on_rotor"][..., :2]).max(axis=-1) <= 1e-13 * scale).all()
    np.testing.assert_allclose(
        found["angle"][:, 0], 0.4 + 0.7 * np.array(INSTANTS) + 0.4 * np.sin(2 * np.array(INSTANTS)), atol=1e-14
    )


def test_nor_does_it_where_a_vector_of_the_driver_points_beside_the_plane_of_the_turn():
    found = jn.solve(rotor(DRAWINGS["x along the axle"], ([1, 0, 0.4], [0.6, 0.8, 1.5])), INSTANTS, ORDER).outputs
    torque = 2.0 * rates_of_law()
    scale = np.abs(torque).max(axis=0)
    assert (np.abs(found["motor"] - torque) <= 1e-13 * scale).all()
    assert (np.abs(found["bearing"]).max(axis=-1) <= 1e-13 * scale).all()


def solid(random):
    """Mass, centre of mass and inertia of a body in space."""
    spread = random.normal(size=(3, 3))
    spread = 0.05 * spread @ spread.T + 0.05 * np.eye(3)
    tensor = (np.trace(spread) * np.eye(3) - spread).tolist()
    return {
        "mass": random.uniform(0.5, 3.0),
        "center_of_mass": random.uniform(-0.1, 0.1, 3).tolist(),
        "inertia": tensor,
    }


def all_in_space():
    """A mechanism with every joint, driver, force and output of space, driven, and a guess that is not put together."""
    random = np.random.default_rng(5)
    z, o = [0.1, -0.2, 1.0], [0.0, 0.0, 0.0]
    a, b, c = [1.0, 0.2, -0.1], [-0.2, 1.0, 0.1], [0.3, 0.5, 0.4]
    near = [1.0, 0.05, -0.04, 0.03]

    def body(x, y, height):
        return jn.Body([x, y, height], orientation=near, **solid(random))

    def turn(name, value):
        return f"{value} + {name}_shift"

    return jn.Mechanism(
        space="spatial",
        gravity=[0.4, -0.7, -9.81],
        parameters={f"{name}_shift": 0.0 for name in SPATIAL_ANGLES},
        bodies={
            "rotor": body(0, 0, 0),
            "arm": body(0.5, 0.1, 0.2),
            "tube": body(0.9, 0.2, 0.3),
            "nut": body(2, 0, 0.1),
            "cross": body(0, 2, 0.0),
            "ram": body(0.4, 3.0, 1.0),
            "link": body(0.8, 3.4, 1.3),
        },
        joints={
            "axle": spatial.Revolute(("ground", "rotor"), o, o, z, z),
            "elbow": spatial.Revolute(("rotor", "arm"), [0.5, 0.1, 0.2], o, a, a),
            "sleeve": spatial.Cylindrical(("arm", "tube"), [0.2, 0, 0], o, b, b),
            "thread": spatial.Screw(("ground", "nut"), [2, 0, 0], o, z, z, 0.3),
            "hooke": spatial.Universal(("ground", "cross"), [0, 2, 0], o, [1, 0, 0.1], [0, 1, 0.2]),
            "guide": spatial.Prismatic(("ground", "ram"), [0, 3, 1], o, [1, 0, 0.1], [1, 0, 0.1], [0, 1, 0], [0, 1, 0]),
            "ball": spatial.Spherical(("ram", "link"), [0.4, 0.4, 0.3], o),
            "rod": spatial.DoubleSpherical(("ground", "link"), [0.9, 4.4, 2.0], [0.3, 0.1, 0.2], 1.1),
            "square": spatial.Dot1(("ground", "link"), [0, 0, 1], [1, 0.1, 0]),
            "plane": spatial.Dot2(("ground", "link"), [1.5, 3.5, 1.45], [0.5, 0.1, 0.1], [0.1, 1.0, 0.2]),
        },
        drivers={
            "spin": drivers.RotationDriver(("ground", "rotor"), z, turn("spin", LAW)),
            "bend": drivers.RotationDriver(("rotor", "arm"), a, "0.2 + 0.3*sin(2*t)", [0, 1, 0.3], [0.1, 1, 0.5]),
            "roll": drivers.RotationDriver(("tube", "arm"), b, turn("roll", "0.1 - 0.5*t**2")),
            "extend": drivers.SpatialSlideDriver(("arm", "tube"), [0.2, 0, 0], o, b, "0.1 + 0.05*sin(3*t)"),
            "feed": drivers.SpatialSlideDriver(("ground", "nut"), [2, 0, 0], o, z, "0.1 + 0.2*t"),
            "pitch": drivers.RotationDriver(("ground", "cross"), [0, 1, 0], turn("pitch", "0.2 + 0.4*sin(t)")),
            "yaw": drivers.RotationDriver(("cross", "ground"), [1, 0.1, 0.2], turn("yaw", "0.3*cos(2*t)")),
            "reach": drivers.SpatialDistanceDriver(("ground", "ram"), [0, 2.0, 0.5], o, "1.3 + 0.1*sin(t)"),
        },
        forces={
            "spring": forces.Spring(("arm", "ram"), c, a, 12.0, 0.8, 0.3),
            "slide_spring": forces.SlideSpring(("ground", "tube"), o, c, b, 5.0, 0.1, 0.2),
            "torsion": forces.SpatialTorsionalSpring(("ground", "rotor"), z, 7.0, turn("torsion", 0.2), 0.1),
            "twist": forces.SpatialTorsionalSpring(("ground", "cross"), z, 3.0, turn("twist", 0.1), 0.2),
            "distance_force": forces.DistanceForce(("nut", "cross"), o, c, "3*x - v + t"),
            "slide_force": forces.SlideForce(("rotor", "nut"), c, o, a, "sin(x) - 0.2*v"),
            "torque": forces.SpatialTorque(("arm", "tube"), b, "2*sin(x - torque_shift) - 0.3*v"),
            "moment": forces.SpatialMoment("tube", ["0.3 + t", "0.2 - 0.1*t", "-0.4"]),
            "thrust": forces.SpatialPointForce("link", c, ["1 + t", "0.2*cos(t)", "-0.7"], "body"),
            "own_moment": forces.SpatialMoment("cross", ["0.5", "t**2", "0.2"], "body"),
        },
        outputs={
            "angle": jn.RelativeAngleOutput(("ground", "rotor"), z),
            "tilted": jn.RelativeAngleOutput(("ground", "cross"), z),
            "between": jn.RelativeAngleOutput(("ground", "tube"), z, a, b),
            "distance": jn.DistanceOutput(("cross", "link"), c, a),
            "rate": jn.AngularVelocityOutput("tube"),
        },
    )


SPATIAL_ANGLES = ("spin", "roll", "pitch", "yaw", "torsion", "twist", "torque")


def all_in_the_plane():
    """The same in the plane."""
    o, x, y = [0.0, 0.0], [1.0, 0.1], [-0.1, 1.0]
    massive = {"mass": 1.3, "inertia": 0.2, "center_of_mass": [0.1, -0.05]}

    def body(at, angle):
        return jn.Body(at, angle, **massive)

    return jn.Mechanism(
        space="planar",
        gravity=[0.3, -9.81],
        parameters={f"{name}_shift": 0.0 for name in PLANAR_ANGLES},
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
        },
        joints={
            "A": planar.Revolute(("ground", "crank"), o, o),
            "D": planar.Revolute(("ground", "rocker"), [2, 0], o),
            "BC": planar.DoubleRevolute(("crank", "rocker"), [0.6, 0], [1.2, 0], 1.9),
            "G": planar.Revolute(("crank", "gear"), [0.4, 0], o),
            "mesh": planar.Gear(("rocker", "gear", "crank"), -1.5),
            "P": planar.Revolute(("ground", "planet"), [-2, 0], o),
            "pair": planar.Coordinate(("crank", "planet"), "angle", -2.0),
            "guide": planar.Prismatic(("ground", "block"), [0, -1], o, x, x),
            "level": planar.Parallel1(("block", "pin"), y, y),
            "slot": planar.Parallel2(("block", "pin"), [0.2, 0], o, y),
            "line": planar.Parallel2(("ground", "disc"), [3.0, 1.0], o, x),
            "rolling": planar.Rolling(("ground", "disc"), [3.0, 0.7], o, x, 0.3),
            "axle": planar.Revolute(("disc", "wheel"), [2.0, 0], o),
            "W": planar.Revolute(("wheel", "second"), [1.0, 0], o),
        },
        drivers={
            "turn": drivers.CoordinateDriver(("ground", "crank"), "angle", f"{LAW} + turn_shift"),
            "push": drivers.SlideDriver(("ground", "block"), [0, -1], o, x, "1 + 0.2*sin(2*t)"),
            "reach": drivers.DistanceDriver(("ground", "pin"), [0.5, 0.3], o, "2.4 + 0.1*t"),
            "roll": drivers.SlideDriver(("ground", "disc"), [0, 0.7], o, x, "3 + 0.5*t"),
            "swing": drivers.CoordinateDriver(("disc", "wheel"), "angle", "0.3*t**2 + swing_shift"),
            "fold": drivers.CoordinateDriver(("wheel", "second"), "angle", "sin(t) + fold_shift", 0.5),
        },
        forces={
            "spring": forces.Spring(("crank", "pin"), x, o, 10.0, 0.5, 0.2),
            "slide_spring": forces.SlideSpring(("ground", "rocker"), o, x, y, 5.0, 0.1, 0.2),
            "torsion": forces.TorsionalSpring(("crank", "rocker"), 3.0, "0.2 + torsion_shift", 0.1),
            "distance_force": forces.DistanceForce(("disc", "pin"), o, o, "3*x - v + t"),
            "slide_force": forces.SlideForce(("crank", "block"), x, o, y, "sin(x) - 0.2*v"),
            "torque": forces.Torque(("ground", "planet"), "2*sin(x - torque_shift) - 0.3*v"),
            "moment": forces.Moment("wheel", "0.3*(x - moment_shift)**2 - v"),
            "thrust": forces.PointForce("second", x, ["1 + t", "0.2*cos(t)"], "body"),
        },
        outputs={
            "angle": jn.AngleOutput("gear"),
            "between": jn.PlanarRelativeAngleOutput(("rocker", "gear")),
            "distance": jn.DistanceOutput(("planet", "pin"), x, y),
            "rate": jn.AngularVelocityOutput("rocker"),
        },
    )


PLANAR_ANGLES = ("turn", "swing", "fold", "torsion", "torque", "moment")


def with_all_outputs(mechanism):
    """Return a mechanism of which everything is asked: points, reactions, forces of drivers, applied forces."""
    size = 2 if mechanism.space == "planar" else 3
    outputs = dict(mechanism.outputs)
    for name in mechanism.bodies:
        outputs[f"point_{name}"] = jn.PointOutput(name, [0.3, -0.2, 0.4][:size])
    for name, joint in {**mechanism.joints, **mechanism.drivers}.items():
        outputs[f"force_{name}"] = JointForceOutput(name)
        if hasattr(joint, "point_j"):
            outputs[f"moment_{name}"] = JointTorqueOutput(name)
    for name, driver in mechanism.drivers.items():
        turning = hasattr(driver, "axis_i") or getattr(driver, "coordinate", "") == "angle"
        outputs[f"drive_{name}"] = (DriverTorqueOutput if turning else DriverForceOutput)(name)
    for name, force in mechanism.forces.items():
        if getattr(force, "frame", "global") == "global":
            kind = AppliedForceOutput if force.unit == "N" else AppliedTorqueOutput
            outputs[f"applied_{name}"] = kind(name)
    return jn.Mechanism(**{**vars_of(mechanism), "outputs": outputs})


def vars_of(mechanism):
    """Return the arguments of a mechanism."""
    names = ("space", "bodies", "joints", "drivers", "forces", "outputs", "parameters", "gravity")
    return {name: getattr(mechanism, name) for name in names}


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
        output = jn.RelativeAngleOutput(("one", "two"), around.tolist())
        start = {"quaternion": np.array(pose.quaternion.coefficients[0])}
        (group,) = with_datums([group_of([output], "spatial")], start)
        plain = group_of([output], "spatial").evaluate(pose.truncate(0)).coefficients[0]
        result = np.array(group.evaluate(pose).dense().coefficients).reshape(ORDER + 1)
        turns = (result[0] - float(np.squeeze(plain))) / (2 * np.pi)
        assert turns == pytest.approx(np.round(turns), abs=1e-12)
        found.append(result)
    np.testing.assert_allclose(found[1][1:], found[0][1:], rtol=1e-11, atol=1e-11)
    assert np.abs(found[0][1:]).min() > 1e-4


@jax.jit
def applied(system, coordinates):
    """Return what the applied forces do to the bodies at rest, (coordinates, bodies)."""
    pose_type = SpatialPose if "quaternion" in coordinates else PlanarPose
    pose = pose_at(coordinates, pose_type).extended(None, None)
    return system.applied_forces(pose, Jet.variable(jnp.zeros((1, 1)), 1)).coefficients[0][:, 1:, 0]


def statics(mechanism):
    """Return positions and attitudes of the bodies put together, and the wrench of each joint on each of them at rest.

    Attitudes are matrices. Wrenches, (coordinates, bodies) by name, hold forces in global axes and moments about the
    origins of the bodies, in their axes.
    """
    model, coordinates = assemble(build(mechanism), 0.0, 1e-12)
    system, still = model.system, np.zeros(model.system.cells.shape[1])
    jacobian = np.array(_moved(system, coordinates, still, np.float64(0.0), model.pose_type)[2])
    scale = np.tile(np.asarray(system.column_scale), len(model.bodies))
    load = np.array(applied(system, coordinates)).T.ravel()
    multipliers = np.linalg.solve(jacobian.T, scale * load)
    wrenches = {}
    for name, row, size in zip(model.rows, jacobian, multipliers, strict=True):
        wrench = (row * size / scale).reshape(len(model.bodies), -1).T
        wrenches[name] = wrenches.get(name, 0.0) + wrench
    attitudes = coordinates.get("quaternion", coordinates.get("angle"))[..., 1:, 0]
    attitudes = [matrix(q) if len(np.shape(q)) else rotation(q) for q in np.moveaxis(attitudes, -1, 0)]
    return coordinates["position"][:, 1:, 0].T, attitudes, wrenches, coordinates


@pytest.mark.parametrize("kind", [all_in_space, all_in_the_plane], ids=["space", "plane"])
def test_no_position_and_no_reaction_at_rest_depends_on_how_frames_are_drawn(kind):
    mechanism = kind()
    random = np.random.default_rng(3)
    places, attitudes, wrenches, coordinates = statics(mechanism)
    largest = max(np.abs(wrench).max() for wrench in wrenches.values())
    for _ in range(3):
        drawings = {name: Drawing.random(random, mechanism.space) for name in ("ground", *mechanism.bodies)}
        moved = shifts(mechanism, coordinates, drawings)
        other = redrawn(at(mechanism, coordinates), drawings)
        named = {f"{n}_shift": x for n, x in moved.items() if f"{n}_shift" in other.parameters}
        new_places, new_attitudes, found, _ = statics(other.with_parameters(**named))
        world = drawings["ground"]
        for k, name in enumerate(mechanism.bodies):
            drawing, attitude = drawings[name], attitudes[k]
            place = world.point(places[k] + attitude @ drawing.origin)
            np.testing.assert_allclose(new_places[k], place, rtol=0, atol=1e-11)
            np.testing.assert_allclose(new_attitudes[k], world.axes.T @ attitude @ drawing.axes, rtol=0, atol=1e-11)
            for joint, wrench in wrenches.items():
                size = len(place)
                force, moment = wrench[:size, k], wrench[size:, k]
                local = attitude.T @ force
                lever = drawing.origin[0] * local[1] - drawing.origin[1] * local[0] if size == 2 else None
                moment = moment - (np.cross(drawing.origin, local) if lever is None else lever)
                moment = drawing.axes.T @ moment if size == 3 else moment
                expected = np.concatenate([world.axes.T @ force, moment])
                np.testing.assert_allclose(found[joint][:, k], expected, rtol=0, atol=1e-10 * largest)


@pytest.mark.slow
def test_no_quantity_depends_on_how_frames_are_drawn_in_the_plane():
    """Every body and the ground with another random frame: the same motion and the same forces, with their rates.

    In space the mechanism with all elements compiles for more than five minutes; there the reactions at rest, the rotor
    with its rates, and angles in any motion are compared.
    """
    mechanism = with_all_outputs(all_in_the_plane())
    kept = jn.solve(mechanism, [0.0, 0.1, 0.3], ORDER)
    random = np.random.default_rng(2)
    drawings = {name: Drawing.random(random, mechanism.space) for name in ("ground", *mechanism.bodies)}
    moved = shifts(mechanism, kept.poses[1], drawings)
    other = redrawn(at(mechanism, kept.poses[1]), drawings)
    other = other.with_parameters(**{f"{n}_shift": x for n, x in moved.items() if f"{n}_shift" in other.parameters})
    found = jn.solve(other, kept.time, ORDER)
    world = drawings["ground"]
    scales = {}
    for name, values in kept.outputs.items():
        unit = mechanism.outputs[name].unit
        scale = np.abs(values).reshape(*values.shape[:2], -1).max(axis=(0, 2))
        scales[unit] = np.maximum(scales.get(unit, 0.0), scale)
    for name, values in found.outputs.items():
        expected, output = kept.outputs[name], mechanism.outputs[name]
        if expected.ndim == 3:
            expected = expected @ world.axes
        if isinstance(output, jn.PointOutput):
            expected[:, 0] -= world.axes.T @ world.origin
        if name in moved:
            expected = expected.copy()
            turns = values[0, 0] - expected[0, 0] - moved[name]
            assert turns == pytest.approx(2 * np.pi * np.round(turns / (2 * np.pi)), abs=1e-11)
            expected[:, 0] += values[0, 0] - expected[0, 0]
        error = np.abs(values - expected).reshape(*values.shape[:2], -1).max(axis=(0, 2))
        assert (error <= 1e-11 * scales[output.unit]).all(), (name, error / scales[output.unit])
