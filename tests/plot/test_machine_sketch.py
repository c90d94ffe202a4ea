"""Sketches, animations and portraits: what is drawn where, against the motion itself."""

import itertools
import pathlib
import re

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from PIL import Image

import jounce as jn
from jounce.plot import animate, check_animation, hodograph, phase_portrait, save, sketch
from jounce.plot.animation import frame_instants
from jounce.plot.drawings.drawing import screen_of
from jounce.plot.drawings.scene import scene_of
from jounce.plot.style import BODY_COLORS

ROOT = pathlib.Path(__file__).resolve().parents[2]
QUICK = ("four_bar", "epicyclic", "rack_pinion")
FILES = [
    pytest.param(path, id=path.stem, marks=() if path.stem in QUICK else pytest.mark.slow)
    for path in sorted((ROOT / "examples").glob("*.yaml"))
]


@pytest.fixture(scope="module")
def four_bar():
    return jn.solve(jn.load(ROOT / "examples" / "four_bar.yaml"), np.linspace(0.0, 2.0, 41), order=3)


@pytest.fixture(scope="module")
def hooke():
    mechanism = jn.load(ROOT / "examples" / "hooke_joint.yaml")
    return jn.solve(mechanism, np.linspace(0.0, 0.5, 11), order=1)


def artists(figure, owner):
    axes = figure.axes[0]
    return [artist for artist in (*axes.lines, *axes.patches) if artist.get_gid() == owner]


@pytest.mark.slow
@pytest.mark.parametrize("path", FILES)
def test_every_example_has_all_its_bodies_and_joints(path):
    mechanism = jn.load(path)
    scene = scene_of(mechanism)
    assert all(np.isfinite(shape.points).all() for shape in scene.shapes)
    drawn = {shape.owner for shape in scene.shapes}
    # they keep directions, or their gears and wheels stand for them, which are drawn as bodies
    unseen = ("dot1", "parallel1", "coordinate", "gear", "wheel")
    for name, joint in mechanism.joints.items():
        assert f"joints.{name}" in drawn or joint.type_name in unseen or joint.type_name == "revolute"
    for kind in ("drivers", "forces"):
        for name in mechanism.elements[kind]:
            assert f"{kind}.{name}" in drawn
    assert {label.text for label in scene.labels} >= set(mechanism.rigid_bodies)
    left, right, lower, upper = scene.limits
    assert right > left
    assert upper > lower


@pytest.mark.slow
def test_links_and_pins_are_where_the_bodies_are(four_bar):
    figure = sketch(four_bar, 0.52)  # nearest: t = 0.5 s
    (bar,) = artists(figure, "bodies.rocker")
    at = int(np.argmin(np.abs(four_bar.time - 0.5)))
    np.testing.assert_allclose(bar.get_xydata(), [[0.1321, 0.0], four_bar.outputs["C"][at, 0]], rtol=0, atol=1e-12)
    assert bar.get_color() == BODY_COLORS[1]
    centers = [patch.get_center() for patch in artists(figure, "joints.BC") if hasattr(patch, "get_center")]
    assert any(np.allclose(center, four_bar.outputs["C"][at, 0], rtol=0, atol=1e-12) for center in centers)
    (axes,) = figure.axes
    assert axes.get_aspect() == 1.0
    curves = [line for line in axes.lines if len(line.get_xdata()) == 41]
    np.testing.assert_allclose(curves[0].get_xydata(), four_bar.outputs["C"][:, 0], rtol=0, atol=1e-15)


def test_the_scale_is_a_tenth_to_a_fifth_of_the_machine():
    for name in QUICK:
        figure = sketch(jn.load(ROOT / "examples" / f"{name}.yaml"), names="none")
        (bar,) = [line for line in figure.axes[0].lines if line.get_gid() == "scale"]
        left, right, lower, upper = scene_of(jn.load(ROOT / "examples" / f"{name}.yaml")).limits
        assert 0.1 <= np.ptp(bar.get_xdata()) / max(right - left, upper - lower) <= 0.2


def names_in(figure):
    return [text for text in figure.axes[0].texts if str(text.get_gid()).startswith("name.")]


def test_names_are_all_there_and_none_covers_another(four_bar):
    andrews = sketch(jn.load(ROOT / "examples" / "andrews.yaml"))
    for figure, expected in (
        (sketch(four_bar), {"crank", "rocker", "A", "D", "BC", "C"}),
        (andrews, {"K1", "K7", "O", "P6"}),
    ):
        texts = names_in(figure)
        assert expected <= {text.get_text() for text in texts}
        figure.draw_without_rendering()
        boxes = [text.get_window_extent() for text in texts]
        for first, second in itertools.combinations(boxes, 2):
            across = min(first.x1, second.x1) - max(first.x0, second.x0)
            upward = min(first.y1, second.y1) - max(first.y0, second.y0)
            assert across < 1.0 or upward < 1.0
    assert {text.get_text() for text in names_in(sketch(four_bar, names="outputs"))} == {"C"}
    bodies = sketch(four_bar, names="bodies")
    assert {t.get_text() for t in names_in(bodies)} == {"crank", "rocker"}
    assert not names_in(sketch(four_bar, names="none"))


def test_paths_are_colored_by_the_size_of_a_derivative(four_bar):
    figure = sketch(four_bar, order=3)
    (collection,) = [c for c in figure.axes[0].collections if isinstance(c, LineCollection)]
    size = np.linalg.norm(four_bar.outputs["C"][:, 3], axis=-1)
    np.testing.assert_allclose(collection.get_array(), 0.5 * (size[1:] + size[:-1]), rtol=1e-12)
    assert figure.axes[1].get_ylabel() == "jerk of C  (m/s$^3$)"
    assert not [c for c in sketch(four_bar, paths=[]).axes[0].collections if isinstance(c, LineCollection)]


@pytest.mark.slow
def test_a_spatial_mechanism_is_seen_from_the_side_asked_for(hooke):
    view = (-90.0, 0.0)  # x to the right, z upward
    figure = sketch(hooke, 0.25, view=view)
    rim = hooke.outputs["rim"][5, 0]
    (dot,) = artists(figure, "outputs.rim")
    np.testing.assert_allclose(dot.get_center(), [rim[0], rim[2]], rtol=0, atol=1e-12)
    assert {"x", "y", "z"} <= {text.get_text() for text in figure.axes[0].texts}
    axes = screen_of((17.0, 33.0))
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), rtol=0, atol=1e-15)
    np.testing.assert_allclose(np.cross(axes[0], axes[1]), axes[2], rtol=0, atol=1e-15)


def test_gears_are_circles_that_touch():
    scene = scene_of(jn.load(ROOT / "examples" / "epicyclic.yaml"))
    discs = {s.owner: s for s in scene.shapes if s.kind == "disc" and s.owner.startswith("bodies.") and s.fill}
    sun, planet = discs["bodies.sun"], discs["bodies.planet"]
    assert (round(sun.radius, 9), round(planet.radius, 9)) == (0.024, 0.018)
    apart = np.linalg.norm(sun.points[0, 0] - planet.points[0, 0])
    np.testing.assert_allclose(apart, sun.radius + planet.radius, rtol=1e-9)
    rings = sorted(s.radius for s in scene.shapes if s.owner == "bodies.ring" and s.kind == "disc")
    assert rings[0] == pytest.approx(0.06)  # its teeth are inside
    assert len(rings) == 2


def test_a_joint_of_ones_own_has_a_symbol():
    import runpy

    runpy.run_path(str(ROOT / "examples" / "own_joint.py"))
    scene = scene_of(jn.load(ROOT / "examples" / "own_joint" / "cam.yaml"))
    assert [s.kind for s in scene.shapes if s.owner == "joints.roller"].count("area") == 2


def test_what_cannot_be_drawn_is_reported(four_bar):
    with pytest.raises(jn.errors.MechanismError, match="did you mean 'bodies'"):
        sketch(four_bar, names="bodys")
    with pytest.raises(jn.errors.MechanismError, match=r"position of a point.*'psi'.*valid: C"):
        sketch(four_bar, paths=["psi"])
    with pytest.raises(jn.errors.MechanismError, match=r"up to order 3.*got 4"):
        sketch(four_bar, order=4)
    with pytest.raises(jn.errors.MechanismError, match="solve it first"):
        sketch(four_bar.mechanism, order=1)
    with pytest.raises(jn.errors.MechanismError, match=r"jn\.load reads one"):
        sketch("four_bar.yaml")


def test_hodograph_is_the_derivative_by_components(four_bar):
    figure = hodograph(four_bar, "C", 2)
    (axes,) = figure.axes
    (curve,) = [line for line in axes.lines if len(line.get_xdata()) == 601]
    np.testing.assert_allclose(curve.get_xydata()[::15], four_bar.outputs["C"][:, 2], rtol=1e-9, atol=1e-12)
    assert axes.get_ylabel() == r"$\ddot{C}_{y}$  (m/s$^2$)"
    with pytest.raises(jn.errors.MechanismError, match="needs an output with components"):
        hodograph(four_bar, "psi")
    with pytest.raises(jn.errors.MechanismError, match="did you mean 'psi'"):
        hodograph(four_bar, "ps")
    with pytest.raises(jn.errors.MechanismError, match=r"up to order 3.*got 4"):
        hodograph(four_bar, "C", 4)


@pytest.mark.slow
def test_hodograph_in_space_has_three_projections(hooke):
    figure = hodograph(hooke, "rim")
    for axes, pair in zip(figure.axes, ([0, 1], [0, 2], [1, 2]), strict=True):
        (curve,) = [line for line in axes.lines if len(line.get_xdata()) == 601]
        np.testing.assert_allclose(curve.get_xydata()[::60], hooke.outputs["rim"][:, 1][:, pair], rtol=1e-9, atol=1e-12)


def test_phase_portrait_draws_derivatives_against_each_other(four_bar):
    for orders in ((0, 1), (1, 3)):
        (axes,) = phase_portrait(four_bar, "psi", orders).axes
        (curve,) = [line for line in axes.lines if len(line.get_xdata()) == 601]
        at_instants = four_bar.outputs["psi"][:, list(orders)]
        np.testing.assert_allclose(curve.get_xydata()[::15], at_instants, rtol=1e-9, atol=1e-12)
        fine = jn.solve(four_bar.mechanism, np.linspace(0.0, 2.0, 601), order=3).outputs["psi"][:, list(orders)]
        np.testing.assert_allclose(curve.get_xydata(), fine, rtol=0, atol=4e-3 * np.abs(fine).max())  # of 41 instants
    assert len(phase_portrait(four_bar, "C").axes) == 2
    with pytest.raises(jn.errors.MechanismError, match=r"up to order 3.*got 4"):
        phase_portrait(four_bar, "psi", (3, 4))


def test_a_gif_moves(four_bar, tmp_path):
    path, seen = tmp_path / "four_bar.gif", []
    animate(four_bar, path, fps=5, progress=lambda done, total: seen.append((done, total)))
    with Image.open(path) as film:
        assert film.n_frames == 11
        assert film.info["duration"] == 200  # ms
        frames = []
        for k in (0, 5, 10):
            film.seek(k)
            frames.append(np.asarray(film.convert("L"), int))
    assert seen[-1] == (11, 11)
    assert np.abs(frames[0] - frames[1]).max() > 100  # the links moved
    assert np.mean(np.abs(frames[0] - frames[1]) > 100) < 0.2  # and nothing else
    assert np.mean(np.abs(frames[0] - frames[2]) > 100) < 0.01  # after a period they are back; the clock went on


def test_times_of_frames():
    np.testing.assert_allclose(frame_instants([0.0, 4.0], speed=2.0, fps=10), np.linspace(0.0, 4.0, 21))
    assert len(frame_instants([0.0, 1000.0])) == 501  # 20 s of film
    assert frame_instants([1.0, 0.0]).tolist()[:2] == [1.0, 0.98]  # backward; 2 s of film
    with pytest.raises(jn.errors.MechanismError, match=r"at most 3000"):
        frame_instants([0.0, 1000.0], speed=1.0)
    for wrong in (0.0, -1.0, np.inf):
        with pytest.raises(jn.errors.MechanismError, match="greater than zero"):
            frame_instants([0.0, 1.0], speed=wrong)


def test_an_mp4_has_its_frames(four_bar, tmp_path):
    from imageio_ffmpeg import count_frames_and_secs

    animate(four_bar, tmp_path / "film.mp4", speed=0.5, fps=5)  # 2 s of motion
    frames, seconds = count_frames_and_secs(str(tmp_path / "film.mp4"))
    assert frames == 21
    assert seconds == pytest.approx(21 / 5, abs=0.01)


def test_a_film_that_cannot_be_written_is_reported_before(four_bar, tmp_path, monkeypatch):
    with pytest.raises(jn.errors.OutputError, match=r"\.gif, \.mp4"):
        animate(four_bar, tmp_path / "film.avi")
    with pytest.raises(jn.errors.OutputError, match="does not exist"):
        check_animation(tmp_path / "none" / "film.gif")
    monkeypatch.setattr("jounce.plot.animation._ffmpeg", lambda: None)
    with pytest.raises(jn.errors.OutputError, match=r"needs ffmpeg.*write a \.gif"):
        animate(four_bar, tmp_path / "film.mp4")
    assert not list(tmp_path.iterdir())


def test_svg_names_what_each_line_shows(four_bar, tmp_path):
    path = tmp_path / "sketch.svg"
    save(sketch(four_bar), path)
    found = set(re.findall(r'id="([a-z]+\.[A-Za-z]+)"', path.read_text(encoding="utf-8")))
    assert {"bodies.crank", "joints.A", "drivers.theta", "outputs.C"} <= found


def test_instants_that_failed_are_left_out(tmp_path):
    mechanism = jn.load(ROOT / "examples" / "four_bar.yaml").with_parameters(BC=0.11)
    motion = jn.solve(mechanism, np.linspace(0.0, 2.0, 21), order=1, strict=False)
    assert np.any(motion.status != 0)
    for artist in artists(sketch(motion, 1.5), "bodies.crank"):
        assert np.isfinite(artist.get_xydata()).all()
    animate(motion, tmp_path / "film.gif", fps=4)
    solved = np.isin(np.searchsorted(motion.time, np.linspace(0.0, 2.0, 9)), np.flatnonzero(motion.status == 0))
    with Image.open(tmp_path / "film.gif") as film:
        assert 1 <= film.n_frames <= 9
        assert film.n_frames <= solved.sum() + 1
    motion.status[:] = 2
    with pytest.raises(jn.errors.MechanismError, match="no instant was solved"):
        sketch(motion)
