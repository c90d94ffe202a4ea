"""Tables of joints read back as the trajectories that they are, whatever the names of the joints say."""

import numpy as np
import pytest

import jounce as jn
from jounce.cli.robot_commands.joint_tables import joint_table
from jounce.io import write

INERTIA = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
LINK = f'<link name="{{}}"><inertial><mass value="1"/>{INERTIA}</inertial></link>'
JOINT = '<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/><axis xyz="0 0 1"/></joint>'
TIMES = np.linspace(0.0, 1.0, 41)


def arm(folder, turning, sliding):
    links = map(LINK.format, ("base", "upper", "lower"))
    joints = JOINT.format(turning, "continuous", "base", "upper"), JOINT.format(sliding, "prismatic", "upper", "lower")
    path = folder / "arm.urdf"
    path.write_text(f'<robot name="arm">{"".join([*links, *joints])}</robot>')
    return jn.load_robot(path)


@pytest.mark.parametrize(
    "turning, sliding, headed",
    [
        ("elbow", "lift", False),
        ("elbow_deg", "lift_mm", True),
        ("elbow_rad", "lift_s", True),
        ("elbowDeg", "lift (mm)", True),
        ("q_deg_0", "lift[mm]", True),
    ],
)
def test_a_written_trajectory_is_read_with_its_names_and_numbers(turning, sliding, headed, tmp_path):
    robot = arm(tmp_path, turning, sliding)
    laws = {turning: "0.3 + 2*t - t**2", sliding: "0.1*t**3"}
    given = jn.JointTrajectory(laws, 0.0, 1.0, TIMES)
    out = tmp_path / "out.csv"
    write(joint_table(robot, given, TIMES), out)
    heading = out.read_text().partition("\n")[0].split(",")
    unit = (lambda text: f" [{text}]") if headed else (lambda _: "")
    assert heading[:3] == [f"time{unit('s')}", f"{turning}{unit('rad')}", f"{turning}_d1{unit('rad/s')}"]
    assert heading[5] == f"{sliding}{unit('m')}"
    again = jn.load_trajectory(out)
    assert again.names == given.names
    expected = np.stack([0.3 + 2 * TIMES - TIMES**2, 0.1 * TIMES**3], axis=-1)
    np.testing.assert_allclose(again.derivatives(TIMES, 0)[:, 0], expected, rtol=0, atol=1e-14)


def test_the_driver_of_a_mechanism_has_its_unit():
    mechanism = jn.load("examples/four_bar.yaml")
    (name,) = mechanism.drivers
    table = joint_table(mechanism, jn.JointTrajectory({name: "t"}, 0.0, 1.0, TIMES), TIMES, "four-bar")
    assert table[name].attrs["units"] == "rad"
    assert table.attrs["title"] == "four-bar"
