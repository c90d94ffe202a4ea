"""Cams: joints that hold one coordinate to a law of another, with forces on both."""

import dataclasses
from collections.abc import Sequence
from typing import Any

from jounce.base.modules import belongs_to_package, field
from jounce.constraints.angles import upright
from jounce.constraints.base import AbstractConstraint, MotionLaw, Part, rows
from jounce.constraints.drivers import CoordinateDriver, RotationDriver, SlideDriver, SpatialSlideDriver
from jounce.constraints.facts import facts_of
from jounce.errors import MechanismError
from jounce.jet import Jet, wrap

AT_REST = 0.0  # law of a driver that only provides its coordinate


class Cam(AbstractConstraint):
    """A cam: one coordinate follows a law of another.

    The residual is the coordinate of the follower minus the law of that of the leader. The leader thus bears the force
    on the follower times the slope of the law, whatever moves it. An angle in space is that of a body about the axis of
    its hinge. Attitudes determine it up to whole turns. A leading angle is therefore a separate coordinate, that of a
    massless carriage, which counts turns; a following angle may differ by whole turns.

    Parameters
    ----------
    follower : AbstractConstraint
        A driver that defines the following coordinate; its law has the coordinate of the leader in place of time.
    leader : AbstractConstraint
        The leading element: a driver, whose coordinate counts and not its law; or a joint that turns or slides.
    of : str, optional
        Name of the leader in a file.

    Raises
    ------
    MechanismError
        If one of them has no coordinate, or is of a user's class.

    Examples
    --------
    >>> import jounce as jn
    >>> axle = jn.planar.Revolute(("ground", "shaft"), [0, 0], [0, 0])
    >>> lift = jn.drivers.CoordinateDriver(("ground", "valve"), "y", motion="0.02*(1 - cos(t))")
    >>> jn.joints.Cam(lift, axle).bodies
    ('ground', 'valve', 'shaft')
    """

    follower: Part
    motion: MotionLaw
    leader: Part
    of: str = field(static=True, default="")
    slots: tuple[tuple[int, ...], ...] = field(static=True, default=((), ()))
    unit: Any = field(default=None, init=False)  # displacement of the carriage per rad, m: the size of the mechanism

    body_counts = (2, 3, 4)
    symbol = "none"

    def __init__(
        self,
        follower: Any,
        leader: Any,
        of: str = "",
        *,
        motion: Any = None,
        bodies: Sequence[str] | None = None,
        slots: Any = None,
    ):
        if getattr(follower, "role", "") != "driver" or not hasattr(follower, "motion"):
            raise MechanismError("must be a driver, whose law is that of the cam", name="follower", value=follower)
        self.motion = follower.motion if motion is None else motion
        follower = coordinate_of_element(follower, "follower")
        leader = coordinate_of_element(leader, "leader")
        names = tuple(dict.fromkeys((*follower.bodies, *leader.bodies)))
        self.slots = tuple(tuple(names.index(body) for body in part.bodies) for part in (follower, leader))
        self.bodies = names if bodies is None else tuple(bodies)
        self.follower, self.leader = (
            _between(part, [self.bodies[k] for k in indices])
            for part, indices in zip((follower, leader), self.slots, strict=True)
        )
        self.of = of

    @property
    def hidden(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The counted angle of a leader that turns in space."""
        return ("turn",) if turns_in_space(self.leader) else ()

    def evaluate(self, *bodies: Any) -> Jet:
        """Return the coordinate of the follower."""
        return self.follower.evaluate(*(bodies[k] for k in self.slots[0]))

    def residual(self, *bodies_and_time: Any) -> Jet:
        *bodies, _ = bodies_and_time
        leading, residuals = self.leader.evaluate(*(bodies[k] for k in self.slots[1])), []
        if self.hidden:
            along, aside, unit = bodies[-1].position
            size = 1.0 if self.unit is None else self.unit
            turn = along / size
            residuals = [wrap(leading - turn), aside, unit - size, *upright(bodies[-1])]
            leading = turn
        excess = self.evaluate(*bodies) - self.motion(leading)
        excess = wrap(excess) if turns_in_space(self.follower) else excess
        return rows(excess, *residuals) if residuals else excess


def turns_in_space(part: Any) -> bool:
    """Return whether a follower or leader is an angle about an axis in space, determined up to whole turns."""
    return hasattr(part, "datum")


def coordinate_of_element(element: Any, name: str = "leader") -> Any:
    """Return a driver, without a law, for the coordinate of a driver, or of a joint that turns or slides.

    Parameters
    ----------
    element : AbstractConstraint
        An element of this package.
    name : str
        Name of the element, for messages.

    Raises
    ------
    MechanismError
        If it has no coordinate, or one that no cam can follow.

    Examples
    --------
    >>> from jounce.constraints import planar
    >>> pin = planar.Revolute(("ground", "crank"), [0, 0], [0, 0])
    >>> coordinate_of_element(pin).coordinate
    'angle'
    """
    if isinstance(element, Cam):
        element = element.follower
    kind, bodies = type(element), getattr(element, "bodies", ())
    if not isinstance(element, AbstractConstraint) or not belongs_to_package(kind.residual):
        message = "must be a driver, or a joint that turns or slides, of this package"
        raise MechanismError(f"{message}; for any other law, write a joint of your own", name=name, value=element)
    if element.role == "driver" and hasattr(element, "evaluate"):
        return dataclasses.replace(element, motion=AT_REST)
    pair = facts_of(kind).pair
    if pair == "revolute":
        return CoordinateDriver(bodies, "angle", AT_REST)
    if pair == "prismatic":
        return SlideDriver(bodies, element.point_i, element.point_j, element.vector_i, AT_REST)
    if kind.space == "spatial" and kind.type_name == "prismatic":
        return SpatialSlideDriver(bodies, element.point_i, element.point_j, element.axis_i, AT_REST)
    if kind.space == "spatial" and kind.type_name == "revolute":
        return RotationDriver(bodies, element.axis_i, AT_REST)
    message = "has no coordinate that a cam could follow; name a driver, a pin, a slide, or an output"
    raise MechanismError(message, name=name, value=kind.type_name or kind.__name__)


def _between(element: Any, bodies: Sequence[str]) -> Any:
    """Return an element with renamed bodies."""
    return element if element.bodies == tuple(bodies) else dataclasses.replace(element, bodies=tuple(bodies))
