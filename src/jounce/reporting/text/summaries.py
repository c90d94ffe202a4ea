"""Summaries in words of mechanisms, robots and motions, and of a trajectory and the limits of a robot."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jounce.dynamics.limits.check_limits import INSTANTS
from jounce.dynamics.limits.limit_report import LimitReport
from jounce.dynamics.limits.motion_ends import TrajectoryEnd
from jounce.dynamics.limits.trajectories import drives_note
from jounce.mechanism.time import last_step_words
from jounce.reporting.load_changes import load_words
from jounce.reporting.motion_ends import between_words, breaks_words, ends_words
from jounce.reporting.text.law_facts import law_words
from jounce.trajectory import JointTrajectory
from jounce.units.instants import interval_text, time_text

if TYPE_CHECKING:
    import xarray

    from jounce.integrate.results.robot_simulation import RobotSimulation

Facts = Mapping[str, Any]
"""Plain data, by the keys of a kind of facts."""


def motion_summary(facts: Facts, file: str) -> str:
    """Return the summary of a motion: bodies, degrees of freedom, instants, and conservation of energy."""
    time, title = facts["time"], facts["title"] or file
    interval = (
        f"t = {time_text(time['start'])} s"
        if time["count"] == 1
        else f"from t = {interval_text(time['start'], time['stop'])}"
    )
    all_solved = time["solved"] == time["count"]
    instants = count(time["count"], "instant") if all_solved else f"{time['solved']} of {time['count']} instants"
    bodies = count(len(facts["bodies"]), "moving body", "moving bodies")
    joints = count(len(facts["joints"]), "joint")
    order = f"derivatives to order {facts['order']}"
    if "steps" in facts:
        head = f"{facts['space']}: {bodies}, {joints}, {count(len(facts['forces']), 'force')}"
        phrase = f"{instants} {interval} in {count(facts['steps'], 'step')}, {order}"
        lines = [title, head, facts["mobility"], phrase, *_conservation_lines(facts), *facts["remarks"]]
        return "\n".join(wrapped(line) for line in lines)
    equations, drives = facts["equations_of_joints"], facts["equations_of_drivers"]
    bodies = _with_carriages(bodies, facts, facts["coordinates"])
    bodies, joints = f"{bodies} ({facts['coordinates']} coordinates)", f"{joints} ({count(equations, 'equation')})"
    lines = [title, f"{facts['space']}: {bodies}, {joints}", freedom_words(drives, facts["drivers"])]
    lines.append(f"{instants} {interval}, {order}")
    if facts["change_points"]:
        change_points = ", ".join(f"{t:g} s" for t in facts["change_points"][:6])
        ellipsis = ", ..." if len(facts["change_points"]) > 6 else ""
        lines.append(f"passes a change point, where another motion could branch off, at t = {change_points}{ellipsis}")
    lines += [wrapped(remark) for remark in facts["remarks"]]
    return "\n".join(lines)


def _with_carriages(phrase: str, facts: Facts, coordinates: int) -> str:
    """Return the number of bodies in words, with the number of carriages, which have hidden joint coordinates."""
    carriages = coordinates // (3 if facts["space"] == "planar" else 6) - len(facts["bodies"])
    return f"{phrase} and {count(carriages, 'carriage of a joint', 'carriages of joints')}" if carriages else phrase


def _conservation_lines(facts: Facts) -> list[str]:
    """Return the lines on the conservation of energy and constraints in a simulation."""
    if not facts["time"]["solved"]:
        return []
    energy, kinks = facts["energy"], facts["kinks"]
    change, size = energy["largest_change"], energy["largest_kinetic"]
    fraction = f", {change / size:.1e} of the largest kinetic energy" if size else ""
    lines = [f"energy: {energy['start']:.9g} J at the start; it changes by {change:.2g} J{fraction}"]
    if facts["drivers"] or facts["forces"]:
        lines.append("(drivers, actuators and dampers change it)")
    if kinks:
        names = ", ".join(dict.fromkeys(kink["name"] for kink in kinks))
        kinks_text = count(len(kinks), "kink or jump", "kinks or jumps")
        lines.append(f"{kinks_text}: {names}, the first at t = {time_text(kinks[0]['time'])} s; no derivatives there")
    lines.append(f"constraint drift: {facts['drift']:.1e} (rad, or sizes of the mechanism)")
    return lines


def freedom_words(freedom: int, drivers: Iterable[str]) -> str:
    """Return the degrees of freedom and their drivers in words."""
    phrase, names = count(freedom, "degree of freedom", "degrees of freedom"), ", ".join(drivers)
    return f"{phrase}, driven by {names}" if names else phrase


def start_summary(facts: Facts) -> str:
    """Return the degrees of freedom of a mechanism or a robot in words, and whether a motion can start."""
    return "\n".join(_mechanism_start(facts) if facts["kind"] == "mechanism" else _robot_start(facts))


def start_heading(facts: Facts) -> str:
    """Return the heading of a file: its title, its kind and its degrees of freedom."""
    freedom = facts["freedom"]["words"]
    if facts["kind"] == "mechanism":
        return f"{facts['title'] or facts['file']}\n{facts['space']} mechanism: {freedom}"
    return f"{facts['title']}\nrobot on {facts['base']}: {freedom}, {facts['mass']:.6g} kg"


def _mechanism_start(facts: Facts) -> list[str]:
    freedom, assembly, time = facts["freedom"], facts["assembly"], facts["time"]
    bodies = count(len(facts["bodies"]), "moving body", "moving bodies")
    bodies = _with_carriages(bodies, facts, facts["freedom"]["coordinates"])
    lines = [
        "Degrees of freedom",
        f"  {bodies}: {count(freedom['coordinates'], 'coordinate')}",
        f"  joints: {count(freedom['equations'] - freedom['of_drivers'], 'equation')}"
        f"; drivers: {count(freedom['of_drivers'], 'equation')}; independent: {freedom['independent']}",
    ]
    for repeated in freedom["repeated"]:
        equations = count(repeated["equations"], "equation")
        lines.append(f"  {repeated['kind']} {repeated['name']} repeats {equations} of {', '.join(repeated['of'])}")
    if (mobility := facts["mobility"]) is not None:
        if mobility["order"] is not None:
            lines.append(f"  with drivers released: {mobility['count']} by count, {mobility['instantaneous']} by rank")
        lines.append(f"  {mobility['words']}")
    if freedom["left"]:
        lines.append(f"  left to move: {freedom['left']}, with which {', '.join(freedom['moving'])} can move")
    if freedom["idle"]:
        spinning = "; ".join(
            " and ".join(bodies) + (" as one" if len(bodies) > 1 else "") for bodies in freedom["idle"]
        )
        lines.append(f"  idle: {spinning} may spin about an axis of itself; held by the least motion")
    assembled = assembly["status"] == "assembled"
    lines += [
        "",
        "Start",
        f"  assembled at t = {time_text(assembly['at'])} s" if assembled else f"  {assembly['message']}",
    ]
    if time is not None:
        lines.append(f"  time: {count(time['count'], 'instant')} from {interval_text(time['start'], time['stop'])}")
        lines += [f"  {time['remark']}"] if "remark" in time else []
    else:
        lines.append("  no time grid is given")
    remarks = (*law_words(facts["laws"]), *_train_words(facts["trains"]), *efficiency_words(facts["efficiencies"]))
    remarks = (*remarks, *screw_words(facts["screws"]), *line_words(facts["lines"]), *facts["remarks"])
    lines += [f"  {line}" for line in remarks]
    if freedom["message"] and facts["ok"] and freedom["left"]:
        lines.append("  it has degrees of freedom left: jounce simulate moves it by its forces")
    elif freedom["message"]:
        lines.append(f"  {freedom['message']}")
    elif facts["ok"]:
        lines.append("  all motion is prescribed: jounce run solves it")
    return lines


def _robot_start(facts: Facts) -> list[str]:
    freedom, message = facts["freedom"], facts["assembly"]["message"]
    lines = ["Degrees of freedom", f"  {count(freedom['coordinates'], 'moving joint')} that follow no other"]
    if facts["closures"] and facts["ok"]:
        lines.append(f"  loops: {count(freedom['equations'], 'independent equation')}; left: {freedom['left']}")
    return lines + ([f"  {message}"] if message else [])


def limits_summary(report: LimitReport, motion: JointTrajectory, robot: Path, trajectory: Path) -> str:
    """Return the summary of a check of limits: the motion, joints at rest, and quantities without limits."""
    joint_count = count(len(motion.names), "moving joint")
    lines = [
        f"{report.robot}: {joint_count} ({robot.name}, {trajectory.name})",
        f"t = {interval_text(motion.start, motion.stop)}, {len(report.times)} instants and the peaks between them",
    ]
    lines += filter(None, [last_step_words(motion.times)])
    if report.held:
        units = {row.joint: "m" if row.unit == "N" else "rad" for row in report.rows if row.unit in ("N", "N m")}
        resting = [f"{name} at {value:.6g} {units[name]}" for name, value in report.held.items()]
        lines.append(f"not in the trajectory, held still: {', '.join(resting)}")
    if any(row.unit.startswith("N") for row in report.limited):
        lines.append(f"torques: {drives_note(report.drives)}")
    free: dict[str, list[str]] = {}
    for row in report.rows:
        if row.ratio is None:
            free.setdefault(row.quantity, []).append(row.joint)
    if free:
        limited = {row.quantity for row in report.limited}
        unlimited = [f"{word} of {', '.join(names)}" if word in limited else word for word, names in free.items()]
        lines.append(f"without a limit: {', '.join(unlimited)}")
    lines += [*between_words(motion), *ends_words(report.ends), *load_words(report)]
    return "\n".join(wrapped(line) for line in lines)


def torques_summary(
    dataset: xarray.Dataset, motion: JointTrajectory, ends: Sequence[TrajectoryEnd], robot: Path, trajectory: Path
) -> str:
    """Return the summary of torques: the joints, the instants, joints at rest, and the state at the ends."""
    rates, instants = dataset.sizes["derivative"] - 1, dataset["time"].values
    note = f", with {count(rates, 'rate')}" if rates else ""
    between = " and the peaks between them" if len(instants) <= INSTANTS else ""
    lines = [
        f"{dataset.attrs['title']}: torques of {count(len(dataset.data_vars), 'moving joint')}{note} "
        f"({robot.name}, {trajectory.name})",
        f"t = {interval_text(instants[0], instants[-1])}, {count(len(instants), 'instant')}{between}",
    ]
    lines.append(f"torques: {dataset.attrs['drives']}")
    lines += filter(None, [last_step_words(instants)])
    resting = [str(name) for name in dataset.data_vars if name not in motion.names]
    if resting:
        lines.append(f"not in the trajectory, held still: {', '.join(resting)}")
    lines += [*between_words(motion), *ends_words(ends)]
    return "\n".join(wrapped(line) for line in lines)


def robot_motion_summary(motion: RobotSimulation, file: Path) -> str:
    """Return the summary of the motion of a robot: instants, and change of energy."""
    first, *lines = robot_motion_words(motion)
    return "\n".join(wrapped(line) for line in (f"{first} ({file.name})", *lines))


def robot_motion_words(motion: RobotSimulation) -> list[str]:
    """Return the lines of the summary of the motion of a robot, the first one a title."""
    times, energy, steps = motion.time, motion.energy, count(len(motion.steps.start), "step")
    return [
        f"{motion.robot.name}: motion of {count(len(motion.robot.joint_names), 'moving joint')}",
        f"t = {interval_text(times[0], times[-1])}, {count(len(times), 'instant')}, {steps}",
        f"energy: {energy[0]:.9g} J at the start, {energy[-1]:.9g} J at the stop",
    ]


def verdict(report: LimitReport) -> str:
    """Return the verdict on limits, with the quantity nearest to its limit or with the largest excess."""
    number, worst = len(report.limited), report.worst
    assert worst is not None
    size = "infinite by a jump" if worst.infinite else f"{worst.ratio:.4g} of its limit"
    location = f"{worst.joint} {worst.quantity}, {size} at t = {time_text(worst.time, 5)} s"
    ends = [] if report.hand_over else breaks_words(report.ends)
    if report.kept:
        return f"All limits kept ({number}).\nClosest: {location}"
    if report.broken:
        head = f"{len(report.broken)} of {count(number, 'limit')} broken.\nWorst: {location}"
        return "\n".join([head, *map(wrapped, ends)])
    lines = [f"Limits broken at the ends, not within the motion ({number}). Closest there: {location}", *ends]
    hint = "If the robot moves before the start and after the stop, say so with --hand-over."
    return "\n".join([*map(wrapped, lines), hint])


def wrapped(line: str) -> str:
    """Return a line wrapped after commas and colons only."""
    import textwrap

    glued = re.sub("(?<![,:]) ", "\0", line)
    broken = textwrap.fill(glued, 80, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
    return broken.replace("\0", " ")


def count(number: int, noun: str, plural: str = "") -> str:
    """Return a number with its noun in the singular or plural."""
    return f"{number} {noun if number == 1 else plural or f'{noun}s'}"


def _train_words(facts: list[dict[str, Any]]) -> list[str]:
    """Return the speed ratios of gears in words, one line for each driver."""
    by_driver: dict[str, list[str]] = {}
    for fact in facts:
        fraction = f" = {fact['fraction']}" if "/" in (fact["fraction"] or "") else ""
        by_driver.setdefault(fact["driver"], []).append(f"{fact['body']} {fact['ratio']:.9g}{fraction}")
    return [f"turns for a turn of {driver}: {', '.join(fraction)}" for driver, fraction in by_driver.items()]


def efficiency_words(facts: list[dict[str, Any]]) -> list[str]:
    """Return the efficiencies of gears with friction in words, one line for each.

    Examples
    --------
    >>> efficiency_words([{"joint": "mesh", "bodies": ["worm", "wheel"], "forward": 0.42, "backward": -0.35}])
    ['mesh: efficiency 0.42 from worm to wheel; locks itself: wheel does not drive worm']
    """
    lines_shown = []
    for fact in facts:
        first, second = fact["bodies"]
        backward = f", {fact['backward']:.4g} from {second} to {first}"
        backward = backward if fact["backward"] > 0 else f"; locks itself: {second} does not drive {first}"
        lines_shown.append(f"{fact['joint']}: efficiency {fact['forward']:.4g} from {first} to {second}{backward}")
    return lines_shown


def screw_words(facts: list[dict[str, Any]]) -> list[str]:
    """Return screws with friction in words, one line for each.

    Examples
    --------
    >>> thread = {"joint": "thread", "lead_angle": 0.05, "efficiency": 0.4, "back_efficiency": 0.0}
    >>> screw_words([thread | {"self_locking": True}])
    ['thread: lead angle 2.865 deg, efficiency 40 % from turning to advance, locks by itself']
    """
    lines = []
    for fact in facts:
        forward, back = (f"{100 * fact[key]:.3g} %" for key in ("efficiency", "back_efficiency"))
        backward = "locks by itself" if fact["self_locking"] else f"{back} from advance to turning"
        phrase = f"{fact['joint']}: lead angle {math.degrees(fact['lead_angle']):.4g} deg"
        lines.append(f"{phrase}, efficiency {forward} from turning to advance, {backward}")
    return lines


def line_words(facts: list[dict[str, Any]]) -> list[str]:
    """Return belts and ropes in words, one line for each.

    Examples
    --------
    >>> line_words([{"joint": "rope", "length": 1.2, "wraps": None, "spans": [0.5, 0.2, 0.5]}])
    ['rope: 1.2 m long, of spans of 0.5, 0.2, 0.5 m']
    """
    lines_shown = []
    for fact in facts:
        phrase = f"{fact['joint']}: {fact['length']:.6g} m long"
        if fact["spans"] is not None:
            lines_shown.append(f"{phrase}, of spans of {', '.join(f'{span:.6g}' for span in fact['spans'])} m")
            continue
        lies = zip(fact["wraps"], fact["bodies"], strict=True)
        phrase += f", on {' and '.join(f'{math.degrees(wrap):.4g} deg of {body}' for wrap, body in lies)}"
        parts = "the length of the belt changes as the centers move apart: a tensioner takes it up"
        lines_shown.append(
            f"{phrase}; {parts}" if fact["carrier"] is None else f"{phrase}, both carried by {fact['carrier']}"
        )
    return lines_shown
