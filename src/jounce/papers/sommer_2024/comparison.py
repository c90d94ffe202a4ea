"""The page `comparison.md`: what is the paper's and what is chosen, a verdict on each figure, and all errors."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from jounce.papers.sommer_2024.measure import Results
from jounce.papers.sommer_2024.simulations import QUANTITIES, SIMULATIONS, STEP, STEPS, TOLERANCE, TOLERANCES

PRINTED = {  # root-mean-square errors in the text of the paper, sections 4 and 6
    ("four_bar", "jerk"): 1.07e-13,
    ("four_bar", "jounce"): 9.7e-13,
    ("rsur", "jerk"): 2.17e-14,
    ("rsur", "jounce"): 3.81e-13,
}
UNITS = ("rad/s", "rad/s^2", "rad/s^3", "rad/s^4")
FLOOR = 1e-14  # normalised RMSE of what is computed to rounding
ALIKE = 10.0  # errors of velocity to jounce differ by less than this factor
CONVERGING = (1.5e-3, 3e-2)  # s, steps at which neither rounding nor the next order shows
STANDS_IN = {  # what of each simulation the text of the paper does not give
    "four_bar": "",
    "inverted_slider_crank_slide": "drive",
    "inverted_slider_crank_distance": "drive",
    "rsur": "axes and drive",
    "rssr": "axes and drive",
    "rspu_distance": "axes and drive",
    "rspu_slide": "axes and drive",
}
CHOSEN = """\
From the text of the paper: lengths, joints, kinds of drivers, the motion of the four-bar's crank (equation 56), time
step and assembly tolerance. The drawings (figures 1, 8, 9) are not in the text that this was made from, and no other
motion is printed. **Geometry and drive of the spatial cases are chosen here, as stand-ins**, so that every mechanism
assembles over the whole cycle:

- RSUR, RSSR: the fixed axes meet at O at a right angle; the crank AB turns about x through A = (OA, 0, 0), theta
  counted from y; the follower CD turns about y through D = (0, OD, 0), psi counted from z; of the two assemblies the
  one with C on the positive z side; the universal joint has one arm along the follower's axis. Drive: equation 56.
- RSPU: the crank as in RSUR; the universal joint on the ground at D = (0, OD, 0) with its fixed arm along z. Drive:
  BD = 28.85 + 1.5 sin(2 pi t / tau) cm.
- Inverted slider-crank (planar): drive EG = 7 + 1 sin(2 pi t / tau) cm.

So only the four-bar can be compared with the paper number by number. The printed errors of RSUR stand beside those of a
motion that may be another."""
WHY = """\
The paper reads its floor of 1e-15 at tolerances below 1e-11 (four-bar, figure 4) and 1e-12 (RSUR, figure 10). Here the
error is about the tolerance down to the floor of rounding, because the tolerance bounds another quantity: here the next
Newton correction, in rad or in sizes of the mechanism, which for this sweep is then left unmade (`refine=False`). The
paper does not say what its tolerance bounds. A plain Newton-Raphson that stops when the largest residual of the paper's
constraints is within the tolerance reaches the floor of the four-bar's angle at 1e-11 if lengths are in cm, in which
the paper gives them, and only below 1e-14 if they are in m (`tests/papers/test_sommer_2024.py`)."""


def comparison(results: Mapping[str, Results]) -> str:
    """Return what was chosen, a verdict on each figure, and the errors beside the printed ones, in Markdown."""
    lines = ["# Sommer 2024: errors of the output angle against explicit geometric solutions", ""]
    lines += ["## What is the paper's and what is chosen here", "", CHOSEN, ""]
    lines += ["## Verdict on each figure", "", "| figure | here | verdict |", "|---|---|---|", *_verdicts(results), ""]
    lines += ["## Why the floor of the tolerance sweep differs", "", WHY, ""]
    lines += ["## Errors at nominal settings", "", *_errors(results), ""]
    lines += ["## Phase lag of backward differences (section 7)", "", *_lags(results)]
    return "\n".join(lines) + "\n"


def _verdicts(results: Mapping[str, Results]) -> Iterator[str]:
    """Yield a row for each figure whose simulations were run."""
    cranks = ("inverted_slider_crank_slide", "inverted_slider_crank_distance")
    rspu = ("rspu_distance", "rspu_slide")
    yield "| 1 | drawn from the mechanism files, lengths as printed | redrawn |"
    for figure, names in {
        2: ("four_bar",),
        3: ("four_bar",),
        4: ("four_bar",),
        5: ("four_bar",),
        6: cranks,
        7: cranks,
        8: (),
        9: (),
        10: ("rsur", "rssr"),
        11: ("rsur", "rssr"),
        12: rspu,
        13: rspu,
    }.items():
        if figure in (8, 9):
            yield f"| {figure} | drawn from the mechanism file, lengths as printed, axes chosen | redrawn, stand-in |"
        elif set(names) <= set(results):
            judge = _history if figure in (2, 3) else _tolerances if figure in (4, 6, 10, 12) else _steps
            found, holds, but = judge([results[name] for name in names], figure)
            chosen = {STANDS_IN[name] for name in names} - {""}
            verdict = ("reproduced" if holds else "NOT reproduced") + but
            verdict += f"; {', '.join(sorted(chosen))}: stand-in" if chosen else ""
            yield f"| {figure} | {found} | {verdict} |"


def _history(results: Sequence[Results], figure: int) -> tuple[str, bool, str]:
    """Judge figures 2 and 3: the error of the four-bar's jerk or jounce is no larger than the printed one."""
    quantity = "jerk" if figure == 2 else "jounce"
    found, printed = results[0].cycle.rmse[QUANTITIES.index(quantity)], PRINTED["four_bar", quantity]
    return f"RMSE of {quantity} {found:.2g}, printed {printed:.3g}", bool(found <= printed), ", error smaller"


def _tolerances(results: Sequence[Results], _: int) -> tuple[str, bool, str]:
    """Judge a sweep of tolerances: errors of all quantities fall together, to rounding."""
    errors = np.stack([result.by_tolerance for result in results])
    spread = float((errors.max(axis=2) / errors.min(axis=2)).max())
    reached = [tolerance for tolerance, row in zip(TOLERANCES, errors.max(axis=(0, 2)), strict=True) if row <= FLOOR]
    floor = float(errors[:, 0].max())
    text = f"velocity to jounce within a factor of {spread:.2g} of each other; floor {floor:.1g}"
    text += f", reached at tolerances to {max(reached):.0e}" if reached else ""
    return text, spread < ALIKE and floor <= FLOOR, "; the floor begins at another tolerance, see below"


def _steps(results: Sequence[Results], _: int) -> tuple[str, bool, str]:
    """Judge a sweep of steps: differences converge at their orders, the simulation does not depend on the step."""
    steps = np.array(STEPS)
    between = (steps > CONVERGING[0]) & (steps < CONVERGING[1])
    slopes = {
        method: np.array(
            [np.polyfit(np.log(steps[between]), np.log(r.by_step[method][between]), 1)[0] for r in results]
        )
        for method in ("second order", "fourth order")
    }
    worst = max(float(result.by_step["simulation"].max()) for result in results)
    second, fourth = (f"{slopes[m].min():.2f} to {slopes[m].max():.2f}" for m in ("second order", "fourth order"))
    text = f"differences converge with order {second} and {fourth}; simulation at most {worst:.1g} at every step"
    right = all(np.abs(slopes[m] - p).max() < 0.1 for m, p in (("second order", 2), ("fourth order", 4)))
    return text, right and worst <= FLOOR, ""


def _errors(results: Mapping[str, Results]) -> Iterator[str]:
    yield f"One cycle of 2 s, time step {STEP:g} s, assembly tolerance {TOLERANCE:g}. Printed: the root-mean-square"
    yield "errors (RMSE) that the text of the paper states, computed there in MATLAB. Normalised: RMSE divided by the"
    yield "largest absolute value of the quantity over the cycle."
    yield ""
    yield "| simulation | chosen | quantity | unit | largest value | RMSE | printed RMSE | normalised RMSE |"
    yield "|---|---|---|---|---|---|---|---|"
    for name, result in results.items():
        cycle = result.cycle
        columns = zip(QUANTITIES, UNITS, cycle.peak, cycle.rmse, cycle.normalised_rmse, strict=True)
        for quantity, unit, peak, error, normalised in columns:
            printed = PRINTED.get((name, quantity))
            beside = "" if printed is None else f"{printed:.3g}"
            row = f"{STANDS_IN[name]} | {quantity} | {unit} | {peak:.4g} | {error:.2e} | {beside} | {normalised:.1e}"
            yield f"| {name} | {row} |"


def _lags(results: Mapping[str, Results]) -> Iterator[str]:
    yield "A backward difference of the acceleration over a step h is the mean of the jerk over that step, a second one"
    yield "the mean of the jounce over two steps, with the weights of a triangle. So all harmonics come late by h / 2"
    yield "and by h, and a harmonic of angular frequency w is smaller by sinc(w h / 2) and by its square. Lag: of the"
    yield "largest harmonic of the cycle. Error: normalised RMSE; in closed form from the spectrum of the explicit"
    yield "solution."
    yield ""
    yield "| simulation | quantity | h, s | lag, s | closed form | error | closed form | lag, simulation | error |"
    yield "|---|---|---|---|---|---|---|---|---|"
    for name, result in results.items():
        for lag in result.lags:
            late, wrong = lag.late(lag.difference), lag.measured_error(lag.difference)
            row = f"{lag.quantity} | {lag.step:g} | {late:.6g} | {lag.expected:g} | {wrong:.4g} | {lag.error:.4g}"
            ours = f"{abs(lag.late(lag.simulated)):.0e} | {lag.measured_error(lag.simulated):.1e}"
            yield f"| {SIMULATIONS[name].title} | {row} | {ours} |"
