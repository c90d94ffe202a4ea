"""Drives: what they may hold, and what is seen at the joint of what the motor has."""

import math

import numpy as np
import pytest

import jounce as jn


def test_inertia_and_time_constant_are_those_at_the_joint():
    drive = jn.planning.Drive(stiffness=2e4, damping=10.0, rotor_inertia=5e-5, gear_ratio=-100)
    assert drive.reflected_inertia == pytest.approx(0.5, rel=1e-15)
    assert drive.time_constant == 5e-4
    assert drive.elastic
    spindle = jn.planning.Drive(stiffness=1.0, rotor_inertia=1.0, lead=0.005)
    assert spindle.ratio == 2 * math.pi / 0.005
    assert not jn.planning.Drive(rotor_inertia=1.0).elastic
    assert jn.planning.Drive().reflected_inertia is None


@pytest.mark.parametrize(
    "values, field",
    [
        ({"stiffness": 0.0}, "stiffness"),
        ({"stiffness": -1.0}, "stiffness"),
        ({"stiffness": np.nan}, "stiffness"),
        ({"stiffness": 1.0, "damping": -1.0}, "damping"),
        ({"damping": 1.0}, "damping"),
        ({"deflection_limit": 1.0}, "deflection_limit"),
        ({"rotor_inertia": -1.0}, "rotor_inertia"),
        ({"gear_ratio": 0.0}, "gear_ratio"),
        ({"gear_ratio": 2.0, "lead": 1.0}, "gear_ratio"),
        ({"lead": -0.1}, "lead"),
    ],
)
def test_wrong_values_are_reported_by_their_names(values, field):
    with pytest.raises(jn.errors.RobotError) as raised:
        jn.planning.Drive(**values)
    assert raised.value.name == field


@pytest.mark.parametrize(
    "drives, words",
    [
        ({"shoulde": jn.planning.Drive()}, "shoulder"),
        ({"elbow": 3.0}, "must be a jn.planning.Drive"),
        ({"elbow": jn.planning.Drive(lead=0.01)}, "gear_ratio"),
        ([1.0], "mapping"),
        (None, "mapping"),
    ],
)
def test_drives_that_do_not_fit_are_refused(arm, swing, drives, words):
    with pytest.raises(jn.errors.RobotError, match=words):
        jn.planning.feedforward(arm, swing, drives)
