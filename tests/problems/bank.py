"""Every joint and driver in all its variants, of which there are random instances."""

import dataclasses

import numpy as np

import jounce as jn
from jounce.constraints import base
from jounce.constraints.base import value_fields
from jounce.testing.samples import Samples
from tests.problems.own_types import taken_back


def users_own_joint():
    """Return a joint as a user writes it: registered by a type of its own, then taken out of the registry again."""
    with taken_back():

        class PointOnParabola(jn.joints.AbstractConstraint, type="point_on_parabola", space="planar", role="joint"):
            point_j: jn.joints.Vector
            curvature: jn.joints.Scalar

            def residual(self, body_i, body_j, time):
                d = body_j.point(self.point_j) - body_i.position
                x, y = (
                    body_i.direction(np.array([1.0, 0.0])[:, None, None]),
                    body_i.direction(np.array([0.0, 1.0])[:, None, None]),
                )
                return y.dot(d) - self.curvature * x.dot(d) ** 2

        return base.catalogue("planar", "joint")["point_on_parabola"]


OWN = users_own_joint()


TEETH = {"point_i": [0.3, -0.2], "point_j": [0.1, 0.4], "pressure_angle": 0.35}
GEARS = {
    "ratio": {"ratio": -0.7},
    "teeth": TEETH | {"radius_i": 0.8, "radius_j": 1.3},
    "ring": TEETH | {"radius_i": 0.7, "radius_j": -1.4},
}


BELTS = {word: {"radius_i": 0.8, "radius_j": 1.3, "crossed": word == "crossed"} for word in ("open", "crossed")}


@dataclasses.dataclass(frozen=True)
class Case:
    """A class of the catalogue, with or without its optional values, and its word where it takes one."""

    kind: type
    space: str
    optional: bool = False
    word: str = ""

    def __str__(self):
        extra = "-".join(x for x in (self.word, "all" if self.optional else "") if x)
        return f"{self.space}-{self.kind.role}-{self.kind.type_name}" + (f"-{extra}" if extra else "")

    def element(self, random, bodies=None, values=None):
        """Return a random instance; `values` replaces some of its values."""
        samples = Samples(self.kind, self.space, self.given, self.optional, self.joined)
        return samples.element(random, bodies or (), values)

    @property
    def joined(self):
        """How many bodies it is between, where that is not told by its class."""
        return 3 if self.kind is jn.joints.Rope else {"teeth": 2, "ring": 2, "ratio": 3}.get(self.word)

    @property
    def period(self):
        """Of its last row, where that is known up to whole periods: a number, or the field that has it."""
        if self.word in ("teeth", "ring"):
            return 2 * np.pi * (1 + self.given["radius_i"] / self.given["radius_j"])
        if self.word in BELTS:
            return 2 * np.pi * (1 + (0.8 if self.word == "crossed" else -0.8) / 1.3)
        return {"screw": "lead", "constant_velocity": 2 * np.pi}.get(self.kind.type_name)

    @property
    def given(self):
        """The values that are not random: its word, or what makes gears and belts of one form."""
        if self.word in BELTS:
            return BELTS[self.word]
        if self.word in GEARS:
            return GEARS[self.word]
        return {"coordinate": self.word} if self.word else {}


def cases():
    """Return every class of the catalogue, in all variants, and a user's own."""
    found = []
    for space in ("planar", "spatial"):
        kinds = [k for role in ("joint", "driver") for k in base.catalogue(space, role).values()]
        kinds = [k for k in kinds if not k.__module__.startswith("jounce.robot")]  # judged with the robots they hold
        kinds = [k for k in kinds if not k.nonholonomic]  # their rows are no functions of places: test_wheels.py
        for kind in [*kinds, *([OWN] if space == "planar" else [])]:
            fields = value_fields(kind)
            extras = {n for n, f in fields.items() if f.default is None and n != "offset"}
            variants = [(False, ""), (True, "")] if extras else [(False, "")]
            if "coordinate" in fields:
                variants = [(False, "angle"), (True, "angle"), (False, "x"), (True, "y")]
            if kind is jn.planar.Gear:
                variants = [(False, word) for word in GEARS]
            if kind is jn.planar.Belt:
                variants = [(False, word) for word in BELTS]
            found += [Case(kind, space, *variant) for variant in variants]
    return found
