"""Ropes: lines of constant length through points of bodies, in the plane and in space."""

from itertools import pairwise
from typing import Any

from jounce.base.modules import field
from jounce.base.shapes import Numbers
from jounce.constraints.base import AbstractConstraint, Points, Scalar
from jounce.errors import MechanismError
from jounce.jet import Jet, sqrt
from jounce.jet.algebra import total


class Rope(AbstractConstraint, type="rope"):
    """Rope, cable or string of constant length that runs without friction through points of bodies in the given order.

    The distances between successive points add up to the length. A block and tackle is a rope through a point of the
    moving block and one of the ground in turn. The multiplier is the tension, the same all along: positive where the
    rope pulls, negative where it would have to push and is therefore slack.

    Parameters
    ----------
    bodies : tuple of str
        Names of the bodies in the order of the points; a body may occur several times.
    points : sequence of sequence of float
        One point on each of these bodies, in its frame, m.
    length : float
        Length of the whole rope between its ends, m.

    Raises
    ------
    MechanismError
        If a rope has fewer than two bodies, or all points are on one body.

    Examples
    --------
    >>> import jounce as jn
    >>> weights = ("a", "ground", "ground", "b")
    >>> jn.joints.Rope(weights, [[0, 0], [-0.1, 0], [0.1, 0], [0, 0]], length=1.2).bodies
    ('a', 'ground', 'ground', 'b')
    """

    points: Points  # m, one on each body in its frame
    length: Scalar  # m
    slots: tuple[int, ...] = field(static=True, default=(), init=False)  # slot of each point, if bodies repeat

    body_counts = range(2, 101)
    may_repeat = True
    symbol = "rope"

    def __check_init__(self):
        if len(set(self.bodies)) < 2:
            message = "a rope joins two or more bodies, but all its points are on one"
            raise MechanismError(message, name="bodies", value=list(self.bodies))

    def residual(self, *bodies_and_time: Any) -> Jet:
        """Return the excess of the sum of distances over the length, m."""
        *bodies, _ = bodies_and_time
        points = [bodies[slot].point(self.points[k]) for k, slot in enumerate(self.slots or range(len(bodies)))]
        segments = [after - before for before, after in pairwise(points)]
        return total(sqrt(segment.dot(segment)) for segment in segments) - self.length

    def line_force(self) -> float:
        """Return the tension, N, per multiplier."""
        return 1.0

    def first_on(self, slot: int) -> Numbers:
        """Return the first point on the body in a slot, in its frame, m."""
        return self.points[(self.slots or tuple(range(len(self.points)))).index(slot)]


def distinct(bodies: tuple[str, ...]) -> tuple[tuple[str, ...], tuple[int, ...]]:
    """Return the bodies without repetition, and the slot of each among them.

    Examples
    --------
    >>> distinct(("a", "ground", "ground", "b"))
    (('a', 'ground', 'b'), (0, 1, 1, 2))
    """
    names = tuple(dict.fromkeys(bodies))
    return names, tuple(map(names.index, bodies))


def shares_points(element: Any) -> bool:
    """Return whether an element has several points on one body."""
    return isinstance(element, Rope) and len(set(element.bodies)) < len(element.bodies)
