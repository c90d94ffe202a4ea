"""What a command shows on a terminal and elsewhere: the table of peaks, the progress bar."""

import math
import pathlib
import sys

import numpy as np
import pytest

import jounce as jn
from jounce.base.activity import Activity, Count, compiling, now
from jounce.reporting.peaks import Peak, peaks
from jounce.reporting.progress import Display
from jounce.reporting.terminal import print_text, show_peaks

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


def test_a_line_of_progress_is_shown_on_a_terminal_and_for_long_work_only(capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.setenv("TERM", "xterm-256color")
    reports = []
    with Display("solve") as shown, Count("solving", report=lambda *call: reports.append(call)) as count:
        count(3, 5)
        shown._look()
    assert capsys.readouterr().err == ""
    monkeypatch.setattr("jounce.reporting.progress.PATIENCE", 0.0)
    with Display("solve") as shown, Count("solving") as count:
        count(3, 5)
        shown._look()
        assert "solving" in (err := capsys.readouterr().err)
        assert "60 %" in err
        print_text("words")  # take the line away
        assert shown._line is None
    assert capsys.readouterr().out == "words\n"
    assert reports == [(3, 5)]


def test_what_is_compiled_is_said_until_something_is_done():
    with Count("solving") as count:
        with compiling(np.linalg.matrix_rank):
            assert now().words == "solving: compiling matrix rank"
            with Count("within") as within:  # the outermost is told
                within(1, 2)
            count(1, 7)
            assert now() == Activity("solving", 1, 7)
        count(7, 7)
    assert now() is None


@pytest.mark.slow
def test_peaks_of_an_angular_velocity_start_with_velocity():
    found = [p for p in peaks(jn.solve(jn.load(RSUR), [0.0, 0.1])) if p.output == "coupler_spin_x"]
    assert [(p.derivative, p.unit) for p in found][:2] == [("velocity", "rad/s"), ("acceleration", "rad/s^2")]
