"""What holds for robots with loops, whatever their joints are fitted with: power, momentum, frames, values."""

import dataclasses

import numpy as np
import pytest

import jounce as jn
from tests.oracles.moving_masses import change_of_momentum, product
from tests.problems.fitted_robots import CLOSED_NAMES, closed, redrawn

ORDER = 4
TIME = [0.1, 0.4, 0.8]


def solved(robot, near, laws):
    motion = jn.solve(robot.mechanism(near, drivers=laws), TIME, ORDER)
    assert (motion.status == 0).all()
    return motion


def coordinates(motion, robot):
    """Return the coordinates of the tree and their derivatives, (time, ORDER + 1, n)."""
    return np.stack([motion.outputs[name] for name in robot.joint_names], axis=-1)


def efforts(motion, laws):
    """Return the forces of the motors, (time, ORDER - 1, motors)."""
    return np.stack([np.asarray(jn.driver_force(motion, f"{x}_drive").values) for x in laws], -1)[:, : ORDER - 1]


def near_to(found, expected, tolerance=1e-11):
    found, expected = np.asarray(found), np.asarray(expected)
    assert found.shape == expected.shape
    for level in range(found.shape[1]):
        assert np.abs(expected[:, level]).max() > 1e-3, "nothing is compared"
        size = np.abs(expected[:, : level + 1]).max()
        assert np.abs(found[:, level] - expected[:, level]).max() <= tolerance * size, level


@pytest.fixture(scope="module", params=CLOSED_NAMES)
def loop(request):
    robot, near, laws = closed(request.param)
    return robot, near, laws, solved(robot, near, laws)


@pytest.mark.slow
def test_motors_give_the_power_that_the_tree_needs_with_rates(loop):
    """Closures do no work: the forces that all joints of the tree would need work as the motors do."""
    robot, _, laws, motion = loop
    q, effort = coordinates(motion, robot), efforts(motion, laws)
    needed = np.asarray(jn.inverse_dynamics(robot.opened(), q))
    rates = q[:, 1 : ORDER + 1]
    given = sum(product(effort[..., k], rates[..., robot.joint_names.index(x)]) for k, x in enumerate(laws))
    parts = [product(needed[..., k], rates[..., k]) for k in range(len(robot.joint_names))]
    near_to(given, sum(parts))
    assert all(np.abs(part).max() > 1e-3 for part in parts)
    if "F" in laws:  # free of the loop: its motor gives what it needs
        near_to(effort[..., [*laws].index("F")], needed[..., robot.joint_names.index("F")])


@pytest.mark.slow
def test_the_ground_bears_what_the_momentum_of_the_links_lacks_with_rates(loop):
    robot, _, _, motion = loop
    point = np.array([0.3, -0.2, 0.4])
    expected = change_of_momentum(robot.opened(), coordinates(motion, robot))
    expected[..., 3:] -= np.cross(point, expected[..., :3])
    found = jn.dynamics.ground_reaction(motion, point)
    both = [np.asarray(x.values)[:, : ORDER - 1] for x in dataclasses.astuple(found)]
    near_to(-np.concatenate(both, axis=-1), expected)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_frames_are_drawn_at_will(loop, seed):
    robot, near, laws, motion = loop
    other, moves = redrawn(robot, np.random.default_rng(seed))
    again = solved(other, near, laws)
    near_to(coordinates(again, other), coordinates(motion, robot), 1e-10)
    near_to(efforts(again, laws), efforts(motion, laws), 1e-10)
    shift, turn = moves[robot.base]
    was, now = (jn.dynamics.ground_reaction(x, point) for x, point in ((motion, shift), (again, np.zeros(3))))
    for before, after in zip(dataclasses.astuple(was), dataclasses.astuple(now), strict=True):
        near_to(after.values, np.asarray(before.values) @ turn, 1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pin", "slider"])
def test_a_simulated_motion_needs_no_power_of_motors(name):
    robot, near, laws = closed(name)
    start = {joint: f"({law}) + 0.3*t" for joint, law in laws.items()}
    run = jn.simulate(robot.mechanism(near, initial=start), [0.0, 0.03, 0.06], order=3)
    assert (run.status == 0).all()
    q = coordinates(run, robot)
    parts = product(np.asarray(jn.inverse_dynamics(robot.opened(), q)), q[:, 1:])
    sizes = np.maximum.accumulate(np.abs(parts).max(axis=(0, 2)))
    assert (sizes > 1e-3).all()
    assert (np.abs(parts.sum(axis=-1)).max(axis=0) <= 1e-9 * sizes).all()


@pytest.mark.slow
def test_every_number_of_a_drive_counts_in_proportion(loop):
    robot, near, laws, motion = loop
    whole, total = (
        efforts(motion, laws),
        efforts(jn.solve(robot.mechanism(near, drivers=laws, drives=False), TIME, ORDER), laws),
    )
    for field in ("armature", "damping", "friction", "stiffness"):
        held = {joint.name: np.asarray(getattr(joint, field)) for joint in robot.moving_joints}
        if not any(map(np.any, held.values())):
            continue

        def with_factor(factor, field=field, held=held):
            joints = [
                dataclasses.replace(joint, **{field: factor * held[name]})
                if name in held and np.any(held[name])
                else joint
                for name, joint in robot.joints.items()
            ]
            return efforts(solved(robot.changed(joints=joints), near, laws), laws)

        half, twice = with_factor(0.5), with_factor(2.0)
        part = 2 * (whole - half)
        assert np.abs(part).max() > 1e-4, field
        np.testing.assert_allclose(twice - whole, part, rtol=0, atol=1e-10 * np.abs(whole).max())
        total = total + part
    near_to(total, whole, 1e-10)
