"""Mechanisms and motions stay as they were made: what they were given may change, and they may not."""

import copy
import dataclasses
import pickle

import jax
import numpy as np
import pytest

import jounce as jn


def pendulum(point, arm, parameters, time):
    return jn.Mechanism(
        space="planar",
        parameters=parameters,
        bodies={"rod": jn.Body(position=point)},
        joints={"O": jn.planar.Revolute(("ground", "rod"), point_i=point, point_j=[0, 0])},
        drivers={"theta": jn.drivers.CoordinateDriver(("ground", "rod"), "angle", motion="speed*t")},
        outputs={"tip": jn.outputs.PointOutput("rod", point=arm)},
        time=time,
    )


def test_the_parameters_that_a_mechanism_was_given_may_change_afterwards():
    parameters, times = {"speed": 2.0}, [0.0, 0.25]
    late, early = (pendulum([0.1, 0.2], [0.3, 0.0], parameters, times) for _ in range(2))
    jn.solve(early, order=0)
    parameters["speed"] = 9.0
    for mechanism in (early, late):
        found = jn.solve(mechanism, order=0).dataset["tip"].sel(component="x", derivative=0)
        np.testing.assert_allclose(found, [0.4, 0.1 + 0.3 * np.cos(0.5)], atol=1e-14)


def test_instants_that_were_given_may_change_afterwards():
    times = np.linspace(0.0, 1.0, 5)
    motion = jn.solve(pendulum([0.0, 0.0], [1.0, 0.0], {"speed": 1.0}, None), times, order=0)
    times += 3.0
    np.testing.assert_allclose(motion.dataset["tip"].sel(component="x", derivative=0), np.cos(times - 3.0), atol=1e-14)
    np.testing.assert_array_equal(motion.dataset["time"], times - 3.0)


def test_a_law_may_be_an_array_without_axes_as_an_entry_of_a_dataset_is():
    mechanism = pendulum([0.0, 0.0], [1.0, 0.0], {"speed": 2.0}, [0.0])
    angle = jn.solve(mechanism, [0.0, 0.3], order=1).dataset["tip"].values[1, 0, 0].reshape(())
    driver = jn.drivers.CoordinateDriver(("ground", "rod"), "angle", motion=angle)
    held = dataclasses.replace(mechanism, drivers={"theta": driver})
    assert jn.solve(held, order=0).outputs["tip"][0, 0, 0] == pytest.approx(np.cos(np.cos(0.6)), abs=1e-15)


def test_a_mechanism_does_not_change_and_says_what_to_do():
    mechanism = pendulum([0.0, 0.0], [1.0, 0.0], {"speed": 1.0}, None)
    with pytest.raises(TypeError, match="do not change: with_parameters gives another mechanism"):
        mechanism.parameters["speed"] = 2.0
    with pytest.raises(TypeError, match=r"do not change: dataclasses\.replace gives another mechanism"):
        mechanism.joints.clear()
    for same in (copy.deepcopy(mechanism), pickle.loads(pickle.dumps(mechanism))):
        assert same == mechanism
        assert same.parameters == {"speed": 1.0}
        with pytest.raises(TypeError, match="with_parameters"):
            same.parameters.update(speed=2.0)


def test_jax_sees_the_parameters_of_a_mechanism_as_those_of_a_dictionary():
    mechanism = pendulum([0.0, 0.0], [1.0, 0.0], {"speed": 2.0, "other": 5.0}, [0.0, 0.25])

    def height(parameters):
        return jn.solve(mechanism.with_parameters(**parameters), order=0).outputs["tip"][-1, 0, 1]

    with jax.enable_x64(True):
        slope = jax.grad(height)(mechanism.parameters)
        moved = jax.tree.map(lambda value, rate: value + rate, mechanism.parameters, slope)
    assert slope == pytest.approx({"speed": 0.25 * np.cos(0.5), "other": 0.0}, abs=1e-14)
    assert moved == pytest.approx({"speed": 2.0 + 0.25 * np.cos(0.5), "other": 5.0}, abs=1e-14)
