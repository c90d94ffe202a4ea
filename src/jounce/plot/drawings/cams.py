"""Disc and follower of a plate cam, as drawn."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.constraints import Cam
from jounce.mechanism import Mechanism
from jounce.mechanism.mechanism import GROUND
from jounce.mechanism.resolve import resolve

Point = Float[np.ndarray, " component"]


def cam_disc(mechanism: Mechanism, joint: Any) -> tuple[tuple[str, str], tuple[Point, Point]] | None:
    """Return the bodies of a plate cam and of its follower, and a point of each in its frame, m.

    The point of the disc is its origin; the point of the follower traces the pitch curve on the disc.

    Parameters
    ----------
    mechanism : Mechanism
    joint : Joint

    Returns
    -------
    tuple of two tuples, or None
        None for other joints, and if the points are unknown: for turning followers, in space, and for leaders that do
        not turn.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot.drawings.cams import cam_disc
    >>> engine = jn.load("examples/camshaft.yaml")
    >>> bodies, points = cam_disc(engine, engine.joints["cam"])
    >>> bodies
    ('shaft', 'follower')
    """
    if mechanism.space != "planar" or not isinstance(joint, Cam):
        return None
    follower, leader = joint.follower, joint.leader
    turns, rocks = (getattr(part, "coordinate", None) == "angle" for part in (leader, follower))
    disc, follower_body = leader.bodies[-1], follower.bodies[-1]
    if not turns or rocks or GROUND in (disc, follower_body) or disc == follower_body:
        return None
    point = getattr(follower, "point_j", None)
    place = np.zeros(2) if point is None else np.asarray(resolve(point, mechanism.parameter_values), float)
    return (disc, follower_body), (np.zeros(2), place)


def pitch_curve(
    visited: Float[np.ndarray, "time components"],
) -> tuple[Float[np.ndarray, "point components"], bool]:
    """Return the points on a disc that a follower visits in a motion, and whether they form a closed curve.

    Parameters
    ----------
    visited : array of shape (time, 2)
        Positions of the point of the follower in the frame of the disc, m; NaN where the motion failed.

    Examples
    --------
    >>> import numpy as np
    >>> from jounce.plot.drawings.cams import pitch_curve
    >>> angle = np.linspace(0, 2 * np.pi, 73)
    >>> pitch_curve(np.stack([np.cos(angle), np.sin(angle)], axis=1))[1]
    True
    """
    points = visited[np.isfinite(visited).all(axis=1)]
    if len(points) < 3:
        return points, False
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return points, bool(np.linalg.norm(points[-1] - points[0]) <= 2 * steps.max())
