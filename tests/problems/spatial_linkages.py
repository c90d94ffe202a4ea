"""Spatial four-bars RSSR and RCCC with axes in general position, constrained exactly."""

import math

import numpy as np

import jounce as jn
from jounce import drivers, spatial
from tests.oracles.linkage_paths import Affine
from tests.problems.linkages import LAW, Family, lengths

ORIGIN, X, Z = [0, 0, 0], [1, 0, 0], [0, 0, 1]


def frame_about(axis):
    """Return a rotation matrix of which the third column is a unit vector."""
    side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    side /= np.linalg.norm(side)
    return np.stack([side, np.cross(axis, side), axis], axis=1)


def unit_vector(random):
    """Return a random direction."""
    vector = random.normal(size=3)
    return vector / np.linalg.norm(vector)


def about_z(angle):
    """Return the matrix of a turn about z."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def quaternion_of(rotation):
    """Return the Euler parameters of a rotation matrix."""
    # the eigenvector that belongs to the largest eigenvalue (Bar-Itzhack 2000)
    r = rotation
    axial = [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]
    matrix = np.empty((4, 4))
    matrix[1:, 1:] = r + r.T - np.trace(r) * np.eye(3)
    matrix[0, 1:] = matrix[1:, 0] = axial
    matrix[0, 0] = np.trace(r)
    return np.linalg.eigh(matrix)[1][:, -1]


class RSSR(Family):
    """Crank of radius a about z at the origin, rocker of radius r about an axis through D, rod of length l.

    The unknowns are cosine and sine of the rocker's angle.
    """

    name = "RSSR"
    dimensions = ("a", "r", "l", "dx", "dy", "dz", "nx", "ny", "nz")
    guessed = ("crank", *(f"q{k}" for k in range(4)))

    def build(self, parameters):
        d, n = ["dx", "dy", "dz"], ["nx", "ny", "nz"]
        return jn.Mechanism(
            space="spatial",
            parameters=parameters | {"nz": 1.0, "q0": 1.0},
            bodies={
                "crank": jn.Body(ORIGIN, orientation=["cos(crank/2)", 0, 0, "sin(crank/2)"]),
                "rocker": jn.Body(d, orientation=["q0", "q1", "q2", "q3"]),
            },
            joints={
                "A": spatial.Revolute(("ground", "crank"), ORIGIN, ORIGIN, Z, Z),
                "D": spatial.Revolute(("ground", "rocker"), d, ORIGIN, n, Z),
                "rod": spatial.DoubleSpherical(("crank", "rocker"), ["a", 0, 0], ["r", 0, 0], "l"),
            },
            drivers={"drive": drivers.RotationDriver(("ground", "crank"), Z, LAW, X, X)},
            outputs={"C": jn.outputs.PointOutput("rocker", X), "D": jn.outputs.PointOutput("rocker", ORIGIN)},
        )

    @staticmethod
    def seat(values):
        """Return D and the frame of the rocker at angle zero."""
        axis = np.array([values["nx"], values["ny"], values["nz"]])
        return np.array([values["dx"], values["dy"], values["dz"]]), frame_about(axis)

    def forms(self, values):
        d, frame = self.seat(values)
        plane, space = Affine(2), Affine(2, components=3)
        turning = plane.unknown(0)
        tip = space.fixed(*d) + values["r"] * frame[:, :2] @ turning
        crank = values["a"] * space.input((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
        return [plane.product(turning, turning, 1.0, 2.0), space.distance(tip, crank, values["l"])]

    def draw(self, random, nearness, sign):
        a, r, rod = lengths(random, 3)
        d, n = 1.5 * random.normal(size=3), unit_vector(random)
        if nearness:
            angle = np.linspace(-np.pi, np.pi, 20001)  # whose extremes are near enough for where a dead point is
            tips = np.stack([a * np.cos(angle), a * np.sin(angle), 0 * angle], axis=1) - d
            height = tips @ n
            away = np.sqrt(np.maximum((tips**2).sum(axis=1) - height**2, 0.0))
            most = random.choice([-1, 1])
            extremes = height**2 + (away + most * r) ** 2
            k = np.argmin(most * extremes)
            k = (extremes[k - 1 : k + 2], away[k]) if 0 < k < len(angle) - 1 else None
            if k is None:
                return None
            (before, at, after), away = k
            peak = at - (after - before) ** 2 / (8 * (after - 2 * at + before))
            square = peak - most * sign * r * away * nearness**2
            rod = math.sqrt(square) if square > 0.04 else None
        if rod is None:
            return None
        return dict(zip(self.dimensions, (a, r, rod, *d, *n), strict=True))

    def assembly(self, values, value, random):
        d, frame = self.seat(values)
        tip = values["a"] * np.array([np.cos(value), np.sin(value), 0.0]) - d
        along = frame[:, :2].T @ tip
        away = np.hypot(*along)
        cosine = (values["r"] ** 2 + tip @ tip - values["l"] ** 2) / (2 * values["r"] * away)
        if not abs(cosine) < 1 - 1e-15:
            return None
        angle = np.arctan2(along[1], along[0]) + random.choice([-1, 1]) * np.arccos(cosine)
        return np.array([np.cos(angle), np.sin(angle)])

    def guess(self, values, value, x):
        _, frame = self.seat(values)
        return value, *quaternion_of(frame @ about_z(np.arctan2(x[1], x[0])))

    def unknowns(self, outputs, values):
        return (outputs["C"] - outputs["D"]) @ self.seat(values)[1][:, :2]


class RCCC(Family):
    """A crank about z with a cylindrical joint on it, a coupler and a rocker, by twists and shortest distances of axes.

    The unknowns are the direction of the axis between coupler and rocker, which a spherical four-bar gives, and its
    moment about the origin, which follows from linear equations (Yang and Freudenstein 1964).
    """

    name = "RCCC"
    dimensions = ("px", "py", "pz", "kx", "ky", "kz", "gx", "gy", "gz", "nx", "ny", "nz")
    dimensions += ("e", "es", "ec", "f", "fs", "fc")  # coupler and rocker: distance, sine and cosine of the twist
    guessed = ("crank", *(f"{body}{n}" for body in ("coupler", "rocker") for n in ("x", "y", "z", 0, 1, 2, 3)))
    tracked = 3

    def build(self, parameters):
        at, along, point, axis = ([n + c for c in "xyz"] for n in "pkgn")
        bodies = {
            name: jn.Body([name + c for c in "xyz"], orientation=[f"{name}{k}" for k in range(4)])
            for name in ("coupler", "rocker")
        }
        crank = jn.Body(ORIGIN, orientation=["cos(crank/2)", 0, 0, "sin(crank/2)"])
        ones = dict.fromkeys(("kz", "nz", "coupler0", "rocker0"), 1.0)
        return jn.Mechanism(
            space="spatial",
            parameters=parameters | ones,
            bodies={"crank": crank, **bodies},
            joints={
                "1": spatial.Revolute(("ground", "crank"), ORIGIN, ORIGIN, Z, Z),
                "2": spatial.Cylindrical(("crank", "coupler"), at, ORIGIN, along, Z),
                "3": spatial.Cylindrical(("coupler", "rocker"), ["e", 0, 0], ORIGIN, [0, "-es", "ec"], Z),
                "4": spatial.Cylindrical(("ground", "rocker"), point, ["f", 0, 0], axis, [0, "-fs", "fc"]),
            },
            drivers={"drive": drivers.RotationDriver(("ground", "crank"), Z, LAW, X, X)},
            outputs={"tip": jn.outputs.PointOutput("rocker", Z), "origin": jn.outputs.PointOutput("rocker", ORIGIN)},
        )

    @staticmethod
    def axes(values):
        """Return point and direction of the axis on the crank, at angle zero, and of that on the ground."""
        return tuple(np.array([values[n + c] for c in "xyz"]) for n in "pkgn")

    def forms(self, values):
        point, along, base, axis = self.axes(values)
        space = Affine(6, components=3)
        m, moment = space.unknown(0), space.unknown(3)
        second = carried(space, along), carried(space, np.cross(point, along))
        fourth = space.fixed(*axis), space.fixed(*np.cross(base, axis))
        return [
            space.product(m, m, 1.0, 2.0),
            space.product(m, second[0], values["ec"]),
            space.product(m, fourth[0], values["fc"]),
            space.product(m, moment, 0.0),
            space.product(m, second[1], -values["e"] * values["es"]) + space.product(moment, second[0], 0.0),
            space.product(m, fourth[1], -values["f"] * values["fs"]) + space.product(moment, fourth[0], 0.0),
        ]

    def draw(self, random, nearness, sign):
        twists = random.uniform(0.3, np.pi - 0.3, size=3)
        ground, coupler, rocker = random.uniform(0.3, np.pi - 0.3, size=3)
        crank = twists[0]
        if nearness:  # the diagonal of the spherical four-bar is largest, or smallest, at the sum or difference
            most = random.choice([-1, 1])
            w = -most * np.sqrt(1 - sign * nearness**2)
            cosine = np.cos(coupler) * np.cos(rocker) + w * np.sin(coupler) * np.sin(rocker)
            if not abs(cosine) < 1:
                return None
            ground = np.arccos(cosine) - crank if most > 0 else crank + random.choice([-1, 1]) * np.arccos(cosine)
            if not (0.2 < ground < np.pi - 0.2 and crank + ground < np.pi):
                return None
        offset = random.uniform(-np.pi, np.pi)
        along = np.array([np.sin(crank) * np.cos(offset), np.sin(crank) * np.sin(offset), np.cos(crank)])
        offset = random.uniform(-np.pi, np.pi)
        axis = np.array([np.sin(ground) * np.cos(offset), np.sin(ground) * np.sin(offset), np.cos(ground)])
        values = (*random.normal(size=3), *along, *random.normal(size=3), *axis)
        for twist in (coupler, rocker):
            values = (*values, random.uniform(0.2, 1.0), np.sin(twist), np.cos(twist))
        return dict(zip(self.dimensions, map(float, values), strict=True))

    def assembly(self, values, value, random):
        point, along, base, axis = self.axes(values)
        about = about_z(value)
        point, along = about @ point, about @ along
        # the direction: m = x along + y axis + z (along x axis)
        c, normal = along @ axis, np.cross(along, axis)
        x, y = np.linalg.solve([[1, c], [c, 1]], [values["ec"], values["fc"]])
        under = (1 - x**2 - y**2 - 2 * x * y * c) / (normal @ normal)
        if not under > 1e-15:
            return None
        m = x * along + y * axis + random.choice([-1, 1]) * np.sqrt(under) * normal
        matrix = np.stack([m, along, axis])
        right = [
            0.0,
            -values["e"] * values["es"] - m @ np.cross(point, along),
            -values["f"] * values["fs"] - m @ np.cross(base, axis),
        ]
        return np.concatenate([m, np.linalg.solve(matrix, right)])

    def guess(self, values, value, x):
        point, along, base, axis = self.axes(values)
        about = about_z(value)
        point, along = about @ point, about @ along
        m, foot = x[:3], np.cross(x[:3], x[3:])
        # on the coupler the first axis is z and the shortest way to the second is x; likewise on the rocker
        coupler = placed(point, along, foot, m)
        rocker = placed(foot, m, base, axis)
        return value, *coupler, *rocker

    def unknowns(self, outputs, values):
        p, m = outputs["origin"], outputs["tip"] - outputs["origin"]
        moment = np.zeros_like(m)
        for k in range(m.shape[1]):
            moment[:, k] = sum(math.comb(k, j) * np.cross(p[:, j], m[:, k - j]) for j in range(k + 1))
        return np.concatenate([m, moment], axis=-1)


def carried(space, vector):
    """Return a vector that turns with the crank about z."""
    x, y, z = vector
    return space.input((x, y, 0.0), (-y, x, 0.0)) + space.fixed(0.0, 0.0, z)


def placed(point, z, other, along):
    """Return the pose of a link with its axis z through a point, and the shortest way to another line as x."""
    x = np.cross(z, along)
    x /= np.linalg.norm(x)
    # the foot on the first axis: point + s z, where the way to the other line is along x
    s, _, _ = np.linalg.solve(np.stack([z, -along, x], axis=1), other - point)
    return *(point + s * z), *quaternion_of(np.stack([x, np.cross(z, x), z], axis=1))
