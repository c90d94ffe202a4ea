"""A solved motion prepared for display: poses of all bodies at all instants, quantities over time, loads."""

from __future__ import annotations

import abc
import dataclasses
from collections.abc import Mapping
from functools import cached_property

import numpy as np
from jaxtyping import Float
from xarray import Dataset

from jounce.kinematics import Motion
from jounce.mechanism.time import nearest_instants
from jounce.units.shown_units import raised
from jounce.viewer.shapes.appearance import Appearance, BodyPoint, Position

Vectors = Float[np.ndarray, "time 3"]
Positions = Float[np.ndarray, "time body 3"]
Quaternions = Float[np.ndarray, "time body 4"]


@dataclasses.dataclass(frozen=True)
class Parameter:
    """A parameter with a slider on the page.

    Parameters
    ----------
    name : str
    value : float
        Value in the file, SI.
    low, high : float
        Ends of the slider.
    group : str, default ""
        Heading of its group.
    derived : bool, default False
        Whether it follows from others by an expression, and is only shown.
    unit : str, default ""
        SI unit, if known.
    whole : bool, default False
        Whether it is a whole number.
    """

    name: str
    value: float
    low: float
    high: float
    group: str = ""
    derived: bool = False
    unit: str = ""
    whole: bool = False

    @property
    def label(self) -> str:
        """Name with the unit, as shown at the slider."""
        return f"{self.name} ({raised(self.unit)})" if self.unit else self.name


@dataclasses.dataclass(frozen=True)
class Quantity:
    """A quantity over time with its derivatives, for plots.

    Parameters
    ----------
    unit : str
        Unit of derivative 0.
    values : numpy.ndarray of shape (time, order, component)
    words : tuple of str
        Name of each derivative.
    labels : tuple of str
        Name of each component, if there are several.
    """

    unit: str
    values: Float[np.ndarray, "time order component"]
    words: tuple[str, ...]
    labels: tuple[str, ...] = ("x", "y", "z")


@dataclasses.dataclass(frozen=True)
class Load:
    """The force and torque of a joint, a driver or an applied force on a body, over time.

    Parameters
    ----------
    name : str
    kind : {"reaction", "driver", "applied"}
    point : numpy.ndarray of shape (time, 3)
        Point of application, m.
    force : numpy.ndarray of shape (time, 3) or None
        Force, N, in the global frame.
    torque : numpy.ndarray of shape (time, 3) or None
        Torque, N m, in the global frame.
    """

    name: str
    kind: str
    point: Vectors
    force: Vectors | None = None
    torque: Vectors | None = None


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Recording(abc.ABC):
    """A solved motion for the page, in three components, with zero z for planar mechanisms.

    Parameters
    ----------
    title : str
    planar : bool
    time : numpy.ndarray of shape (time,)
        Solved instants, s.
    order : int
        Highest derivative.
    bodies : tuple of str
        Names of the bodies, ``ground`` or the base of a robot first.
    position : numpy.ndarray of shape (time, body, 3)
        Origins of the bodies, m.
    quaternion : numpy.ndarray of shape (time, body, 4)
        Attitudes of the bodies, scalar part first.
    values : mapping
        Values of the parameters of the solution.
    appearance : Appearance
        Shapes of the bodies.
    notice : str, default ""
        Remark on unsolved instants.
    """

    title: str
    planar: bool
    time: Float[np.ndarray, " time"]
    order: int
    bodies: tuple[str, ...]
    position: Positions
    quaternion: Quaternions
    values: Mapping[str, float]
    appearance: Appearance
    notice: str = ""

    @abc.abstractmethod
    def quantities(self) -> Mapping[str, Quantity]:
        """Return the plotted quantities by name."""

    @abc.abstractmethod
    def derivatives(self, body: str, point: Position) -> Float[np.ndarray, "time derivative 3"]:
        """Return the position and derivatives of a point of a body."""

    @abc.abstractmethod
    def all_loads(self) -> list[Load]:
        """Return the loads of joints, drivers and applied forces on the bodies; empty without masses."""

    @abc.abstractmethod
    def dataset(self) -> Dataset:
        """Return the dataset of an export."""

    @cached_property
    def outputs(self) -> Mapping[str, Quantity]:
        """Plotted quantities by name, computed once."""
        return self.quantities()

    @cached_property
    def loads(self) -> list[Load]:
        """Loads of joints, drivers and applied forces on the bodies, computed once."""
        return self.all_loads()

    @cached_property
    def _motions(self) -> dict[BodyPoint, np.ndarray]:
        return {}

    def motion(self, point: BodyPoint) -> Float[np.ndarray, "time derivative 3"]:
        """Return the position of a point and its derivatives, m by s, computed once."""
        if point not in self._motions:
            self._motions[point] = self.derivatives(point.body, point.point)
        return self._motions[point]

    def frame_at(self, instant: float) -> int:
        """Return the index of the instant nearest to a time."""
        return int(nearest_instants(self.time, np.array([instant]))[0])

    def global_point(self, body: str, point: Position) -> Vectors:
        """Return the global position of a point of a body at all instants, m."""
        index = self.bodies.index(body)
        return self.position[:, index] + rotated(self.quaternion[:, index], spatial_vectors(np.asarray(point, float)))

    @cached_property
    def box(self) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
        """Corners of the bounding box of all moving parts over all instants, m."""
        corners = [self.global_point(body, corner) for body, box in self.appearance.corners().items() for corner in box]
        all_points = np.concatenate([self.position.reshape(-1, 3), *corners])
        return all_points.min(axis=0), all_points.max(axis=0)

    @cached_property
    def size(self) -> float:
        """Diagonal of the bounding box, m; 1 if it is a point."""
        low, high = self.box
        return float(np.linalg.norm(high - low)) or 1.0

    def first_moving_point(self) -> BodyPoint:
        """Return the first point that moves by more than rounding, or the first of all if none does."""
        points, bound = self.appearance.points, 1e-9 * self.size
        return next((point for point in points if np.ptp(self.motion(point)[:, 0], axis=0).max() > bound), points[0])


def poses(motion: Motion) -> tuple[Positions, Quaternions]:
    """Return the origins and quaternions of all bodies, the ground first."""
    _, coordinates = motion.poses
    values = {name: np.asarray(derivatives[0]).T for name, derivatives in coordinates.items()}  # time, body, component
    position = spatial_vectors(values["position"])
    if "angle" in values:
        half = 0.5 * values["angle"]
        zero = np.zeros_like(half)
        quaternion = np.stack([np.cos(half), zero, zero, np.sin(half)], axis=-1)
    else:
        quaternion = values["quaternion"]
    shape = (len(motion.time), max(position.shape[1], quaternion.shape[1]))
    return np.broadcast_to(position, (*shape, 3)), np.broadcast_to(quaternion, (*shape, 4))


def rotated(
    quaternion: Float[np.ndarray, "*batch 4"], vector: Float[np.ndarray, "*local 3"]
) -> Float[np.ndarray, "*batch 3"]:
    """Return vectors rotated by quaternions, scalar part first.

    Examples
    --------
    >>> import numpy as np
    >>> rotated(np.array([0.5, 0.5, 0.5, 0.5]), np.array([1.0, 0.0, 0.0])).tolist()
    [0.0, 1.0, 0.0]
    """
    scalar, axis = quaternion[..., :1], quaternion[..., 1:]
    axis, vector = np.broadcast_arrays(axis, vector)
    product = np.cross(axis, vector)
    return vector + 2 * (scalar * product + np.cross(axis, product))


def spatial_vectors(values: Float[np.ndarray, "*batch components"]) -> Float[np.ndarray, "*batch 3"]:
    """Return vectors, components last, with a zero third component added to those with two."""
    missing = 3 - values.shape[-1]
    return np.concatenate([values, np.zeros((*values.shape[:-1], missing))], axis=-1) if missing else values
