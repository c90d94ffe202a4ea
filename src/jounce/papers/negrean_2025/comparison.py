"""The page `comparison.md`: what was chosen, closed forms beside the library, and the printed segment."""

from collections.abc import Mapping

import numpy as np

from jounce.papers.negrean_2025 import case as chosen, segment
from jounce.papers.negrean_2025.history import STEPS, History, difference

ENERGY_ROWS = (
    ("E_1 (141)", "kg m^2/s^4"),
    ("E_2 (142)", "kg m^2/s^6"),
    ("E_3 (143)", "kg m^2/s^8"),
)
TORQUE_ROWS = (
    ("torque (144)", "N m"),
    ("torque rate (145)", "N m/s"),
    ("second torque rate (146)", "N m/s^2"),
)
NAMES = ("angle", "speed", "acceleration", "jerk", "jounce")
UNITS = ("rad", "rad/s", "rad/s^2", "rad/s^3", "rad/s^4")


def comparison(histories: Mapping[str, History], data: list[str] | None = None) -> str:
    """Return the page in Markdown; `data` says what was given in the place of the stand-ins."""
    lines = [
        "# Negrean 2025, section 4: energies, torque and its rates for one arm of a robot",
        "",
        *(_chosen() if data is None else data),
        "",
        "## Closed forms of the paper beside the library",
        "",
        f"At {len(next(iter(histories.values())).time)} instants, {STEPS} in each segment. Difference: the largest"
        " one over time, divided by the",
        "largest absolute value of the quantity. Energies: equations 141-143 against",
        "`jounce.acceleration_energy`. Torques: equations 144-146 with the part of gravity against",
        "`jounce.inverse_dynamics` (recursive Newton-Euler), and the higher-order equations 129-131 of energies,",
        "`jounce.dynamics.higher_order` with m = 2, 3, 4, and `jounce.dynamics.gravity_forces`.",
        "",
        "| motion | quantity | unit | largest value | library - closed form | higher-order - closed form |",
        "|---|---|---|---|---|---|",
    ]
    for name, history in histories.items():
        lines += _rows(name, history)
    lines += ["", *_laws(histories), "", *_segment()]
    return "\n".join(lines) + "\n"


def _chosen() -> list[str]:
    sizes = " + ".join(f"{size:g} sin({rate:g} t + {phase:g})" for size, rate, phase in chosen.RIPPLE)
    size, rate, decay = chosen.RINGING
    return [
        "The paper turns the third link of a Fanuc LR Mate 100 iB from 0 to pi in 1.7 s and measures its tangential",
        "acceleration every 0.033 s. The samples are printed only as figures 4 and 5, the masses only as figure 6,",
        "and neither is in the text that this was made from. So the numbers and curves here are **not those of the",
        "paper**; the method is. What the text holds: 0 to pi, 1.7 s, 51 segments of degree 5 (m = 4), all formulas.",
        "",
        "## Stand-ins",
        "",
        f"- Masses (figure 6): M_3 = {chosen.MASS:g} kg, x_C = {chosen.CENTER_X:g} m, z_C = {chosen.CENTER_Z:g} m,"
        f" I_y = {chosen.INERTIA_Y:g} kg m^2 about the centre of",
        f"  mass; I_x = {chosen.INERTIA_X:g} and I_z = {chosen.INERTIA_Z:g} kg m^2 have no effect. About the axis:"
        f" {chosen.inertia_about_axis():.6g} kg m^2.",
        f"- The accelerometer is {chosen.RADIUS:g} m from the axis.",
        f"- High-speed motion: samples at {len(chosen.KNOTS)} knots, 1.7 s / 51 apart, of the polynomial of degree 7"
        " from 0 to pi with rest",
        "  to the third derivative at both ends, plus the ripple of an accelerometer,",
        f"  {sizes} rad/s^2.",
        "- Sudden stop: the same until"
        f" {chosen.STOP:g} s, then a braking pulse (1 - cos) of {chosen.BRAKING:g} s that takes all the speed, then"
        " ringing,",
        f"  {size:g} exp(-{decay:g} t) sin({rate:g} t) rad/s^2, and the same ripple.",
        "- As one does with an accelerometer, bias and drift are taken off: a straight line, so that the motion ends",
        "  at pi at rest; after the sudden stop, where the angle is not known, a constant, so that it ends at rest.",
        "- Conditions of the segments (equation 64): angle and speed zero at the start, jerk zero at both ends.",
        "- The axis is horizontal, gravity is 9.81 m/s^2. At angle zero x is level and z up, and the link turns down.",
    ]


def _rows(name: str, history: History) -> list[str]:
    rows = []
    peaks = np.max(np.abs(history.closed_energies), axis=0)
    for (what, unit), peak, d in zip(
        ENERGY_ROWS, peaks, difference(history.energies, history.closed_energies), strict=True
    ):
        rows.append(f"| {name} | {what} | {unit} | {peak:.4g} | {d:.1e} | |")
    peaks = np.max(np.abs(history.closed_torques), axis=0)
    library = difference(history.torques, history.closed_torques)
    equations = difference(history.equation_torques, history.closed_torques)
    for (what, unit), peak, d, e in zip(TORQUE_ROWS, peaks, library, equations, strict=True):
        rows.append(f"| {name} | {what} | {unit} | {peak:.4g} | {d:.1e} | {e:.1e} |")
    return rows


def jumps(history: History) -> np.ndarray:
    """Return the largest jumps at the knots of the angle and its derivatives to the fifth, shape (6,)."""
    law = history.case.motion
    found = []
    for k in range(6):
        pieces = [np.polynomial.Polynomial(c).deriv(k) for c in law.coefficients.T]
        ends = [piece(step) for piece, step in zip(pieces, np.diff(law.knots), strict=True)]
        found.append(max(abs(end - piece(0.0)) for end, piece in zip(ends[:-1], pieces[1:], strict=True)))
    return np.array(found)


def _laws(histories: Mapping[str, History]) -> list[str]:
    inner = len(next(iter(histories.values())).case.knots) - 2
    lines = [
        "## The segments",
        "",
        f"Largest jumps at the {inner} inner knots; the fifth derivative is a step function, the lower ones are"
        " continuous.",
        "",
        "| motion | angle | speed | acceleration | jerk | jounce | fifth | end of the angle / rad |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name, history in histories.items():
        cells = " | ".join(f"{jump:.1e}" for jump in jumps(history))
        lines.append(f"| {name} | {cells} | {history.motion[-1, 0]:.12g} |")
    return lines


def _segment() -> list[str]:
    checks = segment.check()
    cut = [c for c in checks if not c.rounded]
    ends = segment.evaluated(np.array(segment.INTERVAL))
    lines = [
        "## The printed segment on [0.565, 0.605] s",
        "",
        "Five polynomials are printed, the angle to the jounce. With the signs + - + - + - of the angle, lost in the",
        "text, each coefficient must be its power times that of the polynomial before. Residual: printed less derived.",
        f"Of the {len(checks)} coefficients, {len(checks) - len(cut)} agree within the rounding of three decimals, and",
        f"{len(cut)} only if digits were cut off, not rounded; the largest residual is"
        f" {max(abs(c.residual) for c in checks)}.",
        "",
        "| derivative | power | printed | derived | residual | rounding explains |",
        "|---|---|---|---|---|---|",
    ]
    for c in checks:
        within = f"{'yes' if c.rounded else 'no'}, {c.rounding}"
        lines.append(f"| {NAMES[c.order]} | {c.power} | {c.printed} | {c.derived} | {c.residual} | {within} |")
    lines += ["", "| at | " + " | ".join(f"{n} / ({u})" for n, u in zip(NAMES, UNITS, strict=True)) + " |"]
    lines.append("|---|" + "---|" * len(NAMES))
    for column, instant in enumerate(segment.INTERVAL):
        cells = " | ".join(f"{value:.5g}" for value in ends[:, column])
        lines.append(f"| {instant} s | {cells} |")
    lines.append("| known to | " + " | ".join(f"{segment.uncertainty(k):.1g}" for k in range(len(NAMES))) + " |")
    lines += [
        "",
        "With these signs the arm is near its middle, past its highest speed and slowing down, which is plausible for",
        "a motion from 0 to pi. The speed is 3.5 times the mean of pi in 1.7 s: most of the turn must take much less",
        "than 1.7 s, unlike that of the stand-in. The segment is 0.040 s long, not the 0.0333 s of 51 equal segments,",
        "and 0.565 s is no multiple of these. The jounce changes by 1.8e4 rad/s^4 within the segment, in which the",
        "acceleration changes by 3.6 rad/s^2: so short a ripple says more of the samples than of the arm.",
    ]
    return lines
