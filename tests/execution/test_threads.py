"""Long grids in several threads: the same to the last bit, whoever calls; errors and interrupts come through."""

import threading
from concurrent.futures import ThreadPoolExecutor

import jax
import numpy as np
import pytest

import jounce as jn
from jounce.execution.compilation import ByXla
from jounce.execution.threads import VARIABLE, Threads, thread_count
from tests.problems.small import four_bar, slider_crank

LONG = np.linspace(0, 2, 4001)


def results(motion):
    return np.concatenate([values.ravel() for values in (*motion.outputs.values(), motion.status)])


@pytest.mark.slow
@pytest.mark.parametrize("mechanism", [four_bar(), slider_crank("4 - 0.5*cos(t)**2")], ids=["four-bar", "passes"])
def test_results_do_not_depend_on_the_number_of_threads(mechanism):
    one, two, three = (results(jn.solve(mechanism, LONG, order=3, strict=False, threads=count)) for count in (1, 2, 3))
    np.testing.assert_array_equal(two, one)
    np.testing.assert_array_equal(three, one)


def test_several_threads_may_call_at_once():
    lengths = [0.12, 0.13, 0.14, 0.15]
    single = [results(jn.solve(four_bar(BC=length), LONG, threads=1)) for length in lengths]
    with ThreadPoolExecutor(4) as callers:
        together = callers.map(lambda length: results(jn.solve(four_bar(BC=length), LONG, threads=2)), lengths)
        for found, expected in zip(together, single, strict=True):
            np.testing.assert_array_equal(found, expected)


def test_progress_is_reported_in_the_thread_that_asked_and_may_interrupt():
    def interrupt(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        jn.solve(four_bar(), LONG, progress=interrupt, threads=2)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rssr", "four_bar"])
def test_programs_of_long_grids_hold_no_lapack(monkeypatch, name):
    """JAX waits for batches of LAPACK in the threads that they need: two callers would wait for each other."""
    texts, call = {}, ByXla.__call__

    def recorded(self, *arguments, **keywords):
        if (name := self.function.__name__) not in texts:
            texts[name] = self.jitted.lower(*arguments, **keywords).as_text()
        return call(self, *arguments, **keywords)

    monkeypatch.setattr(ByXla, "__call__", recorded)
    monkeypatch.setenv("JOUNCE_NATIVE", "0")  # machine code calls no library of the kind
    jn.solve(jn.load(f"examples/{name}.yaml"), LONG[:1100], strict=False)
    assert {"take_steps", "_in_rounds"} <= texts.keys()
    assert "lapack" not in texts["take_steps"] + texts["_in_rounds"]


def test_items_are_mapped_in_order_and_an_error_comes_through():
    def inverse(k):
        return 1 / k

    with Threads(2) as threads:
        assert list(threads.map(inverse, range(1, 40))) == [1 / k for k in range(1, 40)]
        with pytest.raises(ZeroDivisionError):
            list(threads.map(inverse, [2, 1, 0, 3, 4]))


def test_errors_come_in_the_order_of_their_items():
    """Whichever thread has come to one first."""
    second = threading.Event()

    def failing(k):
        if k == 0:
            second.wait(timeout=20)
        else:
            second.set()
        raise ValueError(k)

    with Threads(2, compiled=True) as threads, pytest.raises(ValueError, match="0"):
        list(threads.map(failing, range(4)))
    assert second.is_set()


def test_as_many_threads_compute_as_are_asked_for():
    meeting, names = threading.Barrier(3), set()

    def meet(_):
        names.add(threading.current_thread().name)
        meeting.wait(timeout=20)

    with Threads(3, compiled=True) as threads:
        list(threads.map(meet, range(6)))
    assert len(names) == 3


def test_two_items_run_side_by_side_as_soon_as_a_first_one_has_compiled():
    meeting = threading.Barrier(2)
    with Threads(2) as pool:
        assert list(pool.map(abs, [-1])) == [1]
        ends = list(pool.map(lambda _: meeting.wait(timeout=20), range(2)))  # in turn, the first would wait for ever
    assert sorted(ends) == [0, 1]


def test_the_default_device_of_the_caller_is_that_of_its_threads():
    device = jax.devices()[0]
    with jax.default_device(device), Threads(2) as threads:
        assert list(threads.map(lambda _: jax.config.jax_default_device, range(3))) == [device] * 3


@pytest.mark.parametrize("count", [0, -1, 1.5, True, "two"])
def test_no_number_of_threads(count):
    with pytest.raises(jn.errors.MechanismError, match="whole number above zero"):
        thread_count(count)


def test_number_of_threads_from_the_environment(monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)
    assert thread_count() >= 1
    monkeypatch.setenv(VARIABLE, "3")
    assert thread_count() == 3
    assert thread_count(2) == 2
    monkeypatch.setenv(VARIABLE, "many")
    with pytest.raises(jn.errors.MechanismError, match=VARIABLE):
        thread_count()
