"""Starts of closed robots in the assembly in which they are drawn, by trigonometry, wherever their drives start."""

import warnings

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import jounce as jn

FOREARM, SPAN = 0.9, 0.6  # m; the cranks of the five-bar measure 1 m
DRAWN = np.radians([100.0, 70.0])
ROD = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])


def about_z(angle):
    return Rotation.from_euler("z", angle).as_matrix()


def five_bar_tip(angles, side):
    """Return the pins of the cranks, and the tip, where the forearms meet on one side of the line between them."""
    left, right = np.exp(1j * angles[0]), SPAN + np.exp(1j * angles[1])
    across = right - left
    height = np.sqrt(FOREARM**2 - abs(across) ** 2 / 4)
    return left, right, left + across / 2 + side * 1j * across / abs(across) * height


def five_bar(side):
    left, right, tip = five_bar_tip(DRAWN, side)
    forearms = [np.angle(tip - pin) - crank for pin, crank in zip((left, right), DRAWN, strict=True)]
    links = [jn.Link("base"), *(jn.Link(name, ROD) for name in ("a", "b", "fore_a", "fore_b"))]
    joints = [
        jn.Joint("A", "base", "a", rotation=about_z(DRAWN[0])),
        jn.Joint("B", "base", "b", position=[SPAN, 0, 0], rotation=about_z(DRAWN[1])),
        jn.Joint("P", "a", "fore_a", position=[1, 0, 0], rotation=about_z(forearms[0])),
        jn.Joint("Q", "b", "fore_b", position=[1, 0, 0], rotation=about_z(forearms[1])),
    ]
    closure = jn.robot.Closure("tip", ("fore_a", "fore_b"), points=[[FOREARM, 0, 0]] * 2)
    return jn.Robot("five-bar", links, joints, closures=[closure])


def end_of(mechanism, body, length):
    """Return where the end of a link starts, as a complex number."""
    pose = mechanism.bodies[body]
    e0, _, _, e3 = pose.orientation
    x, y, _ = pose.position
    return x + 1j * y + length * (e0 + 1j * e3) ** 2


@pytest.mark.parametrize("side, turns", [(-1, (221, 33)), (-1, (169, 61)), (-1, (136, -126)), (-1, (203, -138))])
def test_cranks_that_cannot_go_straight_to_their_start_go_elsewhere(side, turns):
    """On the straight way the forearms would have to stretch: it ended in the other assembly, without a word."""
    angles = np.radians(turns)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mechanism = five_bar(side).mechanism(drivers={"A": float(angles[0]), "B": float(angles[1])})
    expected = five_bar_tip(DRAWN + angles, side)[2]
    assert abs(end_of(mechanism, "fore_a", FOREARM) - expected) < 1e-4


def double_rocker(angle, side, lengths):
    """Return the angles of coupler and rocker at that of the crank, by the law of cosines."""
    ground, crank, coupler, rocker = lengths
    diagonal = ground - crank * np.exp(1j * angle)
    cosine = (coupler**2 + abs(diagonal) ** 2 - rocker**2) / (2 * coupler * abs(diagonal))
    along = np.angle(diagonal) + side * np.arccos(cosine)
    return along, np.angle(crank * np.exp(1j * angle) + coupler * np.exp(1j * along) - ground)


def four_bar(drawn, side, lengths):
    ground, crank, coupler, rocker = lengths
    along, last = double_rocker(drawn, side, lengths)
    links = [jn.Link("base"), *(jn.Link(name, ROD) for name in ("crank", "coupler", "rocker"))]
    joints = [
        jn.Joint("A", "base", "crank", rotation=about_z(drawn)),
        jn.Joint("B", "crank", "coupler", position=[crank, 0, 0], rotation=about_z(along - drawn)),
        jn.Joint("D", "base", "rocker", position=[ground, 0, 0], rotation=about_z(last)),
    ]
    tip = jn.robot.Closure("C", ("coupler", "rocker"), points=[[coupler, 0, 0], [rocker, 0, 0]])
    return jn.Robot("four-bar", links, joints, closures=[tip])


@pytest.mark.parametrize("side", [1, -1])
def test_a_crank_that_is_stopped_one_way_goes_the_other(side):
    """The crank cannot fold over the ground, at 0 degrees, but can turn through 180."""
    lengths = (1.0, 1.0, 1.7, 0.9)  # at 0 degrees the ends of coupler and rocker would be less than 0.8 m apart
    drawn, turn = np.radians(120.0), np.radians(-240.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mechanism = four_bar(drawn, side, lengths).mechanism(drivers={"A": float(turn)})
    along, _ = double_rocker(drawn + turn, side, lengths)
    tip = np.exp(1j * (drawn + turn)) + lengths[2] * np.exp(1j * along)
    assert abs(end_of(mechanism, "coupler", lengths[2]) - tip) < 1e-4


def test_a_start_that_no_way_leads_to_is_reported():
    """Driven by its rocker, a crank-rocker is drawn above the ground, and starts below it: another circuit."""
    lengths = (3.0, 2.0, 3.0, 1.0)  # the driven link is the one that cannot turn round
    drawn = np.radians(100.0)
    robot = four_bar(drawn, 1, lengths)
    with pytest.warns(jn.errors.AssemblyWarning, match=r"four-bar: the loops, .* driven joints \(A\) moved"):
        robot.mechanism(drivers={"A": float(np.radians(-160.0))})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        robot.mechanism({"B": 0.1, "D": 0.1}, drivers={"A": -0.1})
