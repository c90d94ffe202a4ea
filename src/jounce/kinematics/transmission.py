"""Recognition of planar four-bars and slider-cranks: Grashof type and range of the transmission angle."""

import dataclasses
import math
from typing import NamedTuple

import numpy as np

from jounce.constraints.drivers import CoordinateDriver
from jounce.constraints.facts import facts_of
from jounce.jet.turns import WHOLE_TURN, shifted_by_turns
from jounce.mechanism import Mechanism, build
from jounce.mechanism.mechanism import GROUND
from jounce.mechanism.system import Group

EQUAL = 1e-9  # relative to the sum of lengths: a linkage at the boundary between two types


@dataclasses.dataclass(frozen=True)
class FourBar:
    """A planar four-bar driven at a link on the ground.

    Attributes
    ----------
    crank, coupler, output, ground : float
        Link lengths, m.
    offset : float
        Driver value at which the crank points from its ground hinge to the other ground hinge, rad.
    """

    crank: float
    coupler: float
    output: float
    ground: float
    offset: float

    @property
    def type(self) -> str:
        """Grashof type of the linkage (Grashof 1883)."""
        links = {"ground": self.ground, "crank": self.crank, "coupler": self.coupler, "output": self.output}
        ordered = sorted(links.values())
        excess = ordered[0] + ordered[3] - ordered[1] - ordered[2]
        if abs(excess) <= EQUAL * sum(ordered):
            return "change-point four-bar: shortest and longest link are together as long as the others"
        if excess > 0:
            return "triple-rocker (not Grashof): no link turns all the way round"
        shortest = min(links, key=lambda name: links[name])
        return {
            "ground": "double-crank (Grashof)",
            "crank": "crank-rocker (Grashof)",
            "coupler": "double-rocker (Grashof): the coupler turns all the way round",
            "output": "rocker-crank (Grashof): driven at the rocker",
        }[shortest]

    def transmission(self, value: float) -> float:
        """Return the acute angle between coupler and output link at a driver value, rad."""
        a, b, c, d = self.crank, self.coupler, self.output, self.ground
        square = a * a + d * d - 2 * a * d * math.cos(value - self.offset)
        cosine = (b * b + c * c - square) / (2 * b * c)
        angle = math.acos(max(-1.0, min(1.0, cosine)))
        return min(angle, math.pi - angle)

    @property
    def turning_values(self) -> tuple[float, ...]:
        """Driver values at which the transmission angle may be extreme, modulo whole turns, rad."""
        a, b, c, d = self.crank, self.coupler, self.output, self.ground
        cosine = (a * a + d * d - b * b - c * c) / (2 * a * d)  # where the angle is a right one
        square = [math.acos(cosine), -math.acos(cosine)] if abs(cosine) <= 1 else []
        return tuple(self.offset + x for x in (0.0, math.pi, *square))


@dataclasses.dataclass(frozen=True)
class SliderCrank:
    """A planar slider-crank driven at its crank.

    Attributes
    ----------
    crank, rod : float
        Distances between hinges, m.
    eccentricity : float
        Offset of the slider's hinge line from the crank's hinge, positive to the left of the guide direction, m.
    offset : float
        Driver value at which the crank points along the guide, rad.
    """

    crank: float
    rod: float
    eccentricity: float
    offset: float

    @property
    def type(self) -> str:
        """Type of the linkage: whether the crank can turn all the way round."""
        gap = self.rod - self.crank - abs(self.eccentricity)
        if abs(gap) <= EQUAL * (self.rod + self.crank):
            return "change-point slider-crank: the rod is as long as crank and eccentricity together"
        return "slider-crank" if gap > 0 else "slider-crank whose crank only rocks"

    def transmission(self, value: float) -> float:
        """Return the angle between the rod and the normal of the guide at a driver value, rad."""
        sine = (self.crank * math.sin(value - self.offset) - self.eccentricity) / self.rod
        return math.acos(min(1.0, abs(sine)))

    @property
    def turning_values(self) -> tuple[float, ...]:
        """Driver values at which the transmission angle may be extreme, modulo whole turns, rad."""
        level = self.eccentricity / self.crank
        flat = [math.asin(level), math.pi - math.asin(level)] if abs(level) <= 1 else []
        return tuple(self.offset + x for x in (math.pi / 2, -math.pi / 2, *flat))


Linkage = FourBar | SliderCrank


def extremes(linkage: Linkage, low: float, high: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the smallest and the largest transmission angle over a range, each with its driver value, rad.

    An infinite range stands for a whole turn.
    """
    is_unlimited = not (math.isfinite(low) and math.isfinite(high))
    if is_unlimited:
        low, high = linkage.offset - math.pi, linkage.offset + math.pi
    values = [low, high]
    for value in linkage.turning_values:
        values += list(np.arange(shifted_by_turns(value, low + math.pi), high, WHOLE_TURN))
    angles = [(linkage.transmission(value), value) for value in values]
    return min(angles), max(angles)


def recognized(mechanism: Mechanism, driver: str) -> Linkage | None:
    """Return the linkage of a mechanism whose driver is the angle of a link on the ground, or None."""
    law = {**mechanism.initial, **mechanism.drivers}.get(driver)
    if mechanism.space != "planar" or not isinstance(law, CoordinateDriver) or law.coordinate != "angle":
        return None
    if law.bodies[0] != GROUND or law.offset not in (0, 0.0):
        return None
    loop = _loop(_joints(mechanism), law.bodies[1])
    if loop is None:
        return None
    return _four_bar(loop) if loop[-1][2].guide is None else _slider_crank(loop)


class _Joint(NamedTuple):
    """A hinge, or a guide, between two bodies.

    Attributes
    ----------
    bodies : tuple of str
    points : tuple of array
        Position of the joint in the frame of each body.
    guide : array, optional
        Direction on the first body along which the second slides.
    """

    bodies: tuple[str, str]
    points: tuple[np.ndarray, np.ndarray]
    guide: np.ndarray | None = None

    def on(self, body: str) -> np.ndarray:
        """Return the position of the joint in the frame of a body."""
        return self.points[self.bodies.index(body)]


_Link = tuple[str, _Joint, _Joint]
"""A body, the joint through which the loop enters it, and the joint through which it leaves."""


def _joints(mechanism: Mechanism) -> list[_Joint]:
    """Return the hinges and guides, a massless rod as a body with two hinges; empty if there are other joints."""
    names = [GROUND, *mechanism.bodies]
    joints: list[_Joint] = []
    for group in build(mechanism).system.groups:
        if group.is_driver:
            continue
        pair = facts_of(type(group.element)).pair
        if pair not in ("revolute", "rod", "prismatic"):
            return []
        for k in range(group.instances):
            first, second = (names[slot[k]] for slot in group.bodies[:2])
            points = _value(group, "point_i", k), _value(group, "point_j", k)
            if pair == "rod":
                rod, length = f"rod {len(joints)}", float(_value(group, "length", k))
                joints.append(_Joint((first, rod), (points[0], np.zeros(2))))
                joints.append(_Joint((rod, second), (np.array([length, 0.0]), points[1])))
            else:
                guide = _value(group, "vector_i", k) if pair == "prismatic" else None
                joints.append(_Joint((first, second), points, guide))
    return joints


def _value(group: Group, name: str, instance: int) -> np.ndarray:
    value = np.asarray(getattr(group.element, name))[..., 0]
    return value[..., min(instance, value.shape[-1] - 1)]


def _loop(joints: list[_Joint], crank: str) -> list[_Link] | None:
    """Return the three links of the loop in order from the crank; None unless only the last joint is a guide."""
    first = [joint for joint in joints if set(joint.bodies) == {GROUND, crank}]
    if len(joints) != 4 or len(first) != 1:
        return None
    links: list[_Link] = []
    body, joint = crank, first[0]
    while body != GROUND and len(links) < 3 and joint.guide is None:
        neighbors = [other for other in joints if body in other.bodies and other is not joint]
        if len(neighbors) != 1:
            return None
        links.append((body, joint, neighbors[0]))
        joint = neighbors[0]
        body = joint.bodies[1 - joint.bodies.index(body)]
    return links if body == GROUND and len(links) == 3 else None


def _four_bar(loop: list[_Link]) -> FourBar | None:
    arms = [after.on(body) - before.on(body) for body, before, after in loop]
    ground = loop[-1][2].on(GROUND) - loop[0][1].on(GROUND)
    crank, coupler, output, base = (float(np.linalg.norm(x)) for x in (*arms, ground))
    offset = math.atan2(ground[1], ground[0]) - math.atan2(arms[0][1], arms[0][0])
    return FourBar(crank, coupler, output, base, offset) if min(crank, coupler, output, base) > 0 else None


def _slider_crank(loop: list[_Link]) -> SliderCrank | None:
    """Return a slider-crank whose guide is on the ground."""
    (crank, first, crank_pin), (rod, _, closing), (slider, _, guide) = loop
    if guide.guide is None or guide.bodies[0] != GROUND:
        return None
    if np.max(np.abs(closing.on(slider) - guide.on(slider))) > 0:
        return None  # a hinge off the guide line: its distance depends on the orientation of the slider
    arm, length = crank_pin.on(crank) - first.on(crank), float(np.linalg.norm(closing.on(rod) - crank_pin.on(rod)))
    direction = guide.guide / np.linalg.norm(guide.guide)
    normal = np.array([-direction[1], direction[0]])
    eccentricity = float(normal @ (guide.on(GROUND) - first.on(GROUND)))
    offset = math.atan2(direction[1], direction[0]) - math.atan2(arm[1], arm[0])
    return SliderCrank(float(np.linalg.norm(arm)), length, eccentricity, offset)
