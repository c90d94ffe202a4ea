"""The page `comparison.md`: data of the paper and chosen data, a verdict on each figure, and all errors."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from jounce.papers.output import markdown_table, page
from jounce.papers.sommer_2024 import cases
from jounce.papers.sommer_2024.measurement import Results

PRINTED = {  # root-mean-square errors in the text of the paper, sections 4 and 6
    ("four_bar", "jerk"): 1.07e-13,
    ("four_bar", "jounce"): 9.7e-13,
    ("rsur", "jerk"): 2.17e-14,
    ("rsur", "jounce"): 3.81e-13,
}
PRINTED_FLOORS = {4: 1e-11, 10: 1e-12}  # tolerances below which errors stay constant in the text, by figure
ALMOST = 1e-9
UNITS = ("rad/s", "rad/s^2", "rad/s^3", "rad/s^4")
FLOOR = 1e-14  # normalized RMSE of rounding
ALIKE = 10.0  # largest ratio of the errors of velocity to jounce
CONVERGING = (1.5e-3, 3e-2)  # s, steps at which neither rounding nor the next order matters
STANDS_IN = {  # data of each simulation that the text of the paper lacks
    "four_bar": "",
    "inverted_slider_crank_slide": "drive",
    "inverted_slider_crank_distance": "drive",
    "rsur": "axes and drive",
    "rssr": "axes and drive",
    "rspu_distance": "axes and drive",
    "rspu_slide": "axes and drive",
}


def comparison(results: Mapping[str, Results]) -> str:
    """Return the chosen data, a verdict on each figure, and computed beside printed errors, in Markdown."""
    return page(
        __package__,
        "comparison.md",
        verdicts=markdown_table("figure | here | verdict", _verdicts(results)),
        floor=page(__package__, f"floor_{next(iter(results.values())).stop}.md").rstrip(),
        step=cases.STEP,
        tolerance=cases.TOLERANCE,
        errors=markdown_table(
            "simulation | chosen | quantity | unit | largest value | RMSE | printed RMSE | normalized RMSE",
            _errors(results),
        ),
        lags=markdown_table(
            "simulation | quantity | h, s | lag, s | closed form | error | closed form | lag, simulation | error",
            _lags(results),
        ),
    )


def _verdicts(results: Mapping[str, Results]) -> Iterator[tuple[str, ...]]:
    """Yield a row for each figure that has results."""
    figures = (
        dict.fromkeys(cases.HISTORIES, ("four_bar",))
        | cases.TOLERANCE_SWEEPS
        | cases.STEP_SWEEPS
        | {1: (), 8: (), 9: ()}
    )
    for figure, names in sorted(figures.items()):
        if figure == 1:
            yield "1", "drawn from the mechanism files, lengths as printed", "redrawn"
        elif not names:
            yield str(figure), "drawn from the mechanism file, lengths as printed, axes chosen", "redrawn, stand-in"
        elif set(names) <= set(results):
            judge = (
                _history if figure in cases.HISTORIES else _tolerances if figure in cases.TOLERANCE_SWEEPS else _steps
            )
            result, confirmed, remark = judge([results[name] for name in names], figure)
            chosen = {STANDS_IN[name] for name in names} - {""}
            verdict = ("reproduced" if confirmed else "NOT reproduced") + remark
            verdict += f"; {', '.join(sorted(chosen))}: stand-in" if chosen else ""
            yield str(figure), result, verdict


def _history(results: Sequence[Results], figure: int) -> tuple[str, bool, str]:
    """Judge figures 2 and 3: the error of the four-bar's jerk or jounce is no larger than the printed one."""
    quantity = cases.HISTORIES[figure]
    computed, printed = results[0].cycle.rmse[cases.QUANTITIES.index(quantity)], PRINTED["four_bar", quantity]
    return f"RMSE of {quantity} {computed:.2g}, printed {printed:.3g}", bool(computed <= printed), ", error smaller"


def _tolerances(results: Sequence[Results], figure: int) -> tuple[str, bool, str]:
    """Judge a sweep of tolerances: errors of all quantities fall together, to rounding.

    With residuals in cm, errors stop falling at the tolerance in the text of the paper. A correction squares the
    residual, so the largest residual is often far below the tolerance, and errors do not fall evenly.
    """
    errors = np.stack([result.by_tolerance for result in results])
    spread = float((errors.max(axis=2) / errors.min(axis=2)).max())
    reached = [
        tolerance for tolerance, row in zip(cases.TOLERANCES, errors.max(axis=(0, 2)), strict=True) if row <= FLOOR
    ]
    floor = float(errors[:, 0].max())
    text = f"velocity to jounce within a factor of {spread:.2g} of each other; floor {floor:.1g}"
    text += f", reached at tolerances to {max(reached):.0e}" if reached else ""
    if results[0].stop == "correction":
        return text, spread < ALIKE and floor <= FLOOR, "; the floor begins at another tolerance, see below"
    floors = PRINTED_FLOORS.get(figure, cases.TOLERANCES[0])
    begins_alike = bool(reached) and max(reached) >= floors * (1 - ALMOST)
    return text, begins_alike, f"; the paper has it at {floors:.0e}" if figure in PRINTED_FLOORS else ""


def _steps(results: Sequence[Results], _: int) -> tuple[str, bool, str]:
    """Judge a sweep of steps: differences converge at their orders, the simulation does not depend on the step."""
    steps = np.array(cases.STEPS)
    in_range = (steps > CONVERGING[0]) & (steps < CONVERGING[1])
    slopes = {}
    for method in ("second order", "fourth order"):
        errors = np.log([result.by_step[method][in_range] for result in results])  # simulation, step, quantity
        slopes[method] = np.array([np.polyfit(np.log(steps[in_range]), error, 1)[0] for error in errors])
    worst = max(float(result.by_step["simulation"].max()) for result in results)
    second, fourth = (f"{slopes[m].min():.2f} to {slopes[m].max():.2f}" for m in ("second order", "fourth order"))
    text = f"differences converge with order {second} and {fourth}; simulation at most {worst:.1g} at every step"
    is_right = all(np.abs(slopes[m] - p).max() < 0.1 for m, p in (("second order", 2), ("fourth order", 4)))
    return text, is_right and worst <= FLOOR, ""


def _errors(results: Mapping[str, Results]) -> Iterator[tuple[str, ...]]:
    for name, result in results.items():
        cycle = result.cycle
        columns = zip(cases.QUANTITIES, UNITS, cycle.peak, cycle.rmse, cycle.normalized_rmse, strict=True)
        for quantity, unit, peak, error, normalized in columns:
            printed = PRINTED.get((name, quantity))
            printed_text = "" if printed is None else f"{printed:.3g}"
            sizes = f"{peak:.4g}", f"{error:.2e}", printed_text, f"{normalized:.1e}"
            yield name, STANDS_IN[name], quantity, unit, *sizes


def _lags(results: Mapping[str, Results]) -> Iterator[tuple[str, ...]]:
    for name, result in results.items():
        for lag in result.lags:
            delay, error = lag.late(lag.difference), lag.measured_error(lag.difference)
            lag_cells = f"{delay:.6g}", f"{lag.expected:g}", f"{error:.4g}", f"{lag.error:.4g}"
            values = f"{abs(lag.late(lag.simulated)):.0e}", f"{lag.measured_error(lag.simulated):.1e}"
            yield cases.VALIDATION_CASES[name].title, lag.quantity, f"{lag.step:g}", *lag_cells, *values
