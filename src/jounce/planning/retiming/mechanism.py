"""Time-optimal motion of a driven mechanism along the path of its drivers, within limits of force and yank."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from jounce.dynamics.limits.limit_report import LimitReport, LimitRow
from jounce.errors import MechanismError, SolveError, TrajectoryError
from jounce.mechanism import Mechanism
from jounce.planning.paths.paths import checked
from jounce.planning.retiming.fastest import fastest
from jounce.planning.retiming.quantities.mechanism_quantities import MechanismQuantities, rate_motion
from jounce.planning.retiming.rates.rate_law import Conditions, RateLaw
from jounce.planning.retiming.retimed import RetimedTrajectory, active_limits
from jounce.robot.model.links_and_joints import Limits
from jounce.trajectory import FollowingMotion

EXPANSIONS = 4  # expansions of forces about the last law
STEADY = 3e-4  # fraction of the duration: a smaller change ends the expansions
INSTANTS = 1501
AROUND, SPREAD = 33, 2  # instants about the worst instant of each quantity, and their reach in steps to each side
SLOWINGS = 8
SHORTER = 1e-9  # fraction of a duration


def retime_mechanism(
    mechanism: Mechanism,
    limits: Mapping[str, Limits],
    rates: tuple[float, float],
    order: int | None,
    cells: int,
    duration: float | None = None,
) -> RetimedTrajectory:
    """Return the fastest motion of the drivers of a mechanism along the path of their laws; see `retime`."""
    source = MechanismQuantities(mechanism, limits)
    all_limits = source.limits.values()
    min_order = 2 if any(x.jerk is not None or x.effort_rate is not None for x in all_limits) else 1
    if order is not None and order < min_order:
        message = f"these limits require derivatives that are continuous to order {min_order} or higher"
        raise MechanismError(message, name="order", value=order)
    conditions = Conditions(order or min_order, rates)
    checked(source.path, conditions.order)
    source.refer_to(None)
    law, search = fastest(source, source.labels, source.path.start, source.path.stop, conditions, cells)
    for _ in range(EXPANSIONS if source.loaded else 0):
        previous = law.duration
        source.refer_to(law)
        law, search = fastest(source, source.labels, source.path.start, source.path.stop, conditions, cells)
        if abs(law.duration - previous) < STEADY * previous:
            break
    if duration is not None and duration >= law.duration:
        law = search.lengthened(law, duration)
    note = ""
    for _ in range(SLOWINGS):
        laws, report = _checked(source, mechanism, law)
        excess = 0.0 if report.worst is None else (report.worst.ratio or 0.0) - 1
        if excess <= 1e-9:
            if duration is not None and duration < laws.stop * (1 - SHORTER):
                message = f"the least time of this path within these limits is {laws.stop:.9g} s, which is longer"
                raise TrajectoryError(message, name="duration", value=duration)
            return RetimedTrajectory(
                laws.laws,
                laws.stop,
                source.path,
                laws.progress,
                report,
                active_limits(search, law, rate_motion(law)),
            )
        if report.worst is not None:
            note = f" of the {report.worst.quantity} of {report.worst.joint} by {excess:.2g} of it"
        if any(rates):
            break
        law = law.slowed(1 + 2 * excess + 1e-7)
    message = f"the law found breaks the limit{note}; try more cells, or smaller rates at the ends"
    raise SolveError(message, name="cells", value=cells)


@dataclasses.dataclass(frozen=True)
class _MechanismLaws:
    laws: Any
    stop: float
    progress: Any


def _checked(source: MechanismQuantities, mechanism: Mechanism, law: RateLaw) -> tuple[_MechanismLaws, LimitReport]:
    """Return the motion of a law, and its comparison with the limits from a solution of the mechanism."""
    motion = rate_motion(law)
    progress = FollowingMotion(law.parameter, motion)
    laws = _MechanismLaws(
        {name: FollowingMotion(path_law, progress) for name, path_law in source.laws.items()}, motion.duration, progress
    )
    times = np.linspace(0.0, motion.duration, INSTANTS)
    _, _, ratios = source.ratios_of(progress, times)
    step = times[1]
    peak_times = times[np.argmax(ratios, axis=0)]
    nearby = (peak_times[:, None] + step * SPREAD * np.linspace(-1, 1, AROUND)).reshape(-1)
    times = np.unique(np.clip(np.concatenate([times, nearby]), 0.0, motion.duration))
    times = times[np.append(True, np.diff(times) > 1e-9 * motion.duration)]
    values, bounds, ratios = source.ratios_of(progress, times)
    peaks = np.argmax(ratios, axis=0)
    rows = tuple(
        LimitRow(
            label.owner,
            label.word,
            label.unit,
            float(values[i, k]),
            float(times[i]),
            float(np.copysign(bounds[i, k], values[i, k])),
            float(ratios[i, k]),
        )
        for k, (label, i) in enumerate(zip(source.labels.every, peaks.tolist(), strict=True))
        if np.isfinite(bounds[i, k])
    )
    names = tuple(dict.fromkeys(label.owner for label in source.labels.every))
    nothing = np.zeros((len(times), 6, 0))
    report = LimitReport(mechanism.title or "mechanism", names, rows, {}, times, nothing, nothing)
    return laws, report
