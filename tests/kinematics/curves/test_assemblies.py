"""All assemblies of linkages, against elimination; circuits and branches; the assembly that a file selects."""

import dataclasses

import numpy as np
import pytest

import jounce as jn
from jounce import drivers, planar
from tests.oracles.six_bar_assemblies import crank_angles
from tests.problems.branch_study import FAMILIES
from tests.problems.linkages import FourBar
from tests.problems.small import slider_crank

FOUR_BAR, STEPHENSON = FourBar(), FAMILIES["Stephenson III at the link"]
NAMES = ("a", "b", "c", "d", "px", "py", "l", "r", "qx", "qy")


def four_bar(a, b, c, d, value=1.0):
    values = {"a": a, "b": b, "c": c, "d": d}
    start = FOUR_BAR.assembly(values, value, np.random.default_rng(0))
    guess = map(float, FOUR_BAR.guess(values, value, start))
    known = dict(zip(FOUR_BAR.guessed, guess, strict=True))
    return FOUR_BAR.mechanism.with_parameters(**values, start=value, **known)


def six_bar(number):
    linkage = STEPHENSON.linkage(np.random.default_rng([11, number]), False)[0]
    angles, degree = crank_angles(*(linkage.values[name] for name in NAMES), linkage.law(0.0))
    assert degree == 6
    return linkage.mechanism, np.array(angles)


def agree(found, angles):
    """Return whether the assemblies have exactly the given crank angles, each once."""
    crank = np.array([x.mechanism.bodies["crank"].angle for x in found])
    away = np.abs(np.angle(np.exp(1j * (crank[:, None] - angles))))
    return len(crank) == len(angles) and away.min(axis=0).max() < 1e-8 and away.min(axis=1).max() < 1e-8


@pytest.mark.slow
def test_all_assemblies_of_a_stephenson_linkage():
    mechanism, angles = six_bar(0)
    assert agree(jn.assemblies(mechanism, 0.0, circuits=False), angles)


@pytest.mark.slow
def test_all_assemblies_of_many_stephenson_linkages():
    counts = []
    for number in range(1, 3):
        mechanism, angles = six_bar(number)
        assert agree(jn.assemblies(mechanism, 0.0, circuits=False), angles), number
        counts.append(len(angles))
    assert max(counts) >= 4


@pytest.mark.slow
def test_circuits_and_branches_of_four_bars():
    turning = jn.assemblies(four_bar(1.0, 3.0, 2.5, 3.2))
    assert [(x.circuit, x.branch) for x in turning] == [(1, 1), (2, 1)]
    rocking = jn.assemblies(four_bar(3.0, 2.0, 2.5, 3.2))
    assert [(x.circuit, x.branch) for x in rocking] == [(1, 1), (1, 2)]
    crossing = jn.assemblies(four_bar(1.0, 2.0, 1.0, 2.0))  # both branches cross at change points
    assert [(x.circuit, x.branch) for x in crossing] == [(1, 1), (1, 2)]


@pytest.mark.slow
def test_a_kite_has_two_assemblies_on_one_circuit():
    kite = jn.Mechanism(  # crank and rod alike, rocker and ground alike: folded, crank and rod turn as one body
        space="planar",
        bodies={"crank": jn.Body([0, 0], 0.7), "rod": jn.Body([0.76, 0.64], 0.76), "rocker": jn.Body([2, 0], 2.5)},
        joints={
            "A": planar.Revolute(("ground", "crank"), [0, 0], [0, 0]),
            "B": planar.Revolute(("crank", "rod"), [1, 0], [0, 0]),
            "C": planar.Revolute(("rod", "rocker"), [1, 0], [2, 0]),
            "D": planar.Revolute(("ground", "rocker"), [2, 0], [0, 0]),
        },
        drivers={"turn": drivers.CoordinateDriver(("ground", "crank"), "angle", motion="0.7 + t")},
    )
    found = jn.assemblies(kite, 0.0, count=8)
    assert len(found) == 2
    assert len(found.circuits) == 1


@pytest.mark.slow
def test_what_is_found_does_not_depend_on_the_seed():
    first, second = (jn.assemblies(four_bar(1.0, 3.0, 2.5, 3.2), seed=k, circuits=False) for k in (0, 5))
    for one, other in zip(first, second, strict=True):
        np.testing.assert_allclose(one.mechanism.bodies["rocker"].angle, other.mechanism.bodies["rocker"].angle)
        assert one.hits != other.hits or one.distance == pytest.approx(other.distance)
    assert first.since_last_new > 900


@pytest.mark.slow
def test_a_slider_that_lies_turned_over_in_its_guide_is_no_assembly():
    found = jn.assemblies(slider_crank(), 1.0, circuits=False)
    assert len(found) == 2
    heights = [x.mechanism.bodies["slider"].position[0] for x in found]
    expected = np.cos(1.0) + np.array([1, -1]) * np.sqrt(9 - np.sin(1.0) ** 2)
    np.testing.assert_allclose(sorted(heights), sorted(expected), atol=1e-12)


@pytest.mark.slow
def test_a_spatial_linkage():
    linkage = jn.assemblies(jn.load("examples/rsur.yaml"), circuits=False)  # the coupler also turned over in its cross
    spins = [2 * np.arccos(min(abs(_turn_between(linkage[0], other)), 1.0)) for other in linkage[:2]]
    np.testing.assert_allclose(spins, [0.0, np.pi], atol=1e-7)
    assert len(linkage) == 4


def folding_six_bar():
    """A four-bar with two equal links from its joint C to one of the two positions of C, where they fold and spin."""
    crank, rocker = np.array([np.cos(1.0), np.sin(1.0)]), np.array([3.0, 0.0])
    middle, along = (crank + rocker) / 2, rocker - crank
    across = np.array([-along[1], along[0]]) / np.linalg.norm(along) * np.sqrt(2.5**2 - along @ along / 4)
    points = {"above": middle + across, "below": middle - across}
    base = list(map(float, points["above"]))
    revolutes = {
        "A": ("ground", "crank", [0, 0], [0, 0]),
        "D": ("ground", "rocker", [3, 0], [0, 0]),
        "C": ("rocker", "first", [2.5, 0], [0, 0]),
        "G": ("ground", "second", base, [0, 0]),
        "E": ("first", "second", [2.5, 0], [2.5, 0]),
    }
    joints = {name: planar.Revolute((i, j), p, q) for name, (i, j, p, q) in revolutes.items()}
    joints["BC"] = planar.DoubleRevolute(("crank", "rocker"), [1, 0], [2.5, 0], 2.5)
    down = float(np.arctan2(*(points["below"] - rocker)[::-1]))
    poses = {"crank": ([0, 0], 1.0), "rocker": ([3, 0], down), "first": (list(map(float, points["below"])), 0.5)}
    return jn.Mechanism(
        space="planar",
        bodies={name: jn.Body(*pose) for name, pose in {**poses, "second": (base, -0.5)}.items()},
        joints=joints,
        drivers={"turn": drivers.CoordinateDriver(("ground", "crank"), "angle", "1 + t")},
    ), points["below"]


@pytest.mark.slow
def test_configurations_that_move_with_the_driver_held_are_no_assemblies():
    mechanism, below = folding_six_bar()
    found = jn.assemblies(mechanism, 0.0, circuits=False)
    assert len(found) == 2
    assert found.movable > 100
    assert "move with the drivers held" in repr(found)
    for assembly in found:
        np.testing.assert_allclose(assembly.mechanism.bodies["first"].position, below, atol=1e-12)


def _turn_between(first, second):
    return np.dot(*(np.asarray(x.mechanism.bodies["coupler"].orientation) for x in (first, second)))


def test_a_loop_that_cannot_close():
    with pytest.raises(jn.errors.AssemblyError, match="cannot be assembled"):
        jn.assemblies(four_bar(1.0, 3.0, 2.5, 3.2).with_parameters(d=20.0), circuits=False)


def test_degrees_of_freedom_that_are_left():
    with pytest.raises(jn.errors.MobilityError, match="infinitely many"):
        jn.assemblies(dataclasses.replace(four_bar(1.0, 3.0, 2.5, 3.2), drivers={}))


def test_a_number_that_is_not_there():
    with pytest.raises(jn.errors.AssemblyError, match="2 were found"):
        jn.assemblies(four_bar(1.0, 3.0, 2.5, 3.2), circuits=False).number(3)


@pytest.mark.slow
@pytest.mark.parametrize("wish, side", [({"rocker": "above"}, 1), ({"rocker": "below"}, -1)])
def test_a_motion_of_the_assembly_that_is_wished_for(wish, side):
    mechanism = dataclasses.replace(four_bar(1.0, 3.0, 2.5, 3.2), assembly=wish)
    motion = jn.solve(mechanism, [0.0, 0.01], order=1)
    assert np.sign(motion.outputs["C"][0, 0, 1]) == side


@pytest.mark.slow
def test_a_motion_of_the_assembly_of_a_number():
    mechanism = four_bar(1.0, 3.0, 2.5, 3.2)
    tips = [
        jn.solve(dataclasses.replace(mechanism, assembly=k), [0.0, 0.01], order=1).outputs["C"][0, 0] for k in (1, 2)
    ]
    found = jn.assemblies(mechanism)
    for tip, assembly in zip(tips, found, strict=True):
        angle = assembly.mechanism.bodies["rocker"].angle
        np.testing.assert_allclose(tip, [3.2 + 2.5 * np.cos(angle), 2.5 * np.sin(angle)], atol=1e-12)


def test_a_wish_that_tells_nothing_apart():
    mechanism = dataclasses.replace(four_bar(1.0, 3.0, 2.5, 3.2), assembly={"crank": "above"})
    with pytest.raises(jn.errors.AssemblyError, match="assemblies 1 and 2 fit equally well"):
        jn.solve(mechanism, [0.0, 0.01])


@pytest.mark.parametrize("wish", [0, True, "second", {}, {"rocker": "up"}, {"rockr": "above"}, 1.5])
def test_wishes_that_make_no_sense(wish):
    with pytest.raises(jn.errors.MechanismError, match="assembly"):
        dataclasses.replace(four_bar(1.0, 3.0, 2.5, 3.2), assembly=wish)
