"""Programs that are kept between processes: the same results as without, whatever became of the store."""

import threading

import jax
import numpy as np
import pytest

import jounce as jn
from jounce.execution import compilation
from jounce.execution.compilation import Compiled
from jounce.execution.store import programs as store_
from tests.programs import forget


class Shelf(dict):
    """A store in memory that counts what is asked of it."""

    def __init__(self):
        self.dropped = []

    def put(self, key, value):
        self[key] = value

    def drop(self, key):
        self.dropped.append(self.pop(key))


traced = []


def example(x, y=(), *, times=1):
    """What is compiled here: it is told when it is traced."""
    traced.append(times)
    return {"sum": x.sum() * times, "parts": (x + 1.0, y)}


@pytest.fixture
def shelf():
    traced.clear()
    store = Shelf()
    store_.use_store(store)
    yield store
    store_.use_store(None)


def anew():
    """The function as in a new process, which has compiled nothing yet."""
    jax.clear_caches()
    return Compiled(example, ("times",), (Compiled.__call__,))


def test_another_process_does_not_trace(shelf):
    x = np.arange(3.0)
    for _ in range(3):
        result = anew()(x, (2.0,), times=2)
        assert float(result["sum"]) == 6.0
        np.testing.assert_array_equal(result["parts"][0], x + 1)
        assert float(result["parts"][1][0]) == 2.0
    assert (len(shelf), traced) == (1, [2])


def test_what_differs_has_a_program_of_its_own(shelf):
    x = np.arange(3.0)
    calls = [
        ((x,), {"times": 1}), ((x,), {"times": 2}), ((x,), {"times": 2.0}), ((np.arange(4.0),), {}),
        ((x, 1.0), {}), ((x, [1.0]), {}), ((x, (1.0,)), {}), ((x, {"a": 1.0}), {}),
        ((x, 1), {}),
    ]  # fmt: skip
    for arguments, keywords in calls * 2:
        found, expected = anew()(*arguments, **keywords), example(*arguments, **keywords)
        assert jax.tree.structure(found) == jax.tree.structure(expected)
        jax.tree.map(np.testing.assert_array_equal, found, expected)
    assert len(shelf) == len(calls)


def test_one_process_asks_once(shelf):
    function = anew()
    for k in range(3):
        assert float(function(np.full(2, float(k)))["sum"]) == 2 * k
    shelf.clear()
    assert float(function(np.ones(2))["sum"]) == 2


def test_functions_of_users_go_the_ordinary_way(shelf):
    own = Compiled(example, ("times",))  # a function of a test is a user's
    assert float(own(np.ones(2))["sum"]) == 2.0
    assert not shelf


def test_threads_share_programs(shelf):
    x, found = np.arange(5.0), []
    anew()(x)
    function = anew()

    def work():
        for _ in range(20):
            found.append(float(function(x)["sum"]))

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [10.0] * 80


@pytest.mark.slow
def test_a_motion_is_the_same_with_kept_programs(shelf):
    mechanism = jn.load("examples/slider_crank.yaml")
    time = np.linspace(0.0, 0.1, 7)
    forget()  # those that other tests have made are not kept
    before = jn.solve(mechanism, time, order=5)
    assert shelf
    forget()
    count = len(shelf)
    after = jn.solve(mechanism, time, order=5)
    assert len(shelf) == count
    for name, values in before.outputs.items():
        np.testing.assert_array_equal(after.outputs[name], values)


def test_a_command_about_few_instants_is_in_haste(monkeypatch):
    monkeypatch.setattr(store_, "_many", False)
    monkeypatch.setattr(store_, "_soon", True)
    store_.expect(store_.FEW)
    assert store_.is_in_haste()
    store_.expect(store_.FEW + 1)
    store_.expect(1)  # the many are not forgotten
    assert not store_.is_in_haste()


def test_all_programs_are_optimized_but_for_a_command(shelf):
    assert not store_.is_in_haste()


@pytest.mark.parametrize("unknown", ["xla_cpu_use_fusion_emitters", "xla_backend_optimization_level", "everything"])
def test_options_that_a_release_of_xla_does_not_know_are_left_out(monkeypatch, unknown):
    def are_known(options):
        return not (unknown == "everything" or unknown in options)

    monkeypatch.setattr(compilation, "on_processor", lambda: True)
    monkeypatch.setattr(compilation, "_level_is_set", lambda: False)
    monkeypatch.setattr(compilation, "_are_known", are_known)
    compilation._known_options.cache_clear()
    try:
        found = compilation.compiler_options(narrow=True)
    finally:
        compilation._known_options.cache_clear()
    names = {"xla_cpu_use_fusion_emitters", "xla_disable_hlo_passes", "xla_backend_optimization_level"}
    assert found is None if unknown == "everything" else found.keys() == names - {unknown}
