"""Optimized designs against optima in closed form, and what is told where there is none."""

import dataclasses

import numpy as np
import pytest

import jounce as jn
from jounce.design.objectives.objectives import Goals
from jounce.design.optimization.law_knots import law_knots
from jounce.design.optimization.problem import Locked, Problem
from tests.dynamics.inverse.test_friction import ladder

TIME = np.linspace(-1.0, 1.0, 41)
CRANK = jn.Mechanism(
    space="planar",
    gravity=[0, -9.81],
    parameters={"a": 0.1, "b": 0.1, "c": 0.1, "r": 0.3, "x": 0.0},
    bodies={"crank": jn.Body([0.0, 0.0], mass=2.0, inertia=0.5, center_of_mass=["r", 0.0])},
    joints={"O": jn.planar.Revolute(("ground", "crank"), ["x", 0], [0, 0])},
    drivers={"theta": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", motion="t**3 + a*t + b*t**2 + c")},
    outputs={"angle": jn.outputs.AngleOutput("crank"), "tip": jn.outputs.PointOutput("crank", ["r", 0.0])},
    time=TIME,
)
CUBIC = {"a": (-2.0, 2.0), "b": (-2.0, 2.0), "c": (-2.0, 2.0)}


@pytest.fixture(scope="module")
def chebyshev():
    return jn.optimize(CRANK, "peak(angle)", CUBIC, starts=1)


@pytest.mark.slow
def test_the_least_peak_of_a_cubic_is_that_of_chebyshev(chebyshev):
    """The cubic of least deviation from zero is T_3/4: four equal peaks, two at the ends and two between instants."""
    assert chebyshev.success
    assert chebyshev.objective == pytest.approx(0.25, abs=1e-10)
    assert list(chebyshev.parameters.values()) == pytest.approx([-0.75, 0.0, 0.0], abs=1e-8)
    assert chebyshev.mechanism.parameters["a"] == chebyshev.parameters["a"]
    assert chebyshev.comparisons[0].before == pytest.approx(1.3, abs=1e-12)
    assert chebyshev.grid_error < 1e-10


@pytest.mark.slow
def test_nothing_is_a_success_that_is_not_solved_at_all_instants(chebyshev):
    assert (chebyshev.motion.status == jn.Status.OK).all()
    assert chebyshev.residual < 1e-6
    assert "0.25" in repr(chebyshev)


@pytest.mark.slow
def test_the_least_mean_square_is_that_of_legendre():
    found = jn.optimize(CRANK, "rms(angle)", CUBIC, starts=1)
    assert found.success
    assert found.objective == pytest.approx(np.sqrt(4 / 175), abs=1e-12)
    assert found.parameters["a"] == pytest.approx(-0.6, abs=1e-7)


@pytest.mark.slow
def test_goals_of_time_and_parameters_alone_are_to_the_order_that_they_need():
    found = jn.optimize(CRANK, "rms(r*exp(t), 1)", {"r": (0.1, 0.5)}, ["mean(r*t**2) >= 0.1"], starts=1)
    assert found.success
    assert found.parameters["r"] == pytest.approx(0.3, abs=1e-9)
    assert found.objective == pytest.approx(0.3 * np.sqrt((np.e**2 - np.e**-2) / 4), rel=1e-9)


@pytest.mark.slow
def test_a_condition_is_kept_and_its_multiplier_is_the_slope_of_the_optimum():
    """The least mean square with the rate at the end held is that of linear equations, and so is its slope."""
    powers = np.array([1, 2, 0])  # of a, b and c
    gram = 1.0 * ((powers[:, None] + powers) % 2 == 0) / (powers[:, None] + powers + 1)
    cubic = 1.0 * ((powers + 3) % 2 == 0) / (powers + 4)
    end = powers * 1.0
    matrix = np.block([[2 * gram, end[:, None]], [end[None], np.zeros((1, 1))]])
    *place, multiplier = np.linalg.solve(matrix, [*(-2 * cubic), 3.5 - 3.0])
    found = jn.optimize(CRANK, "mean(angle**2)", CUBIC, ["at(angle, 1, 1) == 3.5"], starts=1)
    assert found.success
    assert list(found.parameters.values()) == pytest.approx(place, abs=1e-7)
    assert found.objective == pytest.approx(1 / 7 + 2 * cubic @ place + place @ gram @ place, abs=1e-12)
    assert found.multipliers["at(angle, 1, 1) == 3.5"] == pytest.approx(-multiplier, abs=1e-7)
    assert found.comparisons[1].after == pytest.approx(3.5, abs=1e-9)


@pytest.mark.slow
def test_conditions_that_cannot_be_met_are_reported_with_how_far_they_are():
    with pytest.raises(jn.errors.DesignError, match=r"'at\(angle, 1, 1\) == 12': .*9 .* 12, .*3 ") as error:
        jn.optimize(CRANK, "mean(angle**2)", CUBIC, ["at(angle, 1, 1) == 12"], starts=1, iterations=4)
    assert error.value.design.status == "infeasible"
    assert list(error.value.design.parameters.values())[:2] == pytest.approx([2.0, 2.0], abs=1e-6)


@pytest.mark.slow
def test_a_crank_through_points_has_their_mean_radius():
    radii = np.array([0.2, 0.3, 0.55])
    points = radii[:, None] * np.stack([np.cos([-0.5, 0.1, 0.4]), np.sin([-0.5, 0.1, 0.4])], axis=1)
    found = jn.optimize(CRANK, "path_error(tip, ring)", {"r": (0.1, 1.0)}, curves={"ring": points}, starts=1)
    assert found.success
    assert found.parameters["r"] == pytest.approx(radii.mean(), abs=1e-9)
    assert found.objective == pytest.approx(radii.std(), abs=1e-9)


def test_what_is_on_a_bound_is_the_bound_to_the_bit():
    """0.1 + (0.3 - 0.1) is not 0.3, nor is what a search leaves a rounding short of its bound."""
    bounds = {"a": (0.1, 0.3), "b": (-0.7, 0.1), "c": (0.1, 0.7)}
    assert any(low + (high - low) != high for low, high in bounds.values())
    problem = Problem(Goals(CRANK, "mean(angle)", [], tuple(bounds), {}, TIME), bounds)
    for rounding in (0.0, 1e-15):
        at_ends = [problem.values(np.full(3, place)) for place in (rounding, 1.0 - rounding)]
        assert [tuple(end[name] for end in at_ends) for name in bounds] == list(bounds.values())


@pytest.mark.slow
def test_slopes_are_those_of_differences():
    """Of every measure, of forces too, at a design that is nothing special."""
    asked = [
        "peak(angle, 2)",
        "maximum(tip_x) - minimum(tip_y)",
        "span(tip_x*angle_d1, 1, -0.5, 0.53)",
        "rms(tip_y, 1)",
    ]
    asked += ["mean(abs(angle + 2))*r", "at(tip_x, 2, 0.123)", "peak(torque(theta), 1)", "peak(force(O))"]
    asked += ["rms(force_x(O))", "path_error(tip, ring)", "path_deviation(tip, ring)", "path_error(tip, timed)"]
    points = np.array([[0.3, 0.2], [0.5, 0.1], [0.1, -0.3]])
    curves = {"ring": points, "timed": (np.array([-0.7, 0.0, 0.456]), points)}
    bounds = {"a": (-1.0, 1.0), "b": (-1.0, 1.0), "r": (0.1, 0.5), "x": (-0.1, 0.1)}
    from jounce.design.optimization.optimize import _curve

    targets = {name: _curve(name, given) for name, given in curves.items()}
    goals = Goals(CRANK, "mean(angle)", [f"{text} <= 1" for text in asked], tuple(bounds), targets, TIME)
    problem = Problem(goals, bounds)
    place = np.array([0.62, 0.44, 0.57, 0.68])

    def numbers(place):
        found = problem.evaluate(place)
        extremes, chosen = problem.extremes(found)
        values, (by_place, by_extreme, by_smooth) = problem.numbers(place, extremes, found.smooth)
        return values, by_place + by_extreme @ found.row_slopes[chosen] + by_smooth @ found.smooth_slopes

    _, slopes = numbers(place)
    step = 1e-5
    for k in range(len(place)):
        shift = step * np.eye(len(place))[k]
        difference = (numbers(place + shift)[0] - numbers(place - shift)[0]) / (2 * step)
        scale = 1.0 + np.abs(difference)
        assert (np.abs(slopes[:, k] - difference) / scale).max() < 1e-7


LIFT = dataclasses.replace(
    CRANK,
    parameters={"lift": 0.2, "T": 0.5, "r": 0.3, "x": 0.0},
    drivers={
        "theta": jn.drivers.CoordinateDriver(
            ("ground", "crank"),
            "angle",
            motion=jn.laws.SegmentedMotion([
                jn.laws.Segment("dwell", 0.2), jn.laws.Segment("polynomial_3_4_5", "T", to="lift"),
                jn.laws.Segment("dwell", 0.3),
            ]),
        )
    },
    time=np.linspace(0.0, 1.0, 21),
)  # fmt: skip


def test_knots_are_those_that_no_design_moves():
    assert law_knots(LIFT, {"lift": (0.1, 0.3)}, 0.0, 1.0).tolist() == pytest.approx([0.2, 0.7])
    assert law_knots(LIFT, {"T": (0.4, 0.6)}, 0.0, 1.0).tolist() == pytest.approx([0.2])


@pytest.mark.parametrize("count, knots", [(5, [0.2, 0.5, 0.7]), (400, [0.2, 0.7])])
def test_knots_of_forces_count_unless_they_are_too_many(count, knots):
    t = np.linspace(0.0, 1.0, count)  # of five samples only the middle one is a knot: the others are not-a-knot
    load = jn.forces.Torque(("ground", "crank"), law=jn.laws.SplineMotion(t, np.sin(9 * t), degree=3))
    loaded = dataclasses.replace(
        LIFT, forces={"load": load}, outputs={"torque": jn.outputs.DriverTorqueOutput("theta")}
    )
    loaded = dataclasses.replace(
        loaded, bodies={"crank": dataclasses.replace(LIFT.bodies["crank"], mass=1.0, inertia=0.1)}
    )
    assert law_knots(loaded, {"lift": (0.1, 0.3)}, 0.0, 1.0).tolist() == pytest.approx(knots)


@pytest.mark.slow
@pytest.mark.parametrize("dwell", [0.2, 0.2123])
def test_a_peak_at_a_knot_of_the_law_is_that_of_the_handbook(dwell):
    """Jerk of 3-4-5 is 60 at both ends, where it jumps: no series goes on beyond, at a knot of the grid or another."""
    law = jn.laws.SegmentedMotion(
        [jn.laws.Segment("dwell", dwell), jn.laws.Segment("polynomial_3_4_5", 0.5, to="lift")]
    )
    driver = jn.drivers.CoordinateDriver(("ground", "crank"), "angle", motion=law)
    mechanism = dataclasses.replace(LIFT, drivers={"theta": driver})
    found = jn.optimize(mechanism, "peak(angle, 3)", {"lift": (0.1, 0.3)}, starts=1)
    assert found.success, found.message
    assert found.objective == pytest.approx(60 * 0.1 / 0.5**3, rel=1e-10)


@pytest.mark.slow
def test_points_that_are_met_exactly_are_an_optimum():
    """What is left of the distance is rounding, which no finer grid repeats."""
    angles = np.array([-0.6, 0.0, 0.4])
    points = 0.25 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    found = jn.optimize(CRANK, "path_error(tip, p)", {"r": (0.2, 0.5)}, curves={"p": points}, starts=1)
    assert found.objective < 1e-9
    assert found.success, found.message


@pytest.mark.slow
def test_designs_that_lock_are_kept_away_from(four_bar):
    found = jn.optimize(four_bar, "peak(psi, 4)", {"BC": (0.12, 0.6)}, starts=3, samples=16)
    assert found.success
    assert found.smallest_singular_value > 0.01
    assert "cannot be assembled, or lock" in found.notes[0]
    single = jn.solve(four_bar.with_parameters(**found.parameters), np.linspace(0.0, 2.0, 4001))
    sampled = np.abs(single.outputs["psi"][:, 4]).max()  # the peak lies between two of the instants
    assert found.objective * (1 - 1e-5) < sampled < found.objective * (1 + 1e-9)
    for change in (-1e-4, 1e-4):
        other = jn.solve(four_bar.with_parameters(BC=found.parameters["BC"] + change), np.linspace(0.0, 2.0, 4001))
        assert np.abs(other.outputs["psi"][:, 4]).max() > sampled
    with pytest.raises(jn.errors.DesignError, match=r"none of 16 designs .*assembled"):
        jn.optimize(four_bar, "peak(psi, 4)", {"BC": (0.5, 0.6)}, starts=2, samples=16)


@pytest.mark.slow
def test_where_friction_locks_in_all_designs_that_is_what_is_reported():
    words = r"friction locks in all 2 designs .*joints\.wall\.friction: friction locks at t = 0 s.*smaller coefficient"
    made, bounds = ladder().with_parameters(mu=2.5), {"mu": (2.0, 3.0)}
    with pytest.raises(jn.errors.DesignError, match=words):
        jn.optimize(made, "peak(force)", bounds, time=[0.0, 0.6], starts=1, samples=2)


@pytest.mark.slow
def test_the_largest_friction_under_a_limit_of_force_is_that_of_the_closed_form():
    """30 N over slope less coefficient, largest at the start; the mechanism as it is locks, and most samples."""
    given = {"vary": {"mu": (0.05, 1.0)}, "subject_to": ["peak(force) <= 300"], "time": [0.0, 0.6, 1.5]}
    found = jn.optimize(ladder().with_parameters(mu=1.0), "-mu", **given, starts=1, samples=8)
    assert found.success
    assert found.parameters["mu"] == pytest.approx(0.3 / np.sqrt(0.91) - 0.1, rel=1e-6)
    assert "joints.wall.friction: friction locks at t = 0 s" in found.notes[-1]


@pytest.mark.slow
@pytest.mark.parametrize("instants, locks", [([0.0, 1.0, 2.0], False), ([0.0, 0.5, 1.0], True)])
def test_friction_that_locks_at_instants_where_no_goal_looks_is_no_design(instants, locks):
    """The ladder goes down at whole seconds, where friction helps, and is pushed up at the half ones."""
    made, bounds = ladder("0.4 - 0.1*sin(2*pi*t)", 0.4), {"mu": (0.05, 0.7)}
    goals = Goals(made, "-mu", ["at(force, 0, 0) >= -1000"], tuple(bounds), {}, np.array(instants))
    problem = Problem(goals, bounds)
    if locks:
        with pytest.raises(Locked, match=r"friction locks at t = 0\.5 s"):
            problem.evaluate(np.array([1.0]))
    else:
        assert np.isfinite(problem.evaluate(np.array([1.0])).smooth).all()


@pytest.mark.slow
def test_friction_that_locks_between_the_instants_makes_no_optimum():
    made, goal = ladder("0.4 - 0.1*sin(2*pi*t)", 0.4), "at(force, 0, 0) >= -1000"
    found = jn.optimize(made, "-mu", {"mu": (0.05, 0.7)}, [goal], time=[0.0, 1.0, 2.0], starts=1)
    assert not found.success
    assert "between the instants the design locks" in found.message


@pytest.mark.slow
def test_the_second_assembly_is_asked_for_where_it_is_the_better_one(four_bar):
    """Both turn about the same fixed pivots: the pin of the rocker is above the ground in one, below in the other."""
    found = jn.optimize(four_bar, "maximum(C_y)", {"BC": (0.14, 0.145)}, starts=1, assemblies="all")
    assert found.success
    assert found.mechanism.assembly in (1, 2)
    assert found.objective < 0
    assert np.max(jn.solve(found.mechanism, order=0).outputs["C"][:, 0, 1]) == pytest.approx(found.objective, abs=1e-4)
    other = dataclasses.replace(found.mechanism, assembly=3 - found.mechanism.assembly)
    assert np.max(jn.solve(other, order=0).outputs["C"][:, 0, 1]) > found.objective + 0.1
    as_given = np.max(jn.solve(four_bar, order=0).outputs["C"][:, 0, 1])
    assert found.comparisons[0].before == pytest.approx(as_given, abs=1e-4)


@pytest.fixture
def four_bar():
    return dataclasses.replace(jn.load("examples/four_bar.yaml"), time=np.linspace(0.0, 2.0, 121))
