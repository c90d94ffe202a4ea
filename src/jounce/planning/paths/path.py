"""The positions of joints along a path."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.trajectory import AbstractMotion
from jounce.trajectory.laws.stacking import law_derivatives
from jounce.units.instants import time_text


@dataclasses.dataclass(frozen=True, eq=False)
class Path:
    """The positions of joints along a path, over a parameter s that runs from `start` to `stop`.

    Parameters
    ----------
    laws : dict of str to AbstractMotion
        Position of each joint over s, rad or m.
    start, stop : float
        Ends of s.
    deviation : float, default 0
        Largest distance of the path from its source, rad or m: from the straight lines between samples or waypoints, or
        from the given trajectory or laws.
    allowed : float, optional
        Bound of the deviation, if one was given.
    words : str, optional
        Description of the path, for messages.
    instants : tuple of arrays, optional
        Values of s, and the instants of the samples at these values, s.
    passed : tuple of arrays, optional
        Values of s, and the instants of the trajectory, or other parameter of its points, at these values.
    points : Lines, optional
        Waypoints of the path.
    joined : float, optional
        Value of s at which the path joins the given path, from the state of a running robot.
    """

    laws: Mapping[str, AbstractMotion]
    start: float
    stop: float
    deviation: float = 0.0
    allowed: float | None = None
    words: str = ""
    instants: tuple[Float[np.ndarray, " place"], Float[np.ndarray, " place"]] | None = None
    passed: tuple[Float[np.ndarray, " place"], Float[np.ndarray, " place"]] | None = None
    points: Any = None
    joined: float | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(self.laws)

    def location(self, s: float) -> str:
        """Return a description of a place on the path for messages, with the time of the samples if it has any."""
        note = "" if self.instants is None else f" (t = {time_text(np.interp(s, *self.instants))} s of the samples)"
        return f"s = {s:.6g}{note}"

    def derivatives(self, s: Float[np.ndarray, " point"], order: int) -> Float[np.ndarray, "point derivative joint"]:
        """Return positions and derivatives by s."""
        return np.moveaxis(law_derivatives(list(self.laws.values()), s, order), -1, 0)
