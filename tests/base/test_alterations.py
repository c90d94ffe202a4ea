"""What was replaced in this process is found, wherever it is, and nothing else is."""

import time

import pytest

import jounce as jn
from jounce.base import alterations
from jounce.base.alterations import altered
from jounce.execution import structure
from jounce.execution.store.programs import Store
from jounce.execution.structure import UndescribedError, cache_key
from jounce.integrate.marching import marching
from jounce.io import json_schema
from jounce.jet.programs import operations
from jounce.kinematics.continuation import continuation_steps, step_control

REVOLUTE = jn.planar.Revolute


def test_nothing_is_altered():
    assert altered() is None


@pytest.mark.parametrize(
    "thing, name, value",
    [
        (step_control, "GROWTH", 2.0),
        (continuation_steps, "advance", lambda: None),
        (continuation_steps, "jnp", object()),
        (REVOLUTE, "residual", lambda *_: 0.0),
        (REVOLUTE, "squared_distance", not REVOLUTE.squared_distance),
        (marching, "march", None),
        (Store, "get", None),
    ],
)
def test_what_is_replaced_is_named_until_it_is_back(monkeypatch, thing, name, value):
    assert altered() is None  # and known
    with monkeypatch.context() as patch:
        patch.setattr(thing, name, value)
        assert str(altered()).endswith(f".{name}")
        with pytest.raises(UndescribedError, match=name):
            cache_key((altered,), None, (), {})
    assert altered() is None


def test_a_method_that_a_class_did_not_have_is_named(monkeypatch):
    monkeypatch.setattr(REVOLUTE, "__rsub__", lambda *_: 0.0, raising=False)
    assert str(altered()).endswith("Revolute.__rsub__")


def test_a_table_that_has_another_entry_is_named(monkeypatch):
    name, table = next((n, t) for n, t in vars(operations).items() if n.isupper() and isinstance(t, dict))
    assert altered() is None
    monkeypatch.setitem(table, "an operation of this test", None)
    assert str(altered()).endswith(f".{name}")


def test_users_classes_alter_nothing():
    class Own(REVOLUTE, type="own_of_this_test"):
        """A joint."""

        def residual(self, body_i, body_j, time):
            return super().residual(body_i, body_j, time)

    assert altered() is None


def test_programs_of_files_that_were_written_meanwhile_have_no_names(monkeypatch):
    monkeypatch.setattr(structure, "IMPORT_TIME", time.time() - 1e10)
    structure._changed_file.cache_clear()
    try:
        assert str(structure._changed_file()).endswith(".py")
    finally:
        structure._changed_file.cache_clear()
    assert time.time() >= alterations.IMPORT_TIME


def test_writing_the_schema_alters_nothing():
    json_schema()
    assert altered() is None
