"""Torques, regressors and energies of robots as code, against the numbers, and by what they must fulfill."""

import numpy as np
import pytest

import jounce as jn
from jounce.errors import RobotError
from tests.problems.robots import FILES, NAMES, robot_named
from tests.problems.written import run
from tests.written_equations.test_code import COMPILER, compiled

EVERYTHING = ("torque", "mass_matrix", "regressor", "energies")


def coordinates(robot, order, seed=3):
    return np.random.default_rng(seed).uniform(-1, 1, (order + 1, len(robot.joint_names)))


def assert_near(found, expected, size=1e-13):
    np.testing.assert_allclose(found, expected, rtol=0, atol=size * max(1e-6, np.abs(expected).max()))


def arm():
    """Two joints that turn and one that slides, with all that drives have."""
    body = jn.Inertia(1.3, center_of_mass=[0.2, 0.1, -0.05], tensor=np.diag([0.03, 0.05, 0.04]))
    drive = {"armature": 0.3, "damping": 0.2, "friction": 0.7}
    joints = [
        jn.Joint("a", "base", "one", axis=[0, 0, 1], **drive),
        jn.Joint("b", "one", "two", axis=[0, -1, 0], position=[0.4, 0, 0.1], **drive),
        jn.Joint("c", "two", "three", axis=[1, 1, 0], type="prismatic", position=[0.2, 0, 0]),
    ]
    return jn.Robot("arm", [jn.Link("base"), *(jn.Link(x, body) for x in ("one", "two", "three"))], joints)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name, order", [("arm", 3), *(pytest.param(name, 4, marks=pytest.mark.slow) for name in NAMES)]
)
def test_code_of_robots_gives_their_numbers(name, order, tmp_path):
    robot = arm() if name == "arm" else robot_named(name)
    quantities = [x for x in EVERYTHING if x != "regressor" or name == "arm"]
    code = run(jn.equations(robot, order=order, quantities=quantities))
    q = coordinates(robot, order)
    torque = jn.inverse_dynamics(robot, q)
    assert_near(code["torque"](q), torque)
    assert_near(code["torque"](q[:3]), torque[:1])
    assert_near(code["mass_matrix"](q[0]), jn.mass_matrix(robot, q[0]))
    for p in range(order):
        assert_near(code[f"energy_{p}"](q), jn.energy.acceleration_energy(robot, q, order=p).total)
    if name == "arm":
        assert_near(code["regressor"](q) @ np.array(code["PARAMETER_VALUES"]), torque)
    if COMPILER:
        call = compiled(jn.equations(robot, format="c", order=order, quantities=quantities), tmp_path)
        assert_near(call("torque", torque.shape, q), code["torque"](q), 1e-14)
        if name == "arm":
            found = code["regressor"](q)
            assert_near(call("regressor", found.shape, q), found, 1e-14)


@pytest.mark.slow
def test_the_regressor_is_that_of_pinocchio():
    """Torque per parameter, of which Pinocchio orders the moments of inertia Ixx, Ixy, Iyy, Ixz, Iyz, Izz."""
    pinocchio = pytest.importorskip("pinocchio")
    path = str(FILES / "panda.urdf")
    model = pinocchio.buildModelFromUrdf(path)
    robot = jn.load_robot(path)
    code = run(jn.equations(robot, order=2, quantities="regressor", drives=False))
    q = coordinates(robot, 2)
    names = [model.names[k] for k in range(1, model.njoints)]
    columns = [robot.joint_names.index(name) for name in names if name in robot.joint_names]
    given = [np.zeros(model.nv) for _ in range(3)]
    for level, row in zip(given, q, strict=True):
        for joint in robot.joint_names:
            level[model.joints[model.getJointId(joint)].idx_v] = row[robot.joint_names.index(joint)]
    expected = pinocchio.computeJointTorqueRegressor(model, model.createData(), *given)
    places = {label: k for k, label in enumerate(code["PARAMETERS"])}
    found = code["regressor"](q)[0]
    order = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
    links = {joint.name: joint.child for joint in robot.joints.values()}
    for name in names[:7]:
        first = 10 * (model.getJointId(name) - 1)
        for k, word in enumerate(order):
            column = found[columns[:7], places[f"{links[name]}.{word}"]]
            np.testing.assert_allclose(
                column, expected[[model.joints[model.getJointId(x)].idx_v for x in names[:7]], first + k], atol=1e-13
            )


def test_options_of_robots():
    robot = arm()
    with pytest.raises(RobotError, match="order: must be 2 or more: torques need accelerations"):
        jn.equations(robot, order=1)
    with pytest.raises(RobotError, match="joint: is for mechanisms"):
        jn.equations(robot, "a")
    with pytest.raises(RobotError, match="format: is for mechanisms"):
        jn.equations(robot, format="latex")
    with pytest.raises(RobotError, match=r"quantities: .*torque"):
        jn.equations(robot, quantities="forces")
    bare = run(jn.equations(robot, order=2, drives=False))
    q = coordinates(robot, 2)
    assert_near(bare["torque"](q), jn.inverse_dynamics(robot, q, drives=False))
