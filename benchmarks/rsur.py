"""RSUR mechanism to jounce over 10,000 instants, positions included, beside the bare linear algebra that it needs.

The base is one batched LU factorisation and four solves of the same 18 x 18 systems, by LAPACK through JAX, on
Jacobians that are already there. Run: ``python benchmarks/rsur.py``
"""

from pathlib import Path

from timing import race, report, use_one_core

use_one_core()

import jax  # noqa: E402
import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402

import jounce as jn  # noqa: E402

INSTANTS, ORDER = 10_000, 4


def bare_linear_algebra(size: int):
    """Return a function that factors and solves random systems of the same size, all at once."""
    generator = np.random.default_rng(0)
    matrices = jnp.asarray(generator.normal(size=(INSTANTS, size, size)))
    right_sides = jnp.asarray(generator.normal(size=(ORDER, INSTANTS, size, 1)))
    triangular_solve = jax.lax.linalg.triangular_solve

    @jax.jit
    def factor_and_solve(matrices, right_sides):
        lu, _, permutation = jax.lax.linalg.lu(matrices)
        solutions = []
        for right in right_sides:
            y = jnp.take_along_axis(right, permutation[..., None], 1)
            y = triangular_solve(lu, y, left_side=True, lower=True, unit_diagonal=True)
            solutions.append(triangular_solve(lu, y, left_side=True, lower=False))
        return solutions

    return lambda: jax.block_until_ready(factor_and_solve(matrices, right_sides))


def main() -> None:
    """Print the ratio; the aim is 3 at most."""
    mechanism = jn.load(Path(__file__).parents[1] / "examples" / "rsur.yaml")
    time = np.linspace(0.0, 2.0, INSTANTS)
    competitors = {
        "bare LU and four solves of 18 x 18": bare_linear_algebra(18),
        "jounce.solve to jounce, positions included": lambda: jn.solve(mechanism, time, order=ORDER),
    }
    report(f"RSUR, {INSTANTS} instants, one core", race(competitors), INSTANTS, "bare LU and four solves of 18 x 18")


if __name__ == "__main__":
    main()
