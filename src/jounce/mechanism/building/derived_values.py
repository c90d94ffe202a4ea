"""Values of joints that follow from the starting guess: offsets, signs of attitudes, and units of turns."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.constraints.cams import Cam
from jounce.constraints.facts import value_fields
from jounce.execution.compilation import compiled
from jounce.jet import Jet
from jounce.mechanism.building.starting_guess import pose_at
from jounce.mechanism.system import Group, with_field
from jounce.mechanism.transmissions.axis_angles import measures_angle, with_datum_of
from jounce.rigid.pose import Pose


def with_offsets(group: Group, pose_type: type[Pose], guess: dict[str, Any]) -> Group:
    """Return a group with offsets; a missing offset is the one with which the starting guess satisfies the joint."""
    fields = value_fields(type(group.element))
    if "offset" not in fields or group.element.offset is not None:
        return group
    offset = _fulfilling_offset(group, guess, pose_type)
    return with_field(group, "offset", offset if isinstance(offset, Tracer) else np.asarray(offset))


@compiled("pose_type", brief=True)
def _fulfilling_offset(group: Group, guess: dict[str, Any], pose_type: type[Pose]) -> Float[Numbers, "instance 1"]:
    def residual(offset: Any) -> Any:
        trial = with_field(group, "offset", offset)
        return trial.residual(pose_at(guess, pose_type), Jet([jnp.zeros((1, 1))])).coefficients[0]

    zero = jnp.zeros((group.instances, 1))
    value, slope = jax.jvp(residual, (zero,), (jnp.ones_like(zero),))
    return -jnp.sum(value * slope, axis=0)  # the slope is -1 in the row that holds the offset, else 0


def with_sense(group: Group, pose_type: type[Pose], guess: dict[str, Any]) -> Group:
    """Return a group with the sign of the Euler parameters to which its attitudes are compared, as at the guess."""
    if not hasattr(group.element, "sense"):
        return group
    pose = pose_at(guess, pose_type)
    sense = group.element.sense_at(*(pose.take(indices) for indices in group.bodies))
    return with_field(group, "sense", sense if sense is None or isinstance(sense, Tracer) else np.asarray(sense))


def counts_turns(group: Group) -> bool:
    """Return whether a group consists of cams whose leader turns are counted by carriages."""
    return isinstance(group.element, Cam) and bool(group.element.hidden)


def with_turn_unit(group: Group, length: Any) -> Group:
    """Return a group of cams whose carriages move by the size of the mechanism, m, for each rad of the leader."""
    if not counts_turns(group):
        return group
    return with_field(group, "unit", length * np.ones((group.instances, 1)))


def with_derived_of(group: Group, source: Group) -> Group:
    """Return a group with the offsets and signs of another group, which were derived from a position."""
    if measures_angle(group):
        return with_datum_of(group, source)
    if hasattr(group.element, "sense"):
        return with_field(group, "sense", source.element.sense)
    if counts_turns(group):
        return with_field(group, "unit", source.element.unit)
    if "offset" not in value_fields(type(group.element)) or group.element.offset is not None:
        return group
    return with_field(group, "offset", source.element.offset)
