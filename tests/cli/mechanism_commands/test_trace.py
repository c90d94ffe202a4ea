"""The command that traces a mechanism, and the range that `inspect` tells."""

import json

import numpy as np
import pytest

from jounce.cli import main
from jounce.io import read

FILE, STROKE = "examples/four_bar.yaml", ("--set", "AB=15 cm")


def shown(capsys, *arguments):
    status = main([*map(str, arguments)])
    printed = capsys.readouterr()
    return status, printed.out, printed.err


@pytest.mark.slow
def test_limit_positions_in_a_table_a_file_and_a_figure(capsys, tmp_path):
    table, figure = tmp_path / "curve.csv", tmp_path / "curve.png"
    status, out, _ = shown(capsys, "trace", FILE, *STROKE, "--out", table, "--figure", figure, "--points", 50)
    assert status == 0
    assert "(23.8218 deg)  minimum" in out
    assert figure.stat().st_size > 10_000
    rows = np.genfromtxt(table, delimiter=",", names=True)
    assert rows.dtype.names[:4] == ("arc_length", "driver_value", "psi", "psi_d1")
    assert len(rows) == 52
    assert rows["driver_value"].min() == pytest.approx(np.radians(23.8218), abs=1e-5)
    stored = tmp_path / "curve.nc"
    assert shown(capsys, "trace", FILE, *STROKE, "--out", stored, "--points", 50)[0] == 0
    np.testing.assert_array_equal(read(stored)["psi"].values[:, 1], rows["psi_d1"])


@pytest.mark.slow
def test_as_json(capsys):
    status, out, _ = shown(capsys, "trace", FILE, *STROKE, "--json")
    (curve,) = json.loads(out)["curves"]
    assert status == 0
    assert [x["kind"] for x in curve["limits"]] == ["maximum", "minimum"]


@pytest.mark.parametrize(
    "options, message",
    [
        (("--driver", "thet"), "--driver"),
        (("--order", 12), "--order"),
        (("--points", 0), "--points"),
        (("--length", -1), "--length"),
        (("--figure", "curve.gif"), "gif"),
        (("--figure", "curve.png", "--show", "nothing"), "outputs"),
    ],
)
def test_bad_options(capsys, options, message, tmp_path, monkeypatch):
    status, _, err = shown(capsys, "trace", FILE, *STROKE, *options)
    assert status == 2
    assert message in err


@pytest.mark.slow
def test_the_range_of_a_driver(capsys):
    status, out, _ = shown(capsys, "inspect", FILE, "--range")
    assert status == 0
    assert "theta makes whole turns" in out
    assert "crank-rocker (Grashof)" in out
    assert "transmission angle from 23.4792 deg to 56.527 deg" in out
    assert "poor transmission" in out
    found = json.loads(shown(capsys, "inspect", FILE, *STROKE, "--range", "--json")[1])["range"]
    assert found["low"] == pytest.approx(np.radians(23.8218), abs=1e-5)
    assert found["smallest_singular_value"] < 1e-12
