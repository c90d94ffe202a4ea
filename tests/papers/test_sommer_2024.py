"""The seven simulations of Sommer 2024: explicit solutions, errors, sweeps, files written."""

import csv
import dataclasses
import pathlib
import subprocess
import sys

import mpmath as mp
import numpy as np
import pytest

from jounce.errors import OutputError
from jounce.papers import output
from jounce.papers.sommer_2024 import (
    QUANTITIES,
    VALIDATION_CASES,
    backward_difference,
    cases,
    central_difference,
    comparison,
    figures,
    geometry,
    reproduction,
)
from jounce.papers.sommer_2024.cases import STEPS, TOLERANCES, stencil_instants
from jounce.papers.sommer_2024.phase_lag import STEPS as LAG_STEPS
from jounce.papers.sommer_2024.residual_stop import ResidualStop

ROOT = pathlib.Path(__file__).parents[2]
FLOOR = 1e-14  # normalized RMSE that every quantity of every simulation must reach


# The same angles from other, textbook formulas, at any precision.


def swing(t, p):
    return mp.sin(2 * mp.pi * t / p["tau"])


def crank_angle(t, p):
    return mp.radians(30) + mp.radians(60) * swing(t, p)


def driven_distance(t, p):
    return p["d_start"] + p["d_delta"] * swing(t, p)


def angle_opposite(opposite, one, other):
    """Law of cosines."""
    return mp.acos((one**2 + other**2 - opposite**2) / (2 * one * other))


def four_bar(t, p):
    diagonal = p["AB"] * mp.expj(crank_angle(t, p)) - p["AD"]
    return mp.arg(diagonal) - angle_opposite(p["BC"], abs(diagonal), p["CD"])


def inverted_slider_crank(t, p):
    return mp.pi - angle_opposite(driven_distance(t, p), p["EF"], p["FG"])


def rsur(t, p):
    """Tangent of the half angle, from the quadratic equation of the closed loop."""
    theta = crank_angle(t, p)
    b = mp.matrix([p["OA"], p["AB"] * mp.cos(theta) - p["OD"], p["AB"] * mp.sin(theta)])  # from D to B
    k = (mp.fdot(b, b) + p["CD"] ** 2 - p["BC"] ** 2) / (2 * p["CD"])
    return 2 * mp.atan((b[0] - mp.sqrt(b[0] ** 2 + b[2] ** 2 - k**2)) / (k + b[2]))


def rspu(t, p):
    """B and D, seen along the axis of the crank, stand AB and OD from it; along the axis they are OA apart."""
    return angle_opposite(mp.sqrt(driven_distance(t, p) ** 2 - p["OA"] ** 2), p["AB"], p["OD"])


TEXTBOOK = {geometry.four_bar: four_bar, geometry.inverted_slider_crank: inverted_slider_crank}
TEXTBOOK |= {geometry.rsur: rsur, geometry.rspu: rspu}


def precise(form, time, parameters, order=4):
    """The derivatives of a textbook formula at 40 digits, rounded at the end."""
    with mp.workdps(40):
        exact = {name: mp.mpf(float(value)) for name, value in parameters.items()}
        series = [mp.taylor(lambda t: form(t, exact), mp.mpf(float(instant)), order) for instant in time]
        return np.array([[float(mp.re(c) * mp.factorial(k)) for k, c in enumerate(row)] for row in series])


def largest_error(found, right):
    """Of any derivative, by its largest value; angles may differ by whole turns."""
    error = found - right
    error[:, 0] -= 2 * np.pi * np.round(error[:, 0] / (2 * np.pi))
    return (np.abs(error).max(axis=0) / np.abs(right).max(axis=0)).max()


@pytest.mark.parametrize("name", ["four_bar", "inverted_slider_crank_slide", "rsur", "rspu_slide"])
def test_explicit_solution_has_the_digits_of_the_textbook_formula(name):
    simulation = VALIDATION_CASES[name]
    mechanism = simulation.load()
    time = np.array([0.0, 0.17, 0.43, 0.5, 0.87, 1.06, 1.31, 1.5, 1.93])
    found = simulation.explicit(mechanism, time)
    right = precise(TEXTBOOK[simulation.form], time, mechanism.parameter_values)
    assert largest_error(found, right) <= 1e-14


def test_explicit_solutions_reach_higher_orders():
    simulation = VALIDATION_CASES["four_bar"]
    parameters = simulation.load().parameter_values
    time = np.array([0.1, 0.9, 1.4])
    found = geometry.evaluate(simulation.form, time, parameters, order=8)
    right = precise(four_bar, time, parameters, order=8)
    assert largest_error(found, right) <= 1e-13


def test_explicit_solutions_use_neither_solver_nor_constraints():
    text = pathlib.Path(geometry.__file__).read_text()
    assert not any(room in text for room in ("jounce.kinematics", "jounce.constraints", "jounce.mechanism", "solve("))


@pytest.mark.parametrize("name", VALIDATION_CASES)
def test_files_in_the_package_are_those_in_examples(name):
    inside = cases.MECHANISMS / f"{name}.yaml"
    assert inside.read_bytes() == (ROOT / "examples" / f"{name}.yaml").read_bytes()


DRAWN = ("figure_01", "figure_02", "figure_04", "figure_05", "figure_08", "phase_lag")


@pytest.fixture(scope="module")
def small_run(tmp_path_factory):
    """A whole reproduction, of the four-bar alone."""
    directory = tmp_path_factory.mktemp("small") / "made" / "here"
    calls, kept = [], {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reproduction, "VALIDATION_CASES", {"four_bar": VALIDATION_CASES["four_bar"]})
        patch.setattr(figures, "FIGURES", {k: figures.FIGURES[k] for k in DRAWN})
        measure = reproduction.measure
        patch.setattr(
            reproduction, "measure", lambda s, advanced, stop: kept.setdefault(s.name, measure(s, advanced, stop=stop))
        )
        paths = reproduction.reproduce(directory, lambda done, total: calls.append((done, total)))
    return directory, paths, calls, kept["four_bar"]


def check_errors(path, names):
    lines = path.read_text().splitlines()
    assert lines[0] == "simulation,quantity,rmse,normalized_rmse"
    rows = list(csv.DictReader(lines))
    assert [(row["simulation"], row["quantity"]) for row in rows] == [(n, q) for n in names for q in QUANTITIES]
    for row in rows:
        assert 0 < float(row["normalized_rmse"]) <= FLOOR, row
        assert 0 < float(row["rmse"]) <= 1e-12, row


@pytest.mark.slow
def test_reproduction_writes_its_files(small_run):
    directory, paths, calls, _ = small_run
    names = ["comparison.md", "errors.csv", "errors_by_tolerance.csv", "errors_by_step.csv"]
    names += [f"{name}.{kind}" for name in DRAWN for kind in ("png", "svg")]
    assert [path.name for path in paths] == names
    assert sorted(path.name for path in directory.iterdir()) == sorted(names), "nothing else is left behind"
    check_errors(directory / "errors.csv", ["four_bar"])
    for path in paths:
        content = path.read_bytes()
        if path.suffix == ".png":
            assert content.startswith(b"\x89PNG")
            assert len(content) > 20_000
        if path.suffix == ".svg":
            assert b"</svg>" in content
    assert [done for done, _ in calls] == list(range(1, calls[-1][1] + 1))


@pytest.mark.slow
def test_sweeps_are_tables_too(small_run):
    directory, _, _, results = small_run
    rows = list(csv.DictReader((directory / "errors_by_tolerance.csv").read_text().splitlines()))
    assert [float(row["tolerance"]) for row in rows] == list(TOLERANCES)
    found = np.array([[float(row[quantity]) for quantity in QUANTITIES] for row in rows])
    np.testing.assert_array_equal(found, results.by_tolerance)
    rows = list(csv.DictReader((directory / "errors_by_step.csv").read_text().splitlines()))
    for method, errors in results.by_step.items():
        chosen = [row for row in rows if row["method"] == method]
        assert [float(row["step"]) for row in chosen] == list(STEPS)
        np.testing.assert_array_equal([[float(row["jerk"]), float(row["jounce"])] for row in chosen], errors)


@pytest.mark.slow
def test_comparison_puts_printed_errors_beside_ours(small_run):
    text = (small_run[0] / "comparison.md").read_text()
    row = next(line for line in text.splitlines() if line.startswith("| four_bar |") and "| jerk |" in line)
    assert "| 1.07e-13 |" in row
    assert text.count("1.07e-13") == 2, "there, and in the verdict on figure 2"


@pytest.mark.slow
def test_comparison_says_what_is_chosen_before_any_number(small_run):
    text = (small_run[0] / "comparison.md").read_text()
    chosen = text.index("stand-ins")
    assert chosen < text.index("|")
    assert all(name in text[chosen - 200 : text.index("|")] for name in ("RSUR", "RSSR", "RSPU", "drive"))
    assert "NOT reproduced" not in text


@pytest.mark.slow
@pytest.mark.parametrize("figure", [2, 3, 4, 5])
def test_each_figure_has_a_verdict_that_the_numbers_decide(small_run, figure):
    result = small_run[3]
    row = verdict(result, figure)
    assert "| reproduced" in row
    cycle = dataclasses.replace(result.cycle, simulated=result.cycle.simulated * (1 + 1e-9))
    worse = {name: values * 1e3 for name, values in result.by_step.items()}
    apart = result.by_tolerance * np.array([1.0, 1.0, 1.0, 100.0])
    spoiled = dataclasses.replace(result, cycle=cycle, by_tolerance=apart, by_step=worse)
    assert "| NOT reproduced" in verdict(spoiled, figure)


def verdict(result, figure):
    page = comparison.comparison({"four_bar": result})
    return next(line for line in page.splitlines() if line.startswith(f"| {figure} |"))


def plain_newton_raphson(tolerance, unit):
    """The angle of the four-bar's rocker by Haug's textbook iteration on residuals, lengths in m times `unit`."""
    ad, ab, bc, cd = (unit * length for length in (0.1321, 0.04, 0.1423, 0.2031))
    q, found = np.array([0.0, 0.0, np.pi / 6, ad, 0.0, 2.2]), []
    for t in cases.nominal_time():
        theta = np.radians(30) + np.radians(60) * np.sin(np.pi * t)
        while True:
            b, c = (length * np.array([np.cos(a), np.sin(a)]) for length, a in ((ab, q[2]), (cd, q[5])))
            d = q[3:5] + c - q[:2] - b
            residual = np.array([q[0], q[1], q[3] - ad, q[4], d @ d - bc**2, q[2] - theta])
            if np.abs(residual).max() <= tolerance:
                break
            jacobian = np.zeros((6, 6))
            jacobian[[0, 1, 2, 3, 5], [0, 1, 3, 4, 2]] = 1.0
            jacobian[4] = 2 * np.concatenate([-d, [-d @ [-b[1], b[0]]], d, [d @ [-c[1], c[0]]]])
            q = q - np.linalg.solve(jacobian, residual)
        found.append(q[5])
    return np.array(found)


@pytest.mark.slow
def test_the_floor_of_the_paper_is_that_of_residuals_in_centimeters(small_run):
    """Figure 4 has its floor at tolerances below 1e-11: so has the iteration on residuals in cm, not that in m."""
    right = small_run[3].cycle.explicit[:, 0]

    def error(tolerance, unit):
        wrong = plain_newton_raphson(tolerance, unit) - right
        return np.sqrt(np.mean(wrong**2)) / np.abs(right).max()

    assert error(1e-11, 100.0) < 1e-15 < error(1e-10, 100.0)
    assert error(1e-14, 1.0) > 1e-15


@pytest.mark.slow
@pytest.mark.parametrize("name, figure, floor", [("four_bar", 4, 1e-11), ("rsur", 10, 1e-12)])
def test_stopped_by_the_largest_residual_in_centimeters_the_floor_is_where_the_paper_has_it(
    small_run, name, figure, floor
):
    sweep = ResidualStop(VALIDATION_CASES[name])
    errors = np.stack([sweep.error(tolerance) for tolerance in TOLERANCES])
    at = TOLERANCES.index(floor)
    assert (errors[: at + 1] <= FLOOR).all()
    assert errors[at + 1].max() > FLOOR
    assert (errors[at + 2] > 5 * errors[at]).all()
    result = dataclasses.replace(small_run[3], stop="residual", by_tolerance=errors)
    page = comparison.comparison(dict.fromkeys(cases.TOLERANCE_SWEEPS[figure], result))
    row = next(line for line in page.splitlines() if line.startswith(f"| {figure} |"))
    assert "| reproduced" in row
    assert f"{floor:.0e}" in row
    assert "each instant starts from the position at the instant before" in page
    worse = dataclasses.replace(result, by_tolerance=10 * errors[[*range(1, len(errors)), -1]])
    page = comparison.comparison(dict.fromkeys(cases.TOLERANCE_SWEEPS[figure], worse))
    assert "NOT reproduced" in next(line for line in page.splitlines() if line.startswith(f"| {figure} |"))


def test_a_rule_that_is_none_is_refused_before_any_computing(tmp_path, run):
    for paper, words in (("sommer-2024", ("residuals", "residual")), ("negrean-2025", ("--stop", "sommer-2024"))):
        status, _, complaint = run("reproduce", paper, "--out", tmp_path / "out", "--stop", "residuals")
        assert status == 2
        assert all(word in complaint for word in words), complaint
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_errors_fall_with_the_tolerance_until_the_floor(small_run):
    errors = small_run[3].by_tolerance
    assert errors.shape == (len(TOLERANCES), 4)
    assert (errors <= np.array(TOLERANCES)[:, None]).all()
    assert (errors[0] <= FLOOR).all()
    assert (errors[2:] > 10 * errors[:-2]).all(), "two decades of tolerance are worth more than one of error"
    assert (errors[-1] > 1e-7).all()


@pytest.mark.slow
def test_jerk_and_jounce_are_as_precise_as_velocity_and_acceleration(small_run):
    errors = small_run[3].by_tolerance
    assert (errors.max(axis=1) < 10 * errors.min(axis=1)).all()


@pytest.mark.slow
@pytest.mark.parametrize("method, order", [("second order", 2), ("fourth order", 4)])
def test_differences_converge_at_their_order(small_run, method, order):
    steps, errors = np.array(STEPS), small_run[3].by_step[method]
    between = (steps > 1.5e-3) & (steps < 3e-2)
    slopes = np.diff(np.log(errors[between]), axis=0) / np.diff(np.log(steps[between]))[:, None]
    np.testing.assert_allclose(slopes, order, atol=0.05)


@pytest.mark.slow
def test_the_simulation_does_not_depend_on_the_time_step(small_run):
    by_step = small_run[3].by_step
    assert (by_step["simulation"] <= FLOOR).all()
    assert all((by_step["simulation"] < 1e-3 * by_step[method]).all() for method in ("second order", "fourth order"))


@pytest.mark.slow
@pytest.mark.parametrize("quantity, steps_late", [("jerk", 0.5), ("jounce", 1.0)])
def test_backward_differences_are_late_by_half_a_step_and_by_a_step(small_run, quantity, steps_late):
    lags = [lag for lag in small_run[3].lags if lag.quantity == quantity]
    assert [lag.step for lag in lags] == list(LAG_STEPS)
    for lag in lags:
        assert lag.expected == steps_late * lag.step
        assert lag.late(lag.difference) == pytest.approx(lag.expected, rel=1e-6)
        assert abs(lag.late(lag.simulated)) < 1e-15
        assert lag.measured_error(lag.simulated) <= FLOOR
        assert lag.measured_error(lag.difference) == pytest.approx(lag.error, rel=2e-3)  # few samples at large steps
    errors = np.array([lag.error for lag in lags])
    np.testing.assert_allclose(errors[0] / LAG_STEPS[0], errors[1] / LAG_STEPS[1], rtol=0.02)  # first order in h


def test_backward_differences_are_means_of_the_derivative():
    t = 0.25 * np.arange(9)
    np.testing.assert_allclose(backward_difference(t**3, 0.25, derivative=1), 3 * t[1:] ** 2 - 0.75 * t[1:] + 0.0625)
    np.testing.assert_allclose(backward_difference(t**3, 0.25, derivative=2), 6 * (t[2:] - 0.25))


def test_differences_are_exact_for_polynomials_of_their_order():
    t = 0.5 * np.arange(9) - 2
    for accuracy, derivative in ((2, 1), (2, 2), (4, 1), (4, 2)):
        degree = accuracy + derivative - 1
        polynomial = np.polynomial.Polynomial(np.arange(1, degree + 2))
        found = central_difference(polynomial(t), 0.5, derivative=derivative, accuracy=accuracy)
        np.testing.assert_allclose(found, polynomial.deriv(derivative)(t[2:-2]), rtol=1e-13, atol=1e-12)


@pytest.mark.parametrize("step", STEPS)
def test_every_instant_has_its_neighbors_and_all_make_one_cycle(step):
    time, centers = stencil_instants(step)
    assert time[0] == 0.0
    assert (np.diff(time) > 0).all()
    assert len(time) <= 1010
    for k in (-2, -1, 1, 2):
        np.testing.assert_allclose(time[centers + k] - time[centers], k * step, rtol=0, atol=1e-15)
    np.testing.assert_allclose(time[centers[-1]] - time[centers[0]], 2.0, rtol=1e-15)


def test_a_directory_that_cannot_be_made_is_refused_before_any_computing(tmp_path, monkeypatch):
    monkeypatch.setattr(reproduction, "measure", lambda *_: pytest.fail("computed"))
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match=r"file/out: .*Not a directory"):
        reproduction.reproduce(tmp_path / "file" / "out")
    with pytest.raises(OutputError, match="files cannot be written there"):
        reproduction.reproduce(tmp_path / "file")


def test_a_file_that_cannot_be_written_leaves_nothing_behind(tmp_path):
    (tmp_path / "errors.csv" / "inside").mkdir(parents=True)
    with pytest.raises(OutputError, match=r"errors\.csv: is a directory"):
        output.write(tmp_path / "errors.csv", b"text")
    assert [path.name for path in tmp_path.iterdir()] == ["errors.csv"]


@pytest.mark.slow
def test_drawing_is_imported_late_and_leaves_pyplot_alone():
    code = (
        "import sys, jounce.papers.sommer_2024 as s; assert 'matplotlib' not in sys.modules\n"
        "import jounce.papers.sommer_2024.figures; assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.fixture(scope="module")
def whole_run(tmp_path_factory, small_run):
    """The whole reproduction, to which the results of the four-bar are given as they are there."""
    directory, kept = tmp_path_factory.mktemp("whole"), {"four_bar": small_run[3]}
    measure = reproduction.measure

    def measured(simulation, advanced):
        if simulation.name not in kept:
            kept[simulation.name] = measure(simulation, advanced)
        return kept[simulation.name]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reproduction, "measure", measured)
        return directory, reproduction.reproduce(directory), kept


@pytest.mark.slow
@pytest.mark.parametrize("name", VALIDATION_CASES)
def test_simulation_reaches_rounding_from_velocity_to_jounce(whole_run, name):
    cycle = whole_run[2][name].cycle
    assert cycle.time[-1] == 2.0
    assert cycle.time.shape == (201,)
    assert np.abs(cycle.simulated[:, 0] - cycle.explicit[:, 0]).max() <= 1e-14
    assert (cycle.normalized_rmse <= FLOOR).all(), dict(zip(QUANTITIES, cycle.normalized_rmse, strict=True))
    assert (cycle.peak > 0.1).all(), "the motion is worth measuring"
    for (printed_name, quantity), printed in comparison.PRINTED.items():
        if printed_name == name:
            assert cycle.rmse[QUANTITIES.index(quantity)] < printed


@pytest.mark.slow
def test_the_whole_reproduction(whole_run):
    directory, paths, _ = whole_run
    check_errors(directory / "errors.csv", VALIDATION_CASES)
    figures = {path.name for path in paths if path.suffix == ".png"}
    assert figures == {f"figure_{k:02d}.png" for k in range(1, 14)} | {"phase_lag.png"}
    assert all(path.stat().st_size > 1000 for path in paths)
