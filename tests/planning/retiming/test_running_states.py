"""Motions that begin with the state of a running robot: on the path, and beside it."""

import numpy as np
import pytest

import jounce as jn
from jounce.errors import JounceError, SolveError, TrajectoryError

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


@pytest.mark.slow
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
        ([[-9.0, 0.0], [2.0, 0.0]], "state: the position of x is below the end of its range, -1, .* got -9"),
        (
            [[0.0, 0.0], [1.0, 0.5], [-8.1, 0.0]],
            "state: the acceleration of x is above its limit of 8 m/s.2 .* got -8.1",
        ),
        ([[0.0, 0.0], [1.0, 0.5], [0.0, 6.0]], "state: the force of y is above its limit of 5 N .* got 6"),
        ([[0.0, 0.0], [1.0, 0.5], [0.0, 1.0], [-101.0, 1.0]], "state: the jerk of x is above its limit of 100 .* -101"),
    ],
)
def test_bad_states_are_named(state, message):
    common = {"velocity": 2.0, "acceleration": 8.0, "jerk": 100.0, "lower": -1.0}
    limits = {"x": jn.Limits(**common), "y": jn.Limits(**common, effort=5.0)}
    with pytest.raises(JounceError, match=message):
        jn.retime(table(), [[0.0, 0.0], [1.0, 0.4], [2.0, 0.0]], limits, state=state)


def test_a_state_is_not_given_twice():
    path, state = [[0.0, 0.0], [1.0, 0.4]], np.zeros((2, 2))
    with pytest.raises(TrajectoryError, match="rates: the state determines the initial rate"):
        jn.retime(table(), path, LIMITS, state=state, rates=(0.1, 0.0))


def test_a_state_that_cannot_be_braked_is_refused_by_the_limit_in_the_way():
    limits = {name: jn.Limits(velocity=2.0, acceleration=8.0, jerk=100.0, upper=2.0) for name in ("x", "y")}
    state = [[1.9, 0.0], [1.8, 0.0]]  # braking takes 0.2 m at least
    with pytest.raises(
        SolveError, match=r"state: no motion from this state .* position of x would exceed its limit by"
    ):
        jn.retime(table(), [[0.0, 0.0], [1.0, 0.4], [1.9, 0.0]], limits, state=state)


def stopped(found, names=("x", "y")):
    """Positions 1e-4 s apart, and their central differences: velocities, accelerations, jerks."""
    step = 1e-4
    times = np.arange(0.0, found.stop, step)
    q = found.derivatives(times, 0)[:, 0]
    v = (q[2:] - q[:-2]) / (2 * step)
    a = (q[2:] - 2 * q[1:-1] + q[:-2]) / step**2
    j = (a[2:] - a[:-2]) / (2 * step)
    return q, v, a, j


@pytest.mark.slow
@pytest.mark.parametrize("level", [1, 2, 3])
def test_states_at_a_limit_are_braked_and_turned(level):
    running = jn.retime(table(), [[0.0, 0.0], [1.0, 0.4], [2.0, -0.5]], LIMITS)
    times = np.linspace(0.1, 0.9, 2001) * running.stop
    every = running.derivatives(times, 3)
    bounds = np.array([np.inf, 2.0, 8.0, 100.0])
    at = int(np.argmax(np.abs(every[:, level]).max(axis=1)))
    assert np.abs(every[at, level]).max() > 0.99 * bounds[level]
    state = every[at, : max(level + 1, 3)]
    back = [[0.5, 0.5], [0.0, 1.0], [-1.0, 0.5]]  # behind it
    found = jn.retime(table(), back, LIMITS, names=("x", "y"), state=state)
    np.testing.assert_allclose(found.derivatives([0.0], len(state) - 1)[0], state, rtol=1e-5, atol=1e-5)
    q, *differences = stopped(found)
    for values, bound in zip(differences, bounds[1:], strict=True):
        assert np.abs(values).max() <= bound * (1 + 1e-3)
    np.testing.assert_allclose(q[-1], back[-1], atol=1e-4)
    assert found.report.kept
    assert found.report.hand_over
    until = float(found.path.words.removesuffix(" s").rpartition(" for ")[2])
    joined = found.derivatives([until], 0)[0, 0]
    own = jn.retime(table(), back, LIMITS, names=("x", "y")).path.derivatives(np.linspace(0, 1, 8001), 0)[:, 0]
    assert np.linalg.norm(own - joined, axis=1).min() < 5e-3  # of rounded words
    # nothing jumps, also where it joins the path
    jumps = np.abs(np.diff(differences[1], axis=0)).max()
    assert jumps <= 100.0 * 1e-4 * 1.01


@pytest.mark.slow
def test_a_single_joint_stops_and_turns():
    slide = jn.Joint("slide", "base", "cart", "prismatic", axis=[1, 0, 0])
    cart = jn.Robot("cart", [jn.Link("base"), jn.Link("cart", jn.Inertia(1.0))], [slide])
    limits = {"slide": jn.Limits(velocity=1.0, acceleration=2.0, jerk=20.0)}
    state = [[0.0], [1.0], [0.0]]
    found = jn.retime(cart, [[0.0], [-2.0]], limits, state=state)
    _, v, a, j = stopped(found)
    assert [np.abs(x).max() <= bound * 1.001 for x, bound in ((v, 1.0), (a, 2.0), (j, 20.0))] == [True] * 3
    # braking at 2 m/s^2, with ramps of the acceleration of 0.1 s: 0.275 m are left behind at least
    reached = float(found.derivatives(np.linspace(0.0, found.stop, 4001), 0)[:, 0].max())
    assert 0.275 <= reached <= 0.35
    assert found.derivatives([found.stop], 1)[0] == pytest.approx(np.array([[-2.0], [0.0]]), abs=1e-8)


@pytest.mark.slow
def test_states_of_the_panda_keep_torques_and_rates_by_pinocchio():
    pinocchio = pytest.importorskip("pinocchio")
    robot = jn.load_robot("examples/robots/panda.urdf")
    limits = jn.io.load_limits("examples/limits/franka_panda.yaml", robot)
    names = [name for name in robot.joint_names if "finger" not in name]
    rng = np.random.default_rng(5)
    middle = np.array([(limits[n].lower + limits[n].upper) / 2 for n in names])
    half = np.array([(limits[n].upper - limits[n].lower) / 2 for n in names])
    first, second = (middle + 0.4 * half * rng.uniform(-1, 1, (5, len(names))) for _ in range(2))
    running = jn.retime(robot, first, limits, names=names)
    state = running.derivatives([0.37 * running.stop], 2)[0]
    onto = np.concatenate([state[:1], second[1:]])
    found = jn.retime(robot, onto, limits, names=names, state=state)
    np.testing.assert_allclose(found.derivatives([0.0], 2)[0], state, rtol=1e-5, atol=1e-5)
    model = pinocchio.buildModelFromUrdf("examples/robots/panda.urdf")
    data = model.createData()
    step = 2e-4
    times = np.arange(0.0, found.stop, step)
    motion = found.derivatives(times, 2)
    place = [model.joints[model.getJointId(name)].idx_q for name in names]
    torques = np.zeros((len(times), len(names)))
    for k, (q, v, a) in enumerate(motion):
        whole = np.zeros((3, model.nq))
        whole[:, place] = q, v, a
        torques[k] = pinocchio.rnea(model, data, *whole)[place]
    effort = np.array([limits[n].effort for n in names])
    assert np.abs(torques / effort).max() <= 1 + 1e-6
    assert np.abs(np.diff(torques, axis=0) / step).max() <= 1000.0 * (1 + 1e-3)


@pytest.mark.slow
def test_a_state_at_the_limits_of_a_point_and_by_direction():
    limits = jn.planning.MotionLimits(
        LIMITS,
        points=(jn.planning.PointLimits("across", speed=1.5, acceleration=6.0),),
        backward={"x": jn.Limits(velocity=0.8)},
    )
    state = np.array([[0.0, 0.0], [0.9, 1.2], [-0.8, 0.6]])  # a speed of 1.5 m/s along the vector (3, 4) / 5
    found = jn.retime(table(), [[-0.2, 0.5], [-1.0, 1.0], [-1.5, 0.0]], limits, state=state)
    _, v, a, j = stopped(found)
    assert np.linalg.norm(v, axis=1).max() <= 1.5 * (1 + 1e-5)
    assert np.linalg.norm(a, axis=1).max() <= 6.0 * (1 + 1e-3)
    assert v[:, 0].min() >= -0.8 * (1 + 1e-5)
    assert np.abs(j).max() <= 100.0 * (1 + 1e-3)
    np.testing.assert_allclose(found.derivatives([0.0], 2)[0], state, atol=1e-5)
    state[1] *= 1.001
    with pytest.raises(TrajectoryError, match=r"speed of the point of across is above its limit of 1.5 m/s .* got 1.5"):
        jn.retime(table(), [[-0.2, 0.5], [-1.0, 1.0], [-1.5, 0.0]], limits, state=state)


@pytest.mark.slow
@pytest.mark.parametrize("share", [1 - 1e-9, 1 + 5e-7])
def test_a_state_at_the_limit_of_a_force_that_bears_weight(share):
    slide = jn.Joint("slide", "base", "lift", "prismatic", axis=[0, 0, 1])
    lift = jn.Robot("lift", [jn.Link("base"), jn.Link("lift", jn.Inertia(1.0))], [slide])
    limits = {"slide": jn.Limits(velocity=1.0, effort=15.0, effort_rate=200.0)}
    gravity = 9.81
    state = np.array([[0.3], [-0.8], [15.0 * share - gravity]])  # it slows down as fast as it can
    found = jn.retime(lift, [[0.5], [1.5]], limits, state=state)
    _, v, a, j = stopped(found)
    assert np.abs(v).max() <= 1.0 * (1 + 1e-6)
    assert np.abs(a + gravity).max() <= 15.0 * (1 + 1e-4)
    assert np.abs(j).max() <= 200.0 * (1 + 1e-3)
    np.testing.assert_allclose(found.derivatives([0.0], 2)[0], state, atol=3e-5)
    assert found.report.kept
