"""Torques: closed forms, what they depend on, drives, robots that are the same, derivatives by JAX, reactions."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from mpmath import mp

import jounce as jn
from jounce.jet.derivatives import taylor_coefficients
from jounce.robot.recursions.newton_euler import recursive_newton_euler
from tests.problems.robots import random_inertia, random_robot, robot_named

ROBOT = random_robot(2, 7)  # a tree with slides and fixed links
MIMIC = robot_named("mimic")
ORDER = 4
Q = np.random.default_rng(1).uniform(-1, 1, (3, ORDER + 1, 7))
MIMIC_Q = np.random.default_rng(1).uniform(-1, 1, (3, ORDER + 1, 4))


def near(found, expected, tolerance=1e-13):
    found, expected = np.asarray(found), np.asarray(expected)
    assert found.shape == expected.shape
    assert np.abs(found - expected).max() <= tolerance * max(1.0, np.abs(expected).max())


@pytest.fixture(scope="module")
def torque():
    return jn.inverse_dynamics(ROBOT, Q)


def test_a_pendulum_to_order_eight():
    """Closed form: tau = I q'' + m g c cos q along q = a t^2, by the series of a complex exponential."""
    rod = jn.Inertia(1.3, [0.4, 0, 0], [0.0, 0.2, 0.2])
    pin = jn.Joint("pin", "base", "rod", axis=[0, -1, 0])
    a, q = 0.7, np.zeros((9, 1))
    q[0], q[2] = 0.5, 2 * a
    found = jn.inverse_dynamics(jn.Robot("pendulum", [jn.Link("base"), jn.Link("rod", rod)], [pin]), q)
    expected = np.zeros(7)
    expected[0] = (0.2 + 1.3 * 0.4**2) * 2 * a
    for k in range(4):
        term = np.exp(0.5j) * (1j * a) ** k / math.factorial(k) * math.factorial(2 * k)
        expected[2 * k] += 1.3 * 9.81 * 0.4 * term.real
    near(found[:, 0], expected, 1e-15)


def test_a_cart_with_a_pendulum():
    """The textbook: forces on the cart and torque at the pin of a point mass, at every sample."""
    cart, bob, length = 2.0, 0.5, 0.8
    links = [jn.Link("base"), jn.Link("cart", jn.Inertia(cart)), jn.Link("bob", jn.Inertia(bob, [0, 0, -length]))]
    joints = [
        jn.Joint("rail", "base", "cart", "prismatic", axis=[1, 0, 0]),
        jn.Joint("pin", "cart", "bob", axis=[0, -1, 0]),
    ]
    q = np.random.default_rng(3).uniform(-2, 2, (6, 3, 2))
    (x2, angle, rate, angle2) = q[:, 2, 0], q[:, 0, 1], q[:, 1, 1], q[:, 2, 1]
    force = (cart + bob) * x2 + bob * length * (np.cos(angle) * angle2 - np.sin(angle) * rate**2)
    moment = bob * length**2 * angle2 + bob * length * (np.cos(angle) * x2 + 9.81 * np.sin(angle))
    found = jn.inverse_dynamics(jn.Robot("cart", links, joints), q)
    near(found[:, 0], np.column_stack([force, moment]), 1e-14)


@pytest.mark.slow
def test_at_rest_the_torque_is_the_slope_of_the_potential():
    still = np.zeros((3, ORDER + 1, 7))
    still[:, 0] = Q[:, 0]
    found = jn.inverse_dynamics(ROBOT, still)[:, 0]
    slope = np.zeros((3, 7))
    for k in range(7):  # a rate of one coordinate at a time gives one partial derivative
        moving = still.copy()
        moving[:, 1, k] = 1.0
        slope[:, k] = -ROBOT.mass * jn.robot.center_of_mass(ROBOT, moving)[:, 1] @ ROBOT.gravity
    near(found, slope)


def test_torque_is_linear_in_gravity(torque):
    none, up = ([0.0, 0.0, 0.0], [1.0, -2.0, 3.0])
    weightless, pulled, both = (
        jn.inverse_dynamics(ROBOT.with_gravity(g), Q) for g in (none, up, np.add(up, ROBOT.gravity))
    )
    near(both - torque, pulled - weightless)


def test_torque_is_linear_in_payload(torque):
    load = random_inertia(np.random.default_rng(4))
    link = ROBOT.moving_links[-1]
    twice = jn.Inertia.total([load, load])
    one, two = (jn.inverse_dynamics(ROBOT.with_payload(link, given), Q) for given in (load, twice))
    near(two - torque, 2 * (one - torque))


def test_payload_is_what_a_link_glued_on_would_be(torque):
    load, link = random_inertia(np.random.default_rng(4)), ROBOT.moving_links[2]
    place, turned = np.array([0.1, 0.2, 0.3]), np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    glue = jn.Joint("glue", link, "load", "fixed", place, turned)
    glued = jn.Robot("glued", [*ROBOT.links.values(), jn.Link("load", load)], [*ROBOT.joints.values(), glue])
    near(jn.inverse_dynamics(glued, Q), jn.inverse_dynamics(ROBOT.with_payload(link, load.moved(place, turned)), Q))


@pytest.mark.slow
def test_a_locked_joint_is_one_that_does_not_move(torque):
    still = Q.copy()
    still[:, :, 3] = 0.0
    still[:, 0, 3] = 0.4
    rest = np.delete(np.arange(7), 3)
    held = ROBOT.locked({ROBOT.joint_names[3]: 0.4})
    near(jn.inverse_dynamics(held, still[..., rest]), jn.inverse_dynamics(ROBOT, still)[..., rest])


def freed(robot):
    """Return the robot with no joint following another, and the matrix that takes its coordinates to all."""
    joints = [dataclasses.replace(joint, mimic=None) for joint in robot.joints.values()]
    free = jn.Robot("free", list(robot.links.values()), joints, robot.gravity)
    matrix, offset = np.zeros((len(free.joint_names), len(robot.joint_names))), np.zeros(len(free.joint_names))
    for row, name in enumerate(free.joint_names):
        mimic = robot.joints[name].mimic
        leader = name if mimic is None else mimic.joint
        matrix[row, robot.joint_names.index(leader)] = 1.0 if mimic is None else mimic.multiplier
        offset[row] = 0.0 if mimic is None else mimic.offset
    return free, matrix, offset


def with_drives(robot):
    """Return the robot with drives at all its joints, those that follow included."""
    generator, names = np.random.default_rng(12), ("armature", "damping", "friction")
    joints = [
        dataclasses.replace(joint, **dict(zip(names, generator.uniform(0.1, 1, 3).tolist(), strict=True)))
        for joint in robot.joints.values()
    ]
    return jn.Robot("driven", list(robot.links.values()), joints, robot.gravity)


@pytest.mark.slow
@pytest.mark.parametrize("drives", [False, True])
def test_joints_that_follow_do_the_work_of_free_ones(drives):
    robot = with_drives(MIMIC)
    free, matrix, offset = freed(robot)
    q = MIMIC_Q @ matrix.T
    q[:, 0] += offset
    expected = jn.inverse_dynamics(free, q, drives=drives) @ matrix
    near(jn.inverse_dynamics(robot, MIMIC_Q, drives=drives), expected)


def test_drives_add_armature_damping_and_friction(torque):
    tree = ROBOT.tree
    extra = torque - jn.inverse_dynamics(ROBOT, Q, drives=False)
    expected = tree.armature * Q[:, 2:] + tree.damping * Q[:, 1:-1]
    expected[:, 0] += tree.friction * np.sign(Q[:, 1])
    near(extra, expected)
    assert [ROBOT.joints[name].friction for name in ROBOT.joint_names] == tree.friction.tolist()
    still = Q.copy()
    still[:, 1] = 0.0
    found = jn.inverse_dynamics(ROBOT, still) - jn.inverse_dynamics(ROBOT, still, drives=False)
    near(found[:, 0], tree.armature * Q[:, 2])  # no friction at rest


@pytest.mark.slow
def test_a_floating_base_at_rest_is_a_fixed_one(torque):
    floating = ROBOT.with_floating_base()
    q = np.concatenate([np.zeros((3, ORDER + 1, 6)), Q], axis=-1)
    near(jn.inverse_dynamics(floating, q)[..., 6:], torque)


def test_nothing_holds_a_robot_that_falls():
    floating = ROBOT.with_floating_base()
    q = np.zeros((3, ORDER + 1, 13))
    q[:, 0] = np.random.default_rng(3).uniform(-1, 1, 13)
    q[:, 1, :3] = [3.0, -2.0, 1.0]
    q[:, 2, :3] = floating.gravity
    near(jn.inverse_dynamics(floating, q), np.zeros((3, ORDER - 1, 13)), 1e-13)


@pytest.mark.slow
def test_forces_on_a_floating_base_are_those_on_its_mass():
    """The sum of outer forces is the mass times the acceleration of its center, with rates."""
    floating = ROBOT.with_floating_base()
    q = np.random.default_rng(3).uniform(-1, 1, (3, ORDER + 1, 13))
    expected = floating.mass * jn.robot.center_of_mass(floating, q)[:, 2:]
    expected[:, 0] -= floating.mass * floating.gravity
    near(jn.inverse_dynamics(floating, q)[..., :3], expected)


@pytest.mark.slow
def test_more_orders_change_none_before(torque):
    for order in (2, 3):
        near(jn.inverse_dynamics(ROBOT, Q[:, : order + 1]), torque[:, : order - 1], 1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("order", [5, 8])
def test_rates_of_high_order_follow_each_other(order, torque):
    """The rate of torque k at t + h is the sum of those above it at t: by the last two orders, to what is left out."""
    q = np.random.default_rng(order).uniform(-1, 1, (1, order + 1, 7))
    q[:, :3] = Q[:1, :3]
    step = 1e-3
    later = np.stack(
        [sum(q[:, k + j] * step**j / math.factorial(j) for j in range(order + 1 - k)) for k in range(order + 1)],
        axis=1,
    )
    now, then = (jn.inverse_dynamics(ROBOT, x) for x in (q, later))
    near(now[:, 0], torque[:1, 0])
    for k in range(order - 3):
        series = sum(now[:, k + j] * step**j / math.factorial(j) for j in range(order - 1 - k))
        left_out = order - 1 - k
        bound = 300 * np.abs(now).max() * step**left_out / math.factorial(left_out) + 1e-12 * np.abs(now[:, k]).max()
        assert np.abs(series - then[:, k]).max() <= bound


@pytest.mark.slow
def test_jit_vmap_and_two_ways_of_differentiation_agree(torque):
    def call(q):
        return jn.inverse_dynamics(ROBOT, q)

    found = jax.jit(jax.vmap(call))(Q[:, :4])
    assert isinstance(found, jax.Array)
    near(found, torque[:, :2])
    arm, q = random_robot(3, 3), Q[0, :4, :3]
    ways = [way(lambda q: jn.inverse_dynamics(arm, q))(jnp.asarray(q)) for way in (jax.jacfwd, jax.jacrev)]
    forward, reverse = ways
    assert forward.shape == (2, 3, 4, 3)
    near(forward, reverse)
    near(forward[0, :, 2], forward[0, :, 2].T)  # the mass matrix
    rate = sum(np.einsum("ij,j->i", forward[0, :, k], q[k + 1]) for k in range(3))
    near(jn.inverse_dynamics(arm, q)[1], rate)  # the rate of torque is the slope of torque along the motion


@pytest.mark.slow
def test_slopes_in_masses_and_centers():
    """Torque is linear in each mass and quadratic in each center, so that differences of any step are exact."""
    tree, q = ROBOT.tree, taylor_coefficients(jnp.asarray(Q[0, :3])[:, :, None])

    @jax.jit
    def torque(mass, center):
        return recursive_newton_euler(dataclasses.replace(tree, mass=mass, center=center), q)[0][0, :, 0]

    whole = torque(tree.mass, tree.center)
    near(whole, jn.inverse_dynamics(ROBOT, Q[0, :3], drives=False)[0])
    by_mass, by_center = jax.jacrev(torque, (0, 1))(jnp.asarray(tree.mass), jnp.asarray(tree.center))
    near(by_mass @ tree.mass, whole - torque(0 * tree.mass, tree.center))
    for body, axis in ((0, 0), (3, 2), (6, 1)):
        step = np.zeros_like(tree.center)
        step[body, axis] = 0.5
        near(by_center[:, body, axis], torque(tree.mass, tree.center + step) - torque(tree.mass, tree.center - step))


def momentum(robot, q, link):
    """Return the linear momentum of the body of a link and the angular one about the origin of the base, with rates."""
    body = robot.moving_links.index(link)
    tree, frame = robot.tree, robot.frames[link]
    place = frame.rotation.T @ (tree.center[body] - frame.position)
    motion = jn.forward_kinematics(robot, q, link, place)
    tensor = frame.rotation.T @ tree.inertia[body] @ frame.rotation
    count = motion.angular_velocity.shape[1]
    linear = tree.mass[body] * motion.position[:, 1:]
    angular = np.zeros_like(linear)
    for level in range(count):
        for i in range(level + 1):
            angular[:, level] += math.comb(level, i) * np.cross(motion.position[:, i], linear[:, level - i])
            for j in range(level - i + 1):  # R I R^T w, three factors
                k = level - i - j
                weight = math.factorial(level) / (math.factorial(i) * math.factorial(j) * math.factorial(k))
                turned = np.einsum("sij,jk,slk->sil", motion.rotation[:, i], tensor, motion.rotation[:, j])
                angular[:, level] += weight * np.einsum("sij,sj->si", turned, motion.angular_velocity[:, k])
    center = motion.position
    return linear, angular, center


@pytest.mark.slow
def test_wrenches_of_joints_change_the_momentum_of_each_body():
    """Newton's second and third laws for every body, with rates, about the origin of the base."""
    carried = jn.robot.joint_wrenches(ROBOT, Q, frame="base")
    levels = ORDER - 1
    force = carried[..., :3]
    about_base = np.zeros_like(force)
    for k, link in enumerate(ROBOT.moving_links):
        origin = jn.forward_kinematics(ROBOT, Q, link).position
        for level in range(levels):
            about_base[:, level, k] = carried[:, level, k, 3:]
            for i in range(level + 1):
                about_base[:, level, k] += math.comb(level, i) * np.cross(origin[:, i], force[:, level - i, k])
    parents = [
        int(np.flatnonzero(row[:k])[-1]) if row[:k].any() else -1 for k, row in enumerate(ROBOT.tree.ancestors[:-1])
    ]
    for k, link in enumerate(ROBOT.moving_links):
        children = [child for child, parent in enumerate(parents) if parent == k]
        linear, angular, center = momentum(ROBOT, Q, link)
        weight = ROBOT.tree.mass[k] * ROBOT.gravity
        net_force = force[:, :, k] - sum(force[:, :, child] for child in children)
        net_moment = about_base[:, :, k] - sum(about_base[:, :, child] for child in children)
        net_force[:, 0] += weight
        net_moment += np.cross(center[:, :levels], weight)
        near(net_force, linear[:, 1 : levels + 1])
        near(net_moment, angular[:, 1 : levels + 1], 1e-12)


@pytest.mark.slow
def test_wrenches_in_axes_of_link_and_base():
    base, link = (jn.robot.joint_wrenches(ROBOT, Q, frame=frame) for frame in ("base", "link"))
    for k, name in enumerate(ROBOT.moving_links):
        rotation = jn.forward_kinematics(ROBOT, Q, name).rotation
        for level in range(ORDER - 1):
            for part in (slice(0, 3), slice(3, 6)):
                expected = sum(
                    math.comb(level, i) * np.einsum("sij,sj->si", rotation[:, i], link[:, level - i, k, part])
                    for i in range(level + 1)
                )
                near(base[:, level, k, part], expected)


def test_torque_is_the_part_of_the_wrench_along_the_axis():
    torque = jn.inverse_dynamics(ROBOT, Q, drives=False)  # what the bodies need; drives act between motor and joint
    wrenches = jn.robot.joint_wrenches(ROBOT, Q)
    for k, (link, name) in enumerate(zip(ROBOT.moving_links, ROBOT.joint_names, strict=True)):
        joint = ROBOT.joints[name]
        assert joint.child == link
        part = wrenches[:, :, k, 3:] if joint.turning else wrenches[:, :, k, :3]
        near(part @ joint.axis, torque[..., k])


def test_a_sensor_between_arm_and_tool_feels_the_motion_of_the_tool():
    """Newton and Euler for a tool at an angle of t sin(2 t) about a level axis, differentiated in thirty digits."""
    mass, center, tensor = 1.3, [0.1, -0.2, 0.3], [[0.05, 0.01, -0.004], [0.01, 0.06, 0.002], [-0.004, 0.002, 0.04]]
    links = [
        jn.Link("base"),
        jn.Link("arm", jn.Inertia(4.0, [0.2, 0, 0])),
        jn.Link("tool", jn.Inertia(mass, center, tensor)),
    ]
    mount = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    pin = jn.Joint("pin", "base", "arm", axis=[0, 0, 1])
    sensor = jn.Joint("sensor", "arm", "tool", "fixed", position=[0.5, 0.1, 0.0], rotation=mount)
    robot = jn.Robot("crane", links, [pin, sensor], gravity=[0.0, -9.81, 0.0])

    def turned(t, vector):
        c, s = mp.cos(t * mp.sin(2 * t)), mp.sin(t * mp.sin(2 * t))
        return [c * vector[0] - s * vector[1], s * vector[0] + c * vector[1], vector[2]]

    from_mount = (np.array(mount) @ center).tolist()
    about_center = np.array(mount) @ tensor @ np.array(mount).T  # of the tool, in the axes of the arm

    def force(t):
        place = [mp.diff(lambda x, k=k: turned(x, np.add([0.5, 0.1, 0.0], from_mount))[k], t, 2) for k in range(3)]
        return [mass * place[0], mass * (place[1] + mp.mpf("9.81")), mass * place[2]]

    def wrench(t):
        rate = lambda x: mp.diff(lambda y: y * mp.sin(2 * y), x)  # noqa: E731
        spin = [mp.diff(lambda x, k=k: turned(x, about_center[:, 2] * rate(x))[k], t) for k in range(3)]
        pull, arm = force(t), turned(t, from_mount)
        moment = [spin[k] + arm[k - 2] * pull[k - 1] - arm[k - 1] * pull[k - 2] for k in range(3)]
        return [*pull, *moment]

    with mp.workdps(40):
        instant = mp.mpf("0.4")
        q = [[float(mp.diff(lambda t: t * mp.sin(2 * t), instant, k))] for k in range(5)]
        expected = [[mp.diff(lambda t, i=i: wrench(t)[i], instant, k) for i in range(6)] for k in range(3)]
    found = jn.robot.joint_wrenches(robot, q, frame="base", fixed=["sensor"])
    near(found[:, 1], np.array(expected, float), 1e-12)
    near(found[:, :1], jn.robot.joint_wrenches(robot, q, frame="base"))
    push = jn.robot.Wrench("tool", force=[3.0, 1.0, -2.0], frame="base")
    pushed = jn.robot.joint_wrenches(robot, q, frame="base", fixed=["sensor"], wrenches=[push])
    near(pushed[0, 1] - found[0, 1], [-3.0, -1.0, 2.0, 0.0, 0.0, 0.0], 1e-12)


def test_fixed_joints_are_named_once_and_are_fixed():
    q = np.zeros((3, 7))
    fixed = [name for name, joint in ROBOT.joints.items() if not joint.moving]
    assert fixed
    whole, some = (jn.robot.joint_wrenches(ROBOT, q, fixed=names) for names in (fixed, fixed[:0:-1] + fixed[:1]))
    near(some, whole[:, [*range(7), *range(7 + len(fixed) - 1, 7, -1), 7]])
    links = [jn.Link("base"), jn.Link("arm", jn.Inertia(1.0, [1, 0, 0])), jn.Link("tip")]
    joints = [jn.Joint("pin", "base", "arm", axis=[0, 1, 0]), jn.Joint("point", "arm", "tip", "fixed")]
    assert not jn.robot.joint_wrenches(jn.Robot("arm", links, joints), np.ones((3, 1)), fixed=["point"])[:, 1].any()
    for given, says in (
        (fixed[0], "fixed: must be a list of names of fixed joints"),
        ([ROBOT.joint_names[0]], "fixed: no fixed joint has this name, got 'joint_0'; valid: fixed_2"),
        ([fixed[0]] * 2, "fixed: a joint is there twice"),
    ):
        with pytest.raises(jn.errors.RobotError, match=says):
            jn.robot.joint_wrenches(ROBOT, q, fixed=given)


def test_frames_of_reactions_are_checked():
    with pytest.raises(jn.errors.RobotError) as caught:
        jn.robot.joint_wrenches(ROBOT, Q, frame="world")
    assert str(caught.value) == "frame: unknown frame, got 'world'; valid: base, link"


def test_calls_as_in_pinocchio_are_answered_by_how_they_are_made_here():
    robot = jn.load_robot("examples/robots/ur5.urdf")
    q = np.zeros(6)
    for call, words in (
        (lambda: jn.inverse_dynamics(robot, q, q, q), r"takes 2 arguments.*jn\.inverse_dynamics\(robot, np\.stack"),
        (lambda: jn.forward_dynamics(robot, q, q, q), r"takes 3 arguments.*pin\.aba\(model, data, q, v, tau\)"),
        (lambda: jn.bias_forces(robot, q, q), "pin.nonLinearEffects"),
        (lambda: jn.inverse_dynamics(robot, q), r"np\.stack\(\[q, v, a\]\)"),
    ):
        with pytest.raises(jn.errors.RobotError, match=words):
            call()
