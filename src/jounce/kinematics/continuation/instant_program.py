"""`advance` for one instant, as a program that solves many: machine code side by side, or XLA in arrays."""

import math
from typing import Any

import jax.numpy as jnp

from jounce.execution.device import on_processor
from jounce.execution.mapped import GPU_WIDTH, mapped
from jounce.kinematics.continuation.correct_and_differentiate import StepResult, advance, solved_batch
from jounce.mechanism.system import System
from jounce.modules import with_fields
from jounce.rigid.pose import Pose

WIDTHS = 128, 512  # instants that XLA solves side by side: as many as the cache holds, within these bounds
CACHED_ENTRIES = 2**16  # of the factors of a round: half a megabyte


def round_width(system: System) -> int:
    """Return how many instants of a long grid XLA solves side by side: a power of two.

    On a processor so many that the factors of their Jacobians fit into the cache, on a GPU so many that they fill it.
    """
    if not on_processor():
        return GPU_WIDTH
    entries = math.prod(system.shape if system.fronts is None else system.fronts.shape)
    least, most = WIDTHS
    return max(least, min(most, 2 ** int(math.log2(max(1, CACHED_ENTRIES // max(1, entries))))))


def _of_many(shared: Any, instants: Any, *, pose_type: type[Pose], order: int) -> StepResult:
    """Solve many instants as `advance_instant` does one; nothing is surveyed."""
    (system, tolerance, refine, wanted), ((coordinates, angles, sign), step, instant, _) = shared, instants
    given = coordinates, angles, sign, step, instant, tolerance, refine, wanted
    arrival, _, _ = solved_batch(system, *given, pose_type=pose_type, order=order)
    return arrival._replace(turnover=jnp.zeros_like(step))


@mapped(by_xla=_of_many)
def advance_instant(shared: Any, instants: Any, *, pose_type: type[Pose], order: int) -> StepResult:
    """Solve an instant from a neighbour solved before.

    Parameters
    ----------
    shared : tuple
        System, tolerance, whether to refine, and the highest derivative that must be finite.
    instants : tuple
        Coordinates, angles and sign of the neighbour, the time from there, the instant, s, and whether to look for
        the nearest singular position: each of length one.
    pose_type, order
        As those of `advance`.
    """
    (system, tolerance, refine, wanted), ((coordinates, angles, sign), step, instant, survey) = shared, instants
    return advance(
        with_fields(system, reflected=True),
        coordinates,
        angles,
        sign,
        step,
        instant,
        tolerance,
        refine,
        survey[0],
        wanted,
        pose_type=pose_type,
        order=order,
        with_turnover=finds_turnover(system),
    )


def finds_turnover(system: System) -> bool:
    """Tell whether the turnover of an instant is found with it; of many bodies it takes vectors of its own."""
    return system.fronts is None
