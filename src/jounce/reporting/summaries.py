"""What the command says about a motion, and about a trajectory and the limits of a robot."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jounce.dynamics.limits import LimitReport
    from jounce.integrate import Simulation
    from jounce.kinematics import Motion
    from jounce.trajectory import JointTrajectory

__all__ = ["count", "limits_summary", "simulation_summary", "summary", "verdict"]


def summary(motion: Motion, file: Path) -> str:
    """Word what was solved: bodies, degrees of freedom, instants."""
    import numpy as np

    from jounce.mechanism import build

    mechanism, time_ = motion.mechanism, motion.time
    rows = build(mechanism).rows
    drives = sum(name.startswith("drivers.") for name in rows)
    bodies = count(len(mechanism.bodies), "moving body", "moving bodies")
    joints = f"{count(len(mechanism.joints), 'joint')} ({count(len(rows) - drives, 'equation')})"
    freedom = count(drives, "degree of freedom", "degrees of freedom")
    driven = f", driven by {', '.join(mechanism.drivers)}" if mechanism.drivers else ""
    solved = int(np.sum(motion.status == 0))
    instants = count(len(time_), "instant") if solved == len(time_) else f"{solved} of {len(time_)} instants"
    span = f"t = {time_[0]:g} s" if len(time_) == 1 else f"from t = {time_[0]:g} s to {time_[-1]:g} s"
    lines = [
        mechanism.title or file.name,
        f"{mechanism.space}: {bodies} ({len(rows)} coordinates), {joints}",
        f"{freedom}{driven}",
        f"{instants} {span}, derivatives to order {motion.order}",
    ]
    if motion.change_points.size:
        passed = ", ".join(f"{t:g} s" for t in motion.change_points[:6])
        more = ", ..." if motion.change_points.size > 6 else ""
        lines.append(f"passes a change point, where another motion could branch off, at t = {passed}{more}")
    return "\n".join(lines)


def simulation_summary(motion: Simulation, file: Path) -> str:
    """Word what was simulated: mobility, instants, steps, and how well energy and constraints were kept."""
    import numpy as np

    from jounce.kinematics import Status

    mechanism, time_ = motion.mechanism, motion.time
    bodies = count(len(mechanism.bodies), "moving body", "moving bodies")
    joints, forces = count(len(mechanism.joints), "joint"), count(len(mechanism.forces), "force")
    reached = motion.status == Status.OK
    instants = count(len(time_), "instant") if reached.all() else f"{int(reached.sum())} of {len(time_)} instants"
    lines = [
        mechanism.title or file.name,
        f"{mechanism.space}: {bodies}, {joints}, {forces}",
        motion.mobility,
        f"{instants} from t = {time_[0]:g} s to {time_[-1]:g} s in {count(motion.steps, 'step')}, "
        f"derivatives to order {motion.order}",
    ]
    if reached.any():
        energy = motion.energy[reached]
        change, size = float(np.max(np.abs(energy - energy[0]))), float(np.max(motion.kinetic_energy[reached]))
        share = f", {change / size:.1e} of the largest kinetic energy" if size else ""
        lines.append(f"energy: {energy[0]:.9g} J at the start; it changes by {change:.2g} J{share}")
        if mechanism.drivers or mechanism.forces:
            lines.append("(drivers, actuators and dampers change it)")
        if motion.kinks:
            names = ", ".join(dict.fromkeys(name for _, name in motion.kinks))
            number = count(len(motion.kinks), "kink or jump", "kinks or jumps")
            lines.append(f"{number}: {names}, the first at t = {motion.kinks[0][0]:.6g} s; no derivatives there")
        lines.append(f"constraint drift: {np.max(motion.drift[reached]):.1e} (rad, or sizes of the mechanism)")
    return "\n".join(_wrapped(line) for line in lines)


def limits_summary(report: LimitReport, motion: JointTrajectory, robot: Path, trajectory: Path) -> str:
    """Word what was compared, which joints stand still, and what has no limits."""
    moved = count(len(motion.names), "moving joint")
    lines = [
        f"{report.robot}: {moved} ({robot.name}, {trajectory.name})",
        f"t = {motion.start:g} s to {motion.stop:g} s, {len(report.times)} instants and the peaks between them",
    ]
    if report.held:
        units = {row.joint: "m" if row.unit == "N" else "rad" for row in report.rows if row.unit in ("N", "N m")}
        held = [f"{name} at {value:.6g} {units[name]}" for name, value in report.held.items()]
        lines.append(f"not in the trajectory, held still: {', '.join(held)}")
    free: dict[str, list[str]] = {}
    for row in report.rows:
        if row.ratio is None:
            free.setdefault(row.quantity, []).append(row.joint)
    if free:
        limited = {row.quantity for row in report.limited}
        told = [f"{word} of {', '.join(names)}" if word in limited else word for word, names in free.items()]
        lines.append(f"without a limit: {', '.join(told)}")
    return "\n".join(_wrapped(line) for line in lines)


def verdict(report: LimitReport) -> str:
    """Word whether the limits are kept, and the place that is nearest to breaking one or breaks one most."""
    number, worst = len(report.limited), report.worst
    assert worst is not None
    place = f"{worst.joint} {worst.quantity}, {worst.ratio:.4g} of its limit at t = {worst.time:.5g} s"
    if report.kept:
        return f"All limits kept ({number}).\nClosest: {place}"
    return f"{len(report.broken)} of {count(number, 'limit')} broken.\nWorst: {place}"


def _wrapped(line: str) -> str:
    """Break a long line after commas and colons only."""
    import textwrap

    glued = re.sub("(?<![,:]) ", "\0", line)
    broken = textwrap.fill(glued, 80, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
    return broken.replace("\0", " ")


def count(number: int, noun: str, plural: str = "") -> str:
    """Word a number of things."""
    return f"{number} {noun if number == 1 else plural or f'{noun}s'}"
