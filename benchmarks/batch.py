"""Double pendulums side by side, each with its own angles, 10 s of motion, beside one alone and diffrax's batch."""

import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jounce as jn
from benchmarks.cases import Case, Cases, Contestant, ready
from benchmarks.pendulum import by_scipy, dopri8

TIME = [0.0, 10.0]


def pendulum() -> jn.Mechanism:
    """Return two point masses on massless rods, from rest at two angles."""
    rod = {"mass": 1.0, "inertia": 0.0, "center_of_mass": [1.0, 0.0]}
    start = {
        name: jn.drivers.CoordinateDriver(("ground", body), "angle", motion=name)
        for name, body in (("first", "upper"), ("second", "lower"))
    }
    return jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        parameters={"first": 0.0, "second": 0.0},
        bodies={"upper": jn.Body([0, 0], **rod), "lower": jn.Body([1, 0], **rod)},
        joints={
            "A": jn.planar.Revolute(("ground", "upper"), [0, 0], [0, 0]),
            "B": jn.planar.Revolute(("upper", "lower"), [1, 0], [0, 0]),
        },
        initial=start,
        outputs={"upper": jn.outputs.AngleOutput("upper"), "lower": jn.outputs.AngleOutput("lower")},
    )


def by_diffrax(starts: np.ndarray, tolerance: float) -> Callable[[], Any]:
    """Return Dopri8 on the two angles with equations written by hand, batched by JAX, (runs, 2)."""
    solve = jax.jit(jax.vmap(dopri8, in_axes=(0, None)))
    return lambda: np.asarray(solve(jnp.asarray(starts), tolerance))


def cases(quick: bool) -> Cases:
    """Yield one pendulum beside many."""
    mechanism, runs = pendulum(), 100 if quick else 1000
    first, second = np.random.default_rng(0).uniform(-0.5, 0.5, (2, runs))
    starts = np.stack([first + math.pi / 2, second + math.pi / 2, 0 * first, 0 * first], axis=1)
    known = np.array([by_scipy(2.3e-14, tuple(start))() for start in starts[:3]])

    def side_by_side() -> Any:
        found = jn.simulate_batch(mechanism, {"first": first, "second": second}, TIME, order=1)
        return np.stack([found.outputs[name][:, -1, 0] for name in ("upper", "lower")], axis=1) + math.pi / 2

    def error(found: Any) -> float:
        return float(np.abs(found[:3] - known).max())

    yield Case(
        f"double pendulums, 10 s, {runs:,} side by side",
        [
            Contestant("jounce", ready(side_by_side), error),
            Contestant("jounce, one alone", ready(lambda: jn.simulate(mechanism, TIME, order=1)), count=1),
            Contestant("diffrax Dopri8, vmap, tolerance 1e-12", lambda: by_diffrax(starts, 1e-12), error, "diffrax"),
        ],
        count=runs,
        unit="pendulum",
        reference="SciPy's DOP853 at a tolerance of 2.3e-14, three pendulums at 10 s, rad",
        rounds=5,
    )
