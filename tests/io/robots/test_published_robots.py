"""The 68 published robots of example-robot-data against Pinocchio: all are read, with one warning of what is wrong."""

import warnings
from xml.etree import ElementTree

import numpy as np
import pytest

import jounce as jn
from tests.problems.published_robots import Pair, difference, files, floating_root, forest, random_states

FEW = (  # one of each fault: moments, a mass, a mimic; a robot that has none, with continuous joints
    "alex_description/urdf/alex_psyonic_hands.urdf",
    "anymal_c_simple_description/urdf/anymal.urdf",
    "bolt_description/robots/bolt.urdf",
    "double_pendulum_description/urdf/double_pendulum_continuous.urdf",
    "human_description/robots/human.urdf",
    "icub_description/robots/icub.urdf",
    "romeo_description/urdf/romeo.urdf",
    "tiago_description/robots/tiago_no_hand.urdf",
)


@pytest.fixture(scope="module", params=["few", pytest.param("all", marks=pytest.mark.slow)])
def pairs(request):
    return {name: Pair(path) for name, path in files().items() if request.param == "all" or name in FEW}


def impossible_links(root):
    """Return the links with moments of inertia that no real body has, or none has without mass."""
    found = set()
    for link in root.iterfind("link[inertial]"):
        mass = float(link.find("inertial/mass").get("value"))
        entries = link.find("inertial/inertia").attrib
        xx, xy, xz, yy, yz, zz = (float(entries[key]) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
        small, middle, large = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        largest = max(abs(small), abs(large))
        doubtful = small < -1e-5 * largest or large - middle - small > 1e-5 * largest
        if doubtful or (mass == 0 and largest > 0):
            found.add(link.get("name"))
    return found


def massless_links(root, model):
    """Return the links that joints move and that have no mass, with what is fixed to them, in Pinocchio's model."""
    children = {joint.get("name"): joint.find("child").get("link") for joint in root.iterfind("joint")}
    numbers = range(1, model.njoints)
    return {
        children[model.names[k]] for k in numbers if not model.inertias[k].mass and not model.inertias[k].inertia.any()
    }


def joints_that_follow_none(root):
    names = {joint.get("name") for joint in root.iterfind("joint")}
    return {
        joint.get("name") for joint in root.iterfind("joint[mimic]") if joint.find("mimic").get("joint") not in names
    }


def joints_with_tighter_soft_limits(root):
    """Return the joints whose controllers keep them in less than their range."""
    found = set()
    for joint in root.iterfind("joint[safety_controller]"):
        hard, soft = (joint.find(tag).attrib for tag in ("limit", "safety_controller"))
        low, high = (float(soft.get(f"soft_{end}_limit", 0)) for end in ("lower", "upper"))
        ends = [float(hard[end]) if end in hard else sign * np.inf for end, sign in (("lower", -1), ("upper", 1))]
        if joint.get("type") == "continuous":
            ends = [-np.inf, np.inf]
        if low < high and (low > ends[0] or high < ends[1]):
            found.add(joint.get("name"))
    return found


def test_all_are_read_and_those_that_are_wrong_have_one_warning_that_names_what(pairs):
    assert len(files()) == 68
    for name, pair in pairs.items():
        root = ElementTree.parse(files()[name]).getroot()
        wrong = impossible_links(root) | massless_links(root, pair.model) | joints_that_follow_none(root)
        soft = joints_with_tighter_soft_limits(root)
        assert len(pair.warnings) == bool(wrong or soft), name
        assert all(x in str(pair.warnings[0].message) for x in sorted(soft)[:1] if len(soft) < 6), name
        assert pair.named == wrong, name
    assert sum(bool(pair.warnings) for pair in pairs.values()) == {68: 22, len(FEW): 7}[len(pairs)]


def test_strict_refuses_those_that_have_a_warning(pairs):
    for name, pair in pairs.items():
        if not pair.warnings:
            continue
        soft = joints_with_tighter_soft_limits(ElementTree.parse(files()[name]).getroot())
        with pytest.raises(jn.errors.RobotError) as caught:
            jn.load_robot(files()[name], strict=True)
        assert caught.value.line
        assert any(caught.value.name.split(".", 1)[1].startswith(x) for x in pair.named | soft)


@pytest.mark.slow
def test_torques_and_their_rates_are_those_of_pinocchio(pairs):
    whole = forest({name: pair.robot for name, pair in pairs.items()})
    q = random_states(whole)
    torques = jn.inverse_dynamics(whole, q, drives=False)
    last = 0
    for name, pair in pairs.items():
        first, last = last, last + len(pair.robot.joint_names)
        expected = pair.torques(q[..., first:last])
        for level in range(2):
            assert difference(torques[:, level, first:last], expected[:, level]) <= 1e-13, name


@pytest.mark.slow
def test_torques_on_a_floating_base_are_those_of_pinocchio():
    pairs = {name: Pair(path, floating_root()) for name, path in files().items()}
    whole = forest({name: pair.robot for name, pair in pairs.items()})
    q = random_states(whole)
    torques = jn.inverse_dynamics(whole, q, drives=False)
    last = 0
    for name, pair in pairs.items():
        first, last = last, last + len(pair.robot.joint_names)
        expected = pair.torques(q[..., first:last])
        assert difference(torques[:, 0, first:last], expected[:, 0]) <= 1e-12, name


@pytest.mark.slow
def test_a_base_can_be_set_free_in_all_files_of_robots_that_stand_on_none():
    for name, path in files().items():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", jn.errors.RobotWarning)
            robot = jn.load_robot(path, floating_base=True)
        assert robot.joint_names[0] == "base_x", name


def test_fingers_without_mass_need_no_torque_and_massless_links_that_carry_some_do(pairs):
    romeo = pairs["romeo_description/urdf/romeo.urdf"].robot
    moved = [romeo.joints[name].child for name in romeo.massless_joints]
    assert len(moved) == 24
    assert all("Finger" in link or "Thumb" in link for link in moved)
    assert not pairs["human_description/robots/human.urdf"].robot.massless_joints
