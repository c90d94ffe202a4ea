"""Links, joints and limits: what they accept, what they refuse and in which words."""

import dataclasses

import numpy as np
import pytest

import jounce as jn

TILTED = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.1], [0.0, 0.0, 1.0]]
MIRROR = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]


def joint(**fields):
    return jn.Joint("a", "base", "link", **fields)


def test_axes_are_normalized():
    assert joint(axis=[0, 3, 4]).axis.tolist() == [0.0, 0.6, 0.8]
    assert joint(axis=[0, 0, -1]).axis.tolist() == [0.0, 0.0, -1.0]


def test_a_fixed_joint_needs_no_axis():
    held = joint(type="fixed", axis=[0, 0, 0])
    assert not held.moving
    assert not held.turning


@pytest.mark.parametrize("kind, turning", [("revolute", True), ("continuous", True), ("prismatic", False)])
def test_kinds_of_joints(kind, turning):
    assert joint(type=kind).moving
    assert joint(type=kind).turning is turning


def test_parts_do_not_change():
    one, place = joint(position=(1, 2, 3)), np.zeros(3)
    with pytest.raises(dataclasses.FrozenInstanceError):
        one.position = place
    with pytest.raises(ValueError, match="read-only"):
        one.position[0] = 5.0
    with pytest.raises(ValueError, match="read-only"):
        joint(axis=(0, 3, 4)).axis[0] = 5.0
    other = joint(position=place)
    place[0] = 1.0
    assert other.position.tolist() == [0.0, 0.0, 0.0]


def test_limits_take_numbers_of_numpy():
    assert jn.Limits(velocity=np.float64(2.0)).velocity == 2.0
    assert jn.Limits(lower=1.0, upper=1.0).lower == 1.0
    assert type(jn.Limits(velocity=np.float64(2.0)).velocity) is float


REFUSED = [
    (lambda: jn.Limits(velocity=0.0), "velocity: must be greater than zero, got 0.0"),
    (lambda: jn.Limits(effort=-1.0), "effort: must be greater than zero, got -1.0"),
    (lambda: jn.Limits(jerk=np.nan), "jerk: must be a finite number, got nan"),
    (lambda: jn.Limits(upper=np.inf), "upper: must be a finite number, got inf"),
    (lambda: jn.Limits(lower=1.0, upper=0.0), "the lower limit must not exceed the upper one, got [1.0, 0.0]"),
    (
        lambda: joint(type="revolut"),
        "joints.a.type: no joint has this type, got 'revolut'; did you mean 'revolute'? valid: continuous, fixed, "
        "prismatic, revolute",
    ),
    (
        lambda: joint(type="floating"),
        "joints.a.type: no joint has this type, got 'floating'; valid: continuous, fixed, prismatic, revolute",
    ),
    (lambda: joint(position=[0, 0]), "joints.a.position: must have the shape (3,), not (2,)"),
    (lambda: joint(position="here"), "joints.a.position: must be real numbers, got 'here'"),
    (lambda: joint(position=np.array([1j])), "joints.a.position: must be real numbers, got array([0.+1.j])"),
    (lambda: joint(position=[0, 0, np.nan]), "joints.a.position: must be finite, got [0.0, 0.0, nan]"),
    (lambda: joint(rotation=np.eye(4)), "joints.a.rotation: must have the shape (3, 3), not (4, 4)"),
    (
        lambda: joint(rotation=TILTED),
        "joints.a.rotation: must be a rotation matrix, got [[1.0, 0.0, 0.0], [0.0, 1.0, 0.1], [0.0, 0.0, 1.0]]",
    ),
    (
        lambda: joint(rotation=MIRROR),
        "joints.a.rotation: must be a rotation matrix, got [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]",
    ),
    (lambda: joint(axis=[0, 0, 0]), "joints.a.axis: must have a direction, got [0.0, 0.0, 0.0]"),
    (lambda: joint(armature=-0.1), "joints.a.armature: must be zero or greater, got -0.1"),
    (lambda: joint(damping=np.nan), "joints.a.damping: must be finite, got nan"),
    (lambda: joint(friction=-2.0), "joints.a.friction: must be zero or greater, got -2.0"),
    (lambda: jn.robot.Mimic("b", multiplier=np.inf), "mimic.multiplier: must be finite, got inf"),
    (lambda: jn.robot.Mimic("b", offset=np.nan), "mimic.offset: must be finite, got nan"),
]


@pytest.mark.parametrize("make, message", REFUSED)
def test_refused(make, message):
    with pytest.raises(jn.errors.RobotError) as caught:
        make()
    assert str(caught.value) == message
