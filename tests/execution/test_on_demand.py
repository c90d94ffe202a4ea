"""A mapping whose values are computed when they are first asked for."""

import gc
import weakref

import jax
import numpy as np
import pytest

import jounce as jn
from jounce.execution.on_demand import OnDemand
from tests.problems.small import four_bar


def counting():
    asked = []

    def compute(name):
        asked.append(name)
        return {"a": 1.0, "b": 2.0} if name in "ab" else {name: 3.0}

    return asked, OnDemand(["a", "b", "c"], compute)


def test_nothing_is_computed_before_it_is_asked_for_nor_twice():
    asked, values = counting()
    assert "b" in values
    assert "d" not in values
    assert (list(values), len(values), asked) == (["a", "b", "c"], 3, [])
    assert (values["b"], values["a"], values["b"], asked) == (2.0, 1.0, 2.0, ["b"])
    assert dict(values) == {"a": 1.0, "b": 2.0, "c": 3.0}
    assert (repr(values), asked) == ("{'a': 1.0, 'b': 2.0, 'c': 3.0}", ["b", "c"])
    with pytest.raises(KeyError, match="'d'; valid: a, b, c"):
        values["d"]


def test_to_jax_it_is_a_tree():
    values = counting()[1]
    doubled = jax.tree.map(lambda x, y: x + y, values, values)
    assert dict(doubled) == {"a": 2.0, "b": 4.0, "c": 6.0}


def test_outputs_in_any_order_are_the_same():
    one, other = (jn.solve(four_bar(), np.linspace(0, 1, 7)).outputs for _ in range(2))
    for name in reversed(list(one)):
        np.testing.assert_array_equal(one[name], dict(other)[name])


def test_a_motion_goes_with_its_last_reference():
    """Nothing that refers to it is kept in it: its arrays would stay until the next search for garbage."""
    motion = jn.solve(four_bar(), np.linspace(0, 1, 7))
    outputs = motion.outputs["psi"], motion.dataset, motion.outputs
    gone = weakref.ref(motion)
    del outputs
    gc.disable()
    try:
        del motion
        assert gone() is None
    finally:
        gc.enable()
