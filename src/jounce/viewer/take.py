"""What the view shows of one motion, in arrays: poses of all bodies at all instants, quantities over time, forces."""

from __future__ import annotations

import abc
import dataclasses
from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np

__all__ = ["Exertion", "Parameter", "Quantity", "Spot", "Take", "poses", "rotated", "spatial_vectors"]


@dataclasses.dataclass(frozen=True)
class Parameter:
    """A number that a slider of the page sets.

    Parameters
    ----------
    name : str
    value : float
        SI, as the file gives it.
    low, high : float
        Ends of the slider.
    group : str, default ""
        Heading under which it stands.
    derived : bool, default False
        It follows from others, by an expression, and is shown only.
    """

    name: str
    value: float
    low: float
    high: float
    group: str = ""
    derived: bool = False


@dataclasses.dataclass(frozen=True)
class Quantity:
    """A quantity over time with its derivatives, for plots.

    Parameters
    ----------
    unit : str
        Of derivative 0.
    values : array of shape (time, orders, components)
    words : tuple of str
        What each derivative is called.
    labels : tuple of str
        What each component is called, where there are several.
    """

    unit: str
    values: np.ndarray
    words: tuple[str, ...]
    labels: tuple[str, ...] = ("x", "y", "z")


@dataclasses.dataclass(frozen=True)
class Spot:
    """A point of a body.

    Parameters
    ----------
    body : str
    point : tuple of float
        In the frame of the body, m; two or three components.
    name : str
        What it is called on the page.
    """

    body: str
    point: tuple[float, ...]
    name: str


@dataclasses.dataclass(frozen=True)
class Exertion:
    """What a joint, a driver or an applied force does to a body, over time.

    Parameters
    ----------
    name : str
    kind : {"reaction", "driver", "applied"}
    place : array of shape (time, 3)
        Where it acts, m.
    force : array of shape (time, 3) or None
        N, global.
    torque : array of shape (time, 3) or None
        N m, global.
    """

    name: str
    kind: str
    place: np.ndarray
    force: np.ndarray | None
    torque: np.ndarray | None


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Take(abc.ABC):
    """One solved motion as the page shows it; everything in three components, planar ones with zero z.

    Parameters
    ----------
    title : str
    planar : bool
    time : array of shape (time,)
        s; only instants that were solved.
    order : int
        Highest derivative.
    bodies : tuple of str
        Names, ``ground`` or the base of a robot first.
    position : array of shape (time, bodies, 3)
        Origins of the bodies, m.
    quaternion : array of shape (time, bodies, 4)
        Their attitudes, scalar part first.
    values : mapping
        Values of the parameters that it was solved with.
    looks : object
        Shapes of the bodies, see `jounce.viewer.looks.Looks`.
    notice : str, default ""
        What is to be said of it: instants that could not be solved.
    """

    title: str
    planar: bool
    time: np.ndarray
    order: int
    bodies: tuple[str, ...]
    position: np.ndarray
    quaternion: np.ndarray
    values: Mapping[str, float]
    looks: Any
    notice: str = ""

    @abc.abstractmethod
    def quantities(self) -> Mapping[str, Quantity]:
        """Return what is plotted, by name."""

    @abc.abstractmethod
    def motion_of(self, body: str, point: Any) -> np.ndarray:
        """Return position and derivatives, (time, order + 1, 3), of a point of a body."""

    @abc.abstractmethod
    def exertions_of(self) -> list[Exertion]:
        """Return what joints, drivers and applied forces do to the bodies; empty where nothing has a mass."""

    @abc.abstractmethod
    def dataset(self) -> Any:
        """Return the xarray.Dataset that an export writes."""

    @cached_property
    def outputs(self) -> Mapping[str, Quantity]:
        """Quantities by name."""
        return self.quantities()

    @cached_property
    def exertions(self) -> list[Exertion]:
        """What joints, drivers and applied forces do to the bodies."""
        return self.exertions_of()

    @cached_property
    def _spots(self) -> dict[Spot, np.ndarray]:
        return {}

    def motion(self, spot: Spot) -> np.ndarray:
        """Return the position of a point and its derivatives, (time, order + 1, 3), m by s; computed once."""
        if spot not in self._spots:
            self._spots[spot] = self.motion_of(spot.body, spot.point)
        return self._spots[spot]

    def frame_at(self, instant: float) -> int:
        """Return the index of the instant nearest to a time."""
        after = int(np.clip(np.searchsorted(self.time, instant), 1, max(len(self.time) - 1, 1)))
        if len(self.time) == 1:
            return 0
        return after - 1 if instant - self.time[after - 1] <= self.time[after] - instant else after

    def placed(self, body: str, point: Any) -> np.ndarray:
        """Return where a point of a body is at all instants, (time, 3), m."""
        index = self.bodies.index(body)
        local = spatial_vectors(np.asarray(point, float))
        return self.position[:, index] + rotated(self.quaternion[:, index], local)

    @cached_property
    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners of the box that holds all that moves, at all instants, m."""
        points = [self.position.reshape(-1, 3)]
        for name, extent in self.looks.extents().items():
            points += [self.placed(name, point) for point in extent]
        every = np.concatenate(points)
        return every.min(axis=0), every.max(axis=0)

    @cached_property
    def size(self) -> float:
        """Diagonal of the box, m; 1 where it is a point."""
        low, high = self.box
        return float(np.linalg.norm(high - low)) or 1.0


def poses(motion: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return origins, (time, bodies, 3), and quaternions, (time, bodies, 4), of all bodies, the ground first."""
    _, coordinates = motion.poses
    position = spatial_vectors(np.moveaxis(np.asarray(coordinates["position"][0]), (2, 1, 0), (0, 1, 2)))
    if "angle" in coordinates:
        half = 0.5 * np.asarray(coordinates["angle"][0]).T
        zero = np.zeros_like(half)
        quaternion = np.stack([np.cos(half), zero, zero, np.sin(half)], axis=-1)
    else:
        quaternion = np.moveaxis(np.asarray(coordinates["quaternion"][0]), (2, 1, 0), (0, 1, 2))
    bodies = max(position.shape[1], quaternion.shape[1])
    shape = (len(motion.time), bodies)
    return np.broadcast_to(position, (*shape, 3)), np.broadcast_to(quaternion, (*shape, 4))


def rotated(quaternion: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Turn vectors by quaternions, scalar part first; shapes (..., 4) and (..., 3).

    Examples
    --------
    >>> import numpy as np
    >>> rotated(np.array([0.5, 0.5, 0.5, 0.5]), np.array([1.0, 0.0, 0.0])).tolist()
    [0.0, 1.0, 0.0]
    """
    scalar, axis = quaternion[..., :1], quaternion[..., 1:]
    axis, vector = np.broadcast_arrays(axis, vector)
    once = np.cross(axis, vector)
    return vector + 2 * (scalar * once + np.cross(axis, once))


def spatial_vectors(values: np.ndarray) -> np.ndarray:
    """Return vectors, components last, with a third component, zero where there are only two."""
    missing = 3 - values.shape[-1]
    return np.concatenate([values, np.zeros((*values.shape[:-1], missing))], axis=-1) if missing else values
