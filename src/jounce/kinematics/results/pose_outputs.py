"""Outputs of poses, evaluated at many instants at once."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.constraints import AbstractConstraint
from jounce.errors import MechanismError
from jounce.execution.compilation import compiled
from jounce.execution.mapped import Mapped
from jounce.jet import Jet
from jounce.jet.algebra import stacked
from jounce.jet.derivatives import plain_derivatives
from jounce.mechanism import AbstractOutput, AbstractQuantity, Mechanism, Model
from jounce.mechanism.building.builder import counted_as_in
from jounce.mechanism.mechanism import GROUND
from jounce.mechanism.system import POSITION_COMPONENTS, Group, group_elements
from jounce.mechanism.transmissions.axis_angles import angles_of, of_one_lane, with_turns


def check_output(output: AbstractQuantity, mechanism: Mechanism, name: str = "output") -> None:
    """Raise MechanismError if an output names missing elements, or does not exist in the space of the mechanism."""
    if not isinstance(output, AbstractQuantity):
        known = isinstance(output, str) and output in mechanism.outputs
        advice = f"; motion.outputs['{output}'] has the values of this one" if known else ""
        raise MechanismError(f"must be an output, such as jn.outputs.PointOutput{advice}", name=name, value=output)
    mechanism.check_fit(output, name)
    output.check(mechanism)


def output_group(
    output: AbstractOutput | AbstractConstraint, mechanism: Mechanism, model: Model | None = None, name: str = "output"
) -> Group:
    """Return an output of poses, or the coordinate of a driver, as a group of one that takes the poses of all bodies.

    With a model, angles about axes are counted as in the outputs of the assembled model.
    """
    index = {body: k for k, body in enumerate((GROUND, *mechanism.bodies))}
    components = POSITION_COMPONENTS[mechanism.space]
    groups, _ = group_elements({name: output}, mechanism.parameter_values, index, components)
    (group,) = groups if model is None else counted_as_in(groups, model)
    return group


@compiled("pose_type")
def output_series(
    groups: tuple[Group, ...], coordinates: dict[str, Any], pose_type: type
) -> tuple[Float[Numbers, "_ _ _ batch"], ...]:
    """Return the Taylor coefficients of outputs, (order + 1, components, instances, batch) for each group."""
    pose = pose_type.from_coordinates({name: Jet(tuple(c)) for name, c in coordinates.items()})
    return tuple(stacked(group.evaluate(pose)) for group in groups)


def series_along(
    groups: tuple[Group, ...], coordinates: dict[str, Any], pose_type: type
) -> tuple[Float[Numbers, "_ _ _ batch"], ...]:
    """Return the result of `output_series` for groups that hold the turns of angles about axes at each instant."""
    lanes = coordinates, angles_of(groups)
    return _of_instant.along(of_one_lane(groups), lanes, pose_type=pose_type)


@Mapped
def _of_instant(
    groups: tuple[Group, ...], lanes: tuple[dict[str, Any], Sequence[Any]], *, pose_type: type
) -> tuple[Float[Numbers, "_ _ _ batch"], ...]:
    coordinates, angles = lanes
    return output_series.function(with_turns(groups, angles), coordinates, pose_type)


def output_values(
    groups: tuple[Group, ...], coordinates: dict[str, Any], pose_type: type
) -> tuple[Float[Numbers, "_ _ _ batch"], ...]:
    """Return the derivatives of outputs, (order + 1, components, instances, batch) for each group."""
    return tuple(plain_derivatives(np.asarray(x)) for x in output_series(groups, coordinates, pose_type))
