"""The folder of a sweep: a Zarr hierarchy that appears whole, is filled by chunks, and knows which are on the disk.

The array ``chunks/digest`` has the digest of every chunk, in a file of its own that is written last, when the arrays of
the chunk are on the disk: what it names is whole. What a process that was killed has left half done has no digest, and
is computed again.
"""

import hashlib
import json
import os
import secrets
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from jounce.errors import OutputError
from jounce.interrupts import undoing
from jounce.io.files.reading import reason_of
from jounce.io.files.writing import replacing
from jounce.sweeps.problems import Quantity
from jounce.sweeps.statistics import Variable

SUFFIX = ".zarr"
AXES = {
    "time": {"units": "s", "long_name": "time"},
    "derivative": {"long_name": "order of the time derivative"},
}
BYTES = hashlib.sha256().digest_size


class Store:
    """The folder of a sweep that is there.

    Parameters
    ----------
    folder : Path
        Ends in .zarr.
    """

    def __init__(self, folder: Path):
        self.folder = folder

    @cached_property
    def manifest(self) -> dict[str, Any]:
        """What the sweep is, as it was written when it began."""
        return json.loads(_attributes(self.folder)["manifest"])

    @cached_property
    def _arrays(self) -> dict[str, Any]:
        import zarr

        return dict(zarr.open_group(self.folder, mode="r+", use_consolidated=True).arrays())

    def write(self, chunk: int, start: int, arrays: Mapping[str, np.ndarray]) -> None:
        """Write the arrays of a chunk, whose first design is `start`; it is done once all is on the disk.

        Raises
        ------
        OutputError
            The disk is full, or what else the system says.
        """
        written = []
        try:
            for name, values in arrays.items():
                target = self._arrays[name]
                target[start : start + len(values)] = values
                key = target.metadata.encode_chunk_key((chunk, *[0] * (values.ndim - 1)))
                written.append(self.folder / name / key)
            for path in written:
                _sync(path)
            mark = self._mark(chunk)
            mark.parent.mkdir(exist_ok=True)
        except OSError as error:
            raise OutputError(f"cannot be written: {reason_of(error)}", path=str(self.folder)) from error
        with replacing(mark) as scratch:
            scratch.write_bytes(self._digest(chunk, arrays))

    def is_done(self, chunk: int) -> bool:
        """Tell whether a chunk is on the disk."""
        return self._mark(chunk).exists()

    def is_whole(self, chunk: int, start: int, count: int) -> bool:
        """Tell whether the arrays of a chunk that is done, of so many designs, are those that were written."""
        try:
            arrays = {
                name: array[start : start + count]
                for name, array in self._arrays.items()
                if (array.metadata.dimension_names or ("",))[0] == "design"
            }
            return self._digest(chunk, arrays) == self._mark(chunk).read_bytes()
        except Exception:  # noqa: BLE001 - whatever is wrong with its files, it is computed again
            return False

    def mended(self, axes: Mapping[str, np.ndarray]) -> list[str]:
        """Return the names of coordinates that are not those that were written, and write them again."""
        found = []
        for name, values in axes.items():
            try:
                same = np.array_equal(self._arrays[name][:], values)
            except Exception:  # noqa: BLE001 - whatever is wrong with its files, it is written again
                same = False
            if not same:
                self._arrays[name][:] = values
                found.append(name)
        return found

    def forget(self, chunk: int) -> None:
        """Have a chunk computed again."""
        self._mark(chunk).unlink(missing_ok=True)

    def done(self, count: int) -> np.ndarray:
        """Tell which of the chunks were put on the disk."""
        found = np.zeros(count, bool)
        with suppress(FileNotFoundError), os.scandir(self._mark(0).parent) as entries:
            found[[int(entry.name) for entry in entries if entry.name.isdecimal()]] = True
        return found

    def is_empty(self) -> bool:
        """Tell whether no chunk is on the disk."""
        with suppress(FileNotFoundError), os.scandir(self._mark(0).parent) as entries:
            return not any(entry.name.isdecimal() for entry in entries)
        return True

    def remove(self) -> None:
        """Remove the folder, which no other process may be writing to."""
        with self.locked():
            shutil.rmtree(self.folder)

    def finish(self, count: int) -> str:
        """Return the digest of the digests of all chunks, and put it into the manifest, whatever stands there."""
        digest = hashlib.sha256()
        for chunk in range(count):
            digest.update(self._mark(chunk).read_bytes())
        checksum = digest.hexdigest()
        path = self.folder / "zarr.json"
        content = json.loads(path.read_text(encoding="utf-8"))
        manifest = {**self.manifest, "checksum": checksum}
        told = {"manifest": json.dumps(manifest, indent=1), "checksum": checksum}
        if content["attributes"] != content["attributes"] | told:
            content["attributes"] |= told
            with replacing(path) as scratch:
                scratch.write_text(json.dumps(content, indent=1), encoding="utf-8")
        self.__dict__["manifest"] = manifest
        for left in self.folder.glob("*/c/**/*.partial"):  # by processes that were killed
            left.unlink(missing_ok=True)
        return checksum

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other processes of this machine from writing the same sweep.

        Raises
        ------
        OutputError
            One does.
        """
        try:
            import fcntl
        except ImportError:  # there is none on Windows
            yield
            return
        descriptor = os.open(self.folder, os.O_RDONLY)
        try:
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                message = "another process is computing this sweep; wait for it, or end it first"
                raise OutputError(message, path=str(self.folder)) from None
            except OSError:  # a file system without locks
                pass
            yield
        finally:
            os.close(descriptor)

    def _digest(self, chunk: int, arrays: Mapping[str, np.ndarray]) -> bytes:
        """Return the digest of the arrays of a chunk by name; what is not a number is NaN, whatever bits it has.

        It is that of the chunk in its place in this sweep: no other one, of this or of another sweep, may take it.
        """
        digest = hashlib.sha256(f"{self.manifest['identity']} {chunk} ".encode())
        for name in sorted(arrays):
            values = np.ascontiguousarray(arrays[name])
            digest.update(f"{name} {values.dtype.str} {values.shape} ".encode())
            digest.update((np.where(np.isnan(values), np.nan, values) if values.dtype.kind == "f" else values).data)
        return digest.digest()

    def _mark(self, chunk: int) -> Path:
        return self.folder / "chunks" / "digest" / "c" / str(chunk)


def find(folder: Path) -> Store | None:
    """Return the sweep in a folder, None where it may be made.

    Raises
    ------
    OutputError
        The name does not end in .zarr, the folder above does not exist, or what is there is no sweep.
    """
    if folder.suffix.lower() != SUFFIX:
        raise OutputError(f"a sweep is written to a folder whose name ends in {SUFFIX}", path=str(folder))
    try:
        if not folder.absolute().parent.is_dir():
            raise OutputError(f"the folder {folder.absolute().parent} does not exist", path=str(folder))
        if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
            if not os.access(folder.absolute().parent, os.W_OK | os.X_OK):
                raise OutputError("nothing may be written in the folder above", path=str(folder))
            return None
    except OSError as error:
        raise OutputError(f"cannot be read: {reason_of(error)}", path=str(folder)) from None
    if "manifest" not in _attributes(folder):
        raise OutputError("something is there that is no sweep of jounce; give another name", path=str(folder))
    return Store(folder)


def create(
    folder: Path,
    manifest: Mapping[str, Any],
    variables: Sequence[Variable],
    axes: Mapping[str, np.ndarray],
    *,
    count: int,
    chunk: int,
) -> Store:
    """Make the folder of a sweep, with all arrays and nothing in them; it appears whole or not at all.

    Raises
    ------
    OutputError
        It cannot be written.
    """
    import warnings

    import zarr

    scratch = folder.with_name(f".jounce-{secrets.token_hex(6)}")
    attributes = {
        "title": manifest["title"],
        "source": "jounce",
        "coordinates": " ".join(v.name for v in variables[: len(manifest["vary"])]),
        "manifest": json.dumps(manifest, indent=1),
        "checksum": "",
    }
    try:
        with undoing(lambda: shutil.rmtree(scratch, ignore_errors=True)), warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Consolidated metadata is currently not part")
            root = zarr.create_group(scratch, attributes=attributes)
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
            root.create_group("chunks").create_array(
                "digest", shape=(BYTES * -(-count // chunk),), chunks=(BYTES,), dtype="u1", compressors=None
            )
            zarr.consolidate_metadata(scratch)
            for path in scratch.rglob("*"):
                _sync(path)
            scratch.rename(folder)
            _sync(folder.absolute().parent)
    except OSError as error:
        raise OutputError(f"cannot be written: {reason_of(error)}", path=str(folder)) from error
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
    return Store(folder)


def axes_of(quantities: Sequence[Quantity], instants: np.ndarray, levels: int) -> dict[str, np.ndarray]:
    """Return the coordinates of the dimensions of a sweep besides the design, by name."""
    labels = {axis: names for quantity in quantities for axis, names in quantity.axes}
    named = {axis: np.array(names, np.dtypes.StringDType()) for axis, names in labels.items()}
    return {"time": np.asarray(instants, float), "derivative": np.arange(levels)} | named


def _axis(root: Any, name: str, values: np.ndarray) -> None:
    array = root.create_array(
        name,
        shape=values.shape,
        chunks=values.shape,
        dtype=values.dtype,
        dimension_names=(name,),
        attributes=AXES.get(name, {}),
    )
    array[:] = values


def _attributes(folder: Path) -> dict[str, Any]:
    try:
        found = json.loads((folder / "zarr.json").read_text(encoding="utf-8"))
        return dict(found.get("attributes", {}))
    except (OSError, ValueError, AttributeError):
        return {}


def _sync(path: Path) -> None:
    """Bring a file, or the entries of a folder, onto the disk; what equals the fill value has no file."""
    with suppress(FileNotFoundError, PermissionError):
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
