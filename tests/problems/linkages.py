"""Families of random linkages with one degree of freedom, many of them close to a change point or a dead point.

Each family knows its mechanism in jounce, compiled once, and on the other hand the quadratic loop equations that
`tests.oracles.linkage_paths` follows, and how the points that both have in common are the unknowns of these.
"""

import abc
import dataclasses
from functools import cached_property

import numpy as np

import jounce as jn
from jounce import drivers, planar
from tests.oracles.linkage_paths import Affine, Law

NEAREST = 1e-6  # by what a linkage near a singular position misses it at least, over a length
LAW = "start + rate*t + wave*sin(speed*t + phase)"
LAW_PARAMETERS = dict.fromkeys(Law._fields, 0.0)


@dataclasses.dataclass(frozen=True)
class Linkage:
    """One random linkage: its dimensions, its law, and the position that its starting guess is near."""

    family: "Family"
    values: dict[str, float]
    law: Law
    start: np.ndarray  # unknowns
    guess: dict[str, float]
    nearness: float | None  # drawn: h over a length where it was placed near a singular position, else None

    @cached_property
    def form(self):
        """The loop equations, shape (unknowns, size, size)."""
        return np.stack(self.family.forms(self.values))

    @cached_property
    def tracked_form(self):
        """Those of the unknowns that are followed."""
        tracked, count = self.family.tracked or len(self.form), len(self.form)
        kept = [*range(tracked), *range(count, count + 3)]
        return self.form[:tracked][:, kept][:, :, kept]

    @property
    def mechanism(self):
        """The mechanism for jounce."""
        return self.family.mechanism.with_parameters(**self.values, **self.guess, **self.law._asdict())


class Family(abc.ABC):
    """Linkages of one structure."""

    name: str
    circular = True  # whether an angle is driven, or a distance
    dimensions: tuple[str, ...]
    guessed: tuple[str, ...]
    tracked: int | None = None  # the first unknowns if they have equations of their own, linear in the others

    @cached_property
    def mechanism(self):
        """The mechanism with nothing but zeros and ones for its parameters."""
        parameters = LAW_PARAMETERS | dict.fromkeys(self.dimensions, 1.0) | dict.fromkeys(self.guessed, 0.0)
        return self.build(parameters)

    @abc.abstractmethod
    def build(self, parameters):
        """Return the mechanism."""

    @abc.abstractmethod
    def forms(self, values):
        """Return the loop equations."""

    @abc.abstractmethod
    def draw(self, random, nearness, sign):
        """Return dimensions; with a nearness, such that the linkage misses (sign 1) or fails to pass a singular
        position by about it.
        """

    @abc.abstractmethod
    def guess(self, values, value, x):
        """Return the starting guess of the poses at a driven value."""

    @abc.abstractmethod
    def unknowns(self, outputs, values):
        """Return the unknowns with their derivatives, shape (time, derivative, unknowns), from outputs of jounce."""

    @abc.abstractmethod
    def assembly(self, values, value, random):
        """Return one of the assemblies at a driven value, at random, or None."""

    def law(self, random, values, nearness, sign):
        """Return a law, uniform or waving, and the time to stop at."""
        speed, turns = 10 ** random.uniform(-0.5, 1.5), random.uniform(0.3, 2.0)
        stop, start = turns * 2 * np.pi / speed, random.uniform(-np.pi, np.pi)
        if random.random() < 0.8:
            return Law(start, random.choice([-1, 1]) * speed, 0.0, 0.0, 0.0), stop
        return Law(start, 0.0, random.uniform(0.3, 3.0), speed, random.uniform(-np.pi, np.pi)), stop

    def linkage(self, random, near, nearest=NEAREST):
        """Return a random linkage, near a singular position if wanted, and the time at which its motion stops."""
        while True:
            nearness = 10 ** random.uniform(np.log10(nearest), -1) if near else None
            sign = random.choice([-1, 1])
            values = self.draw(random, nearness, sign)
            if values is None:
                continue
            law, stop = self.law(random, values, nearness, sign)
            start = self.assembly(values, np.asarray(law(0.0)), random)
            most = not near and random.random() < 0.75  # else, of those drawn at random, most would end on the way
            if start is not None and not (most and self.ends(values, law, stop, random)):
                return Linkage(self, values, law, start, self.near_guess(random, values, law, start), nearness), stop

    def ends(self, values, law, stop, random):
        """Tell whether there is no assembly at some of the instants."""
        return any(self.assembly(values, law(t), random) is None for t in np.linspace(0, stop, 25))

    def near_guess(self, random, values, law, start):
        """Return a guess that is off by something."""
        off = 10 ** random.uniform(-6, -2)
        guess = self.guess(values, float(law(0.0)), start)
        return {name: float(v + off * random.normal()) for name, v in zip(self.guessed, guess, strict=True)}


def angle_of(vector):
    """Return the angle of a plane vector."""
    return np.arctan2(vector[1], vector[0])


def direction(angle):
    """Return a unit vector in the plane."""
    return np.array([np.cos(angle), np.sin(angle)])


def lengths(random, count):
    """Return random lengths, some similar and some not, in m."""
    return 10 ** random.uniform(-0.5, 0.5, size=count)


class SliderCrank(Family):
    """Crank of length a at the origin, rod of length b, slider on the line y = e; the crank is driven."""

    name = "slider-crank"
    dimensions = ("a", "b", "e")
    guessed = ("crank", "rod", "x")

    def build(self, parameters):
        return jn.Mechanism(
            space="planar",
            parameters=parameters,
            bodies={
                "crank": jn.Body([0, 0], "crank"),
                "rod": jn.Body(["a*cos(crank)", "a*sin(crank)"], "rod"),
                "slider": jn.Body(["x", "e"]),
            },
            joints={
                "O": planar.Revolute(("ground", "crank"), [0, 0], [0, 0]),
                "A": planar.Revolute(("crank", "rod"), ["a", 0], [0, 0]),
                "B": planar.Revolute(("rod", "slider"), ["b", 0], [0, 0]),
                "guide": planar.Prismatic(("ground", "slider"), [0, "e"], [0, 0], [1, 0], [1, 0]),
            },
            drivers={"drive": self.driver()},
            outputs={"A": jn.outputs.PointOutput("crank", ["a", 0]), "B": jn.outputs.PointOutput("slider", [0, 0])},
        )

    def driver(self):
        """Return the driver."""
        return drivers.CoordinateDriver(("ground", "crank"), "angle", LAW)

    def forms(self, values):
        space = Affine(1)
        b = space.unknown(0)[:1]
        b = np.concatenate([b, space.fixed(0.0, values["e"])[1:]])
        return [space.distance(b, values["a"] * space.input(), values["b"])]

    def draw(self, random, nearness, sign):
        a, b = lengths(random, 2)
        e = random.choice([-1, 1]) * random.uniform(0, 0.9) * b
        if nearness:
            e = random.choice([-1, 1]) * (a - b * np.sqrt(1 - sign * nearness**2))
        return {"a": a, "b": b, "e": e}

    def assembly(self, values, value, random):
        under = values["b"] ** 2 - (values["a"] * np.sin(value) - values["e"]) ** 2
        return (
            None if under < 1e-16 else np.array([values["a"] * np.cos(value) + random.choice([-1, 1]) * np.sqrt(under)])
        )

    def guess(self, values, value, x):
        tip = values["a"] * direction(value)
        return value, angle_of([x[0] - tip[0], values["e"] - tip[1]]), x[0]

    def unknowns(self, outputs, values):
        return outputs["B"][..., :1]


class SliderDriven(SliderCrank):
    """The same, driven at the slider, which turns back before its dead points or runs into them."""

    name = "slider-crank at the slider"
    circular = False

    def driver(self):
        return drivers.SlideDriver(("ground", "slider"), [0, "e"], [0, 0], [1, 0], LAW)

    def forms(self, values):
        space = Affine(2)
        a = space.unknown(0)
        b = space.input((1.0, 0.0), (0.0, 0.0)) + space.fixed(0.0, values["e"])
        return [space.distance(a, space.fixed(0.0, 0.0), values["a"]), space.distance(a, b, values["b"])]

    def draw(self, random, nearness, sign):
        a, b = lengths(random, 2)
        e = random.uniform(-0.9, 0.9) * (a + b)
        return {"a": a, "b": b, "e": 0.3 * e if abs(e) < abs(a - b) + 0.1 else e}

    def law(self, random, values, nearness, sign):
        a, b, e = values["a"], values["b"], values["e"]
        outer = np.sqrt((a + b) ** 2 - e**2)
        inner = np.sqrt((a - b) ** 2 - e**2) if abs(e) < abs(a - b) else -outer
        low, side, speed = 0.5 * (inner + outer), random.choice([-1, 1]), 10 ** random.uniform(-0.5, 1.5)
        middle = random.uniform(low - 0.4 * (outer - low), low + 0.5 * (outer - low))
        wave = (outer - middle) * random.uniform(0.3, 1.1)
        if nearness:
            wave = np.sqrt((a + b) ** 2 - sign * a * b * nearness**2 - e**2) - middle
        law = Law(side * middle, 0.0, side * wave, speed, random.uniform(-np.pi, np.pi))
        return law, random.uniform(0.3, 2.0) * 2 * np.pi / speed

    def assembly(self, values, value, random):
        a, b, e = values["a"], values["b"], values["e"]
        return dyad(np.zeros(2), np.array([float(value), e]), a, b, random.choice([-1, 1]))

    def guess(self, values, value, x):
        return angle_of(x), angle_of([value - x[0], values["e"] - x[1]]), value

    def unknowns(self, outputs, values):
        return outputs["A"]


def dyad(p, q, first, second, side):
    """Return the joint of two links from p and q, to the left (1) or right (-1) of the way from p to q, or None."""
    d = q - p
    square = d @ d
    under = ((first + second) ** 2 - square) * (square - (first - second) ** 2)
    if not under > 1e-16 * square**2:
        return None
    along = (square + first**2 - second**2) / (2 * square)
    return p + along * d + side * np.sqrt(under) / (2 * square) * np.array([-d[1], d[0]])


def four_bar_lengths(random, nearness, sign):
    """Return crank a, rod b, rocker c and ground d; near a change point if wanted, stretched or folded."""
    a, b, c, d = lengths(random, 4)
    if nearness:
        h = sign * nearness**2 * b * c
        if random.random() < 0.5:
            d = np.sqrt((b + c) ** 2 - h) - a
        else:
            d = a + random.choice([-1, 1]) * np.sqrt(max((b - c) ** 2 + h, 0.0))
    return (a, b, c, d) if d > 0.2 else None


class FourBar(Family):
    """Crank a at the origin, ground d along x, rocker c, and a massless rod b."""

    name = "four-bar"
    dimensions = ("a", "b", "c", "d")
    guessed = ("crank", "rocker")

    def build(self, parameters):
        return jn.Mechanism(
            space="planar",
            parameters=parameters,
            bodies={"crank": jn.Body([0, 0], "crank"), "rocker": jn.Body(["d", 0], "rocker")},
            joints={
                "A": planar.Revolute(("ground", "crank"), [0, 0], [0, 0]),
                "D": planar.Revolute(("ground", "rocker"), ["d", 0], [0, 0]),
                "BC": planar.DoubleRevolute(("crank", "rocker"), ["a", 0], ["c", 0], "b"),
            },
            drivers={"drive": drivers.CoordinateDriver(("ground", "crank"), "angle", LAW)},
            outputs={"C": jn.outputs.PointOutput("rocker", ["c", 0])},
        )

    def forms(self, values):
        space = Affine(2)
        c = space.unknown(0)
        return [
            space.distance(c, values["a"] * space.input(), values["b"]),
            space.distance(c, space.fixed(values["d"], 0.0), values["c"]),
        ]

    def draw(self, random, nearness, sign):
        found = four_bar_lengths(random, nearness, sign)
        return found and dict(zip(self.dimensions, found, strict=True))

    def assembly(self, values, value, random):
        tip = values["a"] * direction(value)
        return dyad(tip, np.array([values["d"], 0.0]), values["b"], values["c"], random.choice([-1, 1]))

    def guess(self, values, value, x):
        return value, angle_of([x[0] - values["d"], x[1]])

    def unknowns(self, outputs, values):
        return outputs["C"]
