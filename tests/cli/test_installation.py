"""What `jounce doctor` says, and that its test can fail."""

import json

import numpy as np

from jounce.cli import installation
from jounce.version import __version__


def test_it_says_what_is_there_and_the_test_passes(run, monkeypatch, tmp_path):
    monkeypatch.setenv("JOUNCE_CACHE_DIR", str(tmp_path))
    status, out, _ = run("doctor", "--json")
    found = json.loads(out)
    assert (status, found["passed"]) == (0, True)
    facts = found["facts"]
    assert facts["jounce"] == __version__
    assert facts["numpy"] == np.__version__
    assert facts["compiled programs"] == f"0 in {tmp_path}, 0.0 MiB"
    assert facts["extra sweep"] == "installed"
    assert len(found["errors"]) == 2
    assert all(0 <= error < 1e-13 for error in found["errors"].values())


def test_wrong_numbers_fail(run, monkeypatch):
    right = installation._tests
    monkeypatch.setattr(installation, "_tests", lambda: {**right(), "test: wrong": 1e-9, "test: none": float("nan")})
    status, out, _ = run("doctor")
    assert status == 1
    assert [line.split("  ")[0] for line in out.splitlines() if "FAILED" in line] == ["test: wrong", "test: none"]
