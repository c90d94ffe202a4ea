"""A warning of angle laws that are likely in degrees, once, when a file is read or a mechanism is first solved."""

from collections.abc import Iterator
from typing import Literal, NamedTuple
from weakref import WeakValueDictionary

import numpy as np

from jounce.constraints import AbstractConstraint
from jounce.constraints.facts import dimension_of_field
from jounce.errors import JounceError, UnitWarning, warn_caller
from jounce.mechanism.laws.driver_outputs import is_turning
from jounce.mechanism.laws.output_drivers import with_output_drivers
from jounce.mechanism.mechanism import Mechanism
from jounce.mechanism.resolve import resolve_motion
from jounce.trajectory import (
    AbstractMotion,
    Expression,
    ExpressionMotion,
    FollowingMotion,
    FunctionMotion,
    SplineMotion,
)
from jounce.trajectory.law_checks.unit_doubts import TURN, degrees_meant, looks_like_degrees, values_of

IN_SI = "A number without a unit is in SI"
_settled: WeakValueDictionary[int, AbstractConstraint] = WeakValueDictionary()


class DriverLaw(NamedTuple):
    """The law of a driver.

    Attributes
    ----------
    name : str
        Name of the driver.
    driver : AbstractConstraint
        The driver as given to the mechanism.
    law : AbstractMotion
        Its law with numbers in the place of parameters.
    """

    name: str
    driver: AbstractConstraint
    law: AbstractMotion


def laws_of_angles(mechanism: Mechanism) -> Iterator[DriverLaw]:
    """Yield the valid laws of drivers of angles; invalid laws are refused when used."""
    return laws_of(mechanism, "angle")


def laws_of(mechanism: Mechanism, dimension: Literal["angle", "length"]) -> Iterator[DriverLaw]:
    """Yield the valid laws of drivers of angles or of lengths; invalid laws are refused when used."""
    try:
        converted, parameters = with_output_drivers(mechanism), mechanism.parameter_values
    except JounceError:
        return
    for name, driver in converted.drivers.items():
        motion = getattr(driver, "motion", None)
        fits = is_turning(driver) if dimension == "angle" else dimension_of_field(driver, "motion") == dimension
        if motion is None or not fits:
            continue
        try:
            law = FunctionMotion(motion) if callable(motion) and not isinstance(motion, AbstractMotion) else motion
            law = law.resolved(parameters) if isinstance(law, AbstractMotion) else resolve_motion(law, parameters)
        except JounceError:
            continue
        yield DriverLaw(name, mechanism.drivers[name], law)


def degrees_doubt(law: AbstractMotion, first: float, last: float) -> str:
    """Return why an angle law is likely in degrees, by its values between two instants, s; an empty text if not."""
    values = values_of(law, first, last)
    if values is not None and (doubt := degrees_meant(values)):
        return doubt
    if (interval := _angle_of_leader(law)) and looks_like_degrees(interval):
        return f"goes on over {interval:g} rad of its leader, {interval / TURN:.2g} turns: degrees?"
    return ""


def names_angle(driver_law: DriverLaw, angles: frozenset[str] = frozenset()) -> bool:
    """Return whether a law is an expression with an angle unit, or with a parameter that is an angle."""
    if not isinstance(driver_law.law, ExpressionMotion) or not isinstance(
        getattr(driver_law.driver, "motion", None), Expression | str
    ):
        return False
    return "deg" in driver_law.law.expression.text or bool(angles & driver_law.law.expression.names)


def settle(driver: AbstractConstraint) -> None:
    """Mark the law of a driver as one that needs no further warning."""
    _settled[id(driver)] = driver


def warn_of_degrees(mechanism: Mechanism, first: float, last: float) -> None:
    """Warn of angle laws that are likely in degrees, once for each driver.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism about to be solved.
    first, last : float
        Interval of time, s.

    Warns
    -----
    UnitWarning
        With the name of the driver, the values of its law in the interval, and the unit that may be meant.
    """
    intervals = mechanism.checked_intervals
    if (first, last) in intervals:
        return
    intervals.add((first, last))
    for angle_law in laws_of_angles(mechanism):
        if _settled.get(id(angle_law.driver)) is angle_law.driver or names_angle(angle_law):
            continue
        if doubt := _constant_doubt(angle_law.law) or degrees_doubt(angle_law.law, first, last):
            settle(angle_law.driver)
            warn_caller(UnitWarning(f"drivers.{angle_law.name}.motion: {doubt} {IN_SI}"))


def _constant_doubt(law: AbstractMotion) -> str:
    """Return why an expression is likely in degrees, by its value at time zero; an empty text if it is not."""
    if not isinstance(law, ExpressionMotion) or "pi" in law.expression.text:
        return ""
    try:
        value = float(law.expression.evaluate({**law.parameters, "t": 0.0}))
    except (JounceError, TypeError, ValueError):  # the use of the law raises it
        return ""
    return number_doubt(value)


def number_doubt(value: float) -> str:
    """Return why a number in rad is likely in degrees; an empty text if it is not.

    Examples
    --------
    >>> number_doubt(45.0), number_doubt(1.5)
    ('45 rad is 7.2 turns: 45 deg?', '')
    """
    return f"{value:g} rad is {abs(value) / TURN:.2g} turns: {value:g} deg?" if looks_like_degrees(value) else ""


def _angle_of_leader(law: AbstractMotion) -> float | None:
    """Return the range of the leader coordinate over which a law is given; None without a leader or without ends."""
    if not isinstance(law, FollowingMotion) or not law.parts:
        return None
    motion = law.parts[0]
    return float(motion.stop) - float(np.asarray(motion.breakpoints)[0]) if isinstance(motion, SplineMotion) else None
