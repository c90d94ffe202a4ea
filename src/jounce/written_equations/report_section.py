"""The equations of a mechanism at an instant of its motion, as a section of a page for a thesis or a report."""

import html
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from jounce.base.shapes import Real, real_numbers
from jounce.dynamics.inverse.constraint_equations import constraint_equations
from jounce.errors import MechanismError
from jounce.kinematics import Motion, Status
from jounce.written_equations.joint_forms.latex import source_of

if TYPE_CHECKING:
    import xarray

SIDES = ("v", "&gamma;", "&eta;", "&sigma;")


def equations_section(motion: Motion, at: Real | None = None) -> str:
    """Return the equations of a mechanism as HTML: joints with their numbers in Sommer 2024, the pattern, right sides.

    Parameters
    ----------
    motion : Motion
        Solved or simulated motion.
    at : float, optional
        Time, s; the section shows the nearest instant of the motion. The first instant unless given.

    Raises
    ------
    MechanismError
        If `at` is outside the motion, or the instant was not solved.
    """
    time = motion.time
    if at is not None and not time.min() <= float(real_numbers("at", at, MechanismError)) <= time.max():
        raise MechanismError(f"is beyond the motion, {time.min():g} to {time.max():g} s", name="at", value=at)
    place = 0 if at is None else int(np.argmin(np.abs(time - at)))
    if motion.status[place] != Status.OK:
        raise MechanismError(f"was not solved at t = {time[place]:g} s; choose another", name="at", value=at)
    equations = constraint_equations(motion)
    pattern = (np.abs(equations.jacobian.values[motion.status == Status.OK]) > 0).any(axis=0)
    values = equations.isel(time=place)
    return "\n".join([
        '<section id="equations">',
        f"<h2>Constraint equations at t = {float(time[place]):.9g} s</h2>",
        "<p>&Phi;(q, t) = 0, and each time derivative of it, &Phi;<sub>q</sub> q<sup>(k)</sup> = v, &gamma;, &eta;, "
        "&sigma;, ...; S is Sommer, Mechanism and Machine Theory 196, 2024, 105613.</p>",
        _table(("joint or driver", "type", "S", "bodies", "rows"), _joints(motion, equations)),
        f"<h2>Jacobian, {pattern.shape[0]} by {pattern.shape[1]}: where it is not zero</h2>",
        f'<pre class="wide">{_pattern(equations, pattern)}</pre>',
        "<h2>Residuals and right sides, SI units</h2>",
        f'<div class="wide">{_sides(values)}</div>',
        "</section>",
    ])  # fmt: skip


def _joints(motion: Motion, equations: "xarray.Dataset") -> Iterable[Sequence[Any]]:
    rows = [row.rpartition(".")[0] for row in equations.row.values.tolist()]
    for name, element in {**motion.mechanism.joints, **motion.mechanism.drivers}.items():
        kind = (element.type_name or type(element).__name__).replace("_", " ")
        yield name, kind, source_of(type(element)) or "-", ", ".join(element.bodies), rows.count(name)


def _pattern(equations: "xarray.Dataset", pattern: np.ndarray) -> str:
    """Return the pattern of nonzero entries: a line for each row, a group of places for each body."""
    columns, rows = equations.column.values.tolist(), equations.row.values.tolist()
    bodies = [column.rpartition(".")[0] for column in columns]
    names = list(dict.fromkeys(bodies))
    counts = [bodies.count(body) for body in names]
    width = max(map(len, rows), default=0)
    widths = [max(2 * count - 1, len(body)) for body, count in zip(names, counts, strict=True)]
    lines = [" " * width + "  " + "  ".join(body.ljust(size) for body, size in zip(names, widths, strict=True))]
    for row, marks in zip(rows, pattern.tolist(), strict=True):
        parts, first = [], 0
        for count, size in zip(counts, widths, strict=True):
            parts.append(" ".join("x" if mark else "." for mark in marks[first : first + count]).ljust(size))
            first += count
        lines.append(f"{row.ljust(width)}  {'  '.join(parts)}")
    return html.escape("\n".join(line.rstrip() for line in lines))


def _sides(values: "xarray.Dataset") -> str:
    orders = [k for k in values.derivative.values.tolist() if np.isfinite(values.right_side.sel(derivative=k)).any()]
    names = [SIDES[k - 1] if k <= len(SIDES) else f"k = {k}" for k in orders]
    columns = [values.residual.values, *(values.right_side.sel(derivative=k).values for k in orders)]
    if "multipliers" in values:
        names, columns = [*names, "&lambda;"], [*columns, values.multipliers.sel(derivative=0).values]
    rows = ((row, *(f"{column[k]:.9g}" for column in columns)) for k, row in enumerate(values.row.values.tolist()))
    return _table(("row", "&Phi;", *names), rows)


def _table(headings: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Return a table in HTML; heads are HTML, rows are plain text."""
    lines = [f"<tr>{''.join(f'<th>{head}</th>' for head in headings)}</tr>"]
    lines += [f"<tr>{''.join(f'<td>{html.escape(str(x))}</td>' for x in row)}</tr>" for row in rows]
    return f"<table>{''.join(lines)}</table>"
