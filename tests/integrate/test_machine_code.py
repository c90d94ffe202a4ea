"""Simulations by machine code beside those of XLA's programs."""

import numpy as np
import pytest

import jounce as jn
from jounce.execution.llvm import programs, self_test

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(not self_test.is_usable(), reason="there is no compiler, or a system where it was not tried"),
]


@pytest.fixture(autouse=True)
def _machine_code(monkeypatch):
    monkeypatch.delenv("JOUNCE_NATIVE", raising=False)  # as where all tests run without machine code


def both_ways(mechanism, times, monkeypatch, **given):
    """Return the simulation by machine code, which is seen to be used, and by XLA alone."""
    called = []
    for kind in (programs.Single, programs.Program):
        call = kind.__call__
        monkeypatch.setattr(kind, "__call__", lambda *a, call=call, **k: called.append(call) or call(*a, **k))
    found = jn.simulate(mechanism, times, **given)
    assert len(set(called)) == 2
    called.clear()
    monkeypatch.setenv("JOUNCE_NATIVE", "0")
    expected = jn.simulate(mechanism, times, **given)
    assert not called
    assert (found.backend, expected.backend) == ("llvm", "xla")
    return found, expected


def agree(found, expected, tolerance):
    np.testing.assert_array_equal(found.status, expected.status)
    assert len(found.events) == len(expected.events)
    for one, other in zip(found.events, expected.events, strict=True):
        np.testing.assert_allclose(one, other, rtol=tolerance)
    for name, values in expected.outputs.items():
        others = tuple(axis for axis in range(values.ndim) if axis != 1)  # the peak of each derivative
        scale = 1e-12 + np.nanmax(np.abs(values), axis=others, keepdims=True)
        np.testing.assert_allclose(found.outputs[name] / scale, values / scale, rtol=0, atol=tolerance)
    np.testing.assert_allclose(found.energy, expected.energy, rtol=tolerance, atol=tolerance)


@pytest.mark.parametrize(
    "name, end",
    [
        ("simple_pendulum", 2.0),
        pytest.param("double_pendulum", 1.0, marks=pytest.mark.slow),
        pytest.param("sprung_four_bar", 1.0, marks=pytest.mark.slow),
        pytest.param("andrews", 0.01, marks=pytest.mark.slow),
        pytest.param("spatial_slider_crank_free", 0.5, marks=pytest.mark.slow),
        pytest.param("flyball_governor", 0.02, marks=pytest.mark.slow),
        pytest.param("stewart_forces", 0.2, marks=pytest.mark.slow),
    ],
)
def test_motions_are_those_of_xla(name, end, monkeypatch):
    mechanism = jn.load(f"examples/{name}.yaml")
    swinging = name in ("simple_pendulum", "double_pendulum")  # others may begin where the event is
    events = [jn.Event(next(iter(mechanism.outputs.values())))] if swinging else []
    agree(*both_ways(mechanism, np.linspace(0.0, end, 30), monkeypatch, events=events), 1e-8)


@pytest.mark.slow
def test_machine_code_goes_backward_and_takes_fixed_steps(monkeypatch):
    mechanism = jn.load("examples/simple_pendulum.yaml")
    for times, method in ((np.linspace(1.0, 0.0, 5), None), (np.linspace(0.0, 1.0, 5), jn.Taylor(8, step=0.05))):
        with monkeypatch.context() as patch:
            agree(*both_ways(mechanism, times, patch, method=method), 1e-9)
