"""Six-bars of Watt and Stephenson: a four-bar with two more links, driven at its crank or elsewhere."""

import abc

import numpy as np
from scipy.optimize import minimize_scalar

import jounce as jn
from jounce import drivers, planar
from tests.oracles.linkage_paths import Affine, Law, follow, turned
from tests.problems.linkages import LAW, NEAREST, Family, Linkage, angle_of, direction, dyad, four_bar_lengths, lengths


class SixBar(Family):
    """A four-bar ABCD, a link of length `l` hinged at Q on one body, a rod of length `r` from its tip to P on another.

    P is on the crank, the coupler or the rocker, Q on the rocker or on the ground: Watt I (coupler, rocker), Watt II
    (rocker, ground), Stephenson I (crank, rocker) and III (coupler, ground). The unknowns are C and the tip R.
    """

    dimensions = ("a", "b", "c", "d", "px", "py", "qx", "qy", "l", "r")
    guessed = ("crank", "coupler", "rocker", "link", "x", "y")
    driven_body = "crank"

    def __init__(self, name, on_p, on_q):
        self.name, self.on_p, self.on_q = name, on_p, on_q

    def build(self, parameters):
        return jn.Mechanism(
            space="planar",
            parameters=parameters,
            bodies={
                "crank": jn.Body([0, 0], "crank"),
                "coupler": jn.Body(["a*cos(crank)", "a*sin(crank)"], "coupler"),
                "rocker": jn.Body(["d", 0], "rocker"),
                "link": jn.Body(["x", "y"], "link"),
            },
            joints={
                "A": planar.Revolute(("ground", "crank"), [0, 0], [0, 0]),
                "B": planar.Revolute(("crank", "coupler"), ["a", 0], [0, 0]),
                "C": planar.Revolute(("coupler", "rocker"), ["b", 0], ["c", 0]),
                "D": planar.Revolute(("ground", "rocker"), ["d", 0], [0, 0]),
                "Q": planar.Revolute((self.on_q, "link"), ["qx", "qy"], [0, 0]),
                "PR": planar.DoubleRevolute((self.on_p, "link"), ["px", "py"], ["l", 0], "r"),
            },
            drivers={"drive": drivers.CoordinateDriver(("ground", self.driven_body), "angle", LAW)},
            outputs={
                "B": jn.outputs.PointOutput("crank", ["a", 0]),
                "C": jn.outputs.PointOutput("rocker", ["c", 0]),
                "R": jn.outputs.PointOutput("link", ["l", 0]),
            },
        )

    def forms(self, values):
        space = Affine(4)
        b, c, r, d = values["a"] * space.input(), space.unknown(0), space.unknown(2), space.fixed(values["d"], 0.0)
        p, q = self.attached(values, space.input(), c, d, space.fixed(values["qx"], values["qy"]))
        return [
            space.distance(c, b, values["b"]),
            space.distance(c, d, values["c"]),
            space.distance(r, p, values["r"]),
            space.distance(r, q, values["l"]),
        ]

    def attached(self, values, u, c, d, q):
        """Return P and Q, from the direction of the crank, C and D, and Q if it is on the ground."""
        b = values["a"] * u
        ends = {"crank": (0 * b, u), "coupler": (b, (c - b) / values["b"]), "rocker": (d, (c - d) / values["c"])}
        origin, along = ends[self.on_p]
        p = origin + turned(along, values["px"], values["py"])
        if self.on_q != "ground":
            origin, along = ends[self.on_q]
            q = origin + turned(along, values["qx"], values["qy"])
        return p, q

    def points(self, values, angle, side):
        """Return C, P and Q for an angle of the crank, or None."""
        u, d = direction(angle), np.array([values["d"], 0.0])
        c = dyad(values["a"] * u, d, values["b"], values["c"], side)
        if c is None:
            return None
        return c, *self.attached(values, u, c, d, np.array([values["qx"], values["qy"]]))

    def draw(self, random, nearness, sign):
        first = nearness and random.random() < 0.4
        sides = four_bar_lengths(random, nearness if first else None, sign)
        if sides is None:
            return None
        values = dict(zip(("a", "b", "c", "d"), sides, strict=True))
        values |= dict(zip(("px", "py", "qx", "qy"), random.normal(size=4), strict=True))
        values |= dict(zip(("l", "r"), lengths(random, 2), strict=True))
        if nearness and not first:
            return self.dead_point(random, values, nearness, sign)
        return values

    def dead_point(self, random, values, nearness, sign):
        """Return the dimensions with a rod such that the link and it nearly stretch, or fold, where P is farthest from
        Q, or nearest.
        """
        side, most = random.choice([-1, 1]), random.choice([-1, 1])

        def distance(angle):
            points = self.points(values, angle, side)
            return np.nan if points is None else most * np.hypot(*(points[2] - points[1]))

        angles = np.linspace(-np.pi, np.pi, 90)
        found = np.array([distance(angle) for angle in angles])
        inner = np.flatnonzero((found[1:-1] > found[:-2]) & (found[1:-1] > found[2:])) + 1
        if not inner.size:
            return None
        middle = int(random.choice(inner))
        best = minimize_scalar(
            lambda angle: -distance(angle), bounds=angles[[middle - 1, middle + 1]], options={"xatol": 1e-9}
        )
        extreme = -most * best.fun
        # with w for cos of the angle between link and rod, extreme^2 = l^2 + r^2 - 2 l r w
        w = -most * np.sqrt(1 - sign * nearness**2)
        under = extreme**2 - values["l"] ** 2 * (1 - w**2)
        if not np.isfinite(extreme) or under < 0:
            return None
        rod = values["l"] * w + random.choice([-1, 1] if most < 0 else [1]) * np.sqrt(under)
        return values | {"r": rod} if rod > 0.2 else None

    def assembly(self, values, value, random):
        points = self.points(values, float(value), random.choice([-1, 1]))
        r = None if points is None else dyad(points[1], points[2], values["r"], values["l"], random.choice([-1, 1]))
        return None if r is None else np.concatenate([points[0], r])

    def guess(self, values, value, x):
        u, c, r, d = direction(value), x[:2], x[2:], np.array([values["d"], 0.0])
        q = self.attached(values, u, c, d, np.array([values["qx"], values["qy"]]))[1]
        return value, angle_of(c - values["a"] * u), angle_of(c - d), angle_of(r - q), *q

    def unknowns(self, outputs, values):
        return np.concatenate([outputs["C"], outputs["R"]], axis=-1)


class Triad(Family):
    """Linkages that no sequence of dyads solves: a position comes first, and the rods are made to fit.

    Those placed near a singular position turn back just before the end of their motion, or run into it.
    """

    def assembly(self, values, value, random):
        raise NotImplementedError("the position comes first")

    @abc.abstractmethod
    def place(self, random, nearness):
        """Return dimensions, a driven angle and the unknowns there, or None."""

    def linkage(self, random, near, nearest=NEAREST):
        while True:
            nearness = 10 ** random.uniform(np.log10(nearest), -1) if near else None
            sign = random.choice([-1, 1])
            placed = self.place(random, nearness)
            if placed is None:
                continue
            values, value, start = placed
            law, stop = self.law(random, values, nearness, sign)
            law = law._replace(start=law.start + value - law(0.0))
            if near and random.random() < 0.7:
                law = self.law_to_the_end(values, value, start, law, sign * nearness**2, random.uniform(0.55, 1.5))
            if law is not None:
                guess = self.near_guess(random, values, law, start)
                return Linkage(self, values, law, start, guess, nearness), float(stop)

    def law_to_the_end(self, values, value, start, law, missing, amplitude):
        """Return a law that turns back a little before the motion ends, or after; None if it ends nowhere."""
        path = follow(np.stack(self.forms(values))[None], True, start[None], [np.array([value, value + 7.0])])
        way = float(path.limit[0]) - value
        if not way > 0.1:
            return None
        wave = amplitude * way
        middle = value + way * (1 - missing) - wave
        return Law(middle, 0.0, wave, law.speed or abs(law.rate), float(np.arcsin((value - middle) / wave)))


class StephensonAtLink(Triad, SixBar):
    """Stephenson III driven at the link on the ground. The unknowns are B and C."""

    driven_body = "link"

    def forms(self, values):
        space = Affine(4)
        b, c, d = space.unknown(0), space.unknown(2), space.fixed(values["d"], 0.0)
        r = space.fixed(values["qx"], values["qy"]) + values["l"] * space.input()
        p = b + turned((c - b) / values["b"], values["px"], values["py"])
        return [
            space.distance(b, space.fixed(0.0, 0.0), values["a"]),
            space.distance(c, b, values["b"]),
            space.distance(c, d, values["c"]),
            space.distance(r, p, values["r"]),
        ]

    def place(self, random, nearness):
        values = self.draw(random, None, 0)
        sides = four_bar_lengths(random, nearness if random.random() < 0.5 else None, random.choice([-1, 1]))
        if values is None or sides is None:
            return None
        values |= dict(zip(("a", "b", "c", "d"), sides, strict=True))
        crank, link = random.uniform(-np.pi, np.pi, size=2)
        points = self.points(values, crank, random.choice([-1, 1]))
        if points is None:
            return None
        c, p, q = points
        rod = np.hypot(*(q + values["l"] * direction(link) - p))
        return (values | {"r": rod}, link, np.concatenate([values["a"] * direction(crank), c])) if rod > 0.2 else None

    def guess(self, values, value, x):
        b, c, d = x[:2], x[2:], np.array([values["d"], 0.0])
        return angle_of(b), angle_of(c - b), angle_of(c - d), value, values["qx"], values["qy"]

    def unknowns(self, outputs, values):
        return np.concatenate([outputs["B"], outputs["C"]], axis=-1)


class StephensonSecond(Triad):
    """Stephenson II: a crank carries one ternary link, the ground another, and two rods join these.

    The unknowns are the directions of both.
    """

    name = "Stephenson II"
    dimensions = ("a", "d", "px", "py", "qx", "qy", "rx", "ry", "sx", "sy", "b", "c")
    guessed = ("crank", "lever", "plate", "x", "y")

    def build(self, parameters):
        rods = {
            "b": (["px", "py"], ["qx", "qy"], "b"),
            "c": (["rx", "ry"], ["sx", "sy"], "c"),
        }
        return jn.Mechanism(
            space="planar",
            parameters=parameters,
            bodies={
                "crank": jn.Body(["d", 0], "crank"),
                "lever": jn.Body([0, 0], "lever"),
                "plate": jn.Body(["x", "y"], "plate"),
            },
            joints={
                "O": planar.Revolute(("ground", "lever"), [0, 0], [0, 0]),
                "D": planar.Revolute(("ground", "crank"), ["d", 0], [0, 0]),
                "E": planar.Revolute(("crank", "plate"), ["a", 0], [0, 0]),
            }
            | {name: planar.DoubleRevolute(("lever", "plate"), *ends) for name, ends in rods.items()},
            drivers={"drive": drivers.CoordinateDriver(("ground", "crank"), "angle", LAW)},
            outputs={
                "lever": jn.outputs.PointOutput("lever", [1, 0]),
                "plate": jn.outputs.PointOutput("plate", [1, 0]),
                "E": jn.outputs.PointOutput("plate", [0, 0]),
            },
        )

    def rods(self, values, u, lever, plate, d):
        """Return the ends of both rods."""
        e = d + values["a"] * u
        p, r = (turned(lever, values[f"{n}x"], values[f"{n}y"]) for n in "pr")
        q, s = (e + turned(plate, values[f"{n}x"], values[f"{n}y"]) for n in "qs")
        return (p, q), (r, s)

    def forms(self, values):
        space = Affine(4)
        lever, plate = space.unknown(0), space.unknown(2)
        first, second = self.rods(values, space.input(), lever, plate, space.fixed(values["d"], 0.0))
        return [
            space.product(lever, lever, 1.0, 2.0),
            space.product(plate, plate, 1.0, 2.0),
            space.distance(*first, values["b"]),
            space.distance(*second, values["c"]),
        ]

    def draw(self, random, nearness, sign):
        raise NotImplementedError("the position comes first")

    def place(self, random, nearness):
        values = dict(zip(self.dimensions[:2], lengths(random, 2), strict=True))
        values |= dict(zip(self.dimensions[2:10], random.normal(size=8), strict=True))
        crank, lever, plate = random.uniform(-np.pi, np.pi, size=3)
        start = np.concatenate([direction(lever), direction(plate)])
        ends = self.rods(values, direction(crank), start[:2], start[2:], np.array([values["d"], 0.0]))
        values |= {name: np.hypot(*(p - q)) for name, (p, q) in zip("bc", ends, strict=True)}
        return (values, crank, start) if min(values["b"], values["c"]) > 0.2 else None

    def guess(self, values, value, x):
        base = np.array([values["d"], 0.0]) + values["a"] * direction(value)
        return value, angle_of(x[:2]), angle_of(x[2:]), *base

    def unknowns(self, outputs, values):
        return np.concatenate([outputs["lever"], outputs["plate"] - outputs["E"]], axis=-1)
