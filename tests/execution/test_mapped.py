"""Functions of one instant run for many: the same by machine code and by XLA, side by side and in rounds."""

import pickle
import threading

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import digamma

import jounce as jn
from jounce.dynamics.inverse import force_programs
from jounce.execution import backends, mapped, translated
from jounce.execution.llvm import self_test
from jounce.execution.llvm.modules import object_file
from jounce.execution.mapped import Mapped, OnXla
from jounce.execution.store import programs as store_
from tests.execution.test_compilation import Shelf

needs_machine_code = pytest.mark.skipif(
    not self_test.is_usable(), reason="there is no compiler, or a system where it was not tried"
)


@pytest.fixture(autouse=True)
def _machine_code(monkeypatch):
    monkeypatch.delenv("JOUNCE_NATIVE", raising=False)  # as where all tests run without machine code


@Mapped
def example(shared, lanes, *, times):
    """A function of one instant."""
    return {"sum": shared[0] * lanes[0] + times, "larger": lanes[0] > shared[0]}


def fresh():
    """The function as in a new process."""
    return Mapped(example.function)


def results(function):
    """Its results for five instants."""
    x = np.arange(5.0)
    found = function.program((2.0,), (x,), times=3)((x,))
    np.testing.assert_array_equal(found["sum"], 2 * x + 3)
    np.testing.assert_array_equal(found["larger"], x > 2)
    return found


def test_what_is_kept_is_not_made_again(monkeypatch):
    store, made = Shelf(), []
    monkeypatch.setattr(store_, "_store", store)
    function = example.function
    monkeypatch.setattr(translated, "cache_key", lambda *given: repr(given[2]))  # it has no name in the package
    monkeypatch.setattr(translated, "object_file", lambda *a, **k: made.append(1) or object_file(*a, **k))
    for _ in range(3):
        results(Mapped(function))
    assert (len(made), len(store)) == (1, 1)
    (key,) = store
    store[key] = b"damaged"
    results(Mapped(function))
    assert (len(made), store.dropped) == (2, [b"damaged"])


def test_a_function_of_a_user_is_not_kept(monkeypatch):
    store = Shelf()
    monkeypatch.setattr(store_, "_store", store)
    results(fresh())
    assert not store


def test_threads_that_ask_at_once_get_one_program():
    function, found = fresh(), []

    def ask():
        found.append(function.program((2.0,), (np.arange(5.0),), times=3))

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len({id(prepared.machine_code) for prepared in found}) == 1


@pytest.mark.parametrize("variable, installed", [("0", True), ("1", False)], ids=["switched off", "not installed"])
def test_there_may_be_none(variable, installed, monkeypatch):
    monkeypatch.setenv("JOUNCE_NATIVE", variable)
    monkeypatch.setattr(self_test, "is_usable", lambda: installed)
    assert isinstance(fresh().program((2.0,), (np.arange(5.0),), times=3), OnXla)


def test_there_is_none_for_what_is_traced():
    def traced(x):
        assert isinstance(fresh().program((x,), (np.arange(5.0),), times=3), OnXla)
        return x

    jax.jit(traced)(2.0)


def test_what_has_no_rule_is_left_to_xla_with_one_warning(monkeypatch):
    def transformed(shared, lanes):
        return jax.lax.digamma(lanes[0]) * shared[0][:, None]

    monkeypatch.setattr(backends, "_warned", set())
    given, x = (np.arange(3.0),), np.random.default_rng(1).uniform(1.0, 2.0, (3, 5))
    function = Mapped(transformed)
    with pytest.warns(jn.errors.MachineCodeWarning, match="operation 'digamma'"):
        program = function.program(given, (x,))
    assert program.backend == "xla"
    np.testing.assert_allclose(program((x,)), digamma(x) * given[0][:, None], rtol=1e-13)
    assert function.program(given, (x,)).backend == "xla"


@pytest.mark.parametrize(
    "shared, lanes",
    [((np.float32(2.0),), (np.arange(5.0),)), ((2.0,), (np.arange(5),)), ((np.ones(2),), (np.arange(5.0),))],
    ids=["single precision", "whole numbers", "another shape"],
)
def test_arrays_of_another_kind_are_refused(shared, lanes):
    code = fresh().program((2.0,), (np.arange(5.0),), times=3).machine_code
    with pytest.raises(ValueError, match="made for"):
        code([np.asarray(x) for x in shared], [np.asarray(x) for x in lanes])


def test_only_a_program_that_becomes_machine_code_calls_it():
    name = fresh().program((2.0,), (np.arange(5.0),), times=3).name
    lanes = np.arange(16.0)
    with pytest.raises(Exception, match=name):
        jax.jit(lambda x: mapped.called(name, (jnp.asarray(2.0),), (x,)))(lanes)
    with pytest.raises(ValueError, match="a vector has"):
        mapped.called(name, (jnp.asarray(2.0),), (jnp.zeros(1),))


def drift(shared, lanes):
    """Where an instant comes to from its source, and how many came before it."""
    (position, label), time, forward = lanes
    moved = shared[0] * position + time[None, None]
    return {"label": label + 1, "position": jnp.where(forward[None, None], position + moved, position), "rest": moved}


DRIFT = Mapped(drift)


@pytest.mark.parametrize("native", [pytest.param("1", marks=needs_machine_code), "0"])
def test_rounds_are_a_loop_over_instants(monkeypatch, native):
    """Whoever computes them; and of rounds that are not all, the rest stays as it is."""
    monkeypatch.setenv("JOUNCE_NATIVE", native)
    generator, count = np.random.default_rng(3), 32
    position, label = generator.normal(size=(3, 2, count + 1)), np.zeros(count + 1, np.int64)
    time, sources = generator.normal(size=count), np.maximum(np.arange(count) - 8, -1) % (count + 1)
    example = (position[..., :1], label[:1]), time[:1], np.array([True])
    program = DRIFT.program((np.float64(0.5),), example, width=lambda: 8)
    assert program.backend == ("llvm" if native == "1" else "xla")
    expected, before = position.copy(), label.copy()
    turns = np.arange(24).reshape(-1, program.width)
    for lane in turns.ravel():
        expected[..., lane] = 1.5 * expected[..., sources[lane]] + time[lane]
        before[lane] = before[sources[lane]] + 1
    lanes, results = ((position, label), time, example[2]), {"label": label, "position": position, "rest": None}
    start = [np.copy(x[..., count:]) for x in lanes[0]]
    program.rounds(lanes, results, sources, (1, 0))(turns)
    np.testing.assert_allclose(position, expected, rtol=1e-13)
    np.testing.assert_array_equal(label, before)
    if program.width == 8:  # sources are lanes of the round before
        lanes, results["label"], results["position"] = (tuple(start), *lanes[1:]), None, np.zeros((3, 2, count))
        program.rounds(lanes, results, np.where(sources == count, 0, -1), (1, 0))(turns)
        np.testing.assert_allclose(results["position"][..., :24], expected[..., :24], rtol=1e-13)


@pytest.mark.parametrize("rows", [True, False])
@pytest.mark.parametrize("count", [0, 1, 8, 9, 300])
def test_xla_computes_blocks_of_few_sizes(monkeypatch, count, rows):
    monkeypatch.setenv("JOUNCE_NATIVE", "0")
    function, x = Mapped(lambda shared, lanes: lanes[0] ** 2 + shared, rows=rows), np.linspace(0.0, 1.0, 3 * count)
    x = x.reshape(count, 3) if rows else x.reshape(3, count)
    found = function.program(np.float64(2.0), (x,))((x,))
    np.testing.assert_allclose(found, x**2 + 2.0, rtol=1e-15)
    assert found.flags.writeable
    assert function.on_xla.jitted._cache_size() == 1


def test_a_mapped_function_is_pickled_by_its_name():
    """Results of mechanisms hold those that compute forces when they are asked for."""
    assert pickle.loads(pickle.dumps(force_programs.joint_wrench)) is force_programs.joint_wrench
