"""What mechanisms look like: points, bars and symbols, against facts of the files."""

import pathlib

import numpy as np
import pytest

import jounce as jn
from jounce.mechanism.carriages import carriage_of
from jounce.plot.drawings.frames import assembled, frames, guessed, points_at, within
from jounce.plot.drawings.geometry import skeleton
from jounce.plot.drawings.scene import scene_of

ROOT = pathlib.Path(__file__).resolve().parents[3]
FILES = sorted((ROOT / "examples").glob("*.yaml"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_example_can_be_seen(path):
    mechanism = jn.load(path)
    seen = skeleton(mechanism)
    carriages = {carriage_of(name) for name in mechanism.joints}  # of curves: they are no bodies that one sees
    assert set(seen.links) == {"ground", *mechanism.bodies} - carriages
    assert [symbol.name for symbol in seen.symbols] == list(mechanism.joints)
    assert [symbol.name for symbol in seen.drivers] == list(mechanism.drivers)
    assert [symbol.name for symbol in seen.forces] == list(mechanism.forces)
    assert 0 < seen.size < np.inf
    components = 2 if mechanism.space == "planar" else 3
    for body, link in seen.links.items():
        assert link.points.shape == (len(link.names), components)
        assert len(link.points) >= 1
        assert bool(link.edges) == (len(link.points) > 1 and body != "ground")
        touched = {index for edge in link.edges for index in edge}
        if len(link.edges) == len(touched) - 1:  # a chain or a tree, not the outline of a plate
            assert touched == set(range(len(link.points)))
        assert max(touched, default=0) < len(link.points)
        for first in range(len(link.points)):
            for second in range(first):
                assert np.linalg.norm(link.points[first] - link.points[second]) > 1e-9 * seen.size
    for symbol in (*seen.symbols, *seen.drivers, *seen.forces):
        assert len(symbol.bodies) == len(symbol.points) == len(symbol.axes) == len(symbol.radii)
        assert all(np.isfinite(point).all() for point in symbol.points)


def test_points_that_coincide_are_one():
    seen = skeleton(jn.load(ROOT / "examples" / "andrews.yaml"))
    k2 = seen.links["K2"]
    names = {names: point.tolist() for names, point in zip(k2.names, k2.points, strict=True)}
    assert names[("P3", "P4", "P6")] == [-0.028, 0.0]
    assert len(k2.points) == 2
    k3 = seen.links["K3"]  # a plate: pins at B and P3, and the spring
    assert len(k3.points) == 3
    assert len(k3.edges) == 3
    assert {name for names in k3.names for name in names} == {"B", "P3", "spring"}


def test_outline_of_a_plate_leaves_out_what_lies_inside():
    bodies = {"plate": jn.Body([0, 0])}
    corners = [[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.4]]
    outputs = {f"p{k}": jn.outputs.PointOutput("plate", point) for k, point in enumerate(corners)}
    joints = {"pin": jn.planar.Revolute(("ground", "plate"), point_i=[0, 0], point_j=[0, 0])}
    link = skeleton(jn.Mechanism(space="planar", bodies=bodies, joints=joints, outputs=outputs)).links["plate"]
    assert sorted(map(sorted, link.edges)) == [[0, 1], [0, 3], [1, 2], [2, 3]]
    on_a_line = {f"p{k}": jn.outputs.PointOutput("plate", [x, x]) for k, x in enumerate((2.0, 1.0, 3.0))}
    link = skeleton(jn.Mechanism(space="planar", bodies=bodies, joints=joints, outputs=on_a_line)).links["plate"]
    assert sorted(map(sorted, link.edges)) == [[0, 2], [1, 2], [1, 3]]  # a chain: 0, 1, 2, 3 m


def test_points_in_space_are_a_plate_or_a_tree():
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.1, 0.1, 2.0]]
    joints = {"ball": jn.spatial.Spherical(("ground", "body"), point_i=[0, 0, 0], point_j=[0, 0, 0])}

    def edges(count):
        outputs = {f"p{k}": jn.outputs.PointOutput("body", corner) for k, corner in enumerate(corners[:count])}
        bodies = {"body": jn.Body([0, 0, 0])}
        return (
            skeleton(jn.Mechanism(space="spatial", bodies=bodies, joints=joints, outputs=outputs)).links["body"].edges
        )

    assert sorted(map(sorted, edges(3))) == [[0, 1], [0, 2], [1, 2]]
    assert sorted(map(sorted, edges(5))) == [[0, 1], [0, 2], [0, 3], [3, 4]]
    platform = skeleton(jn.load(ROOT / "examples" / "stewart_platform.yaml")).links["platform"]
    held = {k for k, names in enumerate(platform.names) if any(name.startswith("leg") for name in names)}
    assert {k for edge in platform.edges[:6] for k in edge} == held  # its outline passes the six legs
    assert len(platform.edges) == 8  # and bars lead to the two outputs


def test_a_body_with_one_pin_reaches_to_its_center_of_mass():
    seen = skeleton(jn.load(ROOT / "examples" / "double_pendulum.yaml"))
    np.testing.assert_array_equal(seen.links["lower"].points, [[0, 0], [1, 0]])
    bare = jn.Mechanism(
        space="planar",
        bodies={"rod": jn.Body([0, 0], mass=1.0, center_of_mass=["l", 0])},
        joints={"pin": jn.planar.Revolute(("ground", "rod"), point_i=[0, 0], point_j=[0, 0])},
        parameters={"l": 2.0},
    )
    link = skeleton(bare).links["rod"]
    np.testing.assert_array_equal(link.points, [[0, 0], [2, 0]])
    assert link.names == (("pin",), ())


def test_gears_touch_at_their_pitch_circles():
    seen = skeleton(jn.load(ROOT / "examples" / "epicyclic.yaml"))
    gears = {symbol.name: symbol for symbol in seen.symbols if symbol.kind == "gear"}
    np.testing.assert_allclose(gears["sun_planet"].radii[:2], [0.024, 0.018], rtol=1e-12)
    np.testing.assert_allclose(gears["planet_ring"].radii[:2], [0.018, 0.060], rtol=1e-12)
    (mesh,) = (s for s in skeleton(jn.load(ROOT / "examples" / "gear_pair.yaml")).symbols if s.kind == "gear")
    np.testing.assert_allclose(mesh.radii, [0.2, 0.1], rtol=1e-12)
    (rack,) = (s for s in skeleton(jn.load(ROOT / "examples" / "rack_pinion.yaml")).symbols if s.kind == "rack")
    pinion = jn.load(ROOT / "examples" / "rack_pinion.yaml").parameter_values["R"]
    assert rack.radii == (pinion, None)
    assert [wheel.radius for wheel in skeleton(jn.load(ROOT / "examples" / "rack_pinion.yaml")).wheels] == [pinion]


def test_wheels_axes_and_parameters():
    mechanism = jn.load(ROOT / "examples" / "rolling_disc.yaml")
    seen = skeleton(mechanism)
    (roll,) = (symbol for symbol in seen.symbols if symbol.kind == "rolling")
    assert [wheel.radius for wheel in seen.wheels] == [mechanism.parameter_values["R"]]
    np.testing.assert_array_equal(roll.axes[0], [-0.5, 0])
    (wheel,) = skeleton(mechanism.with_parameters(R=0.123)).wheels
    assert (wheel.body, wheel.radius, wheel.internal, wheel.partner) == (roll.bodies[1], 0.123, False, None)
    hooke = skeleton(jn.load(ROOT / "examples" / "hooke_joint.yaml"))
    cross = next(symbol for symbol in hooke.symbols if symbol.kind == "universal")
    np.testing.assert_array_equal(np.array(cross.axes), [[0, 1, 0], [0, 0, 1]])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["four_bar", pytest.param("rssr", marks=pytest.mark.slow)])
def test_frames_agree_with_points_of_the_motion(name):
    mechanism = jn.load(ROOT / "examples" / f"{name}.yaml")
    motion = jn.solve(mechanism, np.linspace(0.0, 0.1, 5), order=2)
    body = next(iter(mechanism.bodies))
    points = skeleton(mechanism).links[body].points
    whole = frames(motion)
    found = points_at(whole[body], points)
    assert found.shape == (5, *points.shape)
    for k, point in enumerate(points):
        np.testing.assert_allclose(found[:, k], motion.point(body, point.tolist()).values[:, 0], rtol=0, atol=1e-12)
        np.testing.assert_allclose(within(whole[body], found[:, k]), [point] * 5, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(points_at(whole["ground"], points), [points] * 5)
    np.testing.assert_allclose(assembled(mechanism)[body][0], whole[body][0], rtol=0, atol=1e-8)
    (start,) = points_at(guessed(mechanism)[body], points)
    assert np.linalg.norm(start - found[0]) < 0.5 * skeleton(mechanism).size


def test_instants_that_failed_are_nowhere():
    mechanism = jn.load(ROOT / "examples" / "four_bar.yaml").with_parameters(BC=0.11)
    motion = jn.solve(mechanism, np.linspace(0.0, 2.0, 21), order=1, strict=False)
    assert np.any(motion.status != 0)
    found = points_at(frames(motion)["crank"], np.array([0.04, 0.0]))
    np.testing.assert_array_equal(np.isnan(found).any(axis=1), motion.status != 0)


def test_a_carrier_hides_no_gear():
    shapes = scene_of(jn.load(ROOT / "examples" / "planetary_train.yaml")).shapes
    filled = {body: [s.layer for s in shapes if s.owner == f"bodies.{body}" and s.fill] for body in ("carrier", "sun")}
    assert max(filled["carrier"]) < min(filled["sun"])
