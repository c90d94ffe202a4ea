"""What bodies look like on the page, as data: colored meshes, connectors between two points, points to choose from."""

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

DARK, GRAY = (70, 74, 82), (150, 155, 163)  # of what belongs to no body
# the light colors of Tol, which the color-blind distinguish; arrows have the strong ones
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
    """A surface of triangles in the frame of a body, m, with a color and an opacity from 0 to 1."""

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
        In the frame of the body, m; two or three components.
    name : str
        What it is called on the page.
    """

    body: str
    point: tuple[float, ...]
    name: str


@dataclasses.dataclass(frozen=True, eq=False)
class Connector:
    """What joins a point of one body to a point of another: a rod, a spring, an actuator, a span of a belt or a rope.

    Parameters
    ----------
    name : str
    kind : {"rod", "spring", "actuator", "line"}
    bodies : tuple of str
    points : tuple of numpy.ndarray
        One on each body, in its frame, m.
    radius : float
        m.
    color : tuple of int
    ends : tuple of numpy.ndarray of shape (time, 3)
        Where it begins and ends in the ground, m, where that is no point of a body.
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
    """What a mechanism or a robot looks like.

    Parameters
    ----------
    meshes : mapping of str to sequence of ColoredMesh
        By body, in its frame.
    connectors : sequence of Connector
    points : sequence of BodyPoint
        Points that the page offers for arrows and paths; outputs first.
    size : float
        A length of the whole, m.
    up : tuple of float
        What is up.
    front : float, default 0
        z in front of all planar bodies, m; zero in space.
    """

    meshes: Mapping[str, Sequence[ColoredMesh]]
    connectors: Sequence[Connector]
    points: Sequence[BodyPoint]
    size: float
    up: tuple[float, float, float]
    front: float = 0.0

    def corners(self) -> dict[str, Float[np.ndarray, "8 3"]]:
        """Return the corners of the box around the meshes of each body that has some, in its frame."""
        corners = {}
        for body, meshes in self.meshes.items():
            if meshes:
                bounds = np.stack([colored.mesh.bounds for colored in meshes])
                box = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
                corners[body] = np.stack(np.meshgrid(*np.transpose(box)), axis=-1).reshape(-1, 3)
        return corners


def upward(gravity: Float[np.ndarray, " components"]) -> tuple[float, float, float]:
    """Return the axis nearest to what is up: against gravity, or z where there is none.

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
