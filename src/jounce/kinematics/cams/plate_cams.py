"""The profile of a plate cam, as the envelope of its follower.

Everything is written on jets by the cam angle, in the frame of the cam. The center of a roller traces the pitch curve,
to which the profile is the parallel curve; the profile of a flat face is the envelope of its lines. Tangents, normals,
pressure angles and curvatures follow from derivatives of these jets; no formula for one is written.
"""

import dataclasses
from collections.abc import Callable, Mapping
from functools import cached_property
from operator import attrgetter
from typing import TYPE_CHECKING

import numpy as np

from jounce.base.display import Displayed
from jounce.base.shapes import ArrayLike, real_numbers
from jounce.errors import MechanismError, SampleWarning, TrajectoryError, check_choice, warn_caller, whole_number
from jounce.jet import Jet, atan2, sqrt
from jounce.jet.turns import WHOLE_TURN
from jounce.kinematics.cams.followers import AbstractFollower, Follower, rotated, unit
from jounce.kinematics.cams.results import Extreme, Geometry, Numbers1, Undercut
from jounce.kinematics.cams.undercut import followed_lift, runs
from jounce.rigid import perpendicular
from jounce.trajectory import (
    AbstractMotion,
    Continuity,
    Expression,
    ExpressionMotion,
    SegmentedMotion,
    SplineMotion,
    continuity,
)
from jounce.trajectory.checks import positive
from jounce.trajectory.sample_errors import unsupported_derivative, unsupported_words
from jounce.units.shown_units import ShownUnits

if TYPE_CHECKING:
    import xarray

SIGNS = {"counterclockwise": 1.0, "clockwise": -1.0}
CLOSED = 1e-9  # of the rise: largest difference between start and end of a closed law
CURVED = 2  # highest derivative of a law that affects radii of curvature
ORDER = 3  # of the jets: positions, tangents, and how they turn
BENT = 1e-9  # of the largest turning rate of the normal: smaller ones count as straight
NOTICED = 1e-6  # of the size of the cam: smaller losses of lift come from the spacing of points near an undercut
ROUNDS, POINTS = 9, 9  # refinements of an extreme, and points of each
MOST = 100_000  # points of a profile


@dataclasses.dataclass(frozen=True)
class PlateCam(Displayed):
    """A plate cam with its follower and law.

    Parameters
    ----------
    law : AbstractMotion
        Lift of the follower by the cam angle, m or rad by rad.
    follower : TranslatingFollower or OscillatingFollower
    base_radius : float
        Base radius, m.
    sense : str
        Sense of rotation of the cam, ``"counterclockwise"`` or ``"clockwise"``.
    angle : numpy.ndarray of shape (angle,)
        Cam angles of the table, rad, in the sense of rotation.
    title : str
    units : dict of str to str
        Units for display and files, as those of a `Mechanism`; all attributes are in SI.
    """

    law: AbstractMotion
    follower: Follower
    base_radius: float
    sense: str
    angle: np.ndarray
    title: str = ""
    units: Mapping[str, str] = dataclasses.field(default_factory=dict)

    def __repr__(self) -> str:
        title = f"{self.title}: " if self.title else ""
        follower = f"{type(self.follower).__name__}, base radius {self.base_radius:g} m"
        return f"<PlateCam {title}{type(self.law).__name__}, {follower}, {len(self.angle)} angles>"

    @property
    def shown_units(self) -> ShownUnits:
        """The units for display and files."""
        variable_units = {str(name): x.attrs["units"] for name, x in self.dataset.variables.items()}
        return ShownUnits(self.units, variable_units)

    def at(self, angle: ArrayLike) -> Geometry:
        """Return the cam at any cam angles, rad, exact to rounding."""
        return _geometry(self, np.atleast_1d(real_numbers("angle", angle, MechanismError)))

    @cached_property
    def table(self) -> Geometry:
        """The cam at the angles of its table."""
        return self.at(self.angle)

    @cached_property
    def continuity(self) -> Continuity:
        """The order to which the law is continuous over a turn of the cam and across its end."""
        return continuity(self.law, 0.0, WHOLE_TURN, periodic=True)

    @cached_property
    def largest_pressure_angle(self) -> Extreme:
        """The pressure angle farthest from zero, with its sign, rad."""
        return self._extreme(attrgetter("pressure_angle"), np.abs)

    @cached_property
    def least_radius(self) -> Extreme | None:
        """The smallest radius of curvature where the profile is convex, m; negative where it is undercut.

        None if the profile is nowhere convex.
        """
        return self._least_radius(1.0)

    @cached_property
    def least_concave_radius(self) -> Extreme | None:
        """The smallest radius of curvature where the profile is concave, m; None if it is nowhere concave."""
        return self._least_radius(-1.0)

    @property
    def is_undercut(self) -> bool:
        """Whether the follower cannot follow its law somewhere on the cam."""
        return bool(self.undercuts) or (self.least_radius is not None and self.least_radius.value < 0)

    @cached_property
    def face(self) -> tuple[Extreme, Extreme] | None:
        """The lowest and the highest contact along a flat face, m; None for other followers.

        The face must reach from one to the other. Contacts are measured from the middle of a translating face, and from
        the foot of the pivot along an oscillating one.
        """
        if not self.follower.is_flat:
            return None
        contact = attrgetter("contact")
        return self._extreme(contact, np.negative), self._extreme(contact, np.positive)

    @cached_property
    def undercuts(self) -> tuple[Undercut, ...]:
        """The parts of the law that the cam cannot give, with cam angles and lost lift."""
        lost_lift = self.table.lift - self.followed_lift
        size = 1.0 if self.follower.turning else self.base_radius
        return tuple(runs(self.angle, lost_lift, lost_lift > NOTICED * size))

    @cached_property
    def followed_lift(self) -> Numbers1:
        """The lift of the follower on the remaining profile, at the angles of the table, m or rad.

        The profile is cut point by point; without undercut, the lift is that of the law.
        """
        return followed_lift(self.follower, self.base_radius, SIGNS[self.sense], self.angle, self.table, self.at)

    @cached_property
    def dataset(self) -> "xarray.Dataset":
        """The table as an `xarray.Dataset` along the cam angle, SI, units in the attributes."""
        import xarray

        geometry, lift = self.table, "rad" if self.follower.turning else "m"
        columns = {
            "lift": (geometry.lift, lift),
            "x": (geometry.profile[0], "m"),
            "y": (geometry.profile[1], "m"),
            "pitch_x": (geometry.pitch[0], "m"),
            "pitch_y": (geometry.pitch[1], "m"),
            "pressure_angle": (geometry.pressure_angle, "rad"),
            "curvature": (geometry.curvature, "1/m"),
        }
        if self.follower.is_flat:
            columns["contact"] = (geometry.contact, "m")
            del columns["pitch_x"], columns["pitch_y"]
        variables = {name: ("angle", values, {"units": u, "long_name": name}) for name, (values, u) in columns.items()}
        dataset = xarray.Dataset(variables, coords={"angle": ("angle", self.angle, {"units": "rad"})})
        return dataset.assign_attrs(title=self.title or "plate cam", source="jounce")

    def _least_radius(self, sign: float) -> Extreme | None:
        """Return the smallest radius of curvature where the profile is convex (`sign` 1) or concave (-1)."""

        def radius(geometry: Geometry) -> Numbers1:
            bent = sign * geometry.turned > BENT * np.abs(geometry.turned).max(initial=0.0)
            return np.where(bent, geometry.forward / np.where(bent, sign * geometry.turned, 1.0), np.inf)

        if not np.isfinite(radius(self.table)).any():
            return None
        return self._extreme(radius, np.negative)

    def _extreme(self, value: Callable[[Geometry], Numbers1], size: Callable[[Numbers1], Numbers1]) -> Extreme:
        """Return the value of largest `size`, refined around the largest of the table."""
        step = WHOLE_TURN / max(len(self.angle) - 1, 1)
        best = float(self.angle[int(np.nanargmax(size(value(self.table))))])
        for _ in range(ROUNDS):
            angles = best + step * np.linspace(-1, 1, POINTS)
            best = float(angles[int(np.nanargmax(size(value(self.at(angles)))))])
            step *= 2 / (POINTS - 1)
        return Extreme(float(value(self.at(best))[0]), float(best % WHOLE_TURN))


def plate_cam(
    law: AbstractMotion | Expression | str,
    follower: Follower,
    base_radius: float,
    *,
    sense: str = "counterclockwise",
    count: int = 721,
    title: str = "",
) -> PlateCam:
    """Return the plate cam that gives a follower its law.

    Parameters
    ----------
    law : AbstractMotion, Expression or str
        Lift of the follower from the base circle by the cam angle, which takes the place of time: m by rad for a
        translating follower, rad by rad for an oscillating one. After a turn it must return to its start.
    follower : TranslatingFollower or OscillatingFollower
    base_radius : float
        The smallest radius of the profile where the lift is zero, m.
    sense : str, default "counterclockwise"
        Sense of rotation of the cam, or ``"clockwise"``.
    count : int, default 721
        Number of points of the table over a turn, including both ends.
    title : str, optional

    Returns
    -------
    PlateCam
        The cam; its frame coincides with that of the ground at cam angle zero.

    Raises
    ------
    MechanismError
        If the follower does not reach the base circle, or the law takes it through the axis of the cam or out of reach.
    TrajectoryError
        If the law does not close over a turn, is undefined at some angles, or a value is not valid.

    Examples
    --------
    An eccentric disc of 30 mm, 10 mm off its axis, under a flat face:

    >>> import jounce as jn
    >>> cam = jn.cams.plate_cam("0.01*(1 - cos(t))", jn.cams.TranslatingFollower("flat_face"), base_radius=0.02)
    >>> round(1 / float(cam.at(1.0).curvature[0]), 12), [round(end.value, 12) for end in cam.face]
    (0.03, [-0.01, 0.01])
    """
    if isinstance(law, str | Expression):
        law = ExpressionMotion(law)
    if not isinstance(law, AbstractMotion):
        raise TrajectoryError("must be a motion law, or an expression of t, the cam angle", name="law", value=law)
    if not isinstance(follower, AbstractFollower):
        raise MechanismError("must be a TranslatingFollower or an OscillatingFollower", name="follower", value=follower)
    check_choice("sense", sense, tuple(SIGNS), MechanismError)
    count = whole_number("count", count, 16, MOST, error=TrajectoryError)
    angle = np.linspace(0.0, WHOLE_TURN, count)
    cam = PlateCam(law, follower, positive("base_radius", base_radius), sense, angle, title)
    law.check_instants(0.0, WHOLE_TURN)
    if isinstance(law, SegmentedMotion) and law.beyond != "repeat" and law.lasts(WHOLE_TURN):
        cam = dataclasses.replace(cam, law=law.repeated())
    _check(cam)
    if isinstance(law, SplineMotion) and (doubt := unsupported_derivative(law.errors, CURVED)):
        warn_caller(SampleWarning(unsupported_words("law", *doubt, law)))
    return cam


def _check(cam: PlateCam) -> None:
    """Raise an error if the law does not close, or takes the follower where it cannot be."""
    if isinstance(cam.law, SplineMotion) and cam.law.beyond == "repeat":
        period = float(cam.law.stop) - float(np.asarray(cam.law.breakpoints)[0])
        if abs(WHOLE_TURN / period - round(WHOLE_TURN / period)) > CLOSED * WHOLE_TURN / period:
            message = f"has a period of {period:.9g} rad, which does not go into a turn of the cam"
            if 360.0 % period == 0:
                message += "; if that is in degrees, head the column of the angles 'angle [deg]'"
            raise TrajectoryError(message, name="law")
    follower, start = cam.follower, cam.follower.start(cam.base_radius)
    lift = np.asarray(cam.law(Jet([cam.angle])).coefficients[0])
    if not np.isfinite(lift).all():
        where = float(cam.angle[int(np.argmin(np.isfinite(lift)))])
        raise TrajectoryError("has no finite value at this cam angle, rad", name="law", value=where)
    gap = float(lift[-1] - lift[0])
    if abs(gap) > CLOSED * max(float(np.ptp(lift)), 1e-3 * cam.base_radius):
        message = f"does not close: after a turn of the cam the lift is {gap:.6g} from where it began"
        raise TrajectoryError(message, name="law", value=float(lift[-1]))
    coordinate = start + lift
    low, high = (0.0, np.pi / 2 if follower.is_flat else np.pi) if follower.turning else (0.0, np.inf)
    outside = ~((coordinate > low) & (coordinate < high))
    if outside.any():
        where = int(np.argmax(outside))
        message = f"takes the follower through the axis of the cam, or out of reach, at {cam.angle[where]:.6g} rad"
        raise MechanismError(message, name="law", value=float(lift[where]))


def _geometry(cam: PlateCam, angles: Numbers1) -> Geometry:
    """Return the geometry of a cam at cam angles, from jets by the cam angle in the frame of the cam."""
    follower, sense = cam.follower, SIGNS[cam.sense]
    theta = Jet.variable(angles, ORDER)
    lift = cam.law(theta)
    coordinate = lift + follower.start(cam.base_radius)
    frame_angle = theta * -sense  # in the frame of the cam, the follower rotates the other way
    if follower.is_flat:
        direction, distance = follower.face(coordinate)
        normal = unit(direction + frame_angle)
        direction_rate = (direction + frame_angle).differentiate()
        pitch = profile = normal * distance + perpendicular(normal) * (distance.differentiate() / direction_rate)
        tangent = perpendicular(normal) * -sense
    else:
        pitch = rotated(follower.center(coordinate), frame_angle)
        tangent = pitch.differentiate()
        tangent = tangent / sqrt(_dot(tangent, tangent))
        normal = perpendicular(tangent) * sense  # away from the cam
        profile = pitch - normal * follower.radius
    forward, around = (_dot(tangent, curve.differentiate()) for curve in (profile, pitch))
    turned = _dot(tangent, normal.differentiate())
    center = rotated(pitch, -frame_angle)
    travel = rotated(follower.travel(coordinate, center), frame_angle)
    pressure = atan2((travel[0] * normal[1] - travel[1] * normal[0]) * sense, _dot(travel, normal))
    contact = follower.along_face(coordinate, center) if follower.is_flat else lift * 0.0
    jets = (lift, pitch, profile, pressure, forward, around, turned, contact)
    return Geometry(*(np.asarray(jet.coefficients[0]) for jet in jets))


def _dot(a: Jet, b: Jet) -> Jet:
    return a[0] * b[0] + a[1] * b[1]
