"""How many cells resolve a path, and motions along paths that wave."""

import numpy as np
import pytest

import jounce as jn
from jounce.errors import TrajectoryError
from jounce.planning.paths.paths import Between, cells_needed, path_of

SLIDER = jn.Robot(
    "slider",
    [jn.Link("base"), jn.Link("cart", jn.Inertia(1.0))],
    [jn.Joint("x", "base", "cart", "prismatic", axis=[1, 0, 0])],
)


@pytest.mark.parametrize("waves, cells", [(1, 160), (50, 160), (100, 320), (500, 1280)])
def test_as_many_cells_as_straight_lines_need_to_follow_a_wave(waves, cells):
    # over a look of length h a line misses a sine by 1 - cos(pi waves h), a twentieth of its range at the most
    found = cells_needed(path_of({"x": f"0.5*s + 0.001*sin(2*pi*{waves}*s)"}), 2)
    assert found == cells
    assert 1 - np.cos(np.pi * waves / (4 * found)) <= 0.1
    assert found == 160 or 1 - np.cos(np.pi * waves / (2 * found)) > 0.1


def test_lines_splines_and_jumps_of_higher_derivatives_need_no_more():
    assert cells_needed(path_of({"x": "2*s"}), 2) == 160
    assert cells_needed(path_of({"x": [0.0, 0.4, 1.0, 1.2]}), 2) == 160
    assert cells_needed(path_of({"x": jn.laws.PiecewiseMotion(["t", "t + (t - 0.5)**3"], until=[0.5])}), 2) == 160


@pytest.mark.parametrize(
    "law, message",
    [
        ("0.5*s + 0.001*sin(3000*pi*s)", "too finely at s = "),
        ("0.5*s + 0.02*exp(-((s - 0.50077)/0.00005)**2)", r"(too finely|too sharply).*at s = 0\.50"),
        ("0.5*s + 0.02*exp(-((s - 0.50077)/0.0003)**2)", r"too sharply to be resolved.*at s = 0\.50"),
    ],
)
def test_a_path_that_no_cells_resolve_is_refused(law, message):
    with pytest.raises(TrajectoryError, match=message):
        jn.retime(SLIDER, {"x": law}, {"x": jn.Limits(jerk=60.0)})


@pytest.mark.slow
def test_a_jerk_is_kept_between_samples_on_a_path_with_a_hundred_waves():
    found = jn.retime(SLIDER, {"x": "0.5*s + 0.001*sin(200*pi*s)"}, {"x": jn.Limits(jerk=60.0)})
    jerk = np.abs(found.derivatives(np.linspace(0.0, found.stop, 100001), 3)[:, 3, 0]).max()
    assert 0.99 < jerk / 60.0 < 1 + 1e-6
    assert found.report.kept


@pytest.mark.parametrize("deviation", [1e-4, 1e-5, 1e-6, 1e-8])
def test_corners_rounded_more_narrowly_than_looks_are_refused_not_crept_around(deviation):
    """A time law over 160 cells took days for such a path, whose corners cost milliseconds."""
    corners = np.array([[0.0, -1.2, 1.5], [0.4, -1.0, 1.2], [1.0, -1.1, 1.0], [1.2, -1.4, 1.3]])
    path = path_of(corners, ["a", "b", "c"], 2, Between(deviation))
    with pytest.raises(TrajectoryError, match=r"too finely at s = .*allow a larger deviation"):
        cells_needed(path, 2)
