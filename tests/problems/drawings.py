"""The same mechanism with the frames of its bodies drawn otherwise: turned, and with other origins."""

import dataclasses

import numpy as np
from scipy.spatial.transform import Rotation

import jounce as jn
from jounce import drivers, forces
from jounce.mechanism.resolve import resolve

POINTS, DIRECTIONS = ("point",), ("vector", "axis", "normal")


@dataclasses.dataclass(frozen=True)
class Drawing:
    """A frame drawn into another: its origin there, m, and its axes, the columns of a matrix."""

    origin: np.ndarray
    axes: np.ndarray

    @classmethod
    def random(cls, random, space, *, shift=True):
        """Return a random frame, at the old origin if not shifted."""
        size = 2 if space == "planar" else 3
        axes = rotation(random.uniform(-3, 3)) if size == 2 else Rotation.random(random_state=random).as_matrix()
        return cls(random.uniform(-0.3, 0.3, size) * shift, axes)

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


def rotation(angle):
    """Return the matrix of a turn in the plane."""
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def matrix(quaternion):
    """Return the attitude matrix of Euler parameters."""
    return Rotation.from_quat(quaternion, scalar_first=True).as_matrix()


def redrawn(mechanism, drawings):
    """Return a mechanism in which every body, by name, and the ground have other frames.

    What is told in the axes of the frames goes with them; where angles are counted from does not: see `shifts`.
    """
    values = mechanism.parameter_values
    world = drawings["ground"]

    def element(it):
        changed = {}
        for field in dataclasses.fields(it):
            stem, _, side = field.name.rpartition("_")
            stem, slot = (stem, "ij".index(side)) if side in ("i", "j") and stem else (field.name, 0)
            value = getattr(it, field.name) if field.init else None
            if value is not None and stem in (*POINTS, *DIRECTIONS) and it.bodies:
                drawing = drawings[it.bodies[slot]]
                convert = drawing.point if stem in POINTS else drawing.direction
                changed[field.name] = convert(resolve(value, values))
        if hasattr(it, "frame") and hasattr(it, "law"):  # components
            changed["law"] = turned(it.law, drawings[it.bodies[0]] if it.frame == "body" else world)
        return dataclasses.replace(it, **changed)

    def turned(law, drawing):
        rows = drawing.axes.T.tolist()
        return [" + ".join(f"({x!r})*({part})" for x, part in zip(row, law, strict=True)) for row in rows]

    kinds = ("joints", "drivers", "forces", "outputs")
    gravity = None if mechanism.gravity is None else world.direction(resolve(mechanism.gravity, values))
    return dataclasses.replace(
        mechanism,
        bodies={name: _body(body, drawings[name], world, values) for name, body in mechanism.bodies.items()},
        gravity=gravity,
        **{kind: {name: element(it) for name, it in getattr(mechanism, kind).items()} for kind in kinds},
    )


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
    """Return a mechanism of which the guess is a position put together."""
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


def shifts(mechanism, coordinates, drawings):
    """Return by how much the frames alone change the angle of each element, at a position put together.

    In space it is the angle of ``A_i^T A_j`` about the axis, of elements without vectors; in the plane that of the
    bodies.
    """
    found = {}
    named = {**mechanism.drivers, **mechanism.forces, **mechanism.outputs}
    attitude = coordinates.get("quaternion")
    index = ["ground", *mechanism.bodies].index
    values = mechanism.parameter_values
    drawn = {}
    if attitude is None:
        drawn = {name: drawing.angle - drawings["ground"].angle for name, drawing in drawings.items()}
    for name, it in named.items():
        if isinstance(it, PLANAR_ANGLES) and getattr(it, "coordinate", "angle") == "angle":
            ratio = resolve(getattr(it, "ratio", None) or 1.0, values)  # of the first of two bodies
            found[name] = drawn[it.bodies[-1]] - (ratio * drawn[it.bodies[0]] if len(it.bodies) > 1 else 0.0)
        elif hasattr(it, "datum") and it.vector_i is None:
            axis = resolve(it.axis if hasattr(it, "axis") else it.axis_i, values)
            old = [matrix(attitude.reshape(-1, *attitude.shape[-3:])[0, :, index(body), 0]) for body in it.bodies]
            new = [a @ drawings[body].axes for a, body in zip(old, it.bodies, strict=True)]
            around = drawings[it.bodies[0]].direction(axis)
            found[name] = angle_101(*new, around) - angle_101(*old, axis)
    return found


def angle_101(first, second, axis):
    """Return the angle of ``A_i^T A_j`` about an axis, by ``2 atan2(u.e, e0)``: Sommer 2024, equation 101, mended."""
    e0, *e = Rotation.from_matrix(first.T @ second).as_quat(scalar_first=True)
    return 2 * np.arctan2(np.dot(e, axis) / np.linalg.norm(axis), e0)


PLANAR_ANGLES = (
    drivers.CoordinateDriver,
    forces.Torque,
    forces.TorsionalSpring,
    forces.Moment,
    jn.AngleOutput,
    jn.PlanarRelativeAngleOutput,
)
