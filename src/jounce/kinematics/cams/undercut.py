"""Undercut: the follower, as the cutter, removes parts of the profile, and touches the rest."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float

from jounce.jet.turns import WHOLE_TURN
from jounce.kinematics.cams.followers import AbstractFollower
from jounce.kinematics.cams.results import Geometry, Numbers1, Undercut

LOST = 1e-9  # of the size of the cam: smaller losses of lift are rounding
FINEST = 3601  # least number of points of an undercut profile
CHUNK = 200  # positions of the follower that are compared with all points at once


def followed_lift(
    follower: AbstractFollower,
    base_radius: float,
    sense: float,
    angle: Numbers1,
    table: Geometry,
    geometry_at: Callable[[Numbers1], Geometry],
) -> Numbers1:
    """Return the lift at which a follower touches the rest of a profile that it has cut, m or rad.

    Points of the profile inside the follower at any cam angle are cut away.

    Parameters
    ----------
    follower : AbstractFollower
    base_radius : float
        Base radius, m.
    sense : float
        Sense of rotation of the cam, 1.0 or -1.0.
    angle : array of shape (angle,)
        Cam angles, rad.
    table : Geometry
        The cam at these angles.
    geometry_at : callable
        Returns the cam at other angles.
    """
    start, size = follower.start(base_radius), 1.0 if follower.turning else base_radius

    def touching(
        points: Float[np.ndarray, "2 point"], turns: Float[np.ndarray, " turn"]
    ) -> Float[np.ndarray, "turn point"]:
        """Return the coordinate at which the follower touches each point of the cam, for each rotation of the cam."""
        c, s = np.cos(turns)[:, None], np.sin(turns)[:, None]
        x, y = points
        rotated = np.stack([c * x - s * y, s * x + c * y]).reshape(2, -1)
        return follower.touching(rotated).reshape(len(turns), -1)

    def remaining_points(angle: Numbers1, geometry: Geometry) -> Float[np.ndarray, "2 left"]:
        """Return the points of a profile that are outside of the follower at all cam angles."""
        cut = np.zeros(len(angle), bool)
        for rows in _chunks(len(angle)):
            coordinates = touching(geometry.profile, sense * angle[rows])
            cut |= np.any(coordinates > (start + geometry.lift[rows] + LOST * size)[:, None], axis=0)
        return geometry.profile[:, ~cut]

    if not (follower.is_flat or follower.radius):
        return table.lift  # a knife edge follows any profile that it has cut
    points = remaining_points(angle, table)
    if points.shape[1] < len(angle) < FINEST:  # the spacing of points limits the accuracy of crossing branches
        finer = np.linspace(0.0, WHOLE_TURN, FINEST)
        points = remaining_points(finer, geometry_at(finer))
    lift = np.full(len(angle), -np.inf)
    if points.shape[1]:
        for rows in _chunks(len(angle)):
            lift[rows] = touching(points, sense * angle[rows]).max(axis=1) - start
    return np.where(np.abs(lift - table.lift) <= 1e-12 * size, table.lift, lift)


def _chunks(count: int) -> list[slice]:
    return [slice(first, first + CHUNK) for first in range(0, count, CHUNK)]


def runs(angle: Numbers1, lost_lift: Numbers1, is_lost: Bool[np.ndarray, " angle"]) -> list[Undercut]:
    """Return the parts of a turn in which lift is lost; a part through zero is one."""
    intervals, marks = [], is_lost[:-1]  # the last angle equals the first
    if marks.all():
        worst = int(np.argmax(lost_lift))
        return [Undercut(0.0, WHOLE_TURN, float(angle[worst]), float(lost_lift[worst]))]
    first = int(np.argmin(marks))  # start where nothing is lost
    order = np.roll(np.arange(len(marks)), -first)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], marks[order].astype(int), [0]])))
    for low, high in zip(edges[::2], edges[1::2], strict=True):
        inside = order[low:high]
        worst = inside[int(np.argmax(lost_lift[inside]))]
        start, stop, peak = (float(angle[k]) for k in (inside[0], inside[-1], worst))
        intervals.append(Undercut(start, stop, peak, float(lost_lift[worst])))
    return intervals
