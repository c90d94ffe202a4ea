"""Solids of robot files: colored meshes by link, and capsules along z."""

from __future__ import annotations

import numpy as np
from trimesh import Trimesh

from jounce.viewer.shapes.appearance import ColoredMesh
from jounce.viewer.shapes.mesh_files import Rgba
from jounce.viewer.shapes.meshes import capsule

PLAIN = (190, 195, 202)
Shapes = dict[str, list[ColoredMesh]]
"""Meshes by link, in its frame."""


def colored(mesh: Trimesh, rgba: Rgba | None) -> ColoredMesh:
    """Return a mesh with a color: red, green, blue and an optional opacity, from 0 to 1; gray by default."""
    if rgba is None or len(rgba) < 3:
        return ColoredMesh(mesh, PLAIN)
    red, green, blue = (round(255 * float(np.clip(c, 0, 1))) for c in rgba[:3])
    return ColoredMesh(mesh, (red, green, blue), float(rgba[3]) if len(rgba) > 3 else 1.0)


def upright_capsule(radius: float, length: float) -> Trimesh:
    """Return a capsule along z about the origin, with the length of its cylinder."""
    return capsule([0, 0, -0.5 * length], [0, 0, 0.5 * length], radius)


def words_as_numbers(text: str) -> list[float]:
    """Return the numbers in a text, or raise ValueError."""
    return [float(word) for word in text.split()]
