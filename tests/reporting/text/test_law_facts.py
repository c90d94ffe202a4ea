"""To which derivative laws are continuous, in words."""

import numpy as np
import pytest

import jounce as jn
from jounce.reporting.facts.motion_facts import motion_facts
from jounce.reporting.text.law_facts import jump_facts, law_facts, law_words


@pytest.mark.parametrize("power", [0.5, 2.5])
def test_derivatives_that_are_infinite_or_none_are_reported(power):
    result = jn.laws.continuity(jn.laws.PiecewiseMotion(["0", f"(t-1)**{power}"], until=[1.0]), 0.0, 2.0, order=1)
    law = {"of": "ram", "unit": "m", "continuous_to": result.smoothness, "remark": ""}
    (words,) = law_words([{**law, "derivatives": jump_facts(result)}])
    assert words.startswith("law of ram: continuous to position; ")
    assert all(word in words for word in ("velocity", "no finite value", "1 s"))


CAM = """
space: planar
bodies: {{shaft: {{position: [0, 0]}}, follower: {{position: [0, 40 mm], mass: 1.8 kg, inertia: 1}}}}
joints:
  bearing: {{type: revolute, bodies: [ground, shaft], points: [[0, 0], [0, 0]]}}
  guide: {{type: prismatic, bodies: [ground, follower], points: [[0, 0], [0, 0]], vectors: [[0, 1], [0, 1]]}}
drivers:
  shaft: {{type: coordinate, bodies: [ground, shaft], coordinate: angle, motion: {speed}*t}}
  cam:
    type: coordinate
    bodies: [ground, follower]
    coordinate: y
    motion:
      profile:
        - {{profile: cycloidal, duration: 120 deg, to: 10 mm}}
        - {{profile: dwell, duration: 50 deg}}
        - {{profile: cycloidal, duration: 120 deg, to: 0}}
        - {{profile: dwell, duration: {last} deg}}
      beyond: repeat
      of: shaft
forces:
  spring: {{type: slide_spring, bodies: [ground, follower], points: [[0, 0], [0, 0]], vector: [0, 1],
            stiffness: 15 N/mm, length: -2.5 mm}}
outputs: {{contact: {{driver: cam, quantity: force}}}}
time: {{start: 0, stop: 0.2, count: 81}}
"""


def cam(folder, last=70, speed="20*pi"):
    path = folder / "cam.yaml"
    path.write_text(CAM.format(last=last, speed=speed))
    return jn.load(path)


@pytest.mark.parametrize("last, part", [(50, "repeats every 340 deg of shaft"), (70, ""), (430, ""), (60, "350 deg")])
def test_a_cam_that_does_not_close_over_a_turn_is_reported(tmp_path, last, part):
    facts = {x["driver"]: x["remark"] for x in law_facts(cam(tmp_path, last), 0.0, 0.2)}
    assert facts["shaft"] == ""
    assert (part in facts["cam"]) if part else facts["cam"] == ""


@pytest.mark.slow
def test_a_contact_force_that_changes_its_sign_is_reported_as_lift_off(tmp_path):
    fast = jn.solve(cam(tmp_path, speed="200*pi/3"), [k / 2000 for k in range(60)], order=2)
    (remark,) = motion_facts(fast)["remarks"]
    assert remark.startswith("contact: changes its sign before t = ")
    assert remark.endswith("a follower that is pressed against a cam lifts off there")
    force = fast.outputs["contact"][:, 0]
    first = fast.time[1:][np.sign(force[1:]) != np.sign(force[:-1])][0]
    assert f"t = {first:.4g} s" in remark
    slow = jn.solve(cam(tmp_path, speed="2*pi"), [k / 60 for k in range(60)], order=2)
    assert motion_facts(slow)["remarks"] == []
