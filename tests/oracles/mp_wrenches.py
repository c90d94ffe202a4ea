"""What forces do to bodies, from the mechanics of points and moments, in many digits: judge of applied forces.

A body moves by given functions of time. A load is a force at a place or a moment; the wrench of a body is the force, in
global axes, and the moment about its origin, in its own axes. Rates come from differencing in forty digits.
"""

import dataclasses
import functools

from mpmath import mp, mpf

DIGITS = 40


@dataclasses.dataclass(frozen=True)
class Sine:
    """A quantity ``a + b sin(c t + d)``."""

    a: mpf
    b: mpf
    c: mpf
    d: mpf

    @classmethod
    def random(cls, rng):
        return cls(*(mpf(float(x)) for x in rng.uniform(0.2, 1.0, 4)))

    def __call__(self, t):
        return self.a + self.b * mp.sin(self.c * t + self.d)

    def rate(self, t):
        return self.b * self.c * mp.cos(self.c * t + self.d)


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b, strict=True))


def plus(a, b):
    return [x + y for x, y in zip(a, b, strict=True)]


def minus(a, b):
    return [x - y for x, y in zip(a, b, strict=True)]


def times(a, factor):
    return [x * factor for x in a]


def turned(axis, angle):
    """Return the matrix of a turn about x (0) or z (2)."""
    c, s = mp.cos(angle), mp.sin(angle)
    if axis == 2:
        return mp.matrix([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return mp.matrix([[1, 0, 0], [0, c, -s], [0, s, c]])


@dataclasses.dataclass(frozen=True)
class Moving:
    """A body that moves in space; in the plane the second and third angle are zero, and so is z."""

    position: tuple
    angles: tuple  # about z, the new x, the new z

    @classmethod
    def random(cls, rng, components):
        still = Sine(*[mpf(0)] * 4)
        moving = [Sine.random(rng) for _ in range(6)]
        if components == 2:
            return cls((moving[0], moving[1], still), (moving[2], still, still))
        return cls(tuple(moving[:3]), tuple(moving[3:]))

    def attitude(self, t):
        a, b, c = (angle(t) for angle in self.angles)
        return turned(2, a) * turned(0, b) * turned(2, c)

    def direction(self, local, t):
        return list(self.attitude(t) * mp.matrix(local))

    def seen(self, vector, t):
        """Return the components of a global vector along the axes of the body."""
        return list(self.attitude(t).T * mp.matrix(vector))

    def point(self, local, t):
        return plus([x(t) for x in self.position], self.direction(local, t))

    def spin(self, t):
        """Return the angular velocity, global: each rate about its own axis."""
        a, b, _ = (angle(t) for angle in self.angles)
        first, second = turned(2, a), turned(2, a) * turned(0, b)
        axes = ([0, 0, 1], list(first[:, 0]), list(second[:, 2]))
        total = [mpf(0)] * 3
        for angle, axis in zip(self.angles, axes, strict=True):
            total = plus(total, times(axis, angle.rate(t)))
        return total

    def velocity(self, local, t):
        """Return the velocity of a point, global."""
        return plus([x.rate(t) for x in self.position], cross(self.spin(t), self.direction(local, t)))


def wrench(body, t, forces=(), moments=()):
    """Return force, global, and moment about the origin, along the axes of the body, of loads given globally.

    `forces` are pairs of place and force.
    """
    force, moment = [mpf(0)] * 3, [mpf(0)] * 3
    origin = [x(t) for x in body.position]
    for place, size in forces:
        force = plus(force, size)
        moment = plus(moment, cross(minus(place, origin), size))
    for size in moments:
        moment = plus(moment, size)
    return force + body.seen(moment, t)


def rates(function, t, order):
    """Return the plain derivatives of a function of time that returns a list, as [order][component]."""
    with mp.workdps(DIGITS):

        @functools.cache
        def known(x, digits):  # the columns ask for the same instants, to the same digits
            return function(x)

        size = len(known(mpf(t), mp.prec))
        columns = [mp.taylor(lambda x, k=k: known(x, mp.prec)[k], mpf(t), order) for k in range(size)]
        return [[float(column[n] * mp.factorial(n)) for column in columns] for n in range(order + 1)]
