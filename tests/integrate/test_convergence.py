"""Every integrator converges at the order of its theory, in the plane and in space, forward and backward in time."""

import numpy as np
import pytest

import jounce as jn
from jounce.dynamics.forward.initial_state import consistent_start
from tests.problems import dynamics
from tests.problems.marches import LENIENT, ends, marched, onwards, orders

BIG = 100.0  # s: a fixed step, which the steps of the single runs cut short
BODIES = {"plane": dynamics.double_pendulum, "space": dynamics.spatial_double_pendulum}
METHODS = {  # steps in s, between those that are too long for the leading term of the error and rounding
    "Taylor 5": (jn.Taylor(5, step=BIG), [1 / 64, 1 / 96, 1 / 128]),
    "Taylor 8": (jn.Taylor(8, step=BIG), [1 / 48, 1 / 64, 1 / 96]),
    "Taylor 12": (jn.Taylor(12, step=BIG), [1 / 24, 1 / 32]),
    "Obreshkov 2": (jn.Obreshkov(2, step=BIG), [1 / 64, 1 / 96, 1 / 128]),
    "Obreshkov 4": (jn.Obreshkov(4, step=BIG), [1 / 32, 1 / 48, 1 / 64]),
    "Obreshkov 8": (jn.Obreshkov(8, step=BIG), [1 / 24, 1 / 32, 1 / 40]),
}
QUICK = {("Taylor 5", "plane"), ("Obreshkov 4", "plane")}
SPATIAL = ("Taylor 5", "Obreshkov 4")  # these stand for the others: programs in space compile for long
CASES = [
    pytest.param(method, space, marks=() if (method, space) in QUICK else pytest.mark.slow)
    for method in METHODS
    for space in BODIES
    if space == "plane" or method in SPATIAL
]
STARTS: dict = {}


def ready(space):
    """Return the start of a pendulum in motion, made once."""
    if space not in STARTS:
        moving = {"first": 0.4, "second": 1.3, "first_rate": 1.0, "second_rate": -2.0}
        mechanism = BODIES[space](**moving) if space == "plane" else BODIES[space]()
        STARTS[space] = consistent_start(mechanism, 0.0)
    return STARTS[space]


def exact(space, stop):
    """Return the end of a run of which the error is near rounding: short steps of a series of high order."""
    if (space, stop) not in STARTS:
        front, _ = marched(ready(space), jn.Taylor(20), stop, 1e-15, longest=0.05)
        STARTS[space, stop] = ends(front)
    return STARTS[space, stop]


@pytest.mark.slow
@pytest.mark.parametrize("name, space", CASES)
def test_measured_order_is_that_of_theory(name, space):
    method, steps = METHODS[name]
    expected = int(name.split()[1])
    # forward, errors of the highest orders reach rounding before the leading term stands alone; backward, the motion is
    # livelier, and those from the eighth order on shrink somewhat faster still than they will
    for stop in (0.5, -0.5) if expected <= 8 else (-0.5,):
        front, _ = marched(ready(space), method, stop, LENIENT, steps, lanes=len(steps))
        errors = np.max(np.abs(ends(front) - exact(space, stop)), axis=0)
        found = orders(errors, steps)
        assert errors[-1] > 3e-14, errors  # clear of rounding
        assert np.all(found > expected - 0.3), (stop, errors, found)
        assert np.all(found < expected + (1.5 if expected >= 8 and stop < 0 else 0.5)), (stop, errors, found)


@pytest.mark.slow
def test_the_exact_runs_are_exact():
    time, kinds = dynamics.dynamic_reference("double_pendulum")
    ready = consistent_start(dynamics.double_pendulum(), 0.0)
    front, _ = marched(ready, jn.Taylor(20), float(time[0]), 1e-15, longest=0.05)
    found = front.expansion.state.attitude[:, 0, :, 0]
    expected = np.array([kinds["angles"][name][0] for name in "ab"]).T
    offset = np.round((expected[0] - found[0]) / (np.pi / 2)) * np.pi / 2  # the judge counts from the vertical
    assert np.allclose(found[0], expected[0] - offset, rtol=0, atol=3e-14)
    assert np.allclose(found[1], expected[1], rtol=3e-14)


@pytest.mark.slow
@pytest.mark.parametrize("method", [jn.Taylor(), jn.Obreshkov(4)], ids=["Taylor", "Obreshkov 4"])
def test_back_in_time_to_the_start(method):
    prepared = ready("plane")
    tolerance = 1e-12 if method != jn.Obreshkov(4) else 1e-9
    there, _ = marched(prepared, method, 1.0, tolerance)
    back, _ = onwards(prepared, method, there, 0.0, tolerance)
    first = np.concatenate([np.asarray(part).ravel() for part in prepared.state])
    assert np.max(np.abs(ends(there)[:, 0] - first)) > 1
    assert np.max(np.abs(ends(back)[:, 0] - first)) < 1000 * tolerance  # 2e-10 measured for Taylor: neighbors part


@pytest.mark.slow
def test_the_trap_of_a_double_pendulum_at_horizontal_rest():
    # all odd pairs of coefficients vanish at the start; a control by the last two would take any step there.
    # chaos: an error grows by about 1e5 in these ten seconds. Reference: heyoka in quadruple precision.
    mechanism = dynamics.double_pendulum()
    motion = jn.simulate(mechanism, [0.0, 10.0], order=1)
    angles, rates = ([motion.outputs[name][1, k] for name in "ab"] for k in (0, 1))
    time, kinds = dynamics.dynamic_reference("double_pendulum")
    assert time[-1] == 10
    expected = np.array([kinds["angles"][name][-1, :2] for name in "ab"])
    turns = (expected[:, 0] - angles) / (np.pi / 2)
    assert np.allclose(expected[:, 0] - np.round(turns) * np.pi / 2, angles, rtol=0, atol=1e-9)
    assert np.allclose(rates, expected[:, 1], rtol=0, atol=1e-8)


@pytest.mark.slow
def test_a_polynomial_motion_is_exact_in_one_step():
    falling = consistent_start(dynamics.thrown_stone(), 0.0)
    expected = [1 + 2 * 3, 2 + 5 * 3 - 9.81 * 9 / 2, 0.5 - 9, 2, 5 - 9.81 * 3, -3]
    for method in (jn.Taylor(), jn.Obreshkov(4)):
        front, tried = marched(falling, method, 3.0, 1e-12)
        assert tried == 1
        assert np.allclose(ends(front)[:, 0], expected, rtol=1e-15, atol=1e-14)
