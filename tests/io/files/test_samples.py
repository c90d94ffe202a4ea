"""Samples of motion laws from CSV files."""

import numpy as np
import pytest

from jounce.errors import MechanismFileError
from jounce.io.files.samples import read_points, read_samples
from jounce.units.dimensions import ANGLE, LENGTH, TIME


def write(folder, text):
    path = folder / "samples.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.parametrize(
    "text, names",
    [
        ("time,lift\n0,1\n1,2.5\n", {}),
        ("lift,time\n1,0\n2.5,1\n", {}),
        ("t , lift\n0 , 1\n\n1 , 2.5\n", {}),
        ("0,1\n1,2.5\n", {}),
        ("# a log, of today\n# 100 Hz\ntime,lift\n0,1\n1,2.5\n", {}),
        ("# lift, time\n1,0\n2.5,1\n", {"time": "time"}),
        ("\ufefftime,lift\r\n0,1\r\n1,2.5\r\n", {}),
        ("a,b,c\n9,1,0\n9,2.5,1\n", {"time": "c", "value": "b"}),
        ("time,b,c\n0,9,1\n1,9,2.5\n", {"value": "c"}),
    ],
)
def test_columns_are_found(tmp_path, text, names):
    assert read_samples(write(tmp_path, text), **names) == ([0.0, 1.0], [1.0, 2.5])


@pytest.mark.parametrize(
    "text, names, words",
    [
        ("", {}, "the file of samples is empty"),
        ("time;lift\n0;1\n1;2,5\n", {}, "line 1: entries are separated by commas, here by semicolons"),
        ("0,0;1,5\n1,0;2,5\n", {}, "line 1: entries are separated by commas, here by semicolons"),
        ("time\tlift\n0\t1\n", {}, "line 1: entries are separated by commas, here by tabs"),
        ("time\n1\n", {}, "line 1: samples need a column of times and one of values"),
        ("time,a,b\n0,1,2\n", {}, "line 1: has several columns besides the time, name that of the value; valid: a, b"),
        ("time,lift\n0,1\n", {"value": "lfit"}, "line 1: no column has this name, got 'lfit'; did you mean 'lift'?"),
        ("time,lift\n0,1\n", {"time": "t"}, "line 1: no column has this name, got 't'; valid: lift, time"),
        ("time,lift\n0,1\n1,x\n", {}, "line 3, lift: must be a finite number, got 'x'"),
        ("time,lift\n0,1\n1\n", {}, "line 3, lift: must be a finite number, got ''"),
        ("time,lift\n0,1\n1,1_5\n", {}, "line 3, lift: must be a finite number, got '1_5'"),
        ("time,lift\n0,1\nnan,2\n", {}, "line 3, time: must be a finite number, got 'nan'"),
        ("time,lift\n0,1\n1,1e300\n", {}, "line 3, lift: must be at most 1e+75, got '1e300'"),
        (b"time,lift\n\xff,1\n", {}, "the samples cannot be read"),
        ('time,lift\n"0,1\n', {}, "the samples cannot be read"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(tmp_path, text, names, words):
    path = write(tmp_path, text)
    with pytest.raises(MechanismFileError) as caught:
        read_samples(path, **names)
    assert words in str(caught.value)
    assert str(caught.value).startswith(str(path))


@pytest.mark.parametrize(
    "names, said",
    [
        ("time,lift_mm", "mm"),
        ("time_ms,lift", "ms"),
        ("time,theta_deg", "deg"),
        ("time (s),lift (cm)", "cm"),
        ("Time (ms),lift", "ms"),
    ],
)
def test_units_in_names_alone_are_not_taken_for_those_of_si(tmp_path, names, said):
    path, allowed = write(tmp_path, f"{names}\n0,1\n1,2.5\n"), ([TIME], [LENGTH, ANGLE])
    with pytest.raises(MechanismFileError, match=rf"line 1: this name seems to say {said}.*: write NAME \[{said}\]"):
        read_samples(path, allowed=allowed)


@pytest.mark.parametrize(
    "row, size", [("ms,mm", 1e-3), ("[ms],(mm)", 1e-3), ("ms , cm", 1e-2), ("ms,", 1.0), ("ms,-", 1.0), ("ms,rad", 1.0)]
)
def test_a_row_of_units_below_the_names_is_read(tmp_path, row, size):
    path = write(tmp_path, f"time,lift\n{row}\n0,1\n500,2.5\n")
    assert read_samples(path, allowed=([TIME], [LENGTH, ANGLE])) == ([0.0, 0.5], [1.0 * size, 2.5 * size])


@pytest.mark.parametrize(
    "text, said",
    [
        ("time,lift\nms,kg\n0,1\n", "line 2, lift: the unit measures a mass, not a length or an angle, got 'kg'"),
        ("time,lift\nms,mmm\n0,1\n", "line 2, time: must be a finite number, got 'ms'"),
        ("time [ms],lift\nms,mm\n0,1\n", "line 2, time: must be a finite number, got 'ms'"),
        ("time,lift\nms,2\n0,1\n", "line 2, time: must be a finite number, got 'ms'"),
        ("time,lift\n-,-\n0,1\n", "line 2, time: must be a finite number, got '-'"),
    ],
)
def test_rows_that_state_no_units_of_the_columns_are_refused(tmp_path, text, said):
    path = write(tmp_path, text)
    with pytest.raises(MechanismFileError) as caught:
        read_samples(path, value="lift", allowed=([TIME], [LENGTH, ANGLE]))
    assert said in str(caught.value)


def test_files_that_cannot_be_read(tmp_path, monkeypatch):
    with pytest.raises(MechanismFileError, match="file of samples not found"):
        read_samples(tmp_path / "no.csv")
    with pytest.raises(MechanismFileError, match="is a directory, a file is needed"):
        read_samples(tmp_path)
    monkeypatch.setattr("jounce.io.files.reading.MAX_SAMPLES", 10)
    with pytest.raises(MechanismFileError, match="at most 1e-05 MB are read"):
        read_samples(write(tmp_path, "time,lift\n0,1\n"))


@pytest.mark.parametrize(
    "text, times, points",
    [
        ("1,2\n3,4\n", None, [[1, 2], [3, 4]]),
        ("1,2,3\n4,5,6\n", None, [[1, 2, 3], [4, 5, 6]]),
        ("y,x\n1,2\n3,4\n", None, [[2, 1], [4, 3]]),
        ("tip_x,tip_y,note\n1,2,0\n3,4,0\n", None, [[1, 2], [3, 4]]),
        ("time [ms],x [mm],y [cm],z\n0,1,2,3\n500,4,5,6\n", [0, 0.5], [[0.001, 0.02, 3], [0.004, 0.05, 6]]),
        ("x,tip_x,y\n1,9,2\n3,9,4\n", None, [[1, 2], [3, 4]]),
    ],
)
def test_points_and_their_times(tmp_path, text, times, points):
    found_times, found = read_points(write(tmp_path, text))
    np.testing.assert_allclose(found, points, rtol=1e-15)
    assert (found_times is None) == (times is None)
    if times is not None:
        np.testing.assert_allclose(found_times, times, rtol=1e-15)


@pytest.mark.parametrize(
    "text, words",
    [
        ("1\n2\n", ("line 1", "two or three")),
        ("x,z\n1,2\n", ("line 1", "columns x and y", "x, z")),
        ("a_x,b_x,y\n1,2,3\n", ("line 1", "several", "'x'")),
        ("x,y\n1,inf\n", ("line 2", "y", "inf")),
        ("x [s],y\n1,2\n", ("x", "s")),
    ],
)
def test_what_are_no_points(tmp_path, text, words):
    with pytest.raises(MechanismFileError) as raised:
        read_points(write(tmp_path, text))
    assert all(word in str(raised.value) for word in words), str(raised.value)
