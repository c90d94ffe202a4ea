"""Whole turns of angles about axes in space, counted along the motions of many designs at once."""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.jet.turns import principal
from jounce.kinematics.path_following import PLACES, blended_attitudes
from jounce.mechanism.axis_angles import LARGEST_CHANGE, raw_angles
from jounce.mechanism.system import Group


class CountedAngles(NamedTuple):
    """Angles along the motions of designs, with the turns made.

    Attributes
    ----------
    owner : array of int, shape (places,)
        The design of each place, in rising order.
    instant : array of shape (places,)
        s, in rising order within a design.
    angle : array of shape (instances, places)
        rad.
    doubtful : array of bool, shape (designs,)
        Where an angle changes too fast from place to place to tell its turns.
    """

    owner: Int[np.ndarray, " place"]
    instant: Float[np.ndarray, " place"]
    angle: Float[np.ndarray, "instance place"]
    doubtful: Bool[np.ndarray, " design"]


def counted_angles(
    group: Group,
    owners: Int[np.ndarray, " anchor"],
    at: Float[np.ndarray, " anchor"],
    quaternion: Float[np.ndarray, "order 4 bodies anchor"],
    count: int,
) -> CountedAngles:
    """Count the angles that a group measures along the anchors of designs.

    Parameters
    ----------
    group : Group
        With a lane for each anchor.
    owners, at : array of shape (anchors,)
        The designs of the anchors, in rising order, and their instants, s.
    quaternion : array of shape (order + 1, 4, bodies, anchors)
        Taylor coefficients of the attitudes of all bodies.
    count : int
        Number of designs.
    """
    here = np.arange(len(owners))
    ends = np.append(owners[1:] != owners[:-1], True)
    following = np.where(ends, here, here + 1)
    raw: Any = []
    for share in np.arange(PLACES) / PLACES:
        instants = at + share * (at[following] - at)
        attitudes = blended_attitudes(at, quaternion, (here, following), instants)
        raw.append(raw_angles([group], {"quaternion": attitudes})[0])
    raw = np.stack(raw, axis=-1).reshape(group.instances, -1)
    owner = np.repeat(owners, PLACES)
    instant = (at[:, None] + np.arange(PLACES) / PLACES * (at[following] - at)[:, None]).ravel()
    begins = np.append(True, owner[1:] != owner[:-1])
    rise = np.where(begins[1:], 0.0, principal(np.diff(raw)))
    doubtful = np.zeros(count, bool)
    doubtful[owner[1:][(np.abs(rise) > LARGEST_CHANGE).any(axis=0)]] = True
    known = np.repeat(np.broadcast_to(group.element.datum.near, (group.instances, len(owners))), PLACES, axis=1)
    counted = np.cumsum(np.concatenate([np.zeros((group.instances, 1)), rise], axis=1), axis=1)
    first = np.flatnonzero(begins)[np.cumsum(begins) - 1]  # the place where the motion of each design begins
    angle = known[:, first] + principal(raw[:, first] - known[:, first]) + counted - counted[:, first]
    return CountedAngles(owner, instant, angle, doubtful)
