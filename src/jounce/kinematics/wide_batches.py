"""Many instants in one call: lot after lot, each as wide as the cache holds.

What Python does for a call takes as long as a computer takes for hundreds of instants of a small mechanism.
"""

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from jounce.execution.compilation import compiled
from jounce.execution.device import on_processor
from jounce.kinematics.advance import Arrival, Lanes, SolvedState, solved_batch
from jounce.mechanism.system import System
from jounce.rigid.pose import Pose
from jounce.shapes import Numbers

WIDTHS = 128, 512  # instants that are solved side by side: as many as the cache holds, within these bounds
CACHED_ENTRIES = 2**16  # of the factors of a lot: half a megabyte
MOST_LOTS = 8  # in a call,
CALL_ENTRIES = 2**21  # of which the coordinates have no more entries than this: 16 megabytes
GPU_WIDTH = 2**15


def lot_width(system: System) -> int:
    """Return how many instants of a long grid are solved side by side: a power of two.

    On a processor so many that the factors of their Jacobians fit into the cache, on a GPU so many that they fill it.
    """
    if not on_processor():
        return GPU_WIDTH
    entries = math.prod(system.shape if system.fronts is None else system.fronts.shape)
    least, most = WIDTHS
    return max(least, min(most, 2 ** int(math.log2(max(1, CACHED_ENTRIES // max(1, entries))))))


def lots_in_a_call(width: int, entries: int) -> int:
    """Return how many lots go through a compiled program in one call, where each instant has so many entries."""
    return min(MOST_LOTS, max(1, CALL_ENTRIES // (width * entries))) if on_processor() else 1


@compiled("pose_type", "order", "width")
def advance_in_lots(
    system: System,
    known: SolvedState,
    step: Lanes,
    instant: Lanes,
    settings: tuple[Float[Numbers, ""], Any, Int[Numbers, ""]],
    lots: Int[Numbers, ""],
    *,
    pose_type: type[Pose],
    order: int,
    width: int,
) -> Arrival:
    """Solve many instants, each from a neighbour solved before; nothing is surveyed.

    Parameters
    ----------
    system, known, step, instant, pose_type, order
        As those of `advance`; `known` are coordinates, angles and signs.
    settings : tuple
        Tolerance, whether to refine, and the highest derivative that must be finite.
    lots : int
        Those that are solved; lanes beyond them are left at zero.
    width : int
        Lanes of a lot, a divisor of all lanes.
    """

    def solved(lot: Any) -> Any:
        def some(x: Any) -> Any:
            return jax.lax.dynamic_slice_in_dim(x, lot * width, width, axis=-1)

        (coordinates, angles, sign), away, when = jax.tree.map(some, (known, step, instant))
        given = coordinates, angles, sign, away, when, *settings
        arrival, _, _ = solved_batch(system, *given, pose_type=pose_type, order=order)
        return arrival._replace(turnover=np.zeros(width))

    def go_on(lot: Any, found: Any) -> Any:
        put = jax.lax.dynamic_update_slice_in_dim
        return jax.tree.map(lambda whole, part: put(whole, part, lot * width, -1), found, solved(lot))

    blank = jax.tree.map(lambda x: jnp.zeros((*x.shape[:-1], len(step)), x.dtype), jax.eval_shape(solved, 0))
    return jax.lax.fori_loop(0, lots, go_on, blank)
