"""Step control: the same step lengths and decisions for many designs as for one motion."""

from typing import Any

import jax
import numpy as np
import pytest

from jounce.kinematics.continuation.step_control import (
    GROWTH,
    ExpansionPoint,
    StepLimits,
    StopReason,
    initial_control,
    next_controls,
    plan_next_step,
)
from jounce.kinematics.status import Status

LIMITS = StepLimits(np.asarray(1.0), np.asarray(1e-10))


def placed(instant: Any, safe_step: Any, det_rate: Any = 0.0):
    """Return the control of designs that have reached given instants."""
    point = ExpansionPoint(*(np.array(x, float) for x in np.broadcast_arrays(instant, safe_step, 1.0, det_rate)))
    return initial_control(point, np.array(point.instant))


def decided(control, status, there):
    """Return the control after a step, and whether the step was taken."""
    one = jax.tree.map(lambda x: x[:1], (control, status, there))
    return next_controls.program(LIMITS, one)((control, status, there))


def test_the_shortest_limit_makes_the_step_and_the_last_takes_a_sliver():
    safe, det_rate = np.array([0.2, 0.5, 0.95, 2.0]), np.array([-1.0, -4.0, 0.0, 0.0])
    found = plan_next_step(placed(0.0, safe, det_rate=det_rate), LIMITS)
    np.testing.assert_allclose(found.step, [0.2, 0.4 / 4, 1.0, 1.0], rtol=1e-15)
    np.testing.assert_allclose(found.target, [0.2, 0.1, 1.0, 1.0], rtol=1e-15)
    assert set(np.asarray(found.ending).tolist()) == {StopReason.UNFINISHED}


def test_each_design_has_an_outcome_of_its_own():
    count = 5
    control = plan_next_step(placed(0.0, np.full(count, 0.1)), LIMITS)
    control = jax.tree.map(np.array, control)
    control.step[4], control.target[4] = 1e-11, 1e-11
    status = np.full(count, int(Status.OK))
    status[[1, 4]] = int(Status.NOT_CONVERGED)
    # one goes on, one is halved, one turns over too fast, one is beside a singular position, one is stuck
    det_rate = np.array([0.0, 0.0, -11.0, -1e4, 0.0])
    there = ExpansionPoint(control.target, np.full(count, 0.5), np.full(count, 1.0), det_rate)
    there.det_rate[3], there.radius[3] = -9.0, 100.0
    after, taken = decided(control, status, there)
    np.testing.assert_array_equal(taken, [True, False, False, True, False])
    np.testing.assert_allclose(after.step[:3], [GROWTH * 0.1, 0.05, 0.05], rtol=1e-15)
    np.testing.assert_allclose(after.expansion_point.instant, [0.1, 0, 0, 0.1, 0], rtol=1e-15)
    expected = [StopReason.UNFINISHED] * 3 + [StopReason.PASSAGE, StopReason.REFUSED]
    np.testing.assert_array_equal(after.ending, list(map(int, expected)))


@pytest.mark.parametrize("status", [Status.OK, Status.UNDEFINED, Status.BRANCH_JUMP, Status.INADMISSIBLE])
def test_a_design_among_many_is_decided_as_alone(status):
    random = np.random.default_rng(1)
    count = 9
    safe, det_rate = random.uniform(0.01, 0.5, count), random.normal(size=count) * 5
    control = jax.tree.map(
        np.asarray, plan_next_step(placed(random.uniform(0, 1, count), safe, det_rate=det_rate), LIMITS)
    )
    there = ExpansionPoint(
        control.target, random.uniform(0.01, 0.5, count), np.ones(count), random.normal(size=count) * 5
    )
    outcome = np.full(count, int(status))
    many = decided(control, outcome, there)
    for k in range(count):
        single = decided(*jax.tree.map(lambda x, k=k: x[k : k + 1], (control, outcome, there)))
        jax.tree.map(lambda x, y, k=k: np.testing.assert_array_equal(x[k : k + 1], y), many, single)
