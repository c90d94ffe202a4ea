"""Results of a cam: geometry, extremes and undercut."""

import dataclasses
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

Numbers1 = Float[np.ndarray, " angle"]
Plane = Float[np.ndarray, "2 angle"]


class Geometry(NamedTuple):
    """A cam at given cam angles, in its own frame; lengths in m, angles in rad.

    Attributes
    ----------
    lift : array of shape (angle,)
        Lift, m or rad.
    pitch, profile : array of shape (2, angle)
        Position of the roller center or the edge, and of the contact; the same for a flat face.
    pressure_angle : array of shape (angle,)
        Angle from the travel of the follower to the normal of the profile, in the sense of rotation of the cam:
        positive where the cam lifts the follower.
    forward, around : array of shape (angle,)
        Speed of the contact, and of the roller center, around the cam per rad; where the contact moves backward, the
        profile is undercut.
    turned : array of shape (angle,)
        Rotation of the normal around the cam per rad; negative where the profile is concave.
    contact : array of shape (angle,)
        Position of the contact along a flat face.
    """

    lift: Numbers1
    pitch: Plane
    profile: Plane
    pressure_angle: Numbers1
    forward: Numbers1
    around: Numbers1
    turned: Numbers1
    contact: Numbers1

    @property
    def curvature(self) -> Numbers1:
        """Curvature of the profile, positive where it is convex, 1/m; infinite at a cusp."""
        with np.errstate(divide="ignore"):
            return self.turned / self.forward

    @property
    def pitch_curvature(self) -> Numbers1:
        """Curvature of the pitch curve, 1/m."""
        return self.turned / self.around


@dataclasses.dataclass(frozen=True)
class Extreme:
    """A largest or smallest value of a cam.

    Attributes
    ----------
    value : float
        Value, m or rad.
    angle : float
        Cam angle, rad.
    """

    value: float
    angle: float


@dataclasses.dataclass(frozen=True)
class Undercut:
    """A part of a law that a cam cannot give the follower, since the cutter removes the profile it would touch.

    Attributes
    ----------
    start, stop : float
        Cam angles between which lift is lost, rad; the start exceeds the stop if the part includes zero.
    angle : float
        Cam angle of the largest loss, rad.
    lost : float
        Largest loss of lift, m or rad.
    """

    start: float
    stop: float
    angle: float
    lost: float
