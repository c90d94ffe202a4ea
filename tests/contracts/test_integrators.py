"""Laws that every integrator keeps, on mechanisms of the bank: a closed loop, an open chain in space."""

import numpy as np
import pytest

import jounce as jn
from tests.problems import dynamics

METHODS = {
    "Taylor": (jn.Taylor(), 1e-15),
    "Obreshkov 6": (jn.Obreshkov(6), 1e-12),
    "Obreshkov 8": (jn.Obreshkov(8), 1e-13),
}
MECHANISMS = {
    "free four-bar": dynamics.free_four_bar,
    "spatial double pendulum": dynamics.spatial_double_pendulum,
}
# each compiles for half a minute: the implicit ones move a closed loop, with the highest of their orders
APART = {(f"Obreshkov {order}", name) for order in (6, 8) for name in MECHANISMS if name != "free four-bar"}
APART |= {("Obreshkov 6", "free four-bar")}
CASES = [
    pytest.param(method, name, marks=pytest.mark.slow)  # a minute each; tests/integrate has quick ones
    for name in MECHANISMS
    for method in METHODS
    if (method, name) not in APART
]
GRID = np.linspace(0.0, 1.0, 9)


@pytest.mark.parametrize("method, name", CASES)
def test_laws_of_a_simulation(method, name):
    mechanism, (kind, tolerance) = MECHANISMS[name](), METHODS[method]
    motion = jn.simulate(mechanism, GRID, method=kind, tolerance=tolerance)
    # constraints are kept to rounding, the energy as the tolerance allows
    assert motion.drift.max() <= 1e-13
    size = np.ptp(0.5 * motion.energy) + np.max(np.abs(motion.energy)) + 1.0
    assert np.ptp(motion.energy) <= (1e-13 + 1e3 * tolerance) * size
    # dense output is continuous where steps meet
    ends = motion.dense_output.start[1:]
    gap = 1e-12
    before, after = (motion.at(ends + side * gap, order=1) for side in (-1, 1))
    for output, values in before.outputs.items():
        jump = after.outputs[output][:, 0] - values[:, 0]
        moved = 2 * gap * values[:, 1]
        assert np.allclose(jump, moved, rtol=0, atol=1e-12 + 1e3 * tolerance)
    # each derivative is the rate of the one below
    width = 3e-4
    around = motion.at(np.concatenate([GRID[1:-1] + side * width for side in (-2, -1, 1, 2)]))
    for output, values in around.outputs.items():
        a, b, c, d = np.split(values, 4)
        difference = (a - 8 * b + 8 * c - d) / (12 * width)  # of fourth order in the width
        found = motion.outputs[output][1:-1]
        for k in range(4):
            scale = np.max(np.abs(found[:, k + 1])) + 1.0
            assert np.max(np.abs(difference[:, k] - found[:, k + 1])) <= 1e-6 * scale


@pytest.mark.slow
@pytest.mark.parametrize("method", ["Taylor", "Obreshkov 6"])
def test_forward_and_back_again(method):
    kind, tolerance = METHODS[method]
    there = jn.simulate(dynamics.simple_pendulum(0.3, 1.0), [0.0, 2.0], 1, method=kind, tolerance=tolerance)
    angle, rate = (float(x) for x in there.outputs["angle"][1])
    mechanism = dynamics.simple_pendulum(angle - 2.0 * rate, rate)
    back = jn.simulate(mechanism, [2.0, 0.0], 1, method=kind, tolerance=tolerance)
    assert np.allclose(back.outputs["angle"][1], [0.3, 1.0], rtol=0, atol=1e-13 + 1e2 * tolerance)
