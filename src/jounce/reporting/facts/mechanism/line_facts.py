"""Lengths and courses of belts and ropes in the assembled position."""

from itertools import pairwise
from typing import Any

import numpy as np
from typing_extensions import TypedDict

from jounce.constraints import Rope
from jounce.constraints.planar import Belt
from jounce.mechanism.building.belts import belt_course, centers_of
from jounce.mechanism.building.builder import named_groups
from jounce.mechanism.building.starting_guess import pose_at
from jounce.mechanism.mechanism import GROUND
from jounce.reporting.facts.mechanism.freedom_facts import StartingState


class LineFacts(TypedDict):
    """A belt or a rope: its length, m; for a belt, the wrap angles of both pulleys, rad, and the body that carries
    them, if any; for a rope, the distances between successive points, m.
    """

    joint: str
    bodies: list[str]
    length: float
    wraps: list[float] | None
    carrier: str | None
    spans: list[float] | None


def line_facts(state: StartingState) -> list[dict[str, Any]]:
    """Return the belts and ropes of a mechanism as assembled: LineFacts; none if it cannot be assembled.

    Parameters
    ----------
    state : StartingState
        Start of the mechanism.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.mechanism import build
    >>> drive = jn.load("examples/belt_drive.yaml")
    >>> (belt,) = line_facts(StartingState(drive, build(drive), 0.0))
    >>> belt["carrier"], round(belt["length"], 6)
    ('arm', 0.850724)
    """
    records: list[dict[str, Any]] = []
    if state.coordinates is None:
        return records
    coordinates = {name: np.asarray(value)[None] for name, value in state.coordinates.items()}
    names = [GROUND, *state.mechanism.bodies]
    for group, members in named_groups(state.model):
        for k, row in enumerate(members):
            name = row.partition(".")[2]
            if isinstance(group.element, Belt):
                facts = _belt(group, k, coordinates)
                facts["carrier"] = names[group.bodies[2][k]] if len(group.bodies) > 2 else None
            elif isinstance(group.element, Rope):
                facts = _rope(group, k, state)
            else:
                continue
            records.append({"joint": name, "bodies": list(state.mechanism.joints[name].bodies), **facts})
    return records


def _belt(group: Any, k: int, coordinates: Any) -> dict[str, Any]:
    belt = group.element
    ends = zip(group.bodies, (belt.point_i, belt.point_j), strict=False)
    first, second = (centers_of(coordinates, slot, point)[:, k, 0] for slot, point in ends)
    radii = [float(np.asarray(radius)[k, 0]) for radius in (belt.radius_i, belt.radius_j)]
    course = belt_course(first, second, radii, belt.crossed)
    return {"length": float(course.length), "wraps": [float(x) for x in course.wraps], "spans": None}


def _rope(group: Any, k: int, state: StartingState) -> dict[str, Any]:
    rope, pose = group.element, pose_at(state.coordinates or {}, state.model.pose_type)
    slots = rope.slots or tuple(range(len(rope.points)))
    points = [
        np.asarray(pose.take((group.bodies[slot][k],)).point(point[..., k : k + 1, :]).coefficients[0])[:, 0, 0]
        for slot, point in zip(slots, rope.points, strict=True)
    ]
    spans = [float(np.linalg.norm(b - a)) for a, b in pairwise(points)]
    return {"length": float(np.asarray(rope.length)[k, 0]), "wraps": None, "carrier": None, "spans": spans}
