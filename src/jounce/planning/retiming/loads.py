"""Loads that are taken up and set down along a path: positions on the path, and instants."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from jounce.errors import TrajectoryError
from jounce.planning.paths.path import Path
from jounce.planning.paths.trajectory_paths import stopping
from jounce.robot.algorithms.carried_loads import CarriedLoad
from jounce.trajectory import FollowingMotion
from jounce.trajectory.laws.stacking import law_derivatives

SAME = 1e-12  # fraction of a path: changes nearer to each other, or to an end, coincide
RESTS = 1e-9  # fraction of the largest speed along a path: a slower path already rests
LOOKS = 65  # instants of each refinement of a search


def along_path(loads: Sequence[CarriedLoad], path: Path, *, timed: bool = False) -> tuple[CarriedLoad, ...]:
    """Return loads with their places given by the parameter of a path.

    Parameters
    ----------
    loads : sequence of CarriedLoad
        Loads by time of a trajectory, parameter, share of the path, or waypoint.
    path : Path
        The path.
    timed : bool, default False
        Whether the parameter of the path is time.

    Raises
    ------
    TrajectoryError
        If a place is not on the path, or the path does not have the unit of the place.
    """
    return tuple(_along(load, path, timed) for load in loads)


def with_stops(path: Path, loads: Sequence[CarriedLoad], order: int) -> tuple[Path, tuple[CarriedLoad, ...]]:
    """Return a path that stops where loads change at rest, and the loads by its parameter.

    Parameters
    ----------
    path : Path
        The path.
    loads : sequence of CarriedLoad
        Loads by the parameter of `path`.
    order : int
        Order to which derivatives of the motion are continuous.
    """
    tolerance = SAME * (path.stop - path.start)
    edges = np.unique([x for load in loads if not load.moving for x in (load.start, load.stop) if x is not None])
    edges = edges[(edges > path.start + tolerance) & (edges < path.stop - tolerance)] if len(edges) else edges
    edges = edges[np.diff(edges, prepend=-np.inf) > tolerance]
    if len(edges):
        speeds = np.abs(path.derivatives(np.append(edges, np.linspace(path.start, path.stop, LOOKS)), 1)[:, 1]).max(1)
        edges = edges[speeds[: len(edges)] > RESTS * speeds.max()]
    if not len(edges):
        return path, tuple(loads)
    stopping_path, parameter = stopping(path, edges, order)

    def with_parameters(load: CarriedLoad) -> CarriedLoad:
        ends = [end for end in ("start", "stop") if getattr(load, end) is not None]
        parameters = parameter(np.array([getattr(load, end) for end in ends], float)).tolist()
        return dataclasses.replace(load, **dict(zip(ends, parameters, strict=True)))

    return stopping_path, tuple(with_parameters(load) for load in loads)


def _along(load: object, path: Path, timed: bool) -> CarriedLoad:
    if not isinstance(load, CarriedLoad):
        raise TrajectoryError("must be CarriedLoads", name="loads", value=type(load).__name__)
    ends = {end: _place(x, load, path, timed) for end in ("start", "stop") if (x := getattr(load, end)) is not None}
    return dataclasses.replace(load, **ends, by="s")


def _place(value: float, load: CarriedLoad, path: Path, timed: bool) -> float:
    """Return the parameter of a path at a place in the unit of a load."""
    name, unit = f"loads.{load.link}", load.by
    instants = (np.array([path.start, path.stop]),) * 2 if timed else path.passed
    if unit == "waypoint" and path.points is None:
        raise TrajectoryError("the path has no waypoints; give by='time', 's' or 'share'", name=name, value=unit)
    if unit == "time" and (instants is None or path.points is not None):
        message = "the path says nothing of time; give by='s', 'share' or, of waypoints, 'waypoint'"
        raise TrajectoryError(message, name=name, value=unit)
    if unit == "s":
        low, high, s = path.start, path.stop, value
    elif unit == "share":
        low, high, s = 0.0, 1.0, path.start + value * (path.stop - path.start)
    else:
        assert instants is not None
        table: np.ndarray = path.points.at if unit == "waypoint" else instants[1]  # type: ignore[union-attr]
        low, high = (1, len(table)) if unit == "waypoint" else (float(table[0]), float(table[-1]))
        instant = table[int(np.clip(value, low, high)) - 1] if unit == "waypoint" else value
        s = float(np.interp(instant, instants[1], instants[0]))
    if not low <= value <= high:
        noun = {"waypoint": "waypoints", "time": "instants", "s": "s", "share": "shares of the path"}[unit]
        raise TrajectoryError(f"is not on the path, whose {noun} go from {low:g} to {high:g}", name=name, value=value)
    return float(s)


def instant_at(progress: FollowingMotion, duration: float, s: float) -> float:
    """Return the instant at which the parameter of a path reaches a value, s."""
    low, high = 0.0, duration
    while True:
        looks = np.linspace(low, high, LOOKS)
        index = int(np.searchsorted(law_derivatives([progress], looks, 0)[0, 0], s))
        bracket = float(looks[max(index - 1, 0)]), float(looks[min(index, LOOKS - 1)])
        if bracket == (low, high) or bracket[1] - bracket[0] <= np.spacing(duration):
            return bracket[1]
        low, high = bracket


def in_time(loads: Sequence[CarriedLoad], progress: FollowingMotion, duration: float) -> tuple[CarriedLoad, ...]:
    """Return loads by time, from loads by the parameter of a path and its progress over time."""

    def instant(s: float) -> float:
        return instant_at(progress, duration, s)

    return tuple(
        dataclasses.replace(
            load, **{end: instant(x) for end in ("start", "stop") if (x := getattr(load, end)) is not None}, by="time"
        )
        for load in loads
    )
