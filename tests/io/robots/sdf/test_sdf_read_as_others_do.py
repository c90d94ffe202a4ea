"""SDF files that Gazebo and Drake take: loose links, screws, names of old files, elements that are given twice."""

import numpy as np
import pytest

import jounce as jn
from jounce.errors import RobotFileError, RobotWarning
from tests.io.robots.sdf.test_reader import SOME, joint, link, model, read


def read_with_warning(tmp_path, text, says):
    """Return the robot, read with a warning, which is an error if it is read strictly."""
    with pytest.warns(RobotWarning, match=says):
        robot = read(tmp_path, text)
    with pytest.raises(RobotFileError):
        read(tmp_path, text, strict=True)
    return robot


def test_links_that_nothing_joins_are_free(tmp_path):
    parts = [link("a"), link("b", "1 2 3 0 0 1"), link("c", "1 2 4 0 0 1"), joint("j", "b", "c")]
    robot = read_with_warning(tmp_path, model(*parts), "are joined to the base by nothing.*: b")
    assert robot.joint_names[:3] == ("b_x", "b_y", "b_z")
    assert len(robot.joint_names) == 7
    np.testing.assert_allclose(jn.forward_kinematics(robot, np.zeros((1, 7)), "c").position[0], [1, 2, 4], atol=1e-15)
    weight = np.asarray(jn.inverse_dynamics(robot, np.zeros((3, 7))))[0]
    np.testing.assert_allclose(weight, [0, 0, 4 * 9.81, 0, 0, 0, 0], atol=1e-14)


def test_nothing_moves_in_a_static_model(tmp_path):
    robot = read(tmp_path, model("<static>true</static>", link("a"), link("b"), link("c")), strict=True)
    assert robot.joint_names == ()
    assert robot.frames["c"].body < 0


@pytest.mark.parametrize("ends", [("a", "b"), ("b", "a")])
@pytest.mark.parametrize("pitch", ["<screw_thread_pitch>0.6</screw_thread_pitch>", "<thread_pitch>{}</thread_pitch>"])
def test_a_screw_turns_and_travels(tmp_path, pitch, ends):
    """The travel of a radian is p: the torque is (I + m p^2) times the acceleration, and m g p, from either end."""
    p = 0.6 / (2 * np.pi)
    inside = pitch.format(-1 / p) + "<axis><xyz>0 0 1</xyz></axis>"
    robot = read(tmp_path, model(link("a"), link("b"), joint("j", *ends, "screw", inside)), strict=True)
    assert robot.joint_names == ("j",)
    sign = 1.0 if ends == ("a", "b") else -1.0
    turned = jn.forward_kinematics(robot, [[0.7]], "b")
    np.testing.assert_allclose(turned.position[0], [0, 0, 0.7 * p * sign], atol=1e-15)
    np.testing.assert_allclose(turned.rotation[0][:2, 0], [np.cos(0.7), np.sin(0.7) * sign], atol=1e-15)
    torque = jn.inverse_dynamics(robot, [[0.7], [0.2], [3.0]])[0]
    np.testing.assert_allclose(torque, (0.25 + 2 * p**2) * 3 + 2 * 9.81 * p * sign, rtol=1e-14)


def test_a_screw_may_follow(tmp_path):
    mimic = '<axis><xyz>0 0 1</xyz><mimic joint="j"><multiplier>2</multiplier><offset>0.1</offset></mimic></axis>'
    parts = [*map(link, "abc"), joint("j", "a", "b"), joint("s", "a", "c", "screw", mimic)]
    robot = read(tmp_path, model(*parts), strict=True)
    height = jn.forward_kinematics(robot, [[0.7]], "c").position[0][2]
    np.testing.assert_allclose(height, (2 * 0.7 + 0.1) / (2 * np.pi), rtol=1e-14)


def test_names_of_models_stand_for_their_frames(tmp_path):
    nested = f'<model name="n"><pose>0 0 1 0 0 0</pose>{link("c")}</model>'
    text = model(link("a"), nested, joint("j", "__model__", "n"))
    robot = read(tmp_path, text, strict=True)
    assert (robot.joints["j"].parent, robot.joints["j"].child) == ("a", "n::c")


def test_a_nested_model_may_place_the_model_that_holds_it(tmp_path):
    """Its frame, turned by a quarter at (1, 0, 0), is put at (0, 0, 5): what was at the origin is at (0, 1, 5)."""
    nested = f'<model name="n"><pose>1 0 0 0 0 {np.pi / 2}</pose>{link("c")}</model>'
    parts = ["<pose>0 0 5 0 0 0</pose>", link("a"), nested, joint("held", "world", "a", "fixed"), joint("j", "a", "n")]
    robot = read(tmp_path, model(*parts, attributes='placement_frame="n"'), strict=True)
    for name, place in (("a", [0, 1, 5]), ("n::c", [0, 0, 5])):
        position = jn.forward_kinematics(robot, np.zeros((1, 1)), name).position[0]
        np.testing.assert_allclose(position, place, rtol=0, atol=1e-15)


def test_old_files_name_links_and_joints_alike(tmp_path):
    parts = [link("a"), link("b"), joint("b", "a", "b")]
    robot = read_with_warning(tmp_path, model(*parts, version="1.6"), "have the name of a link.*: b")
    assert robot.joint_names == ("b_joint",)
    with pytest.raises(RobotFileError, match="this name is given twice"):
        read(tmp_path, model(*parts, version="1.7"))


def test_of_two_elements_the_first_counts(tmp_path):
    twice = SOME.replace("</mass>", "</mass>\n<mass>7</mass>")
    robot = read_with_warning(tmp_path, model(link("a", body=twice)), r"given twice.*: links\.a\.inertial \(line 2\)")
    assert robot.links["a"].inertia.mass == 2.0


def test_the_mass_of_a_fluid_is_left_out(tmp_path):
    moved = SOME.replace("<mass>", "<fluid_added_mass><xx>1</xx></fluid_added_mass><mass>")
    robot = read_with_warning(tmp_path, model(link("a", body=moved)), "the mass of the fluid that links move.*: a")
    assert robot.links["a"].inertia.mass == 2.0


def test_models_are_placed_by_others_of_their_world(tmp_path):
    bodies = [link("a", "1 0 0 0 0 0.5"), link("b")]
    leader = f'<model name="m"><pose>0 0 0 1.5707963267948966 0 0</pose>{bodies[0]}</model>'
    arm = f'<model name="n"><pose relative_to="m">0 0 1 0 0 0</pose>{bodies[1]}</model>'
    frame = '<frame name="f" attached_to="m::a"><pose>0 0 0 0 0.3 0</pose></frame>'
    text = '<sdf version="1.9"><world name="w">{}</world></sdf>'
    robot = read(tmp_path, text.format(leader + arm), model="n")
    np.testing.assert_allclose(robot.gravity, [0, -9.81, 0], atol=1e-14)
    tilted = read(tmp_path, text.format(leader + frame + arm.replace('relative_to="m"', 'relative_to="f"')), model="n")
    turn = np.array([[np.cos(0.5), np.sin(0.5), 0], [-np.sin(0.5), np.cos(0.5), 0], [0, 0, 1]])
    tilt = np.array([[np.cos(0.3), 0, -np.sin(0.3)], [0, 1, 0], [np.sin(0.3), 0, np.cos(0.3)]])
    np.testing.assert_allclose(tilted.gravity, tilt @ turn @ [0, -9.81, 0], atol=1e-14)
    with pytest.raises(RobotFileError, match="'k'"):
        read(tmp_path, text.format(leader + arm.replace('relative_to="m"', 'relative_to="k"')), model="n")
