"""The page `comparison.md`: the chosen data, closed forms beside the library, and the printed segment."""

from collections.abc import Iterator, Mapping

import numpy as np
from jaxtyping import Float

from jounce.papers.negrean_2025 import case as chosen, segment
from jounce.papers.negrean_2025.motion_history import STEPS, History, difference
from jounce.papers.output import markdown_table, page

ENERGIES = {"E_1 (141)": "kg m^2/s^4", "E_2 (142)": "kg m^2/s^6", "E_3 (143)": "kg m^2/s^8"}
TORQUES = {"torque (144)": "N m", "torque rate (145)": "N m/s", "second torque rate (146)": "N m/s^2"}
UNITS = {"angle": "rad", "speed": "rad/s", "acceleration": "rad/s^2", "jerk": "rad/s^3", "jounce": "rad/s^4"}


def comparison(histories: Mapping[str, History], data: str | None = None) -> str:
    """Return the page in Markdown; `data` describes measured data that replace the stand-ins."""
    first, checks = next(iter(histories.values())), segment.check()
    ends = segment.evaluated(np.array(segment.INTERVAL)).T
    names = tuple(UNITS)
    residuals = []
    for c in checks:
        explained = f"{'yes' if c.rounded else 'no'}, {c.rounding}"
        residuals.append((names[c.order], *map(str, (c.power, c.printed, c.derived, c.residual)), explained))
    differences = (row for name, history in histories.items() for row in _differences(name, history))
    jumped = (
        (name, *(f"{jump:.1e}" for jump in jumps(history)), f"{history.motion[-1, 0]:.12g}")
        for name, history in histories.items()
    )
    at_ends = [(f"{t} s", *(f"{x:.5g}" for x in row)) for t, row in zip(segment.INTERVAL, ends, strict=True)]
    at_ends.append(("known to", *(f"{segment.uncertainty(k):.1g}" for k in range(len(UNITS)))))
    columns = " | ".join(["at", *(f"{name} / ({unit})" for name, unit in UNITS.items())])
    return page(
        __package__,
        "comparison.md",
        data=data or stand_ins(),
        instants=len(first.time),
        steps=STEPS,
        differences=markdown_table(
            "motion | quantity | unit | largest value | library - closed form | higher-order - closed form", differences
        ),
        inner=len(first.case.knots) - 2,
        jumps=markdown_table(
            "motion | angle | speed | acceleration | jerk | jounce | fifth | end of the angle / rad", jumped
        ),
        coefficients=len(checks),
        rounded=sum(c.rounded for c in checks),
        cut=sum(not c.rounded for c in checks),
        residual=max(abs(c.residual) for c in checks),
        residuals=markdown_table("derivative | power | printed | derived | residual | rounding explains", residuals),
        ends=markdown_table(columns, at_ends),
    )


def stand_ins() -> str:
    """Return the part of the page about the chosen data."""
    size, rate, decay = chosen.RINGING
    return page(
        __package__,
        "stand_ins.md",
        link=chosen.STAND_IN,
        knots=len(chosen.KNOTS),
        ripple=" + ".join(f"{size:g} sin({rate:g} t + {phase:g})" for size, rate, phase in chosen.RIPPLE),
        stop=chosen.STOP,
        braking=chosen.BRAKING,
        size=size,
        rate=rate,
        decay=decay,
    ).rstrip()


def _differences(name: str, history: History) -> Iterator[tuple[str, ...]]:
    peaks = np.max(np.abs(history.closed_energies), axis=0)
    library = difference(history.energies, history.closed_energies)
    for (noun, unit), peak, d in zip(ENERGIES.items(), peaks, library, strict=True):
        yield name, noun, unit, f"{peak:.4g}", f"{d:.1e}", ""
    peaks = np.max(np.abs(history.closed_torques), axis=0)
    library = difference(history.torques, history.closed_torques)
    equations = difference(history.equation_torques, history.closed_torques)
    for (noun, unit), peak, d, e in zip(TORQUES.items(), peaks, library, equations, strict=True):
        yield name, noun, unit, f"{peak:.4g}", f"{d:.1e}", f"{e:.1e}"


def jumps(history: History) -> Float[np.ndarray, "6"]:
    """Return the largest jumps at the knots of the angle and its derivatives to the fifth."""
    law = history.case.motion
    rows = []
    for k in range(6):
        pieces = [np.polynomial.Polynomial(c).deriv(k) for c in law.coefficients.T]
        ends = [piece(step) for piece, step in zip(pieces, np.diff(law.knots), strict=True)]
        steps = [abs(end - piece(0.0)) for end, piece in zip(ends[:-1], pieces[1:], strict=True)]
        rows.append(max(steps, default=0.0))  # one segment has none
    return np.array(rows)
