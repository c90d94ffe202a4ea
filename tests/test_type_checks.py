"""Types are checked wherever tests run, however pytest was called."""

import pytest

from tests.type_checks import only_deals_out


@pytest.mark.parametrize(
    "words",
    ["", "-n 0", "-n0", "-q -n 0 tests", "--numprocesses 0", "--numprocesses=0", "-n 2 -n 0", "-n auto --pdb", "-n"],
)
def test_a_process_that_runs_tests_itself_checks_types(words):
    assert not only_deals_out(words.split(), {})


@pytest.mark.parametrize("words", ["-n 2", "-n2", "-q tests -n 1", "--numprocesses 2", "--numprocesses=3", "-n auto"])
def test_a_process_that_only_deals_out_goes_without_the_imports(words):
    assert only_deals_out(words.split(), {})
    assert not only_deals_out(words.split(), {"PYTEST_XDIST_WORKER": "gw0"})


def test_other_options_that_begin_with_n_are_no_count():
    assert not only_deals_out(["--no-header", "-no-such"], {})
