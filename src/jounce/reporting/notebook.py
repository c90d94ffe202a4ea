"""How mechanisms, motions, robots, trajectories and batches show themselves in a notebook: small HTML tables."""

from __future__ import annotations

import html
import warnings
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from jounce.errors import SampleWarning
from jounce.reporting.summaries import count

__all__ = ["shown"]

ROWS = 30  # of a table, before the rest is counted
# Colours are left to the page, so that light and dark themes both fit; lines are see-through grey.
STYLE = (
    "<style scoped>.jounce{font-size:90%}.jounce table{border-collapse:collapse;margin:.3em 0 .6em}"
    ".jounce th,.jounce td{text-align:left;padding:.15em .8em .15em 0;border-bottom:1px solid rgba(128,128,128,.3);"
    "background:transparent;color:inherit}.jounce td.n,.jounce th.n{text-align:right;"
    "font-variant-numeric:tabular-nums}"
    ".jounce caption{text-align:left;font-weight:bold;color:inherit;white-space:nowrap}"
    ".jounce .bad{font-weight:bold;text-decoration:underline}.jounce p{margin:.2em 0}</style>"
)


def shown(thing: Any) -> str:
    """Return the HTML that a notebook shows of a mechanism, motion, simulation, robot, trajectory or batch.

    Examples
    --------
    >>> import jounce as jn
    >>> page = shown(jn.load("examples/four_bar.yaml"))
    >>> "Planar four-bar" in page, page.count("<table>")
    (True, 5)
    """
    from jounce.integrate import Batch, Simulation
    from jounce.kinematics import Motion
    from jounce.mechanism import Mechanism
    from jounce.robot import Robot
    from jounce.trajectory import JointTrajectory

    kinds: tuple[tuple[type, Any], ...] = (
        (Mechanism, _mechanism),
        (Simulation, _simulation),
        (Motion, _motion),
        (Robot, _robot),
        (JointTrajectory, _trajectory),
        (Batch, _batch),
    )
    parts = next(show for kind, show in kinds if isinstance(thing, kind))(thing)
    return f'<div class="jounce">{STYLE}{"".join(parts)}</div>'


def _text(value: Any) -> str:
    return html.escape(str(value))


def _title(title: str, *lines: str) -> list[str]:
    return [f"<p><b>{_text(title)}</b></p>", *(f"<p>{_text(line)}</p>" for line in lines if line)]


def _table(caption: str, headings: Sequence[str], rows: Iterable[Sequence[Any]], numbers: Sequence[int] = ()) -> str:
    """Return a table; names are escaped, long ones are cut at ROWS rows."""
    rows = list(rows)
    if not rows:
        return ""

    def cells(tag: str, row: Sequence[Any]) -> str:
        marks = [' class="n"' if k in numbers else "" for k in range(len(row))]
        return "".join(f"<{tag}{m}>{_text(x)}</{tag}>" for m, x in zip(marks, row, strict=True))

    body = "".join(f"<tr>{cells('td', row)}</tr>" for row in rows[:ROWS])
    if len(rows) > ROWS:
        body += f'<tr><td colspan="{len(headings)}">and {len(rows) - ROWS} more</td></tr>'
    head = f"<thead><tr>{cells('th', headings)}</tr></thead>"
    return f"<table><caption>{_text(caption)}</caption>{head}<tbody>{body}</tbody></table>"


def _number(value: Any) -> str:
    from jounce.trajectory import Expression

    if value is None:
        return "-"
    if isinstance(value, Expression):
        return value.text
    if isinstance(value, str):
        return value
    if np.shape(value):
        return "[" + ", ".join(map(_number, value)) + "]"
    number = float(value)
    return f"{number:.6g}" if np.isfinite(number) else "-"


def _mechanism(mechanism: Any) -> list[str]:
    from jounce.reporting.mechanism_facts import _element, _output

    def rows(section: str) -> list[list[str]]:
        found = [_element(section, name, x, {}) for name, x in getattr(mechanism, section).items()]
        law = "motion" if section in ("drivers", "initial") else "law"
        more = [] if section == "joints" else [law]
        return [[x["name"], x["type"], ", ".join(x["bodies"]), *(x.get(key, "") for key in more)] for x in found]

    bodies = count(len(mechanism.bodies), "moving body", "moving bodies")
    joints = count(len(mechanism.joints), "joint")
    outputs = [_output(name, x) for name, x in mechanism.outputs.items()]
    attitude = "angle" if mechanism.space == "planar" else "orientation"
    masses = any(body.mass is not None for body in mechanism.bodies.values())
    return [
        *_title(mechanism.title or "Mechanism", f"{mechanism.space}: {bodies}, {joints}"),
        _table("Parameters (SI)", ("name", "value"), [[n, _number(x)] for n, x in mechanism.parameters.items()], (1,)),
        _table(
            "Bodies, as guessed",
            ("body", "position/m", "angle/rad" if attitude == "angle" else attitude, *(["mass/kg"] * masses)),
            [
                [n, _number(b.position), _number(getattr(b, attitude)), *([_number(b.mass)] * masses)]
                for n, b in mechanism.bodies.items()
            ],
        ),
        _table("Joints", ("joint", "type", "bodies"), rows("joints")),
        _table("Drivers", ("driver", "type", "bodies", "motion"), rows("drivers")),
        _table("Forces", ("force", "type", "bodies", "law"), rows("forces")),
        _table("Initial conditions", ("condition", "type", "bodies", "motion"), rows("initial")),
        _table(
            "Outputs",
            ("output", "quantity", "of", "unit"),
            [[x["name"], x["quantity"], ", ".join(x["of"]), x["unit"]] for x in outputs],
        ),
    ]


def _motion(motion: Any) -> list[str]:
    from jounce.kinematics import Status

    solved, total = int(np.sum(motion.status == Status.OK)), len(motion.time)
    span = f"{solved} of {count(total, 'instant')} solved, t = {motion.time[0]:g} s to {motion.time[-1]:g} s, order "
    failed = np.flatnonzero(motion.status != Status.OK)
    lines = _title(motion.mechanism.title or "Motion", f"{span}{motion.order}")
    if failed.size:
        first = int(failed[0])
        word = Status(motion.status[first]).name.lower().replace("_", " ")
        culprit = motion.culprits.get(first)
        place = f" ({culprit})" if culprit else ""
        lines.append(f'<p class="bad">{_text(f"t = {motion.time[first]:g} s: {word}{place}")}</p>')
    return [*lines, _peaks(motion)]


def _peaks(motion: Any) -> str:
    from jounce.reporting.peaks import peaks

    if not motion.mechanism.outputs:
        return "<p>No outputs are defined.</p>"
    found = peaks(motion)
    rows = []
    for peak in found:
        low, high = (_rounded(x, peak.size) for x in (peak.minimum, peak.maximum))
        low_at, high_at = (_rounded(x, 0.0) for x in (peak.minimum_at, peak.maximum_at))
        rows.append([peak.output, peak.derivative, peak.unit, low, low_at, high, high_at])
    headings = ("output", "derivative", "unit", "minimum", "at t/s", "maximum", "at t/s")
    return _table("Peaks", headings, rows, (3, 4, 5, 6))


def _rounded(number: float, size: float) -> str:
    if not np.isfinite(number):
        return "-"
    return f"{0.0 if abs(number) < 1e-15 * size else number:.6g}"


def _simulation(motion: Any) -> list[str]:
    from jounce.kinematics import Status

    *head, table = _motion(motion)
    reached = motion.status == Status.OK
    lines = [motion.mobility, count(motion.steps, "step")]
    if reached.any():
        energy = motion.energy[reached]
        change = float(np.max(np.abs(energy - energy[0])))
        lines.append(f"energy {energy[0]:.6g} J at the start, changes by {change:.2g} J")
        lines.append(f"constraint drift {np.max(motion.drift[reached]):.1e}")
    return [*head, *(f"<p>{_text(line)}</p>" for line in lines), table]


def _robot(robot: Any) -> list[str]:
    rows = []
    for joint in robot.joints.values():
        if not joint.moving:
            continue
        limits, unit = joint.limits, "rad" if joint.turning else "m"
        span = "-" if limits.lower is None and limits.upper is None else f"{_number(limits.lower)} to "
        span += "" if span == "-" else f"{_number(limits.upper)} {unit}"
        follows = "" if joint.mimic is None else f"{joint.mimic.joint} x {joint.mimic.multiplier:g}"
        ends = f"{joint.parent} to {joint.child}"
        rows.append([joint.name, joint.type, ends, span, _number(limits.velocity), _number(limits.effort), follows])
    masses = [
        [name, _number(link.inertia.mass), _number(link.inertia.center_of_mass)]
        for name, link in robot.links.items()
        if link.inertia is not None
    ]
    closures = [[name, x.type, ", ".join(x.links)] for name, x in robot.closures.items()]
    joints, links = count(len(robot.joint_names), "coordinate"), count(len(robot.links), "link")
    headings = ("joint", "type", "links", "range", "velocity", "effort", "follows")
    return [
        *_title(robot.name, f"{joints}, {links}, {robot.mass:.6g} kg, on {robot.base}"),
        _table("Moving joints (rad, m, N m, N)", headings, rows, (4, 5)),
        _table("Masses", ("link", "mass/kg", "centre of mass/m"), masses, (1,)),
        _table("Loops closed by", ("closure", "type", "links"), closures),
    ]


def _trajectory(trajectory: Any) -> list[str]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SampleWarning)  # ranges only
        values = np.asarray(trajectory.derivatives(trajectory.times, order=3))
    names = ("position", "velocity", "acceleration", "jerk")
    rows = []
    for k, name in enumerate(trajectory.names):
        spans = [f"{_number(values[:, d, k].min())} to {_number(values[:, d, k].max())}" for d in range(4)]
        rows.append([name, type(trajectory.laws[name]).__name__, *spans])
    joints = count(len(rows), "joint")
    line = f"{joints}, t = {trajectory.start:g} s to {trajectory.stop:g} s, {count(len(trajectory.times), 'instant')}"
    headings = ("joint", "law", *(f"{name}, SI" for name in names))
    return [*_title("Joint trajectory", line), _table("Ranges", headings, rows)]


def _batch(batch: Any) -> list[str]:
    from jounce.kinematics import Status

    whole = (batch.status == Status.OK).all(axis=1)
    line = f"{int(whole.sum())} of {count(len(whole), 'run')} complete, {count(len(batch.time), 'instant')}"
    parameters = [[name, _number(x.min()), _number(x.max())] for name, x in batch.parameters.items()]
    outputs = []
    for name, values in batch.outputs.items():
        finite = values[np.isfinite(values).all(axis=tuple(range(1, values.ndim)))]
        first = np.take(finite, 0, axis=2) if finite.size else np.full((1, 1), np.nan)
        outputs.append([name, " x ".join(map(str, values.shape)), _number(first.min()), _number(first.max())])
    return [
        *_title("Batch of simulations", line, f"t = {batch.time[0]:g} s to {batch.time[-1]:g} s"),
        _table("Parameters (SI)", ("name", "smallest", "largest"), parameters, (1, 2)),
        _table("Outputs of complete runs (SI)", ("output", "shape", "smallest", "largest"), outputs, (2, 3)),
    ]
