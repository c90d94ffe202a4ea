"""Labels of arrays: joints are told by their names, whatever their order, at every door of robots."""

import copy
import pickle

import numpy as np
import pandas
import pytest
import xarray

import jounce as jn
from jounce.errors import JounceError

ROD = jn.Inertia(2.0, [0.3, 0.1, 0.0], [0.02, 0.03, 0.04])
NAMES = ("A", "B", "C")
Q = np.random.default_rng(3).normal(size=(3, 3))  # as many orders as joints


@pytest.fixture(scope="module")
def arm():
    links = [jn.Link("base"), *(jn.Link(name, ROD) for name in "abc")]
    parents = ("base", "a", "b")
    joints = [
        jn.Joint(name, parent, name.lower(), position=[0.4, 0, 0], axis=axis)
        for name, parent, axis in zip(NAMES, parents, np.eye(3), strict=True)
    ]
    return jn.Robot("arm", links, joints)


LAWS = {n: f"({x!r}) + ({v!r})*t + ({a!r})*t**2/2" for n, (x, v, a) in zip(NAMES, Q.T.tolist(), strict=True)}


def of_trajectory(order):
    return jn.JointTrajectory({name: LAWS[name] for name in order}, 0.0, 1.0).derivatives([0.0], 2)


ORDERED = {
    "trajectory": lambda order: of_trajectory(order)[0],
    "table": lambda order: pandas.DataFrame(Q, columns=NAMES)[list(order)],
    "array": lambda order: xarray.DataArray(Q, dims=("derivative", "joint"), coords={"joint": [*NAMES]}).sel(
        joint=list(order)
    ),
    "other axis of text": lambda order: pandas.DataFrame(Q, columns=NAMES, index=["q", "v", "a"])[list(order)],
    "labels of another robot": lambda _order: pandas.DataFrame(Q, columns=["x", "y", "z"]),
    "no labels": lambda _order: xarray.DataArray(Q, dims=("derivative", "joint")),
}


@pytest.mark.parametrize("kind", ORDERED)
@pytest.mark.parametrize("order", ["ABC", "CAB"])
def test_coordinates_are_in_the_order_of_the_robot_whatever_the_order_of_labels(arm, kind, order):
    q = ORDERED[kind](order)
    np.testing.assert_array_equal(jn.inverse_dynamics(arm, q), jn.inverse_dynamics(arm, Q))
    state, force = q[:2], q[2:]
    np.testing.assert_array_equal(jn.bias_forces(arm, state), jn.bias_forces(arm, Q[:2]))
    np.testing.assert_array_equal(jn.forward_dynamics(arm, state, force), jn.forward_dynamics(arm, Q[:2], Q[2:]))


def test_parts_of_the_values_of_a_trajectory_keep_their_joints(arm):
    q = of_trajectory("CAB")
    expected = jn.mass_matrix(arm, Q[:1])
    for part in (q[:, 0], q[0, :1], q[0][0][None], q[-1:, np.int64(0)], q[..., :1, :], q[[True], 0], q[:, 0, ::-1]):
        np.testing.assert_array_equal(jn.mass_matrix(arm, part), expected.reshape(*part.shape[:-1], 3, 3))
    by_hand = (q[..., [1, 2, 0]], q[:, :, [1, 2, 0]], np.asarray(q)[:, :, [1, 2, 0]], (2 * q[..., [1, 2, 0]]) / 2)
    for ordered in by_hand:
        np.testing.assert_array_equal(jn.inverse_dynamics(arm, ordered)[0], jn.inverse_dynamics(arm, Q))
    assert [type(x) for x in (2 * q, abs(q), q.max(), q.sum(axis=0))] == [
        np.ndarray,
        np.ndarray,
        np.float64,
        np.ndarray,
    ]


def test_copies_of_the_values_of_a_trajectory_keep_their_joints(arm):
    q = of_trajectory("CAB")
    for copied in (q.copy(), copy.copy(q), copy.deepcopy(q), pickle.loads(pickle.dumps(q))):
        assert not np.shares_memory(copied, q)
        np.testing.assert_array_equal(jn.inverse_dynamics(arm, copied)[0], jn.inverse_dynamics(arm, Q))


def test_values_of_joints_some_of_which_the_robot_lacks_are_refused(arm):
    laws = {"D": "t", "B": "t", "C": "t"}
    with pytest.raises(JounceError, match=r"q: its last axis must have each of the joints A, B, C once.*got 'D, B, C'"):
        jn.inverse_dynamics(arm, jn.JointTrajectory(laws, 0.0, 1.0).derivatives([0.0], 2))
    others = jn.JointTrajectory({"x": LAWS["A"], "y": LAWS["B"], "z": LAWS["C"]}, 0.0, 1.0).derivatives([0.0], 2)
    np.testing.assert_array_equal(jn.inverse_dynamics(arm, others)[0], jn.inverse_dynamics(arm, Q))


def test_columns_of_samples_and_waypoints_are_in_the_order_of_the_names():
    times = np.linspace(0.0, 1.0, 11)
    rows = np.outer(times**2, [0.1, 0.2, 0.3])
    table = pandas.DataFrame(rows, columns=[*NAMES])[["B", "C", "A"]]
    found = jn.JointTrajectory.from_samples(times, table, NAMES, degree=3)
    np.testing.assert_allclose(found.derivatives(times, 0, names=NAMES)[:, 0], rows, atol=1e-14)


def test_one_position_is_told_by_its_names_too(arm):
    position = pandas.Series({"C": 0.3, "A": 0.1, "B": 0.2})
    np.testing.assert_array_equal(jn.mass_matrix(arm, position), jn.mass_matrix(arm, [0.1, 0.2, 0.3]))


@pytest.mark.parametrize(
    "q, says",
    [
        (pandas.DataFrame(Q, columns=["A", "B", "time"]), "each of the joints A, B, C once, and nothing else, got 'A,"),
        (pandas.DataFrame(Q, columns=["A", "B", "B"]), "once, and nothing else, got 'A, B, B'"),
        (pandas.DataFrame(Q, index=[*NAMES]), "q: the joints must be along the last axis: transpose it"),
        (xarray.DataArray(Q, dims=("joint", "derivative")), "q: the joints must be along the last axis: transpose it"),
    ],
)
def test_labels_that_do_not_fit_are_refused(arm, q, says):
    with pytest.raises(JounceError) as caught:
        jn.inverse_dynamics(arm, q)
    assert says in str(caught.value)


def _labeled(values, kind):
    """Return values of the joints A, B and C along the last axis with labels, in another order."""
    values = np.asarray(values, float)
    if kind == "array":
        dims = ("row", "joint")[-values.ndim :]
        return xarray.DataArray(values, dims=dims, coords={"joint": [*NAMES]}).sel(joint=["C", "A", "B"])
    if values.ndim == 1:
        return pandas.Series(values, index=NAMES)[["C", "A", "B"]]
    return pandas.DataFrame(values, columns=NAMES)[["C", "A", "B"]]


@pytest.mark.parametrize("kind", ["array", "table"])
def test_starts_ends_limits_and_torques_are_told_by_name(arm, kind):
    start, end, limits = [0.1, 0.2, 0.3], [0.5, 1.2, 0.4], [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [70.0, 80.0, 90.0]]
    found = jn.JointTrajectory.point_to_point(
        NAMES, _labeled(start, kind), _labeled(end, kind), profile="trapezoidal", limits=_labeled(limits, kind)
    )
    plain = jn.JointTrajectory.point_to_point(NAMES, start, end, profile="trapezoidal", limits=limits)
    assert found.stop == plain.stop
    np.testing.assert_array_equal(found.derivatives([0.3], 2), plain.derivatives([0.3], 2))
    one, two = (jn.simulate(arm, [0.0, 0.1], torque=x) for x in ([1.0, 2.0, 3.0], _labeled([1.0, 2.0, 3.0], kind)))
    np.testing.assert_array_equal(one.q, two.q)


@pytest.mark.parametrize("kind", ["array", "table"])
def test_the_start_of_a_tool_path_is_told_by_name(arm, kind):
    place = jn.forward_kinematics(arm, [[0.1, 0.2, -0.3]], "c", [0.4, 0, 0]).position[0]
    line = jn.planning.ToolPath([f"{x!r} - 0.05*sin(t)" for x in place.tolist()], start=0.0, stop=1.0)
    options = {"point": [0.4, 0, 0], "time": [0.0, 0.5]}
    given, plain = (
        jn.planning.follow_tool_path(arm, "c", line, start=x, **options)
        for x in ([0.1, 0.2, -0.3], _labeled([0.1, 0.2, -0.3], kind))
    )
    np.testing.assert_array_equal(given.q, plain.q)


def test_components_of_a_goal_are_told_by_name(arm):
    goal = pandas.Series({"z": 0.05, "y": 0.1, "x": 1.1})
    found, plain = (
        jn.inverse_kinematics(arm, "c", x, point=[0.4, 0, 0], start=[0.1, 0.2, -0.3]) for x in (goal, [1.1, 0.1, 0.05])
    )
    np.testing.assert_array_equal(found.q, plain.q)


@pytest.mark.parametrize(
    "dims, orders, says",
    [
        (("derivative", "time", "joint"), None, "q: the derivatives must be along the last axis but one: transpose it"),
        (
            ("time", "derivative", "joint"),
            [2, 1, 0],
            "its derivatives must be those of order 0, 1, 2 and so on",
        ),
        (
            ("time", "derivative", "joint"),
            [1, 2, 3],
            "its derivatives must be those of order 0, 1, 2 and so on",
        ),
    ],
)
def test_derivatives_that_lie_otherwise_are_refused(arm, dims, orders, says):
    q = xarray.DataArray(np.stack([Q] * 3), dims=dims, coords={"joint": [*NAMES]})
    with pytest.raises(JounceError) as caught:
        jn.inverse_dynamics(arm, q if orders is None else q.assign_coords(derivative=orders))
    assert says in str(caught.value)


T = np.linspace(0.0, 1.0, 6)
WAVE = np.stack([np.sin(T), np.cos(T), -np.sin(T)], axis=1)


def as_array(instants, orders, values):
    return xarray.DataArray(values, dims=("time", "derivative"), coords={"time": instants, "derivative": orders})


def as_table(instants, orders, values):
    return pandas.DataFrame(values, index=instants, columns=pandas.Index(orders, name="derivative"))


@pytest.mark.parametrize("labeled", [as_array, as_table])
@pytest.mark.parametrize("law", [jn.laws.HermiteMotion, jn.laws.HermiteSplineMotion])
def test_samples_whose_labels_have_another_order_are_refused(law, labeled):
    """Times and values that are sorted unlike, or derivatives that are not those of order 0, 1, 2 and so on."""
    given = labeled(T, [0, 1, 2], WAVE)
    instant = jn.Jet.variable(0.37, 2)
    expected = law(T, WAVE)(instant).derivatives()
    np.testing.assert_array_equal(
        law(given["time"] if labeled is as_array else given.index, given)(instant).derivatives(), expected
    )
    with pytest.raises(jn.errors.TrajectoryError, match="the times are its labels, in another order"):
        law(T, given[::-1])
    for orders in ([2, 1, 0], [1, 2, 3]):
        with pytest.raises(jn.errors.TrajectoryError, match="its derivatives must be those of order 0, 1, 2"):
            law(T, labeled(T, orders, WAVE))
    law(T - T[0] + 5.0, given)  # times that are shifted are other times


def test_a_column_goes_with_its_times():
    column = pandas.Series(WAVE[:, 0], index=T)
    with pytest.raises(JounceError, match="values: the times are its labels, in another order"):
        jn.laws.SplineMotion(T, column[::-1])
    with pytest.raises(JounceError, match="values: the times are its labels, in another order"):
        jn.laws.SplineMotion(T, column.to_xarray()[::-1])
    jn.laws.SplineMotion(column.index, column)
    jn.laws.SplineMotion(T, pandas.Series(WAVE[:, 0]))
