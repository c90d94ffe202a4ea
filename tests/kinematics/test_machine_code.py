"""Machine code for many instants: the same motions as XLA, and XLA as the fallback."""

import numpy as np
import pytest

import jounce as jn
from jounce.execution.llvm import self_test
from jounce.execution.llvm.programs import Program
from jounce.execution.mapped import Mapped, OnLlvm
from jounce.kinematics import Status
from jounce.kinematics.continuation import continuation_steps
from jounce.kinematics.continuation.instant_program import advance_instant
from jounce.mechanism.building.builder import build
from tests.linear_algebra.test_frontal import chain
from tests.problems.small import four_bar, slider_crank

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(not self_test.is_usable(), reason="there is no compiler, or a system where it was not tried"),
]
SPATIAL = ["rsur", "rssr", "hooke_joint", "bennett", "sarrus", "stewart_platform", "delta_robot"]
PLANAR = ["six_bar_watt", "jansen_leg", "quick_return", "gear_pair", "wolfrom_train", "peaucellier", "servo_press"]


@pytest.fixture(autouse=True)
def _machine_code(monkeypatch):
    monkeypatch.delenv("JOUNCE_NATIVE", raising=False)  # as where all tests run without machine code


def agree(one, other, tolerance=1e-11):
    """Compare two motions: outcomes, and outputs by the peak of each derivative."""
    np.testing.assert_array_equal(one.status, other.status)
    for name, expected in other.outputs.items():
        peak = np.nanmax(np.abs(expected), axis=0)
        scale = np.where(peak > 1e-9 * np.max(peak), peak, 1.0 + np.max(peak)) + 1e3 * (
            np.max(peak) < 1e-6
        )  # or rounding
        np.testing.assert_allclose(one.outputs[name] / scale, expected / scale, rtol=0, atol=tolerance)


def both_ways(mechanism, times, monkeypatch, **given):
    """Return the motion by machine code and by XLA alone."""
    found = jn.solve(mechanism, times, **given)
    monkeypatch.setenv("JOUNCE_NATIVE", "0")
    return found, jn.solve(mechanism, times, **given)


@pytest.mark.parametrize("count", [1, 40, 1500])
@pytest.mark.parametrize("mechanism", [four_bar, pytest.param(slider_crank, marks=pytest.mark.slow)])
def test_motions_are_those_of_xla(mechanism, count, monkeypatch):
    found, expected = both_ways(mechanism(), np.linspace(0, 2, count), monkeypatch)
    agree(found, expected)
    assert (found.backend, expected.backend) == ("llvm", "xla")


@pytest.mark.slow
@pytest.mark.parametrize("samples", [25, 301])
def test_motions_by_laws_through_samples_are_those_of_xla(samples, monkeypatch):
    """A law of many samples keeps its table in memory, as scalar code for it would be too long."""
    made, program = [], Mapped.program
    monkeypatch.setattr(
        Mapped, "program", lambda *a, **k: made.append(isinstance(program(*a, **k), OnLlvm)) or program(*a, **k)
    )
    instants = np.linspace(0, 2, samples)
    law = jn.trajectory.SplineMotion(instants, 0.5 + np.sin(np.pi * instants), 7)
    found, expected = both_ways(four_bar(motion=law), np.linspace(0, 2, 1500), monkeypatch)
    assert made[0]
    agree(found, expected, tolerance=1e-12)


@pytest.mark.slow
def test_motions_of_many_bodies_are_those_of_xla(monkeypatch):
    mechanism = chain(20)
    assert build(mechanism).system.fronts is not None
    agree(*both_ways(mechanism, np.linspace(0, 2, 50), monkeypatch))


@pytest.mark.slow
@pytest.mark.parametrize("name", [*SPATIAL, *PLANAR])
def test_motions_of_examples_are_those_of_xla(name, monkeypatch):
    mechanism = jn.load(f"examples/{name}.yaml")
    for times in (np.linspace(0, 0.4, 50), np.linspace(0, 0.4, 1200)):
        with monkeypatch.context() as context:
            agree(*both_ways(mechanism, times, context), tolerance=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("order", [0, 1, 9])
def test_other_orders(order, monkeypatch):
    agree(*both_ways(four_bar(), np.linspace(0, 2, 1500), monkeypatch, order=order))


@pytest.mark.slow
def test_instants_that_fail_are_the_same(monkeypatch):
    mechanism = four_bar(motion="30*deg + 3*t", AB=0.12)  # a rocker, which comes to a dead point
    found, expected = both_ways(mechanism, np.linspace(0, 2, 1500), monkeypatch, strict=False)
    assert {int(Status.OK), int(Status.NOT_REACHED)} < set(found.status.tolist())
    agree(found, expected, tolerance=1e-8)
    assert found.faults == expected.faults


def test_unrefined_positions(monkeypatch):
    times = np.linspace(0, 2, 1100)
    found, expected = both_ways(four_bar(), times, monkeypatch, refine=False, tolerance=1e-6)
    np.testing.assert_allclose(found.outputs["psi"][:, 0], expected.outputs["psi"][:, 0], atol=1e-6)


def test_results_depend_neither_on_threads_nor_on_neighbors():
    times = np.linspace(0, 2, 3001)
    found = [jn.solve(four_bar(), times, threads=count).outputs["psi"] for count in (1, 2, 3)]
    np.testing.assert_array_equal(found[1], found[0])
    np.testing.assert_array_equal(found[2], found[0])


def test_a_leg_without_code_of_its_own_is_left_to_xla_whole(monkeypatch):
    """XLA cannot call the machine code of an instant."""
    grid = np.linspace(0.0, 2.0, 5)
    expected = jn.solve(four_bar(), grid)
    programs = []

    def program(shared, lanes, static, **how):
        programs.append(static["native"])

    monkeypatch.setattr(continuation_steps.take_steps.machine_code, "program", program)
    found = jn.solve(four_bar(), grid)
    assert programs
    assert None not in programs
    assert found.backend == "xla"
    agree(found, expected)
    assert jn.solve(four_bar(), np.linspace(0.0, 2.0, 1100)).backend == "llvm, xla"  # by its steps, and its instants


def test_the_machine_code_of_a_motion_is_that_of_its_structure():
    before = len(advance_instant.machine_code._programs)
    jn.solve(four_bar(), np.linspace(0, 2, 5))
    known = len(advance_instant.machine_code._programs)
    jn.solve(four_bar(), np.linspace(0, 1, 1100))
    assert known in (before, before + 1)
    assert len(advance_instant.machine_code._programs) == known
    assert all(
        isinstance(program, Program)
        for program in advance_instant.machine_code._programs.values()
        if program is not None
    )
