"""Appearance of bodies on the page, as data: colored meshes, connectors between two points, and selectable points."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float
from trimesh import Trimesh

Color = tuple[int, int, int]
"""Red, green and blue, from 0 to 255."""

Position = Sequence[float | int] | Float[np.ndarray, " components"]
"""Two or three components, m."""

DARK, GRAY = (70, 74, 82), (150, 155, 163)  # of parts that belong to no body
# the light colors of Tol, suitable for the color-blind; arrows have strong colors
BODY_COLORS = (
    (119, 170, 221),
    (238, 136, 102),
    (68, 187, 153),
    (238, 221, 136),
    (187, 204, 51),
    (255, 170, 187),
    (153, 221, 255),
    (170, 170, 0),
)


@dataclasses.dataclass(frozen=True, eq=False)
class ColoredMesh:
    """A triangle mesh in the frame of a body, m, with a color and an opacity from 0 to 1."""

    mesh: Trimesh
    color: Color
    opacity: float = 1.0


@dataclasses.dataclass(frozen=True)
class BodyPoint:
    """A point of a body.

    Parameters
    ----------
    body : str
    point : tuple of float
        Position in the frame of the body, m; two or three components.
    name : str
        Name on the page.
    """

    body: str
    point: tuple[float, ...]
    name: str


@dataclasses.dataclass(frozen=True, eq=False)
class Connector:
    """A connection of points of two bodies: a rod, a spring, an actuator, or a span of a belt or a rope.

    Parameters
    ----------
    name : str
    kind : {"rod", "spring", "actuator", "line"}
    bodies : tuple of str
    points : tuple of numpy.ndarray
        A point on each body, in its frame, m.
    radius : float
        Radius, m.
    color : tuple of int
    ends : tuple of numpy.ndarray of shape (time, 3)
        Start and end in the ground frame, m, if they are not fixed to bodies.
    """

    name: str
    kind: str
    bodies: tuple[str, ...]
    points: tuple[Float[np.ndarray, " components"], ...]
    radius: float
    color: Color
    ends: tuple[Float[np.ndarray, "time 3"], ...] = ()


@dataclasses.dataclass(frozen=True, eq=False)
class Appearance:
    """Appearance of a mechanism or a robot.

    Parameters
    ----------
    meshes : mapping of str to sequence of ColoredMesh
        Meshes by body, in its frame.
    connectors : sequence of Connector
    points : sequence of BodyPoint
        Points that the page offers for arrows and paths; outputs first.
    size : float
        Characteristic length, m.
    up : tuple of float
        Upward direction.
    front : float, default 0
        z in front of all planar bodies, m; zero for spatial ones.
    """

    meshes: Mapping[str, Sequence[ColoredMesh]]
    connectors: Sequence[Connector]
    points: Sequence[BodyPoint]
    size: float
    up: tuple[float, float, float]
    front: float = 0.0

    def corners(self) -> dict[str, Float[np.ndarray, "8 3"]]:
        """Return the corners of the bounding box of the meshes of each body with meshes, in its frame."""
        corners = {}
        for body, meshes in self.meshes.items():
            if meshes:
                bounds = np.stack([colored.mesh.bounds for colored in meshes])
                box = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
                corners[body] = np.stack(np.meshgrid(*np.transpose(box)), axis=-1).reshape(-1, 3)
        return corners


def upward(gravity: Float[np.ndarray, " components"]) -> tuple[float, float, float]:
    """Return the coordinate axis nearest to the upward direction, against gravity, or z without gravity.

    Examples
    --------
    >>> upward(np.array([0, -9.81, 0])), upward(np.zeros(3))
    ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    """
    if not np.any(gravity):
        return 0.0, 0.0, 1.0
    k = int(np.argmax(np.abs(gravity)))
    x, y, z = (-np.sign(gravity[k]) * np.eye(3)[k] + 0.0).tolist()
    return x, y, z
