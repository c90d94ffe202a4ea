"""Machine code that another process compiles, in haste or because it is long, is the same function."""

import subprocess

import jax.numpy as jnp
import numpy as np
import pytest

from jounce.execution.llvm import machine, modules, programs, self_test

pytestmark = pytest.mark.skipif(
    not self_test.is_usable(), reason="there is no compiler, or a system where it was not tried"
)


def function(given, _):
    (x,) = given
    return (jnp.cos(x) * x[::-1] / (2.0 + jnp.sum(x * x)),)


GIVEN = (np.linspace(-1, 2, 21),)


@pytest.fixture(autouse=True)
def _optimized(monkeypatch):
    """Let LLVM optimize, as it does for users; the tests ask XLA for little of that."""
    monkeypatch.setenv("XLA_FLAGS", "")


def run(**how):
    binary, results = modules.object_file(function, GIVEN, (), {}, large=4, single=True, **how)
    return binary, programs.Single(binary, GIVEN, results)(GIVEN)[0]


def test_haste_changes_no_digit(monkeypatch):
    monkeypatch.setattr(machine, "LONG", 1)
    monkeypatch.setattr(machine, "_compiled_here", None)
    binary, hasty = run(hasty=True)
    monkeypatch.undo()
    usual, found = run()
    assert binary != usual
    np.testing.assert_array_equal(hasty, found)
    x = GIVEN[0]
    np.testing.assert_allclose(found, np.cos(x) * x[::-1] / (2 + x @ x), rtol=1e-14)


def test_short_code_is_compiled_here_in_haste_too(monkeypatch):
    monkeypatch.setattr(machine, "_compiled_elsewhere", None)
    assert run(hasty=True)[0] == run()[0]


def test_what_is_called_once_is_compiled_without_optimizing():
    (binary, found), (usual, expected) = run(brief=True), run()
    assert binary != usual
    np.testing.assert_allclose(found, expected, rtol=1e-14)


@pytest.mark.parametrize("level", [0, 1, 2])
def test_machine_code_is_optimized_as_little_as_that_of_xla(level, monkeypatch):
    without, usual, flag = run(brief=True)[0], run()[0], "--xla_backend_optimization_level"
    monkeypatch.setenv("XLA_FLAGS", f"{flag}=2 --xla_cpu_multi_thread_eigen=false {flag}={level}")
    assert run()[0] == (usual if level else without)


@pytest.mark.parametrize("trouble", ["no process", "it fails", "an application"])
def test_where_there_is_no_other_process_this_one_compiles(trouble, monkeypatch):
    def refused(words, **_):
        raise OSError(2, "no such file") if trouble == "no process" else subprocess.CalledProcessError(1, words)

    monkeypatch.setattr(machine, "LONG", 1)
    if trouble == "an application":
        monkeypatch.setattr(machine.sys, "executable", "/opt/editor/editor")
    else:
        monkeypatch.setattr(machine.subprocess, "run", refused)
    np.testing.assert_array_equal(run(hasty=True)[1], run()[1])


def test_long_code_goes_to_another_process(monkeypatch):
    monkeypatch.setattr(machine, "LONG", 1)
    monkeypatch.setattr(machine.os, "sched_getaffinity", lambda _: {0, 1})
    monkeypatch.setattr(machine, "_compiled_here", None)
    assert np.isfinite(run()[1]).all()
