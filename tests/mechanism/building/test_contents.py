"""Contents of mechanisms: equal only where all values are, to the last bit, and models that nothing outside changes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce.mechanism import build
from jounce.mechanism.building.contents import contents_of


def mechanism(**changed):
    """Return a crank with a rocker, of which a test changes something."""
    parts = {
        "parameters": {"AB": 0.04, "BC": 0.1423},
        "bodies": {"crank": jn.Body([0.0, 0.0], 0.5), "rocker": jn.Body([0.1321, 0.0], 1.7)},
        "joints": {
            "A": jn.planar.Revolute(("ground", "crank"), [0.0, 0.0], [0.0, 0.0]),
            "D": pin(),
            "BC": jn.planar.DoubleRevolute(("crank", "rocker"), ["AB", 0.0], [0.2031, 0.0], "BC"),
        },
        "drivers": {"theta": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", motion="0.5 + t")},
        "outputs": {"psi": jn.outputs.AngleOutput("rocker")},
    }
    return jn.Mechanism(space="planar", **(parts | changed))


def pin(point=(0.1321, 0.0), bodies=("ground", "rocker"), kind=jn.planar.Revolute):
    """Return the joint of the rocker and the ground."""
    return kind(bodies, point, [0.0, 0.0])


def pinned(*given, **named):
    """Return the mechanism with another joint of the rocker and the ground."""
    return mechanism(joints={**mechanism().joints, "D": pin(*given, **named)})


def driven(motion):
    """Return the mechanism with another law."""
    return mechanism(drivers={"theta": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", motion=motion)})


CHANGES = {
    "parameter": lambda: mechanism(parameters={"AB": 0.04, "BC": float(np.nextafter(0.1423, 1.0))}),
    "name of a parameter": lambda: mechanism(parameters={"AB": 0.04, "BC": 0.1423, "X": 1.0}),
    "sign of zero": lambda: pinned([0.1321, -0.0]),
    "whole number": lambda: pinned([0.1321, 0]),
    "array": lambda: pinned(np.array([0.1321, 0.0])),
    "bodies": lambda: pinned(bodies=("rocker", "ground")),
    "order": lambda: mechanism(joints=dict([*mechanism().joints.items()][::-1])),
    "class": lambda: mechanism(outputs={"psi": jn.outputs.PointOutput("rocker", [0.0, 0.0])}),
    "formula": lambda: driven("0.5 + 2*t"),
    "guess": lambda: mechanism(bodies={"crank": jn.Body([0, 0], 0.5), "rocker": jn.Body([0.1321, 0.0], 1.71)}),
    "gravity": lambda: mechanism(gravity=[0.0, -9.81]),
}


@pytest.mark.parametrize("change", CHANGES)
def test_any_other_value_makes_other_contents(change):
    """Mechanisms that differ in one value, in its type or its sign have different contents."""
    assert contents_of(mechanism()) is not None
    assert contents_of(CHANGES[change]()) not in (None, contents_of(mechanism()))


def test_equal_values_make_equal_contents_and_one_model():
    """The third model of equal contents is that of the second, whatever objects hold the values."""
    build(mechanism())
    kept = build(mechanism())
    assert contents_of(mechanism()) == contents_of(mechanism())
    assert build(mechanism()) is kept
    assert build(mechanism(parameters={"AB": 0.04, "BC": 0.15})) is not kept


def test_a_nested_list_is_distinguished_from_its_entries():
    """Where lists begin and end belongs to the contents."""
    inner = np.zeros(1)
    nested = [[[1.0, inner], [3.0]], [[1.0], [inner, 3.0]], [1.0, inner, [3.0]], [[1.0, inner, 3.0]], [1.0, inner, 3.0]]
    assert len({contents_of(mechanism(), x) for x in nested}) == len(nested)


def test_arrays_of_the_same_bytes_are_distinguished():
    """The shape and the type of an array belong to the contents."""
    arrays = [np.zeros((2, 3)), np.zeros((3, 2)), np.zeros(6), np.zeros(6, int)]
    assert len({contents_of(mechanism(), x) for x in arrays}) == len(arrays)


def test_a_parameter_that_is_changed_and_changed_back_is_seen():
    """Solutions follow a parameter, and those of equal values are equal to the last bit."""

    def psi(length):
        return jn.solve(mechanism(parameters={"AB": 0.04, "BC": length}), [0.0, 0.2], order=2).outputs["psi"]

    lengths = [0.14, 0.14, 0.14, 0.15, 0.14, 0.15, 0.15, 0.15]
    found = [psi(length) for length in lengths]
    for length, value in zip(lengths, found, strict=True):
        assert np.array_equal(value, found[lengths.index(length)])
    assert not np.array_equal(found[0], found[3])


def test_a_value_that_is_changed_in_place_is_seen():
    """The contents follow entries of what a mechanism holds, where they can be changed at all."""
    given = mechanism()
    before = contents_of(given)
    object.__setattr__(given.joints["D"], "point_i", (0.1322, 0.0))
    assert contents_of(given) not in (None, before)
    object.__setattr__(given.joints["D"], "point_i", (0.1321, 0.0))
    assert contents_of(given) == before
    array = np.array([0.1321, 0.0])
    object.__setattr__(given.joints["D"], "point_i", array)
    whole = [build(given) for _ in range(3)][-1].system.groups[0].element.point_i.copy()
    array[0] = 0.2
    assert build(given).system.groups[0].element.point_i[0, 1, 0] == 0.2
    array[0] = 0.1321
    assert np.array_equal(build(given).system.groups[0].element.point_i, whole)


def test_nobody_writes_to_a_model_that_is_kept():
    """Arrays of a kept model are read-only, and are not those of the user."""
    given, array = mechanism(), np.array([0.1321, 0.0])
    object.__setattr__(given.joints["D"], "point_i", array)
    model = [build(given) for _ in range(3)][-1]
    arrays = [x for x in jax.tree.leaves((model.system, model.guess)) if isinstance(x, np.ndarray)]
    assert arrays
    assert not any(x.flags.writeable or np.shares_memory(x, array) for x in arrays)
    assert array.flags.writeable


class OwnJoint(jn.planar.Revolute):
    """A joint of a user."""


USERS = {
    "function": lambda: driven(jnp.sin),
    "class": lambda: pinned(kind=OwnJoint),
}


@pytest.mark.parametrize("what", USERS)
def test_what_users_wrote_has_no_contents(what):
    """Functions and classes of users may compute something else next time, and are read again."""
    assert contents_of(USERS[what]()) is None


def test_a_method_that_is_replaced_is_read(monkeypatch):
    """A class of this package with a method of a user has no contents."""
    given = mechanism()
    monkeypatch.setattr(jn.planar.Revolute, "residual", lambda self, body_i, body_j, time: None)
    assert contents_of(given) is None
