"""Drivers that hold outputs to laws, in the place of drivers whose laws then follow from the motion."""

import dataclasses
from collections.abc import Mapping
from typing import Any

from jounce.constraints import AbstractConstraint
from jounce.constraints.drivers import (
    CoordinateDriver,
    DistanceDriver,
    RotationDriver,
    SlideDriver,
    SpatialDistanceDriver,
    SpatialSlideDriver,
)
from jounce.errors import MechanismError, no_such
from jounce.mechanism.mechanism import GROUND, Mechanism
from jounce.mechanism.outputs.base import (
    AbstractMotionOutput,
    AbstractQuantity,
    AngleOutput,
    DistanceOutput,
    PlanarRelativeAngleOutput,
    PointOutput,
    RelativeAngleOutput,
)
from jounce.mechanism.system import POSITION_COMPONENTS
from jounce.trajectory import OutputMotion


def output_laws(mechanism: Mechanism) -> dict[str, OutputMotion]:
    """Return the laws of outputs from which drivers follow, by driver."""
    motions = {name: getattr(driver, "motion", None) for name, driver in mechanism.drivers.items()}
    return {name: motion for name, motion in motions.items() if isinstance(motion, OutputMotion)}


def with_outputs(mechanism: Mechanism, outputs: Mapping[str, AbstractQuantity]) -> Mechanism:
    """Return the mechanism with other outputs, and with those of its own outputs that drivers follow."""
    names = {motion.output for motion in output_laws(mechanism).values()}
    names |= {name.rpartition("_")[0] for name in names}
    followed_outputs = {name: output for name, output in mechanism.outputs.items() if name in names}
    return dataclasses.replace(mechanism, outputs={**followed_outputs, **outputs})


def without_output_laws(mechanism: Mechanism) -> Mechanism:
    """Return the mechanism with zero laws for the drivers that follow from outputs."""
    drivers = {name: dataclasses.replace(mechanism.drivers[name], motion=0.0) for name in output_laws(mechanism)}
    return dataclasses.replace(mechanism, drivers={**mechanism.drivers, **drivers}) if drivers else mechanism


def with_output_drivers(mechanism: Mechanism) -> Mechanism:
    """Return the mechanism with output drivers in the place of the drivers that follow from outputs.

    An output driver holds an output to its law, and has the name of the driver that it replaces. Outputs of the whole
    motion, such as forces, are left out: they belong to the replaced drivers. A mechanism without such laws is returned
    unchanged.

    Raises
    ------
    MechanismError
        If an output does not exist, cannot be held, or is held twice, or the class of its driver defines no coordinate.
    """
    laws = output_laws(mechanism)
    if not laws:
        return mechanism
    drivers = dict(mechanism.drivers)
    for name, motion in laws.items():
        location = f"drivers.{name}.motion"
        if not hasattr(mechanism.drivers[name], "evaluate"):
            message = "the class of this driver does not define its coordinate; give it a method evaluate"
            raise MechanismError(message, name=location, value=type(mechanism.drivers[name]).__name__)
        others = [other for other, law in laws.items() if law.output == motion.output and other != name]
        if others:
            raise MechanismError(
                f"the driver '{others[0]}' follows from this output already",
                name=f"{location}.output",
                value=motion.output,
            )
        drivers[name] = driver_of_output(mechanism, motion, f"{location}.output")
    outputs = {name: x for name, x in mechanism.outputs.items() if not isinstance(x, AbstractMotionOutput)}
    return dataclasses.replace(mechanism, drivers=drivers, outputs=outputs)


def driver_of_output(mechanism: Any, motion: OutputMotion, location: str) -> AbstractConstraint:
    """Return the driver that holds an output to a law; `mechanism` needs a space and outputs only."""
    output, component = _named(mechanism, motion.output, location)
    law, spatial = motion.law, mechanism.space == "spatial"
    match output:
        case AngleOutput():
            return CoordinateDriver((GROUND, *output.bodies), "angle", law)
        case PlanarRelativeAngleOutput():
            return CoordinateDriver(output.bodies, "angle", law)
        case RelativeAngleOutput():
            return RotationDriver(output.bodies, output.axis, law, vector_i=output.vector_i, vector_j=output.vector_j)
        case DistanceOutput():
            kind = SpatialDistanceDriver if spatial else DistanceDriver
            return kind(output.bodies, output.point_i, output.point_j, law)
        case PointOutput() if component is not None:
            kind = SpatialSlideDriver if spatial else SlideDriver
            size = POSITION_COMPONENTS[mechanism.space]
            direction = [float(k == component) for k in range(size)]
            return kind((GROUND, *output.bodies), [0.0] * size, output.point, direction, law)
    if {"point_i", "point_j", "vector_i"} <= {field.name for field in dataclasses.fields(output)}:  # a slide output
        kind = SpatialSlideDriver if spatial else SlideDriver
        return kind(output.bodies, output.point_i, output.point_j, output.vector_i, law)
    message = "cannot be held to a law; name an angle, a distance, a slide, or a component of a point, such as C_y"
    raise MechanismError(message, name=location, value=motion.output)


def _named(mechanism: Any, name: str, location: str) -> tuple[Any, int | None]:
    """Return an output by its name, and the index of its component if the name is that of a component."""
    if name in mechanism.outputs:
        return mechanism.outputs[name], None
    stem, _, label = name.rpartition("_")
    labels = PointOutput.labels[: POSITION_COMPONENTS[mechanism.space]]
    points = {name for name, output in mechanism.outputs.items() if isinstance(output, PointOutput)}
    if stem in points and label in labels:
        return mechanism.outputs[stem], labels.index(label)
    valid_names = [
        column
        for output in mechanism.outputs
        for column in ([f"{output}_{label}" for label in labels] if output in points else [output])
    ]
    raise MechanismError(no_such("output", name, valid_names), name=location, value=name)
