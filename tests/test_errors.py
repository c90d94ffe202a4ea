"""The wording of messages, and what errors carry."""

import pickle
import warnings

import numpy as np
import pytest

import jounce as jn
from jounce import errors
from jounce.errors import (
    ExpressionError,
    JounceError,
    MechanismError,
    MechanismFileError,
    RobotWarning,
    SolveError,
    check_choice,
    check_name,
    did_you_mean,
    flag,
    show_value,
)


def test_message_puts_place_problem_value_and_advice_in_order():
    error = MechanismFileError("is odd; try another", path="a.yaml", line=12, name="joints.BC.length", value=-0.1423)
    assert str(error) == "a.yaml, line 12, joints.BC.length: is odd, got -0.1423; try another"


def test_message_leaves_out_what_is_not_known():
    assert str(JounceError("is odd")) == "is odd"
    assert str(JounceError("is odd", name="a.b")) == "a.b: is odd"
    assert str(JounceError("is odd", value=None)) == "is odd, got nothing"


def test_located_fills_in_but_never_overwrites():
    error = MechanismError("is odd", line=3).located(path="a.yaml", line=9, name="a")
    assert isinstance(error, MechanismError)
    assert str(error) == "a.yaml, line 3, a: is odd"


FAMILY = [kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, JounceError)]


@pytest.mark.parametrize("kind", FAMILY)
def test_every_error_survives_another_process(kind):
    error = pickle.loads(pickle.dumps(kind("is odd", line=3, value=[1])))
    assert (type(error), str(error)) == (kind, "line 3: is odd, got [1]")
    assert str(pickle.loads(pickle.dumps(kind("is odd")))) == "is odd"


def test_solve_error_holds_what_was_computed():
    error = SolveError("stopped", motion="half", status="singular")
    assert (error.motion, error.status) == ("half", "singular")


@pytest.mark.parametrize(
    "value, words",
    [
        (True, "true"),
        ({}, "an empty mapping"),
        ([], "an empty list"),
        ("\u03c8", "'\\u03c8'"),
        ([[[[1]]]], "[[[[...]]]]"),
        ({"a": [1, 2]}, "{a: [1, 2]}"),
    ],
)
def test_values_are_shown_in_plain_short_words(value, words):
    assert show_value(value) == words


def test_long_values_are_cut():
    assert show_value(10**5000) == "a number with too many digits"
    assert len(show_value("x" * 10**6)) == 80
    assert len(show_value(list(range(10**5)))) <= 80


def test_suggestions_come_before_the_list():
    assert did_you_mean("lenght", ["length", "points"]) == "did you mean 'length'? valid: length, points"
    assert did_you_mean("A", ["a"]) == "did you mean 'a'? valid: a"
    assert did_you_mean("q", [str(k) for k in range(100)]) == "there are 100, such as 0, 1, 10"
    assert did_you_mean("q", []) == "none is defined"


def test_a_flag_is_true_or_false_and_nothing_that_only_counts_as_one():
    for value in (True, np.bool_(True)):
        assert flag("drives", value, error=jn.errors.RobotError) is True
    assert flag("drives", np.bool_(False), error=jn.errors.RobotError) is False
    for value in ("no", 2, 0, None, np.array([True]), np.float64(1.0)):
        with pytest.raises(jn.errors.RobotError, match=r"drives.*True or False"):
            flag("drives", value, error=jn.errors.RobotError)


def test_messages_are_bounded_whatever_a_file_says():
    long = "x" * 100_000
    for error in (
        JounceError(long, path=long, name=long, value=long),
        ExpressionError(f"{long}; do this"),
        SolveError(long),
        JounceError(did_you_mean(long, [f"{long}{k}" for k in range(3)])),
    ):
        assert len(str(error)) < 12_000
    with pytest.warns(RobotWarning) as caught:
        warnings.warn(long, RobotWarning, stacklevel=1)
    assert len(str(caught[0].message)) < 5000


def test_of_very_many_names_none_is_likened():
    names = [f"joint_{k:06d}" for k in range(100_000)]
    assert did_you_mean("joint_00000x", names) == "there are 100,000, such as joint_000000, joint_000001, joint_000002"
    assert did_you_mean("joint_000001", names[:1000]) == "did you mean 'joint_000001'?"


def test_a_value_that_cannot_be_a_name_is_no_name():
    with pytest.raises(JounceError, match=r"no link has this name, got \[0, 0\]; valid: base, rod"):
        check_name("link", [0, 0], {"base": 0, "rod": 1}, JounceError)
    with pytest.raises(JounceError, match=r"frame: unknown frame, got \[0, 0\]; valid: body, global"):
        check_choice("frame", [0, 0], {"body", "global"}, JounceError)
