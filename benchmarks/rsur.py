"""RSUR mechanism to jounce, positions included, beside the bare linear algebra that it needs.

The base is one LU factorization and four solves of 18 x 18 systems that are already there, by LAPACK through JAX, in
blocks of 512 that stay in the cache.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jounce as jn
from benchmarks.cases import EXAMPLES, Case, Cases, Contestant, ready
from benchmarks.references import KINEMATIC, error_of

SIZE, SOLVES, BLOCK = 18, 4, 512


def bare_linear_algebra(blocks: int, width: int) -> Callable[[], Any]:
    """Return a function that factors and solves random systems of known solutions, one block after another.

    It returns the largest error of a solution, by which it is judged.
    """
    generator = np.random.default_rng(0)
    matrices = jnp.asarray(generator.normal(size=(blocks, width, SIZE, SIZE)))
    solutions = jnp.asarray(generator.normal(size=(blocks, SOLVES, width, SIZE, 1)))
    right_sides = matrices[:, None] @ solutions
    triangular_solve = jax.lax.linalg.triangular_solve

    def block(systems: Any) -> Any:
        matrices, right_sides = systems
        lu, _, permutation = jax.lax.linalg.lu(matrices)

        def solved(right: Any) -> Any:
            y = jnp.take_along_axis(right, permutation[..., None], 1)
            y = triangular_solve(lu, y, left_side=True, lower=True, unit_diagonal=True)
            return triangular_solve(lu, y, left_side=True, lower=False)

        return jnp.stack([solved(right) for right in right_sides])

    factored_and_solved = jax.jit(lambda matrices, right_sides: jax.lax.map(block, (matrices, right_sides)))

    def run() -> Any:
        return jax.block_until_ready(factored_and_solved(matrices, right_sides))

    run.solutions = solutions  # type: ignore[attr-defined]
    return run


def cases(quick: bool) -> Cases:
    """Yield the grid of the file, and a long one."""
    mechanism = jn.load(EXAMPLES / "rsur.yaml")
    for count, aim in ((201, 2.5), (2001 if quick else 10_001, 1.0)):
        time = np.linspace(0.0, 2.0, count)
        error = error_of("rsur", time, "psi")
        blocks, width = -(-count // BLOCK), min(count, BLOCK)
        base = bare_linear_algebra(blocks, width)
        yield Case(
            f"RSUR to jounce, {count:,} instants",
            [
                Contestant(
                    "jounce, positions included",
                    ready(lambda time=time: jn.solve(mechanism, time)),
                    lambda motion, error=error: error(motion.outputs["psi"]),
                ),
                Contestant(
                    f"LAPACK: LU and {SOLVES} solves in blocks of {width}, Jacobians given",
                    ready(base),
                    lambda found, base=base: float(np.abs(found - base.solutions).max()),
                    count=blocks * width,
                    aim=aim,
                ),
            ],
            count=count,
            unit="instant",
            reference=f"{KINEMATIC}; of LAPACK against the solutions that its right-hand sides were made from",
        )
