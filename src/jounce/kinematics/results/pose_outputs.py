"""Outputs that follow from the poses of bodies at an instant, of many instants at once."""

from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.execution.compilation import compiled
from jounce.jet import Jet
from jounce.jet.algebra import stacked
from jounce.jet.derivatives import plain_derivatives
from jounce.mechanism.system import Group


@compiled("pose_type")
def output_series(
    groups: tuple[Group, ...], coordinates: dict[str, Any], pose_type: type
) -> tuple[Float[Numbers, "_ _ _ batch"], ...]:
    """Return the Taylor coefficients of outputs, (order + 1, components, instances, batch) for each group."""
    pose = pose_type.from_coordinates({name: Jet(tuple(c)) for name, c in coordinates.items()})
    return tuple(stacked(group.evaluate(pose)) for group in groups)


def output_values(
    groups: tuple[Group, ...], coordinates: dict[str, Any], pose_type: type
) -> tuple[Float[Numbers, "_ _ _ batch"], ...]:
    """Return the derivatives of outputs, (order + 1, components, instances, batch) for each group."""
    return tuple(plain_derivatives(np.asarray(x)) for x in output_series(groups, coordinates, pose_type))
