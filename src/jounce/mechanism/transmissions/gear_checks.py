"""Checks of gears, belts, cams and wheels: carriers, hinges, ratios, laws, and the side of a plane."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jax.core import Tracer

from jounce.constraints import planar, spatial
from jounce.constraints.cams import Cam, turns_in_space
from jounce.constraints.friction import GearFriction
from jounce.errors import MechanismError, UnsupportedError
from jounce.mechanism.system import Group
from jounce.mechanism.transmissions.axis_angles import turned
from jounce.mechanism.transmissions.gear_frames import LARGEST_WHOLE, is_toothed
from jounce.mechanism.transmissions.rope_lengths import check_ropes

LEAST_DIFFERENCE = 0.05  # least difference of pulley radii without a common carrier, relative to one of them
FLAT = 1e-6  # largest sine of the angle between the axis and the plane normal of a wheel that lies flat


def check_gears(groups: Sequence[Group], names: Sequence[Sequence[str]]) -> None:
    """Raise MechanismError unless gears have carriers, cams have hinges, and ropes have possible lengths.

    Parameters
    ----------
    groups : sequence of Group
        Groups of joints and drivers.
    names : sequence of sequence of str
        Names of the elements of each group, with their kinds as prefixes.
    """
    check_ropes(groups, names)
    for group, members in zip(groups, names, strict=True):
        if isinstance(group.element, Cam):
            _check_cams(group.element, members)
        if is_toothed(group.element) and group.element.arm is None:
            message = (
                "no body carries both gears: pin each gear at its center, by a revolute joint with the same point, to "
                "one body, such as a carrier or the ground, so that the centers keep their distance"
            )
            raise MechanismError(message, name=f"{members[0]}.points")
        if isinstance(getattr(group.element, "friction", None), GearFriction):
            _check_driving(group.element.friction, members)
        if isinstance(group.element, planar.Belt) and group.element.arm is None:
            _check_belts(group.element, members)
        if isinstance(group.element, spatial.Gear) and None in (group.element.held_i, group.element.held_j):
            slot = 0 if group.element.held_i is None else 1
            message = (
                f"the {('first', 'second')[slot]} gear does not turn about this axis in the frame, the third body: "
                "hinge it there, or to a body that turns about the same axis, by joints that have the axis"
            )
            raise MechanismError(message, name=f"{members[0]}.axes")
        if isinstance(group.element, spatial.Gear) and not isinstance(group.element.whole, Tracer):
            invalid = np.flatnonzero(np.isnan(group.element.whole))
            if invalid.size:
                message = (
                    f"must be one of whole numbers up to {LARGEST_WHOLE}, such as teeth, as attitudes tell angles up "
                    "to whole turns only: write it as 22/37"
                )
                value = float(np.asarray(group.element.ratio).ravel()[invalid[0]])
                raise MechanismError(message, name=f"{members[invalid[0]]}.ratio", value=value)


def _check_driving(friction: GearFriction, names: Sequence[str]) -> None:
    """Raise MechanismError if friction keeps the first of two gears from driving the second."""
    forward = friction.efficiencies[0]
    if isinstance(forward, Tracer):
        return
    invalid = np.flatnonzero(~(np.asarray(forward).ravel() > 0))
    if invalid.size:
        message = (
            "the worm cannot drive its wheel, as lead and friction angle together are 90 deg or more: give a smaller "
            "coefficient or lead angle, or the screw of the smaller lead angle as the first body"
        )
        raise MechanismError(message, name=f"{names[invalid[0]]}.friction")


def _check_belts(belts: planar.Belt, names: Sequence[str]) -> None:
    """Raise MechanismError if belts cannot count the turns of their lines of centers."""
    if isinstance(belts.ratio, Tracer):
        return
    differences = np.abs(1.0 - np.asarray(belts.ratio)).ravel()
    invalid = np.flatnonzero((differences > 0) & (differences < LEAST_DIFFERENCE))
    if invalid.size:
        message = (
            "radii that are nearly the same need one body that carries both pulleys, which counts the turns of the "
            "line of centers: pin both to it, or make the radii equal"
        )
        values = [float(np.asarray(x).ravel()[invalid[0]]) for x in (belts.radius_i, belts.radius_j)]
        raise MechanismError(message, name=f"{names[invalid[0]]}.radii", value=values)


def _check_cams(cams: Cam, names: Sequence[str]) -> None:
    """Raise MechanismError if a spatial angle that leads or follows a cam is not the angle of a hinge."""
    for field, part in (("bodies", cams.follower), ("motion.of", cams.leader)):
        if turns_in_space(part) and part.datum is None:
            message = (
                "the body does not turn about this axis: an angle in space leads or follows a cam where both bodies "
                "are hinged about the axis, by joints that have it"
            )
            raise MechanismError(message, name=f"{names[0]}.{field}")


def check_wheels(groups: Sequence[Group], names: Sequence[Sequence[str]], guess: Mapping[str, Any]) -> None:
    """Raise MechanismError if, at the guess, a wheel lies flat on its plane, or behind a plane of the ground.

    Parameters
    ----------
    groups : sequence of Group
        Groups of joints and drivers.
    names : sequence of sequence of str
        Names of the elements of each group, with their kinds as prefixes.
    guess : dict of str to array
        Coordinates of all bodies, the ground first, (..., bodies, 1).
    """
    for group, members in zip(groups, names, strict=True):
        wheel = group.element
        if not isinstance(wheel, spatial.Wheel):
            continue
        plane, rim = (guess["quaternion"][:, list(bodies)] for bodies in group.bodies)
        on_plane, center = (
            guess["position"][:, list(bodies)] + turned(attitude, np.asarray(point))
            for bodies, attitude, point in zip(group.bodies, (plane, rim), (wheel.point_i, wheel.point_j), strict=True)
        )
        normal, axis = turned(plane, np.asarray(wheel.normal_i)), turned(rim, np.asarray(wheel.axis_j))
        sizes = np.linalg.norm(normal, axis=0) * np.linalg.norm(axis, axis=0)
        flat = np.linalg.norm(np.cross(normal, axis, axis=0), axis=0) <= FLAT * sizes
        height = ((center - on_plane) * normal).sum(axis=0) / np.linalg.norm(normal, axis=0)
        for k, name in enumerate(members[: group.instances]):  # further entries name further rows of the same wheels
            if flat[k, 0]:
                message = "the wheel lies flat on its plane, where no point of its rim touches alone: tilt the body"
                raise MechanismError(message, name=f"{name}.axis")
            if height[k, 0] < 0 and not group.bodies[0][k]:  # a plane of the ground does not move
                message = (
                    f"the center of the wheel is {-height[k, 0]:.4g} m behind its plane at the starting guess, and "
                    "the normal leads from the plane to the wheel: reverse it, or guess the body on its side"
                )
                raise MechanismError(message, name=f"{name}.plane.normal")


def check_ratios(groups: Sequence[Group], names: Sequence[Sequence[str]]) -> None:
    """Raise UnsupportedError if JAX traces the ratio of a spatial gear, because whole turns depend on it."""
    for group, members in zip(groups, names, strict=True):
        if isinstance(group.element, spatial.Gear) and isinstance(group.element.ratio, Tracer):
            message = "a ratio of turns in space is not differentiated, as whole turns go with it; vary it instead"
            raise UnsupportedError(message, name=f"{members[0]}.ratio")
