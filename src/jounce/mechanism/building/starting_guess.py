"""The starting guess of a mechanism: the stated poses of its bodies, the ground first."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from jounce.base.shapes import has_labels
from jounce.constraints.cams import Cam
from jounce.errors import JounceError, MechanismError
from jounce.jet import Jet
from jounce.mechanism.carriages import carriage_guess, curve_in, joint_of
from jounce.mechanism.mechanism import GROUND, Body, Carriage, Mechanism
from jounce.mechanism.resolve import along_instances, resolve, resolve_element, resolved
from jounce.rigid import PlanarPose, SpatialPose
from jounce.rigid.euler_parameters import euler_parameters
from jounce.rigid.pose import Pose


def starting_guess(mechanism: Mechanism, parameters: dict[str, Any], components: int) -> dict[str, Any]:
    """Return the coordinates of all bodies at the starting guess, the ground first."""
    positions, attitudes = [np.zeros(components)], [np.zeros(()) if components == 2 else np.array([1.0, 0, 0, 0])]
    names = (GROUND, *mechanism.rigid_bodies)
    for name, body in mechanism.bodies.items():
        location = f"bodies.{name}"
        if isinstance(body, Carriage):
            poses = dict(zip(names, zip(positions, attitudes, strict=False), strict=False))
            positions.append(_carriage_guess(mechanism, name, body, poses, parameters, components))
            attitudes.append(attitudes[0])
            continue
        _check_unused(body, location, "orientation" if components == 2 else "angle")
        positions.append(resolved(body.position, f"{location}.position", "vector", components, parameters))
        if components == 2:
            attitudes.append(resolved(body.angle, f"{location}.angle", "scalar", components, parameters))
        else:
            attitudes.append(_attitude(body.orientation, f"{location}.orientation", parameters))
    attitude = "angle" if components == 2 else "quaternion"
    return {"position": along_instances(*positions), attitude: along_instances(*attitudes)}


def _check_unused(body: Body, location: str, unused: str) -> None:
    """Raise MechanismError if a body states its attitude in the form of the other space, which would be ignored."""
    value = getattr(body, unused)
    if not (value is None or (type(value) in (int, float) and value == 0)):
        needed = "an angle" if unused == "orientation" else "an orientation"
        raise MechanismError(f"a body of this space has {needed} instead", name=f"{location}.{unused}", value=value)


def _carriage_guess(
    mechanism: Mechanism, name: str, body: Carriage, poses: Any, parameters: dict[str, Any], components: int
) -> Any:
    """Return the starting guess of the position of a carriage, from the poses of the bodies before it."""
    if body.position is not None:
        return np.asarray(body.position, float)
    joint = joint_of(name)
    element = mechanism.joints[joint]
    if isinstance(element, Cam):  # zero turns of the leader: whole turns are counted on the way to the laws
        return np.array([0.0, 0.0, 1.0])
    values = resolve_element(element, parameters, components, f"joints.{joint}")
    start = [x for key, x in values.items() if key.startswith("start")]
    pose_type, key = (PlanarPose, "angle") if components == 2 else (SpatialPose, "quaternion")
    body_i, body_j = (
        pose_at({"position": position, key: attitude}, pose_type)
        for position, attitude in (poses[index] for index in element.bodies)
    )
    point = body_i.to_body(body_j.point(values["point_j"]) - body_i.position).coefficients[0]
    try:
        return carriage_guess(curve_in(values), None if any(x is None for x in start) else start, point)
    except MechanismError as error:
        raise MechanismError(error.message, name=f"joints.{joint}.{error.name}", value=error.value) from None


def _attitude(orientation: Any, name: str, parameters: dict[str, Any]) -> np.ndarray:
    """Return the Euler parameters of an orientation whose numbers may be expressions of the parameters."""
    if orientation is None:
        return np.array([1.0, 0.0, 0.0, 0.0])
    try:
        if isinstance(orientation, Mapping):
            given = dict(orientation)
            if has_labels(angles := given.get("angles")):
                given["angles"] = np.asarray(angles)  # in the order of the turns, whatever their labels
            given = {k: v if k == "euler" else resolve(v, parameters) for k, v in given.items()}
        else:
            given = resolve(orientation, parameters)
        return np.array(euler_parameters(given))
    except JounceError as error:
        key = f"{name}.{error.name}" if error.name else name
        raise type(error)(error.message, name=key, value=error.value) from None


def pose_at(coordinates: Mapping[str, Any], pose_type: type[Pose]) -> Any:
    """Return the pose of order zero that has the given coordinates."""
    return pose_type.from_coordinates({name: Jet([value]) for name, value in coordinates.items()})
