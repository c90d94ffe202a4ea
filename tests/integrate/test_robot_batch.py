"""Batches of robots in joint coordinates: each run is what it is alone, energy is kept, faults are named."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce.errors import JounceError, RobotError
from jounce.kinematics import Status

TIME = np.linspace(0.0, 0.5, 4)


def arm():
    body = jn.Inertia(2.0, [0.3, 0.1, 0], [0.02, 0.03, 0.04])
    links = [jn.Link("base"), jn.Link("a", body), jn.Link("b", body)]
    spring = {"stiffness": 3.0, "spring_reference": 0.2}
    joints = [
        jn.Joint("j", "base", "a", axis=[0, 1, 0], **spring),
        jn.Joint("k", "a", "b", position=[0.5, 0, 0], axis=[0, 1, 1]),
    ]
    return jn.Robot("arm", links, joints)


@pytest.mark.slow
def test_each_run_is_what_it_is_alone():
    one = arm()
    given = {"k": [0.1, 0.5, -0.4], "j.rate": [0.0, 1.0, 2.0], "b.mass": [2.0, 1.0, 3.0]}
    batch = jn.simulate_batch(one, given, TIME, order=3, state={"j": 0.3}, torque={"k": "0.2*sin(t)"})
    assert batch.outputs["j"].shape == (3, 4, 4)
    for run in range(3):
        loaded = one.with_inertia("b", mass=given["b.mass"][run])
        state = [[0.3, given["k"][run]], [given["j.rate"][run], 0.0]]
        single = jn.simulate(loaded, TIME, 3, state=state, torque={"k": "0.2*sin(t)"})
        np.testing.assert_array_equal(np.stack(list(batch.outputs.values()), axis=-1)[run], single.q)
        np.testing.assert_array_equal(batch.status[run], single.status)
        assert batch.steps[run] == len(single.steps.start)


def test_masses_and_springs_swing_in_closed_form():
    """A mass on a spring, without gravity: q = cos(t sqrt(k / m)), in each run its own."""
    rail = jn.Joint("x", "base", "a", "prismatic", axis=[1, 0, 0], stiffness=4.0)
    one = jn.Robot("cart", [jn.Link("base"), jn.Link("a", jn.Inertia(1.0))], [rail])
    masses = np.array([1.0, 2.0, 5.0])
    batch = jn.simulate_batch(one, {"a.mass": masses, "x": np.ones(3)}, TIME, order=2)
    phase = np.sqrt(4.0 / masses)[:, None] * TIME
    np.testing.assert_allclose(batch.outputs["x"][..., 0], np.cos(phase), rtol=0, atol=1e-13)
    np.testing.assert_allclose(batch.outputs["x"][..., 2], -4.0 / masses[:, None] * np.cos(phase), rtol=0, atol=1e-12)
    data = batch.dataset
    assert data["x"].dims == ("run", "time", "derivative")
    assert data["x"].attrs["units"] == "m"
    np.testing.assert_array_equal(data["a.mass"], masses)


@pytest.mark.slow
def test_a_run_that_fails_leaves_the_others():
    rail = jn.Joint("x", "base", "a", "prismatic", axis=[1, 0, 0])
    one = jn.Robot("cart", [jn.Link("base"), jn.Link("a", jn.Inertia(1.0))], [rail])

    def undefined_beyond(time, q, rate):
        return jnp.where(q > 1.0, jnp.nan, 2.0)

    batch = jn.simulate_batch(one, {"x": [0.0, 2.0]}, TIME, order=2, torque=undefined_beyond)
    assert (batch.status[0] == Status.OK).all()
    np.testing.assert_allclose(batch.outputs["x"][0, :, 0], TIME**2, rtol=0, atol=1e-14)
    assert not (batch.status[1] == Status.OK).any()
    assert np.isnan(batch.outputs["x"][1, 1:]).all()


@pytest.mark.parametrize(
    "given, options, says",
    [
        ({}, {}, "a batch differs in at least one parameter"),
        ({"k.mass": [1.0]}, {}, "no joint, JOINT.rate or LINK.mass has this name, got 'k.mass'"),
        ({"base.mass": [1.0]}, {}, "got 'base.mass'"),
        ({"k": [0.1, np.nan]}, {}, "parameters.k: must be a list of finite numbers, one for each run"),
        ({"k": [0.1, 0.2], "j": [0.1]}, {}, "parameters.j: must have one value for each run, 2 as those before"),
        ({"b.mass": [1.0, -1.0]}, {}, "runs.1.mass: must be greater than zero"),
        ({"k": [0.1]}, {"base": object()}, "base: a batch has no free base by quaternions"),
        ({"k": [0.1]}, {"state": [[0.0]]}, "state"),
    ],
)
def test_what_cannot_be_is_refused(given, options, says):
    with pytest.raises((RobotError, JounceError), match=says):
        jn.simulate_batch(arm(), given, TIME, order=2, **options)


def test_a_state_that_is_traced_names_joints():
    def coordinate(angle):
        return jn.simulate_batch(arm(), {"k": [0.1]}, TIME, order=2, state={"elbow": angle}).outputs["k"][0, -1, 0]

    with pytest.raises(RobotError, match="no moving joint has this name, got 'elbow'"):
        jax.grad(coordinate)(0.3)
