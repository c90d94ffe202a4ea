"""Angles that change by half a turn at once: of a vector passing near the axis, and Euler angles near gimbal lock."""

import itertools

import numpy as np
import pytest

import jounce as jn
from jounce import drivers, spatial

X, Z, ORIGIN = [1, 0, 0], [0, 0, 1], [0, 0, 0]
TIME = np.linspace(0.0, 3.0, 7)
START, RATE, SPIN = 1.0, 2.0, 5.0


def gimbals():
    """A body turned about z, then by a small angle about x, and then about y, so that its x axis passes near -z."""
    bodies = ("ground", "outer", "middle", "inner")
    axes, sides = (Z, X, [0, 1, 0]), (X, [0, 1, 0], Z)
    laws = ("spin*t", "miss", f"{START} + {RATE}*t")
    pairs = list(itertools.pairwise(bodies))
    return jn.Mechanism(
        space="spatial",
        parameters={"miss": 0.1, "spin": SPIN},
        bodies={name: jn.Body(ORIGIN) for name in bodies[1:]},
        joints={pair[1]: spatial.Revolute(pair, ORIGIN, ORIGIN, u, u) for pair, u in zip(pairs, axes, strict=True)},
        drivers={
            f"turn_{pair[1]}": drivers.RotationDriver(pair, u, law, a, a)
            for pair, u, a, law in zip(pairs, axes, sides, laws, strict=True)
        },
        outputs={"angle": jn.outputs.RelativeAngleOutput(("ground", "inner"), Z, X, X)},
    )


def swept(turn, miss):
    """Angle of (cos turn, sin(miss) sin turn), which is within a quarter turn of `turn`."""
    angle = np.arctan2(np.sin(miss) * np.sin(turn), np.cos(turn))
    return angle + 2 * np.pi * np.round((turn - angle) / (2 * np.pi))


def expected(miss, time=TIME):
    return SPIN * time + swept(START + RATE * time, miss)


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 8])
@pytest.mark.parametrize("miss", [0.1, 0.05, 0.02, 0.001, 1e-4, 1e-6])
def test_half_a_turn_at_once_is_counted_whatever_the_order(order, miss):
    motion = jn.solve(gimbals().with_parameters(miss=miss), TIME, order=order)
    np.testing.assert_allclose(motion.outputs["angle"][:, 0], expected(miss), rtol=0, atol=1e-8)
    later = motion.evaluate(jn.outputs.RelativeAngleOutput(("inner", "ground"), [0, 1, 0], Z, Z))
    np.testing.assert_array_equal(np.isfinite(later), True)
    angles = motion.evaluate(jn.outputs.EulerAnglesOutput(("inner",), "ZYX")).values[:, 0]
    np.testing.assert_allclose(angles[:, 0], expected(miss), rtol=0, atol=1e-8)


@pytest.mark.slow
def test_designs_count_as_they_do_alone():
    misses = np.array([0.3, 0.1, 0.05, 0.01, 1e-4])
    family = jn.solve_batch(gimbals(), {"miss": misses}, TIME, order=8)
    exact = [expected(miss) for miss in misses]
    np.testing.assert_allclose(family["angle"].values[..., 0], exact, rtol=0, atol=1e-8)


@pytest.mark.slow
def test_simulations_count_them_forward_and_backward_alone_and_side_by_side():
    misses = [0.1, 0.02, 0.001]
    ball = jn.Mechanism(
        space="spatial",
        parameters={"miss": 0.1},
        bodies={"ball": jn.Body(ORIGIN, mass=1.0, inertia=[1.0, 1.0, 1.0])},
        joints={"pin": spatial.Spherical(("ground", "ball"), ORIGIN, ORIGIN)},
        initial={"spin": drivers.RotationDriver(("ground", "ball"), [0, "cos(miss)", "sin(miss)"], f"{RATE}*t")},
        outputs={"angle": jn.outputs.RelativeAngleOutput(("ground", "ball"), Z, X, X)},
    )
    for time in (TIME, -TIME):
        together = jn.simulate_batch(ball, {"miss": misses}, time, order=2).outputs["angle"]
        for miss, beside in zip(misses, together, strict=True):
            single = jn.simulate(ball.with_parameters(miss=miss), time, order=2).outputs["angle"]
            for found in (single, beside):
                np.testing.assert_allclose(found[:, 0], swept(RATE * time, miss), rtol=0, atol=1e-8)
