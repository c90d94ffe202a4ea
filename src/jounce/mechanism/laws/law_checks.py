"""Checks of the laws of a mechanism at the requested instants, before the solution."""

from collections.abc import Iterator

import numpy as np

from jounce.constraints import AbstractConstraint
from jounce.constraints.base import value_fields
from jounce.errors import JounceError, SampleWarning, warn_caller
from jounce.forces import AbstractForce, TimeLaw, VectorLaw
from jounce.mechanism.laws.angle_laws import warn_of_degrees
from jounce.mechanism.laws.cam_laws import cams_in_time
from jounce.mechanism.mechanism import Mechanism
from jounce.trajectory import AbstractMotion, SplineMotion
from jounce.trajectory.sample_errors import unsupported_derivative, unsupported_words

_PLAIN = frozenset((float, int, str, type(None), np.ndarray))  # no law


def check_laws(mechanism: Mechanism, instants: np.ndarray, order: int, *, forces: bool) -> None:
    """Raise an error if laws end before the instants do, and warn if samples do not support the derivatives.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism about to be solved.
    instants : ndarray of shape (time,)
        Instants, s, in any order.
    order : int
        Highest derivative of the motion.
    forces : bool
        Whether the applied forces matter for the result.

    Raises
    ------
    MechanismError
        If a law through samples is not defined at some of the instants.

    Warns
    -----
    UnitWarning
        If a law of an angle is likely in degrees, once for each driver.
    SampleWarning
        If the estimated error of a derivative of samples exceeds a tenth of its peak, as for a `JointTrajectory`.
    """
    first, last = float(np.min(instants)), float(np.max(instants))
    warn_of_degrees(mechanism, first, last)
    start = float(instants[0])
    parts = [("drivers", first, last, order)]
    if forces:
        parts += [("initial", start, start, 1), ("forces", first, last, order - 2)]
    for kind, lower, upper, orders in parts:
        for name, element in getattr(mechanism, kind).items():
            for field, law in _motions(element):
                location = f"{kind}.{name}.{field}"
                try:
                    law = law.resolved(mechanism.parameter_values)
                    law.check_instants(lower, upper)
                except JounceError as error:
                    raise error.located(name=location) from None
                if orders >= 0 and isinstance(law, SplineMotion):
                    _warn(location, law, orders)
    for name, law in cams_in_time(mechanism):
        location = f"joints.{name}.motion"
        try:
            law.check_instants(first, last)
        except JounceError as error:
            raise error.located(name=location) from None
        if isinstance(law.parts[0], SplineMotion):
            _warn(location, law.parts[0], order)


def _motions(element: AbstractConstraint | AbstractForce) -> Iterator[tuple[str, AbstractMotion]]:
    """Yield the motion laws among the values of a driver or a force, with their fields."""
    for field in value_fields(type(element)):
        value = getattr(element, field)
        if type(value) in _PLAIN:
            continue
        entries = (
            value.parts if isinstance(value, VectorLaw) else value if isinstance(value, list | tuple) else (value,)
        )
        for entry in entries:
            law = entry.motion if isinstance(entry, TimeLaw) else entry
            if isinstance(law, AbstractMotion):
                yield field, law


def _warn(location: str, law: SplineMotion, order: int) -> None:
    """Warn of the lowest derivative that the samples of a law do not support."""
    if (doubt := unsupported_derivative(law.errors, order)) is not None:
        warn_caller(SampleWarning(unsupported_words(location, *doubt, law)))
