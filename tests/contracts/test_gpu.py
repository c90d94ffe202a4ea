"""The same programs on a CUDA device, in double precision: their results are those of the processor to rounding.

Where JAX finds no such device, the tests that need one are skipped, with what JAX says; what a GPU makes different,
wider rounds and blocks, is tested on the processor.
"""

import json
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce.execution import mapped
from jounce.execution.device import on_processor
from jounce.kinematics.continuation import instant_program
from tests.problems.mechanisms import example, reference

ROBOTS = Path(__file__).parents[2] / "examples" / "robots"
ROUNDING = 1e-13  # of the peak of each derivative to jounce: what a GPU fuses and sums otherwise


@pytest.fixture(scope="module")
def cuda():
    try:
        return jax.devices("cuda")[0]
    except RuntimeError as error:
        pytest.skip(f"no CUDA device: {error}")


def peaks_apart(found, expected, axis):
    """Largest difference of each derivative by its peak."""
    found, expected = (
        np.moveaxis(np.asarray(x), axis, 0).reshape(np.shape(expected)[axis], -1) for x in (found, expected)
    )
    return np.abs(found - expected).max(axis=1) / np.abs(expected).max(axis=1)


def arm():
    """The panda without fingers, q to the fourth derivative, and torques with two rates in fifty digits."""
    content = json.loads((Path(__file__).parents[1] / "robot" / "references" / "arm.json").read_text())
    robot = jn.load_robot(ROBOTS / "panda.urdf").locked({"panda_finger_joint1": 0.0})
    return robot, np.array(content["q"], float)[:, :5], np.array(content["torque"], float)[:, :3]


@pytest.mark.parametrize("name", ["four_bar", "rsur"])
def test_mechanisms_on_a_gpu(cuda, name):
    time, outputs = reference(name)
    grid = np.unique(np.concatenate([np.linspace(0, 2, 1990), time]))
    mechanism, lanes = jn.load(example(name)), np.searchsorted(grid, time)
    with jax.default_device(cuda):
        found = jn.solve(mechanism, grid).outputs["psi"]
        assert jax.jit(lambda x: x + 1)(np.zeros(1)).devices() == {cuda}
    with jax.default_device(jax.devices("cpu")[0]):
        expected = jn.solve(mechanism, grid).outputs["psi"]
    assert np.all(peaks_apart(found, expected, 1) < ROUNDING)
    assert np.all(peaks_apart(found[lanes], outputs["psi"][:5].T, 1) < ROUNDING)


def test_robots_on_a_gpu(cuda):
    robot, q, expected = arm()
    given = np.resize(q, (5000, *q.shape[1:]))
    with jax.default_device(cuda):
        found = jn.inverse_dynamics(robot, given, drives=False)
        inside = jax.jit(lambda x: jn.inverse_dynamics(robot, x, drives=False))(jnp.asarray(given))
        mass = jn.mass_matrix(robot, q[:, 0])
    assert inside.devices() == {cuda}
    np.testing.assert_allclose(mass, jn.mass_matrix(robot, q[:, 0]), rtol=0, atol=1e-13)
    for torque in (found, np.asarray(inside)):
        assert np.all(peaks_apart(torque, np.resize(expected, torque.shape), 1) < ROUNDING)


def test_simulations_on_a_gpu(cuda):
    mechanism = jn.load(example("double_pendulum"))
    with jax.default_device(cuda):
        found = jn.simulate(mechanism, [0.0, 0.5, 1.0], 2).outputs["a"]
    expected = jn.simulate(mechanism, [0.0, 0.5, 1.0], 2).outputs["a"]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11)


def test_a_default_device_is_asked_before_the_first_backend():
    with jax.default_device(jax.devices("cpu")[0]):
        assert on_processor()
    with jax.default_device("cpu"):
        assert on_processor()
    with jax.default_device("gpu"):
        assert not on_processor()


@pytest.mark.slow
def test_the_wide_rounds_of_a_gpu_give_the_same_motion(monkeypatch):
    mechanism, grid = jn.load(example("four_bar")), np.linspace(0.0, 2.0, 1500)
    expected = jn.solve(mechanism, grid).outputs["psi"]
    monkeypatch.setenv("JOUNCE_NATIVE", "0")
    monkeypatch.setattr(instant_program, "on_processor", lambda: False)
    monkeypatch.setattr(instant_program, "GPU_WIDTH", 2**10)
    found = jn.solve(mechanism, grid).outputs["psi"]
    assert np.all(peaks_apart(found, expected, 1) < ROUNDING)


@pytest.mark.slow
def test_the_wide_blocks_of_a_gpu_give_the_same_torques(monkeypatch):
    robot, q, expected = arm()
    monkeypatch.setenv("JOUNCE_NATIVE", "0")
    monkeypatch.setattr(mapped, "on_processor", lambda: False)
    monkeypatch.setattr(mapped, "SIDE_BY_SIDE", 4)
    monkeypatch.setattr(mapped, "GPU_WIDTH", 16)
    for count in (0, 1, 5, 21):
        found = jn.inverse_dynamics(robot, q[:count], drives=False)
        assert found.shape == (count, 3, 7)
        np.testing.assert_allclose(found, expected[:count], rtol=0, atol=1e-14 * np.abs(expected).max())
