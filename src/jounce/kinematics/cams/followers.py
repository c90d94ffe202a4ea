"""Followers of plate cams: their positions, written on jets, and the lift at which they touch a point.

The cam turns about the origin. A translating follower moves along y, at an offset from the origin. An oscillating
follower turns about a pivot on the x axis, with its arm above that axis. Increasing lift moves either away from the
cam.
"""

import abc
import dataclasses

import numpy as np
from jaxtyping import Float

from jounce.errors import MechanismError, check_choice
from jounce.jet import Jet, cos, sin, stack
from jounce.trajectory.checks import finite, positive

SHAPES = ("knife_edge", "roller", "flat_face")
Plane = Float[np.ndarray, "2 points"]


class AbstractFollower(abc.ABC):
    """A follower of a cam with a knife edge, a roller, or a flat face."""

    shape: str
    radius: float
    turning = False  # whether its lift is an angle

    def __post_init__(self):
        check_choice("shape", self.shape, SHAPES, MechanismError)
        for field in dataclasses.fields(self):  # type: ignore[arg-type] - every follower is a dataclass
            if field.name != "shape":
                is_positive = field.name == "center_distance" or (field.name == "arm" and not self.is_flat)
                check = positive if is_positive else finite
                object.__setattr__(self, field.name, check(field.name, getattr(self, field.name)))
        if self.shape == "roller":
            positive("radius", self.radius)
        elif self.radius:
            raise MechanismError("only a roller has a radius", name="radius", value=self.radius)

    @property
    def is_flat(self) -> bool:
        """Whether the follower has a flat face."""
        return self.shape == "flat_face"

    @abc.abstractmethod
    def start(self, base_radius: float) -> float:
        """Return the coordinate of the follower on the base circle, from which its lift is counted, m or rad.

        Raises
        ------
        MechanismError
            If the follower does not reach the base circle.
        """

    @abc.abstractmethod
    def center(self, coordinate: Jet) -> Jet:
        """Return the center of the roller, or the edge, (2, ...), m."""

    @abc.abstractmethod
    def face(self, coordinate: Jet) -> tuple[Jet, Jet]:
        """Return the direction of the normal of the face, rad, and the distance of the face from the origin, m."""

    @abc.abstractmethod
    def travel(self, coordinate: Jet, point: Jet) -> Jet:
        """Return a vector along which a point of the follower moves with growing lift, (2, ...)."""

    @abc.abstractmethod
    def along_face(self, coordinate: Jet, point: Jet) -> Jet:
        """Return the coordinate of a point along the face, m, from its middle (translating) or from the pivot."""

    @abc.abstractmethod
    def touching(self, points: Plane) -> Float[np.ndarray, " points"]:
        """Return the coordinate at which the follower, coming from outside, touches points; -inf where it misses."""


@dataclasses.dataclass(frozen=True)
class TranslatingFollower(AbstractFollower):
    """A follower that translates along a line.

    Parameters
    ----------
    shape : str
        ``"knife_edge"``, ``"roller"`` or ``"flat_face"``, at right angles to its travel.
    radius : float, default 0
        Radius of the roller, m.
    offset : float, default 0
        Offset of the line of travel, along y, from the axis of the cam toward x, m; for a flat face, that of its
        middle.

    Raises
    ------
    MechanismError
        If the shape does not exist, or does not go with a radius.
    TrajectoryError
        If a value is not a finite number, or a radius is not positive.

    Examples
    --------
    >>> import jounce as jn
    >>> jn.cams.TranslatingFollower("roller", radius=0.008, offset=0.005).offset
    0.005
    """

    shape: str
    radius: float = 0.0
    offset: float = 0.0

    def start(self, base_radius: float) -> float:
        """Return the height on the base circle."""
        if self.is_flat:
            return base_radius
        prime_radius = base_radius + self.radius
        if abs(self.offset) >= prime_radius:
            message = (
                f"is not less than the radius of the prime circle, {prime_radius:g} m, so that the follower misses "
                "the cam"
            )
            raise MechanismError(message, name="offset", value=self.offset)
        return float(np.sqrt(prime_radius**2 - self.offset**2))

    def center(self, coordinate: Jet) -> Jet:
        """Return the center of the roller, or the edge."""
        return stack([coordinate * 0.0 + self.offset, coordinate])

    def face(self, coordinate: Jet) -> tuple[Jet, Jet]:
        """Return the direction of the normal and the height of the face."""
        return coordinate * 0.0 + np.pi / 2, coordinate

    def travel(self, coordinate: Jet, point: Jet) -> Jet:
        """Return the direction of y."""
        del point
        return stack([coordinate * 0.0, coordinate * 0.0 + 1.0])

    def along_face(self, coordinate: Jet, point: Jet) -> Jet:
        """Return x, from the middle of the face."""
        del coordinate
        return point[0] - self.offset

    def touching(self, points: Plane) -> Float[np.ndarray, " points"]:
        """Return the height at which the follower comes down on points."""
        x, y = points
        if self.is_flat:
            return y
        square = self.radius**2 - (x - self.offset) ** 2
        with np.errstate(invalid="ignore"):
            return np.where(square >= 0, y + np.sqrt(square), -np.inf)


@dataclasses.dataclass(frozen=True)
class OscillatingFollower(AbstractFollower):
    """A follower that oscillates about a pivot.

    Parameters
    ----------
    shape : str
        ``"knife_edge"``, ``"roller"`` or ``"flat_face"``.
    center_distance : float
        Distance of the pivot from the axis of the cam, along x, m.
    arm : float, default 0
        Length from the pivot to the edge or to the center of the roller, m; none for a flat face.
    radius : float, default 0
        Radius of the roller, m.
    face_offset : float, default 0
        Distance of a flat face from the pivot, toward the cam, m.

    Raises
    ------
    MechanismError
        If the shape does not exist, or does not go with a radius.
    TrajectoryError
        If a value is not a finite number, or a length is not positive.

    Examples
    --------
    >>> import jounce as jn
    >>> jn.cams.OscillatingFollower("roller", center_distance=0.08, arm=0.07, radius=0.01).turning
    True
    """

    shape: str
    center_distance: float
    arm: float = 0.0
    radius: float = 0.0
    face_offset: float = 0.0

    turning = True

    def start(self, base_radius: float) -> float:
        """Return the angle between the arm, or the face, and the line to the axis of the cam, on the base circle."""
        c = self.center_distance
        if self.is_flat:
            sine = (base_radius + self.face_offset) / c
            if not 0 < sine < 1:
                message = (
                    f"must be more than {base_radius + self.face_offset:g} m for the face to reach the base circle"
                )
                raise MechanismError(message, name="center_distance", value=c)
            return float(np.arcsin(sine))
        prime_radius = base_radius + self.radius
        cosine = (c**2 + self.arm**2 - prime_radius**2) / (2 * c * self.arm)
        if not -1 < cosine < 1:
            low, high = abs(c - prime_radius), c + prime_radius
            message = f"must be from {low:g} m to {high:g} m for the follower to reach the base circle"
            raise MechanismError(message, name="arm", value=self.arm)
        return float(np.arccos(cosine))

    def center(self, coordinate: Jet) -> Jet:
        """Return the center of the roller, or the edge."""
        return stack([self.center_distance - cos(coordinate) * self.arm, sin(coordinate) * self.arm])

    def face(self, coordinate: Jet) -> tuple[Jet, Jet]:
        """Return the direction of the normal, and the distance of the face from the axis of the cam."""
        return np.pi / 2 - coordinate, sin(coordinate) * self.center_distance - self.face_offset

    def travel(self, coordinate: Jet, point: Jet) -> Jet:
        """Return the velocity of the point as the arm turns away from the cam."""
        del coordinate
        return stack([point[1], self.center_distance - point[0]])

    def along_face(self, coordinate: Jet, point: Jet) -> Jet:
        """Return the distance from the foot of the pivot."""
        return (self.center_distance - point[0]) * cos(coordinate) + point[1] * sin(coordinate)

    def touching(self, points: Plane) -> Float[np.ndarray, " points"]:
        """Return the angle of the arm, or of the face, at which it comes down on points."""
        x, y = self.center_distance - points[0], points[1]
        distance, direction = np.hypot(x, y), np.arctan2(y, x)
        with np.errstate(invalid="ignore", divide="ignore"):
            if self.is_flat:
                sine = self.face_offset / distance
                coordinate = direction + np.arcsin(sine)
                return np.where(np.abs(sine) <= 1, coordinate, -np.inf)
            cosine = (self.arm**2 + distance**2 - self.radius**2) / (2 * self.arm * distance)
            if not self.radius:
                return np.where(np.abs(distance - self.arm) <= 1e-9 * self.arm, direction, -np.inf)
            return np.where(np.abs(cosine) <= 1, direction + np.arccos(np.clip(cosine, -1, 1)), -np.inf)


Follower = TranslatingFollower | OscillatingFollower


def rotated(vector: Jet, angle: Jet) -> Jet:
    """Return vectors of shape (2, ...) turned by an angle."""
    c, s = cos(angle), sin(angle)
    return stack([vector[0] * c - vector[1] * s, vector[0] * s + vector[1] * c])


def unit(angle: Jet) -> Jet:
    """Return unit vectors in a direction, (2, ...)."""
    return stack([cos(angle), sin(angle)])
