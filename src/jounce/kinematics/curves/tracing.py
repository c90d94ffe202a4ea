"""A mechanism's curve of configurations from its starting guess; options of those who ask for it."""

import math
import numbers
from typing import Any

from jounce.errors import MechanismError
from jounce.kinematics.curves.curve import Curve, CurveSettings
from jounce.kinematics.curves.path import track_both_directions
from jounce.kinematics.curves.start import freed, start_of_curve
from jounce.mechanism import Mechanism
from jounce.mechanism.time import first_instant


def traced(mechanism: Mechanism, instant: float, driver: str | None, settings: CurveSettings | None = None) -> Curve:
    """Return the curve through the starting guess."""
    settings = settings or CurveSettings()
    free = freed(mechanism, instant, driver)
    tracker, start = start_of_curve(free)
    return Curve(mechanism, free, tracker, track_both_directions(tracker, start, settings.length), settings)


def check_number(name: str, value: Any, least: Any, most: Any) -> None:
    """Raise MechanismError unless an option is a finite number between bounds."""
    fits = isinstance(value, numbers.Real) and not isinstance(value, bool) and math.isfinite(float(value))
    if not fits or not least <= value <= most:
        bounds = "" if not math.isfinite(most) else f" from {least:g} to {most:g}"
        raise MechanismError(f"must be a finite number{bounds}", name=name, value=value)


def instant_of(mechanism: Mechanism, time: Any) -> float:
    """Return an instant that was given, or the first of a mechanism's own time, s."""
    if time is None:
        return first_instant(mechanism.time, mechanism.parameter_values)
    check_number("time", time, -math.inf, math.inf)
    return float(time)
