"""Multipliers from machine code beside those of XLA's programs, and where there is no code."""

import dataclasses

import numpy as np
import pytest

import jounce as jn
from jounce.dynamics.inverse import force_programs
from jounce.dynamics.inverse.motion_forces import MotionForces
from jounce.execution.llvm import programs, self_test

pytestmark = pytest.mark.skipif(
    not self_test.is_usable(), reason="there is no compiler, or a system where it was not tried"
)
Z = [0.0, 0.0, 1.0]


@pytest.fixture(autouse=True)
def _machine_code(monkeypatch):
    monkeypatch.delenv("JOUNCE_NATIVE", raising=False)  # as where all tests run without machine code


def both_ways(motion, monkeypatch):
    """Return the multipliers by machine code, which is seen to be used, and by XLA alone."""
    called, call = [], programs.Program.__call__
    monkeypatch.setattr(programs.Program, "__call__", lambda *a, **k: called.append(1) or call(*a, **k))
    found = MotionForces(motion).multipliers
    assert called
    called.clear()
    monkeypatch.setenv("JOUNCE_NATIVE", "0")
    expected = MotionForces(motion).multipliers
    assert not called
    return found, expected


def agree(found, expected, tolerance=1e-12):
    assert found.shape == expected.shape
    assert np.abs(expected).max() > 0
    scale = 1e-300 + np.abs(expected).max(axis=(1, 2), keepdims=True)  # of each derivative
    np.testing.assert_allclose(found / scale, expected / scale, rtol=0, atol=tolerance)


def turning_door():
    """Return a door on a spring that turns with it, driven more than once round."""
    return jn.Mechanism(
        space="spatial",
        bodies={"door": jn.Body([0, 0, 0], mass=2.0, inertia=[0.1, 0.2, 0.3], center_of_mass=[0.3, 0.0, 0.1])},
        joints={"hinge": jn.spatial.Revolute(("ground", "door"), [0, 0, 0], [0, 0, 0], Z, Z)},
        drivers={"turn": jn.drivers.RotationDriver(("ground", "door"), Z, "9*sin(t)")},
        forces={"spring": jn.forces.SpatialTorsionalSpring(("ground", "door"), Z, 3.0)},
        time=np.linspace(0.0, 1.5, 40),
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "press",
        pytest.param("stewart_forces", marks=pytest.mark.slow),
        pytest.param("excavator", marks=pytest.mark.slow),
        pytest.param("delta_robot", marks=pytest.mark.slow),
    ],
)
def test_multipliers_of_driven_mechanisms(name, monkeypatch):
    mechanism = dataclasses.replace(jn.load(f"examples/{name}.yaml"), outputs={})
    agree(*both_ways(jn.solve(mechanism), monkeypatch))


@pytest.mark.slow
def test_angles_with_their_turns(monkeypatch):
    found, expected = both_ways(jn.solve(turning_door()), monkeypatch)
    agree(found, expected)
    spring = 3.0 * 9.0 * np.sin(np.linspace(0.0, 1.5, 40))  # N m, beyond one turn
    assert np.abs(spring).max() > 6 * np.pi


@pytest.mark.parametrize(
    "name, end", [("double_pendulum", 0.4), pytest.param("sprung_four_bar", 0.2, marks=pytest.mark.slow)]
)
def test_multipliers_of_free_motions(name, end, monkeypatch):
    motion = jn.simulate(jn.load(f"examples/{name}.yaml"), np.linspace(0.0, end, 9))
    agree(*both_ways(motion, monkeypatch), tolerance=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bennett", "sarrus", "four_bar_in_space"])
def test_multipliers_of_redundant_rows(name, monkeypatch):
    """Those of least norm, and which reactions they leave open."""
    motion = jn.solve(dataclasses.replace(jn.load(f"examples/{name}.yaml"), outputs={}))
    agree(*both_ways(motion, monkeypatch))
    monkeypatch.delenv("JOUNCE_NATIVE")
    known = np.isfinite(MotionForces(motion).unique_multipliers)
    monkeypatch.setenv("JOUNCE_NATIVE", "0")
    np.testing.assert_array_equal(np.isfinite(MotionForces(motion).unique_multipliers), known)
    assert known.any()
    assert known.all() == (motion.mechanism.redundant_reactions != "unique")


def test_few_bodies_in_space_are_balanced_by_single_values_and_others_by_loops(monkeypatch):
    door = jn.solve(turning_door(), order=4)
    single, loops = force_programs.largest_array(door.model), force_programs.SMALL
    assert single > loops
    found = MotionForces(door).multipliers
    monkeypatch.setattr(force_programs, "largest_array", lambda model: loops)
    agree(MotionForces(door).multipliers, found)


@pytest.mark.parametrize("name", ["four_bar", "bennett", "spatial_slider_crank_free"])
def test_balances_in_the_plane_with_redundant_rows_or_of_free_motions_are_loops(name):
    mechanism = jn.load(f"examples/{name}.yaml")
    motion = jn.simulate(mechanism, [0.0, 0.01]) if name.endswith("free") else jn.solve(mechanism, [0.0])
    assert force_programs.largest_array(motion.model) == force_programs.SMALL
