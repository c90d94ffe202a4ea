"""Small motions of robots about a state, beside Pinocchio's derivatives of forward dynamics."""

import numpy as np
import pinocchio
import pytest

import jounce as jn
from tests.problems.closed_robots import forward, in_contact, in_pinocchio


@pytest.mark.slow
def test_a_tree_has_the_derivatives_of_articulated_bodies():
    robot = jn.load_robot("examples/robots/scara.urdf")
    n = len(robot.joint_names)
    q = np.random.default_rng(7).uniform(-0.8, 0.8, (3, n))
    model, _ = in_pinocchio(robot)
    data = model.createData()
    torque = pinocchio.rnea(model, data, *q)
    pinocchio.computeABADerivatives(model, data, q[0], q[1], torque)
    small = jn.linearize(robot, q=q, drives=False)
    assert small.coordinates == robot.joint_names
    # as torques: what small masses make of rounding are large accelerations
    for found, known in ((small.A[n:, :n], data.ddq_dq), (small.A[n:, n:], data.ddq_dv)):
        np.testing.assert_allclose(small.mass @ (found - known), 0.0, atol=1e-13 * np.abs(torque).max())
    known = np.triu(data.Minv) + np.triu(data.Minv, 1).T
    np.testing.assert_allclose(np.linalg.inv(small.mass), known, rtol=0, atol=1e-11 * np.abs(known).max())


@pytest.mark.slow
def test_a_loop_has_the_differences_of_constrained_dynamics():
    robot = jn.load_robot("examples/robots/five_bar.xml")
    motors, near = ["left_motor", "right_motor"], np.zeros(4)
    model, frames = in_pinocchio(robot.opened())
    constraint = in_contact(model, frames, next(iter(robot.closures.values())))
    names = list(model.names)[1:]

    def moved(place, rate):
        """The mechanism through a state of its motors, at constant rates."""
        values = zip(motors, place, rate, strict=True)
        laws = {m: jn.laws.ExpressionMotion("p + v*t", {"p": float(p), "v": float(v)}) for m, p, v in values}
        return jn.solve(robot.mechanism(near, drivers=laws), [0.0], order=2)

    def acceleration(place, rate):
        motion = moved(place, rate)
        state = np.array([motion.outputs[name][0, :2] for name in names]).T
        return forward(model, constraint, state, torque)[0][[names.index(m) for m in motors]]

    place, rate, step = np.array([0.1, 0.2]), np.array([0.7, -0.4]), 1e-5
    held = moved(place, rate)
    torque = np.zeros(4)
    for motor in motors:
        torque[names.index(motor)] = float(jn.driver_force(held, f"{motor}_drive")[0, 0])
    np.testing.assert_allclose(acceleration(place, rate), 0.0, atol=1e-10)
    state = np.array([held.outputs[name][0, :2] for name in robot.joint_names]).T
    small = jn.linearize(robot, q=state, coordinates=motors)
    for k, change in enumerate(np.eye(2) * step):
        for column, (ahead, behind) in (
            (k, ((place + change, rate), (place - change, rate))),
            (2 + k, ((place, rate + change), (place, rate - change))),
        ):
            slope = (acceleration(*ahead) - acceleration(*behind)) / (2 * step)
            np.testing.assert_allclose(small.A[2:, column], slope, rtol=0, atol=1e-7 * np.abs(small.A).max())
