"""What is drawn has the size of what it stands for: poses, arrows, paths, forces, against a wheel worked by hand."""

import numpy as np
import pytest

import jounce as jn
from jounce.viewer.page.overlay import DisplayOptions, Overlay
from jounce.viewer.page.plots import cursor_data, default_charts
from jounce.viewer.shapes.arrows import TracedPoint, load_scale
from jounce.viewer.shapes.recording import rotated
from jounce.viewer.subjects.mechanisms import MechanismSubject, instants_shown
from tests.viewer.small import INERTIA, MASS, RADIUS, derivatives_of_the_rim, wheel


@pytest.fixture(scope="module")
def recording():
    return MechanismSubject(wheel()).solve({}, 3)


def rim(recording):
    return next(point for point in recording.appearance.points if point.name == "rim")


def test_bodies_are_where_the_law_puts_them(recording):
    expected = derivatives_of_the_rim(recording.time)
    assert recording.bodies == ("ground", "wheel")
    np.testing.assert_allclose(recording.global_point("wheel", [RADIUS, 0]), expected[:, 0], rtol=0, atol=1e-14)
    turned = rotated(recording.quaternion[:, 1], np.array([1.0, 0, 0]))
    np.testing.assert_allclose(turned * RADIUS, expected[:, 0], rtol=0, atol=1e-14)
    assert not recording.position[:, 0].any()


@pytest.mark.slow
def test_the_first_point_that_has_arrows_moves():
    recording = MechanismSubject(jn.load("examples/belt_drive.yaml")).solve({}, 2)
    names = [point.name for point in recording.appearance.points]
    first = recording.first_moving_point()
    path = recording.motion(first)[:, 0]
    assert names.index(first.name) > 0  # the arm turns about the first one
    assert np.ptp(path, axis=0).max() > 0.1


def test_arrows_are_scaled_derivatives(recording):
    expected = derivatives_of_the_rim(recording.time)
    drawn = Overlay.of(recording, DisplayOptions((TracedPoint(rim(recording), (1, 2)),), lengths={2: 2.5}))
    for order in (1, 2):
        arrows = drawn.arrows[order][:, 0]
        along = arrows[:, 1] - arrows[:, 0]
        np.testing.assert_allclose(along / drawn.scales[order], expected[:, order], rtol=0, atol=1e-11)
        np.testing.assert_allclose(arrows[:, 0, :2], expected[:, 0, :2], rtol=0, atol=1e-14)
        assert (arrows[:, 0, 2] == recording.appearance.front).all()  # before the bodies
    plain = Overlay.of(recording, DisplayOptions((TracedPoint(rim(recording), (2,)),)))
    assert drawn.scales[2] == 2.5 * plain.scales[2]
    longest = np.linalg.norm(plain.arrows[2][:, 0, 1] - plain.arrows[2][:, 0, 0], axis=1).max()
    assert 0.1 * recording.size < longest <= 0.3 * recording.size * (1 + 1e-9)


def test_paths_run_through_the_point_and_are_colored_by_a_derivative(recording):
    expected = derivatives_of_the_rim(recording.time)
    drawn = Overlay.of(recording, DisplayOptions((TracedPoint(rim(recording), ()),), path_order=2))
    assert drawn.lines.shape == (100, 2, 3)
    np.testing.assert_allclose(drawn.lines[:, 0, :2], expected[:-1, 0, :2], rtol=0, atol=1e-14)
    sizes = np.linalg.norm(expected[:, 2], axis=1)
    np.testing.assert_allclose(drawn.extremes, (0.0, sizes.max()), rtol=1e-12)
    assert drawn.colors[0, 0].tolist() == [68, 1, 84]  # viridis begins so
    steady = Overlay.of(recording, DisplayOptions((TracedPoint(rim(recording), ()),), path_order=1))
    assert steady.extremes[0] == 0.0  # colors start at zero
    assert not drawn.arrows


def test_forces_are_those_of_the_wheel(recording):
    by_kind = {load.kind: load for load in recording.loads}
    torque = INERTIA * 12 * recording.time  # 6 c t
    np.testing.assert_allclose(by_kind["driver"].torque[:, 2], torque, rtol=0, atol=1e-12)
    np.testing.assert_allclose(by_kind["driver"].force, 0.0, atol=1e-12)
    np.testing.assert_allclose(by_kind["reaction"].force, [[0, MASS * 10.0, 0]] * 101, rtol=0, atol=1e-11)
    scale, largest = load_scale(recording, recording.loads)
    drawn = Overlay.of(recording, DisplayOptions(kinds=frozenset({"reaction"}), force_length=2.0))
    arrow = drawn.forces["reaction"][3, 0]
    np.testing.assert_allclose((arrow[1] - arrow[0]) / (2.0 * scale), [0, 20.0, 0], rtol=0, atol=1e-11)
    np.testing.assert_allclose(arrow[0, :2], 0.0, atol=1e-14)  # it starts at the pin
    assert largest == pytest.approx(6.0)
    assert {e.kind for e in drawn.loads} == {"reaction"}


@pytest.mark.slow
def test_applied_forces_act_along_their_lines():
    spring = jn.forces.Spring(("ground", "wheel"), [1.0, 0.0], [RADIUS, 0.0], stiffness=5.0, length=0.2)
    push = jn.forces.PointForce(("wheel",), [RADIUS, 0.0], law=[3.0, 0.0], frame="body")
    moment = jn.forces.Moment(("wheel",), law=7.0)
    subject = MechanismSubject(wheel(forces={"spring": spring, "push": push, "moment": moment}))
    recording = subject.solve({}, 2)
    found = {load.name: load for load in recording.loads if load.kind == "applied"}
    place = derivatives_of_the_rim(recording.time)[:, 0]
    line = place - [1.0, 0, 0]
    length = np.linalg.norm(line, axis=1, keepdims=True)
    np.testing.assert_allclose(found["spring"].force, -5.0 * (length - 0.2) * line / length, rtol=0, atol=1e-11)
    np.testing.assert_allclose(found["push"].force, 3.0 * place / RADIUS, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found["moment"].torque, [[0, 0, 7.0]] * 101, rtol=0, atol=1e-12)
    assert found["moment"].force is None
    assert [each.kind for each in recording.appearance.connectors] == ["spring"]


def test_points_follow_their_parameters(recording):
    other = MechanismSubject(wheel()).solve({"r": 0.6}, 3)
    kept = DisplayOptions((TracedPoint(rim(recording), (1, 3)),)).fitted(other)
    assert kept.traced[0].point.point == (0.6, 0.0)
    lower = MechanismSubject(wheel()).solve({}, 1)
    assert DisplayOptions((TracedPoint(rim(recording), (1, 3)),)).fitted(lower).traced[0].orders == (1,)
    assert other.values["twice"] == pytest.approx(1.2)


def test_sliders_have_sensible_ends():
    found = {p.name: p for p in MechanismSubject(wheel()).parameters}
    assert (found["c"].low, found["c"].high) == (1.0, 3.0)
    assert [p.name for p in found.values() if p.derived] == ["twice"]


def test_instants_are_enough_to_look_smooth_and_not_too_many():
    assert len(instants_shown(wheel(time=jn.TimeGrid(0, 2, count=20001)))) == 2001
    few = instants_shown(wheel(time=[0.0, 1.0, 4.0]))
    assert len(few) == 101
    assert {0.0, 1.0, 4.0} <= set(few.tolist())
    assert instants_shown(wheel(time=[0.5])).tolist() == [0.5]


def test_a_mechanism_without_instants_is_refused():
    with pytest.raises(jn.errors.MechanismError, match="no time grid"):
        MechanismSubject(wheel(time=None))


def test_a_motion_that_ends_early_is_shown_as_far_as_it_goes():
    law = jn.drivers.CoordinateDriver(("ground", "wheel"), "angle", motion="sqrt(0.5 - t)")
    recording = MechanismSubject(wheel(drivers={"turn": law})).solve({}, 1)
    assert 10 < len(recording.time) < 52
    assert "instants were solved" in recording.notice
    assert np.isfinite(recording.position).all()


def test_outputs_are_plotted_with_their_words_and_units(recording):
    angle = recording.outputs["angle"]
    np.testing.assert_allclose(angle.values[:, 1, 0], 6 * recording.time**2, rtol=0, atol=1e-12)
    assert angle.words == ("angle", "velocity", "acceleration", "jerk")
    assert angle.unit == "rad"
    assert recording.outputs["rim"].values.shape == (101, 4, 2)
    assert default_charts(recording) == [("rim", 0), ("rim", 2)]
    without = MechanismSubject(wheel(outputs={})).solve({}, 2)
    assert list(without.outputs) == ["angle of wheel"]


def test_a_cursor_is_an_upright_line_at_the_instant():
    time, values = np.linspace(0, 1, 11), np.linspace(2, 4, 11)[:, None]
    for frame in (0, 5, 10):
        times, line, cursor = cursor_data(time, values, frame)
        here = np.flatnonzero(np.isfinite(cursor))
        assert here.tolist() == [frame, frame + 1]
        np.testing.assert_allclose(times[here], time[frame], atol=1e-8)
        assert cursor[here].tolist() == [2.0, 4.0]
        assert (np.diff(times) > 0).all()
        np.testing.assert_allclose(line[here], values[frame, 0], atol=1e-12)


@pytest.mark.slow
def test_a_simulation_is_shown_too():
    free = wheel(
        drivers={},
        initial={"go": jn.drivers.CoordinateDriver(("ground", "wheel"), "angle", motion="0.2 + 3*t")},
        time=[0.0, 0.5],
    )
    recording = MechanismSubject(free).solve({}, 2)
    np.testing.assert_allclose(recording.outputs["angle"].values[:, 0, 0], 0.2 + 3 * recording.time, atol=1e-10)
