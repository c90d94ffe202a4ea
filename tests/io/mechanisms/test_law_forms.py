"""Every form of law in a file: of a leader, beyond its ends, and as a derivative, with its units."""

import math

import numpy as np
import pytest

import jounce as jn
from jounce.constraints import MotionLaw
from jounce.io.mechanisms.writing.writer import write_mechanism
from tests.problems.own_types import taken_back

TURNS = """
title: Laws
space: planar
parameters: {c: sqrt(2), n: 2 rad/s, end: 45 deg}
bodies:
  crank: {position: [0, 0]}
  wheel: {position: [1.4142135623730951, 0], angle: 45 deg}
joints:
  A: {type: revolute, bodies: [ground, crank], points: [[0, 0], [0, 0]]}
  B: {type: revolute, bodies: [ground, wheel], points: [[c, 0], [0, 0]]}
drivers:
  crank: {type: coordinate, bodies: [ground, crank], coordinate: angle, motion: n*t - 180*deg}
  wheel: {type: coordinate, bodies: [ground, wheel], coordinate: angle, motion: MOTION}
outputs:
  wheel: {body: wheel, quantity: angle}
time: {start: 0, stop: 1, step: 0.5}
"""
GENEVA = (
    "{start: -180 deg, piecewise: [{until: -end, expression: 45 deg}, "
    "{until: end, expression: -atan(sin(t)/(c - cos(t)))}, {until: 180 deg, expression: -45 deg}], "
    "beyond: advance, of: crank}"
)


def load(tmp_path, motion, **others):
    path = tmp_path / "laws.yaml"
    path.write_text(TURNS.replace("MOTION", motion))
    for name, text in others.items():
        (tmp_path / f"{name}.csv").write_text(text)
    return jn.load(path)


def wheel(mechanism, instants, order=2):
    return jn.solve(mechanism, instants, order=order).outputs["wheel"]


@pytest.mark.slow
def test_a_geneva_of_its_crank_over_many_turns(tmp_path):
    instants = np.array([-7.0, 0.3, math.pi / 2 + 0.1, 17.3])
    found = wheel(load(tmp_path, GENEVA), instants)
    crank = 2 * instants - math.pi
    turn = np.floor((crank + math.pi) / (2 * math.pi))
    local = crank - 2 * math.pi * turn
    moving = np.abs(local) < math.pi / 4
    c, s, k = np.cos(local), np.sin(local), math.sqrt(2)
    angle = np.where(moving, -np.arctan(s / (k - c)), -np.sign(local) * math.pi / 4) - math.pi / 2 * turn
    d = 1 + k * k - 2 * k * c
    speed = np.where(moving, -2 * (k * c - 1) / d, 0.0)
    acceleration = np.where(moving, 4 * k * (k * k - 1) * s / d**2, 0.0)
    np.testing.assert_allclose(found, np.stack([angle, speed, acceleration], axis=1), atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(
    "motion, value, speed",
    [
        ("{expression: 0.5*sin(t), of: crank}", 0.5 * math.sin(2 - math.pi), math.cos(2 - math.pi)),
        ("{expression: 1 + t/4, of: n*t}", 1.5, 0.5),
        ("{expression: 30 deg/s, derivative: 1, initial: [90 deg]}", math.pi / 2 + math.pi / 6, math.pi / 6),
        ("{expression: 2 rad, derivative: 1, of: crank}", 2 * (2 - math.pi), 4.0),
        ("{expression: 6*t, derivative: 2, initial: [1, 0.5]}", 2.5, 3.5),
        ("{piecewise: [{until: 0.5, expression: 2*t}, {expression: 1}], derivative: 1}", 0.75, 1.0),
        (
            "{profile: [{profile: constant_velocity, duration: 1 s, to: 4 rad/s}], derivative: 1, initial: [1]}",
            3.0,
            4.0,
        ),
        (
            "{profile: [{profile: dwell, duration: 2 s}], derivative: 1, initial: [10 deg, 90 deg/s]}",
            math.radians(100),
            math.pi / 2,
        ),
        ("{samples: table.csv, beyond: advance}", 3.0, 3.0),
        ("{samples: table.csv, beyond: advance, of: crank}", 3 * (2 - math.pi), 6.0),
    ],
)
def test_forms(tmp_path, motion, value, speed):
    table = "time,value\n" + "".join(f"{k / 32},{3 * k / 32}\n" for k in range(25))
    mechanism = load(tmp_path, motion, table=table)
    np.testing.assert_allclose(wheel(mechanism, [1.0], 1)[0], [value, speed], atol=1e-12)


def test_pieces_that_repeat_end_where_they_begin(tmp_path):
    with pytest.raises(jn.JounceError, match=r"do not end where they begin, but 0.4 from there"):
        load(tmp_path, "{piecewise: [{until: 0.4 s, expression: t}], beyond: repeat, derivative: 1}")


@pytest.mark.slow
@pytest.mark.parametrize(
    "motion",
    [
        GENEVA,
        "{expression: 0.5*sin(t), of: crank}",
        "{expression: n, derivative: 1, initial: [0.3], start: 1}",
        "{piecewise: [{until: 0.5, expression: 2*t}, {expression: 1}], derivative: 1, of: crank}",
        "{profile: [{profile: cycloidal, duration: 1 s, to: 4}], derivative: 1, initial: [1, 0.5], start: 1 s}",
    ],
)
def test_what_is_written_reads_the_same(tmp_path, motion):
    mechanism = load(tmp_path, motion)
    write_mechanism(mechanism, tmp_path / "written.json")
    again = jn.load(tmp_path / "written.json")
    instants = [0.2, 0.9, 1.7]
    np.testing.assert_allclose(wheel(again, instants), wheel(mechanism, instants), rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize(
    "motion, words",
    [
        ("{expression: t, beyond: repeat}", "motion.beyond: an expression has no end; write it as a piece"),
        ("{piecewise: [{until: 1, expression: t}, {expression: 1}], beyond: advance}", "the last piece has no end"),
        ("{piecewise: [{until: 1, expression: t}, {until: 0.5, expression: 1}]}", "must increase"),
        ("{piecewise: [{until: -1, expression: t}]}", "give start, which is 0 unless given"),
        ("{piecewise: [{until: 1 s, expression: t}], of: crank}", "until: .*angle"),
        ("{piecewise: [{until: 1, expression: t}], beyond: never}", "no such way|unknown way"),
        ("{expression: 3 mm, derivative: 1}", "must be angle per s"),
        ("{expression: t, initial: [1]}", "is only for a law that is given by a derivative"),
        ("{expression: t, derivative: 7}", "must be a whole number from 0 to 4"),
        ("{expression: t, derivative: 1, initial: [1, 2]}", "must be a list of at most 1 values"),
    ],
)
def test_what_cannot_be_is_named_with_its_place(tmp_path, motion, words):
    with pytest.raises(jn.errors.MechanismFileError, match=words) as error:
        load(tmp_path, motion)
    assert "laws.yaml, line 13, drivers.wheel.motion" in str(error.value)


def test_a_law_that_does_not_go_as_far_as_its_leader_is_named_before_any_computing(tmp_path):
    mechanism = load(tmp_path, "{piecewise: [{until: 90 deg, expression: t}], of: crank}")
    with pytest.raises(
        jn.errors.MechanismError, match=r"drivers.wheel.motion: its leader goes from -3.14159265 to -1.14"
    ):
        jn.solve(mechanism, [0.0, 1.0])


@pytest.mark.parametrize(
    "law",
    [
        pytest.param(
            "{profile: [{profile: cycloidal, duration: 90 deg, to: 45 deg}], beyond: hold}", marks=pytest.mark.slow
        ),
        pytest.param(
            "{piecewise: [{until: 90 deg, expression: t/2 - sin(4*t)/8}, {expression: 45 deg}]}", marks=pytest.mark.slow
        ),
        "{samples: table.csv, degree: 1, beyond: hold}",
    ],
)
def test_laws_of_own_joints_are_of_what_they_are_called_with_in_any_unit(tmp_path, law):
    joint = f"  own: {{type: law_of_an_angle, bodies: [crank, wheel], motion: {law}}}\ndrivers:"
    driver = "  wheel: {type: coordinate, bodies: [ground, wheel], coordinate: angle, motion: MOTION}\n"
    (tmp_path / "table.csv").write_text("angle [deg],value [deg]\n0,0\n45,22.5\n90,45\n")
    path = tmp_path / "own.yaml"
    path.write_text(TURNS.replace(driver, "").replace("drivers:", joint))
    with taken_back():

        class Follower(jn.joints.AbstractConstraint, type="law_of_an_angle", space="planar"):
            motion: MotionLaw

            dimensions = {"motion": "angle"}

            def residual(self, body_i, body_j, time):
                return body_j.angle - self.motion(body_i.angle)

        found = wheel(jn.load(path), [math.pi / 2 + math.pi / 8, 3.0], order=0)[:, 0]
    np.testing.assert_allclose(found, [math.pi / 8, math.pi / 4], atol=1e-12)
