"""Transmission angles and types of linkages, against their geometry."""

import dataclasses

import numpy as np
import pytest

import jounce as jn
from jounce.kinematics.transmission import FourBar, SliderCrank, extremes, recognized
from tests.problems.linkages import FourBar as RandomFourBar, SliderCrank as RandomSliderCrank

TYPES = {
    (1.0, 3.0, 2.5, 3.2): "crank-rocker",
    (3.0, 3.2, 2.5, 1.0): "double-crank",
    (3.0, 1.0, 2.5, 3.2): "double-rocker",
    (2.5, 3.0, 1.0, 3.2): "rocker-crank",
    (3.0, 2.0, 2.5, 3.6): "triple-rocker",
    (1.0, 2.0, 1.0, 2.0): "change-point",
}


@pytest.mark.parametrize("lengths, kind", TYPES.items())
def test_types_of_grashof(lengths, kind):
    mechanism = RandomFourBar().mechanism.with_parameters(**dict(zip("abcd", lengths, strict=True)))
    found = recognized(mechanism, "drive")
    assert found.type.startswith(kind)


@pytest.mark.slow
@pytest.mark.parametrize("family, point", [(RandomFourBar(), "C"), (RandomSliderCrank(), "B")])
def test_extremes_are_those_along_the_curve(family, point):
    for seed in range(6):
        linkage = family.linkage(np.random.default_rng(seed), False)[0]
        curve = jn.trace(linkage.mechanism, 0.0, count=2001, order=0)
        found = recognized(linkage.mechanism, "drive")
        (least, least_at), (most, _) = extremes(found, *curve.range)
        assert found.transmission(least_at) == pytest.approx(least)
        angles = _angles(linkage, curve, point)
        branch = curve.branches[0]
        on = (curve.arc_lengths >= branch.start) & (curve.arc_lengths <= branch.stop)
        on |= curve.arc_lengths - curve.length >= branch.start
        np.testing.assert_allclose([angles[on].min(), angles[on].max()], [least, most], atol=2e-3)
        assert angles[on].min() > least - 1e-6
        assert angles[on].max() < most + 1e-6


def _angles(linkage, curve, point):
    """Return the transmission angle from the positions of the points."""
    values, theta = linkage.values, curve.values[:, 0]
    tip = values["a"] * np.stack([np.cos(theta), np.sin(theta)], axis=1)
    rod = curve.outputs[point][:, 0] - tip
    if point == "C":
        second = curve.outputs["C"][:, 0] - np.array([values["d"], 0.0])
    else:
        second = np.broadcast_to([0.0, 1.0], rod.shape)  # the normal of the guide
    cosine = np.sum(rod * second, axis=1) / np.linalg.norm(rod, axis=1) / np.linalg.norm(second, axis=1)
    return np.arccos(np.minimum(np.abs(cosine), 1.0))


def test_a_four_bar_of_hinges_turned_in_its_frames():
    """The driver angle belongs to a frame not aligned with the crank, on a slanted ground."""
    crank = FourBar(1.0, 3.0, 2.5, 3.2, 0.0)
    turn = 0.7
    ground = 3.2 * np.array([np.cos(0.3), np.sin(0.3)])
    mechanism = jn.Mechanism(
        space="planar",
        bodies={k: jn.Body([0, 0]) for k in ("crank", "coupler", "rocker")},
        joints={
            "A": jn.planar.Revolute(("crank", "ground"), [0, 0], [0, 0]),
            "B": jn.planar.Revolute(("crank", "coupler"), [np.cos(turn), np.sin(turn)], [1, 1]),
            "C": jn.planar.Revolute(("rocker", "coupler"), [0, 2.5], [1, 4]),
            "D": jn.planar.Revolute(("ground", "rocker"), ground, [0, 0]),
        },
        drivers={"drive": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", "t")},
    )
    found = recognized(mechanism, "drive")
    np.testing.assert_allclose(found.offset, 0.3 - turn)
    np.testing.assert_allclose(found.transmission(0.3 - turn + 1.1), crank.transmission(1.1))


@pytest.mark.slow
def test_what_is_no_four_bar_is_not_taken_for_one():
    for name in ("six_bar_watt", "six_bar_stephenson", "gear_pair", "rssr", "quick_return"):
        mechanism = jn.load(f"examples/{name}.yaml")
        assert recognized(mechanism, next(iter(mechanism.drivers))) is None
    driven = RandomFourBar().mechanism
    at_rod = dataclasses.replace(driven.drivers["drive"], bodies=("crank", "rocker"))
    assert recognized(dataclasses.replace(driven, drivers={"drive": at_rod}), "drive") is None


def test_a_slider_crank_that_turns_and_one_that_rocks():
    assert SliderCrank(1.0, 3.0, 0.5, 0.0).type == "slider-crank"
    assert "only rocks" in SliderCrank(1.0, 1.2, 0.5, 0.0).type
