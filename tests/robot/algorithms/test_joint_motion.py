"""Joint motion from operational motion: round trips, least norm, damping, singular configurations and refusals."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from tests.problems.robots import random_robot, robot_named

UR5 = robot_named("ur5")
TOOL = UR5.moving_links[-1], (0.0, 0.1, 0.2)
ROD = jn.Inertia(1.0, [0.5, 0, 0])


def planar(count):
    """Return an arm of rods of length 1 in the x-y plane."""
    links = [jn.Link("base"), *(jn.Link(f"rod_{k}", ROD) for k in range(count))]
    joints = [
        jn.Joint(f"pin_{k}", links[k].name, links[k + 1].name, position=[float(k > 0), 0, 0]) for k in range(count)
    ]
    return jn.Robot("planar", links, joints)


ARM = planar(2)
TIP = "rod_1", (1.0, 0.0, 0.0)
STRETCHED = [0.3, 0.0]


@pytest.fixture(scope="module")
def motion():
    """Return derivatives to order 4 of the coordinates of the UR5, and the motion of its tool."""
    q = np.random.default_rng(8).uniform(-1, 1, (2, 5, 6))
    return q, jn.robot.operational_accelerations(UR5, q, *TOOL)


@pytest.mark.slow
def test_round_trip_to_order_four(motion):
    q, operational = motion
    found = jn.robot.joint_motion(UR5, q[:, 0], operational, *TOOL)
    smallest = found.singular_values[:, -1].min()
    assert smallest > 0.01  # the random states are far from singular
    np.testing.assert_allclose(found.q, q, rtol=0, atol=1e-13 / smallest * np.abs(operational).max())
    np.testing.assert_allclose(found.residual, np.zeros((2, 4, 6)), rtol=0, atol=1e-13 * np.abs(operational).max())
    assert found.singular.tolist() == [False, False]


@pytest.mark.slow
def test_singular_values_are_those_of_the_jacobian(motion):
    q, operational = motion
    found = jn.robot.joint_motion(UR5, q[:, 0], operational, *TOOL)
    expected = np.linalg.svd(jn.jacobian(UR5, q[:, :1], *TOOL)[:, 0], compute_uv=False)
    np.testing.assert_allclose(found.singular_values, expected, rtol=0, atol=1e-14)


@pytest.mark.slow
def test_one_sample_and_transformed_by_jax(motion):
    q, operational = motion
    expected = jn.robot.joint_motion(UR5, q[:, 0], operational, *TOOL)
    one = jn.robot.joint_motion(UR5, q[0, 0], operational[0], *TOOL)
    np.testing.assert_allclose(one.q, expected.q[0], rtol=0, atol=1e-11)
    mapped = jax.jit(jax.vmap(lambda p, x: jn.robot.joint_motion(UR5, p, x, *TOOL)))(q[:, 0], operational)
    assert isinstance(mapped, jn.robot.JointMotion)
    np.testing.assert_allclose(mapped.q, expected.q, rtol=0, atol=1e-11)
    np.testing.assert_allclose(mapped.singular_values, expected.singular_values, rtol=0, atol=1e-14)


@pytest.mark.slow
def test_a_redundant_arm_moves_with_the_least_norm():
    robot = random_robot(9, 8, tree=False)
    place = robot.moving_links[-1], (0.1, 0.0, 0.2)
    q = np.random.default_rng(9).uniform(-1, 1, (2, 5, 8))
    operational = jn.robot.operational_accelerations(robot, q, *place)
    found = jn.robot.joint_motion(robot, q[:, 0], operational, *place)
    scale = np.abs(operational).max() / found.singular_values.min()
    np.testing.assert_allclose(found.residual, np.zeros((2, 4, 6)), rtol=0, atol=1e-13 * scale)
    again = jn.robot.operational_accelerations(robot, found.q, *place)
    np.testing.assert_allclose(again, operational, rtol=0, atol=1e-13 * scale)
    jacobian = jn.jacobian(robot, found.q, *place)
    inverse = np.linalg.pinv(jacobian[:, 0])
    speed = np.einsum("sij,sj->si", inverse, operational[:, 0])
    np.testing.assert_allclose(found.q[:, 1], speed, rtol=0, atol=1e-13 * scale)
    lacking = operational[:, 1] - np.einsum("sij,sj->si", jacobian[:, 1], speed)
    np.testing.assert_allclose(found.q[:, 2], np.einsum("sij,sj->si", inverse, lacking), rtol=0, atol=1e-12 * scale)


@pytest.mark.slow
def test_position_and_orientation_tasks():
    q = np.random.default_rng(2).uniform(0.5, 1, (2, 4, 2))
    operational = jn.robot.operational_accelerations(ARM, q, *TIP)
    for given in (operational, operational[..., :3]):
        found = jn.robot.joint_motion(ARM, q[:, 0], given, *TIP, task="position")
        np.testing.assert_allclose(found.q, q, rtol=0, atol=1e-12)
        assert found.residual.shape == (2, 3, 3)
        assert found.singular_values.shape == (2, 2)
    turning = jn.Robot("turning", [jn.Link("base"), jn.Link("rod", ROD)], [jn.Joint("pin", "base", "rod")])
    found = jn.robot.joint_motion(turning, [0.3], [[0, 0, 2.0], [0, 0, 3.0]], "rod", task="orientation")
    assert found.q.tolist() == [[0.3], [2.0], [3.0]]


@pytest.mark.slow
def test_rows_of_a_task_can_be_chosen():
    """A planar arm of three joints is redundant in the plane, and singular for a task in space."""
    arm, tip = planar(3), ("rod_2", (1.0, 0.0, 0.0))
    q = np.random.default_rng(2).uniform(0.5, 1, (1, 3, 3))
    operational = jn.robot.operational_accelerations(arm, q, *tip)
    found = jn.robot.joint_motion(arm, q[:, 0], operational, *tip, task=(0, 1))
    np.testing.assert_allclose(
        jn.robot.operational_accelerations(arm, found.q, *tip)[..., :2], operational[..., :2], atol=1e-12
    )
    assert not found.singular.any()
    with pytest.raises(jn.errors.SingularityError):
        jn.robot.joint_motion(arm, q[:, 0], operational, *tip, task="position")


@pytest.mark.slow
def test_a_singular_configuration_is_named():
    positions = [[0.3, 1.0], [0.3, -1.0], [0.3, 1e-3], [1.0, 1e-9]]
    steps = np.ones((4, 2, 3))
    with pytest.raises(jn.errors.SingularityError) as caught:
        jn.robot.joint_motion(ARM, positions, steps, *TIP, task="position")
    assert str(caught.value) == (
        "rod_1: the configuration is singular for this task at sample 2: the singular values of the Jacobian reach "
        "from 2.2 down to 0.00045; give a damping, or take another task or path"
    )
    with pytest.raises(jn.errors.SingularityError, match=r"at sample \(1, 0\): "):
        jn.robot.joint_motion(ARM, np.reshape(positions, (2, 2, 2)), steps.reshape(2, 2, 2, 3), *TIP, task="position")
    with pytest.raises(jn.errors.SingularityError, match="for this task: the singular"):
        jn.robot.joint_motion(ARM, STRETCHED, steps[0], *TIP, task="position")


def test_singular_samples_can_be_left_out():
    positions = [[0.3, 1.0], STRETCHED]
    found = jn.robot.joint_motion(ARM, positions, np.ones((2, 2, 3)), *TIP, task="position", strict=False)
    assert found.singular.tolist() == [False, True]
    assert np.isfinite(found.q[0]).all()
    assert np.isnan(found.q[1, 1:]).all()
    assert found.q[1, 0].tolist() == STRETCHED


def test_a_point_that_no_joint_moves_is_singular():
    robot = jn.Robot("one", [jn.Link("base"), jn.Link("rod", ROD)], [jn.Joint("pin", "base", "rod")])
    with pytest.raises(jn.errors.SingularityError, match="from 0 down to 0"):
        jn.robot.joint_motion(robot, [0.3], [[1.0, 0, 0]], "rod", task="position")
    found = jn.robot.joint_motion(robot, [0.3], [[1.0, 0, 0]], "rod", task="position", damping=0.1)
    assert found.q.tolist() == [[0.3], [0.0]]
    assert found.residual.tolist() == [[1.0, 0.0, 0.0]]
    assert found.singular.tolist() is True


def test_damping_holds_back_what_is_lost_and_nothing_else():
    direction, across = np.array([np.cos(0.3), np.sin(0.3)]), np.array([-np.sin(0.3), np.cos(0.3)])
    requested = np.zeros((1, 3))
    requested[0, :2] = 2 * direction + 5 * across
    found = jn.robot.joint_motion(ARM, STRETCHED, requested, *TIP, task="position", damping=0.05)
    np.testing.assert_allclose(found.residual[0, :2], 2 * direction, rtol=0, atol=1e-14)
    np.testing.assert_allclose(found.q[1], [2.0, 1.0], rtol=0, atol=1e-12)  # least norm of 2 q1 + q2 = 5
    bent = jn.robot.joint_motion(ARM, [0.3, 1.0], requested, *TIP, task="position", damping=0.05)
    exact = jn.robot.joint_motion(ARM, [0.3, 1.0], requested, *TIP, task="position")
    assert np.array_equal(bent.q, exact.q)  # far from singular the damping has faded out


def test_damping_fades_in_by_the_textbook():
    """Below the threshold s becomes s / (s^2 + d^2 (1 - (s / limit)^2)), one singular value at a time."""
    position, damping, threshold = np.array([0.3, 0.02]), 0.4, 0.1
    jacobian = jn.jacobian(ARM, [position], *TIP)[0, :2]
    u, s, v = np.linalg.svd(jacobian)
    limit = threshold * s[0]
    assert s[1] < limit
    held = s[1] / (s[1] ** 2 + damping**2 * (1 - (s[1] / limit) ** 2))
    expected = v.T @ np.diag([1 / s[0], held]) @ u.T @ [1.0, 1.0]
    given = {"task": "position", "damping": damping, "threshold": threshold}
    found = jn.robot.joint_motion(ARM, position, [[1.0, 1.0, 0.0]], *TIP, **given)
    np.testing.assert_allclose(found.q[1], expected, rtol=1e-13)


def test_nan_stays_in_its_sample():
    requested = np.ones((2, 2, 3))
    requested[1] = np.nan
    found = jn.robot.joint_motion(ARM, [[0.3, 1.0]] * 2, requested, *TIP, task="position")
    assert np.isfinite(found.q[0]).all()
    assert np.isnan(found.q[1, 1:]).all()


def test_arrays_of_jax_of_single_precision():
    requested = jnp.ones((2, 3), jnp.float32)
    found = jn.robot.joint_motion(ARM, jnp.asarray([0.5, 1.0], jnp.float32), requested, *TIP, task="position")
    assert found.q.dtype == np.float64


WANTED = np.ones((1, 3))


@pytest.mark.parametrize(
    "call, message",
    [
        (
            lambda: jn.robot.joint_motion(ARM, STRETCHED, WANTED, *TIP, task="point"),
            "task: unknown task, got 'point'; did you mean 'position'? valid: orientation, pose, position",
        ),
        (
            lambda: jn.robot.joint_motion(ARM, STRETCHED, WANTED, *TIP, task=(0, 6)),
            "task: must be a name or different rows from 0 to 5, got [0, 6]",
        ),
        (
            lambda: jn.robot.joint_motion(ARM, STRETCHED, WANTED, *TIP, damping=-1.0),
            "damping: must be 0 or greater, got -1.0",
        ),
        (
            lambda: jn.robot.joint_motion(ARM, STRETCHED, WANTED, *TIP, damping=np.nan),
            "damping: must be finite, got nan",
        ),
        (
            lambda: jn.robot.joint_motion(ARM, STRETCHED, WANTED, *TIP, threshold=0.0),
            "threshold: must be 1e-15 or greater, got 0.0",
        ),
        (
            lambda: jn.robot.joint_motion(ARM, 0.0, WANTED, *TIP),
            "position: must have the shape (..., n) with n = 2, not ()",
        ),
        (
            lambda: jn.robot.joint_motion(ARM, [0.0, 0.0, 0.0], WANTED, *TIP),
            "position: must have the shape (..., n) with n = 2, not (3,)",
        ),
        (
            lambda: jn.robot.joint_motion(ARM, ["a", "b"], WANTED, *TIP),
            "position: must be an array of real numbers, got 'list'",
        ),
        (
            lambda: jn.robot.joint_motion(ARM, STRETCHED, WANTED[0], *TIP, task="position"),
            "operational: must have the shape (order, 3), order 1 or more, not (3,)",
        ),
        (
            lambda: jn.robot.joint_motion(ARM, [STRETCHED], WANTED, *TIP, task="position"),
            "operational: must have the shape (1, order, 3), order 1 or more, not (1, 3)",
        ),
        (
            lambda: jn.robot.joint_motion(ARM, STRETCHED, np.ones((1, 4)), *TIP, task="position"),
            "operational: must have the shape (order, 3), order 1 or more, not (1, 4)",
        ),
        (
            lambda: jn.robot.joint_motion(ARM, STRETCHED, WANTED, "tip", task="position"),
            "link: no link has this name, got 'tip'; valid: base, rod_0, rod_1",
        ),
    ],
)
def test_refused(call, message):
    with pytest.raises(jn.errors.RobotError) as caught:
        call()
    assert str(caught.value) == message
