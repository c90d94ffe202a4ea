"""The figure of limits: which panels and curves it has, and where the worst instants are marked."""

import matplotlib.image
import numpy as np
import pytest

import jounce as jn
from jounce.dynamics.limits.check_limits import check_limits
from jounce.plot import draw_limits, save
from jounce.trajectory import JointTrajectory


def crane(slide, pin):
    links = [jn.Link("base"), jn.Link("carriage", jn.Inertia(3.0)), jn.Link("rod", jn.Inertia(2.0, [0.5, 0, 0]))]
    joints = [
        jn.Joint("slide", "base", "carriage", "prismatic", axis=[1, 0, 0], limits=slide),
        jn.Joint("pin", "carriage", "rod", axis=[0, -1, 0], limits=pin),
    ]
    return jn.Robot("crane", links, joints)


MOTION = JointTrajectory({"slide": "0.5*sin(2*t)", "pin": "1 + t"}, start=0.0, stop=2.0)


@pytest.fixture(scope="module")
def report():
    pin = jn.Limits(lower=0.0, upper=4.0, velocity=0.5, acceleration=9.0, jerk=9.0, effort=20.0, effort_rate=90.0)
    return check_limits(crane(jn.Limits(lower=-1.0, upper=1.0, velocity=2.0, effort=50.0), pin), MOTION)


def drawn(figure):
    return [axes for axes in figure.axes if axes.axison]


def curves_of(axes):
    return [line for line in axes.get_lines() if len(line.get_xdata()) > 2]


def test_a_panel_for_each_quantity_with_the_shares_of_each_joint(report):
    panels = drawn(draw_limits(report))
    assert [axes.get_ylabel().partition("\n")[0] for axes in panels] == [
        "position",
        "jerk",
        "velocity",
        "force / torque",
        "acceleration",
        "torque rate",
    ]
    position, jerk = panels[:2]
    assert len(curves_of(position)) == 2
    assert len(curves_of(jerk)) == 1
    for joint, line in enumerate(curves_of(position)):
        np.testing.assert_array_equal(line.get_xdata(), report.times)
        np.testing.assert_array_equal(line.get_ydata(), report.shares[:, 0, joint])


def test_the_worst_instant_is_marked_and_reported(report):
    velocity = drawn(draw_limits(report))[2]
    (mark,) = (line for line in velocity.get_lines() if line.get_marker() == "o")
    assert (mark.get_xdata()[0], mark.get_ydata()[0]) == (0.0, pytest.approx(2.0))
    assert velocity.get_title(loc="left") == "worst: pin, 1 rad/s (limit 0.5)"
    low, high = velocity.get_ylim()
    assert low < -1
    assert high > 2


def test_a_lower_limit_is_marked_below():
    motion = JointTrajectory({"slide": "-0.9*t/2", "pin": "0"}, start=0.0, stop=2.0)
    (panel,) = drawn(draw_limits(check_limits(crane(jn.Limits(lower=-1.0, upper=1.0), jn.Limits()), motion)))
    (mark,) = (line for line in panel.get_lines() if line.get_marker() == "o")
    assert mark.get_ydata()[0] == pytest.approx(-0.9)


def test_joints_held_still_have_torques_only():
    robot = crane(jn.Limits(lower=-1.0, upper=1.0, effort=50.0), jn.Limits(lower=0.0, upper=4.0))
    panels = drawn(draw_limits(check_limits(robot, JointTrajectory({"pin": "1 + t"}, start=0.0, stop=2.0))))
    assert [len(curves_of(axes)) for axes in panels] == [1, 1]
    assert [axes.get_ylabel().partition("\n")[0] for axes in panels] == ["position", "force"]


def test_the_legend_names_the_joints_and_the_title_the_robot(report):
    figure = draw_limits(report)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["slide", "pin"]
    assert figure.get_suptitle() == "crane"
    assert draw_limits(report, "costs $5").get_suptitle() == r"costs \$5"


@pytest.mark.slow
def test_joints_beyond_the_colors_differ_in_their_dashes():
    links = [jn.Link("base"), *(jn.Link(f"link{k}", jn.Inertia(1.0, [0.1, 0, 0])) for k in range(9))]
    joints = [
        jn.Joint(f"joint{k}", "base" if k == 0 else f"link{k - 1}", f"link{k}", limits=jn.Limits(velocity=1.0))
        for k in range(9)
    ]
    motion = JointTrajectory({f"joint{k}": f"{k + 1}*t/10" for k in range(9)}, start=0.0, stop=1.0)
    (panel,) = drawn(draw_limits(check_limits(jn.Robot("snake", links, joints), motion)))
    styles = {(line.get_color(), line.get_linestyle()) for line in curves_of(panel)}
    assert len(styles) == 9


def test_long_trajectories_are_thinned():
    motion = JointTrajectory({"slide": "t", "pin": "t"}, start=0.0, stop=1.0, times=np.linspace(0, 1, 3001))
    report = check_limits(crane(jn.Limits(velocity=2.0), jn.Limits()), motion)
    (panel,) = drawn(draw_limits(report))
    (line,) = curves_of(panel)
    assert len(report.times) == 12001
    assert 3000 < len(line.get_xdata()) <= 4001
    assert (line.get_xdata()[0], line.get_xdata()[-1]) == (0.0, 1.0)


def test_nothing_to_draw_is_reported():
    report = check_limits(crane(jn.Limits(), jn.Limits()), MOTION)
    with pytest.raises(jn.errors.RobotError, match="there are no limits to draw"):
        draw_limits(report)


@pytest.mark.slow
def test_the_file_has_ink(report, tmp_path):
    path = tmp_path / "limits.png"
    save(draw_limits(report), path)
    pixels = matplotlib.image.imread(path)[..., :3]
    assert pixels.shape[1] == 1400
    colored = np.ptp(pixels, axis=2) > 0.3
    for half in np.array_split(colored, 2, axis=1):
        assert half.mean() > 1e-3
