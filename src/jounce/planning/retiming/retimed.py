"""Retimed trajectories, and their active limits along the path."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jounce.dynamics.limits.limit_report import LimitReport
from jounce.planning.paths.path import Path
from jounce.planning.retiming.rates.rate_law import RateLaw
from jounce.planning.retiming.rates.rate_motion import RateMotion
from jounce.planning.retiming.search import Search
from jounce.robot.algorithms.carried_loads import CarriedLoad
from jounce.trajectory import AbstractMotion, FollowingMotion, JointTrajectory

BINDS = 1e-2  # fraction of a limit: with a smaller margin, the limit binds


class RetimedTrajectory(JointTrajectory):
    """A trajectory along a path, from 0 s, with a record of its limits. Returned by `retime`.

    Parameters
    ----------
    laws : dict of str to AbstractMotion
        The law of each joint.
    stop : float
        Duration, s.
    path : Path
        The path of the trajectory.
    progress : FollowingMotion
        The parameter s of the path over time.
    report : LimitReport
        Comparison of the trajectory with its limits, as by `check_limits`.
    active : xarray.Dataset
        Over ``s`` and ``limit`` (such as "panda_joint1 torque rate"): ``share``, the used fraction of the limit;
        ``binds``, whether less than a hundredth of the limit is left; ``price``, s, the decrease of the duration per
        relative increase of the limit at the point, the sum over points being that for the whole path. Over ``s``:
        ``time``.
    loads : tuple of CarriedLoad
        Loads of links during parts of the motion, by time.
    """

    def __init__(
        self,
        laws: Mapping[str, AbstractMotion],
        stop: float,
        path: Path,
        progress: FollowingMotion,
        report: LimitReport,
        active: Any,
        loads: Sequence[CarriedLoad] = (),
    ):
        super().__init__(laws, 0.0, stop, np.linspace(0.0, stop, 201))
        self.path, self.progress, self.report, self.active, self.loads = path, progress, report, active, tuple(loads)

    def slower(self, factor: float) -> "RetimedTrajectory":
        """Return the motion slowed by a factor, with the report of this one."""
        parameter, motion = self.progress.parts
        assert isinstance(motion, RateMotion)
        slow = motion.slower(factor)
        progress = FollowingMotion(parameter, slow)
        laws = {name: FollowingMotion(law, progress) for name, law in self.path.laws.items()}
        loads = [
            dataclasses.replace(load, **{end: x * factor for end in ("start", "stop") if (x := getattr(load, end))})
            for load in self.loads
        ]
        return RetimedTrajectory(laws, slow.duration, self.path, progress, self.report, self.active, loads)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (dict(self.laws), self.stop, self.path, self.progress, self.report, self.active, self.loads)

    def __repr__(self) -> str:
        return f"RetimedTrajectory({', '.join(self.names)}; {self.stop:g} s)"


def active_limits(search: Search, law: RateLaw, motion: RateMotion) -> Any:
    """Return the labeled dataset of active limits along the path and their prices."""
    import xarray

    shares = search.curves.ratios(law.at(search.points))
    u, s = search.points, search.shape[0]
    knots = np.interp(u, motion.begins, motion.instants)  # accurate enough for the time of a point in a figure
    names = [f"{label.owner} {label.word}" for label in search.labels.every]
    variables = {
        "share": (("s", "limit"), shares),
        "binds": (("s", "limit"), shares > 1 - BINDS),
        "price": (("s", "limit"), search.prices, {"units": "s"}),
        "time": (("s",), knots, {"units": "s"}),
        "unit": (("limit",), [label.unit for label in search.labels.every]),
    }
    limited = np.flatnonzero((shares > 0).any(axis=0))
    return xarray.Dataset(variables, coords={"s": s, "limit": names}).isel(limit=limited)
