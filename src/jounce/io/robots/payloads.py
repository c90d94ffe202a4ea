"""Loads that a robot holds, given as ``LINK=MASS`` with units, also for a part of a motion."""

from __future__ import annotations

import re
from collections.abc import Iterable

from jounce.errors import JounceError, RobotError, UnitWarning, check_name, warn_caller
from jounce.rigid.inertia import Inertia
from jounce.robot.algorithms.carried_loads import CarriedLoad
from jounce.robot.robot import Robot
from jounce.units.assignments import assignments
from jounce.units.values import parse_value

OPTION = "--payload"
PLACE_FORMS = "instants such as 0.8 s, shares of a path such as 30 %, or waypoints such as 'waypoint 2'"


def with_payloads(robot: Robot, texts: Iterable[str]) -> Robot:
    """Return a robot that holds point masses at the origins of links.

    Parameters
    ----------
    robot : Robot
        Robot without the loads.
    texts : iterable of str
        Texts ``LINK=MASS``; the mass is a number in kg or a number with a unit.

    Raises
    ------
    RobotError
        If a link does not exist, a mass is not valid, or a load is for a part of a motion.

    Warns
    -----
    UnitWarning
        If a mass without a unit is larger than that of the robot.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0])
    >>> pendulum = jn.Robot("pendulum", [jn.Link("base"), jn.Link("rod", rod)], [jn.Joint("pin", "base", "rod")])
    >>> with_payloads(pendulum, ["rod=500 g"]).mass
    1.5
    """
    form = "a load is given by LINK=MASS, such as 'hand=3 kg'"
    for link, mass in assignments(texts, OPTION, form, RobotError).items():
        if "@" in mass:
            message = "a load that is carried for a part of a motion is for check, torques, retime and export only"
            raise RobotError(message, name=OPTION, value=f"{link}={mass}")
        try:
            robot = robot.with_payload(link, Inertia(_mass(robot, mass)))
        except JounceError as error:
            value = link if error.name == "link" else mass
            raise RobotError(error.message, name=OPTION, value=value) from None
    return robot


def parsed_loads(robot: Robot, texts: Iterable[str], *, moving: bool = False) -> list[CarriedLoad]:
    """Return loads that links carry during parts of a motion.

    Parameters
    ----------
    robot : Robot
        Robot with the links.
    texts : iterable of str
        Texts ``LINK=MASS@FROM:TO``. The ends are instants with a unit, shares of a path in percent, or ``waypoint
        NUMBER``, counted from 1; a missing one is the end of the motion.
    moving : bool, default False
        Whether the loads change while the robot moves.

    Raises
    ------
    RobotError
        If a link does not exist, or a mass or an end is not valid.

    Warns
    -----
    UnitWarning
        If a mass without a unit is larger than that of the robot.

    Examples
    --------
    >>> import jounce as jn
    >>> robot = jn.load_robot("examples/robots/panda.urdf")
    >>> [load.words for load in parsed_loads(robot, ["panda_hand=3 kg@0.8 s:2 s"])]
    ['panda_hand carries 3 kg from 0.8 s to 2 s']
    """
    form = f"a load for a part of a motion is given by LINK=MASS@FROM:TO, its ends {PLACE_FORMS}"
    loads = []
    for text in texts:
        link, _, range_text = (part.strip() for part in text.partition("="))
        mass, _, ends = (part.strip() for part in range_text.partition("@"))
        first, _, last = (part.strip() for part in ends.partition(":"))
        if not (link and mass and (first or last)):
            raise RobotError(form, name=OPTION, value=text)
        try:
            check_name("link", link, robot.links, RobotError, name="link")
            (start, by), (stop, other) = _place(first), _place(last)
            if by and other and by != other:
                raise RobotError("both ends are of one kind", name="place")
            loads.append(CarriedLoad(link, Inertia(_mass(robot, mass)), start, stop, by or other or "time", moving))  # type: ignore[arg-type]
        except JounceError as error:
            raise RobotError(error.message, name=OPTION, value=text) from None
    return loads


def _mass(robot: Robot, text: str) -> float:
    value = parse_value(text, "mass")
    mass = value.value
    assert isinstance(mass, float)  # expressions are evaluated, since no names are allowed
    if value.dimension is None and 0 < robot.mass < mass:
        hint = f"{mass:g} kg, more than the robot, which has {robot.mass:.3g} kg; grams need their unit: {mass:g} g"
        warn_caller(UnitWarning(f"{OPTION}: {hint}"))
    return mass


def _place(text: str) -> tuple[float | None, str | None]:
    """Return the value of an end of a load, and its kind; None for both if the text is empty."""
    if not text:
        return None, None
    if waypoint := re.fullmatch(r"waypoint\s*([0-9]+)", text):
        return float(waypoint[1]), "waypoint"
    if match := re.fullmatch(r"([0-9.]+)\s*%", text):
        try:
            return float(match[1]) / 100, "share"
        except ValueError:
            raise RobotError("is no number of percent", name="place") from None
    number = parse_value(text, "time").value
    assert isinstance(number, float)
    return number, "time"
