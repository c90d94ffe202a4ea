"""What a command shows on a terminal and elsewhere: the table of peaks, the progress bar."""

import math
import pathlib
import sys

import pytest

import jounce as jn
from jounce.reporting.peaks import Peak, peaks
from jounce.reporting.terminal import Bar, show_peaks

RSUR = pathlib.Path(__file__).resolve().parents[2] / "examples" / "rsur.yaml"

PEAKS = [
    Peak("short", "position", "m", -1.0, 0.5, 2.0, 1.5, 2.0),
    Peak("a_rather_long_name_of_an_output", "jounce", "rad/s^4", -123.456e-20, 1.25e-3, 7.0, 12.5, 7e9),
    Peak("a_rather_long_name_of_an_output", "5th", "rad/s^5", *[math.nan] * 4, 0.0),
]


def test_long_names_stand_on_lines_of_their_own(capsys):
    show_peaks(PEAKS)
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    assert [line.split() for line in lines[3:8]] == [
        ["short"],
        ["position", "m", "-1", "0.5", "2*", "1.5"],
        [],
        ["a_rather_long_name_of_an_output"],
        ["jounce", "rad/s^4", "0", "0.00125", "7*", "12.5"],
    ]
    assert lines[8].split() == ["5th", "rad/s^5", "-", "-", "-", "-"]


def test_a_terminal_gets_a_colored_table(capsys, monkeypatch):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("COLUMNS", "100")
    for name in ("NO_COLOR", "FORCE_COLOR", "TTY_COMPATIBLE"):
        monkeypatch.delenv(name, raising=False)
    show_peaks(PEAKS)
    out = capsys.readouterr().out
    assert "\x1b[1m2\x1b[0m" in out
    assert "a_rather_long_name_of_an_output" in out


def test_a_bar_is_shown_on_a_terminal_and_for_long_work_only(capsys, monkeypatch):
    clock = iter([0.0, 0.5, 1.5, 2.0, *range(3, 1000)])
    monkeypatch.setattr("jounce.reporting.terminal.time.monotonic", lambda: next(clock))
    with Bar("solving") as bar:
        for done in range(1, 5):
            bar(done, 5)
    assert capsys.readouterr().err == ""
    clock = iter([0.0, 0.5, 1.5, 2.0, *range(3, 1000)])
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.setenv("TERM", "xterm-256color")
    with Bar("solving") as bar:
        bar(1, 5)
        bar(2, 5)
        assert capsys.readouterr().err == ""
        bar(3, 5)
        bar(5, 5)
    assert "solving" in capsys.readouterr().err


@pytest.mark.slow
def test_peaks_of_an_angular_velocity_start_with_velocity():
    found = [p for p in peaks(jn.solve(jn.load(RSUR), [0.0, 0.1])) if p.output == "coupler_spin_x"]
    assert [(p.derivative, p.unit) for p in found][:2] == [("velocity", "rad/s"), ("acceleration", "rad/s^2")]
