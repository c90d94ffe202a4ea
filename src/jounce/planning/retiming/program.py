"""The convex program of the fastest rate: least duration within linear bounds on z and its derivatives."""

import dataclasses
import importlib
from importlib.util import find_spec
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.errors import UnsupportedError

TOLERANCE = 1e-7

_Points = Float[np.ndarray, " _"]  # of any length


def require_solver() -> None:
    """Raise UnsupportedError where the solver of cone programs is not installed."""
    if find_spec("clarabel") is None:
        message = "retiming needs Clarabel, which is not installed; install it with: pip install 'jounce[planning]'"
        raise UnsupportedError(message, name="clarabel")


@dataclasses.dataclass(frozen=True, eq=False)
class Program:
    """Least ``sum weights / sqrt(z)`` over the coefficients x of z.

    Parameters
    ----------
    weights : ndarray of shape (node,)
        Of a quadrature over u.
    nodes : sparse matrix of shape (node, coefficient)
        Makes z at its nodes.
    rows : sparse matrix of shape (row, coefficient), and right : ndarray of shape (row,)
        Bounds: ``rows x <= right``.
    cones : sparse matrix of shape (3 * cone, coefficient), and radii : ndarray of shape (cone,)
        Vectors, whose length is at most a radius.
    equal : sparse matrix, and equal_right : ndarray
        ``equal x == equal_right``.
    """

    weights: _Points
    nodes: Any
    rows: Any
    right: _Points
    cones: Any
    radii: _Points
    equal: Any
    equal_right: _Points


@dataclasses.dataclass(frozen=True, eq=False)
class Solution:
    """What came of a program.

    Parameters
    ----------
    coefficients : ndarray of shape (coefficient,) or None
        None where there is none.
    prices : ndarray of shape (row,)
        By how much the sum would fall for each unit that a bound were raised.
    slack : float
        By how much bounds must at least be exceeded; 0 where all can be kept.
    """

    coefficients: _Points | None
    prices: _Points
    slack: float = 0.0


def solve_program(program: Program, *, elastic: bool = False) -> Solution:
    """Solve a program with Clarabel; with `elastic`, find by how little bounds must be exceeded instead."""
    from scipy import sparse

    clarabel: Any = importlib.import_module("clarabel")  # its names are those of a compiled module

    count, nodes = program.nodes.shape[1], 0 if elastic else len(program.weights)
    extra = 1 if elastic else 2 * nodes
    wide = sparse.csc_matrix
    objective = np.concatenate([np.zeros(count), *([np.ones(1)] if elastic else [program.weights, np.zeros(nodes)])])
    blocks: list[Any] = [sparse.hstack([program.equal, wide((program.equal.shape[0], extra))])]
    sides: list[Any] = [program.equal_right]
    kinds: list[Any] = [clarabel.ZeroConeT(len(program.equal_right))] if len(program.equal_right) else []
    free = -np.ones((len(program.right), 1)) if elastic else wide((len(program.right), extra))
    least = sparse.hstack([-program.nodes, wide((program.nodes.shape[0], extra))])
    floor = np.full(program.nodes.shape[0], -1e-6)
    blocks += [sparse.hstack([program.rows, free])]
    sides += [program.right]
    kinds += [clarabel.NonnegativeConeT(len(program.right))]
    if elastic:
        blocks += [least]
        sides += [floor]
        kinds += [clarabel.NonnegativeConeT(len(floor))]
    if len(program.radii):
        cone = program.cones.tocoo()
        row = cone.row + cone.row // 3 + 1  # of four rows each, the first is the radius
        shape = (4 * len(program.radii), count + extra)
        blocks.append(sparse.coo_matrix((-cone.data, (row, cone.col)), shape=shape))
        sides.append(np.column_stack([program.radii, np.zeros((len(program.radii), 3))]).reshape(-1))
        kinds += [clarabel.SecondOrderConeT(4)] * len(program.radii)
    if not elastic:
        # y^2 <= z and 1 <= r y, so that r >= 1 / sqrt(z), as the cones
        # ((z + 1) / 2, (z - 1) / 2, y) and ((r + y) / 2, (r - y) / 2, 1)
        z, one = program.nodes.tocoo(), np.arange(nodes)
        half = np.full(nodes, 0.5)
        parts = (
            (z.row * 6, z.col, z.data / 2), (z.row * 6 + 1, z.col, z.data / 2),
            (one * 6 + 2, count + nodes + one, 2 * half),
            (one * 6 + 3, count + one, half), (one * 6 + 3, count + nodes + one, half),
            (one * 6 + 4, count + one, half), (one * 6 + 4, count + nodes + one, -half),
        )  # fmt: skip
        row, column, data = (np.concatenate(x) for x in zip(*parts, strict=True))
        blocks.append(sparse.coo_matrix((-data, (row, column)), shape=(6 * nodes, count + extra)))
        sides.append(np.tile([0.5, -0.5, 0.0, 0.0, 0.0, 1.0], nodes))
        kinds += [clarabel.SecondOrderConeT(3)] * (2 * nodes)
    settings = clarabel.DefaultSettings()
    settings.verbose, settings.max_threads = False, 1
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = TOLERANCE
    matrix = wide(sparse.vstack(blocks, format="csc"))
    size = count + extra
    solver = clarabel.DefaultSolver(wide((size, size)), objective, matrix, np.concatenate(sides), kinds, settings)
    solution = solver.solve()
    begin = len(program.equal_right)
    prices = np.array(solution.z)[begin : begin + len(program.right)]
    usable = str(solution.status) in ("Solved", "AlmostSolved")
    x = np.array(solution.x)
    return Solution(x[:count] if usable else None, prices, float(x[-1]) if elastic else 0.0)
