"""The motion of drivers at the rate of a servo drive."""

import csv
import json
import math

import pytest

from jounce.cli import main

PRESS = "examples/servo_press.yaml"


def rows(path):
    with path.open(newline="") as stream:
        return list(csv.reader(stream))


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """Position to jerk of the motor in degrees, at 100 Hz."""
    out = tmp_path_factory.mktemp("drive") / "drive.csv"
    assert main(["servo", PRESS, "--rate", "100Hz", "--units", "angle=deg", "--out", str(out)]) == 0
    return rows(out)


@pytest.mark.slow
def test_a_row_for_each_period_position_to_jerk_in_the_units_asked_for(drive):
    assert drive[0] == ["time [s]", "motor [deg]", "motor_d1 [deg/s]", "motor_d2 [deg/s^2]", "motor_d3 [deg/s^3]"]
    assert len(drive) == 1 + 121
    table = [[float(x) for x in row] for row in drive[1:]]
    for time, angle, *_ in table:  # the ram hangs on the crank: the triangle of 80 and 320 mm
        turn = math.radians(angle)
        ram = 0.5 + 0.08 * math.sin(turn) - math.sqrt(0.32**2 - (0.08 * math.cos(turn)) ** 2)
        if time <= 0.05:
            assert ram == pytest.approx(0.24, abs=1e-12)
        if 0.66 <= time <= 0.74:
            assert ram == pytest.approx(0.107, abs=1e-12)
    speeds = [(b[1] - a[1]) / 0.02 for a, b in zip(table, table[2:], strict=False)]
    assert all(abs(x - row[2]) < 0.01 * 600 for x, row in zip(speeds, table[1:], strict=False))


@pytest.mark.slow
def test_the_last_row_is_the_end_of_the_motion_whatever_the_rate(tmp_path, capsys):
    out = tmp_path / "drive.csv"
    assert main(["servo", PRESS, "--rate", "77Hz", "--out", str(out)]) == 0
    assert "does not divide the time" in capsys.readouterr().out.replace("\n", " ")
    assert float(rows(out)[-1][0]) == 1.2


@pytest.mark.slow
def test_json_is_in_si_and_tells_the_continuity(capsys):
    assert main(["servo", PRESS, "--rate", "100", "--units", "angle=deg", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["rate"] == 100.0
    assert [peak["unit"] for peak in record["peaks"]] == ["rad", "rad/s", "rad/s^2", "rad/s^3"]
    assert record["laws"][0]["of"] == "ram_y"
    assert record["laws"][0]["continuous_to"] == 3


@pytest.mark.parametrize(
    "options, words",
    [
        (["--rate", "1 mm"], "--rate: must be a frequency, such as 1kHz"),
        (["--rate", "0"], "--rate: must be greater than zero"),
        (["--driver", "moto"], "--driver: no driver has this name, got 'moto'; did you mean 'motor'?"),
        (["--units", "angle=mm"], "--units angle: measures a length, not an angle"),
        (["--units", "angle"], "--units: units are given by NAME=UNIT"),
        (["--header-units", "--plain-header"], "--plain-header: cannot be given together with --header-units"),
    ],
)
def test_what_is_wrong_is_reported_with_the_option(capsys, options, words):
    assert main(["servo", PRESS, *options]) == 2
    assert words in capsys.readouterr().err
