"""Equilibria and small motions of robots: against inverse dynamics, forces of drivers, and closed forms."""

import numpy as np
import pytest

import jounce as jn
from jounce.errors import MechanismError, RobotError
from tests.problems.closed_robots import FIVE_BAR

MASS, LENGTH, INERTIA = 1.2, 0.4, 0.03


def arm(**drive):
    """An elbow of two skew hinges."""
    rod = jn.Inertia(MASS, center_of_mass=[LENGTH, 0.05, 0.1], tensor=[0.01, INERTIA, INERTIA])
    joints = [
        jn.Joint("shoulder", "base", "upper", axis=[0, -1, 0], **drive),
        jn.Joint("elbow", "upper", "lower", axis=[0.6, 0, 0.8], position=[0.5, 0, 0.1], **drive),
    ]
    return jn.Robot("elbow", [jn.Link("base"), jn.Link("upper", rod), jn.Link("lower", rod)], joints)


def slopes(robot, state, step=1e-6, **settings):
    """Central differences of inverse dynamics by q, q' and q''."""
    found = np.zeros((3, 2, 2))
    for level in range(3):
        for k in range(2):
            moved = np.zeros_like(state)
            moved[level, k] = step
            ahead, behind = (jn.inverse_dynamics(robot, state + s * moved, **settings)[0] for s in (1, -1))
            found[level, :, k] = (np.asarray(ahead) - np.asarray(behind)) / (2 * step)
    return found


def test_names_and_shapes_that_do_not_fit_a_robot_are_refused():
    robot = arm()
    for call, kind, place in (
        (lambda: jn.equilibrium(robot, hold=["wrist"]), RobotError, "hold"),
        (lambda: jn.equilibrium(robot, torques={"wrist": 1.0}), RobotError, "torques"),
        (lambda: jn.equilibrium(robot, hold="all", torques={"elbow": 1.0}), RobotError, "torques.elbow"),
        (lambda: jn.equilibrium(robot, q=[0.0]), RobotError, "q"),
        (lambda: jn.linearize(robot, q=[0.0, 0.0, 0.0]), RobotError, "q"),
        (lambda: jn.linearize(robot, q=[0.0, np.nan]), RobotError, "q"),
        (lambda: jn.linearize(robot, coordinates=["wrist"]), RobotError, "coordinates"),
        (lambda: jn.linearize(jn.load("examples/double_pendulum.yaml"), q=[0.0]), MechanismError, "q"),
        (lambda: jn.equilibrium(jn.load("examples/double_pendulum.yaml"), hold="all"), MechanismError, "hold"),
    ):
        with pytest.raises(kind) as caught:
            call()
        assert caught.value.name == place


@pytest.mark.slow
def test_matrices_of_an_arm_that_moves_are_the_derivatives_of_its_inverse_dynamics():
    robot = arm(damping=0.3, armature=0.02)
    state = np.array([[0.4, -1.1], [1.3, -0.7], [2.0, 0.9]])
    for drives in (False, True):
        small = jn.linearize(robot, q=state, drives=drives)
        expected = slopes(robot, state, drives=drives)
        for matrix, slope in zip((small.stiffness, small.damping, small.mass), expected, strict=True):
            assert np.allclose(matrix, slope, atol=1e-8)
        assert small.coordinates == small.inputs == ("shoulder", "elbow")
        assert np.array_equal(small.input_matrix, np.eye(2))


@pytest.mark.slow
def test_an_arm_hangs_where_gravity_needs_no_torque_and_swings_there():
    robot = arm()
    rest = jn.equilibrium(robot, q=[-1.2, 0.3])
    q = np.array([rest.outputs[name] for name in robot.joint_names])
    still = np.stack([q, 0 * q, 0 * q])
    assert np.abs(jn.inverse_dynamics(robot, still)).max() < 1e-12
    assert rest.stability == "stable"
    small = jn.linearize(rest)
    assert small.coordinates == ("shoulder", "elbow")
    expected = slopes(robot, still)
    squares = np.linalg.eigvals(np.linalg.solve(expected[2], expected[0]))
    assert np.allclose(small.modes.angular_frequencies**2, np.sort(squares.real), rtol=1e-7)


@pytest.mark.slow
def test_held_joints_have_the_torques_of_inverse_dynamics_and_given_torques_move_the_rest():
    robot, q = arm(), np.array([0.3, -0.8])
    held = jn.equilibrium(robot, q=q, hold="all")
    expected = np.asarray(jn.inverse_dynamics(robot, np.stack([q, 0 * q, 0 * q])))[0]
    found = [float(jn.driver_force(held.motion, f"{name}_drive")[0, 0]) for name in robot.joint_names]
    assert np.allclose(found, expected, atol=1e-12)
    pushed = jn.equilibrium(robot, q=q, hold="shoulder", torques={"elbow": 0.4})
    rest = np.array([pushed.outputs[name] for name in robot.joint_names])
    torque = np.asarray(jn.inverse_dynamics(robot, np.stack([rest, 0 * rest, 0 * rest])))[0, 1]
    assert rest[0] == pytest.approx(0.3, abs=1e-12)
    assert torque == pytest.approx(0.4, abs=1e-12)


@pytest.mark.slow
def test_a_robot_with_loops_has_the_stiffness_of_the_torques_that_hold_it():
    robot = jn.load_robot(FIVE_BAR)
    small = jn.linearize(robot)
    names = small.coordinates
    assert len(names) == 2

    def torques(moved):
        held = jn.equilibrium(robot, q=moved, hold=names)
        return np.array([float(jn.driver_force(held.motion, f"{name}_drive")[0, 0]) for name in names])

    step = 1e-5
    for k in range(2):
        places = [{name: s * step * (name == names[k]) for name in names} for s in (1, -1)]
        slope = (torques(places[0]) - torques(places[1])) / (2 * step)
        assert np.allclose(slope, small.stiffness[:, k], atol=1e-7)
    other = jn.linearize(robot, coordinates=["left_motor", "right_motor"])
    values = [np.sort(np.linalg.eigvals(np.linalg.solve(x.mass, x.stiffness)).real) for x in (small, other)]
    assert values[0].shape == values[1].shape == (2,)


def test_what_no_joint_of_a_robot_balances_is_named_with_what_to_do():
    links = [jn.Link("base"), jn.Link("wheel", jn.Inertia(1.0, tensor=[0.1, 0.1, 0.1]))]
    robot = jn.Robot("hub", links, [jn.Joint("hub", "base", "wheel", axis=[0, 1, 0])])
    with pytest.raises(jn.errors.SolveError, match=r"\(0, 0\.7, 0\) N m on wheel is balanced by nothing; .* \(hold\)"):
        jn.equilibrium(robot, torques={"hub": 0.7})
