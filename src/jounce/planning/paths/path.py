"""The positions of joints along a path."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.trajectory import AbstractMotion
from jounce.trajectory.laws.stacking import law_derivatives


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
        How far the path is from what it was made of, at most, rad or m: from the straight lines between samples or
        waypoints, or from the trajectory or the laws that were given.
    allowed : float, optional
        How far it may be, where that was bounded.
    words : str, optional
        What it is, for messages.
    instants : tuple of arrays, optional
        Values of s, and the instants of the samples there, s.
    passed : tuple of arrays, optional
        Values of s, and the instants of the trajectory, or what else its points count, there.
    points : Lines, optional
        The waypoints that it goes through.
    joined : float, optional
        The s at which it comes onto the path that was given, from the state of a running robot.
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
        """Say where on the path a value of s is, by the time of the samples too where it was made of some."""
        note = "" if self.instants is None else f" (t = {np.interp(s, *self.instants):.6g} s of the samples)"
        return f"s = {s:.6g}{note}"

    def derivatives(self, s: Float[np.ndarray, " point"], order: int) -> Float[np.ndarray, "point derivative joint"]:
        """Return positions and derivatives by s."""
        return np.moveaxis(law_derivatives(list(self.laws.values()), s, order), -1, 0)
