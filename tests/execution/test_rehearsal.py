"""What is compiled beside the first program is what comes later, and whatever goes wrong there leaves no trace."""

import sys
import threading
from contextlib import contextmanager

import jax
import numpy as np
import pytest

import jounce as jn
from jounce.execution.compilation import StoppedError, compiled, stopped_by
from jounce.execution.rehearsal import NAME, first_time, is_rehearsing, rehearsed
from jounce.execution.threads import VARIABLE
from tests.problems.dynamics import double_pendulum
from tests.problems.small import four_bar
from tests.programs import counts

START = "_moved", "_with_row_rates", "_judged"  # of a simulation, found beside


@pytest.fixture
def compiled_later(monkeypatch):
    """Rehearse first, in this thread and with its errors; tell what was compiled in the place of that afterwards."""
    before = {}
    monkeypatch.setenv(VARIABLE, "2")

    @contextmanager
    def first(rehearsal, *, wanted):
        rehearsal()  # also where another test has had the programs
        before.update(counts())
        yield

    solving = sys.modules["jounce.kinematics.position_analysis.solve"]
    rehearse = solving._rehearse  # in this thread in any case

    def known(*arguments):
        rehearse(*arguments)
        before.update(counts())

    monkeypatch.setattr(solving, "rehearsed", first)
    monkeypatch.setattr(solving, "_rehearse", known)
    monkeypatch.setattr(sys.modules["jounce.execution.rehearsal"], "_had", set())
    monkeypatch.setattr(sys.modules["jounce.integrate.mechanisms.programs_ahead"], "rehearsed", first)
    return lambda: {name for name, count in counts().items() if count > before[name]}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["press", "sarrus", "servo_press"])  # its driver follows from an output
def test_forces_of_a_motion_are_rehearsed(name, compiled_later):
    motion = jn.solve(jn.load(f"examples/{name}.yaml"), order=1)
    assert all(np.isfinite(values).any() for values in motion.outputs.values())
    assert compiled_later() <= {"take_steps"}


@pytest.mark.slow
def test_results_with_a_rehearsal_beside_are_those_without(monkeypatch):
    press, found = jn.load("examples/press.yaml"), []
    for threads in ("1", "2"):
        jax.clear_caches()  # or there is nothing to rehearse
        monkeypatch.setenv(VARIABLE, threads)
        monkeypatch.setattr(sys.modules["jounce.execution.rehearsal"], "_had", set())
        found.append(jn.solve(press, order=1).outputs)
    for name, values in found[0].items():
        np.testing.assert_array_equal(found[1][name], values)


@pytest.mark.slow
def test_long_grids_are_rehearsed(compiled_later):
    jn.solve(four_bar(), np.linspace(0, 2, 1500), order=5)
    assert compiled_later() <= {"take_steps"}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["delta_robot", "sarrus"])
def test_forces_of_a_simulation_are_rehearsed(name, compiled_later):
    simulation = jn.simulate(jn.load(f"examples/{name}.yaml"), np.linspace(0.0, 0.02, 5), order=1)
    assert all(np.isfinite(values).any() for values in simulation.outputs.values())
    assert compiled_later() <= {"march", *START}


@pytest.mark.parametrize(
    "mechanism, method",
    [
        pytest.param(double_pendulum(), None, marks=pytest.mark.slow),
        pytest.param(double_pendulum(), jn.Obreshkov(4, step=1 / 64), marks=pytest.mark.slow),
    ],
)
def test_the_evaluation_of_steps_is_rehearsed(mechanism, method, compiled_later):
    simulation = jn.simulate(mechanism, np.linspace(0, 0.2, 5), order=2, method=method)
    assert all(np.isfinite(values).all() for values in simulation.outputs.values())
    assert compiled_later() <= {"march", *START}


def test_what_goes_wrong_in_a_rehearsal_is_not_told(monkeypatch):
    monkeypatch.setenv(VARIABLE, "2")  # also on one core
    called = threading.Event()

    def wrong():
        called.set()
        raise ZeroDivisionError

    with rehearsed(wrong, wanted=True):
        pass
    assert called.is_set()


def test_nothing_is_rehearsed_where_it_is_not_wanted_or_one_thread_computes(monkeypatch):
    called = []
    with rehearsed(lambda: called.append(1), wanted=False):
        pass
    monkeypatch.setenv(VARIABLE, "1")
    with rehearsed(lambda: called.append(1), wanted=True):
        pass
    assert not called


def test_an_error_ends_a_rehearsal_before_its_next_program(monkeypatch):
    monkeypatch.setenv(VARIABLE, "2")
    asked, failed, ended = (threading.Event() for _ in range(3))
    reached = []
    program = compiled()(np.negative)

    def rehearsal():
        asked.set()
        assert failed.wait(60)
        try:
            program(np.ones(2))
            reached.append("compiled")
        except StoppedError:
            reached.append("stopped")
        ended.set()

    def failing():
        with rehearsed(rehearsal, wanted=True):
            assert asked.wait(60)
            threading.Timer(0.2, failed.set).start()  # after the error has left the context
            raise KeyError

    with pytest.raises(KeyError):
        failing()
    assert ended.wait(60)
    assert reached == ["stopped"]


def test_programs_run_again_when_what_stopped_them_is_over():
    program, stop = compiled()(lambda x: 2 * x), threading.Event()
    stop.set()
    with stopped_by(stop), pytest.raises(StoppedError):
        program(np.ones(2))
    np.testing.assert_array_equal(program(np.ones(2)), [2, 2])


def test_a_program_is_new_once_for_arguments_of_one_form():
    name = "a program of this test"
    assert [first_time(name, (np.ones(2), 1.0), 3), first_time(name, (np.zeros(2), 2.0), 3)] == [True, False]
    assert [first_time(name, (np.ones(3), 1.0), 3), first_time(name, (np.ones(2), 1.0), 4)] == [True, True]


def test_it_is_known_whether_some_thread_still_compiles(monkeypatch):
    monkeypatch.setenv(VARIABLE, "2")
    going, done = threading.Event(), threading.Event()

    def rehearsal():
        going.set()
        done.wait(10)

    assert not is_rehearsing()

    def stopped():
        with rehearsed(rehearsal, wanted=True):
            assert going.wait(10)
            raise KeyError

    with pytest.raises(KeyError):
        stopped()
    assert is_rehearsing()
    done.set()
    for thread in threading.enumerate():
        if thread.name == NAME:
            thread.join(10)
    assert not is_rehearsing()
