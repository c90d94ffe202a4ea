"""Loads that a robot holds, given from outside as ``LINK=MASS`` with units."""

from __future__ import annotations

from collections.abc import Iterable

from jounce.errors import JounceError, RobotError
from jounce.io.files.assignments import assignments
from jounce.rigid.inertia import Inertia
from jounce.robot.robot import Robot
from jounce.units.values import parse_value


def with_payloads(robot: Robot, texts: Iterable[str]) -> Robot:
    """Return a robot that holds point masses in the origins of links.

    Parameters
    ----------
    robot : Robot
        The robot without them.
    texts : iterable of str
        ``LINK=MASS``, the mass a number in kg or a number with a unit.

    Raises
    ------
    RobotError
        There is no such link, or no such mass.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0])
    >>> pendulum = jn.Robot("pendulum", [jn.Link("base"), jn.Link("rod", rod)], [jn.Joint("pin", "base", "rod")])
    >>> with_payloads(pendulum, ["rod=500 g"]).mass
    1.5
    """
    form = "a load is given by LINK=MASS, such as 'hand=3 kg'"
    for link, mass in assignments(texts, "--payload", form, RobotError).items():
        try:
            number = parse_value(mass, "mass").value
            assert isinstance(number, float)  # no names are allowed, so that expressions are worked out
            robot = robot.with_payload(link, Inertia(number))
        except JounceError as error:
            value = link if error.name == "link" else mass
            raise RobotError(error.message, name="--payload", value=value) from None
    return robot
