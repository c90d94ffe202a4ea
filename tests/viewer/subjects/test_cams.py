"""Plate cams in the view: the follower touches the outline of the cam at every instant that is shown."""

import numpy as np
import pytest

import jounce as jn
from jounce.viewer import view
from jounce.viewer.subjects.cams import CamSubject

FOLLOWERS = [
    (jn.cams.TranslatingFollower("roller", radius=0.008, offset=0.005), 0.009),
    (jn.cams.TranslatingFollower("knife_edge"), 0.009),
    (jn.cams.TranslatingFollower("flat_face"), 0.003),
    (jn.cams.OscillatingFollower("roller", center_distance=0.08, arm=0.07, radius=0.01), 0.1),
    (jn.cams.OscillatingFollower("knife_edge", center_distance=0.08, arm=0.07), 0.1),
    (jn.cams.OscillatingFollower("flat_face", center_distance=0.08, face_offset=0.002), 0.05),
]
CASES = [(*case, "clockwise") for case in FOLLOWERS] + [(*FOLLOWERS[k], "counterclockwise") for k in (0, 5)]


def turned(points, angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]]) @ points


@pytest.mark.slow
@pytest.mark.parametrize("follower, rise, sense", CASES)
def test_the_follower_touches_the_cam(follower, rise, sense):
    """Nothing of the outline is within what the follower shows, and some point of it is on its edge."""
    segments = [("dwell", 2.0, {}), ("cycloidal", 1.5, {"by": rise}), ("cycloidal", 1.5, {"by": -rise})]
    law = jn.laws.SegmentedMotion(
        [jn.laws.Segment(name, long, **given) for name, long, given in segments], beyond="hold"
    )
    cam = jn.cams.plate_cam(law, follower, base_radius=0.03, sense=sense)
    seen = CamSubject(cam).solve({}, 2)
    assert not seen.notice
    assert {"cam", "follower"} <= seen.appearance.meshes.keys()
    face = -getattr(follower, "face_offset", 0.0)
    tip = np.array([-follower.arm if follower.turning else 0.0, 0.0])
    for k in range(0, 361, 20):
        cam_angle, follower_angle = (2 * np.arctan2(seen.quaternion[k, b, 3], seen.quaternion[k, b, 0]) for b in (1, 2))
        outline = turned(cam.table.profile, cam_angle) - seen.position[k, 2, :2, None]
        outline = turned(outline, -follower_angle)
        away = face - outline[1] if follower.is_flat else np.hypot(*(outline - tip[:, None])) - follower.radius
        assert away.min() == pytest.approx(0.0, abs=1e-12)


def test_a_cam_has_neither_modes_nor_a_trajectory():
    with pytest.raises(jn.JounceError, match="neither modes nor a trajectory"):
        view(jn.cams.load_cam("examples/cams/intake.yaml"), modes=True, open_page=False)
