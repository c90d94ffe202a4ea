"""Flat faces and rockers on cams with loads: contact, lift-off and springs in closed form, forces where they touch."""

import dataclasses
import math

import numpy as np
import pytest

import jounce as jn

LIFT, SPEED, STIFFNESS, INERTIA, MASS, RATE = 0.2, 60.0, 8.0, 0.004, 0.3, 300.0
FILE = f"""
space: planar
parameters: {{twist: -0.25, free: -30 mm, speed: {SPEED}}}
bodies:
  shaft: {{position: [0, 0], mass: 1, inertia: 0.001}}
  rocker: {{position: [0.11, 0], mass: 1, inertia: {INERTIA}}}
  tappet: {{position: [0, 0.04], mass: {MASS}, inertia: 0.001}}
joints:
  axle: {{type: revolute, bodies: [ground, shaft], points: [[0, 0], [0, 0]]}}
  pivot: {{type: revolute, bodies: [ground, rocker], points: [[0.11, 0], [0, 0]]}}
  guide: {{type: prismatic, bodies: [ground, tappet], points: [[0, 0], [0, 0]], vectors: [[0, 1], [0, 1]]}}
  rocks: {{type: coordinate, bodies: [ground, rocker], coordinate: angle,
    motion: {{expression: {LIFT}*(1 - cos(t))/2, of: axle}}}}
  lifts: {{type: coordinate, bodies: [ground, tappet], coordinate: y, offset: 40 mm,
    motion: {{expression: 0.01*(1 - cos(t)), of: axle}}}}
drivers:
  motor: {{type: coordinate, bodies: [ground, shaft], coordinate: angle, motion: speed*t}}
forces:
  torsion: {{type: torsional_spring, bodies: [ground, rocker], stiffness: {STIFFNESS}, angle: twist}}
  spring: {{type: slide_spring, bodies: [ground, tappet], points: [[0, 40 mm], [0, 0]], vector: [0, 1],
    stiffness: {RATE}, length: free}}
outputs:
  on_rocker: {{joint: rocks, quantity: contact_torque}}
  on_tappet: {{joint: lifts, quantity: contact}}
  motor: {{driver: motor, quantity: torque}}
time: {{start: 0, stop: 0.1, count: 101}}
"""


@pytest.fixture(scope="module")
def mechanism(tmp_path_factory):
    path = tmp_path_factory.mktemp("cams") / "followers.yaml"
    path.write_text(FILE)
    return jn.load(path)


def contacts(theta, twist=-0.25, free=-0.03):
    """Torque on the rocker and force on the tappet: D'Alembert."""
    rocker = INERTIA * SPEED**2 * LIFT / 2 * np.cos(theta) + STIFFNESS * (LIFT * (1 - np.cos(theta)) / 2 - twist)
    tappet = MASS * SPEED**2 * 0.01 * np.cos(theta) + RATE * (0.01 * (1 - np.cos(theta)) - free)
    return rocker, tappet


@pytest.mark.slow
def test_contacts_and_the_torque_of_the_shaft(mechanism):
    time = np.array([0.003, 0.02, 0.047, 0.09])
    found = jn.solve(mechanism, time, order=0).outputs
    theta = SPEED * time
    rocker, tappet = contacts(theta)
    np.testing.assert_allclose(found["on_rocker"][:, 0], rocker, rtol=1e-11)
    np.testing.assert_allclose(found["on_tappet"][:, 0], tappet, rtol=1e-11)
    torque = rocker * LIFT / 2 * np.sin(theta) + tappet * 0.01 * np.sin(theta)
    np.testing.assert_allclose(found["motor"][:, 0], torque, rtol=1e-11, atol=1e-13)


@pytest.mark.parametrize("kind", ["rocker", "tappet"])
def test_the_force_at_the_point_where_a_flat_face_touches_has_the_power_of_the_law(kind):
    """Along the normal there: its moments about shaft and pivot are to each other as the law says."""
    law = f"{LIFT}*(1 - cos(t))/2" if kind == "rocker" else "0.01*(1 - cos(t))"
    rocks = jn.cams.OscillatingFollower("flat_face", center_distance=0.11, face_offset=0.005)
    slides = jn.cams.TranslatingFollower("flat_face")
    cam = jn.cams.plate_cam(law, rocks if kind == "rocker" else slides, base_radius=0.04)
    theta = np.array([0.4, 1.3, 2.9, 4.4])
    there = cam.at(theta)
    slope = (LIFT / 2 if kind == "rocker" else 0.01) * np.sin(theta)
    contact = there.profile.T  # in the frame of the cam
    ahead, behind = (cam.at(angle).profile.T for angle in (theta + 1e-5, theta - 1e-5))
    tangent = (ahead - behind) / np.linalg.norm(ahead - behind, axis=1)[:, None]
    normal = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)
    about_shaft = contact[:, 0] * normal[:, 1] - contact[:, 1] * normal[:, 0]
    about_pivot = 1.0  # of a tappet: the normal is along the travel
    if kind == "rocker":
        c, s = np.cos(theta), np.sin(theta)
        arm = contact - 0.11 * np.stack([c, -s], axis=1)  # from the pivot, which goes round the cam in reverse
        about_pivot = arm[:, 0] * normal[:, 1] - arm[:, 1] * normal[:, 0]
    rtol = {"tappet": 1e-7, "rocker": 1e-6}[kind]
    np.testing.assert_allclose(np.abs(about_shaft / about_pivot), np.abs(slope), rtol=rtol)


@pytest.mark.parametrize("count", [101, 48], ids=["an instant at the end of the lift", "none there"])
def test_springs_that_just_keep_the_followers_on_their_cams(mechanism, count):
    """The least contact is at the end of the lift, where the cam lets go of the follower fastest."""
    turn = np.linspace(0, 2 * np.pi / SPEED, count)
    least = jn.dynamics.contact_spring(mechanism, "rocks", "torsion", turn)
    assert least.free == pytest.approx(LIFT - INERTIA * SPEED**2 * LIFT / 2 / STIFFNESS, rel=1e-9)
    rocker, tappet = contacts(math.pi)
    assert least.margin == pytest.approx(rocker, rel=1e-9)
    least = jn.dynamics.contact_spring(mechanism, "lifts", "spring", turn)
    assert least.free == pytest.approx(0.02 - MASS * SPEED**2 * 0.01 / RATE, rel=1e-9)
    assert least.margin == pytest.approx(tappet, rel=1e-9)


def test_followers_that_lift_off_are_named_with_the_instant(mechanism):
    """With weaker springs both lift off near the end of the lift: at the angles where the contact is zero."""
    weak = dataclasses.replace(mechanism, parameters={**mechanism.parameters, "twist": 0.1, "free": -0.01})
    found = jn.solve(weak, order=0)
    theta = SPEED * found.time
    for name, exact in zip(("on_rocker", "on_tappet"), contacts(theta, 0.1, -0.01), strict=True):
        np.testing.assert_allclose(found.outputs[name][:, 0], exact, rtol=1e-10, atol=1e-10)
        change = found.time[1:][np.sign(exact[1:]) != np.sign(exact[:-1])][0]
        comment = found.dataset[name].attrs["comment"]
        assert f"changes its sign before t = {change:.4g} s" in comment
        assert "lifts off there" in comment


@pytest.mark.slow
def test_the_jump_speed_is_that_of_the_handbook():
    """Where spring and weight just hold the mass to a modified sine, whose formulas are those of Norton 2002."""
    camshaft, u = jn.load("examples/camshaft.yaml"), np.linspace(1 / 8, 7 / 8, 200001)
    phase, rise, turn = 4 * np.pi * u / 3 + np.pi / 3, 0.015, np.pi / 2
    lift = rise / (4 + np.pi) * (2 + np.pi * u - 9 / 4 * np.sin(phase))
    bend = rise / (4 + np.pi) * 4 * np.pi**2 * np.sin(phase) / turn**2  # second derivative by the angle
    falling = bend < 0
    speed = np.sqrt(((9.81 + 5000.0 * (0.046 + lift - 0.030)) / -np.where(falling, bend, -1e-9))[falling].min())
    for share, held in ((0.999, True), (1.001, False)):
        time = np.linspace(0.0, 2 * np.pi / (share * speed), 361)
        spring = jn.dynamics.contact_spring(camshaft.with_parameters(speed=share * speed), "cam", "spring", time)
        assert (spring.margin > 0) == held
        assert abs(spring.margin) < 0.5  # N, of a preload of 80
