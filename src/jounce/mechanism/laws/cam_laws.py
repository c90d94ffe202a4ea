"""The laws of cams as laws of time, where the leader of a cam is driven by a law of time."""

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from jounce.constraints.base import value_fields
from jounce.constraints.cams import Cam, coordinate_of_element
from jounce.errors import JounceError, MechanismError
from jounce.jet import Jet
from jounce.jet.turns import WHOLE_TURN
from jounce.mechanism.building.builder import Model, named_groups
from jounce.mechanism.carriages import carriage_of
from jounce.mechanism.laws.output_drivers import driver_of_output
from jounce.mechanism.mechanism import Mechanism
from jounce.mechanism.resolve import resolve_motion
from jounce.trajectory import FollowingMotion, OutputMotion


def same_coordinate(element: Any, other: Any) -> bool:
    """Return whether two drivers prescribe the same coordinate, whatever their laws.

    Examples
    --------
    >>> from jounce import drivers
    >>> one, two = (drivers.CoordinateDriver(("ground", "shaft"), "angle", law) for law in ("t", "2*t"))
    >>> same_coordinate(one, two)
    True
    """
    if type(element) is not type(other) or element.bodies != other.bodies:
        return False
    return all(_plain(element, name) == _plain(other, name) for name in value_fields(type(element)) if name != "motion")


def _plain(element: Any, name: str) -> str:
    value = getattr(element, name)
    value = value.tolist() if hasattr(value, "tolist") else list(value) if isinstance(value, tuple) else value
    if name == "ratio" and (value is None or element.bodies[0] == "ground"):
        value = 1.0
    if isinstance(value, list):
        return repr([float(x) if isinstance(x, int | float) else str(x) for x in value])
    return repr(float(value)) if isinstance(value, int | float) else str(value)


def driver_of_leader(mechanism: Mechanism, cam: Cam) -> str | None:
    """Return the name of the driver of the leader of a cam; None if there is none."""
    for name, driver in mechanism.drivers.items():
        try:
            if same_coordinate(coordinate_of_element(driver), cam.leader):
                return name
        except JounceError:  # a driver that leads no cam
            continue
    return None


def leader_name(mechanism: Mechanism, cam: Cam) -> str | None:
    """Return the name of a driver, joint, initial condition or output with the leader coordinate of a cam, or None."""
    kinds = (mechanism.drivers, mechanism.joints, mechanism.initial)
    names = [cam.of] if cam.of else []
    for name in [*names, *(x for kind in kinds for x in kind), *mechanism.outputs]:
        element = next((kind[name] for kind in kinds if name in kind), None)
        try:
            if element is None:
                element = driver_of_output(mechanism, OutputMotion(name, "0"), "of")
            if element is not cam and same_coordinate(coordinate_of_element(element), cam.leader):
                return name
        except JounceError:
            continue
    return None


def check_turns(mechanism: Mechanism, model: Model, coordinates: Mapping[str, Any], instant: float) -> None:
    """Raise MechanismError if a spatial cam has not counted the turns with which the law of its leader starts.

    Parameters
    ----------
    mechanism : Mechanism
        Assembled mechanism.
    model : Model
        Its model.
    coordinates : mapping of str to array
        Coordinates of all bodies at the instant, the ground first, (..., bodies, 1).
    instant : float
        Instant at which the mechanism is assembled, s.
    """
    for name, cam in mechanism.joints.items():
        if not (isinstance(cam, Cam) and cam.hidden) or (leader := driver_of_leader(mechanism, cam)) is None:
            continue
        given = _law_value(model, f"drivers.{leader}", instant)
        place = np.asarray(coordinates["position"])[:, 1 + model.bodies.index(carriage_of(name)), 0]
        if abs(gap := place[0] / place[-1] - given) > 1.0:
            message = (
                f"its leader starts at {given:g} rad by the law of {leader}, and {abs(gap) / WHOLE_TURN:.3g} turns "
                "of it were not counted on the way from the starting guess: start the law less than 100 turns from it"
            )
            raise MechanismError(message, name=f"joints.{name}.motion.of")


def _law_value(model: Model, driver: str, instant: float) -> float:
    """Return the value of the law of a driver at an instant, s; `driver` is its dotted name."""
    for group, names in named_groups(model):
        if driver in names:
            values = np.asarray(group.element.motion(Jet([np.full((1, 1), instant)])).coefficients[0])
            return float(np.broadcast_to(values, (group.instances, 1))[names.index(driver), 0])
    return math.nan


def cams_in_time(mechanism: Mechanism) -> Iterator[tuple[str, FollowingMotion]]:
    """Yield the name and the law of time of each cam with a driven leader.

    Invalid laws are left out: they are refused when used.
    """
    values = mechanism.parameter_values
    for name, cam in mechanism.joints.items():
        if not isinstance(cam, Cam) or (leader := driver_of_leader(mechanism, cam)) is None:
            continue
        motion: Any = getattr(mechanism.drivers[leader], "motion", None)
        if motion is None or isinstance(motion, OutputMotion):
            continue
        try:
            law, leader_law = (resolve_motion(x, values) for x in (cam.motion, motion))
        except JounceError:
            continue
        yield name, FollowingMotion(law, leader_law)
