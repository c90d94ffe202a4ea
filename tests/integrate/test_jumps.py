"""The state at a jump of a force is as exact as the steps: closed forms over many jumps, forward and backward."""

import numpy as np
import pytest

import jounce as jn
from jounce import drivers, forces, planar

STRENGTH = 1000.0
QUARTER = np.sqrt(2.0 / STRENGTH)  # s: from rest at 1 m to the middle


def relay(time):
    """Position of 1 kg at rest at 1 m, under a force of constant size toward zero."""
    s = np.mod(time, 4 * QUARTER)
    parts = [1 - STRENGTH * s**2 / 2, -1 + STRENGTH * (s - 2 * QUARTER) ** 2 / 2]
    parts.append(1 - STRENGTH * (s - 4 * QUARTER) ** 2 / 2)
    return np.where(s < QUARTER, parts[0], np.where(s < 3 * QUARTER, parts[1], parts[2]))


def sled(law, motion="1.0"):
    rail = ([0, 0], [0, 0], [1, 0], [1, 0])
    return jn.Mechanism(
        space="planar",
        parameters={"K": STRENGTH, "drag": 0.05},
        bodies={"sled": jn.Body([1, 0], mass=1.0, inertia=1.0)},
        joints={"rail": planar.Prismatic(("ground", "sled"), *rail)},
        forces={"push": forces.SlideForce(("ground", "sled"), *rail[:3], law)},
        initial={"go": drivers.SlideDriver(("ground", "sled"), *rail[:3], motion)},
        outputs={"x": jn.outputs.PointOutput("sled", [0, 0])},
    )


@pytest.mark.slow
def test_a_relay_over_ten_periods():
    time = np.linspace(0.0, 40 * QUARTER, 82)[:-1]
    for instants in (time, -time):  # it is even in time
        motion = jn.simulate(sled("-K*x/abs(x)"), instants, 1)
        assert np.abs(motion.outputs["x"][:, 0, 0] - relay(time)).max() < 1e-12
        when = np.abs([instant for instant, _ in motion.kinks])
        np.testing.assert_allclose(when, QUARTER * (1 + 2 * np.arange(20)), rtol=0, atol=1e-15 * 40)


@pytest.mark.slow
def test_runs_of_a_batch_and_robots_cross_jumps_as_exactly():
    time = np.linspace(0.0, 12 * QUARTER, 26)[:-1]
    batch = jn.simulate_batch(sled("-K*x/abs(x)"), {"K": [STRENGTH, STRENGTH / 4]}, time, 1)
    assert (batch.status == 0).all()
    for run, since in ((0, time), (1, time / 2)):
        assert np.abs(batch.outputs["x"][run, :, 0, 0] - relay(since)).max() < 1e-12
    axis = jn.robot.JointAxis([1, 0, 0], type="prismatic", inertia=jn.Inertia(1.0))
    robot = jn.robot.from_screws([axis])
    (name,) = robot.joint_names
    torque = {name: f"-{STRENGTH}*{name}/abs({name})"}
    time = np.linspace(0.0, 40 * QUARTER, 82)[:-1]
    motion = jn.simulate(robot, time, 1, state=[[1.0], [0.0]], torque=torque)
    assert np.abs(motion.q[:, 0, 0] - relay(time)).max() < 1e-12
    assert len(motion.kinks) == 20


@pytest.mark.slow
def test_dry_friction_at_turning_points():
    # x'' = -x - drag sign(v): half turns of circles about -drag and drag, which turn at multiples of pi
    motion = jn.simulate(sled("-x - drag*v/abs(v)", "10*cos(t - 0.5)"), np.linspace(0.0, 40.0, 81), 1)
    radius = np.hypot(10 * np.cos(0.5) + 0.05, 10 * np.sin(0.5))
    phase = np.arctan2(10 * np.sin(0.5), 10 * np.cos(0.5) + 0.05)  # before the first turn, there x is greatest
    turns = phase + np.pi * np.arange(13)
    np.testing.assert_allclose([when for when, _ in motion.kinks], turns[turns < 40.0], rtol=0, atol=1e-12)
    count = np.searchsorted(turns, motion.time)  # turns so far
    size = radius - 0.1 * count  # the center leaps by twice 0.05 at each
    expected = np.where(count % 2 == 0, -0.05, 0.05) + size * np.cos(motion.time - phase)
    assert np.abs(motion.outputs["x"][:, 0, 0] - expected).max() < 1e-11


@pytest.mark.slow
def test_a_jump_in_time_costs_no_digits():
    time = np.linspace(0.0, 3.0, 7)
    motion = jn.simulate(sled("K*(t - 1.1)/abs(t - 1.1)"), time, 1)
    after = np.maximum(time - 1.1, 0.0)
    expected = 1 - STRENGTH * time**2 / 2 + STRENGTH * after**2
    np.testing.assert_allclose(motion.outputs["x"][:, 0, 0], expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    assert motion.kinks[0][0] == pytest.approx(1.1, abs=1e-13)


@pytest.mark.slow
def test_friction_at_rest_ends_the_run_with_a_reason():
    motion = jn.simulate(sled("-drag*v/abs(v)", "t"), [0.0, 10.0, 30.0], 1, strict=False)  # at rest after 20 s
    assert [jn.Status(int(s)).name for s in motion.status] == ["OK", "OK", "COLLAPSED"]
    assert motion.ended_at == pytest.approx(20.0, abs=1e-6)
    assert motion.steps < 200
    assert "forces.push" in motion.faults[2]
    assert "dry friction" in motion.faults[2]
