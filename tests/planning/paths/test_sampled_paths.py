"""Paths of samples: within a deviation of each of them, whatever noise, rounding and dwells do."""

import itertools

import numpy as np
import pytest

import jounce as jn
from jounce.errors import TrajectoryError
from jounce.planning.paths.paths import Between, cells_needed, checked, path_of
from jounce.planning.paths.sampled_paths import path_of_samples
from jounce.planning.paths.straight_lines import simplified_polyline

pytestmark = pytest.mark.long


def rise(t):
    """Return a rise from 0 to 1 between 1 and 3, at rest before and after: its jerk jumps there."""
    x = np.clip((t - 1) / 2, 0, 1)
    return x**3 * (10 - 15 * x + 6 * x**2)


def distances(places, points):
    """Return how far places are from straight lines between points: each from all of them."""
    found = np.full(len(places), np.inf)
    for a, b in itertools.pairwise(points):
        along, since = b - a, places - a
        share = np.clip(since @ along / max(along @ along, 1e-300), 0, 1)
        found = np.minimum(found, np.linalg.norm(since - share[:, None] * along, axis=1))
    return found


def samples(kind):
    rng = np.random.default_rng(7)
    t = np.linspace(0.0, 4.0, 201)
    two = np.stack([rise(t), 0.3 * rise(t) - 0.5 * rise(t - 0.8)], axis=1)
    match kind:
        case "rounded":
            return t, np.round(rise(t), 4)[:, None]
        case "exact dwells":
            return t, rise(t)[:, None]
        case "few":
            return np.arange(6.0), np.array([[0.0, 0, 0, 1, 1, 1]]).T
        case "noise":
            return t, two + rng.normal(scale=2e-5, size=two.shape)
        case "encoder":
            return t, np.round(two * 2000) / 2000  # coarser than the deviation
        case "there and back":
            return t, np.round(np.stack([rise(2 * t) - rise(2 * t - 3), 0 * t], axis=1), 5)
        case "corners":
            corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 1, 0], [0, 0.2, 0.7], [0.5, 0.5, 0.5]], float)
            return np.array([0, 1, 1.5, 3, 4, 4.1]), corners
        case "two points":
            return np.array([0.0, 1.0, 1.5, 2.0, 3.0, 4.0]), np.outer([0, 0, 0, 0, 0, 1.0], [1.0, -2.0])
        case "uneven":
            t = np.sort(rng.uniform(0, 4, 150))
            return t, np.round(np.stack([rise(t), -rise(t)], axis=1), 5)
    raise AssertionError(kind)


KINDS = "rounded", "exact dwells", "few", "noise", "encoder", "there and back", "corners", "two points", "uneven"


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("deviation", [None, 1e-2])
def test_a_path_of_samples_is_near_them(kind, deviation):
    times, points = samples(kind)
    names = [f"j{k}" for k in range(points.shape[1])]
    path = path_of(jn.JointTrajectory.from_samples(times, points, names), None, 2, Between(deviation))
    stated = min(1e-3, 1e-3 * np.linalg.norm(np.ptp(points, axis=0))) if deviation is None else deviation
    assert path.allowed == pytest.approx(stated)
    places = path.derivatives(np.linspace(path.start, path.stop, 4001), 0)[:, 0]
    apart = stated * np.sqrt(points.shape[1])  # of joints that are each within it
    assert path.deviation <= stated + 2e-9
    assert distances(places, points).max() <= 1.2 * apart
    assert distances(points, places).max() <= 1.2 * apart  # and it leaves none of them out
    np.testing.assert_allclose(places[[0, -1]], points[[0, -1]], atol=stated)
    inside = stated if len(points) >= 12 else np.ptp(points, axis=0) * 1e-7 + 1e-12
    if kind not in ("noise", "uneven"):
        assert (places.min(axis=0) >= points.min(axis=0) - inside).all()
        assert (places.max(axis=0) <= points.max(axis=0) + inside).all()


@pytest.mark.parametrize("kind", ["rounded", "exact dwells", "few", "noise"])
def test_a_path_of_one_rise_does_not_turn_back(kind):
    times, points = samples(kind)
    path = path_of(jn.JointTrajectory.from_samples(times, points[:, :1], ["j"]), None, 2)
    values = path.derivatives(np.linspace(path.start, path.stop, 2001), 1)[:, :, 0]
    assert values[1:-1, 1].min() > 0
    assert (np.diff(values[:, 0]) > 0).all()
    assert cells_needed(path, 2) == 160


def test_samples_of_a_smooth_motion_still_have_splines_through_them():
    t = np.linspace(0.0, 3.0, 301)
    points = np.stack([np.sin(t), np.cos(2 * t)], axis=1)
    path = path_of(jn.JointTrajectory.from_samples(t, points, ["a", "b"]), None, 2)
    assert path.words == "splines of degree 5 through 301 samples"
    sag = np.sqrt(17) * 0.01**2 / 8  # of the chord of a curve of that second derivative
    assert path.deviation < 1.2 * sag
    places = path.derivatives(np.linspace(path.start, path.stop, 501), 0)[:, 0]
    np.testing.assert_allclose(places[:, 1], 1 - 2 * places[:, 0] ** 2, atol=1e-8)


def test_splines_through_positions_and_velocities_state_their_degree():
    t = np.linspace(0.0, 3.0, 301)
    law = jn.laws.HermiteSplineMotion(t, np.stack([np.sin(t), np.cos(t)], axis=1))
    path = path_of(jn.JointTrajectory({"a": law}, 0.0, 3.0), None, 2)
    assert path.words == "splines of degree 5 through 301 samples"


@pytest.mark.parametrize("kind", ["rounded", "few", "noise", "corners"])
def test_where_times_count_dwells_stay_still_and_each_instant_is_near(kind):
    times, points = samples(kind)
    names = [f"j{k}" for k in range(points.shape[1])]
    given = jn.JointTrajectory.from_samples(times, points, names)
    path = checked(path_of_samples(given, 2, 2e-3, timed=True), 2)
    at = np.linspace(times[0], times[-1], 3001)
    lines = np.stack([np.interp(at, times, column) for column in points.T], axis=1)
    values = path.derivatives(at, 1)
    own = np.abs(path.derivatives(times, 0)[:, 0] - points)
    if len(times) >= 12:
        assert own.max() <= 2e-3 * (1 + 1e-9)
    else:
        assert np.linalg.norm(values[:, 0] - lines, axis=1).max() <= 2e-3 * (1 + 1e-9)
    if kind in ("rounded", "few"):
        dwell = at < (0.8 if kind == "rounded" else 1.5) - 1e-12  # a rounded 0.8 belongs to the motion after it
        assert np.abs(values[dwell, 1]).max() == 0.0


def test_positions_alone_of_a_controller_are_samples():
    corner = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    laws = {name: jn.laws.HermiteMotion([0.0, 1.0, 2.0], corner[:, [k]]) for k, name in enumerate("ab")}
    path = path_of(jn.JointTrajectory(laws, 0.0, 2.0), None, 2, Between(0.01))
    places = path.derivatives(np.linspace(0, 1, 2001), 0)[:, 0]
    assert 0.001 < distances(places, corner).max() <= 0.01


def test_waypoints_are_met_unless_a_deviation_is_given():
    corner = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    through, near = path_of(corner, ["a", "b"], 2), path_of(corner, ["a", "b"], 2, Between(0.02))
    at = np.linspace(0, 1, 3001)
    assert (through.words, through.allowed) == ("splines of degree 3 through 4 waypoints", None)
    assert distances(corner, through.derivatives(at, 0)[:, 0]).max() < 1e-3
    assert through.deviation == pytest.approx(distances(through.derivatives(at, 0)[:, 0], corner).max(), rel=1e-2)
    assert distances(near.derivatives(at, 0)[:, 0], corner).max() <= 0.02
    again = path_of(through, None, 2, Between(0.02))  # as a file of waypoints is read before the deviation is known
    np.testing.assert_array_equal(again.derivatives(at, 0), near.derivatives(at, 0))


def test_a_kink_of_a_path_is_rounded_within_a_deviation():
    law = {"a": "abs(s - 0.3)", "b": "s"}
    with pytest.raises(TrajectoryError, match="round it by a deviation"):
        path_of(law, None, 2)
    places = path_of(law, None, 2, Between(1e-3)).derivatives(np.linspace(0, 1, 4001), 0)[:, 0]
    assert 1e-4 < np.abs(places[:, 0] - np.abs(places[:, 1] - 0.3)).max() <= np.sqrt(2) * 1e-3


def test_what_would_bend_too_sharply_is_refused_by_joint_and_instant():
    t = np.linspace(0.0, 2.0, 2001)
    rng = np.random.default_rng(0)
    points = np.stack([0.1 * t, rng.normal(scale=0.05, size=t.size)], axis=1)
    given = jn.JointTrajectory.from_samples(t, points, ["even", "noisy"])
    with pytest.raises(TrajectoryError, match=r"noisy: .*about t = \d.* s, .* choose a larger one"):
        path_of(given, None, 2, Between(1e-6))
    with pytest.raises(TrajectoryError, match=r"(even|noisy): .*(choose|allow) a larger"):
        cells_needed(path_of(given, None, 2, Between(0.02)), 2)
    with pytest.raises(TrajectoryError, match="does not move"):
        path_of(jn.JointTrajectory.from_samples(t, np.ones((t.size, 1)), ["j"]), None, 2)


def test_points_are_taken_together_in_their_sequence():
    back = np.array([[0.0], [0.5], [1.0], [0.5], [0.0], [0.0], [1.0]])
    chosen, off = simplified_polyline(back, 1e-3)
    assert back[chosen, 0].tolist() == [0.0, 1.0, 0.0, 1.0]
    assert off == 0.0
    rng = np.random.default_rng(3)
    walk = np.cumsum(rng.normal(size=(400, 3)), axis=0)
    chosen, off = simplified_polyline(walk, 1.5)
    assert off <= 1.5
    assert (np.diff(chosen) > 0).all()
    for a, b in itertools.pairwise(chosen):
        assert distances(walk[a : b + 1], walk[[a, b]]).max() <= off + 1e-12
