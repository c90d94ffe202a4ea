"""Chains of four-bars against the number of bodies, positions included, beside banded LAPACK.

Each rocker drives the next through a rod; all loops are parallelograms, so that all angles are those of the driver. The
base is SciPy's ``solve_banded`` on the Jacobian of one instant, its rows in the order of the chain, with five
right-hand sides at once: a correction of the position and four derivatives.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from mpmath import mp, mpf
from scipy.linalg import solve_banded

import jounce as jn
from benchmarks.cases import Case, Cases, Contestant, ready
from benchmarks.references import largest_error
from tests.oracles.mp_series import Series, sin

SPAN, RADIUS, SOLVES, BASE_INSTANTS = 1.5, 1.0, 5, 8


def chain(count: int) -> jn.Mechanism:
    """Return a chain of parallel four-bars."""
    bodies = {f"b{k}": jn.Body([SPAN * k, 0.0], angle=np.pi / 2) for k in range(count + 1)}
    pins = {f"g{k}": jn.planar.Revolute(("ground", f"b{k}"), [SPAN * k, 0.0], [0, 0]) for k in range(count + 1)}
    rods = {
        f"p{k}": jn.planar.DoubleRevolute((f"b{k}", f"b{k + 1}"), [RADIUS, 0], [RADIUS, 0], SPAN) for k in range(count)
    }
    return jn.Mechanism(
        space="planar",
        bodies=bodies,
        joints=pins | rods,
        drivers={"turn": jn.drivers.CoordinateDriver(("ground", "b0"), "angle", motion="pi/2+0.35*sin(t)")},
        outputs={"last": jn.outputs.AngleOutput(f"b{count}")},
    )


def exact(time: np.ndarray) -> np.ndarray:
    """Return the angle and four derivatives, (instants, 5), from the driver's law in fifty digits."""
    with mp.workdps(50):
        series = [0.35 * sin(Series([mpf(float(t)), mpf(1), *[mpf(0)] * 3])) for t in time]
        angles = [(s + mp.pi / 2).derivatives() for s in series]
        return np.array([[float(x) for x in one] for one in angles])


def banded(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the Jacobian at a quarter turn in LAPACK's band storage, right-hand sides, and their solutions.

    Rows are the driver, then for each body its pin and its rod to the next; three diagonals below and two above.
    """
    size = 3 * (count + 1)
    matrix = np.zeros((size, size))
    matrix[0, 2] = 1.0
    for k in range(count + 1):
        pin, column = 3 * k + 1, 3 * k
        matrix[pin, column] = matrix[pin + 1, column + 1] = 1.0
        if k < count:  # half the square of the rod's length; it is horizontal
            matrix[pin + 2, [column, column + 2, column + 3, column + 5]] = SPAN * np.array([-1.0, RADIUS, 1, -RADIUS])
    bands = np.zeros((6, size))
    for offset in range(-3, 3):
        bands[2 - offset, max(offset, 0) : size + min(offset, 0)] = np.diagonal(matrix, offset)
    solutions = np.random.default_rng(count).normal(size=(size, SOLVES))
    return bands, matrix @ solutions, solutions


def banded_run(count: int) -> Callable[[], Any]:
    """Return the function that solves one system after another."""
    bands, right_sides, solutions = banded(count)

    def run() -> Any:
        for _ in range(BASE_INSTANTS):
            found = solve_banded((3, 2), bands, right_sides, check_finite=False)
        return np.abs(found - solutions).max()

    return run


def cases(quick: bool) -> Cases:
    """Yield chains of more and more four-bars."""
    for count in (8, 32) if quick else (8, 16, 32, 64, 128, 1000):
        time = np.linspace(0.0, 6.28, 201 if quick or count > 128 else 2001)
        mechanism, expected = chain(count), exact(time[::50])
        aim = {128: 1.0, 1000: 2.0}.get(count)
        yield Case(
            f"chain of {count} four-bars to jounce, {len(time):,} instants",
            [
                Contestant(
                    "jounce, positions included",
                    ready(lambda mechanism=mechanism, time=time: jn.solve(mechanism, time)),
                    lambda motion, expected=expected: largest_error(motion.outputs["last"][::50], expected),
                ),
                Contestant(
                    f"LAPACK, banded, {SOLVES} solves, Jacobian given (SciPy)",
                    lambda count=count: banded_run(count),
                    float,
                    count=BASE_INSTANTS,
                    aim=aim,
                ),
            ],
            count=len(time),
            unit="instant",
            reference="the driver's law in fifty digits; of LAPACK against the solutions behind its right-hand sides",
            at={"bodies": count + 1},
        )
