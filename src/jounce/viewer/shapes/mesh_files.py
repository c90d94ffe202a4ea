"""Mesh files named in a URDF, in its folder or in the folder of its package."""

from __future__ import annotations

import io
import os
import warnings
from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from trimesh.resolvers import Resolver

from jounce.errors import RobotFileError
from jounce.io.files.reading import MAX_SAMPLES, named_file, read_file

Rgba = tuple[float, ...]
"""Red, green, blue and opacity, from 0 to 1."""
LARGEST = 400_000  # triangles of a mesh that a page can move smoothly


class MeshFiles:
    """The mesh files named in a robot file.

    Parameters
    ----------
    path : Path
        The robot file.
    allow
        Further folders allowed for meshes.
    """

    def __init__(self, path: Path, allow: Iterable[str | PathLike[str]] = ()) -> None:
        self.path, self.allow = path, tuple(allow)

    def read(self, name: str) -> list[tuple[trimesh.Trimesh, Rgba | None]]:
        """Return the parts of a mesh, by its name in the file, with their colors; none if it cannot be read."""
        try:
            file = self._file(name)
            if file is None:
                return []
            content = read_file(file, MAX_SAMPLES, what="the mesh", error=RobotFileError)
        except RobotFileError as error:
            warnings.warn(f"a mesh is not shown: {error.located(path=self.path)}", stacklevel=2)
            return []
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                kind = Path(file).suffix.lower().removeprefix(".")
                parts = trimesh.load_scene(io.BytesIO(content), file_type=kind, resolver=_resolver(file)).dump()
        except Exception:  # noqa: BLE001 - mesh readers raise errors of many kinds; bars are shown instead
            return []
        meshes = (part for part in parts if isinstance(part, trimesh.Trimesh) and 0 < len(part.faces) <= LARGEST)
        return [(part, _color(part)) for part in meshes]

    def _file(self, name: str) -> str | None:
        """Return the file of a mesh: relative to the robot file, or in its package, above it or in allowed folders."""
        scheme, _, rest = name.rpartition("://")
        if not rest:
            return None
        if scheme in ("package", "model"):
            above = self.path.resolve().parents[:-1]  # without the root of the file system
            folders = [*above, *(Path(folder).resolve() for folder in self.allow)]
            candidates = [(folder, inner) for folder in folders for inner in (rest, rest.partition("/")[2]) if inner]
            files = [named_file(inner, folder / "package.xml", error=RobotFileError) for folder, inner in candidates]
        else:
            files = [named_file(rest, self.path, self.allow, error=RobotFileError)]
        return next((file for file in files if os.path.lexists(file)), None)


def _color(part: trimesh.Trimesh) -> Rgba | None:
    try:
        visual: Any = part.visual
        rgba = np.asarray(visual.to_color().main_color if visual.defined else None, float) / 255
    except (AttributeError, TypeError, ValueError):
        return None
    return tuple(rgba.tolist()) if rgba.shape == (4,) and np.isfinite(rgba).all() else None


def _resolver(file: str) -> Resolver:
    """Return the resolver that gives trimesh the files named in a mesh: materials, pictures."""

    class AdjacentFiles(Resolver):
        def __init__(self) -> None:
            pass

        def get(self, name: str) -> bytes:
            return read_file(named_file(name.strip(), file, error=RobotFileError), MAX_SAMPLES, error=RobotFileError)

        def write(self, name: str, data: Any) -> None:
            raise RobotFileError("is not written", path=file, value=(name, data))

        def namespaced(self, namespace: str) -> Resolver:
            raise RobotFileError("is in no folder", path=file, value=namespace)

        def keys(self) -> list[str]:
            return []

    return AdjacentFiles()
