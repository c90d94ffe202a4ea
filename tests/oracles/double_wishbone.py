"""Double wishbone in closed form, by mpmath: two arms, an upright on two balls, a tie rod from the steering rack.

Given are the angle of one arm and the displacement of the rack, to the left.

Each of the three unknown angles, of the upper arm and of the upright about the line of its balls, is the solution of
``a cos(x) + b sin(x) = c``.
"""

from mpmath import mp


def vector(values):
    return mp.matrix([mp.mpf(str(x)) for x in values])


def dot(a, b):
    return sum(a[k] * b[k] for k in range(3))


def cross(a, b):
    return mp.matrix([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def unit(a):
    return a / mp.sqrt(dot(a, a))


def turned(place, center, axis, angle):
    """Return a place turned about an axis through a center."""
    d, u = place - center, unit(axis)
    return center + d * mp.cos(angle) + cross(u, d) * mp.sin(angle) + u * (dot(u, d) * (1 - mp.cos(angle)))


def met(place, center, axis, other, distance):
    """Return a place turned about an axis, by the smaller angle, until it has a distance from another."""
    u = unit(axis)
    d = place - center
    along = u * dot(u, d)
    flat, side = d - along, cross(u, d)
    e = other - center - along  # |flat cos + side sin - e| = distance
    a, b = dot(flat, e), dot(side, e)
    c = (dot(flat, flat) + dot(e, e) - distance**2) / 2
    middle, reach = mp.atan2(b, a), mp.acos(c / mp.sqrt(a * a + b * b))
    angle = min((middle + reach, middle - reach), key=lambda x: abs(mp.atan2(mp.sin(x), mp.cos(x))))
    return turned(place, center, axis, angle)


def distance(a, b):
    return mp.sqrt(dot(a - b, a - b))


def triad(p, q, r):
    x = unit(q - p)
    z = unit(cross(x, r - p))
    return [x, cross(z, x), z]


class Suspension:
    """Hardpoints at design height, m."""

    def __init__(self):
        self.lower = vector([0, 0.36, 0.2]), vector([1, 0.04, -0.02])
        self.upper = vector([0, 0.44, 0.48]), vector([1, -0.05, 0.06])
        self.lower_ball, self.upper_ball = vector([0.01, 0.74, 0.18]), vector([-0.02, 0.69, 0.52])
        self.inner, self.outer = vector([-0.12, 0.38, 0.238]), vector([-0.13, 0.725, 0.235])

    def upright(self, angle, rack=0):
        """Return the map of places of the upright, at an angle of the lower arm and a displacement of the rack."""
        lower = turned(self.lower_ball, *self.lower, angle)
        upper = met(self.upper_ball, *self.upper, lower, distance(self.upper_ball, self.lower_ball))
        before = triad(self.lower_ball, self.upper_ball, self.outer)
        ahead, behind = _frame(lower, upper), _frame(self.lower_ball, self.upper_ball)
        guess = lower + _put(ahead, behind, self.outer - self.lower_ball)
        # the tie rod turns the upright about the line of its balls
        outer = met(guess, lower, upper - lower, self.inner + vector([0, rack, 0]), distance(self.inner, self.outer))
        now = triad(lower, upper, outer)

        def place(given, free=False):
            moved = _put(now, before, given if free else given - self.lower_ball)
            return moved if free else lower + moved

        return place


def _put(axes, known, vector):
    """Return the vector that has the components along axes which another has along those known."""
    return sum((axis * dot(old, vector) for axis, old in zip(axes, known, strict=True)), mp.matrix(3, 1))


def _frame(p, q):
    """Return a frame of a line that changes little as the line tilts little."""
    x = unit(q - p)
    y = unit(cross(x, vector([1, 0, 0])))
    return [x, y, cross(x, y)]
