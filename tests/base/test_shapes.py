"""Arrays that users give: components of vectors by their labels, at the doors that take vectors."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import jounce as jn
from jounce.base.shapes import by_component
from jounce.mechanism.building.starting_guess import starting_guess

ZYX = ["z", "y", "x"]
VECTOR = [0.1, 0.2, 0.3]


def series(labels=ZYX, values=(0.3, 0.2, 0.1)):
    return pd.Series(values, index=labels)


def array(labels=ZYX, values=(0.3, 0.2, 0.1)):
    return xr.DataArray(list(values), dims="component", coords={"component": labels})


@pytest.mark.parametrize("labeled", [series, array])
@pytest.mark.parametrize(
    "labels, values, expected",
    [
        (ZYX, [3, 2, 1], [1, 2, 3]),
        (["Y", "X"], [2, 1], [1, 2]),
        (["x", "y", "z", "w"], [1, 2, 3, 0], [0, 1, 2, 3]),
        (["a", "c", "b"], [3, 2, 1], [3, 2, 1]),
        ([2, 1, 0], [3, 2, 1], [3, 2, 1]),
    ],
)
def test_components_go_by_their_labels_where_these_are_axes(labeled, labels, values, expected):
    assert np.asarray(by_component("v", labeled(labels, values), ValueError)).tolist() == expected


def test_rows_and_columns_of_a_tensor_go_by_their_labels():
    tensor = np.arange(9.0).reshape(3, 3)
    turned = tensor[::-1, ::-1]
    table = by_component("t", pd.DataFrame(turned, index=ZYX, columns=ZYX), ValueError)
    np.testing.assert_array_equal(table, tensor)
    both = xr.DataArray(turned, dims=("row", "column"), coords={"row": ZYX, "column": ZYX})
    np.testing.assert_array_equal(by_component("t", both, ValueError), tensor)
    rows_of_points = by_component("t", pd.DataFrame(tensor[:, ::-1], columns=ZYX), ValueError)
    np.testing.assert_array_equal(rows_of_points, tensor)


@pytest.mark.parametrize(
    "labels, values", [(["x", "y", "u"], [1, 2, 3]), (["x", "x", "y"], [1, 2, 3]), (["z", "y"], [1, 2])]
)
def test_labels_of_other_axes_are_refused_by_name(labels, values):
    with pytest.raises(jn.errors.RobotError, match=rf"gravity: its labels must be .*got '{', '.join(labels)}'"):
        by_component("gravity", series(labels, values), jn.errors.RobotError)


def test_components_along_another_axis_than_the_last_are_refused():
    with pytest.raises(jn.errors.RobotError, match="points: the components must be along the last axis"):
        by_component("points", pd.DataFrame(np.ones((3, 2)), index=ZYX), jn.errors.RobotError)


def pendulum(vector, gravity, size):
    """A rod on a driven hinge, all its vectors given in one form."""
    body = jn.Body(vector, mass=1.5, inertia=size, center_of_mass=vector)
    return jn.Mechanism(
        space="spatial",
        gravity=gravity,
        bodies={"rod": body},
        joints={"hinge": jn.spatial.Revolute(("ground", "rod"), vector, [0, 0, 0], vector, vector)},
        drivers={"motor": jn.drivers.RotationDriver(("ground", "rod"), vector, "t + t**2")},
        forces={"push": jn.forces.SpatialPointForce(("rod",), point=vector, law=vector)},
        outputs={"tip": jn.outputs.PointOutput("rod", vector)},
    )


@pytest.mark.parametrize("labeled", [series, array])
def test_a_mechanism_takes_vectors_with_labels_as_their_lists(labeled):
    """All that it computes is that of lists in the order x, y, z."""
    plain = pendulum(VECTOR, [1.0, 2.0, -9.81], [1.0, 2.0, 2.5])
    found = pendulum(labeled(), labeled(values=(-9.81, 2.0, 1.0)), labeled(values=(2.5, 2.0, 1.0)))
    motions = [jn.solve(mechanism, [0.0, 0.4], order=3) for mechanism in (plain, found)]
    for part in ("force", "torque"):
        expected, same = (getattr(jn.joint_reaction(motion, "hinge"), part) for motion in motions)
        np.testing.assert_array_equal(same, expected)
    np.testing.assert_array_equal(motions[1].outputs["tip"], motions[0].outputs["tip"])
    tip = motions[0].dataset["tip"].isel(time=0, derivative=0)
    at_tip, at_list = (motions[0].point("rod", point).values for point in (tip[::-1], tip.values.tolist()))
    np.testing.assert_array_equal(at_tip, at_list)  # a result that is fed back


@pytest.mark.parametrize("labeled", [series, array])
def test_a_robot_takes_vectors_with_labels_as_their_lists(labeled):
    def arm(vector, gravity, size):
        link = jn.Link("arm", jn.Inertia.solid("box", size=size, mass=2.0))
        joint = jn.Joint("turn", "base", "arm", position=vector, axis=vector)
        return jn.Robot("one", [jn.Link("base"), link], [joint], gravity=gravity)

    robots = (
        arm(VECTOR, [1.0, 2.0, -9.81], [0.1, 0.2, 0.3]),
        arm(labeled(), labeled(values=(-9.81, 2.0, 1.0)), labeled()),
    )
    q = [[0.3], [1.0], [2.0]]
    expected, found = (jn.inverse_dynamics(robot, q) for robot in robots)
    np.testing.assert_array_equal(found, expected)
    places = [jn.forward_kinematics(robots[0], q, "arm", point).position for point in (VECTOR, labeled())]
    np.testing.assert_array_equal(*places)
    given, turned = ([1.0, 0.0, -9.81], labeled(values=(-9.81, 0.0, 1.0)))
    np.testing.assert_array_equal(robots[0].with_gravity(turned).gravity, given)


@pytest.mark.parametrize("labeled", [series, array])
@pytest.mark.parametrize(
    "labels, values, plain, form",
    [
        ("xyzw", [0.1, 0.2, 0.3, 0.9], [0.9, 0.1, 0.2, 0.3], lambda v: v),
        ("zyx", [3.0, 2.0, 1.0], [1.0, 2.0, 3.0], lambda v: {"axis": v, "angle": 0.4}),
        ("zyx", [0.3, 0.2, 0.1], [0.3, 0.2, 0.1], lambda v: {"euler": "zyx", "angles": v}),
    ],
    ids=["quaternion", "axis", "Euler angles"],
)
def test_quaternions_have_the_scalar_first_and_angles_the_order_of_their_turns(labeled, labels, values, plain, form):
    bodies = {"b": jn.Body([0, 0, 0], orientation=form(labeled(list(labels), values)))}
    bodies["same"] = jn.Body([0, 0, 0], orientation=form(plain))
    free = jn.Mechanism(space="spatial", bodies=bodies, joints={})
    _, found, expected = starting_guess(free, {}, 3)["quaternion"][..., 0].T
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("columns", [["x", "y"], ["y", "x"]])
def test_points_of_curves_and_paths_go_by_the_names_of_their_columns(columns):
    s = np.linspace(0.0, 1.0, 9)
    points = pd.DataFrame({"x": s, "y": np.sin(s)})[columns]
    np.testing.assert_array_equal(jn.joints.SampledCurve(points).points, np.stack([s, np.sin(s)], axis=-1))
