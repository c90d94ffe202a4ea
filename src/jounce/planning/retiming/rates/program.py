"""The convex program of the fastest rate: least duration within linear bounds on z and its derivatives."""

import dataclasses
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.planning.solver import cone_solver

TOLERANCE = 1e-7

_Points = Float[np.ndarray, " _"]


@dataclasses.dataclass(frozen=True, eq=False)
class Program:
    """Minimization of ``sum weights / sqrt(z)`` over the coefficients x of z.

    Parameters
    ----------
    weights : ndarray of shape (node,)
        Weights of a quadrature over u.
    nodes : sparse matrix of shape (node, coefficient)
        Matrix from the coefficients to z at the nodes of the quadrature.
    rows : sparse matrix of shape (row, coefficient), and right : ndarray of shape (row,)
        Bounds: ``rows x <= right``.
    cones : sparse matrix of shape (3 * cone, coefficient), and radii : ndarray of shape (cone,)
        Vectors, with lengths of at most the radii.
    equal : sparse matrix, and equal_right : ndarray
        ``equal x == equal_right``.
    duration : float, optional
        Upper bound of the sum; the objective is then ``sum weights z``.
    about : ndarray of shape (node,), optional
        z of a law near the fastest. The objective is then expanded to second order about it, as in Newton's method,
        which takes a third of the time.
    """

    weights: _Points
    nodes: Any
    rows: Any
    right: _Points
    cones: Any
    radii: _Points
    equal: Any
    equal_right: _Points
    duration: float | None = None
    about: _Points | None = None


@dataclasses.dataclass(frozen=True, eq=False)
class Solution:
    """Solution of a program.

    Parameters
    ----------
    coefficients : ndarray of shape (coefficient,) or None
        Coefficients of z; None if the program has no solution.
    prices : ndarray of shape (row,)
        Dual variables: decrease of the objective per unit by which a bound is raised.
    slack : float
        Least excess over the bounds; 0 if all can be kept.
    """

    coefficients: _Points | None
    prices: _Points
    slack: float = 0.0


def solve_program(program: Program, *, elastic: bool = False) -> Solution:
    """Return the solution of a program by Clarabel; with `elastic`, minimize the excess over its bounds instead."""
    from scipy import sparse

    clarabel = cone_solver()

    wide = sparse.csc_matrix
    center = program.about if program.duration is None and not elastic else None
    count, nodes = program.nodes.shape[1], 0 if elastic or center is not None else len(program.weights)
    extra_count = 1 if elastic else 2 * nodes
    slowest, sums = program.duration is not None, np.zeros(count)
    if slowest:
        sums = program.nodes.T @ program.weights
    times = np.zeros(nodes) if slowest else program.weights
    objective = np.concatenate([0 * sums, np.ones(1)] if elastic else [sums, times[:nodes], np.zeros(nodes)])
    quadratic = wide((count + extra_count, count + extra_count))
    if center is not None:
        curved = program.weights * center**-2.5
        quadratic = wide(sparse.triu(program.nodes.T @ sparse.diags(0.75 * curved) @ program.nodes))
        objective = program.nodes.T @ (-1.25 * curved * center)

    def widened(matrix: Any, unknowns: Any = None) -> Any:
        """Return a matrix over the coefficients with columns for the other unknowns, zero unless given."""
        if not extra_count:
            return matrix
        return sparse.hstack([matrix, wide((matrix.shape[0], extra_count)) if unknowns is None else unknowns])

    blocks: list[Any] = [widened(program.equal)]
    sides: list[Any] = [program.equal_right]
    kinds: list[Any] = [clarabel.ZeroConeT(len(program.equal_right))] if len(program.equal_right) else []
    floor = np.full(program.nodes.shape[0], -1e-6)
    blocks += [widened(program.rows, -np.ones((len(program.right), 1)) if elastic else None)]
    sides += [program.right]
    kinds += [clarabel.NonnegativeConeT(len(program.right))]
    if elastic:
        blocks += [widened(-program.nodes)]
        sides += [floor]
        kinds += [clarabel.NonnegativeConeT(len(floor))]
    if slowest and not elastic:
        blocks.append(sparse.csr_matrix(np.concatenate([np.zeros(count), program.weights, np.zeros(nodes)])))
        sides.append(np.array([program.duration]))
        kinds.append(clarabel.NonnegativeConeT(1))
    if len(program.radii):
        cone = program.cones.tocoo()
        row = cone.row + cone.row // 3 + 1  # the first of the four rows of a cone is the radius
        shape = (4 * len(program.radii), count + extra_count)
        blocks.append(sparse.coo_matrix((-cone.data, (row, cone.col)), shape=shape))
        sides.append(np.column_stack([program.radii, np.zeros((len(program.radii), 3))]).reshape(-1))
        kinds += [clarabel.SecondOrderConeT(4)] * len(program.radii)
    if nodes:
        # y^2 <= z and 1 <= r y, so that r >= 1 / sqrt(z), as the cones
        # ((z + 1) / 2, (z - 1) / 2, y) and ((r + y) / 2, (r - y) / 2, 1)
        z, numbers = program.nodes.tocoo(), np.arange(nodes)
        half = np.full(nodes, 0.5)
        entries = (
            (z.row * 6, z.col, z.data / 2), (z.row * 6 + 1, z.col, z.data / 2),
            (numbers * 6 + 2, count + nodes + numbers, 2 * half),
            (numbers * 6 + 3, count + numbers, half), (numbers * 6 + 3, count + nodes + numbers, half),
            (numbers * 6 + 4, count + numbers, half), (numbers * 6 + 4, count + nodes + numbers, -half),
        )  # fmt: skip
        row, column, data = (np.concatenate(x) for x in zip(*entries, strict=True))
        blocks.append(sparse.coo_matrix((-data, (row, column)), shape=(6 * nodes, count + extra_count)))
        sides.append(np.tile([0.5, -0.5, 0.0, 0.0, 0.0, 1.0], nodes))
        kinds += [clarabel.SecondOrderConeT(3)] * (2 * nodes)
    settings = clarabel.DefaultSettings()
    settings.verbose, settings.max_threads = False, 1
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = TOLERANCE
    matrix = wide(sparse.vstack(blocks, format="csc"))
    solver = clarabel.DefaultSolver(quadratic, objective, matrix, np.concatenate(sides), kinds, settings)
    solution = solver.solve()
    start = len(program.equal_right)
    prices = np.array(solution.z)[start : start + len(program.right)]
    usable = str(solution.status) in ("Solved", "AlmostSolved")
    x = np.array(solution.x)
    return Solution(x[:count] if usable else None, prices, float(x[-1]) if elastic else 0.0)
