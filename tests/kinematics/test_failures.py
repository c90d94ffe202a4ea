"""Motions that cannot be solved: reported by name and time, never silently wrong."""

import dataclasses
import re

import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce import Status
from jounce.mechanism import check_mechanism
from tests.problems.small import crank, distance_slider, four_bar, slider_crank

GRID = np.linspace(0, 2, 21)


def failure(mechanism, time, **keywords):
    with pytest.raises(jn.errors.SolveError) as caught:
        jn.solve(mechanism, time, **keywords)
    return caught.value


@pytest.mark.slow
def test_jump_of_a_motion_law_is_reported_with_time_and_body():
    error = failure(crank(lambda t: jnp.where(t < 1, t, t + 1.0)), GRID)
    assert error.status == Status.BRANCH_JUMP
    assert "t = 1 s" in str(error)
    assert "crank" in str(error)
    assert "10 of 21" in str(error)
    assert isinstance(error.motion, jn.Motion)
    np.testing.assert_allclose(error.motion.outputs["angle"][:10, 0], GRID[:10], atol=1e-14)


@pytest.mark.parametrize("jump", [2 * np.pi])
def test_jumps_of_other_sizes(jump):
    assert failure(crank(lambda t: jnp.where(t < 1, t, t + jump)), GRID).status == Status.BRANCH_JUMP


def test_without_strict_good_instants_are_kept_and_the_rest_is_nan():
    motion = jn.solve(crank(lambda t: jnp.where(t < 1, t, t + 1.0)), GRID, strict=False)
    assert motion.status[:10].tolist() == [Status.OK] * 10
    assert motion.status[10] == Status.BRANCH_JUMP
    assert motion.status[11:].tolist() == [Status.NOT_REACHED] * 10
    assert motion.faults[10] == "body crank"
    np.testing.assert_allclose(motion.outputs["angle"][:10, 0], GRID[:10], atol=1e-14)
    assert np.isnan(motion.outputs["angle"][10:]).all()
    assert np.isnan(motion.dataset["tip"].values[10:]).all()
    assert np.isnan(motion.point("crank", [1.0, 2.0]).values[10:]).all()
    assert "10 of 21" in repr(motion)


@pytest.mark.slow
def test_kink_of_a_motion_law_is_no_jump():
    motion = jn.solve(crank(lambda t: jnp.where(t < 1, t, 2 * t - 1)), GRID, order=1)
    np.testing.assert_allclose(motion.outputs["angle"][:, 0], np.where(GRID < 1, GRID, 2 * GRID - 1), atol=1e-13)


@pytest.mark.slow
def test_slider_driven_to_its_dead_center_is_singular():
    error = failure(slider_crank("3.5 + 0.5*t"), np.linspace(0, 1, 5))
    assert error.status == Status.SINGULAR
    assert "t = 1 s" in str(error)
    assert "dead point" in str(error)
    assert not error.motion.status[:4].any()


@pytest.mark.slow
def test_slider_driven_beyond_its_reach():
    time = np.linspace(0, 4, 9)
    motion = jn.solve(slider_crank("3.52 + 0.2*t"), time, strict=False)
    reached = 3.52 + 0.2 * time < 4
    assert not motion.status[reached].any()
    assert motion.status[~reached].all()
    x = 3.52 + 0.2 * time[reached]
    np.testing.assert_allclose(motion.outputs["angle"][reached, 0], np.arccos((x**2 + 1 - 9) / (2 * x)), rtol=1e-12)
    assert "t = 2.5 s" in str(failure(slider_crank("3.52 + 0.2*t"), time))


@pytest.mark.slow
def test_crank_that_leaves_the_region_of_assembly():
    mechanism = four_bar(0.0, 2.0, "t", AB=0.2, AD=0.3, BC=0.1, CD=0.15)
    time = np.linspace(0, 3, 31)
    motion = jn.solve(mechanism, time, strict=False)
    reached = np.sqrt(0.2**2 + 0.3**2 - 2 * 0.2 * 0.3 * np.cos(time)) < 0.25  # B within reach of the coupler and rocker
    assert (motion.status[reached] == Status.OK).all()
    assert (motion.status[~reached] != Status.OK).all()
    assert failure(mechanism, time).motion.status[~reached].all()


@pytest.mark.slow
def test_dead_center_passed_smoothly_keeps_to_the_motion():
    """The law touches the dead center and returns; the crank continues through it in a smooth motion."""
    time = np.linspace(0, 3, 31)
    angle = jn.solve(slider_crank("4 - 0.5*cos(t)**2"), time, order=0).outputs["angle"][:, 0]
    assert (np.diff(angle) < 0).all()


@pytest.mark.slow
def test_change_point_of_a_parallelogram_is_passed_on_the_same_branch():
    time = np.linspace(0.5, 4, 15)
    mechanism = four_bar("0.5", "0.5", "t", AB=0.1, CD=0.1, AD=0.2, BC=0.2)
    motion = jn.solve(mechanism, time, order=1)
    np.testing.assert_allclose(motion.outputs["psi"], np.stack([time, np.ones(15)], axis=1), rtol=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("beyond", [-1e-11, 0.0, 1e-9, 1e-8])
def test_a_motion_that_ends_at_a_change_point_has_no_derivatives_there(beyond):
    """In the stretched position, the branch cannot be determined, and rounding decides all rates."""
    time = np.array([0.5, 2.0, np.pi + beyond])
    mechanism = four_bar("0.5", "0.5", "t", AB=0.1, CD=0.1, AD=0.2, BC=0.2)
    error = failure(mechanism, time, order=1)
    assert list(error.motion.status) == [Status.OK, Status.OK, Status.SINGULAR]


@pytest.mark.slow
@pytest.mark.parametrize("time", [[0.0, 0.5, 1.0, 1.5], [0.0, 0.3, 0.7, 1.1]])
def test_distance_driver_that_reaches_zero(time):
    error = failure(distance_slider("0.5 - 0.5*t"), time)
    assert error.status == Status.INADMISSIBLE
    assert "drivers.reach" in str(error)
    good = np.array(time) < 1
    assert not error.motion.status[good].any()
    assert error.motion.status[~good].all()


@pytest.mark.slow
@pytest.mark.parametrize("motion", ["-0.5", "0", "0.5*t"])
def test_distance_driver_that_is_not_positive_at_the_start(motion):
    error = failure(distance_slider(motion), [0.0, 1.0])
    assert error.status == Status.INADMISSIBLE
    assert "t = 0 s" in str(error)
    assert "drivers.reach" in str(error)


@pytest.mark.parametrize("motion", ["1/t", "log(t-1)"])
def test_motion_law_without_a_value_at_the_start(motion):
    with pytest.raises(jn.JounceError, match=r"drivers\.turn"):
        jn.solve(crank(motion), [0.0, 1.0])


def test_motion_law_without_a_value_later():
    error = failure(crank("sqrt(1-t)"), np.linspace(0, 2, 5))
    assert "t = 1" in str(error)


def test_mechanism_that_cannot_be_assembled():
    with pytest.raises(jn.errors.AssemblyError, match=r"t = 0 s.*joints\.BC") as caught:
        jn.solve(four_bar(BC=0.9), [0.0, 1.0])
    assert caught.value.status == Status.NOT_ASSEMBLED


def test_drivers_that_contradict_each_other():
    again = crank("t")
    mechanism = jn.Mechanism(
        space="planar",
        bodies=again.bodies,
        joints=again.joints,
        drivers={
            "one": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", "t"),
            "two": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", "t + 1"),
        },
    )
    with pytest.raises(jn.errors.AssemblyError, match=r"drivers\.(one|two), drivers\.(one|two)"):
        jn.solve(mechanism, [0.0])


PIN = jn.planar.Revolute(("ground", "crank"), [0, 0], [0, 0])
TURN = jn.drivers.CoordinateDriver(("ground", "crank"), "angle", "t")


@pytest.mark.parametrize(
    "bodies, joints, drivers, message",
    [
        (["crank"], {"O": PIN}, {}, r"1 degree of freedom is left, with which crank can move: add 1 driver"),
        (["crank", "loose"], {"O": PIN}, {"turn": TURN}, r"3 degrees of freedom are left, with which loose can move"),
        (
            ["crank"],
            {"O": PIN, "twin": PIN},
            {},
            r"with which crank can move: .*; joint twin repeats 2 equations of O, ",
        ),
        (["crank"], {}, {}, r"3 degrees of freedom are left"),
    ],
    ids=["driver_missing", "loose_body", "joint_twice", "nothing_at_all"],
)
def test_degrees_of_freedom_are_explained(bodies, joints, drivers, message):
    mechanism = jn.Mechanism(
        space="planar", bodies={name: jn.Body([0, 0]) for name in bodies}, joints=joints, drivers=drivers
    )
    with pytest.raises(jn.errors.MobilityError, match=message):
        jn.solve(mechanism, [0.0])


def wiper(**joints):
    """A four-bar with a second arm on a tie; `joints` replaces or adds joints, and None removes one."""
    pin = jn.planar.Revolute
    found = {
        "O": PIN,
        "B": pin(("crank", "rod"), [0.045, 0], [0, 0]),
        "C": pin(("rod", "left"), [0.31, 0], [0.075, 0]),
        "D": pin(("ground", "left"), [0.3, 0], [0, 0]),
        "E": pin(("left", "tie"), [0.075, 0], [0, 0]),
        "F": pin(("tie", "right"), [0.42, 0], [0.075, 0]),
        "G": pin(("ground", "right"), [0.72, 0], [0, 0]),
        **joints,
    }
    places = {"crank": (0, 0, 0), "rod": (0.045, 0, 0.26), "left": (0.3, 0, 1.6), "tie": (0.3, 0.075, 0)}
    places["right"] = (0.72, 0, 1.6)
    return jn.Mechanism(
        space="planar",
        bodies={name: jn.Body([x, y], angle) for name, (x, y, angle) in places.items()},
        joints={name: joint for name, joint in found.items() if joint is not None},
        drivers={"turn": TURN},
    )


def test_a_joint_that_was_forgotten_is_asked_for():
    with pytest.raises(jn.errors.MobilityError) as caught:
        jn.solve(wiper(F=None), [0.0])
    words = str(caught.value)
    assert "2 degrees of freedom are left" in words
    assert re.search("tie (is held )?by E alone", words)
    assert re.search("right (is held )?by G alone", words)
    assert "is a revolute joint missing between them, bodies: [" in words
    with pytest.raises(jn.errors.MobilityError, match=r"right (is held )?by no joint.*is a joint missing"):
        jn.solve(wiper(F=None, G=None), [0.0])
    with pytest.raises(jn.errors.MobilityError) as caught:  # a driver is missing of the crank, and no joint
        jn.solve(dataclasses.replace(wiper(), drivers={}), [0.0])
    assert "missing" not in str(caught.value)


def test_constraints_that_contradict_each_other_are_reported_in_one_sentence():
    extra = jn.planar.Revolute(("ground", "tie"), [0.3, 0.0], [0, 0])
    with pytest.raises(jn.errors.AssemblyError) as caught:
        jn.solve(wiper(extra=extra), [0.0])
    words = str(caught.value)
    assert words.startswith("over-constrained at t = 0 s: joints.")
    assert words.endswith("; correct lengths, or take out a joint")
    assert len(words) < 200
    assert "2 equations more than coordinates" in caught.value.details
    second = jn.drivers.CoordinateDriver(("ground", "left"), "angle", motion="2 + t")
    twice = dataclasses.replace(wiper(), drivers={"turn": TURN, "second": second})
    with pytest.raises(jn.errors.AssemblyError) as caught:
        jn.solve(twice, [0.0])
    words = str(caught.value)
    assert words.endswith("; correct lengths, or take out a joint or a driver")


@pytest.mark.slow
@pytest.mark.parametrize(
    "law, stop, count, end, status",
    [
        ("sqrt(1 - t)", 2, 9, 1, {Status.UNDEFINED, Status.INADMISSIBLE}),  # its rate at the end, and what is beyond
        ("sqrt(1 - t)", 2, 201, 1, {Status.UNDEFINED, Status.INADMISSIBLE}),
        ("log(1 - t)", 2, 201, 1, {Status.INADMISSIBLE}),
        ("1/(t - 1)", 2, 9, 1, {Status.INADMISSIBLE}),
        ("log(abs(1 - t))", 1.9, 9, 1, {Status.COLLAPSED}),  # no instant of the grid is the pole
        ("tan(2*t)", 0.9, 9, np.pi / 4, {Status.COLLAPSED}),
        ("tan(2*t)", 0.9, 201, np.pi / 4, {Status.COLLAPSED}),
    ],
)
def test_a_law_that_ends_or_grows_beyond_all_bounds(law, stop, count, end, status):
    """A pole is reported at once with its instant, although only the steps can reveal it."""
    time = np.linspace(0, stop, count)
    motion = jn.solve(crank(law), time, order=2, strict=False)
    before = time < end
    assert (motion.status[before] == Status.OK).all()
    assert set(motion.status[~before].tolist()) == status | {Status.NOT_REACHED}
    assert np.isnan(motion.outputs["angle"][~before, 1]).all()
    message = motion.faults.get(int(np.argmin(before)) + (law == "sqrt(1 - t)"), "")
    assert "turn" in message


@pytest.mark.parametrize("order", [-1, 1.5, "4", None, True, 31])
def test_order_that_is_none(order):
    with pytest.raises((jn.errors.MechanismError, TypeError), match="order"):  # TypeError by the checker of the tests
        jn.solve(crank("t"), [0.0], order=order)


@pytest.mark.parametrize("tolerance", [0, -1.0, np.nan, np.inf, "1e-3", None])
def test_tolerance_that_is_none(tolerance):
    with pytest.raises((jn.errors.MechanismError, TypeError), match="tolerance"):
        jn.solve(crank("t"), [0.0], tolerance=tolerance)


@pytest.mark.parametrize(
    "law", [lambda t: jnp.stack([t, t]), lambda t: None, lambda t: float(t)], ids=["vector", "none", "float"]
)
def test_python_function_that_is_no_motion_law(law):
    with pytest.raises(jn.errors.MechanismError, match=r"drivers\.turn"):
        jn.solve(crank(law), [0.0])


def test_what_is_no_mechanism():
    # of the public functions, the checks of types in the tests would say so first
    with pytest.raises(jn.errors.MechanismError, match=r"jn\.Mechanism, got 'a\.yaml'; jn\.load"):
        check_mechanism("a.yaml")


def test_gaps_of_what_cannot_be_assembled_are_lengths_and_angles():
    free = dataclasses.replace(four_bar(BC=1.0), drivers={})  # AB and CD reach 0.0400 + 0.1321 + 0.2031 m
    with pytest.raises(jn.errors.AssemblyError, match=r"joints\.BC stays open, by 625 mm.*missing"):
        jn.solve(free, [0.0])
    base = four_bar()
    level = jn.planar.Parallel1(("ground", "crank"), [1, 0], [1, 0])
    upright = jn.planar.Parallel1(("ground", "crank"), [np.cos(0.4), np.sin(0.4)], [1, 0])
    both = {"level": level, "upright": upright}
    with pytest.raises(jn.errors.AssemblyError, match=r"11\.\d* deg, 11\.\d* deg") as caught:
        jn.solve(dataclasses.replace(base, joints=base.joints | both, drivers={}), [0.0])
    assert "missing" not in str(caught.value)


def test_the_gap_of_two_points_in_one_place_is_a_length():
    """A squared distance has no slope where it is zero; only its class determines its unit."""
    reach = jn.drivers.DistanceDriver(("ground", "crank"), [1, 0], [1, 0], motion="0.5 + t")
    pin = jn.planar.Revolute(("ground", "crank"), [0, 0], [0, 0])
    crank = jn.Mechanism(space="planar", bodies={"crank": jn.Body([0, 0])}, joints={"O": pin}, drivers={"reach": reach})
    with pytest.raises(jn.errors.AssemblyError, match=r"drivers\.reach stays open, by 500 mm"):
        jn.solve(crank, [0.0])
