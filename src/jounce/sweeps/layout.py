"""The initial files in the folder of a sweep, and the size of its results."""

import json
import math
import os
import shutil
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jounce.errors import OutputError
from jounce.sweeps.problems import Quantity
from jounce.sweeps.statistics import Variable

AXES = {
    "time": {"units": "s", "long_name": "time"},
    "derivative": {"long_name": "order of the time derivative"},
}
DIGEST = 32  # bytes
SHRINKS = 4
"""Largest assumed compression ratio of results: 1.1 for those of four-bars, but designs that cannot be assembled take
almost no space."""


def files_of(
    manifest: Mapping[str, Any],
    variables: Sequence[Variable],
    axes: Mapping[str, np.ndarray],
    *,
    count: int,
    chunk: int,
) -> dict[str, bytes]:
    """Return the files of a Zarr hierarchy with all arrays, still empty, by their names in the folder.

    Parameters
    ----------
    manifest : dict
        Manifest of the sweep.
    variables : sequence of Variable
        Arrays over the designs, parameters first.
    axes : dict of str to array
        Coordinates of the other dimensions.
    count : int
        Number of designs.
    chunk : int
        Number of designs computed together.
    """
    import zarr
    from zarr.storage import MemoryStore

    files: dict[str, Any] = {}
    attributes = {
        "title": manifest["title"],
        "source": "jounce",
        "coordinates": " ".join(v.name for v in variables[: len(manifest["vary"])]),
        "manifest": json.dumps(manifest, indent=1),
        "checksum": "",
    }
    store = MemoryStore(files)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Consolidated metadata is currently not part")
        root = zarr.create_group(store, attributes=attributes)
        for name, values in axes.items():
            _axis(root, name, values)
        for variable in variables:
            root.create_array(
                variable.name,
                shape=(count, *variable.shape),
                chunks=(chunk, *variable.shape),
                dtype=variable.dtype,
                fill_value=float("nan") if variable.dtype == "f8" else -1,
                dimension_names=("design", *variable.dims),
                attributes=variable.attributes,
            )
        digests = (DIGEST * -(-count // chunk),)
        root.create_group("chunks").create_array(
            "digest", shape=digests, chunks=(DIGEST,), dtype="u1", compressors=None
        )
        zarr.consolidate_metadata(store)
    return {name: content.to_bytes() for name, content in files.items()}


def axes_of(quantities: Sequence[Quantity], instants: np.ndarray, levels: int) -> dict[str, np.ndarray]:
    """Return the coordinates of the dimensions of a sweep other than the design, by name."""
    labels = {axis: names for quantity in quantities for axis, names in quantity.axes}
    label_arrays = {axis: np.array(names, np.dtypes.StringDType()) for axis, names in labels.items()}
    return {"time": np.asarray(instants, float), "derivative": np.arange(levels)} | label_arrays


def _axis(root: Any, name: str, values: np.ndarray) -> None:
    array = root.create_array(
        name,
        shape=values.shape,
        chunks=values.shape,
        dtype=values.dtype,
        compressors=None,  # compressed bytes would depend on the release of the compressor
        dimension_names=(name,),
        attributes=AXES.get(name, {}),
    )
    array[:] = values


def check_room(folder: Path, variables: Sequence[Variable], count: int, chunk: int) -> None:
    """Raise OutputError if the results of a sweep cannot fit on the disk, even if compressed."""
    size = sum(math.prod(variable.shape) * np.dtype(variable.dtype).itemsize for variable in variables)
    files = -(-count // chunk) * (len(variables) + 1)
    parent = folder.absolute().parent
    advice = "; sweep fewer designs, or write to a larger disk"
    space = shutil.disk_usage(parent).free
    if count * size > SHRINKS * space:
        message = f"{count} designs of {size} bytes each are {_size(count * size)}, and {_size(space)} are free{advice}"
        raise OutputError(message, path=str(folder))
    if files > (limit := _free_files(parent)):
        message = f"{count} designs take {files} files, and the disk has room for {limit}{advice}, or in larger chunks"
        raise OutputError(message, path=str(folder))


def _free_files(folder: Path) -> float:
    if not hasattr(os, "statvfs"):
        return math.inf
    return float(os.statvfs(folder).f_favail) or math.inf  # some file systems have no limit, and report 0


def _size(count: int | float) -> str:
    names = ("bytes", "kB", "MB", "GB", "TB", "PB", "EB")
    power = min(int(math.log10(max(count, 1)) // 3), len(names) - 1)
    return f"{count / 1000**power:.3g} {names[power]}"
