"""Orientations against SciPy."""

import itertools
import math

import hypothesis
import hypothesis.strategies as st
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jounce.errors import MechanismError
from jounce.rigid.euler_parameters import from_axis_angle, from_euler, from_quaternion

SEQUENCES = ["".join(s) for s in itertools.product("xyz", repeat=3) if s[0] != s[1] != s[2]]
angles = st.floats(-7, 7, allow_nan=False)


def agree(ours, rotation):
    """Quaternions are equal up to their sign, which does not affect the attitude."""
    theirs = rotation.as_quat(scalar_first=True)
    np.testing.assert_allclose(np.outer(ours, ours), np.outer(theirs, theirs), atol=3e-15)


def test_there_are_twelve_sequences():
    assert len(SEQUENCES) == 12


@pytest.mark.parametrize("sequence", SEQUENCES + [s.upper() for s in SEQUENCES])
@hypothesis.given(a=angles, b=angles, c=angles)
@hypothesis.settings(max_examples=10)
def test_euler_angles_turn_as_scipy_says(sequence, a, b, c):
    agree(from_euler(sequence, [a, b, c]), Rotation.from_euler(sequence, [a, b, c]))


@hypothesis.given(axis=st.tuples(*[st.floats(-5, 5)] * 3).filter(lambda v: math.hypot(*v) > 1e-3), angle=angles)
def test_axis_and_angle_turn_as_scipy_says(axis, angle):
    unit = np.array(axis) / np.linalg.norm(axis)
    agree(from_axis_angle(axis, angle), Rotation.from_rotvec(angle * unit))


def test_lower_case_is_fixed_and_upper_case_moving():
    quarter = math.pi / 2
    fixed, moving = from_euler("zxz", [quarter, quarter, 0.0]), from_euler("ZXZ", [quarter, quarter, 0.0])
    np.testing.assert_allclose(fixed, [0.5, 0.5, -0.5, 0.5], atol=1e-15)
    np.testing.assert_allclose(moving, [0.5, 0.5, 0.5, 0.5], atol=1e-15)


def test_quaternions_are_normalized():
    assert from_quaternion([0.0, 3.0, 0.0, 4.0]) == (0.0, 0.6, 0.0, 0.8)


@pytest.mark.parametrize(
    "call, words",
    [
        (lambda: from_quaternion([0.0, 0.0, 0.0, 0.0]), "the Euler parameters must not be of zero length"),
        (lambda: from_axis_angle([0.0, 0.0, 0.0], 1.0), "the axis must not be of zero length"),
        (lambda: from_axis_angle([math.inf, 0.0, 0.0], 1.0), "must be finite"),
        (lambda: from_euler("zxq", [1.0, 1.0, 1.0]), "write three letters"),
        (lambda: from_euler("zXz", [1.0, 1.0, 1.0]), "write three letters"),
        (lambda: from_euler("zz", [1.0, 1.0, 1.0]), "write three letters"),
        (lambda: from_euler("zzx", [1.0, 1.0, 1.0]), "neighbors different"),
    ],
)
def test_nonsense_is_refused(call, words):
    with pytest.raises(MechanismError, match=words):
        call()
