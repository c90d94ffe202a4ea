"""Logs whose stamps are dates, or seconds and nanoseconds, whose cells are empty, and whose rows end with a comma."""

import numpy as np
import pytest

import jounce as jn
from jounce.errors import RecordingWarning, TrajectoryError
from jounce.io.files import long_tables

TIMES = np.round(np.arange(0.0, 1.0, 0.01), 2)
SEEN = np.array([0.305, 0.703])


def angles(t):
    return np.stack([0.4 * np.sin(2 * t) + 0.2, 0.3 * np.cos(1.5 * t)], axis=-1)


def rows(stamps, cells=None, end=""):
    cells = angles(TIMES) if cells is None else cells
    texts = [[x if isinstance(x, str) else f"{x:.12g}" for x in row] for row in cells]
    return "".join(f"{stamp},{','.join(row)}{end}\n" for stamp, row in zip(stamps, texts, strict=True))


def check(path, text, tolerance=1e-9):
    """Check that the motion of a text is the one above, from zero on."""
    path.write_text(text)
    trajectory = jn.load_trajectory(path)
    assert (trajectory.names, trajectory.start) == (("a", "b"), 0.0)
    np.testing.assert_allclose(trajectory.derivatives(SEEN, 0)[:, 0], angles(SEEN), rtol=0, atol=tolerance)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "log.csv"


@pytest.mark.parametrize(
    "form", ["2024-11-27T05:{m:02d}:{s}Z", "2024-11-27 05:{m:02d}:{s}", "2024-11-27T07:{m:02d}:{s}+02:00"]
)
def test_dates(path, form):
    """Over the full minute, with nine digits: no digit is lost."""
    stamps = [form.format(m=int(58.5 + t) // 60, s=f"{(58.5 + t) % 60:012.9f}") for t in TIMES]
    with pytest.warns(RecordingWarning, match=r"t = 0 is 1732683658\.500000000 s"):
        check(path, "time,a,b\n" + rows(stamps), 1e-12)


def test_a_day_that_is_none_is_no_date(path):
    path.write_text("time,a,b\n" + rows(["2024-02-30 05:00:00", *TIMES[1:]]))
    with pytest.raises(TrajectoryError, match=r"line 2, time: must be a finite number, got '2024-02-30 05:00:00'"):
        jn.load_trajectory(path)


@pytest.mark.parametrize("names", ["sec,nanosec", "header.stamp.sec,header.stamp.nanosec", "stamp_secs,stamp_nsecs"])
@pytest.mark.parametrize("long", [False, True])
def test_seconds_and_nanoseconds(path, names, long, monkeypatch):
    if long:
        monkeypatch.setattr(long_tables, "LONG", 100)
    stamps = [f"{1732686000 + int(t + 0.5)},{round((t + 0.5) % 1 * 1e9)}" for t in TIMES]
    with pytest.warns(RecordingWarning, match=r"t = 0 is 1732686000\.500000000 s"):
        check(path, f"{names},a,b\n" + rows(stamps), 1e-12)


def test_seconds_with_a_part_beside_nanoseconds_are_refused(path):
    path.write_text("sec,nanosec,a,b\n" + rows([f"{t + 0.5},{0}" for t in TIMES]))
    with pytest.raises(TrajectoryError, match=r"line 2, sec: seconds beside nanoseconds, and these, must be whole"):
        jn.load_trajectory(path)


def test_empty_cells_are_samples_that_are_missing(path):
    cells = [
        [x if k % 7 else "" for x in row[:1]] + [x if k % 5 else "nan" for x in row[1:]]
        for k, row in enumerate(angles(TIMES).tolist(), 1)
    ]
    with pytest.warns(RecordingWarning) as caught:
        check(path, "time,a,b\n" + rows(TIMES, cells), 1e-7)
    words = (
        "positions are missing, and left to the splines: 12 of a (the first in line 8), 18 of b (the first in line 6)"
    )
    assert f"{words}; 2 rows" in str(caught[0].message)


def test_a_column_without_any_number_is_named(path):
    path.write_text("time,a,b\n" + rows(TIMES, [[x, ""] for x in angles(TIMES)[:, 0].tolist()]))
    with pytest.raises(TrajectoryError, match=r"line 1, b: this column has no position; leave it out"):
        jn.load_trajectory(path)


def test_rows_that_end_with_a_comma(path):
    check(path, "time,a,b,\n" + rows(TIMES, end=","), 1e-9)


def test_what_ros2_echoes_as_csv_has_no_names(path):
    path.write_text("".join(f"{1732686000 + k},0,base,a,b,0.1,0.2,,\n" for k in range(5)))
    with pytest.raises(TrajectoryError, match=r"line 1: the first row holds the names .* leave --csv out"):
        jn.load_trajectory(path)


STATE = """header: {{stamp: {{sec: {sec}, nanosec: {nano}}}, frame_id: ''}}
name: [a, b]
position: [{a:.12g}, {b:.12g}]
velocity: [{rates}]
effort: [.nan, .nan]
"""


@pytest.mark.parametrize(
    "rates, note", [(".nan, .nan", None), ("0.0, -0.0", "zero throughout, and left out as not mea")]
)
def test_joint_states_whose_velocities_are_not_measured(tmp_path, rates, note):
    path, motion = tmp_path / "echo.yaml", angles(TIMES).tolist()
    texts = [
        STATE.format(sec=1732686000 + round(t * 100) // 100, nano=round(t * 100) % 100 * 10**7, a=a, b=b, rates=rates)
        for t, (a, b) in zip(TIMES, motion, strict=True)
    ]
    with pytest.warns(RecordingWarning) as caught:
        check(path, "---\n".join(texts))
    words = str(caught[0].message)
    assert note is None or f"{note}sured: a, b" in words
    assert note or "velocities" not in words


def test_velocities_of_zero_of_a_joint_that_stands_still_are_its_velocities(path):
    path.write_text("time,a,b,a_vel,b_vel\n" + rows(TIMES, [[1.0, 2.0, 0.0, 0.0] for _ in TIMES]))
    assert not jn.load_trajectory(path).derivatives(SEEN, 2)[:, 1:].any()


TRAJECTORY = """{{joint_trajectory: {{joint_names: [a], points: [
  {{positions: [0.0], time_from_start: 0}}, {{positions: [1.0], time_from_start: 1}}]}},
  multi_dof_joint_trajectory: {{joint_names: [base], points: [{points}]}}}}"""


def test_a_base_that_a_message_moves_is_named(tmp_path):
    path = tmp_path / "plan.yaml"
    path.write_text(TRAJECTORY.format(points="{transforms: [], time_from_start: 0}"))
    with pytest.warns(RecordingWarning, match=r"is left out: base \(multi_dof_joint_trajectory, line 3\)"):
        jn.load_trajectory(path)
    path.write_text(TRAJECTORY.format(points=""))
    assert jn.load_trajectory(path).names == ("a",)
