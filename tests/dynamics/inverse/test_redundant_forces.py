"""Reactions of redundant joints: the unique ones as in a model without redundancy, the others NaN, or as chosen."""

import dataclasses
import functools

import numpy as np
import pytest

import jounce as jn
from jounce.dynamics.forward.initial_state import consistent_start
from tests.problems import overconstrained
from tests.problems.overconstrained import ORIGIN, Z

MASS, LENGTH, GRAVITY = 3.0, 0.8, 9.81
TIMES = [0.0, 0.4]


def door(law="0.3*t + 0.2*t**2", **given):
    """A door on two hinges, one above the other, turned about the vertical."""
    hinge = {"axis_i": Z, "axis_j": Z}
    return jn.Mechanism(
        space="spatial",
        gravity=[0, 0, -GRAVITY],
        bodies={"door": jn.Body(ORIGIN, mass=MASS, inertia=[0.1, 0.2, 0.3], center_of_mass=[0.5, 0, LENGTH / 2])},
        joints={
            "lower": jn.spatial.Revolute(("ground", "door"), ORIGIN, ORIGIN, **hinge),
            "upper": jn.spatial.Revolute(("ground", "door"), [0, 0, LENGTH], [0, 0, LENGTH], **hinge),
        },
        drivers={"turn": jn.drivers.RotationDriver(("ground", "door"), Z, law)} if law else {},
        **given,
    )


def of_both(motion, derivative=0):
    """Return force and torque of the lower and of the upper hinge, (time, 3) each."""
    reactions = [jn.joint_reaction(motion, name) for name in ("lower", "upper")]
    return [part.sel(derivative=derivative).values for r in reactions for part in (r.force, r.torque)]


@pytest.mark.slow
def test_what_two_hinges_share_has_no_unique_reaction():
    motion = jn.solve(door(), TIMES, order=3)
    for force, torque in zip(*[iter(of_both(motion))] * 2, strict=True):
        assert np.isnan(force).all()
        np.testing.assert_array_equal(np.isnan(torque), [[True, True, False]] * 2)
    comment = jn.joint_reaction(motion, "upper").force.attrs["comment"]
    assert comment.startswith("not unique, as constraints are redundant: joint upper repeats 5 equations of lower")
    torque = jn.driver_force(motion, "turn")
    assert "comment" not in torque.attrs
    inertia = 0.3 + MASS * 0.25
    np.testing.assert_allclose(torque.values, [[inertia * 0.4, 0, 0]] * 2, atol=1e-12)
    rows = jn.constraint_equations(motion).multipliers
    assert np.isnan(rows.sel(row=["lower.1", "upper.5"])).all()
    assert np.isfinite(rows.sel(row="turn.1", derivative=[0, 1, 2])).all()


def shared(stiffness):
    """Return forces and couples across the axis of both hinges, (10,), that share the weight by stiffnesses, (10,)."""
    balance = np.zeros((5, 10))  # of forces, and of couples about the origin
    for k, height in enumerate((0.0, LENGTH)):
        balance[:3, 5 * k : 5 * k + 3] = np.eye(3)
        balance[3, 5 * k + 1], balance[4, 5 * k] = -height, height  # r x F with r along z
        balance[3, 5 * k + 3] = balance[4, 5 * k + 4] = 1.0
    weight = MASS * GRAVITY * np.array([0, 0, 1, 0, -0.5])
    return stiffness * (balance.T @ np.linalg.solve(balance * stiffness @ balance.T, weight))


ACROSS = [0, 1, 2, 3, 4, 6, 7, 8, 9, 10]  # of force and torque of both


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.5, 0.2])
def test_elastic_hinges_share_the_weight_by_their_stiffness(share):
    stiffness = [{"force": 1e7 * part, "torque": 3e4} for part in (1 - share, share)]
    chosen = dict(zip(("lower", "upper"), stiffness, strict=True))
    motion = jn.solve(door(law="0*t", redundant_reactions=chosen), TIMES, order=2)
    found = np.concatenate([x[0] for x in of_both(motion)])[ACROSS]
    expected = shared(np.concatenate([[x["force"]] * 3 + [x["torque"]] * 2 for x in stiffness]))
    np.testing.assert_allclose(found, expected, atol=1e-10 * MASS * GRAVITY)
    assert found[7] == pytest.approx(share * MASS * GRAVITY)  # springs side by side
    asked = jn.joint_reaction(jn.solve(door(law="0*t"), TIMES, order=2), "upper", redundant=chosen)
    np.testing.assert_array_equal(asked.force.values[0, 0], found[5:8])


@pytest.mark.slow
def test_stiffnesses_that_decide_nothing_are_refused():
    with pytest.raises(jn.errors.MechanismError, match="leaves reactions open"):
        jn.joint_reaction(jn.solve(door(redundant_reactions={"turn": {"torque": 1.0}}), TIMES, order=3), "lower")


@pytest.mark.parametrize(
    "choice, message",
    [
        ("all", "redundant_reactions: must be one of unique, least_norm, or stiffnesses"),
        ({}, "must name a joint"),
        ({"middle": {"force": 1.0}}, "no joint has this name"),
        ({"lower": 3.0}, "redundant_reactions.lower: must be the stiffness of the joint"),
        ({"lower": {"bend": 1.0}}, "must be the stiffness of the joint"),
    ],
)
def test_bad_choices_are_refused(choice, message):
    with pytest.raises(jn.errors.MechanismError, match=message):
        door(redundant_reactions=choice)


@pytest.mark.slow
def test_a_stiffness_must_be_above_zero():
    motion = jn.solve(door(redundant_reactions={"lower": {"force": "0*3"}}), TIMES, order=4)
    with pytest.raises(jn.errors.MechanismError, match=r"redundant_reactions\.lower\.force: .*stiffness"):
        jn.joint_reaction(motion, "lower")


@pytest.mark.slow
def test_the_least_norm_is_that_of_a_pseudo_inverse_whatever_the_frames_and_units():
    """Of all forces and couples at both hinges, over a length, those that balance the weight with the least squares."""
    motion = jn.solve(door(law="0*t", redundant_reactions="least_norm"), TIMES, order=2)
    length = motion.model.length
    found = np.concatenate([x[0] for x in of_both(motion)])[ACROSS]
    np.testing.assert_allclose(found, shared(np.array(([1.0] * 3 + [length**2] * 2) * 2)), atol=1e-10 * MASS * GRAVITY)


@pytest.mark.slow
def test_rates_of_a_choice_are_its_derivatives():
    motion = jn.solve(door(redundant_reactions="least_norm"), np.linspace(0.0, 0.4, 401), order=3)
    for value, rate in zip(of_both(motion, 0), of_both(motion, 1), strict=True):
        slope = (value[4:] - 8 * value[3:-1] + 8 * value[1:-3] - value[:-4]) / (12 * 1e-3)
        np.testing.assert_allclose(-slope, rate[2:-2], atol=1e-6 * (1 + np.abs(rate).max()))


def planar_twin(space, law):
    return overconstrained.four_bar_of_hinges(space=space, law=law, masses=True)


@functools.cache
def flat_and_wide(law):
    """Return the motion of the driven four-bar, in the plane and in space."""
    return [jn.solve(planar_twin(space, law), np.linspace(0, 1, 5), order=3) for space in ("planar", "spatial")]


@pytest.mark.slow
@pytest.mark.parametrize("law", [f"0.7 + {overconstrained.LAW}", ""], ids=["driven", "free"])
def test_a_four_bar_of_hinges_in_space_has_the_forces_of_the_plane(law):
    """Driven or moved by its weight: the same motion, unique forces in the plane, none across it."""
    order, times = 3 if law else 2, np.linspace(0, 1, 5)
    flat, wide = (
        flat_and_wide(law)
        if law
        else (jn.simulate(planar_twin(space, law), times, order=order) for space in ("planar", "spatial"))
    )
    for k in range(order + 1):
        expected = flat.outputs["C"][:, k]
        assert np.abs(wide.outputs["C"][:, k, :2] - expected).max() <= 1e-11 * np.abs(expected).max()
    for name in "ABCD":
        expected, found = jn.joint_reaction(flat, name), jn.joint_reaction(wide, name)
        for k in range(order - 1):
            of_plane, of_space = (x.force.sel(derivative=k).values for x in (expected, found))
            assert np.abs(of_space[:, :2] - of_plane).max() <= 1e-10 * np.abs(of_plane).max()
            assert np.isnan(of_space[:, 2]).all()
        np.testing.assert_array_equal(np.isnan(found.torque.values[:, 0]), [[True, True, False]] * len(times))
    if law:
        expected, found = (jn.driver_force(motion, "turn").values for motion in (flat, wide))
        np.testing.assert_allclose(found, expected, rtol=1e-10)
        energies = [jn.energy.kinetic_energy(motion).total.values for motion in (flat, wide)]
        np.testing.assert_allclose(*energies, rtol=1e-11)
    else:
        assert "1 degree of freedom" in wide.mobility


@pytest.mark.slow
@pytest.mark.parametrize("rate, agrees", [("0.2*t", True), ("0.3*t", False)])
def test_initial_conditions_that_say_the_same_twice_must_agree_in_their_rates(rate, agrees):
    swing = dataclasses.replace(door(law=""), gravity=[0, -1.0, 0])
    laws = {"one": "0.1 + 0.2*t", "two": f"0.1 + {rate}"}
    starts = {name: jn.drivers.RotationDriver(("ground", "door"), Z, law) for name, law in laws.items()}
    begun = dataclasses.replace(swing, initial=starts)
    if agrees:
        state = consistent_start(begun, 0.0).state
        half = [np.cos(0.05), 0, 0, np.sin(0.05)]
        np.testing.assert_allclose(state.attitude[:, 0, 0], half, rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(state.spin[:, 0, 0], [0, 0, 0.2], rtol=1e-12, atol=1e-15)
    else:
        with pytest.raises(jn.errors.AssemblyError, match=r"contradict .*rates .*initial\.two"):
            jn.simulate(begun, [0.0])


@pytest.mark.slow
def test_forces_in_the_coordinates_of_the_driver_are_those_of_the_plane():
    flat, wide = flat_and_wide(f"0.7 + {overconstrained.LAW}")
    found, expected = (jn.dynamics.newton_euler(motion).values for motion in (wide, flat))
    np.testing.assert_allclose(found, expected, rtol=1e-10)
