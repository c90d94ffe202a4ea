"""Plate cams as they are drawn: the pitch curve on the disc."""

import pathlib

import numpy as np
import pytest

import jounce as jn
from jounce.plot.drawings.cams import cam_disc, pitch_curve
from jounce.plot.drawings.frames import frames, points_at, within

EXAMPLES = pathlib.Path(__file__).parents[3] / "examples"


@pytest.mark.slow
def test_the_pitch_curve_is_as_far_from_the_shaft_as_the_law_says():
    mechanism = jn.load(EXAMPLES / "camshaft.yaml")
    motion = jn.solve(mechanism, np.linspace(0, 0.3, 91), order=0)
    (disc, follower), points = cam_disc(mechanism, mechanism.joints["cam"])
    whole = frames(motion)
    pitch, is_whole = pitch_curve(within(whole[disc], points_at(whole[follower], points[1])))
    assert is_whole
    angle = 2 * np.pi * motion.time / 0.3  # of the shaft; the follower, straight above, goes round the disc in reverse
    np.testing.assert_allclose(np.unwrap(np.arctan2(pitch[:, 1], pitch[:, 0])), np.pi / 2 - angle, atol=1e-12)
    distance = np.linalg.norm(pitch, axis=1)
    np.testing.assert_allclose(distance, motion.outputs["roller"][:, 0, 1], rtol=1e-14)
    dwell = (angle > np.pi / 2 + 1e-9) & (angle < np.pi - 1e-9)
    np.testing.assert_allclose(distance[dwell], 0.046 + 0.015, rtol=1e-13)


def test_a_part_of_a_turn_is_open_and_what_failed_is_left_out():
    angle = np.linspace(0, 3, 31)
    visited = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    visited[4] = np.nan
    pitch, is_whole = pitch_curve(visited)
    assert not is_whole
    assert len(pitch) == 30


def test_followers_that_rock_and_other_joints_have_no_disc():
    pump = jn.load(EXAMPLES / "four_bar.yaml")
    assert cam_disc(pump, pump.joints["A"]) is None
