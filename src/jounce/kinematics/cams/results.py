"""Results of a cam: its shape, extremes with the cam angles where they are, and undercut."""

import dataclasses
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

Numbers1 = Float[np.ndarray, " angle"]
Plane = Float[np.ndarray, "2 angle"]


class Geometry(NamedTuple):
    """A cam at some cam angles, in its own frame; lengths in m, angles in rad.

    Attributes
    ----------
    lift : array of shape (angle,)
        m or rad.
    pitch, profile : array of shape (2, angle)
        The center of the roller or the edge, and where it touches; of a flat face both are the same.
    pressure_angle : array of shape (angle,)
        From the travel of the follower to the normal of the profile, in the sense in which the cam turns: positive
        where the cam lifts the follower.
    forward, around : array of shape (angle,)
        How far the contact, and the center of the roller, go round the cam per rad; where the contact goes back, the
        profile is undercut.
    turned : array of shape (angle,)
        How far the normal turns round the cam per rad, negative where the profile is concave.
    contact : array of shape (angle,)
        Where a flat face is touched, along it.
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
        """Curvature of the profile, positive where it is convex, 1/m; infinite where it is pointed."""
        with np.errstate(divide="ignore"):
            return self.turned / self.forward

    @property
    def pitch_curvature(self) -> Numbers1:
        """Curvature of the curve of the center of the roller, 1/m."""
        return self.turned / self.around


@dataclasses.dataclass(frozen=True)
class Extreme:
    """A largest or a smallest value of a cam.

    Attributes
    ----------
    value : float
        m, or rad.
    angle : float
        Of the cam, rad.
    """

    value: float
    angle: float


@dataclasses.dataclass(frozen=True)
class Undercut:
    """A part of a law that a cam cannot give the follower, since the cutter takes away what it should touch.

    Attributes
    ----------
    start, stop : float
        Cam angles between which lift is lost, rad; of a part through zero, the start is greater than the stop.
    angle : float
        Where most is lost, rad.
    lost : float
        How much there, m or rad.
    """

    start: float
    stop: float
    angle: float
    lost: float
