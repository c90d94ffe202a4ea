"""Where machine code was not tried, a small program in another process decides, and one warning tells of it."""

import subprocess

import pytest

from jounce.execution.llvm import programs, self_test


@pytest.fixture(autouse=True)
def untried(monkeypatch):
    monkeypatch.setattr(self_test, "TRIED", ())
    for function in (self_test.is_usable, self_test.passes):
        function.cache_clear()
    yield
    for function in (self_test.is_usable, self_test.passes):
        function.cache_clear()


def test_machine_code_passes_here():
    self_test.check()


def test_other_numbers_do_not(monkeypatch):
    run = programs.Program.__call__
    monkeypatch.setattr(programs.Program, "__call__", lambda *given: [x + 1e-9 for x in run(*given)])
    with pytest.raises(AssertionError, match="others"):
        self_test.check()


@pytest.mark.slow
def test_another_process_tries_it():
    assert self_test.is_usable()


def failed(words, **_):
    raise subprocess.CalledProcessError(1, words, stderr=b"Traceback\nAssertionError: the numbers are others\n")


def killed(words, **_):
    raise subprocess.CalledProcessError(-11, words, stderr=b"")


@pytest.mark.parametrize("run, reason", [(failed, "the numbers are others"), (killed, "status -11")])
def test_where_it_fails_one_warning_says_why(monkeypatch, run, reason):
    monkeypatch.setattr(self_test.subprocess, "run", run)
    with pytest.warns(UserWarning, match=reason) as caught:
        assert not self_test.is_usable()
    assert not self_test.is_usable()
    assert len(caught) == 1


def test_an_application_is_not_started_again(monkeypatch):
    monkeypatch.setattr(self_test.sys, "executable", "/opt/editor/editor")
    with pytest.warns(UserWarning, match="/opt/editor/editor"):
        assert not self_test.is_usable()
