"""Messages about a motion that runs into a dead point: where its driver turns back, and where the branch leads."""

import math

import numpy as np

from jounce.errors import JounceError
from jounce.kinematics.curves.branches import trace
from jounce.kinematics.curves.curve import Curve
from jounce.kinematics.curves.start import TIME, law_values, posed
from jounce.kinematics.results.motion import Motion
from jounce.kinematics.status import Status
from jounce.mechanism import with_output_drivers
from jounce.mechanism.laws.output_drivers import output_laws

ENDS = (Status.SINGULAR, Status.NOT_CONVERGED, Status.COLLAPSED)
LENGTH = 40.0  # of the curve that is traced for the other branch
NEAR = 1e-9  # relative to the value: distance of an instant from a dead point that counts as reached


def dead_end_words(motion: Motion, index: int) -> str:
    """Describe the dead point that ends a motion before an instant, and the other branch; or return an empty string.

    The curve of configurations is traced from the last instant that was solved.
    """
    mechanism = with_output_drivers(motion.mechanism)
    drivers = mechanism.drivers
    if not drivers or index == 0 or motion.status[index] not in ENDS or motion.status[index - 1] != Status.OK:
        return ""
    before, instant = float(motion.time[index - 1]), float(motion.time[index])
    _, coordinates = motion.poses
    last_solved = posed(mechanism, {name: np.asarray(c)[0, ..., index - 1] for name, c in coordinates.items()})
    name = next(iter(drivers)) if len(drivers) == 1 else TIME
    try:
        target = instant if name == TIME else law_values(mechanism, instant)[name]
        curve = trace(last_solved, before, driver=name, order=0, count=2, length=LENGTH)
    except JounceError:
        return ""  # the message already names the failure
    end = _end_before(curve, target)
    if end is None:
        return ""
    value, other = end
    if name == TIME:
        values = law_values(mechanism, value)
        text = ", ".join(f"{driver} = {x:.9g}" for driver, x in values.items())
        return (
            f"its drivers lead it to a dead point at t = {value:.9g} s, where {text}: from there they can only go back"
        )
    hint = "" if other is None else f", on another branch, which leads to {_words(other, curve.unit)}"
    laws = output_laws(motion.mechanism)
    if name in laws:
        return (
            f"{laws[name].output} can go no further than {_words(value, curve.unit)}: there it does not determine the "
            f"driver {name}, which goes on past this dead point while it turns back"
        )
    return f"{name} can go no further than {_words(value, curve.unit)}: past this dead point it turns back{hint}"


def _end_before(curve: Curve, target: float) -> tuple[float, float | None] | None:
    """Return the end of a driver's range that keeps it from a value, and the far end of the branch beyond it."""
    low, high = curve.range
    slack = NEAR * max(abs(low), abs(high), 1e-300)
    upwards = target >= high - slack
    if not np.isfinite(low) or not (upwards or target <= low + slack) or not curve.turning_points:
        return None
    value = high if upwards else low
    limits = [x.value for x in curve.turning_points]
    if not any(abs(x - value) <= slack for x in limits):
        return None  # the curve was traced no further
    branches = [b for b in curve.branches[1:] if abs((b.high if upwards else b.low) - value) <= slack]
    ends = [b.low if upwards else b.high for b in branches]
    return value, next((x for x in ends if any(abs(x - y) <= slack for y in limits)), None)


def _words(value: float, unit: str) -> str:
    return f"{math.degrees(value):.9g} deg" if unit == "rad" else f"{value:.9g} {unit}".rstrip()
