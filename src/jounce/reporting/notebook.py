"""Display of mechanisms, motions, robots, trajectories and batches in a notebook: small HTML tables."""

from __future__ import annotations

import dataclasses
import html
import warnings
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from jounce.base.display import Displayed
from jounce.design import OptimizedDesign
from jounce.dynamics import Equilibrium, LimitReport, Linearization, Modes
from jounce.dynamics.limits.check_limits import fine_grid
from jounce.errors import JounceError, SampleWarning
from jounce.integrate import Batch, RobotSimulation
from jounce.kinematics import Assemblies, Curve, Motion, PlateCam, Status
from jounce.mechanism import Mechanism
from jounce.planning import Feedforward, JointPoses, ToolPathMotion
from jounce.reporting.facts.curve_facts import curve_facts, curve_summary, curve_tables
from jounce.reporting.facts.design_facts import design_facts, design_table, design_words
from jounce.reporting.facts.mechanism.mechanism_facts import mechanism_facts
from jounce.reporting.facts.modes_facts import equilibrium_facts, equilibrium_tables, equilibrium_words, modes_table
from jounce.reporting.facts.motion_facts import motion_facts
from jounce.reporting.facts.robot_facts import robot_facts
from jounce.reporting.peaks import peaks, shown_peaks, table_peaks
from jounce.reporting.text.summaries import count, robot_motion_words, verdict
from jounce.reporting.text.tables import Table, limits_table, mechanism_tables, number, peaks_table, robot_tables, table
from jounce.robot import Robot
from jounce.trajectory import JointTrajectory
from jounce.units.instants import interval_text, time_text

ROWS = 30  # of a table; further rows are only counted
# Colors are those of the page, for light and dark themes; lines are translucent gray.
STYLE = (
    "<style scoped>.jounce{font-size:90%}.jounce table{border-collapse:collapse;margin:.3em 0 .6em}"
    ".jounce th,.jounce td{text-align:left;padding:.15em .8em .15em 0;border-bottom:1px solid rgba(128,128,128,.3);"
    "background:transparent;color:inherit}.jounce td.n,.jounce th.n{text-align:right;"
    "font-variant-numeric:tabular-nums}"
    ".jounce caption{text-align:left;font-weight:bold;color:inherit;white-space:nowrap}"
    ".jounce .bad{font-weight:bold;text-decoration:underline}.jounce p{margin:.2em 0}</style>"
)


def shown(displayed: Displayed) -> str:
    """Return the HTML with which a notebook shows an object of this package, such as a mechanism or a motion.

    Examples
    --------
    >>> import jounce as jn
    >>> page = shown(jn.load("examples/four_bar.yaml"))
    >>> "Planar four-bar" in page, page.count("<table>")
    (True, 5)
    """
    match displayed:
        case Mechanism():
            parts = _mechanism(displayed)
        case Motion():
            parts = _motion(displayed)
        case Robot():
            parts = _robot(displayed)
        case JointTrajectory():
            parts = _trajectory(displayed)
        case Batch():
            parts = _batch(displayed)
        case Equilibrium():
            parts = _equilibrium(displayed)
        case Linearization():
            parts = _linearization(displayed)
        case Modes():
            parts = _tables([modes_table(displayed)])
        case Curve():
            facts = curve_facts(displayed)
            parts = [*_title(*(curve_summary(facts, "Curve").split("\n"))), *_tables(curve_tables(facts))]
        case OptimizedDesign():
            design = design_facts(displayed, "Optimized design")
            parts = [*_title(*design_words(design).split("\n")), *_tables([design_table(design)])]
        case LimitReport():
            parts = [
                *_title(
                    displayed.robot, *(verdict(displayed).split("\n") if displayed.limited else ["nothing has a limit"])
                ),
                *_tables([limits_table(displayed)]),
            ]
        case _:
            parts = _others(displayed)
    return f'<div class="jounce">{STYLE}{"".join(parts)}</div>'


def _others(displayed: Displayed) -> list[str]:
    """Return the HTML of the less common results."""
    match displayed:
        case Assemblies():
            return _assemblies(displayed)
        case RobotSimulation():
            title = _title(*robot_motion_words(displayed))
            return [*title, *_tables([dataclasses.replace(peaks_table(table_peaks(displayed.dataset)), title="Peaks")])]
        case ToolPathMotion():
            return _tool_path_motion(displayed)
        case JointPoses():
            return _joint_poses(displayed)
        case PlateCam() | Feedforward():
            return [*_title(repr(displayed).strip("<>")), *_tables([_ranges(displayed.dataset)])]
    return _title(repr(displayed).strip("<>"))


def _text(value: object) -> str:
    return html.escape(str(value))


def _title(title: str, *lines: str) -> list[str]:
    return [f"<p><b>{_text(title)}</b></p>", *(f"<p>{_text(line)}</p>" for line in lines if line)]


def _tables(tables: Iterable[Table]) -> list[str]:
    """Return tables as HTML, with names escaped and at most ROWS rows each."""
    return [_table(each) for each in tables if each.rows]


def _table(table: Table) -> str:
    def cells(tag: str, row: Sequence[str]) -> str:
        marks = [' class="n"' if k in table.numbers else "" for k in range(len(row))]
        return "".join(f"<{tag}{m}>{_text(x)}</{tag}>" for m, x in zip(marks, row, strict=True))

    body = "".join(f"<tr>{cells('td', row)}</tr>" for row in table.rows[:ROWS])
    if len(table.rows) > ROWS:
        body += f'<tr><td colspan="{len(table.headings)}">and {len(table.rows) - ROWS} more</td></tr>'
    head = f"<thead><tr>{cells('th', table.headings)}</tr></thead>"
    return f"<table><caption>{_text(table.title)}</caption>{head}<tbody>{body}</tbody></table>"


def _written(value: Any) -> str:
    """Return a value as it was given, as text: a number, an expression of parameters, or a list of them."""
    if value is None or isinstance(value, str):
        return value or "-"
    if np.shape(value):
        return "[" + ", ".join(map(_written, value)) + "]"
    return getattr(value, "text", None) or number(float(value))


def _mechanism(mechanism: Mechanism) -> list[str]:
    bodies = count(len(mechanism.rigid_bodies), "moving body", "moving bodies")
    joints = count(len(mechanism.joints), "joint")
    title = _title(mechanism.title or "Mechanism", f"{mechanism.space}: {bodies}, {joints}")
    attitude = "angle" if mechanism.space == "planar" else "orientation"
    guessed = table(
        "Bodies, as guessed",
        ("body", "position/m", "angle/rad" if attitude == "angle" else attitude, "mass/kg"),
        [
            [n, _written(b.position), _written(getattr(b, attitude)), "" if b.mass is None else _written(b.mass)]
            for n, b in mechanism.rigid_bodies.items()
        ],
    )
    try:
        return [*title, *_tables(mechanism_tables(mechanism_facts(mechanism), guessed))]
    except JounceError as error:  # of circular parameters
        return [*title, *_title(str(error)), *_tables([guessed])]


def _motion(motion: Motion) -> list[str]:
    facts = motion_facts(motion)
    time = facts["time"]
    phrase = f"{time['solved']} of {count(time['count'], 'instant')} solved"
    line = f"{phrase}, t = {interval_text(time['start'], time['stop'])}, order {facts['order']}"
    lines = _title(facts["title"] or "Motion", line)
    if facts["failures"]:
        failure = facts["failures"][0]
        fault = f" ({failure['fault']})" if failure["fault"] else ""
        word = failure["status"].lower().replace("_", " ")
        text = _text(f"t = {time_text(failure['time'])} s: {word}{fault}")
        lines.append(f'<p class="bad">{text}</p>')
    if "steps" in facts:
        text = [facts["mobility"], count(facts["steps"], "step")]
        if time["solved"]:
            energy = facts["energy"]
            text.append(f"energy {energy['start']:.6g} J at the start, changes by {energy['largest_change']:.2g} J")
            text.append(f"constraint drift {facts['drift']:.1e}")
        lines += [f"<p>{_text(line)}</p>" for line in text]
    if not motion.mechanism.outputs:
        return [*lines, "<p>No outputs are defined.</p>"]
    motion_peaks = shown_peaks(peaks(motion), motion.mechanism.shown_units)
    return [*lines, *_tables([dataclasses.replace(peaks_table(motion_peaks), title="Peaks")])]


def _equilibrium(rest: Equilibrium) -> list[str]:
    lines = equilibrium_words(equilibrium_facts(rest, [])).split("\n")
    return [*_title(rest.mechanism.title or "Equilibrium", *lines), *_tables(equilibrium_tables(rest))]


def _linearization(model: Linearization) -> list[str]:
    place = "a motion" if model.equilibrium is None else f"an equilibrium that is {model.equilibrium.stability}"
    title = _title(model.mechanism.title or "Small motions", f"about {place} at t = {time_text(model.time)} s")
    tables = []
    for name, matrix in (("Mass", model.mass), ("Damping", model.damping), ("Stiffness", model.stiffness)):
        rows = [[c, *map(number, row)] for c, row in zip(model.coordinates, matrix.tolist(), strict=True)]
        tables.append(Table(f"{name} (SI)", ("", *model.coordinates), rows, range(1, len(rows) + 1)))
    return [*title, *_tables([*tables, modes_table(model.modes)])]


def _robot(robot: Robot) -> list[str]:
    facts = robot_facts(robot)
    joints, links = count(len(robot.joint_names), "coordinate"), count(len(facts["links"]), "link")
    line = f"{joints}, {links}, {facts['mass']:.6g} kg, on {facts['base']}"
    return [*_title(facts["title"], line), *_tables(robot_tables(facts))]


def _trajectory(trajectory: JointTrajectory) -> list[str]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SampleWarning)  # ranges only
        values = np.asarray(trajectory.derivatives(fine_grid(trajectory, least=1), order=3))
    names = ("position", "velocity", "acceleration", "jerk")
    rows = []
    for k, name in enumerate(trajectory.names):
        ranges = [_range(values[:, d, k]) for d in range(4)]
        rows.append([name, type(trajectory.laws[name]).__name__, *ranges])
    joints = count(len(rows), "joint")
    line = (
        f"{joints}, t = {interval_text(trajectory.start, trajectory.stop)}, {count(len(trajectory.times), 'instant')}"
    )
    headings = ("joint", "law", *(f"{name}, SI" for name in names))
    return [*_title("Joint trajectory", line), *_tables([Table("Ranges", headings, rows)])]


def _assemblies(assemblies: Assemblies) -> list[str]:
    headings = ("assembly", "circuit", "branch", "found from", "distance", "least singular value")
    rows = [
        [
            str(assembly.number),
            *("-" if part is None else str(part) for part in (assembly.circuit, assembly.branch)),
            count(assembly.hits, "start"),
            number(assembly.distance),
            number(assembly.smallest_singular_value),
        ]
        for assembly in assemblies
    ]
    return [*_title(repr(assemblies).strip("<>")), *_tables([Table("", headings, rows, range(4, 6))])]


def _tool_path_motion(motion: ToolPathMotion) -> list[str]:
    orders = ("position", "velocity", "acceleration", "jerk")[: motion.q.shape[1]]
    rows = [
        [name, *(_range(motion.q[:, order, k]) for order in range(len(orders)))]
        for k, name in enumerate(motion.robot.joint_names)
    ]
    title = _title(repr(motion).strip("<>"), motion.ending)
    return [*title, *_tables([Table("Ranges", ("joint", *(f"{word}, SI" for word in orders)), rows)])]


def _joint_poses(poses: JointPoses) -> list[str]:
    rows = [[name, _range(poses.q[..., k])] for k, name in enumerate(poses.joint_names)]
    return [*_title(repr(poses).strip("<>")), *_tables([Table("Coordinates", ("joint", "range, SI"), rows)])]


def _ranges(dataset: Any) -> Table:
    """Return the table of ranges of the variables of a dataset, without their derivatives."""
    rows = []
    for name, variable in dataset.data_vars.items():
        values = variable.isel(derivative=0) if "derivative" in variable.dims else variable
        rows.append([str(name), str(variable.attrs.get("units", "")), _range(values.values)])
    return Table("Ranges", ("quantity", "unit", "range"), rows)


def _range(values: np.ndarray) -> str:
    finite = values[np.isfinite(values)]
    return f"{number(finite.min())} to {number(finite.max())}" if finite.size else "-"


def _batch(batch: Batch) -> list[str]:
    is_complete = (batch.status == Status.OK).all(axis=1)
    line = f"{int(is_complete.sum())} of {count(len(is_complete), 'run')} complete, {count(len(batch.time), 'instant')}"
    parameters = [[name, number(x.min()), number(x.max())] for name, x in batch.parameters.items()]
    outputs = []
    for name, values in batch.outputs.items():
        finite = values[np.isfinite(values).all(axis=tuple(range(1, values.ndim)))]
        first = np.take(finite, 0, axis=2) if finite.size else np.full((1, 1), np.nan)
        outputs.append([name, " x ".join(map(str, values.shape)), number(first.min()), number(first.max())])
    return [
        *_title("Batch of simulations", line, f"t = {interval_text(batch.time[0], batch.time[-1])}"),
        *_tables(
            [
                Table("Parameters (SI)", ("name", "smallest", "largest"), parameters, (1, 2)),
                Table("Outputs of complete runs (SI)", ("output", "shape", "smallest", "largest"), outputs, (2, 3)),
            ]
        ),
    ]
