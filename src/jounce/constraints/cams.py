"""Cams: joints that hold a coordinate to a law of another one, and react on both."""

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

AT_REST = 0.0  # the law of a driver of which the coordinate alone is meant


class Cam(AbstractConstraint):
    """A coordinate is a law of another one: a cam, which presses its follower and is pressed by it.

    The residual is the coordinate of the follower less the law of that of the leader. So the leader bears the force on
    the follower times the slope of the law, whatever moves it. An angle in space is that of a body about an axis by
    which it is hinged. Attitudes tell it up to whole turns: an angle that leads is therefore a coordinate of its own,
    that of a carriage without mass, which counts them, and an angle that follows may have gone whole turns.

    Parameters
    ----------
    follower : AbstractConstraint
        A driver, which says what follows, and by its law how: the coordinate of the leader takes the place of the time.
    leader : AbstractConstraint
        What is followed: a driver, of which the coordinate counts and not the law; or a joint that turns or slides.
    of : str, optional
        The name of the leader in a file.

    Raises
    ------
    MechanismError
        If one of them has no coordinate, or is a class of a user's own.

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
    unit: Any = field(default=None, init=False)  # m, by which the carriage moves with a rad: the size of all

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
            _between(part, [self.bodies[k] for k in its])
            for part, its in zip((follower, leader), self.slots, strict=True)
        )
        self.of = of

    @property
    def hidden(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The angle of a leader that turns in space, with its whole turns."""
        return ("turn",) if turns_in_space(self.leader) else ()

    def evaluate(self, *bodies: Any) -> Jet:
        """Return the coordinate of the follower."""
        return self.follower.evaluate(*(bodies[k] for k in self.slots[0]))

    def residual(self, *bodies_and_time: Any) -> Jet:
        *bodies, _ = bodies_and_time
        leading, held = self.leader.evaluate(*(bodies[k] for k in self.slots[1])), []
        if self.hidden:
            along, aside, unit = bodies[-1].position
            size = 1.0 if self.unit is None else self.unit
            turn = along / size
            held = [wrap(leading - turn), aside, unit - size, *upright(bodies[-1])]
            leading = turn
        excess = self.evaluate(*bodies) - self.motion(leading)
        excess = wrap(excess) if turns_in_space(self.follower) else excess
        return rows(excess, *held) if held else excess


def turns_in_space(part: Any) -> bool:
    """Tell whether the follower or the leader of a cam is an angle about an axis, known up to whole turns."""
    return hasattr(part, "datum")


def coordinate_of_element(element: Any, name: str = "leader") -> Any:
    """Return a driver without a law that has the coordinate of a driver, or of a joint that turns or slides.

    Parameters
    ----------
    element : AbstractConstraint
        Of this package.
    name : str
        What it is, for messages.

    Raises
    ------
    MechanismError
        If it has no coordinate, or one that a cam does not follow.

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
    """Return an element between bodies of other names."""
    return element if element.bodies == tuple(bodies) else dataclasses.replace(element, bodies=tuple(bodies))
