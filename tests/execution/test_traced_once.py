"""Functions that are traced once for a program: how often they run, and that nothing outlives the program."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jounce.execution.traced_once import one_program, traced_once

SCALE = [2.0]
RUNS = []


@traced_once(static=(1,))
def powers(x, count):
    """A value of a user's, which may change, times a power."""
    RUNS.append(count)
    return SCALE[0] * x**count


@pytest.fixture(autouse=True)
def _none_yet(monkeypatch):
    monkeypatch.setattr("tests.execution.test_traced_once.RUNS", RUNS[:0])
    SCALE[0] = 2.0


def program(x):
    """Calls, derivatives and batches of derivatives of one function."""
    with one_program():
        _, slope = jax.jvp(lambda y: powers(y, 3), (x,), (jnp.ones_like(x),))
        slopes = jax.vmap(lambda d: jax.jvp(lambda y: powers(y, 3), (x,), (d,))[1])(jnp.eye(2))
        return powers(x, 3) + powers(2.0 * x, 3) + slope + slopes.sum(axis=0) + powers(x, 2)


def test_traced_once_for_each_form_in_a_program():
    x = np.array([0.5, -1.5])
    found = jax.jit(lambda y: program(y))(x)
    assert RUNS == [3, 2], "once for each static argument"
    np.testing.assert_allclose(found, 2 * (x**3 + 8 * x**3 + 2 * 3 * x**2 + x**2), rtol=1e-15)


def test_another_program_sees_what_has_changed():
    x = np.array([0.5, -1.5])
    before = jax.make_jaxpr(lambda y: program(y))(x)
    SCALE[0] = 5.0
    after = jax.make_jaxpr(lambda y: program(y))(x)
    assert RUNS == [3, 2, 3, 2]
    values = [jax.core.eval_jaxpr(each.jaxpr, each.consts, x)[0] for each in (before, after)]
    np.testing.assert_allclose(values[1], 2.5 * np.asarray(values[0]), rtol=1e-15)


def test_outside_of_a_program_it_runs_as_written():
    assert [float(powers(2.0, count)) for count in (1, 1)] == [4.0, 4.0]
    assert RUNS == [1, 1]


def test_programs_within_programs_keep_their_own():
    with one_program():
        powers(jnp.ones(2), 3)
        with one_program():
            powers(jnp.ones(2), 3)
        powers(jnp.ones(2), 3)
    assert RUNS == [3, 3]
