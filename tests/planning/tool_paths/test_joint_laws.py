"""Laws of joints along paths with corners and spikes: of a gantry, whose joints are the place of the tool."""

import numpy as np
import pytest

import jounce as jn
from jounce.errors import TrajectoryError

CORNER = [
    jn.laws.SegmentedMotion(
        [jn.laws.Segment("polynomial", 1.0, to=0.5, begin=[0.5], end=[0.5]), jn.laws.Segment("dwell", 1.0)]
    ),
    jn.laws.SegmentedMotion(
        [jn.laws.Segment("dwell", 1.0), jn.laws.Segment("polynomial", 1.0, to=0.5, begin=[0.5], end=[0.5])]
    ),
]


def along(*laws, order=4):
    rod = jn.Inertia(1.0)
    joints = [
        jn.Joint(name, parent, child, "prismatic", axis=axis)
        for name, parent, child, axis in zip("xyz", "0ab", "abc", np.eye(3).tolist(), strict=True)
    ]
    gantry = jn.Robot("gantry", [jn.Link(name, rod) for name in "0abc"], joints)
    path = jn.planning.ToolPath(laws, start=0.0, stop=2.0)
    return gantry, path, jn.planning.follow_tool_path(gantry, "c", path, order=order).trajectory()


@pytest.mark.slow
@pytest.mark.parametrize(
    "laws, kink",
    [
        pytest.param(["0.5*abs(t - 0.987)", "t", "0.1*t"], 0.987, marks=pytest.mark.slow),
        (["0.5*abs(t - 1)", "t", "0.1*t"], 1.0),
        pytest.param([*CORNER, 0.0], 1.0, marks=pytest.mark.slow),
    ],
    ids=["between instants", "at one of them", "known"],
)
def test_a_corner_is_kept_and_its_velocities_jump(laws, kink):
    _, path, laws = along(*laws)
    times = np.union1d(np.linspace(0.0, 2.0, 4001), kink + np.array([-1e-5, -1e-7, 1e-7, 1e-5]))
    expected = path.position(times, 1)
    smooth = (np.abs(times - kink) > 1e-8) & (times < 2.0)  # at its end a law that is held has the derivatives of rest
    found = laws.derivatives(times, 1)
    np.testing.assert_allclose(found[:, 0], expected[:, 0], rtol=0, atol=2e-9)
    np.testing.assert_allclose(found[smooth, 1], expected[smooth, 1], rtol=0, atol=1e-6)
    law = laws.laws["x"]
    assert isinstance(law, jn.laws.HermiteMotion)
    instants, jumps = law.jumps(1)
    broken = jumps[1] != 0
    assert instants[broken] == pytest.approx([kink], abs=1e-9)
    after, before = expected[times > kink + 1e-8][0, 1, 0], expected[times < kink - 1e-8][-1, 1, 0]
    assert jumps[1][broken] == pytest.approx([after - before], abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("order", [0, pytest.param(4, marks=pytest.mark.slow)])
def test_a_spike_between_instants_is_followed(order):
    _, path, laws = along("0.5*t + 0.3*exp(-((t - 0.9871)/0.002)**2)", "t", 0.0, order=order)
    times = np.linspace(0.0, 2.0, 20001)
    np.testing.assert_allclose(laws.derivatives(times, 0), path.position(times, 0), rtol=0, atol=1e-8)


@pytest.mark.slow
def test_a_spike_too_narrow_to_be_followed_is_reported_with_its_instant():
    with pytest.raises(TrajectoryError, match=r"too narrow to be followed, at t = 0\.9871"):
        along("0.5*t + 0.3*exp(-((t - 0.9871)/0.0000005)**2)", "t", 0.0)


@pytest.mark.slow
def test_a_corner_is_no_path_to_be_retimed():
    gantry, _, laws = along("0.5*abs(t - 0.987)", "t", 0.0)
    with pytest.raises(TrajectoryError, match=r"kink.*s = 0\.987"):
        jn.retime(gantry, laws, {name: jn.Limits(velocity=1.0, acceleration=5.0) for name in "xyz"})
