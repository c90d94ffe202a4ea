"""A single state of a mechanism as the user gives it; it need not satisfy the joints."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.base.shapes import by_component, real_numbers
from jounce.dynamics.motion_values import Coordinates, cut
from jounce.errors import MechanismError, check_choice, check_name
from jounce.jet.derivatives import taylor_coefficients
from jounce.kinematics import Motion, Status
from jounce.kinematics.position_analysis.solve import HIGHEST_ORDER
from jounce.mechanism import Mechanism, Model, build
from jounce.mechanism.building.builder import with_reference
from jounce.mechanism.laws.law_checks import check_laws
from jounce.rigid import SpatialPose
from jounce.rigid.euler_parameters import euler_parameters
from jounce.rigid.pose import Pose


class MotionAtState(Motion):
    """A single state of a mechanism, consistent or not, as a motion of one instant; `at_state` builds it."""


def at_state(subject: object, state: object, time: object) -> tuple[Motion, int]:
    """Return a state as a motion of one instant, and the number of its known derivatives."""
    if not isinstance(subject, Motion | Mechanism):
        raise MechanismError("must be a jn.Motion or a jn.Mechanism", name="motion", value=subject)
    mechanism = dataclasses.replace(subject if isinstance(subject, Mechanism) else subject.mechanism, outputs={})
    instant = _array("time", time, ())
    model = build(mechanism)
    coordinates = _guessed(model) if state is None else _coordinates(mechanism, model, state)
    order = len(coordinates["position"]) - 1
    check_laws(mechanism, instant[None], order + 1, forces=order > 1)
    if isinstance(subject, Motion):  # revolutions about axes are counted as along the motion
        system = dataclasses.replace(subject.model.system, outputs=())
        model = dataclasses.replace(subject.model, system=system, outputs=())
    else:
        reference = {name: values[0] for name, values in cut(coordinates, 0).items()}
        model, _ = with_reference(model, reference, float(instant))
    history = subject.history if isinstance(subject, Motion) else None
    status = np.array([int(Status.OK)])
    return MotionAtState(
        mechanism, model, instant[None], order, (dict(coordinates), ()), status, {}, history=history
    ), order


def _guessed(model: Model) -> Coordinates:
    coordinates = {name: np.asarray(value)[None] for name, value in model.guess.items()}
    return coordinates | (
        {} if "angle" in coordinates else {"angular_velocity": np.zeros((0, *coordinates["position"].shape[1:]))}
    )


def _coordinates(mechanism: Mechanism, model: Model, state: object) -> Coordinates:
    """Return the Taylor coefficients of the coordinates of all bodies, the ground first, from a user's state."""
    if not isinstance(state, Mapping):
        raise MechanismError(
            "must be a mapping of bodies to where they are and how they move", name="state", value=state
        )
    for name in state:
        check_name("moving body", name, mechanism.bodies, MechanismError, name="state")
    missing_bodies = [name for name in mechanism.bodies if name not in state]
    if missing_bodies:
        raise MechanismError("is missing: a state must contain every moving body", name=f"state.{missing_bodies[0]}")
    states = [_body_state(f"state.{name}", state[name], model.pose_type) for name in mechanism.bodies]
    orders = {len(body["position"]) - 1: name for body, name in zip(states, mechanism.bodies, strict=True)}
    if len(orders) > 1:
        listed = ", ".join(f"'{name}' has {order}" for order, name in sorted(orders.items()))
        raise MechanismError(f"all bodies need derivatives to the same order; {listed}", name="state")
    (order,) = orders
    if order >= HIGHEST_ORDER:
        raise MechanismError(f"derivatives are taken to order {HIGHEST_ORDER - 1}", name="state", value=order)
    coordinates = {}
    for name in states[0]:
        derivatives = np.stack([np.zeros_like(states[0][name]), *(body[name] for body in states)], axis=-1)[..., None]
        if name == "quaternion":
            derivatives[0, 0, 0] = 1.0
        coordinates[name] = taylor_coefficients(derivatives)
    return coordinates


def _body_state(location: str, entry: object, pose_type: type[Pose]) -> dict[str, Float[np.ndarray, "_ *component"]]:
    """Return the plain derivatives of the coordinates of one body."""
    spatial = pose_type is SpatialPose
    keys = ("position", "orientation", "angular_velocity") if spatial else ("position", "angle")
    if not isinstance(entry, Mapping):
        raise MechanismError(f"must be a mapping with {', '.join(keys)}", name=location, value=entry)
    for key in entry:
        check_choice("key", key, keys, MechanismError, name=location)
    for key in keys[:2]:
        if key not in entry:
            raise MechanismError("is missing", name=f"{location}.{key}")
    position = _array(f"{location}.position", entry["position"], (pose_type.shifts,))
    order = len(position) - 1
    if not spatial:
        angle = _array(f"{location}.angle", entry["angle"], (1,))[:, 0]
        _check_order(f"{location}.angle", len(angle) - 1, order)
        return {"position": position, "angle": angle}
    try:
        quaternion = np.array([euler_parameters(entry["orientation"])])
    except MechanismError as error:
        raise error.located(name=f"{location}.orientation") from None
    spin = _array(f"{location}.angular_velocity", entry.get("angular_velocity", np.zeros((0, 3))), (3,))
    _check_order(f"{location}.angular_velocity", len(spin), order)
    return {"position": position, "quaternion": quaternion, "angular_velocity": spin}


def _check_order(name: str, given_order: int, order: int) -> None:
    if given_order != order:
        message = f"goes with a position and {order} {'derivative' if order == 1 else 'derivatives'} of it"
        raise MechanismError(f"{message}; give as many here", name=name, value=given_order)


def _array(name: str, value: Any, shape: tuple[int, ...]) -> Float[np.ndarray, "..."]:
    """Return finite numbers: a scalar for an empty shape, otherwise a stack of arrays, from one array or a list."""
    array = np.array(real_numbers(name, by_component(name, value, MechanismError), MechanismError))
    if shape:
        scalar = shape == (1,)
        if array.ndim == len(shape) - scalar:
            array = array[None]
        array = array[:, None] if scalar and array.ndim == 1 else array
    if array.ndim != len(shape) + bool(shape) or array.shape[1:] != shape:
        expected = "one number" if not shape else f"a list of {shape[0]} numbers, or one such list for each derivative"
        raise MechanismError(f"must be {expected}", name=name, value=value)
    if not np.isfinite(array).all():
        raise MechanismError("must be finite", name=name, value=value)
    return array
