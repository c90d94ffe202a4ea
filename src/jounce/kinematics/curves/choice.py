"""The assembly that a mechanism selects among all of its assemblies."""

import dataclasses
from collections.abc import Mapping

import numpy as np

from jounce.errors import AssemblyError
from jounce.kinematics.assembly.axis_directions import in_global_axes
from jounce.kinematics.curves.assembly_modes import Assemblies, Assembly, assemblies
from jounce.mechanism import Mechanism, build
from jounce.mechanism.mechanism import NEAREST, SIDES
from jounce.rigid.planar import PlanarPose

DIFFERENT = 1e-6  # sizes of the mechanism: least distance by which a selection must distinguish assemblies


def chosen(mechanism: Mechanism, instant: float) -> Mechanism:
    """Return a mechanism whose starting guess is the assembly that it selects; unchanged if it selects none.

    Raises
    ------
    AssemblyError
        If there is no assembly with the number, or the selection fits several assemblies.
    """
    wish = mechanism.assembly
    if wish is None:
        return mechanism
    drivers = {**mechanism.drivers, **mechanism.initial}
    driven = dataclasses.replace(mechanism, drivers=drivers, initial={}, forces={}, outputs={}, assembly=None)
    candidates = assemblies(driven, instant, circuits=isinstance(wish, int))
    if isinstance(wish, int):
        picked = candidates.number(wish)
    else:
        picked = candidates[0] if wish == NEAREST else _by_wish(candidates, wish)
    return dataclasses.replace(mechanism, bodies={**mechanism.bodies, **_guesses(mechanism, picked)}, assembly=None)


def _guesses(mechanism: Mechanism, picked: Assembly) -> dict:
    return {
        name: dataclasses.replace(
            body, position=assembled.position, angle=assembled.angle, orientation=assembled.orientation
        )
        for (name, body), assembled in zip(mechanism.bodies.items(), picked.mechanism.bodies.values(), strict=True)
    }


def _by_wish(candidates: Assemblies, wish: Mapping[str, str]) -> Assembly:
    """Return the assembly in which each body lies farthest toward its side; the first body has priority."""
    remaining = list(candidates)
    for body, side in wish.items():
        axis, sign = SIDES[side]
        sizes = np.array([sign * _middle(assembly.mechanism, body)[axis] for assembly in remaining])
        lower_bound = sizes.max() - DIFFERENT * build(remaining[0].mechanism).length
        remaining = [x for x, size in zip(remaining, sizes, strict=True) if size > lower_bound]
    if len(remaining) > 1:
        numbers = " and ".join(str(x.number) for x in remaining)
        message = f"assemblies {numbers} fit equally well: add the side of another body, or give a number"
        raise AssemblyError(message, name="assembly", value=dict(wish))
    return remaining[0]


def _middle(mechanism: Mechanism, body: str) -> np.ndarray:
    """Return the mean of the joint points on a body in the global frame; its origin if there are none."""
    model = build(mechanism)
    number = 1 + list(mechanism.bodies).index(body)
    points = [
        np.asarray(getattr(group.element, name))[:, min(k, np.shape(getattr(group.element, name))[1] - 1), 0]
        for group in model.system.groups
        if not group.is_driver
        for slot, name in zip(group.bodies, ("point_i", "point_j"), strict=False)
        if getattr(group.element, name, None) is not None
        for k, holder in enumerate(slot)
        if holder == number
    ]
    local = np.mean(points, axis=0) if points else np.zeros(2 if model.pose_type is PlanarPose else 3)
    origin = np.asarray(model.guess["position"])[:, number, 0]
    return origin + in_global_axes(local[:, None], model.guess, np.array([number]))[:, 0]
