"""`advance` for one instant, as a program for many: vectors of machine code, or arrays of XLA."""

import math
from collections.abc import Mapping
from typing import Any, TypeVar

import jax
import jax.numpy as jnp

from jounce.base.modules import with_fields
from jounce.execution.device import on_processor
from jounce.execution.mapped import GPU_WIDTH, mapped
from jounce.kinematics.continuation.correct_and_differentiate import StepResult, advance, solved_batch
from jounce.mechanism.system import System
from jounce.rigid.pose import Pose

Values = TypeVar("Values")
WIDTHS = 128, 512  # least and greatest number of instants that XLA solves side by side, to fit the cache
CACHED_ENTRIES = 2**16  # of the factors of a round: half a megabyte


def round_width(system: System) -> int:
    """Return the number of instants of a long grid that XLA solves side by side, a power of two.

    On a CPU, the factors of their Jacobians fit into the cache; on a GPU, they fill the device.
    """
    if not on_processor():
        return GPU_WIDTH
    entries = math.prod(system.shape if system.fronts is None else system.fronts.shape)
    narrowest, widest = WIDTHS
    return max(narrowest, min(widest, 2 ** int(math.log2(max(1, CACHED_ENTRIES // max(1, entries))))))


def _of_many(shared: Any, instants: Any, *, pose_type: type[Pose], order: int) -> StepResult:
    """Solve many instants as `advance_instant` does one; instants of one motion are not searched."""
    (system, settings), (source, step, instant, design, search) = shared, instants
    arguments = of_design(system, design), settings, source, step, instant
    if design is None:
        return solved_batch(*arguments, pose_type=pose_type, order=order)[0]
    return advance(*arguments, jnp.any(search), pose_type=pose_type, order=order, searched=step.shape[-1])


@mapped(by_xla=_of_many)
def advance_instant(shared: Any, instants: Any, *, pose_type: type[Pose], order: int) -> StepResult:
    """Solve an instant from a solved neighbor.

    Parameters
    ----------
    shared : tuple
        System and `Settings`.
    instants : tuple
        State of the neighbor, time step from it, the instant, s, the values of its design (see `of_design`) or None,
        and whether to search, as in `advance`: each of length one.
    pose_type, order
        As in `advance`.
    """
    (system, settings), (source, step, instant, design, search) = shared, instants
    reflected = with_fields(of_design(system, design), reflected=True)
    options: Any = {
        "pose_type": pose_type,
        "order": order,
        "with_det_rate": design is not None or finds_det_rate(system),
    }
    return advance(reflected, settings, source, step, instant, search[0], **options)


def of_design(values: Values, design: Mapping[int, Any] | None) -> Values:
    """Return a system with leaves replaced by the `design` values of a design, or of several, by leaf index."""
    if not design:
        return values
    leaves, structure = jax.tree.flatten(values)
    return jax.tree.unflatten(structure, [design.get(k, leaf) for k, leaf in enumerate(leaves)])


def finds_det_rate(system: System) -> bool:
    """Return whether the program of an instant computes the rate of the determinant; large systems do so separately."""
    return system.fronts is None
