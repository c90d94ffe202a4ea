"""Checks that teeth with a pressure angle mesh: racks at their pitch radii, gears in space at their pitch point."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np

from jounce.constraints import spatial
from jounce.constraints.couplings import ROLLING, PitchPoint
from jounce.constraints.friction import velocities, velocity_at
from jounce.dynamics.friction.coupling import has_flanks
from jounce.dynamics.motion_values import pose_of
from jounce.errors import MechanismError
from jounce.execution.mapped import Mapped
from jounce.jet import Jet, cross
from jounce.jet.algebra import stacked
from jounce.kinematics import Motion, Status
from jounce.mechanism.building.builder import group_rows
from jounce.mechanism.system import Group, movable, with_field

FAR = 300.0  # times the distance of crossed axes: larger radii are no gears, but numbers in mm without a unit
LEAD = math.radians(0.5)  # largest rounding of a lead angle that is given to friction
OFF_PITCH = 1e-6  # fraction of the pitch radius: farther from the pitch line, a wheel does not mesh


def check_meshing(motion: Motion, groups: Sequence[Group], coordinates: Callable[..., Any]) -> None:
    """Raise MechanismError if teeth with a pressure angle do not mesh.

    Parameters
    ----------
    motion : Motion
        The motion to check.
    groups : sequence of Group
        Groups of joints and drivers.
    coordinates : callable
        Function of the indices of bodies and a number of coefficients that returns the coordinates of the bodies.
    """
    if motion.traced:
        return
    for group, rows in zip(groups, group_rows(motion.model), strict=True):
        if not has_flanks(group):
            continue
        poses = [coordinates(slot, 2) for slot in group.bodies]
        names = motion.model.rows[rows]
        if isinstance(group.element, spatial.Gear):
            _check_pitch_points(motion, group.element, poses, names)
        elif hasattr(group.element, "radius"):
            _check_pitch_line(motion, group.element, poses, names)


def _check_pitch_line(motion: Motion, element: Any, poses: Sequence[Any], names: Sequence[str]) -> None:
    """Raise MechanismError if a wheel is not at its pitch radius from the line it rolls on."""
    slope = np.tan(np.asarray(element.pressure_angle))
    deviation = np.asarray(_parted.along(element, (poses, motion.time), pose_type=motion.poses[0]))
    deviation = np.where(slope > 0, deviation / np.where(slope > 0, slope, 1.0), 0.0)
    radius = np.asarray(element.radius)
    is_off_pitch = (np.abs(deviation) > OFF_PITCH * radius) & (motion.status == Status.OK)
    if is_off_pitch.any():
        instance, lane = np.argwhere(is_off_pitch)[0]
        size = radius[instance, 0]
        message = (
            f"at t = {motion.time[lane]:g} s the center is {deviation[instance, lane] - size:.6g} m to the left of the "
            f"line, and must be {-size:.6g} m, the radius to its right: move the line or the center, reverse the "
            "line, or guide the rack so that it keeps its distance"
        )
        raise MechanismError(message, name=f"{names[instance]}.points")


def _check_pitch_points(motion: Motion, gears: Any, poses: Sequence[Any], names: Sequence[str]) -> None:
    """Raise MechanismError if the contact of gears in space at their pitch point does not fit their ratio."""
    geometry = _meshing.along(gears, poses, pose_type=motion.poses[0])
    (first, second), drift, speed = geometry["radii"], geometry["drift"], geometry["speed"]
    helix = 0.0 if gears.helix_angle is None else np.asarray(gears.helix_angle)
    rolls = geometry["sliding"] <= ROLLING * first
    skew = (geometry["distance"] > ROLLING * (first + second)) & (geometry["angle"] > ROLLING)
    friction = getattr(gears.friction, "lead_angle", None)
    lead = geometry["lead"] if friction is None else np.asarray(friction)
    on_axis = (
        "the third point, the pitch point, lies on the axis of the {} gear, and must be where the teeth of both touch"
    )
    moves = "at t = {{time:g}} s the {} point moves in the frame, the third body: give one on the axis of the gear"
    faults = (
        (first <= ROLLING * second, on_axis.format("first"), "points"),
        (second <= ROLLING * first, on_axis.format("second"), "points"),
        (drift[0] > OFF_PITCH * speed[0] * first, moves.format("first"), "points"),
        (drift[1] > OFF_PITCH * speed[1] * second, moves.format("second"), "points"),
        (
            ~skew & ~rolls,
            "at the third point the pitch radii are {first:.9g} m and {second:.9g} m, and the gears slide by "
            "{sliding:.3g} m per rad: on axes that are parallel or cut each other they roll, so move that point, or "
            "change the ratio or its sign",
            "points",
        ),
        (
            skew & (geometry["plane"] <= ROLLING * first * second),
            "at the third point both gears move along one line, so that they touch in no plane: give a point on the "
            "common perpendicular of the axes, or near it",
            "points",
        ),
        (
            skew & (np.minimum(first, second) > FAR * geometry["distance"]),
            "the third point is {first:.6g} m and {second:.6g} m from axes that are {distance:.6g} m apart: give where "
            "the teeth touch; a number without a unit is in m",
            "points",
        ),
        (
            skew & (helix != 0),
            "teeth of gears on crossed axes lie along the sliding velocity, which follows from the pitch point and the "
            "ratio: leave the helix angle out",
            "helix_angle",
        ),
        (
            skew & (np.abs(geometry["lead"] - lead) > LEAD),
            "the lead angle of the first gear is {lead:.4g} deg by the pitch point and the ratio: give that one to the "
            "friction, or move the pitch point",
            "friction.lead_angle",
        ),
        (
            rolls & (geometry["cone"] <= ROLLING) & (helix != 0),
            "the first gear is a crown wheel, whose teeth have no hand about its axis: give the other gear first",
            "helix_angle",
        ),
    )
    for is_wrong, template, field in faults:
        if (odd := np.argwhere(is_wrong & (motion.status == Status.OK))).size:
            position = tuple(odd[0])
            numbers = {"first": first[position], "second": second[position], "sliding": geometry["sliding"][position]}
            numbers["distance"] = geometry["distance"][position]
            numbers["lead"] = np.degrees(geometry["lead"][position])
            text = template.format(time=motion.time[position[1]], **numbers)
            raise MechanismError(text, name=f"{names[position[0]]}.{field}")


@Mapped
def _meshing(gears: Any, poses: Sequence[Any], *, pose_type: Any) -> Mapping[str, Any]:
    """Return the contact geometry of gears in space, (instances, time): lengths in m, per rad of rotation of gear i."""
    jets = [pose_of(pose, pose_type, 1) for pose in poses]
    bodies, rates = [movable(pose.truncate(0)) for pose in jets], velocities([movable(pose) for pose in jets])
    mesh = PitchPoint.of(gears, tuple(bodies))
    points = [b.point(point) for b, point in zip(bodies[:2], (gears.point_i, gears.point_j), strict=True)]
    drift = [velocity_at(body, rate, point) - velocity_at(bodies[2], rates[2], point)
             for body, rate, point in zip(bodies[:2], rates, points, strict=False)]  # fmt: skip
    normal, sliding = cross(*mesh.axes), _size(mesh.sliding)
    return {
        "radii": jnp.stack([_size(arm) for arm in mesh.arms]),
        "sliding": sliding,
        "drift": jnp.stack([_size(x) for x in drift]),
        "speed": jnp.stack([_size(rate[1] - rates[2][1]) for rate in rates[:2]]),
        "angle": _size(normal),
        "distance": jnp.abs((points[1] - points[0]).dot(normal).coefficients[0]) / jnp.maximum(_size(normal), 1e-300),
        "lead": jnp.arcsin(jnp.minimum(jnp.abs(mesh.sliding.dot(mesh.axes[0]).coefficients[0]) / sliding, 1.0)),
        "plane": _size(cross(*mesh.arms)),
        "cone": jnp.abs(cross(mesh.normal, mesh.arms[0]).dot(mesh.axes[0]).coefficients[0]) / _size(mesh.arms[0]),
    }


def _size(vector: Jet) -> Any:
    return jnp.linalg.norm(vector.coefficients[0], axis=0)


@Mapped
def _parted(element: Any, lanes: tuple[Sequence[Any], Any], *, pose_type: Any) -> Any:
    """Return the difference of a residual with and without a flank."""
    poses, instants = lanes
    position_poses = [pose_type.from_coordinates({name: Jet([c[0]]) for name, c in pose.items()}) for pose in poses]
    group = Group(element, ())
    time = Jet([instants[None]])

    def residual(flank: float) -> Any:
        return stacked(with_field(group, "flank", flank).element.residual(*position_poses, time))[0]

    return residual(1.0) - residual(0.0)
