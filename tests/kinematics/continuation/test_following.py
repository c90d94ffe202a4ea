"""Staying on the branch: near misses, dead points, change points, laws that jump, outputs without a value."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from mpmath import mp

import jounce as jn
from jounce import drivers, planar
from jounce.jet import Jet
from jounce.kinematics import Status
from jounce.kinematics.assembly.assemble import assemble
from jounce.kinematics.continuation.correct_and_differentiate import _status
from jounce.kinematics.continuation.solver import Solver
from jounce.linear_algebra.linear import DenseFactor
from jounce.mechanism import build
from tests.problems.small import crank, distance_slider, four_bar, slider_crank

NEAR_MISS = {"a": 0.8, "b": 1.0, "e": 0.8 - np.sqrt(1 - 0.03**2)}  # comes within 1.7 degrees of its dead point


def twin_slider_cranks(law="6*t"):
    """Two equal slider-cranks on one crank: near their dead points both determinants change sign together."""
    a, b, e = NEAR_MISS.values()
    guide = {"vector_i": [1, 0], "vector_j": [1, 0], "point_i": [0, "e"], "point_j": [0, 0]}
    names = ("one", "two")
    return jn.Mechanism(
        space="planar",
        parameters=NEAR_MISS,
        bodies={"crank": jn.Body([0, 0])} | {n: jn.Body([a + np.sqrt(b * b - e * e), "e"]) for n in names},
        joints={"O": planar.Revolute(("ground", "crank"), [0, 0], [0, 0])}
        | {f"rod_{n}": planar.DoubleRevolute(("crank", n), ["a", 0], [0, 0], "b") for n in names}
        | {f"guide_{n}": planar.Prismatic(("ground", n), **guide) for n in names},
        drivers={"turn": drivers.CoordinateDriver(("ground", "crank"), "angle", law)},
        outputs={n: jn.outputs.PointOutput(n, [0, 0]) for n in names},
    )


@pytest.mark.slow
@pytest.mark.parametrize("count", [31, 301])
def test_two_loops_that_miss_their_dead_points_together(count):
    """If both moved to the other branch, the determinant of the whole would change its sign twice at once."""
    time = np.linspace(0, 1, count)
    motion = jn.solve(twin_slider_cranks(), time, order=0)
    a, b, e = NEAR_MISS.values()
    expected = a * np.cos(6 * time) + np.sqrt(b * b - (a * np.sin(6 * time) - e) ** 2)
    for name in ("one", "two"):
        np.testing.assert_allclose(motion.outputs[name][:, 0, 0], expected, rtol=0, atol=1e-13)
    assert not motion.change_points.size


def det_rate_of(mechanism, instant):
    """Return the result of `advance` at an instant, and all eigenvalues of J^-1 J' by differences, from NumPy."""
    model, coordinates = assemble(build(mechanism), instant, 1e-12)
    solver = Solver(model, 4, 1e-12)
    known = {name: np.stack([x, *[np.zeros_like(x)] * 4]) for name, x in coordinates.items()}
    angles = tuple(np.zeros((5, 1, group.instances, 1)) for group in model.system.outputs)
    arrival = solver(solver.needed((known, angles, np.zeros(1))), np.zeros(1), np.array([instant]), search=True)
    jets = {name: Jet(tuple(map(jnp.asarray, c))) for name, c in arrival.coordinates.items()}

    def jacobian(step):
        pose = model.pose_type.predicted_from(jets, jnp.array([step]))
        return np.asarray(model.system.jacobian(pose, Jet([jnp.array([[instant + step]])])))[:, :, 0]

    step = 1e-5
    slope = (jacobian(step) - jacobian(-step)) / (2 * step)
    return float(arrival.det_rate[0]), np.linalg.eigvals(np.linalg.solve(jacobian(0.0), slope))


@pytest.mark.slow
@pytest.mark.parametrize("instant", [2.0, 3.0, 3.5])
def test_turnover_is_the_largest_eigenvalue(instant):
    mechanism = four_bar("t0", "t0", "t", AB=0.1, CD=0.1, AD=0.2, BC=0.2, t0=instant)
    found, eigenvalues = det_rate_of(mechanism, instant)
    largest = eigenvalues[np.argmax(np.abs(eigenvalues))]
    assert np.abs(largest) <= abs(found) * (1 + 1e-6)
    assert abs(found) < 1.4 * np.abs(largest)
    assert np.sign(found) == np.sign(largest.real)
    assert np.sign(found) == np.sign(instant - np.pi)  # a change point is ahead, or behind


PARALLELOGRAM = four_bar("0.5", "0.5", "t", AB=0.1, CD=0.1, AD=0.2, BC=0.2)


@pytest.mark.parametrize("order, tolerance", [(0, [1e-14]), (4, [1e-14, 1e-13, 1e-11, 1e-9, 1e-7])])
def test_change_point_is_passed_at_any_instant_and_reported(order, tolerance):
    time = np.sort(np.r_[np.linspace(0.5, 6, 23), np.pi, np.pi + np.array([-1e-2, -1e-5, 1e-9, 1e-3])])
    motion = jn.solve(PARALLELOGRAM, time, order=order)
    np.testing.assert_allclose(motion.change_points, [np.pi], atol=1e-12)
    np.testing.assert_allclose(motion.dataset.attrs["change_points"], motion.change_points)
    for k, limit in enumerate(tolerance):
        truth = (time, np.ones_like(time), *np.zeros((3, len(time))))[k]
        np.testing.assert_allclose(motion.outputs["psi"][:, k], truth, atol=limit * 10)


def test_where_both_sides_disagree_only_what_rounding_spoils_is_refused(monkeypatch):
    """No known motion makes the two tests disagree, so the disagreement is forced."""
    away = np.geomspace(1e-6, 0.5, 40)
    time = np.r_[0.5, np.pi - away[::-1], np.pi + away]
    monkeypatch.setattr("jounce.kinematics.position_analysis.grid.LARGEST_DISAGREEMENT", -1.0)
    motion = jn.solve(PARALLELOGRAM, time, order=4, strict=False)
    refused = motion.status == Status.SINGULAR
    width = np.max(np.abs(time - np.pi)[refused])
    assert 1e-3 < width < 0.2
    np.testing.assert_array_equal(refused, np.abs(time - np.pi) <= width)
    assert (motion.status[~refused] == Status.OK).all()


def test_change_point_at_the_end_of_a_grid():
    motion = jn.solve(PARALLELOGRAM, [0.5, 2.0, np.pi + 1e-4], order=1, strict=False)
    assert motion.status[:2].tolist() == [Status.OK] * 2
    if motion.status[2] == Status.OK:
        np.testing.assert_allclose(motion.outputs["psi"][2], [np.pi + 1e-4, 1.0], atol=1e-9)


@pytest.mark.slow
def test_dead_center_touched_by_the_law_is_a_change_point():
    """The crank continues through the dead center: cos(angle) follows from the position of the slider."""
    time = np.linspace(0, 3, 31)
    motion = jn.solve(slider_crank("4 - 0.5*cos(t)**2"), time, order=0)
    np.testing.assert_allclose(motion.change_points, [np.pi / 2], atol=1e-9)
    x = 4 - 0.5 * np.cos(time) ** 2
    angle = np.sign(np.pi / 2 - time) * np.arccos(np.clip((x * x + 1 - 9) / (2 * x), -1, 1))
    np.testing.assert_allclose(motion.outputs["angle"][:, 0], angle, atol=1e-9)


BESIDE = np.array([1e-3, 1e-4, 1e-6, 1e-9, 1e-12])


def folding_slider_crank(angle, time, start=1.4):
    """Crank and rod of length one, which can fold at an angle of pi/2: then x = 2 cos(angle), or stays zero."""
    bodies = {
        "crank": jn.Body([0, 0], start),
        "rod": jn.Body([np.cos(start), np.sin(start)], -start),
        "slider": jn.Body([2 * np.cos(start), 0]),
    }
    joints = {
        "A": planar.Revolute(("ground", "crank"), [0, 0], [0, 0]),
        "B": planar.Revolute(("crank", "rod"), [1, 0], [0, 0]),
        "C": planar.Revolute(("rod", "slider"), [1, 0], [0, 0]),
        "guide": planar.Prismatic(("ground", "slider"), [0, 0], [0, 0], [1, 0], [1, 0]),
    }
    turned = drivers.CoordinateDriver(("ground", "crank"), "angle", motion=angle)
    outputs = {"x": jn.outputs.PointOutput("slider", [0, 0])}
    return jn.Mechanism(
        space="planar", bodies=bodies, joints=joints, drivers={"turn": turned}, outputs=outputs, time=time
    )


def sine_of_parabola(offset, time, order):
    """Return the derivatives of 2 sin(s^2 / 2 - offset), s = time - 1/2, by series in thirty digits."""
    with mp.workdps(30):
        series = [
            mp.taylor(lambda t: 2 * mp.sin((t - mp.mpf("0.5")) ** 2 / 2 - mp.mpf(offset)), x, order) for x in time
        ]
        return np.array([[float(c * mp.factorial(k)) for k, c in enumerate(one)] for one in series])


@pytest.mark.parametrize("order", [0, 4, 6])
@pytest.mark.parametrize(
    "instants", [[0.0, 0.3, 0.5, 0.7], [0.3, 0.5, 0.7], [*np.linspace(0, 1, 11), *(0.5 - BESIDE), *(0.5 + BESIDE)]]
)
def test_motion_that_turns_back_at_a_change_point_goes_on_along_its_series(order, instants):
    """The determinant has a double zero; x = 2 cos(angle) is analytic in time, and x = 0 afterwards is not."""
    time = np.sort(np.array(instants))
    motion = jn.solve(folding_slider_crank("pi/2 - 0.5*(t - 0.5)**2", time), order=order)
    np.testing.assert_allclose(motion.change_points, [0.5], atol=1e-9)
    limits = (1e-11, 1e-10, 1e-9, 1e-7, 1e-6, 1e-6, 1e-6)
    truth = sine_of_parabola(0.0, time, order)
    for k in range(order + 1):
        np.testing.assert_allclose(motion.outputs["x"][:, k, 0], truth[:, k], rtol=0, atol=limits[k])


@pytest.mark.parametrize("offset", [1e-4, 1e-6, 1e-9, 1e-12, -1e-12, -1e-9, -1e-6, -1e-4])
def test_motion_that_turns_back_just_beyond_or_before_a_change_point(offset):
    """Two simple zeros, or none, a little apart: the continuation in time is the same as from a double zero."""
    time = np.linspace(0, 1, 21)
    motion = jn.solve(folding_slider_crank(f"pi/2 + {offset} - 0.5*(t - 0.5)**2", time), order=2)
    truth = sine_of_parabola(offset, time, 2)
    np.testing.assert_allclose(motion.outputs["x"][:, :, 0], truth, rtol=0, atol=1e-9)


@pytest.mark.parametrize("order", [0, 4, 6, 8])
@pytest.mark.parametrize("sign", ["", "-"])
def test_parallelogram_that_turns_back_where_it_is_flat(order, sign):
    time = np.sort(np.r_[np.linspace(0, 1, 11), 0.5 - BESIDE, 0.5 + BESIDE])
    turning = four_bar(f"{sign}0.125", f"{sign}0.125", f"{sign}0.5*(t - 0.5)**2", AB=0.05, CD=0.05, AD=0.2, BC=0.2)
    motion = jn.solve(turning, time, order=order)
    s, still = time - 0.5, np.zeros((max(order - 2, 0), len(time)))
    truth = float(sign + "1") * np.stack([s**2 / 2, s, np.ones(len(time)), *still][: order + 1], axis=1)
    limits = (1e-11, 1e-10, 1e-9, 1e-7, 1e-6, 1e-6, 1e-5, 1e-4, 1e-3)
    for k in range(order + 1):
        np.testing.assert_allclose(motion.outputs["psi"][:, k], truth[:, k], rtol=0, atol=limits[k])


@pytest.mark.parametrize("power", [3, 4, 5])
@pytest.mark.parametrize("order", [0, 4, 6, 8])
def test_motion_that_rests_at_a_change_point_ends_before_rounding_chooses_its_branch(order, power):
    """Toward a zero of multiplicity three and more the branches are closer than positions are certain."""
    time = np.sort(np.r_[np.linspace(0, 1, 21), 0.5 - BESIDE, 0.5 + BESIDE])
    start = 0.5 * (-0.5) ** power
    resting = four_bar(f"{start}", f"{start}", f"0.5*(t - 0.5)**{power}", AB=0.05, CD=0.05, AD=0.2, BC=0.2)
    motion = jn.solve(resting, time, order=order, strict=False)
    solved = motion.status == Status.OK
    assert not solved[time >= 0.5].any()
    assert motion.status[~solved][0] == Status.SINGULAR
    np.testing.assert_allclose(
        motion.outputs["psi"][solved, 0], 0.5 * (time[solved] - 0.5) ** power, rtol=0, atol=1e-11
    )
    if order:
        rate = 0.5 * power * (time[solved] - 0.5) ** (power - 1)
        np.testing.assert_allclose(motion.outputs["psi"][solved, 1], rate, rtol=0, atol=1e-9)


def test_near_parallelogram_with_a_dead_point_where_it_turns_back_ends_there():
    """A coupler longer by 1e-11 m leaves a gap of 1e-5 rad in the range of the crank, which the law enters."""
    time = np.linspace(0, 1, 21)
    turning = four_bar("0.125", "0.125", "0.5*(t - 0.5)**2", AB=0.05, CD=0.05, AD=0.2, BC=0.2 + 1e-11)
    motion = jn.solve(turning, time, order=2, strict=False)
    np.testing.assert_array_equal(motion.status == Status.OK, time < 0.5)


@pytest.mark.parametrize("missed", [0.01, 1e-3])
def test_parallelogram_that_turns_back_before_it_is_flat_goes_on(missed):
    turning = four_bar("0.5", "0.5", f"{missed} + 0.5*(t - 0.5)**2", AB=0.05, CD=0.05, AD=0.2, BC=0.2)
    time = np.linspace(0, 1, 21)
    motion = jn.solve(turning, time, order=2)
    expected = np.stack([missed + 0.5 * (time - 0.5) ** 2, time - 0.5, np.ones(21)], axis=1)
    np.testing.assert_allclose(motion.outputs["psi"][:, :3], expected, atol=1e-10)


def test_branches_a_little_apart_are_no_change_point():
    """A coupler longer by 1e-9 turns the crossing into a near miss, a gap of 1e-5 rad wide: the rocker turns back."""
    mechanism = four_bar("0.5", "0.5", "t", AB=0.1, CD=0.1, AD=0.2, BC=0.2 + 1e-9)
    time = np.linspace(0.5, 6, 12)
    motion = jn.solve(mechanism, time, order=0, strict=False)
    assert not motion.change_points.size
    psi, good = motion.outputs["psi"][:, 0], motion.status == Status.OK
    gap = 0.1 * np.exp(1j * time) - 0.2 - 0.1 * np.exp(1j * psi)
    np.testing.assert_allclose(np.abs(gap[good]), 0.2 + 1e-9, rtol=1e-14)
    side = np.sign((np.conj(gap) * np.exp(1j * psi)).imag)[good]  # of the rocker, seen along the coupler
    assert (side == side[0]).all()


@pytest.mark.slow
@pytest.mark.parametrize("jump", [0.06, 0.3, 1.0, 3.0, 2 * np.pi])
def test_law_that_jumps_is_refused_at_any_size(jump):
    mechanism = crank(lambda t: 2 * t + jnp.where(t < 0.5, 0.0, jump))
    motion = jn.solve(mechanism, np.linspace(0, 1, 11), order=0, strict=False)
    assert motion.status[:5].tolist() == [Status.OK] * 5
    assert motion.status[6] != Status.OK
    assert Status.BRANCH_JUMP in motion.status


@pytest.mark.slow
def test_output_without_a_rate_is_not_ok_and_the_motion_goes_on():
    mechanism = jn.Mechanism(
        space="planar",
        bodies={"block": jn.Body([0.5, 0])},
        joints={"guide": planar.Prismatic(("ground", "block"), [0, 0], [0, 0], [1, 0], [1, 0])},
        drivers={"slide": drivers.SlideDriver(("ground", "block"), [0, 0], [0, 0], [1, 0], "0.5 - 0.5*t")},
        outputs={"gap": jn.outputs.DistanceOutput(("ground", "block"), [0, 0], [0, 0])},
    )
    time = np.linspace(0, 2, 5)
    np.testing.assert_allclose(jn.solve(mechanism, time, order=0).outputs["gap"][:, 0], abs(0.5 - 0.5 * time))
    motion = jn.solve(mechanism, time, order=1, strict=False)
    assert motion.status.tolist() == [0, 0, Status.UNDEFINED, 0, 0]
    assert motion.faults == {2: "output gap"}
    np.testing.assert_allclose(motion.outputs["gap"][[1, 3]], [[0.25, -0.5], [0.25, 0.5]], atol=1e-15)
    with pytest.raises(jn.errors.SolveError, match="output gap"):
        jn.solve(mechanism, time, order=1)


@pytest.mark.slow
def test_law_without_a_third_derivative_at_the_start():
    mechanism = distance_slider("1 + t**2.5")
    time = np.linspace(0, 2, 5)
    for order in (0, 2):
        motion = jn.solve(mechanism, time, order=order)
        np.testing.assert_allclose(motion.outputs["x"][:, 0, 0], 1 + time**2.5, rtol=1e-14)
    motion = jn.solve(mechanism, time, order=3, strict=False)
    assert motion.status.tolist() == [Status.UNDEFINED, 0, 0, 0, 0]
    np.testing.assert_allclose(motion.outputs["x"][1:, 3, 0], 1.875 * time[1:] ** -0.5, rtol=1e-12)


def test_nearly_singular_factor_is_singular():
    """A pivot of 1e-13 of the largest leaves three digits: no such instant is OK."""
    matrix = np.diag([1.0, 1.0, 1e-13])[:, :, None]
    ratio = DenseFactor.of(jnp.asarray(matrix)).pivot_ratio()
    yes = jnp.ones(1, bool)
    assert int(_status(jnp.zeros(1), yes, ratio, yes, yes, yes, 1e-12)[0]) == Status.SINGULAR


EXCURSIONS = [
    jn.laws.SegmentedMotion(
        [
            jn.laws.Segment("dwell", 0.5),
            jn.laws.Segment("cycloidal", 0.5, by=6.0),
            jn.laws.Segment("cycloidal", 0.5, by=-6.0),
        ],
        0.52,
    ),
    pytest.param(jn.laws.Expression("0.52 + 6*exp(-(t - 1)**2/0.01)"), marks=pytest.mark.slow),
    pytest.param(jn.laws.Expression("0.52 + 6*t**6*(2 - t)**6"), marks=pytest.mark.slow),
]


def excursion(law):
    """A four-bar at the same position at both instants, with another position between them."""
    crank_rocker = jn.load("examples/four_bar.yaml")
    driver = dataclasses.replace(crank_rocker.drivers["theta"], motion=law)
    return dataclasses.replace(crank_rocker, drivers={"theta": driver}, time=[0.0, 2.0])


@pytest.mark.slow
@pytest.mark.parametrize("law", EXCURSIONS)
def test_a_motion_that_begins_at_rest_and_comes_back_is_not_stepped_over(law):
    """Between two instants with the same position lies an unreachable one; the series of the law is zero."""
    mechanism = excursion(law)
    assert list(jn.solve(mechanism).status) == [Status.OK] * 2
    locking = mechanism.with_parameters(AB=0.12)  # no crank: it cannot pass the frame
    assert list(jn.solve(locking, strict=False).status) == [Status.OK, Status.SINGULAR]


@pytest.mark.slow
def test_designs_that_lock_between_two_instants_at_rest_are_reported():
    designs = jn.solve_batch(excursion(EXCURSIONS[0]), {"AB": [0.04, 0.12]}, order=1)
    assert designs["status"].values.tolist() == [[Status.OK] * 2, [Status.OK, Status.SINGULAR]]
