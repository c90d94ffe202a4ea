"""Forces, energies and motion of tree robots in many digits, from first principles: the independent judge of robots.

Every pose is a power series in the frame of the base. Forces come from virtual work, energies from point masses:
nothing is handed from body to body but the pose itself, and nothing here knows of the library.
"""

from dataclasses import dataclass, field, replace
from typing import Any

from mpmath import mp, mpf

from tests.oracles.mp_series import Series, sin_cos


@dataclass(frozen=True)
class Body:
    """A link and the joint that carries it; `parent` is an index, -1 is the base; type may be fixed."""

    name: str
    parent: int
    type: str
    position: Any
    rotation: Any
    axis: Any
    mass: Any = field(default_factory=lambda: mpf(0))
    center: Any = field(default_factory=lambda: [mpf(0)] * 3)
    inertia: Any = field(default_factory=lambda: [[mpf(0)] * 3 for _ in range(3)])
    joint: str = ""


@dataclass(frozen=True)
class Robot:
    """Bodies, parents before children, and the acceleration of free fall."""

    bodies: tuple[Body, ...]
    gravity: Any

    @property
    def moving(self):
        """Indices of the bodies with a coordinate, in the order of the motions."""
        return [k for k, body in enumerate(self.bodies) if body.type != "fixed"]

    def without_gravity(self):
        """Return the same robot where nothing falls."""
        return replace(self, gravity=[mpf(0)] * 3)

    def locked(self, names):
        """Return the robot with joints held at coordinate zero."""
        return replace(self, bodies=tuple(replace(b, type="fixed") if b.joint in names else b for b in self.bodies))


def number(x):
    """Return an mpf from a decimal string or, exactly, from a float."""
    return mpf(x) if isinstance(x, str | mpf) else mpf(float(x))


def numbers(x):
    """Return nested lists of mpf."""
    return [numbers(y) for y in x] if isinstance(x, list | tuple) or getattr(x, "ndim", 0) else number(x)


def from_numbers(bodies, gravity=(0, 0, "-9.81")):
    """Return a robot from dicts of floats or decimal strings; rotations are made orthogonal to the last digit."""
    made = []
    for k, body in enumerate(bodies):
        axis = unit(numbers(body.get("axis", [0, 0, 1])))
        rest = {key: numbers(body[key]) for key in ("mass", "center", "inertia") if key in body}
        place = numbers(body.get("position", [0, 0, 0]))
        rotation = orthogonal(numbers(body.get("rotation", [[1, 0, 0], [0, 1, 0], [0, 0, 1]])))
        names = {"name": body.get("name", f"link_{k + 1}"), "joint": body.get("joint", f"joint_{k + 1}")}
        made.append(
            Body(
                parent=body["parent"], type=body["type"], position=place, rotation=rotation, axis=axis, **rest, **names
            )
        )
    return Robot(tuple(made), numbers(list(gravity)))


def motion(derivatives):
    """Return the series of a coordinate with the given plain derivatives."""
    return Series([number(d) / mp.factorial(k) for k, d in enumerate(derivatives)])


# vectors are lists of three series or numbers


def unit(a):
    """Return a vector of numbers made one long."""
    length = mp.sqrt(mp.fdot(a, a))
    return [x / length for x in a]


def dot(a, b):
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    """Return the vector product."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def plus(a, b):
    """Return the sum of two vectors."""
    return [x + y for x, y in zip(a, b, strict=True)]


def minus(a, b):
    """Return the difference of two vectors."""
    return [x - y for x, y in zip(a, b, strict=True)]


def scaled(a, factor):
    """Return a vector times a scalar."""
    return [x * factor for x in a]


def transposed(A):
    """Return the transpose of a matrix."""
    return [list(column) for column in zip(*A, strict=True)]


def times(A, b):
    """Return a matrix times a vector."""
    return [dot(row, b) for row in A]


def matrices(A, B):
    """Return the product of two matrices."""
    columns = transposed(B)
    return [[dot(row, column) for column in columns] for row in A]


def rates(a, n=1):
    """Return the n-th time derivative of a vector of series, n orders shorter."""
    for _ in range(n):
        a = [x.differentiate() for x in a]
    return a


def cut(a, length):
    """Return a vector of series cut to so many coefficients."""
    return [Series(x.c[:length]) for x in a]


def orthogonal(R):
    """Return the rotation nearest to a matrix of rounded numbers, by Newton's iteration ``R (3 - R^T R) / 2``."""
    for _ in range(8):
        square = matrices(transposed(R), R)
        R = matrices(R, [[(mpf(3 * (i == j)) - square[i][j]) / 2 for j in range(3)] for i in range(3)])
    return R


def turn(axis, angle):
    """Return the rotation matrix about a unit vector by an angle that is a series or a number."""
    sine, cosine = sin_cos(angle) if isinstance(angle, Series) else (mp.sin(angle), mp.cos(angle))
    x, y, z = axis
    skew = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
    versine = 1 - cosine
    return [
        [versine * (axis[i] * axis[j]) + (cosine if i == j else sine * skew[i][j]) for j in range(3)] for i in range(3)
    ]


class State:
    """A robot along a motion: poses, centers of mass and angular velocities of all bodies, in the frame of the base.

    Parameters
    ----------
    robot : Robot
        What moves.
    motions : list of Series
        One for each coordinate, all of one length.
    """

    def __init__(self, robot, motions):
        self.robot, self.motions = robot, motions
        self.length = len(motions[0])
        zero = Series([mpf(0)] * self.length)
        one = [[zero + mpf(i == j) for j in range(3)] for i in range(3)]
        self.attitude, self.origin, self.axis = [], [], []
        coordinates = dict(zip(robot.moving, motions, strict=True))
        for k, body in enumerate(robot.bodies):
            A, r = (one, [zero] * 3) if body.parent < 0 else (self.attitude[body.parent], self.origin[body.parent])
            r, A = plus(r, times(A, body.position)), matrices(A, body.rotation)
            axis = times(A, body.axis)
            if body.type in ("revolute", "continuous"):
                A = matrices(A, turn(body.axis, coordinates[k]))
            elif body.type == "prismatic":
                r = plus(r, [a * coordinates[k] for a in axis])
            self.attitude.append(A)
            self.origin.append(r)
            self.axis.append(axis)
        self.center = [self.point(k, body.center) for k, body in enumerate(robot.bodies)]

    def point(self, k, local=(0, 0, 0)):
        """Return the position of a point of body k, given in its frame."""
        if not any(local):
            return self.origin[k]
        return plus(self.origin[k], times(self.attitude[k], numbers(list(local))))

    def angular_velocity(self, k):
        """Return the angular velocity of body k, read off ``A' A^T``; one order shorter."""
        A = self.attitude[k]
        before = [cut(row, self.length - 1) for row in A]
        rate = [rates(row) for row in A]
        return [dot(rate[2], before[1]), dot(rate[0], before[2]), dot(rate[1], before[0])]

    def angular_momentum(self, k):
        """Return the angular momentum of body k about its center of mass; one order shorter."""
        A = [cut(row, self.length - 1) for row in self.attitude[k]]
        return times(A, times(self.robot.bodies[k].inertia, times(transposed(A), self.angular_velocity(k))))

    def carries(self, j, k):
        """Tell whether joint j moves body k."""
        while k >= 0:
            if k == j:
                return True
            k = self.robot.bodies[k].parent
        return False

    def shift(self, j, point, length):
        """Return how a point and the attitude of a body carried by joint j shift with its coordinate."""
        axis = cut(self.axis[j], length)
        if self.robot.bodies[j].type == "prismatic":
            return axis, [0 * axis[0]] * 3
        return cross(axis, minus(cut(point, length), cut(self.origin[j], length))), axis

    def pull(self, k):
        """Return what moves body k: ``m (r'' - g)`` at the center of mass and the rate of its angular momentum."""
        body = self.robot.bodies[k]
        falling = [Series([-g, *[mpf(0)] * (self.length - 3)]) for g in self.robot.gravity]
        return scaled(plus(rates(self.center[k], 2), falling), body.mass), rates(self.angular_momentum(k))

    def forces(self, loads=None):
        """Return the generalized force at each coordinate by virtual work, two orders shorter than the motions.

        `loads` maps indices of bodies to series of an external force and its moment about the origin of the body, in
        components of its frame.
        """
        n = self.length - 2
        found = [Series([mpf(0)] * n) for _ in self.robot.moving]
        for k, body in enumerate(self.robot.bodies):
            pairs = [(*self.pull(k), self.center[k])] if body.mass else []
            if loads and k in loads:
                A = [cut(row, n) for row in self.attitude[k]]
                force, moment = (scaled(times(A, cut(x, n)), mpf(-1)) for x in loads[k])
                pairs.append((force, moment, self.origin[k]))
            for place, j in enumerate(self.robot.moving):
                if self.carries(j, k):
                    for force, moment, point in pairs:
                        moved, turned = self.shift(j, point, n)
                        found[place] = found[place] + dot(force, moved) + dot(moment, turned)
        return found

    def wrench(self, k):
        """Return force and moment about its origin that body k gets through its joint, in its own frame.

        D'Alembert's principle for everything that the joint carries, cut free at once.
        """
        n = self.length - 2
        force = moment = [Series([mpf(0)] * n) for _ in range(3)]
        for i, body in enumerate(self.robot.bodies):
            if body.mass and self.carries(k, i):
                pull, spin = self.pull(i)
                arm = minus(cut(self.center[i], n), cut(self.origin[k], n))
                force, moment = plus(force, pull), plus(moment, plus(spin, cross(arm, pull)))
        back = transposed([cut(row, n) for row in self.attitude[k]])
        return times(back, force), times(back, moment)

    def center_of_mass(self):
        """Return the center of mass of all moving bodies."""
        masses = [body.mass for body in self.robot.bodies]
        weighted = [scaled(r, m) for r, m in zip(self.center, masses, strict=True)]
        return [sum((r[i] for r in weighted[1:]), weighted[0][i]) / mp.fsum(masses) for i in range(3)]

    def jacobian(self, k, local=(0, 0, 0)):
        """Return the columns of the Jacobian of a point of body k: linear rows, then angular ones."""
        point, zero = self.point(k, local), Series([mpf(0)] * self.length)
        columns = []
        for j in self.robot.moving:
            moved, turned = self.shift(j, point, self.length) if self.carries(j, k) else ([zero] * 3, [zero] * 3)
            columns.append([*moved, *turned])
        return columns

    def potential_energy(self):
        """Return the energy of weight."""
        g = self.robot.gravity
        found = Series([mpf(0)] * self.length)
        for body, r in zip(self.robot.bodies, self.center, strict=True):
            found = found - dot(r, scaled(g, body.mass))
        return found

    def energies(self, k, p):
        """Return the acceleration energy of order p of body k as a cloud of points: of translation, and of rotation.

        By definition half the sum of masses times squared (p+1)-th derivatives of positions; p = 0 is kinetic energy.
        """
        body = self.robot.bodies[k]
        high = rates(self.center[k], p + 1)
        translation = dot(high, high) * (body.mass / 2)
        total = 0 * translation
        for mass, place in cloud(body):
            high = rates(self.point(k, place), p + 1)
            total = total + dot(high, high) * (mass / 2)
        return translation, total - translation


def cloud(body):
    """Return seven point masses with the mass, the center of mass and the inertia of a body.

    Second moments ``S = sum d l l^T`` (Cholesky without square roots) stand for pairs of points at the center
    plus and minus a multiple of l; the rest of the mass sits at the center.
    """
    trace = body.inertia[0][0] + body.inertia[1][1] + body.inertia[2][2]
    rest = [[(trace / 2 if i == j else 0) - body.inertia[i][j] for j in range(3)] for i in range(3)]
    spread = 2 * sum(abs(rest[i][i]) for i in range(3)) / body.mass if body.mass else 0
    points, left = [], body.mass
    for k in range(3):
        pivot = rest[k][k]
        if abs(pivot) <= mpf(10) ** (5 - mp.dps) * (trace or 1):
            continue
        column = [rest[i][k] / pivot for i in range(3)]
        rest = [[rest[i][j] - pivot * column[i] * column[j] for j in range(3)] for i in range(3)]
        half, arm = pivot / (2 * spread), mp.sqrt(spread)
        points += [(half, [c + sign * arm * x for c, x in zip(body.center, column, strict=True)]) for sign in (1, -1)]
        left = left - 2 * half
    return [*points, (left, list(body.center))] if body.mass else []
