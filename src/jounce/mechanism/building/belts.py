"""Courses of belts: strands, wraps and length, from the centers of the pulleys."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from jounce.constraints.planar import Belt
from jounce.errors import MechanismError
from jounce.mechanism.building.builder import named_groups

Points = Float[np.ndarray, "2 *batch"]


class BeltCourse(NamedTuple):
    """Course of a belt; angles in rad, lengths in m, NaN where the pulleys overlap.

    Attributes
    ----------
    line : array of shape (...)
        Angle of the line of centers, from the first to the second.
    leaving : array of shape (...)
        Angle from the line of centers to the point at which the strand on its left leaves the first pulley; the strand
        on its right leaves at the negative angle.
    wraps : tuple of array of shape (...)
        Wrap angle on each pulley.
    length : array of shape (...)
        Length of the whole belt.
    """

    line: Any
    leaving: Any
    wraps: tuple[Any, Any]
    length: Any


def belt_course(first: Points, second: Points, radii: Sequence[float], crossed: bool) -> BeltCourse:
    """Return the course of a belt around two pulleys.

    Parameters
    ----------
    first, second : array of shape (2, ...)
        Centers of the pulleys, m.
    radii : sequence of float
        Radii of the pulleys, m.
    crossed : bool
        Whether the strands cross.

    Examples
    --------
    >>> import numpy as np
    >>> course = belt_course(np.zeros(2), np.array([0.5, 0.0]), (0.1, 0.1), False)
    >>> round(float(course.length - 2 * 0.5 - 2 * np.pi * 0.1), 12)  # two strands and a whole turn
    0.0
    """
    x, y = second - first
    distance, (a, b) = np.hypot(x, y), radii
    radial = a + b if crossed else a - b
    with np.errstate(invalid="ignore", divide="ignore"):
        strand = np.sqrt(np.where(distance > a + b, distance**2 - radial**2, np.nan))
        leaving = np.arccos(radial / distance)
    on_first = 2 * (np.pi - leaving)
    on_second = on_first if crossed else 2 * leaving
    length = 2 * strand + a * on_first + b * on_second
    return BeltCourse(np.arctan2(y, x), leaving, (on_first, on_second), length)


def belt_outline(course: BeltCourse, centers: Sequence[Points], radii: Sequence[float], crossed: bool) -> Any:
    """Return points on the outline of a belt, (..., points, 2), m, in order from the strand on the left.

    The first half of the points is on the second pulley, the other half on the first.
    """
    fraction = np.linspace(-1.0, 1.0, 33)
    side = -1.0 if crossed else 1.0  # side of the second pulley at which the strand on the left arrives
    line, leaving = course.line[..., None], course.leaving[..., None]
    around_second = line - side * (np.pi - leaving if crossed else leaving) * fraction
    around_first = line + np.pi - (np.pi - leaving) * fraction
    parts = [
        center[:, ..., None] + radius * np.stack([np.cos(angle), np.sin(angle)])
        for center, radius, angle in zip(centers[::-1], radii[::-1], (around_second, around_first), strict=True)
    ]
    return np.moveaxis(np.concatenate(parts, axis=-1), 0, -1)


def check_room(motion: Any) -> None:
    """Raise MechanismError if pulleys without a common arm overlap in a motion, and name the instant."""
    model = motion.model
    for group, members in named_groups(model):
        if isinstance(group.element, Belt) and group.element.arm is None:
            _check_belts(group, members, motion.poses[1], motion.time)


def _check_belts(group: Any, names: Sequence[str], coordinates: Mapping[str, Any], time: np.ndarray) -> None:
    belt = group.element
    centers = [
        centers_of(coordinates, slot, point)
        for slot, point in zip(group.bodies, (belt.point_i, belt.point_j), strict=False)
    ]
    distance = np.hypot(*(centers[1] - centers[0]))
    overlapping = np.argwhere((distance <= np.asarray(belt.radius_i + belt.radius_j)).T)
    if len(overlapping):
        lane, instance = overlapping[0]
        limit = float(np.asarray(belt.radius_i + belt.radius_j)[instance, 0])
        message = (
            f"at t = {time[lane]:g} s the centers are {distance[instance, lane]:.6g} m apart, and the pulleys overlap "
            f"below {limit:.6g} m, the sum of the radii"
        )
        raise MechanismError(message, name=f"{names[instance]}.radii")


def centers_of(coordinates: Mapping[str, Any], bodies: Sequence[int], point: Any) -> Float[np.ndarray, "2 body time"]:
    """Return the global positions of a point on planar bodies, m."""
    position = np.asarray(coordinates["position"])[0][:, list(bodies)]
    angle = np.asarray(coordinates["angle"])[0][list(bodies)]
    x, y = np.asarray(point)
    return position + np.stack([np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y])
