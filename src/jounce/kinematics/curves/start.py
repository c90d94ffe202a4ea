"""The start of a curve of configurations: an assembled mechanism with one free driver."""

import dataclasses
import math
import numbers
from typing import Any

import numpy as np

from jounce.base.modules import with_fields
from jounce.constraints.facts import dimension_of_field, field_kinds
from jounce.errors import MechanismError, MobilityError, SingularityError, check_name
from jounce.execution.device import resident
from jounce.jet import Jet
from jounce.kinematics.assembly.assemble import check_assembled, find_assembly, freely_moving
from jounce.kinematics.curves.path_tracker import CurvePoint, PathTracker
from jounce.mechanism import Mechanism, build
from jounce.mechanism.time import first_instant
from jounce.trajectory import ExpressionMotion

TIME = "time"
TOLERANCE = 1e-12
VANISHING = 1e-9  # half the second derivatives along directions of one radian, below which they count as zero


@dataclasses.dataclass(frozen=True)
class Freed:
    """A mechanism with one free driver.

    Attributes
    ----------
    mechanism : Mechanism
        The mechanism with the free value in place of time, the other drivers held.
    driver : str or None
        The free driver; ``"time"`` if the instant is free and all drivers follow their laws, None if nothing is driven.
    value : float
        Initial value, rad, m or s.
    unit : str
        Unit of the value.
    """

    mechanism: Mechanism
    driver: str | None
    value: float
    unit: str


def freed(mechanism: Mechanism, instant: float, driver: str | None) -> Freed:
    """Return a mechanism with the value of one driver free.

    Parameters
    ----------
    mechanism : Mechanism
        Driven, or with one degree of freedom.
    instant : float
        Instant at which the other drivers are held, s.
    driver : str or None
        The driver to free, or None for the only one; ``"time"`` for the instant.

    Raises
    ------
    MechanismError
        If none of several drivers is named, or the name does not exist.
    """
    kind = "drivers" if mechanism.drivers else "initial"
    elements = getattr(mechanism, kind)
    if driver == TIME and TIME not in elements and elements:
        return Freed(_driven(mechanism, elements), TIME, instant, "s")
    if driver is not None:
        check_name("driver", driver, tuple(elements), MechanismError, name="driver")
    if not elements:
        return Freed(mechanism, None, 0.0, "")
    if driver is None:
        if len(elements) > 1:
            message = f"there are several drivers, {', '.join(elements)}: name the one whose value is to be free"
            raise MechanismError(message, name="driver", value=None)
        driver = next(iter(elements))
    values = law_values(_driven(mechanism, elements), instant)
    laws = {name: _with_law(x, "t" if name == driver else repr(values[name])) for name, x in elements.items()}
    unit = {"angle": "rad", "length": "m"}.get(dimension_of_field(elements[driver], "motion"), "")
    return Freed(_driven(mechanism, laws), driver, values[driver], unit)


def _driven(mechanism: Mechanism, drivers: Any) -> Mechanism:
    return dataclasses.replace(mechanism, drivers=drivers, initial={})


def law_values(mechanism: Mechanism, instant: float) -> dict[str, float]:
    """Return the values that the laws of all drivers prescribe at an instant, by name."""
    model = build(mechanism)
    groups = [group for group in model.system.groups if group.is_driver]
    values = []
    for group in groups:
        value = group.element.motion(Jet([np.full((1, 1), instant)])).coefficients[0]
        values += np.broadcast_to(value, (group.instances, 1))[:, 0].tolist()
    return {name.partition(".")[2]: value for name, value in zip(model.drivers, values, strict=True)}


def _with_law(driver: Any, text: str) -> Any:
    fields = [name for name, kind in field_kinds(type(driver)).items() if kind == "motion"]
    if fields != ["motion"]:
        raise MechanismError(
            "a driver whose value is free needs one law, its field motion", name="driver", value=fields
        )
    return dataclasses.replace(driver, motion=ExpressionMotion(text))


def start_of_curve(free: Freed) -> tuple[PathTracker, CurvePoint]:
    """Return the path tracker of a mechanism, and the starting point of its curve.

    Raises
    ------
    AssemblyError
        If the bodies cannot be assembled.
    MobilityError
        If there is not exactly one degree of freedom.
    SingularityError
        If the start is a change point.
    """
    model = build(free.mechanism)
    if not model.rows:
        raise MobilityError(f"the mechanism has no joints: {model.system.shape[1]} degrees of freedom are left")
    model, attempt = find_assembly(model, free.value, TOLERANCE)
    driven = free.driver is not None
    check_assembled(model, attempt, free.value, free=not driven)
    system = resident(with_fields(model.system, row_scale=attempt.scale[:, None]))
    model = dataclasses.replace(model, system=system)
    tracker = PathTracker(model, driven, timed=free.driver == TIME)
    point = tracker.point_without_series(attempt.coordinates, free.value)
    _check_freedom(tracker, point)
    tracker = tracker.scaled_at(point)
    return tracker, tracker.with_series(point)


def _check_freedom(tracker: PathTracker, point: CurvePoint) -> None:
    """Raise an error unless the curve has exactly one direction at its start."""
    jacobian = point.jacobian
    null = tracker.null_space(jacobian)
    if null.shape[1] == 1:
        return
    if not null.shape[1]:
        message = "nothing can move: with the driver free, joints and drivers leave no degree of freedom"
        raise MobilityError(message if tracker.driven else "nothing can move: the joints leave no degree of freedom")
    missing = jacobian.shape[1] - jacobian.shape[0]
    rows = tracker.left_null_space(jacobian)
    # degrees of freedom, if not even the second order blocks a direction
    if missing > 1 or np.max(np.abs(rows.T @ tracker.second_order(point, null)), initial=0.0) < VANISHING:
        count = null.shape[1]
        directions = null[: tracker.columns].T
        message = (
            f"a curve needs one degree of freedom, and {'with the driver free ' if tracker.driven else ''}there are "
            f"{count}, with which {freely_moving(tracker.model, directions)} can move: add drivers, which are held, "
            "and name the one that is free"
        )
        raise MobilityError(message)
    raise SingularityError(
        "the start is a change point, where branches cross, so that no one curve starts there: start at another instant"
    )


def check_number(name: str, value: Any, lowest: Any, highest: Any) -> None:
    """Raise MechanismError unless an option is a finite number within bounds."""
    fits = isinstance(value, numbers.Real) and not isinstance(value, bool) and math.isfinite(float(value))
    if not fits or not lowest <= value <= highest:
        bounds = "" if not math.isfinite(highest) else f" from {lowest:g} to {highest:g}"
        raise MechanismError(f"must be a finite number{bounds}", name=name, value=value)


def instant_of(mechanism: Mechanism, time: Any) -> float:
    """Return a given instant, or by default the first of a mechanism's own time, s."""
    if time is None:
        return first_instant(mechanism.time, mechanism.parameter_values)
    check_number("time", time, -math.inf, math.inf)
    return float(time)


def posed(mechanism: Mechanism, coordinates: dict[str, np.ndarray]) -> Mechanism:
    """Return a mechanism with coordinates, the ground first, as the starting guesses of its bodies."""
    bodies = {}
    for k, (name, body) in enumerate(mechanism.bodies.items(), start=1):
        given: dict[str, Any] = {"position": coordinates["position"][:, k].tolist()}
        if "angle" in coordinates:
            given["angle"] = float(coordinates["angle"][k])
        else:
            given["orientation"] = coordinates["quaternion"][:, k].tolist()
        bodies[name] = dataclasses.replace(body, **given)
    return dataclasses.replace(mechanism, bodies=bodies, assembly=None)
