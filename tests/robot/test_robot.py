"""Robots by name: order of q, payload, joints held, floating base, copies, and every refusal in its words."""

import copy
import pickle

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from tests.problems.robots import coordinates, poses, random_robot, robot_named

BODY = jn.Inertia(1.0, [0.1, 0.0, 0.2], [0.02, 0.03, 0.04])
MIMIC = robot_named("mimic")  # eight moving joints, of which four follow


def chain(*joints, links=(), gravity=(0.0, 0.0, -9.81)):
    """Return a robot of links base, a, b, c with the given joints."""
    return jn.Robot("chain", [jn.Link("base"), *(links or (jn.Link(n, BODY) for n in "abc"))], joints, gravity)


def pin(name, parent, child, **fields):
    return jn.Joint(name, parent, child, **fields)


def test_q_has_the_order_of_the_tree_not_of_the_list():
    robot = chain(pin("third", "a", "c"), pin("second", "a", "b"), pin("first", "base", "a"))
    assert robot.joint_names == ("first", "third", "second")  # parents first, branches as given
    assert robot.moving_links == ("a", "c", "b")
    assert robot.link_names == ("base", "a", "b", "c")
    assert robot.base == "base"
    assert repr(robot) == "<Robot chain: 3 joints, 4 links>"


def test_joints_that_follow_are_not_in_q():
    followers = [joint for joint in MIMIC.joints.values() if joint.mimic is not None]
    assert len(followers) == 4
    assert len(MIMIC.joint_names) == 4
    assert len(MIMIC.moving_links) == 8
    assert not {joint.name for joint in followers} & set(MIMIC.joint_names)
    assert tuple(MIMIC.limits) == MIMIC.joint_names


def test_masses_of_base_and_all():
    parts = jn.Link("plate", jn.Inertia(2.0)), jn.Link("foot", jn.Inertia(3.0, [1, 0, 0]))
    links = [jn.Link("base"), *parts, jn.Link("a", BODY)]
    joints = [
        pin("one", "base", "plate", type="fixed", position=[0, 0, 1]),
        pin("two", "plate", "foot", type="fixed", position=[0, 0, 1], rotation=[[0, -1, 0], [1, 0, 0], [0, 0, 1]]),
        pin("three", "foot", "a"),
    ]
    robot = jn.Robot("standing", links, joints)
    assert robot.mass == 6.0
    assert robot.base_inertia.mass == 5.0
    np.testing.assert_allclose(robot.base_inertia.center_of_mass, [0, 0.6, 1.6], rtol=0, atol=1e-15)
    assert chain(pin("x", "base", "a"), pin("y", "a", "b"), pin("z", "b", "c")).base_inertia is None


def test_a_robot_of_no_joints():
    block = jn.Robot("block", [jn.Link("block", jn.Inertia(2.0, [1.0, 0, 0]))], [])
    still = np.zeros((4, 3, 0))
    assert jn.inverse_dynamics(block, still).shape == (4, 1, 0)
    assert jn.robot.joint_wrenches(block, still).shape == (4, 1, 0, 6)
    assert jn.jacobian(block, still, "block").shape == (4, 3, 6, 0)
    assert jn.robot.center_of_mass(block, still)[:, 0].tolist() == [[1.0, 0.0, 0.0]] * 4
    assert repr(block) == "<Robot block: 0 joints, 1 links>"


def test_robots_do_not_change():
    with pytest.raises(AttributeError, match=r"gravity: .*with_gravity"):
        MIMIC.gravity = np.zeros(3)
    with pytest.raises(ValueError, match="read-only"):
        MIMIC.gravity[2] = 0.0
    with pytest.raises(TypeError):
        MIMIC.joints["new"] = next(iter(MIMIC.joints.values()))


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda robot: pickle.loads(pickle.dumps(robot))])
def test_copies_are_the_same_robot(copied):
    other = copied(MIMIC)
    assert other.joint_names == MIMIC.joint_names
    assert other.link_names == MIMIC.link_names
    for name in ("rotation", "position", "mass", "center", "inertia", "coordinate", "multiplier", "offset", "gravity"):
        assert np.array_equal(getattr(other.tree, name), getattr(MIMIC.tree, name)), name


def test_gravity_and_payload_make_another_robot():
    other = MIMIC.with_gravity([1, 2, 3])
    assert other.gravity.tolist() == [1, 2, 3]
    assert MIMIC.gravity.tolist() == [0, 0, -9.81]
    load = jn.Inertia(2.0, [0.1, 0, 0])
    loaded = MIMIC.with_payload("link_4", load)
    assert loaded.mass == pytest.approx(MIMIC.mass + 2.0, rel=1e-15)
    whole = jn.Inertia.total([MIMIC.links["link_4"].inertia, load])
    assert np.array_equal(loaded.links["link_4"].inertia.tensor, whole.tensor)
    framed = chain(pin("x", "base", "a"), links=[jn.Link("a", BODY), jn.Link("b")][:1]).with_payload("base", load)
    assert framed.base_inertia.mass == 2.0
    with pytest.raises(jn.errors.RobotError, match=r"^payload: must be a jn.Inertia, .* got 2.0"):
        MIMIC.with_payload("link_4", 2.0)


def test_locked_joints_hold_what_follows_them_too():
    values = coordinates(MIMIC)
    name = next(joint.mimic.joint for joint in MIMIC.joints.values() if joint.mimic is not None)
    held = MIMIC.locked({name: values[name]})
    assert held.joint_names == tuple(n for n in MIMIC.joint_names if n != name)
    assert not any(j.moving for j in held.joints.values() if j.name == name or (j.mimic and j.mimic.joint == name))
    expected, found = poses(MIMIC, values), poses(held, values)
    for link in MIMIC.link_names:
        np.testing.assert_allclose(found[link], expected[link], rtol=0, atol=1e-14)
    with pytest.raises(jn.errors.RobotError, match=r"^locked: must be a mapping of joints to coordinates"):
        MIMIC.locked([name])


def test_a_fixed_joint_that_should_follow_stays_where_it_is():
    follows = pin("glue", "a", "b", type="fixed", position=[1, 0, 0], mimic=jn.robot.Mimic("x", 2.0, 0.5))
    robot = chain(pin("x", "base", "a"), follows, links=[jn.Link("a", BODY), jn.Link("b", BODY)])
    held = robot.locked({"x": 0.3})
    assert held.joints["glue"].position.tolist() == [1, 0, 0]
    assert held.joints["glue"].rotation.tolist() == np.eye(3).tolist()


def test_a_floating_base_comes_first():
    robot = random_robot(2, 3).with_floating_base("xyz")
    first = "base_x", "base_y", "base_z", "base_angle_1", "base_angle_2", "base_angle_3"
    assert robot.joint_names[:6] == first
    assert robot.base == "world"
    assert robot_named("planar_arm").with_floating_base().base == "world_"  # its own base is called world
    axes = [robot.joints[name].axis.tolist() for name in first]
    assert axes == [*np.eye(3).tolist(), *np.eye(3).tolist()]


def test_coordinates_by_name():
    robot = random_robot(2, 3)
    assert robot.coordinates(joint_1=0.5).tolist() == [0.0, 0.5, 0.0]


LOOP = [pin("x", "a", "b"), pin("y", "b", "a")]
REFUSED = [
    (lambda: jn.Robot("r", [], []), "links: a robot needs at least one link"),
    (lambda: jn.Robot("r", [jn.Link("a"), jn.Link("a")], []), "links: this name is given twice, got 'a'"),
    (
        lambda: chain(pin("x", "base", "a"), pin("x", "a", "b"), pin("z", "b", "c")),
        "joints: this name is given twice, got 'x'",
    ),
    (
        lambda: chain(pin("x", "base", "arm")),
        "joints.x.child: no link has this name, got 'arm'; valid: a, b, base, c",
    ),
    (
        lambda: chain(pin("x", "bass", "a")),
        "joints.x.parent: no link has this name, got 'bass'; did you mean 'base'? valid: a, b, base, c",
    ),
    (
        lambda: chain(pin("x", "base", "a"), pin("y", "a", "b"), pin("z", "base", "b"), pin("w", "b", "c")),
        "joints.z.child: link b is the child of two joints, y and z: a loop, which a tree cannot have, got 'b'; leave "
        "one of them out",
    ),
    (
        lambda: jn.Robot("r", [jn.Link("a", BODY), jn.Link("b", BODY)], LOOP),
        "joints: the joints form a loop: every link is the child of a joint, and none can be the base",
    ),
    (
        lambda: jn.Robot("r", [jn.Link("base"), jn.Link("a", BODY), jn.Link("b", BODY)], LOOP),
        "joints: these joints form a loop that the base does not reach, got ['x', 'y']",
    ),
    (
        lambda: chain(pin("x", "base", "a"), pin("y", "b", "c")),
        "links: exactly one link must be no joint's child, the base, got ['base', 'b']; join the others to it",
    ),
    (
        lambda: jn.Robot("r", [jn.Link("base"), jn.Link("a")], [pin("x", "base", "a")]),
        "links.a.inertia: this joint moves no mass, got nothing; give its link, or one that it carries, an inertia, or "
        "keep it with strict=False, where its torque is zero",
    ),
    (
        lambda: chain(
            pin("x", "base", "a"),
            pin("y", "a", "b", mimic=jn.robot.Mimic("x")),
            pin("z", "b", "c", mimic=jn.robot.Mimic("y")),
        ),
        "joints.z.mimic: must follow a moving joint that follows no other, got 'y'; valid: x",
    ),
    (
        lambda: jn.Robot(
            "r", [jn.Link("base"), jn.Link("a", BODY)], [pin("x", "base", "a", mimic=jn.robot.Mimic("x"))]
        ),
        "joints.x.mimic: must follow a moving joint that follows no other, got 'x'; none is defined",
    ),
    (lambda: MIMIC.with_gravity([0, 0]), "gravity: must have the shape (3,), not (2,)"),
    (lambda: MIMIC.with_gravity([0, 0, np.nan]), "gravity: must be finite, got [0.0, 0.0, nan]"),
    (
        lambda: chain(pin("x", "base", "a"), links=[jn.Link("a", BODY)]).with_payload("tool", BODY),
        "link: no link has this name, got 'tool'; valid: a, base",
    ),
    (
        lambda: chain(pin("x", "base", "a"), links=[jn.Link("a", BODY)]).locked({"y": 0.0}),
        "locked: no moving joint has this name, got 'y'; valid: x",
    ),
    (
        lambda: chain(pin("x", "base", "a"), links=[jn.Link("a", BODY)]).locked({"x": np.inf}),
        "locked.x: must be finite, got inf",
    ),
    (
        lambda: chain(pin("x", "base", "a"), links=[jn.Link("a", BODY)]).coordinates(y=0.0),
        "joint: no moving joint has this name, got 'y'; valid: x",
    ),
    (
        lambda: MIMIC.with_floating_base("ZZX"),
        "sequence: must be three letters X, Y, Z of which neighbors differ, got 'ZZX'",
    ),
]


@pytest.mark.parametrize("make, message", REFUSED)
def test_refused(make, message):
    with pytest.raises(jn.errors.RobotError) as caught:
        make()
    assert str(caught.value) == message


def test_a_joint_that_moves_no_mass_may_be_kept():
    links = [jn.Link("base"), jn.Link("a", BODY), jn.Link("b"), jn.Link("c")]
    joints = [pin("one", "base", "a"), pin("two", "a", "b"), pin("three", "b", "c")]
    robot = jn.Robot("chain", links, joints, strict=False)
    assert robot.massless_joints == ("two", "three")
    for other in (pickle.loads(pickle.dumps(robot)), robot.with_gravity([0, 0, 0]), robot.with_floating_base()):
        assert other.massless_joints == ("two", "three")
    assert robot.with_payload("b", BODY).massless_joints == ("three",)
    assert robot.with_payload("c", BODY).massless_joints == ()


def _slope(function, value, step):
    """Return a central difference, exact for polynomials to the second degree."""
    return (np.asarray(function(value + step)) - np.asarray(function(value - step))) / (2 * step)


@pytest.mark.slow
def test_gradients_by_inertial_parameters():
    robot = random_robot(2, 3, prismatic=0.4)
    link, q = robot.moving_links[1], np.random.default_rng(3).uniform(-1, 1, (3, 3))
    held = robot.links[link].inertia

    def quantities(mass, shift, moment):
        center, tensor = held.center_of_mass + np.eye(3)[1] * shift, held.tensor + np.diag([1.0, 1.0, 0.0]) * moment
        changed = robot.with_inertia(link, mass=mass, center_of_mass=center, tensor=tensor)
        torque, matrix = jn.inverse_dynamics(changed, q)[0], jn.mass_matrix(changed, q[0]).ravel()
        acceleration = jn.forward_dynamics(changed, q[:2], q[2:])[2]
        return jnp.concatenate([jnp.asarray(part) for part in (torque, matrix, acceleration)])

    start = (held.mass, 0.0, 0.0)
    for k, step in enumerate((1e-4, 1e-4, 1e-5)):
        change = np.eye(3)[k]
        _, slope = jax.jvp(quantities, start, tuple(change))
        expected = _slope(lambda x, k=k: quantities(*(x if i == k else v for i, v in enumerate(start))), start[k], step)
        assert np.abs(slope - expected).max() <= 1e-6 * np.abs(expected).max()
    whole = jax.grad(lambda mass: quantities(mass, 0.0, 0.0)[-1])(held.mass)
    _, forward = jax.jvp(lambda mass: quantities(mass, 0.0, 0.0)[-1], (held.mass,), (1.0,))
    assert whole == pytest.approx(float(forward), rel=1e-12)


def test_inertia_of_a_link_is_changed_and_checked():
    robot = random_robot(2, 3)
    link = robot.moving_links[1]
    changed = robot.with_inertia(link, mass=5.0)
    assert changed.mass - robot.mass == pytest.approx(5.0 - robot.links[link].inertia.mass)
    with pytest.raises(jn.errors.RobotError, match="elbow"):
        robot.with_inertia("elbow", mass=1.0)
    with pytest.raises(jn.errors.RobotError, match="mass: must be greater than zero"):
        robot.with_inertia(link, mass=0.0)
