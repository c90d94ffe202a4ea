"""Planar four-bars and slider-cranks recognized: their type by Grashof, and the transmission angle over a range."""

import dataclasses
import math
from typing import Any

import numpy as np

from jounce.constraints.drivers import CoordinateDriver
from jounce.constraints.facts import facts_of
from jounce.jet.turns import WHOLE_TURN, brought_near
from jounce.mechanism import Mechanism, build
from jounce.mechanism.mechanism import GROUND
from jounce.mechanism.system import Group

EQUAL = 1e-9  # of the sum of lengths: a linkage at the bound of two types


@dataclasses.dataclass(frozen=True)
class FourBar:
    """A planar four-bar driven at a link on the ground.

    Attributes
    ----------
    crank, coupler, output, ground : float
        Distances of its hinges, m.
    offset : float
        Driver's value at which the crank points from its hinge to the other one on the ground, rad.
    """

    crank: float
    coupler: float
    output: float
    ground: float
    offset: float

    @property
    def type(self) -> str:
        """Which links can turn all the way round (Grashof 1883)."""
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
        """Return the angle between coupler and output link at a value of the driver, folded to a right one, rad."""
        a, b, c, d = self.crank, self.coupler, self.output, self.ground
        square = a * a + d * d - 2 * a * d * math.cos(value - self.offset)
        cosine = (b * b + c * c - square) / (2 * b * c)
        return _folded(math.acos(max(-1.0, min(1.0, cosine))))

    @property
    def turning_values(self) -> tuple[float, ...]:
        """Values at which the angle, or its distance from a right one, may be extreme, up to whole turns, rad."""
        a, b, c, d = self.crank, self.coupler, self.output, self.ground
        right = (a * a + d * d - b * b - c * c) / (2 * a * d)  # where the angle is a right one
        square = [math.acos(right), -math.acos(right)] if abs(right) <= 1 else []
        return tuple(self.offset + x for x in (0.0, math.pi, *square))


@dataclasses.dataclass(frozen=True)
class SliderCrank:
    """A planar slider-crank driven at its crank.

    Attributes
    ----------
    crank, rod : float
        Distances of hinges, m.
    eccentricity : float
        Distance of the slider's hinge's line from the crank's hinge, to the left of the way that the guide points, m.
    offset : float
        Driver's value at which the crank points along the guide, rad.
    """

    crank: float
    rod: float
    eccentricity: float
    offset: float

    @property
    def type(self) -> str:
        """Whether the crank can turn all the way round."""
        gap = self.rod - self.crank - abs(self.eccentricity)
        if abs(gap) <= EQUAL * (self.rod + self.crank):
            return "change-point slider-crank: the rod is as long as crank and eccentricity together"
        return "slider-crank" if gap > 0 else "slider-crank whose crank only rocks"

    def transmission(self, value: float) -> float:
        """Return the angle between the rod and the normal of the guide at a value of the driver, rad."""
        sine = (self.crank * math.sin(value - self.offset) - self.eccentricity) / self.rod
        return math.acos(min(1.0, abs(sine)))

    @property
    def turning_values(self) -> tuple[float, ...]:
        """Values at which the angle may be extreme, up to whole turns, rad."""
        level = self.eccentricity / self.crank
        flat = [math.asin(level), math.pi - math.asin(level)] if abs(level) <= 1 else []
        return tuple(self.offset + x for x in (math.pi / 2, -math.pi / 2, *flat))


Linkage = FourBar | SliderCrank


def extremes(linkage: Linkage, low: float, high: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the smallest and the largest transmission angle over a range, each with the driver's value there, rad.

    An infinite range is a whole turn.
    """
    whole = not (math.isfinite(low) and math.isfinite(high))
    if whole:
        low, high = linkage.offset - math.pi, linkage.offset + math.pi
    values = [low, high]
    for value in linkage.turning_values:
        values += list(np.arange(brought_near(value, low + math.pi), high, WHOLE_TURN))
    angles = [(linkage.transmission(value), value) for value in values]
    return min(angles), max(angles)


def recognized(mechanism: Mechanism, driver: str) -> Linkage | None:
    """Return the four-bar or slider-crank that a mechanism is, driven at a link on the ground by its angle, or None."""
    law = {**mechanism.initial, **mechanism.drivers}.get(driver)
    if mechanism.space != "planar" or not isinstance(law, CoordinateDriver) or law.coordinate != "angle":
        return None
    if law.bodies[0] != GROUND or law.offset not in (0, 0.0):
        return None
    hinges, guides = _joints(mechanism)
    crank = law.bodies[1]
    if len(guides) == 0 and len(hinges) == 4:
        loop = _loop(hinges, crank)
        return None if loop is None else _four_bar(loop)
    if len(guides) == 1 and len(hinges) == 3:
        return _slider_crank(hinges, guides[0], crank)
    return None


Hinge = tuple[tuple[str, str], tuple[np.ndarray, np.ndarray]]
"""Two bodies, and the hinge in the frame of each."""


def _joints(mechanism: Mechanism) -> tuple[list[Hinge], list[Any]]:
    """Return the hinges and guides of a mechanism; a massless rod is a body with two hinges. None fits others."""
    names = [GROUND, *mechanism.bodies]
    hinges: list[Hinge] = []
    guides: list[Any] = []
    for group in build(mechanism).system.groups:
        if group.is_driver:
            continue
        pair = facts_of(type(group.element)).pair
        for k in range(group.instances):
            first, second = (names[slot[k]] for slot in group.bodies[:2])
            if pair == "revolute":
                hinges.append(((first, second), (_value(group, "point_i", k), _value(group, "point_j", k))))
            elif pair == "rod":
                rod, length = f"rod {len(hinges)}", float(_value(group, "length", k))
                hinges.append(((first, rod), (_value(group, "point_i", k), np.zeros(2))))
                hinges.append(((rod, second), (np.array([length, 0.0]), _value(group, "point_j", k))))
            elif pair == "prismatic":
                fields = ("point_i", "point_j", "vector_i")
                guides.append(((first, second), *(_value(group, name, k) for name in fields)))
            else:
                return [], []
    return hinges, guides


def _value(group: Group, name: str, instance: int) -> np.ndarray:
    value = np.asarray(getattr(group.element, name))[..., 0]
    return value[..., min(instance, value.shape[-1] - 1)]


def _on(hinge: Hinge, body: str) -> np.ndarray:
    return hinge[1][hinge[0].index(body)]


def _other(hinge: Hinge, body: str) -> str:
    return hinge[0][1 - hinge[0].index(body)]


def _loop(hinges: list[Hinge], crank: str) -> list[tuple[str, Hinge, Hinge]] | None:
    """Return the three links of a loop from the crank on, each with its hinges, in order."""
    first = [h for h in hinges if set(h[0]) == {GROUND, crank}]
    if len(first) != 1:
        return None
    members, body, hinge = [], crank, first[0]
    while body != GROUND and len(members) < 3:
        following = [h for h in hinges if body in h[0] and h is not hinge]
        if len(following) != 1:
            return None
        members.append((body, hinge, following[0]))
        body, hinge = _other(following[0], body), following[0]
    return members if body == GROUND and len(members) == 3 else None


def _four_bar(loop: list[tuple[str, Hinge, Hinge]]) -> FourBar | None:
    arms = [_on(after, body) - _on(before, body) for body, before, after in loop]
    ground = _on(loop[-1][2], GROUND) - _on(loop[0][1], GROUND)
    crank, coupler, output, base = (float(np.linalg.norm(x)) for x in (*arms, ground))
    offset = math.atan2(ground[1], ground[0]) - math.atan2(arms[0][1], arms[0][0])
    return FourBar(crank, coupler, output, base, offset) if min(crank, coupler, output, base) > 0 else None


def _slider_crank(hinges: list[Hinge], guide: Any, crank: str) -> SliderCrank | None:
    """Return a slider-crank whose guide is on the ground."""
    (first, second), point_i, point_j, vector = guide
    slider = second if first == GROUND else ""
    closing = [h for h in hinges if slider and slider in h[0]]
    start_of_curve = [h for h in hinges if set(h[0]) == {GROUND, crank}]
    if len(closing) != 1 or len(start_of_curve) != 1:
        return None
    rod = _other(closing[0], slider)
    between = [h for h in hinges if set(h[0]) == {crank, rod}]
    if len(between) != 1 or rod == GROUND:
        return None
    arm = _on(between[0], crank) - _on(start_of_curve[0], crank)
    length = float(np.linalg.norm(_on(closing[0], rod) - _on(between[0], rod)))
    if np.max(np.abs(_on(closing[0], slider) - point_j)) > 0:
        return None  # a hinge beside the guide's line: its distance depends on how the slider lies
    along = vector / np.linalg.norm(vector)
    normal = np.array([-along[1], along[0]])
    eccentricity = float(normal @ (point_i - _on(start_of_curve[0], GROUND)))
    offset = math.atan2(along[1], along[0]) - math.atan2(arm[1], arm[0])
    return SliderCrank(float(np.linalg.norm(arm)), length, eccentricity, offset)


def _folded(angle: float) -> float:
    return min(angle, math.pi - angle)
