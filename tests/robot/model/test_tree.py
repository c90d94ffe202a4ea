"""The arrays of the tree: axes along z, places of states, ancestors; and that names and order do not matter."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import jounce as jn
from jounce.robot.model.tree import axes_with_z_along, turn_about
from tests.problems.robots import humanoid, random_robot, robot_named

SEEDS = range(8)


@pytest.mark.parametrize("axis", [*np.eye(3), *-np.eye(3), [0.6, 0.0, 0.8], [1 / 3, -2 / 3, 2 / 3]])
def test_axes_are_turned_to_z(axis):
    aligned = axes_with_z_along(np.array(axis))
    np.testing.assert_allclose(aligned[:, 2], axis, rtol=0, atol=0)
    np.testing.assert_allclose(aligned @ aligned.T, np.eye(3), rtol=0, atol=2e-16)
    assert np.linalg.det(aligned) == pytest.approx(1.0, abs=1e-15)


def test_turns_are_those_of_scipy():
    axis = np.array([2.0, -1.0, 2.0]) / 3
    for angle in (-3.0, 0.0, 0.4, 7.0):
        expected = Rotation.from_rotvec(angle * axis).as_matrix()
        np.testing.assert_allclose(turn_about(axis, angle), expected, rtol=0, atol=1e-15)


def parents(robot):
    """Return the index of the parent body of each, from the joints."""
    moving = [joint for joint in robot.joints.values() if joint.moving]
    number = {joint.child: k for k, joint in enumerate(moving)}
    carrier = {joint.child: joint for joint in robot.joints.values()}

    def body(link):
        while link in carrier and link not in number:
            link = carrier[link].parent
        return number.get(link, -1)

    return [body(joint.parent) for joint in moving]


@pytest.mark.parametrize("robot", [random_robot(seed, 12) for seed in SEEDS] + [humanoid()], ids=str)
def test_states_are_kept_until_the_last_child_is_done(robot):
    tree, above = robot.tree, parents(robot)
    held = dict.fromkeys(range(tree.shape.slots), -1)  # every place holds the base at first
    for k, parent in enumerate(above):  # outwards, each finds its parent
        assert held[tree.parent_slot[k]] == parent
        held[tree.slot[k]] = k
    sums = {slot: set() for slot in range(tree.shape.slots)}
    for k, _ in reversed(list(enumerate(above))):  # inwards, each finds what its children sent, and nothing else
        received = sums[tree.slot[k]]
        assert received == {child for child, parent in enumerate(above) if parent == k}
        sums[tree.slot[k]] = set()
        sums[tree.parent_slot[k]] = sums[tree.parent_slot[k]] | {k}


def test_a_chain_needs_one_place():
    assert random_robot(1, 9, tree=False).tree.shape.slots == 1
    assert robot_named("panda").tree.shape.slots == 2  # two fingers


@pytest.mark.parametrize("seed", SEEDS)
def test_ancestors_are_the_joints_on_the_way_to_the_base(seed):
    robot = random_robot(seed, 12)
    above = parents(robot)
    for k in range(len(above)):
        way, body = set(), k
        while body >= 0:
            way.add(body)
            body = above[body]
        assert set(np.flatnonzero(robot.tree.ancestors[k])) == way
    assert not robot.tree.ancestors[-1].any()


def test_links_fixed_together_are_one_body():
    robot = random_robot(4, 6, fixed=1.0)
    assert robot.tree.shape.bodies == 6
    assert robot.tree.mass.sum() == pytest.approx(robot.mass, rel=1e-15)
    for k, link in enumerate(robot.moving_links):
        part = link.replace("link", "part")
        assert robot.frames[part].body == robot.frames[link].body == k
        parts = [
            robot.links[name].inertia.moved(robot.frames[name].position, robot.frames[name].rotation)
            for name in (link, part)
        ]
        whole = jn.Inertia.total(parts)
        np.testing.assert_allclose(robot.tree.center[k], whole.center_of_mass, rtol=0, atol=1e-15)
        np.testing.assert_allclose(robot.tree.inertia[k], whole.tensor, rtol=0, atol=1e-15)


ROBOT = random_robot(2, 9, mimic=0.2)


def renamed(name):
    return f"other_{name}"


def shuffled(robot, seed):
    """Return the robot with other names, and links and joints listed in another order."""
    generator = np.random.default_rng(seed)
    links = [jn.Link(renamed(link.name), link.inertia) for link in robot.links.values()]
    joints = [
        dataclasses.replace(
            joint,
            name=renamed(joint.name),
            parent=renamed(joint.parent),
            child=renamed(joint.child),
            mimic=joint.mimic and dataclasses.replace(joint.mimic, joint=renamed(joint.mimic.joint)),
        )
        for joint in robot.joints.values()
    ]
    generator.shuffle(links)
    generator.shuffle(joints)
    return jn.Robot("shuffled", links, joints, robot.gravity)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [pytest.param(0, marks=pytest.mark.slow), 2])
def test_names_and_order_of_the_list_do_not_matter(seed):
    other = shuffled(ROBOT, seed)
    order = [other.joint_names.index(renamed(name)) for name in ROBOT.joint_names]
    assert order != list(range(len(order)))
    q = np.random.default_rng(seed).uniform(-1, 1, (2, 4, len(order)))
    moved = np.empty_like(q)
    moved[..., order] = q
    torque = jn.inverse_dynamics(ROBOT, q, drives=True)
    found = jn.inverse_dynamics(other, moved, drives=True)[..., order]
    np.testing.assert_allclose(found, torque, rtol=0, atol=1e-13 * np.abs(torque).max())
    link = ROBOT.moving_links[-1]
    np.testing.assert_allclose(
        jn.jacobian(other, moved, renamed(link))[..., order], jn.jacobian(ROBOT, q, link), rtol=0, atol=1e-12
    )


def test_axis_and_frame_of_a_link_can_be_chosen_freely():
    """A joint along -z with q is one along z with -q; another frame of the last link changes no torque."""
    body = jn.Inertia(1.5, [0.2, 0.1, -0.3], [0.03, 0.04, 0.05])
    links = [jn.Link("base"), jn.Link("a", body), jn.Link("b", body)]

    def arm(axis, rotation, last):
        joints = [
            jn.Joint("x", "base", "a", axis=axis, position=[0.1, 0, 0.2]),
            jn.Joint("y", "a", "b", position=[0.4, 0, 0], rotation=rotation, axis=rotation.T @ [0, 1, 0]),
        ]
        return jn.Robot("arm", [*links[:2], jn.Link("b", last)], joints)

    turned = Rotation.from_rotvec([0.3, -0.4, 0.9]).as_matrix()
    q = np.random.default_rng(0).uniform(-1, 1, (2, 4, 2))
    expected = jn.inverse_dynamics(arm([0, 0, 1], np.eye(3), body), q)
    mirrored = jn.inverse_dynamics(arm([0, 0, -1], np.eye(3), body), q * [-1, 1]) * [-1, 1]
    np.testing.assert_allclose(mirrored, expected, rtol=0, atol=1e-14 * np.abs(expected).max())
    other = jn.inverse_dynamics(arm([0, 0, 1], turned, body.moved(np.zeros(3), turned.T)), q)
    np.testing.assert_allclose(other, expected, rtol=0, atol=1e-14 * np.abs(expected).max())
