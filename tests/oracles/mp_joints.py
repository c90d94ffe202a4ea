"""Residuals of every joint and driver of a mechanism file, in the judge's own formulation.

A planar body is (x, y, c, s) with c^2 + s^2 = 1, a spatial one (x, y, z, e0, e1, e2, e3) with a unit quaternion: all
coordinates are global and integrable, and the attitude is an unknown like any other. The library's unknowns are an
angle, or a body-fixed angular velocity and a recursion for the attitude: nothing is shared but the file.
"""

from tests.oracles.mp_series import Series, atan2, cos, sin, sqrt


def dot(a, b):
    """Return the inner product of two triples or pairs of series or numbers."""
    first, *rest = [x * y for x, y in zip(a, b, strict=True)]
    return sum(rest, first)


def cross(a, b):
    """Return the vector product in space, or its one component in the plane."""
    if len(a) == 2:
        return a[0] * b[1] - a[1] * b[0]
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def minus(a, b):
    """Return the difference of two vectors."""
    return [x - y for x, y in zip(a, b, strict=True)]


def unit(a):
    """Return a constant vector scaled to unit length."""
    length = sqrt(dot(a, a))
    return [x / length for x in a]


def two_normals(axis):
    """Return two independent constant vectors perpendicular to an axis."""
    smallest = min(range(3), key=lambda k: abs(axis[k]))
    helper = [axis[0] * 0 + (1 if k == smallest else 0) for k in range(3)]
    first = unit(cross(unit(axis), helper))
    return first, cross(unit(axis), first)


class PlanarPose:
    """Body of the plane from its four coordinate series."""

    size = 4

    def __init__(self, coordinates, near=None):
        self.position, (self.c, self.s), self.near = coordinates[:2], coordinates[2:], near

    def direction(self, v):
        return [self.c * v[0] - self.s * v[1], self.s * v[0] + self.c * v[1]]

    def point(self, p):
        return [r + d for r, d in zip(self.position, self.direction(p), strict=True)]

    @property
    def angle(self):
        return atan2(self.s, self.c, self.near)

    def normalization(self):
        return self.c * self.c + self.s * self.s - 1


class SpatialPose:
    """Body of space from its seven coordinate series."""

    size = 7

    def __init__(self, coordinates, near=None):
        self.position, self.p, self._rows = coordinates[:3], coordinates[3:], None

    def rows(self):
        """Return the attitude matrix, each row once."""
        if self._rows is None:
            a, b, c, d = self.p
            aa, bb, cc, dd = a * a, b * b, c * c, d * d
            self._rows = [
                [aa + bb - cc - dd, 2 * (b * c - a * d), 2 * (b * d + a * c)],
                [2 * (b * c + a * d), aa - bb + cc - dd, 2 * (c * d - a * b)],
                [2 * (b * d - a * c), 2 * (c * d + a * b), aa - bb - cc + dd],
            ]
        return self._rows

    def direction(self, v):
        return [dot(row, v) for row in self.rows()]

    def point(self, p):
        return [r + d for r, d in zip(self.position, self.direction(p), strict=True)]

    def normalization(self):
        return dot(self.p, self.p) - 1

    def angular_velocity(self, frame=None):
        """Return 2 conj(p) p' (frame "body") or 2 p' conj(p) (any other: global), one order shorter."""
        p = [Series(x.c[:-1]) for x in self.p]
        rate, conjugate = [x.differentiate() for x in self.p], [p[0], -p[1], -p[2], -p[3]]
        a, b = (conjugate, rate) if frame == "body" else (rate, conjugate)
        v = cross(a[1:], b[1:])
        return [2 * (a[0] * b[k + 1] + b[0] * a[k + 1] + v[k]) for k in range(3)]


def half_turn(i, j, axis):
    """Return (sine, cosine) of half the angle of A_i^T A_j about an axis, up to a common positive factor."""
    u = unit(axis)
    p, q = i.p, j.p
    e0 = dot(p, q)
    e = [p[0] * q[k + 1] - q[0] * p[k + 1] for k in range(3)]
    e = minus(e, cross(p[1:], q[1:]))
    return dot(u, e), e0


def signed_turn(i, j, axis, vectors):
    """Return (sine, cosine) of the angle from a vector of i to one of j about an axis of i, up to a factor."""
    u = i.direction(unit(axis))
    a, b = i.direction(vectors[0]), j.direction(vectors[1])
    return dot(u, cross(a, b)), dot(a, b) - dot(u, a) * dot(u, b)


def parallel(i, j, axes):
    """Return two rows that keep two axes parallel."""
    v = j.direction(axes[1])
    return [dot(i.direction(n), v) for n in two_normals(axes[0])]


def gap(i, j, points):
    """Return the vector from the point on body i to that on body j."""
    return minus(j.point(points[1]), i.point(points[0]))


def collinear(i, j, keys):
    """Return four rows that keep two axes on one line."""
    d = gap(i, j, keys["points"])
    return parallel(i, j, keys["axes"]) + [dot(i.direction(n), d) for n in two_normals(keys["axes"][0])]


def coordinate_of(body, name):
    """Return the angle, x or y of a planar body."""
    return body.angle if name == "angle" else body.position["xy".index(name)]


def along(i, j, keys):
    """Return the distance from point to point along a unit vector of body i."""
    return dot(i.direction(unit(keys["vector"])), gap(i, j, keys["points"]))


def _coordinate(k, f, i, j):
    ratio = k.get("ratio", 1)
    return [coordinate_of(j, k["coordinate"]) - ratio * i.angle - k.get("offset", 0) - (0 if f is None else f)]


def _gear(k, f, i, j, m):
    return [(j.angle - m.angle) - k["ratio"] * (i.angle - m.angle) - k.get("offset", 0)]


def _rolling(k, f, i, j):
    return [along(i, j, k) - k["radius"] * (j.angle - i.angle) - k.get("offset", 0)]


def _distance(k, f, i, j):
    d = gap(i, j, k["points"])
    return [sqrt(dot(d, d)) - f]


def _rod(k, f, i, j):
    d = gap(i, j, k["points"])
    return [sqrt(dot(d, d)) - k["length"]]


def _slide(k, f, i, j):
    return [along(i, j, k) - f]


PLANAR_JOINTS = {
    "revolute": lambda k, f, i, j: gap(i, j, k["points"]),
    "double_revolute": _rod,
    "parallel1": lambda k, f, i, j: [cross(i.direction(k["vectors"][0]), j.direction(k["vectors"][1]))],
    "parallel2": lambda k, f, i, j: [cross(i.direction(k["vector"]), gap(i, j, k["points"]))],
    "prismatic": lambda k, f, i, j: [
        cross(i.direction(k["vectors"][0]), gap(i, j, k["points"])),
        cross(i.direction(k["vectors"][0]), j.direction(k["vectors"][1])),
    ],
    "coordinate": _coordinate,
    "gear": _gear,
    "rolling": _rolling,
}
PLANAR_DRIVERS = {"coordinate": _coordinate, "slide": _slide, "distance": _distance}


def _prismatic(k, f, i, j):
    side = cross(k["axes"][0], k["normals"][0])
    return [*collinear(i, j, k), dot(i.direction(side), j.direction(k["normals"][1]))]


def _screw(k, f, i, j):
    s, c = half_turn(i, j, k["axes"][0])
    advance = dot(i.direction(unit(k["axes"][0])), gap(i, j, k["points"])) - k.get("offset", 0)
    half = advance * (k["pi"] / k["lead"])
    return [*collinear(i, j, k), s * cos(half) - c * sin(half)]


def _rotation(k, f, i, j):
    if "vectors" in k:
        s, c = signed_turn(i, j, k["axis"], k["vectors"])
    else:
        (s, c), f = half_turn(i, j, k["axis"]), f / 2
    return [s * cos(f) - c * sin(f)]


SPATIAL_JOINTS = {
    "spherical": lambda k, f, i, j: gap(i, j, k["points"]),
    "double_spherical": _rod,
    "dot1": lambda k, f, i, j: [dot(i.direction(k["vectors"][0]), j.direction(k["vectors"][1]))],
    "dot2": lambda k, f, i, j: [dot(i.direction(k["vector"]), gap(i, j, k["points"]))],
    "universal": lambda k, f, i, j: [
        *gap(i, j, k["points"]),
        dot(i.direction(k["vectors"][0]), j.direction(k["vectors"][1])),
    ],
    "revolute": lambda k, f, i, j: gap(i, j, k["points"]) + parallel(i, j, k["axes"]),
    "cylindrical": lambda k, f, i, j: collinear(i, j, k),
    "prismatic": _prismatic,
    "screw": _screw,
}
SPATIAL_DRIVERS = {"rotation": _rotation, "slide": _slide, "distance": _distance}
