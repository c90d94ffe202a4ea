"""Programs of a run that are made while its start is looked for: those that the run then needs, and no others."""

import dataclasses
import threading

import numpy as np
import pytest

import jounce as jn
from jounce.execution.background import NAME
from jounce.execution.llvm import self_test
from jounce.execution.translated import Translated
from jounce.integrate.marching.marching import march
from jounce.integrate.results.simulation import expanded
from tests.problems.dynamics import simple_pendulum

needs_machine_code = pytest.mark.skipif(
    not self_test.is_usable(), reason="there is no compiler, or a system where it was not tried"
)


@pytest.fixture
def made(monkeypatch):
    """What machine code is made of, but for that of starts."""
    monkeypatch.delenv("JOUNCE_NATIVE", raising=False)
    found, make = [], Translated._made

    def recorded(self, *given, **named):
        if self.function.__name__ in ("march", "expanded"):
            found.append(self.function.__name__)
        return make(self, *given, **named)

    monkeypatch.setattr(Translated, "_made", recorded)
    return found


def swing(mechanism, tolerance):
    """Each tolerance wants series of another length, and so programs of their own."""
    return jn.simulate(mechanism, np.linspace(0.0, 0.1, 3), tolerance=tolerance)


@needs_machine_code
@pytest.mark.parametrize("threads", ["1", "2"])
def test_they_are_those_of_the_run(made, monkeypatch, threads):
    monkeypatch.setenv("JOUNCE_THREADS", threads)
    tolerance = {"1": 3e-5, "2": 2e-6}[threads]
    found = swing(simple_pendulum(0.3, 1.0), tolerance)
    assert sorted(made) == ["expanded", "march"]
    again = swing(simple_pendulum(0.4, 1.0), tolerance)
    assert sorted(made) == ["expanded", "march"]
    assert found.outputs["angle"][0, 0] != again.outputs["angle"][0, 0]


@pytest.mark.slow
def test_xla_compiles_each_once(monkeypatch):
    monkeypatch.setenv("JOUNCE_NATIVE", "0")
    monkeypatch.setenv("JOUNCE_THREADS", "2")
    before = [program.jitted._cache_size() for program in (march.on_xla, expanded.on_xla)]
    swing(simple_pendulum(0.3, 1.0), 7e-6)
    assert [program.jitted._cache_size() for program in (march.on_xla, expanded.on_xla)] == [
        count + 1 for count in before
    ]


@needs_machine_code
@pytest.mark.slow
def test_those_with_redundant_rows_begin_with_the_start(made, monkeypatch):
    monkeypatch.setenv("JOUNCE_THREADS", "2")
    pendulum = simple_pendulum(0.3, 1.0)
    joints = pendulum.joints | {"again": next(iter(pendulum.joints.values()))}
    swing(dataclasses.replace(pendulum, joints=joints), 1e-7)
    assert sorted(made) == ["expanded", "march"]


@pytest.mark.slow
def test_a_start_that_is_refused_is_reported_whatever_is_made_beside(made, monkeypatch):
    monkeypatch.setenv("JOUNCE_THREADS", "2")
    pendulum = simple_pendulum(0.3, 1.0)
    other = jn.drivers.CoordinateDriver(("ground", "bob"), "angle", "angle + 1")
    with pytest.raises(jn.errors.AssemblyError, match="contradict each other"):
        swing(dataclasses.replace(pendulum, initial=pendulum.initial | {"other": other}), 1e-9)
    for thread in threading.enumerate():
        if thread.name == NAME:
            thread.join()
    found = swing(pendulum, 1e-9)
    assert sorted(made) == ["expanded", "march"]  # those that were made for the other one
    assert np.isfinite(found.outputs["angle"]).all()
