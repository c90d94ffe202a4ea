"""The table in a folder: rows with their days and circumstances, added to, and read again or refused."""

import csv
import json
import sys
from pathlib import Path

import pytest

from benchmarks import __main__ as program, figures, records
from jounce.errors import OutputError

KEPT = Path(__file__).parents[2] / "docs" / "benchmarks"
ABOUT = {"processor": "one", "versions": "jounce 1"}


def row(benchmark, day, *, cost=1.0, case="work", about=ABOUT, **more):
    return {
        "benchmark": benchmark,
        "day": day,
        "case": case,
        "contestant": "jounce",
        "version": "",
        "unit": "run",
        "clock": "wall time",
        "cost": [cost, cost, cost],
        "ratio": None,
        "aim": None,
        "error": None,
        "reference": "",
        "rounds": 3,
        "at": {},
        "left out": "",
        "circumstances": about,
    } | more


def listed(rows):
    return [(row["benchmark"], row["day"], row["case"]) for row in rows]


def test_rows_take_the_place_of_their_own_benchmark_and_others_keep_their_days():
    old = [row("rsur", "2026-01-01"), row("start", "2026-01-02", case="old"), row("start", "2026-01-02", case="gone")]
    new = [row("start", "2026-02-03", case="b"), row("start", "2026-02-03", case="a"), row("four-bar", "2026-02-03")]
    assert listed(records.merged(old, new)) == [
        ("four-bar", "2026-02-03", "work"),
        ("rsur", "2026-01-01", "work"),
        ("start", "2026-02-03", "b"),
        ("start", "2026-02-03", "a"),
    ], "benchmarks are in their order, rows in that of the measurement"


def test_a_benchmark_that_failed_replaces_nothing():
    old = [row("start", "2026-01-01", case="a"), row("start", "2026-01-01", case="b")]
    parts = [row("start", "2026-02-02", case="a"), row("view", "2026-02-02")]
    assert listed(records.merged(old, parts, failed=["start", "view"])) == [
        ("view", "2026-02-02", "work"),
        *listed(old),
    ]


def test_rows_are_read_as_they_were_written_and_the_file_tells_once_what_most_have_in_common(tmp_path):
    other = {"processor": "two", "versions": "jounce 1", "sizes": "small"}
    rows = [row("four-bar", "2026-01-01"), row("rsur", "2026-01-01"), row("start", "2026-02-02", about=other)]
    records.write(rows, tmp_path)
    assert records.read(tmp_path) == rows
    whole = json.loads((tmp_path / "table.json").read_text())
    assert whole["circumstances"] == ABOUT
    assert [line.get("circumstances") for line in whole["rows"]] == [None, None, {"processor": "two", "sizes": "small"}]


def test_sizes_of_one_section_are_not_said_of_all(tmp_path):
    small = ABOUT | {"sizes": "small"}
    rows = [row("rsur", "2026-01-01"), *(row("start", "2026-02-02", about=small, case=case) for case in "ab")]
    records.write(rows, tmp_path)
    assert records.read(tmp_path) == rows


def test_each_section_tells_its_day_and_what_differs(tmp_path):
    other = ABOUT | {"versions": "jounce 2"}
    rows = [
        row("four-bar", "2026-01-01"),
        row("rsur", "2026-01-01", case="a"),
        row("rsur", "2026-01-02", case="b"),
        row("start", "2026-02-02", about=other),
    ]
    records.write(rows, tmp_path)
    lines = (tmp_path / "table.md").read_text().splitlines()
    assert lines[0].endswith("Unless a section says otherwise, processor: one; versions: jounce 1.")
    assert [line for line in lines if line.startswith("`python")] == [
        "`python -m benchmarks --only four-bar`, wall time, measured on 2026-01-01.",
        "`python -m benchmarks --only rsur`, wall time, measured on 2026-01-01 and 2026-01-02.",
        "`python -m benchmarks --only start`, wall time, measured on 2026-02-02; versions: jounce 2.",
    ]
    with (tmp_path / "table.csv").open(newline="") as stream:
        found = [(line["day"], line["versions"]) for line in csv.DictReader(stream)]
    assert found == [
        ("2026-01-01", "jounce 1"),
        ("2026-01-01", "jounce 1"),
        ("2026-01-02", "jounce 1"),
        ("2026-02-02", "jounce 2"),
    ]


def test_a_folder_without_a_table_has_no_rows(tmp_path):
    assert records.read(tmp_path / "none") == []


def put(folder, whole):
    (folder / "table.json").write_text(whole if isinstance(whole, str) else json.dumps(whole))


def older(day, **about):
    without = {key: value for key, value in row("start", "").items() if key not in ("day", "circumstances")}
    return {"circumstances": ABOUT | {"day": day} | about, "rows": [without]}


def test_the_day_of_an_older_table_is_that_of_each_row(tmp_path):
    put(tmp_path, older("2026-01-01"))
    assert records.read(tmp_path) == [row("start", "2026-01-01")]


@pytest.mark.parametrize(
    "whole, reason",
    [
        ('{"circumstances": {}, "rows": [{"bench', "JSONDecodeError"),
        ("", "JSONDecodeError"),
        ("[]", "TypeError"),
        ({"rows": []}, "KeyError: 'circumstances'"),
        ({"circumstances": {}, "rows": ["start"]}, "TypeError"),
        ({"circumstances": {}, "rows": older("")["rows"]}, "row 1: it has no day"),
        (older("2026-01-01; `start` of 2026-01-02"), "row 1: '2026-01-01; `start` of 2026-01-02' is not a day"),
        (older("2026-01-01", processor=1), "circumstances must be text"),
        ({"circumstances": {}, "rows": [row("start", 20260101)]}, "day must be text"),
        ({"circumstances": {}, "rows": [row("start", "2026-01-01"), row("no-such", "2026-01-01")]}, "row 2: there is"),
        ({"circumstances": {}, "rows": [row("start", "2026-01-01") | {"cost": None}]}, "it has no cost"),
        ({"circumstances": {}, "rows": [row("start", "2026-01-01") | {"cost": [1, 2]}]}, "three numbers"),
        ({"circumstances": {}, "rows": [row("start", "2026-01-01") | {"ratio": "twice"}]}, "three numbers"),
        ({"circumstances": {}, "rows": [row("start", "2026-01-01") | {"error": "none"}]}, "aim and error"),
        ({"circumstances": {}, "rows": [row("start", "2026-01-01") | {"at": 3}]}, "at must be"),
    ],
)
def test_a_table_that_cannot_be_read_is_refused_with_the_reason(tmp_path, whole, reason):
    put(tmp_path, whole)
    with pytest.raises(records.TableError) as caught:
        records.read(tmp_path)
    assert reason in str(caught.value)
    assert str(tmp_path / "table.json") in str(caught.value)
    assert "without --only" in str(caught.value)


def contents(folder):
    return {file.name: file.read_bytes() for file in folder.iterdir()}


def test_rows_that_cannot_be_shown_leave_all_files_as_they_were(tmp_path):
    records.write([row("start", "2026-01-01")], tmp_path)
    before = contents(tmp_path)
    with pytest.raises(TypeError):
        records.write([row("start", "2026-01-02") | {"cost": 3}], tmp_path)
    assert contents(tmp_path) == before


def test_a_disk_that_is_full_leaves_no_half_of_a_file(tmp_path, monkeypatch):
    records.write([row("start", "2026-01-01")], tmp_path)
    before = contents(tmp_path)

    def half(path, data):
        with path.open("wb") as stream:
            stream.write(data[: len(data) // 2])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", half)
    with pytest.raises(OutputError, match="No space left"):
        records.write([row("start", "2026-01-02")], tmp_path)
    assert contents(tmp_path) == before


@pytest.fixture
def run(monkeypatch, tmp_path):
    """Runs the command in this folder, with given rows for what is measured."""

    def run(measured, *words, fault=""):
        own = {name: [line for line in measured if line["benchmark"] == name] for name in program.BENCHMARKS}
        monkeypatch.setattr(program, "_in_own_process", lambda name, quick: (own[name], fault))
        monkeypatch.setattr(sys, "argv", ["benchmarks", *words, "--out", str(tmp_path)])
        return program.main()

    return run


def measured_now(benchmark):
    return {key: value for key, value in row(benchmark, "2026-02-02").items() if key != "circumstances"}


def test_the_command_replaces_what_it_measured_and_keeps_the_rest(run, tmp_path):
    records.write([row("rsur", "2026-01-01"), row("start", "2026-01-01")], tmp_path)
    (tmp_path / "orders.png").write_bytes(b"drawn before")
    assert run([measured_now("start")], "--only", "start") == 0
    rsur, start = records.read(tmp_path)
    assert rsur == row("rsur", "2026-01-01")
    assert start["day"] == "2026-02-02"
    assert "jax" in start["circumstances"]["versions"]
    assert (tmp_path / "orders.png").read_bytes() == b"drawn before"


def test_the_command_without_names_replaces_everything(run, tmp_path):
    put(tmp_path, "damaged")
    assert run([measured_now("view"), measured_now("start")]) == 0
    assert listed(records.read(tmp_path)) == [("view", "2026-02-02", "work"), ("start", "2026-02-02", "work")]


def test_the_command_keeps_the_table_where_nothing_was_measured(run, tmp_path, capsys):
    records.write([row("start", "2026-01-01")], tmp_path)
    before = contents(tmp_path)
    assert run([], "--only", "start", fault="it ended") == 1
    assert contents(tmp_path) == before
    assert "its rows in the table stay as they were" in capsys.readouterr().err


def test_a_damaged_table_is_reported_before_anything_is_measured(run, tmp_path, capsys):
    put(tmp_path, "damaged")
    with pytest.raises(SystemExit) as caught:
        run([], "--only", "start")
    assert caught.value.code == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert "table.json cannot be read" in err


def test_a_figure_is_replaced_when_it_is_complete(tmp_path, monkeypatch):
    class Half:
        def savefig(self, path, dpi):
            Path(path).write_bytes(b"half")
            raise OSError(28, "No space left on device")

    (tmp_path / "orders.png").write_bytes(b"drawn before")
    monkeypatch.setattr(figures, "FIGURES", {"orders": lambda rows: Half()})
    with pytest.raises(OutputError, match="No space left"):
        figures.draw([], tmp_path)
    assert contents(tmp_path) == {"orders.png": b"drawn before"}


def test_errors_are_compared_where_both_were_measured():
    assert figures._over([(1.0, 6.0), (2.0, 8.0)], [(2.0, 4.0), (3.0, 1.0)]) == [(2.0, 2.0)]


def test_the_table_of_the_documentation_is_what_its_rows_give(tmp_path):
    records.write(records.read(KEPT), tmp_path)
    for name in ("table.json", "table.md", "table.csv"):
        message = f"docs/benchmarks/{name} was edited: `records.write(records.read(folder), folder)` writes it anew"
        assert (tmp_path / name).read_bytes() == (KEPT / name).read_bytes(), message
