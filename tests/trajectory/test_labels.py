"""Labels of arrays: joints are told by their names, whatever their order, at every door of robots."""

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


ORDERED = {
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
