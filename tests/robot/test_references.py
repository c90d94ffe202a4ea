"""Forces, reactions, energies and Jacobians to order six against references of fifty digits: references/make.py."""

import functools
import json
from pathlib import Path

import numpy as np
import pytest

import jounce as jn
from jounce.io.robots.loader import load_robot

HERE = Path(__file__).parent / "references"
ROBOTS = Path(__file__).parents[2] / "examples" / "robots"


@functools.cache
def reference(name):
    return json.loads((HERE / f"{name}.json").read_text())


def of_file(name, robot):
    """Return the robot of a reference and where its coordinates are in those of the reference."""
    content = reference(name)
    made = load_robot(ROBOTS / f"{robot}.urdf")
    made = made.locked({joint: 0.0 for joint in content["locked"] if joint in made.joint_names})
    return made, [content["joints"].index(joint) for joint in made.joint_names]


def tree():
    """Return the random tree, its coordinates and those of the reference in the same order."""
    content = reference("tree")
    links, joints = [jn.Link("base")], []
    for k, body in enumerate(content["bodies"]):
        mass, center, tensor = (np.array(body[key], float) for key in ("mass", "center", "inertia"))
        links.append(jn.Link(f"link_{k}", jn.Inertia(float(mass), center, tensor)))
        parent = "base" if body["parent"] < 0 else f"link_{body['parent']}"
        place, rotation, axis = (np.array(body[key], float) for key in ("position", "rotation", "axis"))
        joints.append(jn.Joint(f"joint_{k}", parent, f"link_{k}", body["type"], place, rotation, axis))
    robot = jn.Robot("tree", links, joints, np.array(content["gravity"], float))
    assert robot.joint_names == tuple(
        f"joint_{k}" for k, body in enumerate(content["bodies"]) if body["type"] != "fixed"
    )
    return robot, np.array(content["q"], float)


def errors(found, expected):
    """Return the largest error of each derivative, by the peak of that derivative; order on the second axis."""
    found, expected = (np.moveaxis(np.asarray(x), 1, 0).reshape(np.shape(expected)[1], -1) for x in (found, expected))
    return np.abs(found - expected).max(axis=1) / np.abs(expected).max(axis=1)


slow = pytest.mark.slow  # orders that take seconds to compile


def test_torque_and_two_rates_of_the_panda_to_rounding():
    content = reference("arm")
    robot, order = of_file("arm", "panda")
    torque = jn.inverse_dynamics(robot, np.array(content["q"], float)[..., order], drives=False)
    assert torque.shape == (21, 3, 7)
    assert np.all(errors(torque, np.array(content["torque"], float)[..., order]) <= 2e-15)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["panda", "solo12"])
def test_torque_and_six_rates_along_sines(name):
    content = reference(name)
    robot, order = of_file(name, name)
    torque = jn.inverse_dynamics(robot, np.array(content["q"], float)[..., order], drives=False)
    expected = np.array(content["torque"], float)[..., order]
    assert torque.shape == expected.shape
    assert expected.shape[1] == 7
    assert np.all(errors(torque, expected) <= 5e-15)


@pytest.mark.slow
def test_forces_and_six_rates_of_a_random_tree():
    robot, q = tree()
    expected = np.array(reference("tree")["torque"], float)
    assert expected.shape[1] == 7
    assert np.all(errors(jn.inverse_dynamics(robot, q, drives=False), expected) <= 5e-15)


@pytest.mark.parametrize("order", [3, pytest.param(8, marks=slow)])
def test_reactions_of_a_random_tree(order):
    robot, q = tree()
    expected = np.moveaxis(np.array(reference("tree")["wrench"], float), 2, 1)  # sample, level, body, component
    wrench = jn.robot.joint_wrenches(robot, q[:, : order + 1])
    assert np.all(errors(wrench, expected[:, : order - 1]) <= 5e-15)


@pytest.mark.slow
@pytest.mark.parametrize("p, order", [(1, 3), (2, 4), *((p, 8) for p in range(4))])
def test_energies_of_a_random_tree(p, order):
    robot, q = tree()
    expected = np.array([sample[p] for sample in reference("tree")["energy"]], float)[:, : order - p]
    energy = jn.energy.acceleration_energy(robot, q[:, : order + 1], order=p)
    assert energy.total.shape == expected.shape
    assert np.all(errors(energy.total, expected) <= 1e-14)  # by the squares of large derivatives of axes


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, pytest.param(8, marks=slow)])
def test_jacobian_and_center_of_mass_of_a_random_tree(order):
    content = reference("tree")
    robot, q = tree()
    q = q[:, : order + 1]
    expected = np.transpose(np.array(content["jacobian"], float), (0, 2, 3, 1))[:, : order + 1]
    assert np.all(errors(jn.jacobian(robot, q, "link_6", content["point"]), expected) <= 1e-14)
    expected = np.array(content["center"], float)[:, : order + 1]
    assert np.all(errors(jn.robot.center_of_mass(robot, q), expected) <= 1e-14)
