"""The coordinates of drivers as outputs, measured on the bodies."""

from typing import Any

from jounce.base.modules import field
from jounce.constraints.facts import dimension_of_field, stem_of, value_fields
from jounce.errors import MechanismError, check_name
from jounce.mechanism.outputs.base import AbstractMotionOutput


def is_turning(driver: Any) -> bool:
    """Return whether the law of a driver is an angle, so that the driver exerts a torque.

    A class that does not state the dimension of its law drives an angle if it has no points.
    """
    dimension = dimension_of_field(driver, "motion")
    if dimension != "any":
        return dimension == "angle"
    return not any(stem_of(field) == "point" for field in value_fields(type(driver)))


class _DriverCoordinateOutput(AbstractMotionOutput):
    driver: str = field(static=True)

    source = "driver"

    def check(self, mechanism: Any) -> None:
        """Raise MechanismError unless the driver exists, its class defines its coordinate, and the unit fits."""
        check_name("driver", self.driver, mechanism.drivers, MechanismError, name="driver")
        driver = mechanism.drivers[self.driver]
        if not hasattr(driver, "evaluate"):
            message = "the class of this driver does not define its coordinate; give it a method evaluate"
            raise MechanismError(message, name="driver", value=self.driver)
        if is_turning(driver) != (self.unit == "rad"):
            word = "an angle" if is_turning(driver) else "a displacement"
            raise MechanismError(f"the coordinate of this driver is {word}", name="quantity")

    def coefficients(self, motion: Any) -> Any:
        """Return the Taylor coefficients of the coordinate, (order + 1, 1, time)."""
        return motion.driver_coefficients(self.driver)


class DriverAngleOutput(_DriverCoordinateOutput):
    """Coordinate of a driver of an angle, rad, measured on the bodies; also if the driver follows from an output."""

    unit = "rad"


class DriverDisplacementOutput(_DriverCoordinateOutput):
    """Coordinate of a driver of a length, m, measured on the bodies; also if the driver follows from an output."""
