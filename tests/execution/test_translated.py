"""Machine code of functions of small arrays beside XLA's programs."""

import threading

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import digamma

import jounce as jn
from jounce.execution import backends, background, structure, translated
from jounce.execution.compilation import Compiled, compiled
from jounce.execution.llvm import modules, self_test
from jounce.execution.store import programs as store_
from jounce.execution.translated import WhenMade
from tests.execution.test_compilation import Shelf

pytestmark = pytest.mark.skipif(
    not self_test.is_usable(), reason="there is no compiler, or a system where it was not tried"
)


@pytest.fixture(autouse=True)
def _machine_code(monkeypatch):
    monkeypatch.delenv("JOUNCE_NATIVE", raising=False)  # as where all tests run without machine code


def logistic(x, count, *, rate=3.5, power=1):
    """A history of a map, in an array that a loop fills; the kind of result tells who computed it."""

    def turn(k, carry):
        x, history = carry
        x = rate * x * (1.0 - x)
        return x, jax.lax.dynamic_update_index_in_dim(history, x**power, k, 0)

    x, history = jax.lax.fori_loop(0, count, turn, (x, jnp.zeros((60, *x.shape))))
    return {"last": x, "history": history}, history[:, 0].sum()


def program():
    return Compiled(logistic, ("power",))


def expected(x, count, rate=3.5, power=1):
    history = np.zeros((60, *x.shape))
    for k in range(count):
        x = rate * x * (1 - x)
        history[k] = x**power
    return x, history


def check(found, exact):
    (result, total), (x, history) = found, exact
    np.testing.assert_allclose(result["last"], x, rtol=1e-13)
    np.testing.assert_allclose(result["history"], history, rtol=1e-13)
    np.testing.assert_allclose(total, history[:, 0].sum(), rtol=1e-13)


def test_results_are_those_of_the_function():
    x, run = np.array([0.2, 0.7, 0.31]), program()
    for count in (0, 1, 13):
        found = run(x, count)
        assert isinstance(found[0]["last"], np.ndarray)
        check(found, expected(x, count))
    check(run(x, 5, rate=3.9, power=3), expected(x, 5, 3.9, 3))
    check(run(0.5 * x, count=5), expected(0.5 * x, 5))


@pytest.mark.parametrize("reason", ["environment", "traced"])
def test_xla_computes_the_rest(reason, monkeypatch):
    x, run = np.linspace(0.1, 0.9, 3), program()
    if reason == "environment":
        monkeypatch.setenv("JOUNCE_NATIVE", "0")
    found = jax.jit(lambda x: run(x, 7))(x) if reason == "traced" else run(x, 7)
    assert isinstance(found[0]["last"], jax.Array)
    check(found, expected(x, 7))


def test_an_operation_without_code_is_left_to_xla(monkeypatch):
    monkeypatch.setattr(backends, "_warned", set())

    @compiled()
    def transformed(x):
        return jax.lax.digamma(x)

    with pytest.warns(jn.errors.MachineCodeWarning, match="digamma"):
        found = transformed(np.arange(1.0, 5.0))
    np.testing.assert_allclose(found, digamma(np.arange(1.0, 5.0)), rtol=1e-13)


def test_a_program_that_is_too_long_is_left_to_xla_with_a_warning_when_it_is_needed(monkeypatch):
    monkeypatch.setattr(backends, "_warned", set())
    monkeypatch.setattr(modules, "MOST_LINES", 20)
    x = np.linspace(0.1, 0.9, 3)
    run = Compiled(lambda x: sum(jnp.sin(k * x) for k in range(1, 40)), ())
    job = threading.Thread(target=lambda: (background._queued.append(lambda: run(x)), background._took_up_next()))
    job.start()
    job.join()
    assert len(run.machine_code) == 1
    with pytest.warns(jn.errors.MachineCodeWarning, match="a program of more than 20 lines"):
        found = run(x)
    assert isinstance(found, jax.Array)
    np.testing.assert_allclose(found, np.sin(np.arange(1, 40)[:, None] * x).sum(0), rtol=1e-13)


def test_arrays_may_lie_in_any_way():
    run = Compiled(lambda x, y: (x - y, jnp.sum(x)), ())
    whole = np.arange(24.0).reshape(2, 3, 4)
    for x in (whole, whole[::-1], whole[:, ::2], whole.transpose(2, 0, 1), np.broadcast_to(1.5, (2, 3)), whole[:0]):
        difference, total = run(x, 2.0)
        np.testing.assert_array_equal(difference, x - 2.0)
        assert total == x.sum()


def test_a_static_argument_is_found_once_for_arguments_of_a_form():
    found, indices = [], np.array([2, 0])

    def times(factor):
        return lambda: found.append(factor) or factor

    run = Compiled(lambda x, k, *, factor: factor * x[k], ("factor",), otherwise={"factor": 5.0})
    for factor, size, k in ((2.0, 3, indices), (None, 3, indices), (3.0, 4, indices), (4.0, 4, indices[::-1])):
        x = np.arange(float(size))
        np.testing.assert_array_equal(run(x, k, factor=WhenMade(times(factor))), (factor or 2.0) * x[k])
    assert found == [2.0, 3.0, 4.0]  # for other whole numbers it may be another one
    np.testing.assert_array_equal(run(np.arange(9.0), indices, factor=WhenMade(times(None))), [10.0, 0.0])


@pytest.mark.parametrize("damage", [None, b"", b"no program"])
def test_what_is_kept_is_loaded_or_made_again(damage, monkeypatch):
    traced, shelf, x = [], Shelf(), np.array([0.2, 0.4])
    real = jax.make_jaxpr  # of JAX: where something of this package is replaced, nothing is kept
    monkeypatch.setattr(jax, "make_jaxpr", lambda *a, **k: traced.append(a) or real(*a, **k))
    monkeypatch.setattr(store_, "_store", shelf)
    monkeypatch.setattr(structure, "altered", lambda: None)  # whatever other tests of this process have replaced
    for _ in range(2):
        function = translated.Translated(logistic, (Compiled.__call__,), single=True)
        arrays, tree = [x, np.asarray(4)], jax.tree.structure(((x, 4), {}))
        run = function.program((arrays, tree), ((), jax.tree.structure(())), {"power": 2}, large=32)
        check(run(arrays), expected(x, 4, power=2))
        if damage is not None:
            shelf |= dict.fromkeys(shelf, damage)
    assert len(traced) == (1 if damage is None else 2)
    assert len(shelf.dropped) == (damage is not None)


@pytest.mark.parametrize("count", [10, translated.LITTLE + 1])
def test_what_is_given_much_is_compiled_well_however_seldom_it_is_called(count, monkeypatch):
    asked, made = [], translated.object_file
    monkeypatch.setattr(
        translated, "object_file", lambda *given, **how: asked.append(how["brief"]) or made(*given, **how)
    )
    x = np.linspace(0, 1, count)
    np.testing.assert_array_equal(Compiled(lambda x: 2.0 * x, (), brief=True)(x), 2 * x)
    assert asked == [count == 10]
