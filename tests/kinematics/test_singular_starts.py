"""Starts at a change point: rounding leaves bodies a little off it, where one more equation seems independent."""

import dataclasses

import numpy as np
import pytest

import jounce as jn
from jounce.kinematics import Status
from jounce.linear_algebra import host_jacobian

TIME = np.linspace(0.0, 0.1, 3)
FLAT = (90e-3, 140e-3, 100e-3, 130e-3)  # crank and coupler are as long as base and rocker
PARALLELOGRAM = (50e-3, 200e-3, 50e-3, 200e-3)
KITE = (50e-3, 50e-3, 200e-3, 200e-3)  # flat where the crank points away from the rocker's pivot


def four_bar(lengths, angle=0.0, guess=(0.0, 0.0), law=None):
    """A four-bar of crank, coupler, rocker and base, with a first crank angle, and guesses of coupler and rocker."""
    crank, coupler, rocker, base = lengths
    pin = jn.planar.Revolute
    along = (crank * np.cos(angle), crank * np.sin(angle))
    heavy = {"mass": 1.0, "inertia": 0.01}
    return jn.Mechanism(
        space="planar",
        parameters={"crank": crank, "speed": 2 * np.pi, "begin": angle},
        bodies={
            "crank": jn.Body([0, 0], angle, **heavy),
            "coupler": jn.Body(list(along), guess[0], **heavy),
            "rocker": jn.Body([base, 0], guess[1], **heavy),
        },
        joints={
            "A": pin(("ground", "crank"), [0, 0], [0, 0]),
            "B": pin(("crank", "coupler"), ["crank", 0], [0, 0]),
            "C": pin(("coupler", "rocker"), [coupler, 0], [rocker, 0]),
            "D": pin(("ground", "rocker"), [base, 0], [0, 0]),
        },
        drivers={"motor": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", motion=law or "begin + speed*t")},
        outputs={"rocker": jn.outputs.AngleOutput("rocker")},
    )


@pytest.mark.parametrize(
    "lengths, angle, guess",
    [
        (FLAT, 0.0, (np.radians(45), np.radians(100))),
        (FLAT, 0.0, (0.0, 0.1)),
        (FLAT, 1e-9, (0.0, 0.0)),
        (PARALLELOGRAM, 0.0, (0.0, 0.0)),
        (PARALLELOGRAM, 0.0, (0.3, 0.3)),
        (PARALLELOGRAM, 1e-9, (0.0, 0.0)),
        (PARALLELOGRAM, np.pi, (0.1, np.pi + 0.1)),
        (KITE, np.pi, (0.1, np.pi)),
    ],
)
def test_a_start_at_a_change_point_is_singular_wherever_rounding_leaves_it(lengths, angle, guess):
    with pytest.raises(jn.errors.MobilityError, match=r"singular position .* start at another instant") as caught:
        jn.solve(four_bar(lengths, angle, guess), TIME, strict=False)
    assert caught.value.status == Status.SINGULAR


@pytest.mark.parametrize("tolerance", [1e-8, 1e-6])
def test_a_loose_tolerance_does_not_hide_it(tolerance):
    with pytest.raises(jn.errors.MobilityError, match="singular position"):
        jn.solve(four_bar(FLAT, guess=(0.8, 1.7)), TIME, tolerance=tolerance)


def test_a_large_mechanism_is_reported_too(monkeypatch):
    monkeypatch.setattr(host_jacobian, "MOST_DENSE", 4)
    with pytest.raises(jn.errors.MobilityError, match="singular position"):
        jn.solve(four_bar(FLAT, guess=(0.8, 1.7)), TIME)


def test_next_to_a_change_point_the_motion_is_what_the_closed_form_gives():
    short = 1e-9
    lengths = (FLAT[0] - short, *FLAT[1:])
    motion = jn.solve(four_bar(lengths, guess=(0.8, 1.7)), TIME, order=1)
    # crank along the base: the triangle of coupler, rocker and the rest of the base, whose height is the rocker's sine
    rest = FLAT[3] - lengths[0]
    cosine = (FLAT[1] ** 2 - FLAT[2] ** 2 - rest**2) / (2 * FLAT[2] * rest)
    away = 2 * (FLAT[2] + rest - FLAT[1]) * (FLAT[2] + rest + FLAT[1]) / (4 * FLAT[2] * rest)  # 1 - cosine, exactly
    assert cosine == pytest.approx(1.0, abs=1e-6)
    np.testing.assert_allclose(motion.outputs["rocker"][0, 0], 2 * np.arcsin(np.sqrt(away / 2)), rtol=1e-6)
    assert (motion.status == Status.OK).all()


@pytest.mark.slow
def test_a_small_lever_is_no_singular_position():
    lever = 2e-7  # of a mechanism of one metre: the smallest singular value is as small as next to a change point
    mechanism = jn.Mechanism(
        space="planar",
        bodies={"crank": jn.Body([0, 0], 1.0), "slide": jn.Body([1.0, 0.0], 0.0)},
        joints={
            "A": jn.planar.Revolute(("ground", "crank"), [0, 0], [0, 0]),
            "guide": jn.planar.Prismatic(("ground", "slide"), [0, 0], [0, 0], [1, 0], [1, 0]),
            "pin": jn.planar.Parallel2(("slide", "crank"), [-1.0, 0], [lever, 0], [0, 1]),
        },
        drivers={"push": jn.drivers.CoordinateDriver(("ground", "slide"), "x", motion=f"1 + {lever}*cos(1 + t)")},
        outputs={"angle": jn.outputs.AngleOutput("crank")},
    )
    motion = jn.solve(mechanism, [0.0, 0.1], order=1)
    np.testing.assert_allclose(motion.outputs["angle"], [[1.0, 1.0], [1.1, 1.0]], atol=1e-6)


@pytest.mark.slow
def test_of_a_family_those_at_a_change_point_are_singular():
    family = jn.solve_batch(four_bar(FLAT, guess=(0.8, 1.7)), {"crank": [0.04, 0.09]}, TIME, order=1)
    assert (family["status"].values == [[Status.OK] * 3, [Status.SINGULAR] * 3]).all()
    assert np.isnan(family["rocker"].values[1]).all()


def test_free_motions_do_not_start_there():
    mechanism = four_bar(FLAT, guess=(0.8, 1.7))
    free = dataclasses.replace(mechanism, drivers={}, initial=dict(mechanism.drivers))
    with pytest.raises(jn.errors.MobilityError, match="singular position") as caught:
        jn.simulate(free, TIME)
    assert caught.value.status == Status.SINGULAR


@pytest.mark.slow
def test_curves_do_not_start_there():
    with pytest.raises(jn.errors.SingularityError, match="change point"):
        jn.trace(four_bar(FLAT, guess=(0.8, 1.7)))
