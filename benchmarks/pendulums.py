"""Chains of pendulums, simulated, against the number of bodies, beside equations of motion written by hand.

The peer integrates N angles by SciPy's DOP853, with the dense mass matrix of point masses on massless rods in NumPy.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

import jounce as jn
from benchmarks.cases import Case, Cases, Contestant, ready

GRAVITY, LENGTH, LIFT = 9.81, 0.1, 0.3  # m/s^2, m, rad from the vertical, all rods alike


def chain(count: int) -> jn.Mechanism:
    """Return point masses of 1 kg on massless rods, from rest in a straight line."""
    names = ["ground", *(f"rod{k}" for k in range(count))]
    away = LENGTH * np.array([np.sin(LIFT), -np.cos(LIFT)])
    bodies = {
        name: jn.Body(k * away, LIFT - np.pi / 2, mass=1.0, inertia=0.0, center_of_mass=[LENGTH, 0])
        for k, name in enumerate(names[1:])
    }
    return jn.Mechanism(
        space="planar",
        gravity=[0, -GRAVITY],
        bodies=bodies,
        joints={
            f"pin{k}": jn.planar.Revolute(pair, [LENGTH * (k > 0), 0], [0, 0]) for k, pair in enumerate(pairwise(names))
        },
        initial={
            f"start{k}": jn.drivers.CoordinateDriver(("ground", name), "angle", motion=str(LIFT - np.pi / 2))
            for k, name in enumerate(names[1:])
        },
        outputs={"last": jn.outputs.AngleOutput(names[-1])},
    )


def by_hand(count: int, stop: float, tolerance: float) -> Callable[[], Any]:
    """Return DOP853 on the N angles from the vertical."""
    carried = count - np.maximum.outer(np.arange(count), np.arange(count)).astype(float)

    def slope(_: float, state: Any) -> Any:
        angle, speed = state[:count], state[count:]
        apart = angle[:, None] - angle
        right = -(carried * np.sin(apart)) @ speed**2 - GRAVITY / LENGTH * np.diag(carried) * np.sin(angle)
        return np.concatenate([speed, np.linalg.solve(carried * np.cos(apart), right)])

    start = np.concatenate([np.full(count, LIFT), np.zeros(count)])
    options = {"method": "DOP853", "rtol": tolerance, "atol": tolerance}
    return lambda: solve_ivp(slope, (0.0, stop), start, **options).y[count - 1, -1] - np.pi / 2


def cases(quick: bool) -> Cases:
    """Yield longer and longer chains; the peer at a tolerance that gives about the error of jounce."""
    stop = 0.1 if quick else 1.0
    for count in (8,) if quick else (8, 16, 32, 64):
        mechanism, known = chain(count), by_hand(count, stop, 2.3e-14)()

        def error(found: Any, known: float = known) -> float:
            return float(abs(found - known))

        def run(mechanism: jn.Mechanism = mechanism) -> float:
            return jn.simulate(mechanism, [0.0, stop], 1).outputs["last"][-1, 0]

        peer = Contestant("SciPy DOP853, N angles by hand", lambda n=count: by_hand(n, stop, 1e-12), error)
        yield Case(
            f"chain of {count} pendulums, {stop:g} s",
            [Contestant("jounce, absolute coordinates", ready(run), error), peer],
            reference="DOP853 on the angles at a tolerance of 2.3e-14, rad at the end",
            rounds=5,
            at={"bodies": count},
        )
