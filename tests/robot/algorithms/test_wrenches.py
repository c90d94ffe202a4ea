"""External wrenches: J^T F with rates, functions of time, axes of base and link, equilibrium, refusals."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce.robot.algorithms.wrenches import check_wrenches
from tests.problems.robots import random_robot, robot_named

pytestmark = pytest.mark.long

ROBOT = random_robot(2, 7)
LINK, POINT = ROBOT.moving_links[4], (0.1, -0.2, 0.3)
ORDER = 3
LEVELS = ORDER - 1
GENERATOR = np.random.default_rng(6)
Q = GENERATOR.uniform(-1, 1, (3, ORDER + 1, 7))
FORCE, TORQUE = GENERATOR.uniform(-5, 5, (2, 3, LEVELS, 3))


def near(found, expected, tolerance=1e-13):
    found, expected = np.asarray(found), np.asarray(expected)
    assert found.shape == expected.shape
    assert np.abs(found - expected).max() <= tolerance * max(1.0, np.abs(expected).max())


def product(first, second, subscripts):
    """Return the derivatives of a product, order on axis 1 of both."""
    levels = [
        sum(math.comb(n, i) * np.einsum(subscripts, first[:, i], second[:, n - i]) for i in range(n + 1))
        for n in range(LEVELS)
    ]
    return np.stack(levels, axis=1)


@pytest.fixture(scope="module")
def torque():
    return jn.inverse_dynamics(ROBOT, Q)


def expected_change(force, turning, link=LINK, point=POINT):
    """Return minus J^T F with its rates, of a wrench with the axes of the base."""
    jacobian = jn.jacobian(ROBOT, Q, link, point)[:, :LEVELS]
    return -product(jacobian, np.concatenate([force, turning], axis=-1), "sij,si->sj")


@pytest.mark.slow
def test_a_wrench_takes_its_work_off_the_torques(torque):
    wrench = jn.robot.Wrench(LINK, FORCE, TORQUE, POINT)
    near(jn.inverse_dynamics(ROBOT, Q, wrenches=[wrench]) - torque, expected_change(FORCE, TORQUE))


def test_a_wrench_in_the_axes_of_a_link_turns_with_it(torque):
    rotation = jn.forward_kinematics(ROBOT, Q, LINK).rotation
    parts = [product(rotation, part, "sij,sj->si") for part in (FORCE, TORQUE)]
    wrench = jn.robot.Wrench(LINK, FORCE, TORQUE, POINT, frame="link")
    near(jn.inverse_dynamics(ROBOT, Q, wrenches=[wrench]) - torque, expected_change(*parts))


def test_a_wrench_on_a_link_that_is_fixed_to_a_moving_one(torque):
    part = next(joint.child for joint in ROBOT.joints.values() if not joint.moving)
    wrench = jn.robot.Wrench(part, FORCE, TORQUE, POINT)
    near(jn.inverse_dynamics(ROBOT, Q, wrenches=[wrench]) - torque, expected_change(FORCE, TORQUE, part))


def test_wrenches_add_up(torque):
    one, two = (
        jn.robot.Wrench(LINK, FORCE, point=POINT),
        jn.robot.Wrench(ROBOT.moving_links[1], torque=TORQUE, frame="link"),
    )
    changes = [jn.inverse_dynamics(ROBOT, Q, wrenches=[w]) - torque for w in (one, two)]
    near(jn.inverse_dynamics(ROBOT, Q, wrenches=[one, two]) - torque, sum(changes))


def test_constants_have_no_rates(torque):
    force = np.array([1.0, -2.0, 3.0])
    series = np.zeros((3, LEVELS, 3))
    series[:, 0] = force
    found = jn.inverse_dynamics(ROBOT, Q, wrenches=[jn.robot.Wrench(LINK, [1, -2, 3], point=POINT)])
    near(found, jn.inverse_dynamics(ROBOT, Q, wrenches=[jn.robot.Wrench(LINK, series, point=POINT)]), 1e-15)


def test_functions_of_time_have_rates_of_their_own():
    times = np.array([0.0, 0.4, 1.1])
    series = np.zeros((3, LEVELS, 3))
    for k in range(LEVELS):
        series[:, k, 0] = 3 * 2.0**k * np.sin(2 * times + k * np.pi / 2)
        series[:, k, 1] = [4.0, 0.0][k]
        series[:, k, 2] = [times**3, 3 * times**2][k]
    wrench = jn.robot.Wrench(LINK, lambda t: (3 * jnp.sin(2 * t), 4.0, t**3), point=POINT)
    found = jn.inverse_dynamics(ROBOT, Q, wrenches=[wrench], time=times)
    near(found, jn.inverse_dynamics(ROBOT, Q, wrenches=[jn.robot.Wrench(LINK, series, point=POINT)]))
    traced = jax.jit(lambda t: jn.inverse_dynamics(ROBOT, Q, wrenches=[wrench], time=t))(times)
    near(traced, found)


def test_slopes_in_the_force_are_columns_of_the_jacobian():
    @jax.jit
    @jax.jacfwd
    def slope(force):
        return jn.inverse_dynamics(ROBOT, Q[0, :3], wrenches=[jn.robot.Wrench(LINK, force, point=POINT)])[0]

    near(slope(jnp.zeros(3)), -jn.jacobian(ROBOT, Q[0, :1], LINK, POINT)[0, :3].T)


def test_a_robot_that_hangs_on_its_wrench_needs_no_forces():
    """A floating robot at rest, held at its center of mass."""
    robot = robot_named("planar_arm").with_floating_base()
    q = np.zeros((3, len(robot.joint_names)))
    center = jn.robot.center_of_mass(robot, q[:1])[0]
    link = robot.moving_links[5]
    pose = jn.forward_kinematics(robot, q[:1], link)
    local = pose.rotation[0].T @ (center - pose.position[0])
    found = jn.inverse_dynamics(robot, q, wrenches=[jn.robot.Wrench(link, -robot.mass * robot.gravity, point=local)])
    near(found[0, :6], np.zeros(6), 1e-13)


@pytest.mark.slow
def test_joints_carry_what_pushes_beyond_them():
    at_rest = np.zeros((3, ORDER + 1, 7))
    at_rest[:, 0] = Q[:, 0]
    wrench = jn.robot.Wrench(LINK, FORCE, TORQUE, POINT)
    free, pushed = (jn.robot.joint_wrenches(ROBOT, at_rest, wrenches=w, frame="base") for w in ([], [wrench]))
    body = ROBOT.moving_links.index(LINK)
    place = jn.forward_kinematics(ROBOT, at_rest, LINK, POINT).position[:, 0]
    for k, link in enumerate(ROBOT.moving_links):
        arm = (place - jn.forward_kinematics(ROBOT, at_rest, link).position[:, 0])[:, None]
        expected = -np.concatenate([FORCE, TORQUE + np.cross(arm, FORCE)], axis=-1) * ROBOT.tree.ancestors[body, k]
        near(pushed[:, :, k] - free[:, :, k], expected)


def dynamics(*wrenches, time=None):
    return jn.inverse_dynamics(ROBOT, Q, wrenches=wrenches, time=time)


FINGER = jn.Robot("one", [jn.Link("base"), jn.Link("rod", jn.Inertia(1.0))], [jn.Joint("pin", "base", "rod")])


@pytest.mark.parametrize(
    "call, message",
    [
        (
            lambda: jn.robot.Wrench("rod", frame="world"),
            "wrench.frame: unknown frame, got 'world'; valid: base, link",
        ),
        (lambda: jn.robot.Wrench("rod", point=[0, 0]), "wrench.point: must have the shape (3,), not (2,)"),
        (
            lambda: check_wrenches(FINGER, jn.robot.Wrench("rod"), free=False),  # tests check the callers' types
            "wrenches: must be a list of jn.robot.Wrench, got 'Wrench'",
        ),
        (
            lambda: check_wrenches(FINGER, ["rod"], free=False),
            "wrenches[0]: must be a jn.robot.Wrench, got 'str'",
        ),
        (
            lambda: jn.inverse_dynamics(FINGER, np.zeros((3, 1)), wrenches=[jn.robot.Wrench("rood")]),
            "wrenches[0].link: no link has this name, got 'rood'; did you mean 'rod'? valid: base, rod",
        ),
        (
            lambda: jn.inverse_dynamics(FINGER, np.zeros((3, 1)), wrenches=[jn.robot.Wrench("base")]),
            "wrenches[0].link: this link is fixed to the base: nothing moves it, got 'base'",
        ),
        (
            lambda: dynamics(jn.robot.Wrench(LINK), jn.robot.Wrench(LINK, force=FORCE[:2])),
            "wrenches[1].force: must have the shape (3,) or (3, 2, 3), not (2, 2, 3)",
        ),
        (
            lambda: dynamics(jn.robot.Wrench(LINK, torque=[[1.0], [1.0, 2.0]])),
            "wrenches[0].torque: must be an array of real numbers, got 'list'",
        ),
        (
            lambda: dynamics(jn.robot.Wrench(LINK, force=lambda t: (t, t, t))),
            "wrenches[0].force: is a function of time: give the instants of the samples as `time`",
        ),
        (
            lambda: dynamics(jn.robot.Wrench(LINK, force=lambda t: (t, t, t)), time=[0.0, 1.0]),
            "time: must have one instant for each sample, the shape (3,), not (2,)",
        ),
        (
            lambda: dynamics(jn.robot.Wrench(LINK, force=lambda t: (t, t)), time=[0.0, 1.0, 2.0]),
            "wrenches[0].force: the function must return three components, not the shape (2,)",
        ),
        (
            lambda: dynamics(jn.robot.Wrench(LINK, force=lambda _: "x"), time=[0.0, 1.0, 2.0]),
            "wrenches[0].force: the function cannot be used: could not convert string to float: 'x'; it must map a "
            "scalar time to three components with functions of jax.numpy",
        ),
    ],
)
def test_refused(call, message):
    with pytest.raises(jn.errors.RobotError) as caught:
        call()
    assert str(caught.value) == message
