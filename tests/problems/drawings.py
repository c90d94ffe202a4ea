"""The same mechanism with the frames of its bodies drawn otherwise: turned, and with other origins."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import jounce as jn
from jounce import drivers, forces
from jounce.constraints.base import field_kind, value_fields
from jounce.dynamics import (
    AccelerationEnergyOutput,
    AppliedForceOutput,
    AppliedTorqueOutput,
    BodyAccelerationEnergyOutput,
    BodyKineticEnergyOutput,
    BodyPotentialEnergyOutput,
    DriverForceOutput,
    DriverTorqueOutput,
    GroundForceOutput,
    GroundTorqueOutput,
    JointForceOutput,
    JointTorqueOutput,
    KineticEnergyOutput,
    PotentialEnergyOutput,
)
from jounce.dynamics.inverse.outputs.components import is_turning
from jounce.forces import AbstractLaw
from jounce.jet import stack
from jounce.jet.algebra import total
from jounce.jet.turns import principal
from jounce.mechanism.resolve import resolve, resolve_law, resolve_motion
from jounce.robot import CoupledJoints
from jounce.trajectory import AbstractMotion

POINTS, DIRECTIONS = ("point",), ("vector", "axis", "normal", "opposite")


@dataclasses.dataclass(frozen=True)
class Drawing:
    """A frame drawn into another: its origin there, m, and its axes, the columns of a matrix."""

    origin: np.ndarray
    axes: np.ndarray

    @property
    def angle(self):
        """By which the axes are turned in the plane, rad."""
        return float(np.arctan2(self.axes[1, 0], self.axes[0, 0]))

    def point(self, p):
        """Return the coordinates of a point in the new frame."""
        return (self.axes.T @ (np.asarray(p) - self.origin)).tolist()

    def direction(self, v):
        """Return the components of a vector in the new frame."""
        return (self.axes.T @ np.asarray(v)).tolist()


def as_drawn(mechanism):
    """Return the frames of all bodies, by name, as they are."""
    size = 2 if mechanism.space == "planar" else 3
    return {name: Drawing(np.zeros(size), np.eye(size)) for name in ("ground", *mechanism.rigid_bodies)}


def random_drawings(mechanism, random):
    """Return random frames of all bodies, by name; the origin stays where a coupled joint measures its slide to it."""
    followed = {body for it in mechanism.joints.values() if isinstance(it, CoupledJoints) for body in slid(it)}

    def drawing(name, size):
        axes = rotation(random.uniform(-3, 3)) if size == 2 else Rotation.random(random_state=random).as_matrix()
        return Drawing(random.uniform(-0.3, 0.3, size) * (name not in followed), axes)

    return {name: drawing(name, len(same.origin)) for name, same in as_drawn(mechanism).items()}


def slid(it):
    """Return the bodies to the origin of which coupled joints measure how far they slide."""
    children = [it.bodies["ijmn".index(child)] for child in it.roles[1::2]]
    return [body for body, kind in zip(children, it.kinds.split("-"), strict=True) if kind == "slide"]


def rotation(angle):
    """Return the matrix of a turn in the plane."""
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def matrix(quaternion):
    """Return the attitude matrix of Euler parameters."""
    return Rotation.from_quat(quaternion, scalar_first=True).as_matrix()


class ShiftedMotion(AbstractMotion):
    """A law of a driver, of an angle that is counted from elsewhere."""

    motion: AbstractMotion
    shift: Any

    def __call__(self, time):
        return self.motion(time) + self.shift


class CamMotion(AbstractMotion):
    """A law of a cam, of angles of its leader and its follower that are counted from elsewhere."""

    motion: AbstractMotion
    leads: Any
    follows: Any

    def __call__(self, coordinate):
        return self.motion(coordinate - self.leads) + self.follows


class ShiftedLaw(AbstractLaw):
    """A law of a torque, of an angle that is counted from elsewhere."""

    law: AbstractLaw
    shift: Any

    def value(self, displacement, velocity, time):
        return self.law.value(displacement - self.shift, velocity, time)


class DrawnLaw(AbstractLaw):
    """A law of a force with components, of a place in a ground that is drawn otherwise, in axes drawn otherwise."""

    law: AbstractLaw
    origin: Any  # of the new ground in the old one
    world: Any  # axes of the new ground in the old one, the columns of a matrix
    axes: Any  # those of the frame in which components and velocities are

    def value(self, displacement, velocity, time):
        place = _product(self.world, displacement)
        place = stack([part + shift for part, shift in zip(_parts(place), self.origin, strict=True)])
        found = self.law(place, _product(self.axes, velocity), time)
        return _product(np.swapaxes(self.axes, 0, 1), found)


def _parts(vector):
    return [vector[k] for k in range(vector.shape[0])]


def _product(matrix, vector):
    """Return a constant matrix times the jet of a vector."""
    return stack([total(part * x for part, x in zip(row, _parts(vector), strict=True)) for row in matrix])


def redrawn(mechanism, drawings, moved):
    """Return a mechanism in which every body, by name, and the ground have other frames.

    What is told in the axes of the frames goes with them, and so do laws of angles, which change by constants, as
    `shifts` tells them. Whatever the frames are, the same is compiled.
    """
    values, world = mechanism.parameter_values, drawings["ground"]

    def element(name, it):
        changed = {}
        if isinstance(it, jn.joints.Cam):
            parts = [element("", part) for part in (it.follower, it.leader)]
            by = [moved.get(f"{name}.{part}", 0.0) for part in ("leader", "follower")]
            return jn.joints.Cam(*parts, motion=CamMotion(resolve_motion(it.motion, values), *by))
        for key, field in value_fields(type(it)).items():
            value = getattr(it, key)
            if value is not None and field_kind(field) == "vector" and key != "vector_part":
                drawing = drawings[_holder(mechanism, it, key)]
                convert = drawing.point if key.partition("_")[0] in POINTS else drawing.direction
                changed[key] = convert(resolve(value, values))
            changed |= redrawn_shape(it, key, field_kind(field), drawings, values)
        if hasattr(it, "wrenches"):  # of a closure, and the attitude in which it is closed
            first, second = (drawings[body].axes for body in it.bodies)
            changed["wrenches"] = (np.asarray(it.wrenches) @ np.kron(np.eye(2), first)).tolist()
            if it.vector_part is not None:
                closed = Rotation.from_matrix(first.T @ matrix([it.scalar_part, *it.vector_part]) @ second)
                scalar, *vector = closed.as_quat(scalar_first=True).tolist()
                changed |= {"scalar_part": scalar, "vector_part": vector}
        if hasattr(it, "law"):
            changed["law"] = law(it, moved.get(name))
        elif name in moved and hasattr(it, "motion"):
            changed["motion"] = ShiftedMotion(resolve_motion(it.motion, values), moved[name])
        elif name in moved and hasattr(it, "angle"):  # of a spring
            changed["angle"] = resolve(it.angle, values) + moved[name]
        return dataclasses.replace(it, **changed)

    def law(it, shift):
        if hasattr(it, "frame"):
            axes = drawings[it.bodies[0]].axes if it.frame == "body" else world.axes
            return DrawnLaw(resolve_law(it.law, it, values, len(axes)), world.origin, world.axes, axes)
        found = resolve_law(it.law, it, values, None)
        return found if shift is None else ShiftedLaw(found, shift)

    kinds = ("joints", "drivers", "forces", "outputs", "initial")
    gravity = None if mechanism.gravity is None else world.direction(resolve(mechanism.gravity, values))
    return dataclasses.replace(
        mechanism,
        bodies={name: _body(body, drawings[name], world, values) for name, body in mechanism.rigid_bodies.items()},
        gravity=gravity,
        **{kind: {name: element(name, it) for name, it in getattr(mechanism, kind).items()} for kind in kinds},
    )


def redrawn_shape(it, key, kind, drawings, values):
    """Return a curve, or points on each of the bodies, in other frames, by its key; nothing for what is neither."""
    if kind == "curve":
        return {key: redrawn_curve(getattr(it, key), drawings[it.bodies[0]])}
    if kind != "points":
        return {}
    places = zip(it.bodies, resolve(getattr(it, key), values), strict=True)
    return {key: [drawings[body].point(place) for body, place in places]}


def redrawn_curve(expressions, drawing):
    """Return the expressions of a curve in another frame."""
    shifted = [f"({text}) - ({float(shift)!r})" for text, shift in zip(expressions, drawing.origin, strict=True)]
    return [" + ".join(f"({float(a)!r})*({x})" for a, x in zip(axis, shifted, strict=True)) for axis in drawing.axes.T]


def _holder(mechanism, it, key):
    """Return the name of the body in whose frame a point or a direction of an element is given."""
    stem, _, side = key.partition("_")
    if stem not in (*POINTS, *DIRECTIONS) or side not in ("", "i", "j", "m", "1", "2"):
        raise ValueError(f"{type(it).__name__}.{key}: say in whose frame it is given, or the law cannot be tested")
    if side in ("1", "2"):  # one of two joints of which the roles say what they join
        parent, child = it.roles[2 * int(side) - 2 : 2 * int(side)]
        return it.bodies["ijmn".index(child if stem == "opposite" else parent)]
    if isinstance(it, GroundTorqueOutput):
        return "ground"
    if isinstance(it, JointTorqueOutput):
        return acted_on(mechanism, it)
    return it.bodies["ijm".index(side) if side else 0]


def acted_on(mechanism, output):
    """Return the name of the body on which a joint or driver acts with the force or torque that is asked for."""
    bodies = {**mechanism.joints, **mechanism.drivers, **mechanism.forces}[output.joint].bodies
    return output.body or bodies[1]


def frame_of(mechanism, output):
    """Return the name of the body in whose axes the components of an output are, the ground's if they are global."""
    source = mechanism.forces[output.force] if hasattr(output, "force") else output
    frame = getattr(source, "frame", "global")
    if frame == "body":
        return acted_on(mechanism, output) if hasattr(output, "joint") else source.bodies[0]
    return "ground" if frame == "global" else frame


def _body(body, drawing, world, values):
    """Return a body with another frame, in another world."""
    position = np.asarray(resolve(body.position, values))
    changed = {}
    if len(position) == 2:
        angle = resolve(body.angle, values)
        axes = rotation(angle)
        changed["angle"] = angle + drawing.angle - world.angle
    else:
        quaternion = [1, 0, 0, 0] if body.orientation is None else resolve(body.orientation, values)
        axes = matrix(quaternion)
        whole = Rotation.from_matrix(world.axes.T @ axes @ drawing.axes)
        changed["orientation"] = whole.as_quat(scalar_first=True).tolist()
        if body.inertia is not None:
            tensor = np.asarray(body.inertia, float)
            tensor = np.diag(tensor) if tensor.ndim == 1 else tensor
            changed["inertia"] = (drawing.axes.T @ tensor @ drawing.axes).tolist()
    center = np.zeros(len(position)) if body.center_of_mass is None else resolve(body.center_of_mass, values)
    changed["position"] = world.point(position + axes @ drawing.origin)
    return dataclasses.replace(body, center_of_mass=drawing.point(center), **changed)


def at(mechanism, coordinates):
    """Return a mechanism of which the guess is a position assembled."""
    values = {name: x.reshape(-1, *x.shape[-3:])[0] if name != "angle" else x for name, x in coordinates.items()}
    bodies = {}
    for k, (name, body) in enumerate(mechanism.bodies.items(), start=1):
        changed = {"position": values["position"][:, k, 0].tolist()}
        if "quaternion" in values:
            changed["orientation"] = values["quaternion"][:, k, 0].tolist()
        else:
            changed["angle"] = float(values["angle"].reshape(-1, *values["angle"].shape[-2:])[0, k, 0])
        bodies[name] = dataclasses.replace(body, **changed)
    return dataclasses.replace(mechanism, bodies=bodies)


def attitudes_of(mechanism, coordinates):
    """Return the attitude matrices of all bodies, the ground first, by name, at the first of the positions given."""
    if mechanism.space == "planar":
        angles = coordinates["angle"].reshape(-1, *coordinates["angle"].shape[-2:])[0, :, 0]
        return dict(zip(("ground", *mechanism.bodies), map(rotation, angles), strict=True))
    quaternions = coordinates["quaternion"].reshape(-1, *coordinates["quaternion"].shape[-3:])[0, :, :, 0]
    return dict(zip(("ground", *mechanism.bodies), map(matrix, quaternions.T), strict=True))


def counted(mechanism):
    """Return what measures an angle that frames alone change by a constant, by name; in space those without vectors."""
    named = {**mechanism.drivers, **mechanism.forces, **mechanism.outputs, **mechanism.initial}
    cams = {name: it for name, it in mechanism.joints.items() if isinstance(it, jn.joints.Cam)}
    named |= {f"{name}.{part}": getattr(it, part) for name, it in cams.items() for part in ("leader", "follower")}

    def counts(it):
        if isinstance(it, PLANAR_ANGLES):
            return getattr(it, "coordinate", "angle") == "angle"
        return hasattr(it, "datum") and it.vector_i is None

    return {name: it for name, it in named.items() if counts(it)}


def shifts(mechanism, coordinates, drawings):
    """Return by how much the frames alone change the angle of each such element, at a position assembled.

    In space it is the angle of ``A_i^T A_j`` about the axis; in the plane that of the bodies.
    """
    values, attitudes = mechanism.parameter_values, attitudes_of(mechanism, coordinates)

    def angle(it):
        if mechanism.space == "planar":
            drawn = {name: drawing.angle - drawings["ground"].angle for name, drawing in drawings.items()}
            ratio = resolve(getattr(it, "ratio", None) or 1.0, values)  # of the first of two bodies
            return drawn[it.bodies[-1]] - (ratio * drawn[it.bodies[0]] if len(it.bodies) > 1 else 0.0)
        axis = resolve(it.axis if hasattr(it, "axis") else it.axis_i, values)
        old = [attitudes[body] for body in it.bodies]
        new = [a @ drawings[body].axes for a, body in zip(old, it.bodies, strict=True)]
        around = drawings[it.bodies[0]].direction(axis)
        return principal(angle_101(*new, around)) - principal(angle_101(*old, axis))

    return {name: angle(it) for name, it in counted(mechanism).items()}


def angle_101(first, second, axis):
    """Return the angle of ``A_i^T A_j`` about an axis, by ``2 atan2(u.e, e0)``: Sommer 2024, equation 101, mended."""
    e0, *e = Rotation.from_matrix(first.T @ second).as_quat(scalar_first=True)
    return 2 * np.arctan2(np.dot(e, axis) / np.linalg.norm(axis), e0)


def with_all_outputs(mechanism):
    """Return a mechanism of which everything is asked: points, reactions, forces of drivers, applied forces."""
    point = [0.3, -0.2, 0.4][: 2 if mechanism.space == "planar" else 3]
    outputs = dict(mechanism.outputs)
    for name in mechanism.rigid_bodies:
        outputs[f"point_{name}"] = jn.outputs.PointOutput(name, point)
    for name, joint in {**mechanism.joints, **mechanism.drivers}.items():
        outputs[f"force_{name}"] = JointForceOutput(name)
        if hasattr(joint, "point_j"):
            outputs[f"moment_{name}"] = JointTorqueOutput(name)
        for slot, body in enumerate(joint.bodies):
            frames = ("body", joint.bodies[0]) if slot else (joint.bodies[1], "body")
            outputs[f"force_{name}_on_{body}"] = JointForceOutput(name, body, frames[0])
            outputs[f"moment_{name}_on_{body}"] = JointTorqueOutput(name, body, frames[1], point)
    for name, driver in mechanism.drivers.items():
        turning = is_turning(driver)
        outputs[f"drive_{name}"] = (DriverTorqueOutput if turning else DriverForceOutput)(name)
        outputs[f"driven_{name}"] = (jn.outputs.DriverAngleOutput if turning else jn.outputs.DriverDisplacementOutput)(
            name
        )
    for name, force in mechanism.forces.items():
        if len(force.bodies) > 1:
            outputs[f"force_{name}_on_{force.bodies[0]}"] = JointForceOutput(name, force.bodies[0], force.bodies[1])
            outputs[f"moment_{name}_on_{force.bodies[1]}"] = JointTorqueOutput(name, point=point)
    outputs |= {"ground": GroundForceOutput(), "ground_torque": GroundTorqueOutput(point)}
    body = next(iter(mechanism.rigid_bodies))
    outputs |= {f"{kind.__name__}": kind() for kind in ENERGIES} | {
        f"{kind.__name__}": kind(body=body) for kind in ENERGIES_OF_A_BODY
    }
    if mechanism.space == "spatial":
        pair = ([*mechanism.rigid_bodies][-1], body) if len(mechanism.bodies) > 1 else (body, "ground")
        outputs |= {
            "parameters": jn.outputs.EulerParametersOutput(body),
            "parameters_between": jn.outputs.RelativeEulerParametersOutput(pair),
            "matrix": jn.outputs.RotationMatrixOutput(body),
            "matrix_between": jn.outputs.RelativeRotationMatrixOutput(pair),
            "angles": jn.outputs.EulerAnglesOutput(
                body, "XYZ"
            ),  # of which none is undefined where the frames are parallel
            "angles_between": jn.outputs.RelativeEulerAnglesOutput(pair, "xyz"),
        }
    for name, force in mechanism.forces.items():
        outputs[f"applied_{name}"] = (AppliedForceOutput if force.unit == "N" else AppliedTorqueOutput)(name)
    return dataclasses.replace(mechanism, outputs=outputs)


LOCATIONS = (
    jn.outputs.PointOutput,
    jn.outputs.InstantCenterOutput,
    jn.outputs.SpatialInstantCenterOutput,
    jn.outputs.RollCenterOutput,
    jn.outputs.SymmetricRollCenterOutput,
)


def assert_same(mechanism, kept, found, drawings, moved):
    """Assert that a motion in other frames is the same, each value to rounding of the largest of its unit and order."""
    world, scales, parts = drawings["ground"], {}, {}
    for name, values in kept.items():
        scale = np.abs(values).reshape(*values.shape[:2], -1).max(axis=(0, 2))
        unit = mechanism.outputs[name].unit
        scales[unit] = np.maximum(scales.get(unit, 0.0), scale)
    for name, values in found.items():
        expected, output = kept[name].copy(), mechanism.outputs[name]
        if isinstance(output, ATTITUDES):
            expected, values = attitudes(output, expected, values, drawings)
        elif isinstance(output, PotentialEnergyOutput):  # from another origin
            expected[:, 0] += weight(mechanism, output.single_body) @ world.origin
        elif expected.ndim == 3 and not isinstance(output, jn.outputs.ParametersOutput):  # those are of the surface
            expected = expected @ drawings[frame_of(mechanism, output)].axes
        if isinstance(output, LOCATIONS):
            drawing = drawings[frame_of(mechanism, output)]
            expected[:, 0] -= drawing.axes.T @ drawing.origin
        angle = output.driver if isinstance(output, jn.outputs.DriverAngleOutput) else name
        if angle in moved:
            turns = values[0, 0] - expected[0, 0] - moved[angle]
            assert turns == pytest.approx(2 * np.pi * np.round(turns / (2 * np.pi)), abs=1e-11)
            expected[:, 0] += values[0, 0] - expected[0, 0]
        error = np.abs(values - expected).reshape(*values.shape[:2], -1).max(axis=(0, 2))
        parts[name] = error / scales[output.unit]
    # terms of higher rates of energies and of Euler angles cancel: they are larger than what is left
    lost = {name: 10 if isinstance(mechanism.outputs[name], CANCELING) else 1 for name in parts}
    wrong = {name: part for name, part in parts.items() if (part > 1e-11 * lost[name]).any()}
    assert not wrong, wrong


def attitudes(output, kept, found, drawings):
    """Return the attitude matrix as it must be with other frames, and as an output has it, (time, derivative, 9)."""
    bodies = output.bodies if output.body_count == 2 else ("ground", *output.bodies)
    first, second = (drawings[body].axes for body in bodies)
    expected = first.T @ matrices(output, kept) @ second
    return (x.reshape(*x.shape[:2], 9) for x in (expected, matrices(output, found)))


def matrices(output, values):
    """Return attitude matrices with their derivatives from those of an output, (time, derivative, 3, 3)."""
    if isinstance(output, jn.outputs.RotationMatrixOutput):
        return values.reshape(*values.shape[:2], 3, 3)
    factorials = np.cumprod([1.0, *range(1, values.shape[1])])
    parts = jn.Jet(np.moveaxis(values / factorials[:, None], (1, 2), (0, 1)))
    if isinstance(output, jn.outputs.EulerAnglesOutput):
        found = jn.rigid.rotation_matrix(output.sequence, parts)
    else:
        e0, x, y, z = _parts(parts)
        found = stack(
            [
                stack([1 - 2 * (y * y + z * z), 2 * (x * y - e0 * z), 2 * (x * z + e0 * y)]),
                stack([2 * (x * y + e0 * z), 1 - 2 * (x * x + z * z), 2 * (y * z - e0 * x)]),
                stack([2 * (x * z - e0 * y), 2 * (y * z + e0 * x), 1 - 2 * (x * x + y * y)]),
            ]
        )
    return np.moveaxis(np.array(found.derivatives()), (0, 1, 2, 3), (1, 2, 3, 0))


def weight(mechanism, single):
    """Return the weight of one body, or of all, N, which is what potential energy changes by with the origin."""
    values = mechanism.parameter_values
    masses = [
        body.mass for name, body in mechanism.rigid_bodies.items() if single in (None, name) and body.mass is not None
    ]
    return sum(resolve(mass, values) for mass in masses) * np.asarray(resolve(mechanism.gravity, values))


ENERGIES = (KineticEnergyOutput, AccelerationEnergyOutput, PotentialEnergyOutput)
ENERGIES_OF_A_BODY = (BodyKineticEnergyOutput, BodyAccelerationEnergyOutput, BodyPotentialEnergyOutput)
CANCELING = (AccelerationEnergyOutput, jn.outputs.EulerAnglesOutput)
ATTITUDES = (jn.outputs.EulerParametersOutput, jn.outputs.RotationMatrixOutput, jn.outputs.EulerAnglesOutput)
PLANAR_ANGLES = (
    drivers.CoordinateDriver,
    forces.Torque,
    forces.TorsionalSpring,
    forces.Moment,
    jn.outputs.AngleOutput,
    jn.outputs.PlanarRelativeAngleOutput,
)
