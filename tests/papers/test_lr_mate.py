"""The robot that Negrean 2025 measured: its published lengths, and the closed forms 144-146 for its arm."""

import pathlib

import numpy as np

import jounce as jn
from jounce.papers import negrean_2025
from jounce.papers.negrean_2025.closed_forms import gravity_torques

EXAMPLES = pathlib.Path(__file__).parents[2] / "examples"
ROBOT = jn.load_robot(EXAMPLES / "robots" / "lr_mate.urdf")
SWING = jn.load_trajectory(EXAMPLES / "trajectories" / "lr_mate_swing.yaml")


def test_reach_is_the_sum_of_the_published_lengths():
    assert ROBOT.joint_names == ("J1", "J2", "J3", "J4", "J5")
    up, forward = [0.0, 0.0, 0.0, 0.0, 0.0], [0.0, np.pi / 2, np.pi / 2, 0.0, 0.0]
    places = [jn.forward_kinematics(ROBOT, [q], "tool").position[0] for q in (up, forward)]
    np.testing.assert_allclose(places[0], [0.150 + 0.220 + 0.080, 0.0, 0.350 + 0.250], atol=1e-15)
    np.testing.assert_allclose(places[1], [0.150 + 0.250 + 0.220 + 0.080, 0.0, 0.350], atol=1e-15)


def test_swing_is_the_motion_of_the_paper():
    q = SWING.derivatives(np.array([0.0, 1.7]), order=3)
    third = SWING.names.index("J3")
    np.testing.assert_allclose(q[:, 0, third], [0.0, np.pi], atol=1e-14)
    np.testing.assert_allclose(q[:, 1:], 0.0, atol=1e-10)


def test_equations_144_to_146_for_the_third_axis():
    """Forearm, wrist and flange turn as one body about a level axis; signs are those of the paper."""
    q = SWING.derivatives(np.linspace(0.1, 1.6, 7), order=4)
    third = SWING.names.index("J3")
    found = jn.inverse_dynamics(ROBOT, q, drives=False)[..., third]
    offsets = {"forearm": 0.0, "wrist": 0.220, "flange": 0.220}  # of the frames at zero, along the forearm
    mass, moment, inertia = 0.0, np.zeros(3), 0.0
    for name, offset in offsets.items():
        link = ROBOT.links[name].inertia
        center = np.array(link.center_of_mass) + np.array([offset, 0.0, 0.0])
        mass, moment = mass + link.mass, moment + link.mass * center
        inertia += np.array(link.tensor)[1, 1] + link.mass * (center[0] ** 2 + center[2] ** 2)
    center = moment / mass
    lean = np.radians(20)  # of the upper arm, and with it of the zero of J3; the paper's angle turns down
    motion = -q[:, :, third]
    motion[:, 0] += lean
    gravity = gravity_torques(mass, (center[0], center[2]), 9.81, motion)
    np.testing.assert_allclose(-found, negrean_2025.torques(inertia, motion, gravity), rtol=1e-12, atol=1e-11)
