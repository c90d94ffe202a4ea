"""Motions that begin with the state of a running robot: on the path, and beside it."""

import numpy as np
import pytest

import jounce as jn
from jounce.errors import JounceError, TrajectoryError

LIMITS = {name: jn.Limits(velocity=2.0, acceleration=8.0, jerk=100.0) for name in ("x", "y")}


def table():
    carts = [jn.Link(name, jn.Inertia(1.0)) for name in ("along", "across")]
    joints = [
        jn.Joint("x", "base", "along", "prismatic", axis=[1, 0, 0]),
        jn.Joint("y", "along", "across", "prismatic", axis=[0, 1, 0]),
    ]
    return jn.Robot("table", [jn.Link("base"), *carts], joints)


def most(found, order):
    return np.abs(found.derivatives(np.linspace(0.0, found.stop, 6001), order)[:, order]).max()


def kept(found):
    return all(most(found, k) <= bound * (1 + 1e-6) for k, bound in ((1, 2.0), (2, 8.0), (3, 100.0)))


def test_a_state_on_the_path_is_gone_on_with():
    path = [[0.0, 0.0], [1.0, 0.4], [2.0, 0.0]]
    first = jn.retime(table(), path, LIMITS)
    whole = first.stop
    at = 0.4 * whole
    state = first.derivatives([at], 2)[0]
    s = float(np.asarray(first.progress(jn.Jet([np.array([at])])).coefficients[0])[0])
    rest = {name: jn.laws.FollowingMotion(law, f"{s!r} + t*{1 - s!r}") for name, law in first.path.laws.items()}
    noisy = state + 1e-9 * np.array([[0.0], [0.0], [1.0]])
    found = jn.retime(table(), rest, LIMITS, state=noisy)
    assert found.stop == pytest.approx(whole - at, rel=3e-3)
    np.testing.assert_allclose(found.derivatives([0.0], 2)[0], state, atol=1e-5)
    assert kept(found)
    assert found.report.hand_over


@pytest.mark.slow
def test_from_a_running_motion_onto_a_new_path():
    running = jn.JointTrajectory({"x": "1.2*t", "y": "0.3*sin(2*t)"}, 0.0, 2.0)
    state = running.derivatives([0.5], 2)[0]
    path = [[1.0, 0.5], [1.5, 1.0], [1.0, 1.5], [0.0, 1.5]]
    found = jn.retime(table(), path, LIMITS, names=("x", "y"), state=state)
    np.testing.assert_allclose(found.derivatives([0.0], 2)[0], state, atol=2e-5)
    end = found.derivatives([found.stop], 2)[0]
    np.testing.assert_allclose(end, [[0.0, 1.5], [0.0, 0.0], [0.0, 0.0]], atol=1e-6)
    assert kept(found)
    assert "from the running state onto the path, joined at s = 0." in found.path.words
    # later it is on the path: the last quarter is that of a path without a state
    own = jn.retime(table(), path, LIMITS, names=("x", "y")).path.derivatives(np.linspace(0, 1, 8001), 0)[:, 0]
    late = found.derivatives(np.linspace(0.85 * found.stop, found.stop, 50), 0)[:, 0]
    assert max(np.linalg.norm(own - q, axis=1).min() for q in late) < 2e-4
    slower = jn.retime(table(), path, LIMITS, names=("x", "y"), state=state, duration=1.5 * found.stop)
    assert slower.stop == pytest.approx(1.5 * found.stop, rel=1e-9)
    np.testing.assert_allclose(slower.derivatives([0.0], 2)[0], state, atol=2e-5)
    assert kept(slower)


@pytest.mark.parametrize(
    "state, message",
    [
        ([[0.0, 0.0]], "state: must hold positions, velocities"),
        ([[0.0, 0.0], [np.nan, 0.0]], "state: must be finite"),
        ([[0.0, 0.0], [2.1, 0.0]], "state: the velocity of x is above its limit of 2"),
        ([[0.0, 0.0], [0.0, 0.0], [0.0, 1.0]], "state: has accelerations or jerks at rest"),
        ([[-9.0, 0.0], [2.0, 0.0]], "state: no way from this state onto the path"),
    ],
)
def test_bad_states_are_named(state, message):
    limits = {name: jn.Limits(velocity=2.0, acceleration=8.0, lower=-1.0) for name in ("x", "y")}
    with pytest.raises(JounceError, match=message):
        jn.retime(table(), [[0.0, 0.0], [1.0, 0.4], [2.0, 0.0]], limits, state=state)


def test_a_state_is_not_given_twice():
    path, state = [[0.0, 0.0], [1.0, 0.4]], np.zeros((2, 2))
    with pytest.raises(TrajectoryError, match="rates: the state determines the initial rate"):
        jn.retime(table(), path, LIMITS, state=state, rates=(0.1, 0.0))
