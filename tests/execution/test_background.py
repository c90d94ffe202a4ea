"""Programs are made once for each key, in whichever thread, and what goes wrong beside leaves no trace."""

import threading

import jax
import numpy as np
import pytest

import jounce as jn
from jounce.execution import background
from jounce.execution.background import NAME, ByKey, is_compiling, prepare_later
from jounce.execution.compilation import compiled
from jounce.execution.mapped import Mapped
from jounce.execution.threads import VARIABLE
from tests.problems.dynamics import double_pendulum
from tests.problems.small import four_bar
from tests.programs import counts, forget

START = "_moved", "_with_row_rates", "_computed_facts"  # of a simulation, made while its programs are


@pytest.fixture
def two_threads(monkeypatch):
    monkeypatch.setenv(VARIABLE, "2")  # also on one core
    monkeypatch.setattr(background, "_had", set())
    yield
    finish()


def finish():
    if (worker := background._worker) is not None:
        worker.join(60)  # by itself, as a thread about to end is no longer enumerated
    assert not is_compiling()


@pytest.fixture
def made_later(monkeypatch):
    """Do jobs at once, in this thread and with their errors; tell what was compiled beside them afterwards."""
    before = {}
    monkeypatch.setenv(VARIABLE, "2")  # with one thread nothing is made before

    def at_once(job, *_):
        job()
        before.update(counts())

    for name in ("kinematics.position_analysis.solve", "kinematics.results.output_programs"):
        monkeypatch.setattr(f"jounce.{name}.prepare_later", at_once)
    monkeypatch.setattr("jounce.integrate.mechanisms.programs_ahead.prepare_later", at_once)
    return lambda: {name for name, count in counts().items() if count > before.get(name, 0)}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["four_bar", "delta_robot"])
def test_the_programs_of_a_motion_are_those_that_are_made_before(name, made_later):
    motion = jn.solve(jn.load(f"examples/{name}.yaml"), order=1)
    assert all(np.isfinite(values).any() for values in motion.outputs.values())
    assert not made_later() & {"take_steps", "advance_instant", "balanced"}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["delta_robot", "sarrus"])  # the second has redundant rows
def test_the_programs_of_a_simulation_are_those_that_are_made_before(name, made_later):
    simulation = jn.simulate(jn.load(f"examples/{name}.yaml"), np.linspace(0.0, 0.02, 5), order=1)
    assert all(np.isfinite(values).any() for values in simulation.outputs.values())
    assert not made_later() & {"march", "expanded", "balanced"}


@pytest.mark.slow
@pytest.mark.parametrize("method", [None, jn.Obreshkov(4, step=1 / 64)])
def test_steps_and_what_is_within_them_are_made_before(method, made_later):
    simulation = jn.simulate(double_pendulum(), np.linspace(0, 0.2, 5), order=2, method=method)
    assert all(np.isfinite(values).all() for values in simulation.outputs.values())
    assert made_later() <= {*START}


@pytest.mark.slow
def test_results_are_those_without_a_thread_beside(two_threads, monkeypatch):
    press, found = jn.load("examples/press.yaml"), []
    for threads in ("1", "2"):
        forget()  # or there is nothing to be made
        jax.clear_caches()
        monkeypatch.setenv(VARIABLE, threads)
        found.append(jn.solve(press, order=1).outputs)
    for name, values in found[0].items():
        np.testing.assert_array_equal(found[1][name], values)


def test_the_call_waits_for_the_program_that_is_made_beside(two_threads):
    programs, begun, going = ByKey(), threading.Event(), threading.Event()
    made = []

    def make():
        begun.set()
        assert going.wait(60)
        made.append(threading.current_thread().name)
        return "a program"

    prepare_later(lambda: programs.get("key", make), "a job of this test", ())
    assert begun.wait(60)
    assert is_compiling()
    threading.Timer(0.1, going.set).start()
    assert programs.get("key", make) == "a program"
    assert made == [NAME]
    finish()


def test_who_waits_takes_up_what_comes_next(two_threads):
    programs, begun, going = ByKey(), threading.Event(), threading.Event()
    done = []

    def make():
        begun.set()
        assert going.wait(60)

    prepare_later(lambda: programs.get("key", make), "the first job of this test", ())
    prepare_later(lambda: (done.append(threading.current_thread()), going.set()), "the second job", ())
    assert begun.wait(60)
    programs.get("key", make)
    assert done == [threading.current_thread()]


def test_what_goes_wrong_beside_is_raised_where_it_is_due(two_threads):
    programs, threads = ByKey(), []

    def wrong():
        threads.append(threading.current_thread().name)
        raise ZeroDivisionError

    prepare_later(lambda: programs.get("key", wrong), "a job that fails", ())
    finish()
    assert threads == [NAME]
    with pytest.raises(ZeroDivisionError):
        programs.get("key", wrong)
    assert len(programs) == 0
    assert programs.get("key", lambda: 3) == 3


def test_a_job_is_done_once_for_arguments_of_one_form(two_threads):
    done = []

    def give(arguments, *static):
        prepare_later(lambda: done.append(static), "a job of this test", arguments, *static)
        finish()
        return len(done)

    assert [give((np.ones(2), 1.0), 3), give((np.zeros(2), 2.0), 3)] == [1, 1]
    assert [give((np.ones(3), 1.0), 3), give((np.ones(2), 1.0), 4)] == [2, 3]


def test_one_thread_does_nothing_beside(monkeypatch):
    called = []
    monkeypatch.setenv(VARIABLE, "1")
    prepare_later(lambda: called.append(1), "a job that nobody does", ())
    finish()
    assert not called


def test_a_program_is_made_from_shapes_alone():
    program, form = compiled("times")(lambda x, times: {"sum": times * x[0].sum() + x[1]}), jax.ShapeDtypeStruct
    program.prepare((form((3,), float), 1.0), times=2)
    assert len(program.machine_code) == 1
    assert float(program((np.arange(3.0), 4.0), times=2)["sum"]) == 10.0
    assert float(program((np.arange(3.0), 5.0), times=2)["sum"]) == 11.0
    assert len(program.machine_code) == 1


@pytest.mark.parametrize("rows", [False, True])
def test_a_function_of_an_instant_is_made_from_shapes_alone(rows):
    doubled = Mapped(lambda shared, lanes: shared * lanes, rows=rows)
    doubled.program(np.array(2.0), jax.ShapeDtypeStruct((4, 2) if rows else (2, 4), float))
    assert len(doubled.machine_code) == 1
    lanes = np.arange(10.0).reshape((5, 2) if rows else (2, 5))
    np.testing.assert_array_equal(doubled.program(np.array(2.0), lanes)(lanes), 2 * lanes)
    assert len(doubled.machine_code) == 1


def test_a_motion_needs_no_thread_once_its_programs_are_there(two_threads):
    jn.solve(four_bar(), np.linspace(0, 0.1, 3), order=1)
    finish()
    started = threading.active_count()
    jn.solve(four_bar(), np.linspace(0, 0.1, 4), order=1)
    assert threading.active_count() == started
