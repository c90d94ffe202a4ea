"""Laws of angles that are likely in degrees: a warning, once, when a file is read or a mechanism is first solved."""

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
    driver : AbstractConstraint
        As the mechanism was given it.
    law : AbstractMotion
        With numbers in the place of parameters.
    """

    name: str
    driver: AbstractConstraint
    law: AbstractMotion


def laws_of_angles(mechanism: Mechanism) -> Iterator[DriverLaw]:
    """Yield the laws of drivers that turn something, without invalid ones, which their use refuses."""
    return laws_of(mechanism, "angle")


def laws_of(mechanism: Mechanism, dimension: Literal["angle", "length"]) -> Iterator[DriverLaw]:
    """Yield the laws of drivers that turn or move something, without invalid ones, which their use refuses."""
    try:
        held, parameters = with_output_drivers(mechanism), mechanism.parameter_values
    except JounceError:
        return
    for name, driver in held.drivers.items():
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
    """Say why the law of an angle is likely in degrees, by its values from a first to a last instant, s; or nothing."""
    values = values_of(law, first, last)
    if values is not None and (why := degrees_meant(values)):
        return why
    if (interval := _angle_of_leader(law)) and looks_like_degrees(interval):
        return f"goes on over {interval:g} rad of its leader, {interval / TURN:.2g} turns: degrees?"
    return ""


def names_angle(of: DriverLaw, angles: frozenset[str] = frozenset()) -> bool:
    """Tell whether a law is a formula with a unit of an angle, or with one of the parameters that are angles."""
    if not isinstance(of.law, ExpressionMotion) or not isinstance(getattr(of.driver, "motion", None), Expression | str):
        return False
    return "deg" in of.law.expression.text or bool(angles & of.law.expression.names)


def settle(driver: AbstractConstraint) -> None:
    """Note that the law of a driver needs no further warning."""
    _settled[id(driver)] = driver


def warn_of_degrees(mechanism: Mechanism, first: float, last: float) -> None:
    """Warn of laws of angles that are likely in degrees, once for each driver.

    Parameters
    ----------
    mechanism : Mechanism
        About to be solved.
    first, last : float
        s.

    Warns
    -----
    UnitWarning
        With the name of the driver, what its law is over the run, and the unit that may be meant.
    """
    intervals = mechanism.checked_intervals
    if (first, last) in intervals:
        return
    intervals.add((first, last))
    for angle_law in laws_of_angles(mechanism):
        if _settled.get(id(angle_law.driver)) is angle_law.driver or names_angle(angle_law):
            continue
        if why := _constant_doubt(angle_law.law) or degrees_doubt(angle_law.law, first, last):
            settle(angle_law.driver)
            warn_caller(UnitWarning(f"drivers.{angle_law.name}.motion: {why} {IN_SI}"))


def _constant_doubt(law: AbstractMotion) -> str:
    """Say why a formula is likely in degrees, by its value at time zero; or nothing."""
    if not isinstance(law, ExpressionMotion) or "pi" in law.expression.text:
        return ""
    try:
        value = float(law.expression.evaluate({**law.parameters, "t": 0.0}))
    except (JounceError, TypeError, ValueError):  # the use of the law raises it
        return ""
    return number_doubt(value)


def number_doubt(value: float) -> str:
    """Word why a number of rad is likely one of degrees; nothing if it is not.

    Examples
    --------
    >>> number_doubt(45.0), number_doubt(1.5)
    ('45 rad is 7.2 turns: 45 deg?', '')
    """
    return f"{value:g} rad is {abs(value) / TURN:.2g} turns: {value:g} deg?" if looks_like_degrees(value) else ""


def _angle_of_leader(law: AbstractMotion) -> float | None:
    """Return over which part of its leader's way a law is given, None where it follows none, or has no ends."""
    if not isinstance(law, FollowingMotion) or not law.parts:
        return None
    own = law.parts[0]
    return float(own.stop) - float(np.asarray(own.breakpoints)[0]) if isinstance(own, SplineMotion) else None
