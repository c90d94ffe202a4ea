"""The search for what a test uses finds all of it, and nothing else."""

import functools

import numpy as np
import pytest

import jounce as jn
from jounce import rigid, spatial
from jounce.jet import Jet
from jounce.rigid import PlanarPose, rotation_matrix as turned
from tests.contracts import calls
from tests.problems.states import planar_pose, planar_state

KINDS = {"ball": jn.spatial.Spherical, "rod": lambda *given: jn.spatial.DoubleSpherical(*given)}


class Holder:
    def __init__(self, state):
        self.state, self.pose = state, planar_pose(state)

    @property
    def place(self):
        return self.pose.point([0.0, 0.0])

    def point(self, local):
        return local


driver_of_output = functools.cache(Holder)


@pytest.fixture
def helper():
    return jn.load


def by_alias():
    return turned("ZYX", Jet([np.zeros(3)]))


def by_fixture(helper):
    return helper


def by_table():
    return KINDS["ball"]


def by_cache_and_property():
    return driver_of_output(planar_state(np.random.default_rng(0))).place


def by_local_variable():
    pose, _ = planar_pose(), 1
    return pose.direction([1.0, 0.0])


def only_asked_for(x: rigid.SpatialPose) -> spatial.Revolute:
    assert isinstance(x, spatial.Cylindrical)
    with pytest.raises(jn.errors.MobilityError):
        return x
    return x


def only_called_alike():
    holder = Holder(planar_state(np.random.default_rng(0)))
    return holder.point([0.0, 0.0])


def shadowed(turned):
    load = by_local_variable
    return turned("ZYX"), load


def uses(function, one):
    return calls.among(one, calls.used_by(__name__, function.__name__))


@pytest.mark.parametrize(
    "function, expected",
    [
        (by_alias, rigid.rotation_matrix),
        (by_alias, Jet),
        (by_fixture, jn.load),
        (by_table, jn.spatial.Spherical),
        (by_table, jn.spatial.DoubleSpherical),
        (by_cache_and_property, PlanarPose.point),
        (by_local_variable, PlanarPose.direction),
        (shadowed, PlanarPose.direction),
    ],
)
def test_what_is_used_is_found(function, expected):
    assert uses(function, expected)


@pytest.mark.parametrize(
    "function, other",
    [
        (only_asked_for, spatial.Cylindrical),
        (only_asked_for, spatial.Revolute),
        (only_asked_for, rigid.SpatialPose),
        (only_asked_for, jn.errors.MobilityError),
        (only_called_alike, PlanarPose.point),
        (shadowed, rigid.rotation_matrix),
        (shadowed, jn.load),
        (by_local_variable, PlanarPose.point),
        (by_alias, jn.solve),
    ],
)
def test_what_is_not_used_is_not_found(function, other):
    assert not uses(function, other)
