"""Mobility by count, by rank and by finite motions: orders at which velocities are blocked, and branches."""

import dataclasses
import importlib

import numpy as np
import pytest

import jounce as jn
from tests.problems import overconstrained


def linked(bodies, pins, **slots):
    """A planar mechanism: poses of bodies, pins as two bodies with the point on each, pins in slots of the ground."""
    joints = {f"p{k}": jn.planar.Revolute((i, j), list(a), list(b)) for k, (i, j, a, b) in enumerate(pins, start=1)}
    for name, (body, point, vector) in slots.items():
        joints[name] = jn.planar.Parallel2(("ground", body), list(point), list(point), list(vector))
    return jn.Mechanism(
        space="planar",
        bodies={name: jn.Body([float(x) for x in place], angle=angle) for name, (place, angle) in bodies.items()},
        joints=joints,
    )


def hinges_in_line(middle=1.0, off=0.0):
    """A flat triangle of two bars and the ground."""
    bodies = {"left": ((0, 0), 0.0), "right": ((middle, off), 0.0)}
    pins = [
        ("ground", "left", (0, 0), (0, 0)),
        ("left", "right", (middle, off), (0, 0)),
        ("right", "ground", (2.0 - middle, -off), (2.0, 0)),
    ]
    return linked(bodies, pins)


def flat_parallelogram(crank=1.0, base=3.0, cranks=2, size=1.0):
    feet = [size * base * k for k in range(cranks)]
    crank *= size
    bodies = {f"crank{k}": ((foot, 0), 0.0) for k, foot in enumerate(feet, start=1)} | {"beam": ((crank, 0), 0.0)}
    pins = []
    for k, foot in enumerate(feet, start=1):
        pins.append(("ground", f"crank{k}", (foot, 0), (0, 0)))
        pins.append((f"crank{k}", "beam", (crank, 0), (foot, 0)))
    return linked(bodies, pins)


def rhombus_with_dyad():
    """A rhombus folded flat, with two bars from its tip to its foot, which turn freely in the folded position."""
    bodies = {
        "AB": ((0, 0), np.pi),
        "BC": ((-1, 0), 0.0),
        "CD": ((1, 0), np.pi),
        "CE": ((0, 0), 0.0),
        "EA": ((0, 0), 0.0),
    }
    pins = [
        ("ground", "AB", (0, 0), (0, 0)),
        ("AB", "BC", (1, 0), (0, 0)),
        ("BC", "CD", (1, 0), (1, 0)),
        ("CD", "ground", (0, 0), (1, 0)),
        ("BC", "CE", (1, 0), (0, 0)),
        ("CE", "EA", (0.8, 0), (0.8, 0)),
        ("EA", "ground", (0, 0), (0, 0)),
    ]
    return linked(bodies, pins)


def cusp_mechanism(tilt=0.3):
    """A bar between a slot and the middle of Watt's coupler: its curve bends as a cube, and the bar as a square.

    As in the cusp mechanism of Connelly and Servatius (1994), two such curves meet in ``w^2 = c u^3``.
    """
    foot = 1.0 - tilt
    bodies = {
        "arm1": ((-foot, 0.5), 0.0),
        "coupler": ((0, 0), 0.0),
        "arm2": ((foot, -0.5), np.pi),
        "bar": ((0, 0), 0.0),
    }
    pins = [
        ("ground", "arm1", (-foot, 0.5), (0, 0)),
        ("arm1", "coupler", (1, 0), (tilt, 0.5)),
        ("coupler", "arm2", (-tilt, -0.5), (1, 0)),
        ("arm2", "ground", (0, 0), (foot, -0.5)),
        ("coupler", "bar", (0, 0), (0, 0)),
    ]
    return linked(bodies, pins, slot=("bar", (2, 0), (0, 1)))


def turns(branch, *names):
    """Return the initial rotation rates of the named bodies, relative to the first."""
    found = np.array([branch.tangents[name][0, 2] for name in names])
    return found / found[0]


@pytest.mark.slow
def test_three_hinges_in_a_line_are_shaky():
    found = jn.mobility(hinges_in_line(0.7))
    assert (found.kind, found.count, found.instantaneous, found.finite, found.blocked) == ("shaky", 0, 1, 0, 2)
    assert str(found).startswith("shaky: 1 ")
    assert "order 2" in str(found)
    bent = jn.mobility(hinges_in_line(0.7, 0.01))
    assert (bent.kind, str(bent)) == ("rigid", "0 degrees of freedom")


@pytest.mark.parametrize("size", [1e-3, 1.0])
def test_a_flat_parallelogram_has_two_branches_with_their_tangents(size):
    """Both cranks in the same or opposite sense: by the second derivatives of the closure, (L + r) to (L - r)."""
    crank, base = 1.0, 3.0
    found = jn.mobility(flat_parallelogram(crank, base, size=size))
    assert (found.kind, found.count, found.instantaneous, found.finite) == ("change point", 1, 2, 1)
    ratios = sorted(turns(branch, "crank1", "crank2")[1] for branch in found.branches)
    np.testing.assert_allclose(ratios, [-(base + crank) / (base - crank), 1.0], rtol=1e-9)
    assert "change point with 2 branches to order 10, tangents: " in str(found)
    assert all(branch.freedom == 1 and not branch.cusp for branch in found.branches)


@pytest.mark.slow
def test_a_third_crank_closes_one_of_two_branches():
    found = jn.mobility(flat_parallelogram(cranks=3))
    assert (found.kind, found.count, found.instantaneous, found.finite, found.blocked) == ("singular", 0, 2, 1, 2)
    np.testing.assert_allclose(turns(found.branches[0], "crank1", "crank2", "crank3"), 1.0, rtol=1e-9)
    # what only the flat position makes dependent is no redundancy
    assert [repeated.equations for repeated in found.repetitions] == [1]
    turn = jn.drivers.CoordinateDriver(("ground", "crank1"), "angle", "t")
    driven = dataclasses.replace(flat_parallelogram(cranks=3), drivers={"turn": turn})
    with pytest.raises(jn.errors.MobilityError, match=r"13 equations, 12 .* 1 equation .*singular"):
        jn.solve(driven, [0.0])


@pytest.mark.slow
def test_a_kinematotropic_linkage_has_branches_of_one_and_of_two_degrees_of_freedom():
    found = jn.mobility(rhombus_with_dyad())
    assert (found.kind, found.count, found.instantaneous, found.finite) == ("change point", 1, 3, 2)
    assert [branch.freedom for branch in found.branches] == [1, 2]
    first, second = found.branches
    np.testing.assert_allclose(turns(first, "AB", "BC", "CD"), [1.0, 0.0, 1.0], atol=1e-9)  # the rhombus
    assert np.abs(second.tangents["CD"]).max() < 1e-9  # its tip stays at the foot
    assert second.tangents["EA"].shape == (2, 3)


@pytest.mark.slow
def test_a_cusp_is_reported():
    found = jn.mobility(cusp_mechanism())
    assert (found.kind, found.count, found.instantaneous, found.finite) == ("cusp", 1, 2, 1)
    (branch,) = found.branches
    assert branch.cusp
    # the bar is carried across its length at first, as it stays perpendicular to the slot
    np.testing.assert_allclose(branch.tangents["bar"][0, [0, 2]], 0.0, atol=1e-6)
    assert abs(branch.tangents["bar"][0, 1]) > 0.1


@pytest.mark.slow
def test_a_flatter_cusp_than_series_find_is_not_called_shaky():
    """With arms perpendicular to the coupler, Watt's curve bends as the fifth power, and the motion continues."""
    found = jn.mobility(cusp_mechanism(tilt=0.0))
    assert found.kind in ("cusp", "singular")
    assert found.finite == 1


@pytest.mark.slow
@pytest.mark.parametrize("name, count", [("bennett", -2), ("goldberg", -1)])
def test_overconstrained_linkages_are_finite(name, count):
    case = getattr(overconstrained, name)()
    found = jn.mobility(case.mechanism, order=10)
    assert (found.kind, found.count, found.instantaneous, found.finite, found.order) == ("regular", count, 1, 1, 10)
    assert str(found) == "1 degree of freedom, finite to order 10"
    assert sum(repeated.equations for repeated in found.repetitions) == case.redundant


@pytest.mark.slow
def test_hinges_that_are_nearly_a_bennett_linkage_are_a_structure():
    hinges = overconstrained.bennett_hinges(1.2, (0.9, 1.4))
    bent = [(np.add(point, [0.0, 0.0, 1e-3 * (k == 1)]), axis) for k, (point, axis) in enumerate(hinges)]
    found = jn.mobility(overconstrained.hinged_loop(bent, "0*t"))
    assert found.finite == 0
    assert found.kind in ("rigid", "shaky")


def test_an_ordinary_mechanism_costs_no_series(monkeypatch):
    monkeypatch.setattr(importlib.import_module("jounce.kinematics.assembly.mobility"), "ReducedConstraints", None)
    found = jn.mobility(jn.load("examples/four_bar.yaml"))
    assert (found.kind, found.count, found.instantaneous, found.finite, found.order) == ("regular", 1, 1, 1, None)
    free = jn.Mechanism(space="spatial", bodies={"stone": jn.Body([0, 0, 0])}, joints={})
    assert str(jn.mobility(free)) == "6 degrees of freedom"


def test_a_mechanism_is_looked_at_where_its_drivers_and_initial_conditions_hold_it():
    parallelogram = flat_parallelogram()
    poses = {
        name: dataclasses.replace(body, angle=0.3 if name != "beam" else 0.0)
        for name, body in parallelogram.bodies.items()
    }
    turn = jn.drivers.CoordinateDriver(("ground", "crank1"), "angle", "0.3 + t")
    driven = dataclasses.replace(parallelogram, bodies=poses, drivers={"turn": turn})
    begun = dataclasses.replace(parallelogram, bodies=poses, initial={"turn": turn})
    for mechanism in (driven, begun):
        assert str(jn.mobility(mechanism)) == "1 degree of freedom"


@pytest.mark.parametrize("order", [1, 21])
def test_an_order_out_of_bounds_is_refused(order):
    with pytest.raises(jn.errors.MechanismError, match="order: must be a whole number from 2 to 20"):
        jn.mobility(hinges_in_line(), order=order)


def test_what_cannot_be_put_together_is_refused():
    with pytest.raises(jn.errors.AssemblyError):
        jn.mobility(jn.load("examples/four_bar.yaml").with_parameters(BC=0.9))
