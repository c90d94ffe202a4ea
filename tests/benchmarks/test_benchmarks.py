"""The benchmark command: what it lists, what it measures of contestants that cost what they say, what it writes."""

import csv
import importlib
import json
import os
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path

import pytest

import benchmarks
from benchmarks import figures, records, tables
from benchmarks.cases import CannotRunError, Case, Contestant, Reported, ready
from benchmarks.timing import measured, spread

ROOT = Path(__file__).parents[2]


def costing(name, *seconds, **more):
    """A contestant that tells what it takes, round after round, the run before the first round included."""
    durations = iter(seconds)
    return Contestant(name, ready(lambda: Reported(next(durations), seconds[0])), **more)


def rows(*contestants, **more):
    return list(measured(Case("work", contestants, **({"rounds": 3} | more)), quick=False))


def test_ratios_are_medians_over_rounds_of_costs_for_a_unit_of_work():
    ours, peer = rows(costing("ours", 9, 2, 4, 6), costing("peer", 9, 1, 8, 3, count=2), count=4)
    assert ours["cost"] == [0.75, 1.0, 1.25]
    assert peer["cost"] == [1.0, 1.5, 2.75]
    assert ours["ratio"] is None
    assert peer["ratio"] == pytest.approx(spread([0.5 / 0.5, 1 / 4, 1.5 / 1.5]))


def test_errors_are_of_what_came_out():
    (row,) = rows(costing("ours", 3, 2, 2, 2, error=lambda found: found / 10))
    assert row["error"] == 0.3
    assert row["rounds"] == 3


def test_the_first_time_can_be_what_is_measured():
    ours, peer = rows(costing("ours", 6), costing("peer", 3), rounds=0)
    assert ours["cost"] == [6, 6, 6]
    assert peer["ratio"] == [2, 2, 2]


def test_a_peer_that_is_not_installed_is_reported_with_the_extra_that_brings_it():
    ours, peer = rows(costing("ours", 1, 1, 1, 1), costing("peer", 1, needs="no_such_package", extra="bench"))
    assert ours["left out"] == ""
    assert peer["left out"] == "no_such_package is not installed; the extra `bench` brings it"
    assert peer["cost"] is None
    (line,) = tables._cells([peer])
    assert "no_such_package" in line[2]


def test_a_peer_that_fails_is_reported_and_the_others_run():
    def without_compiler():
        raise CannotRunError("there is no C compiler")

    def wrong():
        raise ZeroDivisionError("of its own\nand more")

    first, second, third = rows(Contestant("a", without_compiler), Contestant("b", wrong), costing("c", 1, 1, 1, 1))
    assert first["left out"] == "there is no C compiler"
    assert second["left out"] == "ZeroDivisionError: of its own"
    assert third["cost"] == [1, 1, 1]
    assert third["ratio"] is None, "there is nothing to compare with"


@pytest.mark.slow
def test_tables_and_figures_of_all_rows(tmp_path):
    errors = {"error": lambda found: 1e-9, "aim": 2.0}
    about = tables.circumstances(quick=True)
    found = []
    for benchmark, name, key in (
        ("orders", "four-bar to order", "order"),
        ("orders", "RSUR to order", "order"),
        ("orders", "four-bar to order first call", "order"),
        ("bodies", "chain", "bodies"),
        ("pendulum", "double pendulum", "tolerance"),
        ("jerk", "four-bar", "step"),
        ("jerk", "slider-crank", "step"),
    ):
        for value in (2.0, 4.0):
            pair = costing("jounce", 1, 1, 1, 1, **errors), costing("peer | other", 1, 2, 2, 2, **errors)
            known = {"benchmark": benchmark, "day": "2026-01-01", "circumstances": about}
            found += [known | row for row in rows(*pair, at={key: value})]
            for row in found[-2:]:
                row["case"] = f"{name}"
    records.write(found, tmp_path)
    figures.draw(found, tmp_path)
    assert {file.name for file in tmp_path.iterdir()} == {
        "table.md",
        "table.csv",
        "table.json",
        *(f"{name}.{suffix}" for name in figures.FIGURES for suffix in ("png", "svg")),
    }
    assert records.read(tmp_path) == found
    text = (tmp_path / "table.md").read_text()
    assert "0.5 times (0.5 to 0.5; aim 2)" in text
    assert "peer \\| other" in text
    with (tmp_path / "table.csv").open() as stream:
        lines = list(csv.DictReader(stream))
    assert len(lines) == len(found)
    assert float(lines[1]["ratio median"]) == 0.5


@pytest.mark.parametrize("name", benchmarks.BENCHMARKS)
def test_each_benchmark_is_a_module_of_cases(name):
    cores = getattr(os, "sched_getaffinity", lambda _: None)(0)
    module = importlib.import_module(f"benchmarks.{benchmarks.BENCHMARKS[name].module}")
    assert module.__doc__
    assert callable(module.cases)
    assert getattr(os, "sched_getaffinity", lambda _: None)(0) == cores, "or the tests that follow had one"


def command(*words):
    return subprocess.run(
        [sys.executable, "-m", "benchmarks", *words], cwd=ROOT, capture_output=True, text=True, timeout=300, check=False
    )


def test_the_command_lists_what_there_is():
    printed = command("--list")
    assert printed.returncode == 0, printed.stderr
    assert [line.split()[0] for line in printed.stdout.splitlines()] == list(benchmarks.BENCHMARKS)


@pytest.mark.slow
def test_the_command_measures_one(tmp_path):
    before = datetime.now(UTC)
    printed = command("--only", "files", "--quick", "--out", str(tmp_path))
    assert printed.returncode == 0, printed.stderr
    found = json.loads((tmp_path / "table.json").read_text())
    assert "quick" in found["circumstances"]["sizes"]
    days = {moment.date().isoformat() for moment in (before, datetime.now(UTC))}
    assert all(row["day"] in days for row in found["rows"])
    assert {row["contestant"] for row in found["rows"]} >= {"jounce", "ruamel.yaml alone, safe loader"}
    assert all(row["cost"][1] > 0 for row in found["rows"])
    assert "four_bar.yaml" in printed.stdout


def test_a_benchmark_that_breaks_is_reported(monkeypatch, tmp_path):
    from benchmarks import __main__ as program

    monkeypatch.setattr(program, "BENCHMARKS", {"broken": benchmarks.Benchmark("no_such_module", "Nothing")})
    monkeypatch.setattr(sys, "argv", ["benchmarks", "--only", "broken"])
    assert program.main() == 1
