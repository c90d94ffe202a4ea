"""What each further derivative costs: positions included, to order 2 up to 10, beside nested automatic differentiation.

The peer differentiates the closed form of the four-bar's angle by forward mode within forward mode, compiled by XLA for
all instants at once: it solves nothing, and knows this one mechanism.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jounce as jn
from benchmarks.cases import EXAMPLES, Case, Cases, Contestant, ready
from benchmarks.four_bar import rocker
from benchmarks.references import KINEMATIC, error_of
from tests.programs import forget

ORDERS = (2, 3, 4, 6, 8, 10)
HIGHEST_NESTED = 8  # each further order takes two to three times as long to compile
NESTED = "JAX, nested jvp of the closed form"


def nested(time: np.ndarray, order: int) -> Callable[[], Any]:
    """Return the function that computes the angle and its derivatives by `jax.jvp` of `jax.jvp`."""

    def angle(t: Any) -> Any:
        return rocker(t, jnp, jnp.arctan2)

    def with_derivatives(order: int) -> Callable[[Any], Any]:
        if order == 0:
            return lambda t: (angle(t),)
        lower = with_derivatives(order - 1)

        def higher(t: Any) -> Any:
            values, slopes = jax.jvp(lower, (t,), (1.0,))
            return (*values, slopes[-1])

        return higher

    instants = jnp.asarray(time)
    function = jax.jit(jax.vmap(with_derivatives(order)))
    return lambda: jax.block_until_ready(function(instants))


def cases(quick: bool) -> Cases:
    """Yield the four-bar and the RSUR mechanism to each order, and the first call for each, compilation included."""
    time = np.linspace(0.0, 2.0, 2001 if quick else 10_001)
    for order in (2, 4) if quick else ORDERS:
        for name, title in (("four_bar", "four-bar"), ("rsur", "RSUR")):
            mechanism, error = jn.load(EXAMPLES / f"{name}.yaml"), error_of(name, time, "psi")

            def by_nesting(order: int = order) -> Callable[[], Any]:
                return nested(time, order)

            def solve(mechanism: jn.Mechanism = mechanism, order: int = order) -> jn.Motion:
                return jn.solve(mechanism, time, order=order)

            def compiled_and_solved(solve: Callable[[], Any] = solve) -> Any:
                jax.clear_caches()
                forget()
                return solve()

            def of_motion(motion: Any, error: Callable[[Any], float] = error) -> float:
                return error(motion.outputs["psi"])

            def of_columns(found: Any, error: Callable[[Any], float] = error) -> float:
                return error(np.stack(found, axis=1))

            ours = Contestant("jounce", ready(compiled_and_solved), of_motion)
            peer = Contestant(NESTED, ready(lambda by_nesting=by_nesting: by_nesting()()), of_columns)
            peers = [peer] if name == "four_bar" and order <= HIGHEST_NESTED else []
            where = {"order": order}
            if not quick or name == "four_bar":
                first = f"{title} to order {order}, first call"
                yield Case(first, [ours, *peers], reference=KINEMATIC, rounds=0, at=where)
            yield Case(
                f"{title} to order {order}, {len(time):,} instants",
                [replace(ours, build=ready(solve)), *(replace(peer, build=by_nesting) for peer in peers)],
                count=len(time),
                unit="instant",
                reference=KINEMATIC,
                at=where,
            )
