"""The folder of a sweep: a Zarr hierarchy created atomically and filled by chunks, which records finished chunks.

The array ``chunks/digest`` has the digest of every chunk, each in a file written after the arrays of the chunk are on
the disk, so that a chunk with a digest is complete. A chunk that a killed process left incomplete has no digest, and is
computed again.

Nothing in the folder is trusted: each file is compared with its expected content, writing follows no links, and only
regular files are opened.
"""

import asyncio
import hashlib
import json
import os
import secrets
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from jounce.base.interrupts import cleanup_on_signal
from jounce.errors import OutputError
from jounce.io.files.reading import read_file, reason_of
from jounce.sweeps.folder_files import (
    LARGEST_ROOT,
    REMOVE,
    ROOT,
    attributes_in,
    is_blank,
    is_sweep,
    naming_path,
    parsed,
    put,
    sync as _sync,
)
from jounce.sweeps.layout import DIGEST
from jounce.sweeps.manifest import intact

SUFFIX = ".zarr"
SCRATCH = ".scratch-"


class Store:
    """The existing folder of a sweep.

    Parameters
    ----------
    folder : Path
        Path that ends in .zarr.
    """

    def __init__(self, folder: Path):
        self.folder = folder
        self._written: dict[str, Any] | None = None  # arrays over the designs, opened at the first write

    @cached_property
    def manifest(self) -> dict[str, Any]:
        """Manifest of the sweep, as written at its start.

        Raises
        ------
        OutputError
            If the manifest does not exist, or was changed since.
        """
        return self.reread()

    def reread(self) -> dict[str, Any]:
        """Return the manifest that is in the folder now."""
        path = self.folder / ROOT
        try:
            manifest = parsed(attributes_in(path)["manifest"], path)
        except KeyError:
            raise OutputError("has no manifest of a sweep", path=str(path)) from None
        return intact(manifest, str(path))

    @cached_property
    def _arrays(self) -> dict[str, Any]:
        """Arrays over the designs, with metadata checked before."""
        import zarr

        arrays: dict[str, Any] = dict(zarr.open_group(self.folder, mode="r+", use_consolidated=True).arrays())
        return {name: x for name, x in arrays.items() if (x.metadata.dimension_names or ("",))[0] == "design"}

    def write(self, chunk: int, start: int, arrays: Mapping[str, np.ndarray]) -> None:
        """Write the arrays of a chunk, whose first design is `start`, and mark it as done once all are on the disk.

        Raises
        ------
        OutputError
            If the disk is full, or another error of the system occurs.
        """
        with naming_path(self.folder):
            with ThreadPoolExecutor(1) as pool:  # a thread without a running event loop, unlike that of a notebook
                pool.submit(asyncio.run, self._put(start, arrays)).result()
            for name in arrays:
                _sync(self._part(name, chunk))
            self._mark(chunk).parent.mkdir(exist_ok=True)
            put(self._mark(chunk), self._digest(chunk, arrays))

    async def _put(self, start: int, arrays: Mapping[str, np.ndarray]) -> None:
        """Write the arrays of a chunk concurrently; one after another takes twice as long."""
        import zarr.api.asynchronous

        if self._written is None:
            group = await zarr.api.asynchronous.open_group(self.folder, mode="r+", use_consolidated=True)
            self._written = {name: array async for name, array in group.arrays()}
        whole = self._written
        await asyncio.gather(*(whole[name].setitem(slice(start, start + len(x)), x) for name, x in arrays.items()))

    def is_done(self, chunk: int) -> bool:
        """Return whether a chunk is on the disk."""
        return self._mark(chunk).is_file()

    def is_whole(self, chunk: int, start: int, count: int) -> bool:
        """Return whether the arrays of a finished chunk of `count` designs are unchanged."""
        paths = [self._part(name, chunk) for name in self._arrays]
        try:
            if any(path.exists() and not path.is_file() for path in paths):  # chunks of fill values have no file
                return False
            arrays = {name: array[start : start + count] for name, array in self._arrays.items()}
            digest = read_file(self._mark(chunk), DIGEST, is_input=False)
            return self._digest(chunk, arrays) == digest
        except Exception:  # noqa: BLE001 - a chunk with any defect is computed again
            return False

    def restore(self, files: Mapping[str, bytes]) -> list[str]:
        """Rewrite initial files with unexpected content, and return the names of their arrays.

        Raises
        ------
        OutputError
            If the place of a file or folder is taken, and its content would have to be removed.
        """
        restored = []
        with naming_path(self.folder):
            for folder in sorted({*self._folders(files)}):
                if folder.is_symlink() or (os.path.lexists(folder) and not folder.is_dir()):
                    raise OutputError(f"takes the place of a folder of the sweep; {REMOVE}", path=str(folder))
            for name, content in files.items():
                path = self.folder / name
                if (expected := self._expected_content(path, content)) is not None:
                    path.parent.mkdir(parents=True, exist_ok=True)
                    put(path, expected)
                    restored.append(Path(name).parts[0])
        return list(dict.fromkeys(restored))

    def _folders(self, files: Mapping[str, bytes]) -> Iterator[Path]:
        """Yield the folders of the files of a sweep, now or when it is finished."""
        for name in files:
            parents = Path(name).parents[:-1]
            yield from (self.folder / parent for parent in parents)
            if parents and Path(name).name == ROOT:
                yield self.folder / parents[0] / "c"

    def _expected_content(self, path: Path, content: bytes) -> bytes | None:
        """Return the content that a file must have; None if it has it. Attributes added to the whole sweep stay."""
        try:
            existing = read_file(path, LARGEST_ROOT, error=OutputError, is_input=False)
        except OutputError:
            return content
        if existing == content:
            return None
        if path.name != ROOT:
            return content
        expected = json.loads(content)
        try:
            current = parsed(existing, path)
        except OutputError:
            return content
        if path.parent == self.folder and isinstance(attributes := current.get("attributes"), dict):
            kept_attributes = {name: attributes.get(name) for name in ("manifest", "checksum")}
            expected["attributes"] = attributes | expected["attributes"] | kept_attributes
        return None if current == expected else json.dumps(expected, indent=1).encode()

    def forget(self, chunk: int) -> None:
        """Mark a chunk as not done, so that it is computed again.

        Raises
        ------
        OutputError
            If its digest cannot be removed.
        """
        with naming_path(self._mark(chunk)):
            self._mark(chunk).unlink(missing_ok=True)

    def done(self, count: int) -> np.ndarray:
        """Return the mask of chunks on the disk."""
        is_done = np.zeros(count, bool)
        is_done[[chunk for chunk in map(int, self._marked()) if chunk < count]] = True
        return is_done

    def is_empty(self) -> bool:
        """Return whether the folder contains only its initial files."""
        if next(self._marked(), None) is not None:
            return False
        with naming_path(self.folder):
            entries = [entry for entry in self.folder.iterdir() if not entry.name.startswith(SCRATCH)]
            is_own = {ROOT: True} | {x.name: is_blank(x) for x in entries if x.is_dir() and not x.is_symlink()}
        return all(is_own.get(entry.name, False) for entry in entries)

    def remove(self) -> None:
        """Remove the folder; no other process may be writing to it."""
        with self.locked(), naming_path(self.folder):
            shutil.rmtree(self.folder)

    def finish(self, count: int) -> str:
        """Return the digest of the digests of all chunks, and write it to the manifest.

        Raises
        ------
        OutputError
            If a digest is missing, or the manifest cannot be written.
        """
        digest = hashlib.sha256()
        for chunk in range(count):
            digest.update(read_file(self._mark(chunk), DIGEST, error=OutputError, is_input=False))
        checksum = digest.hexdigest()
        path = self.folder / ROOT
        content = parsed(read_file(path, LARGEST_ROOT, error=OutputError, is_input=False), path)
        manifest = {**self.manifest, "checksum": checksum}
        attributes = {"manifest": json.dumps(manifest, indent=1), "checksum": checksum}
        if content["attributes"] != content["attributes"] | attributes:
            content["attributes"] |= attributes
            with naming_path(self.folder):
                put(path, json.dumps(content, indent=1).encode())
        self.__dict__["manifest"] = manifest
        with suppress(OSError):
            for left in self.folder.rglob("*.partial"):  # left by killed processes
                left.unlink(missing_ok=True)
        return checksum

    @contextmanager
    def scratch(self) -> Iterator[Path]:
        """Yield a folder for temporary files of workers, which is removed even if a signal ends the process.

        If the process is killed at once, the next process removes the folder.
        """
        with naming_path(self.folder):
            path = Path(tempfile.mkdtemp(prefix=SCRATCH, dir=self.folder))
        try:
            with cleanup_on_signal(lambda: shutil.rmtree(path, ignore_errors=True)):
                yield path
        finally:
            shutil.rmtree(path, ignore_errors=True)

    def clear(self) -> None:
        """Remove the temporary folders that killed processes have left."""
        for left in self.folder.glob(f"{SCRATCH}*"):
            shutil.rmtree(left, ignore_errors=True)

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other processes of this machine from writing the same sweep.

        Raises
        ------
        OutputError
            If another process is writing.
        """
        try:
            import fcntl
        except ImportError:  # Windows has no fcntl
            yield
            return
        with naming_path(self.folder):
            descriptor = os.open(self.folder, os.O_RDONLY)
        try:
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                message = "another process is computing this sweep; wait for it, or end it first"
                raise OutputError(message, path=str(self.folder)) from None
            except OSError:  # the file system has no locks
                pass
            yield
        finally:
            os.close(descriptor)

    def _digest(self, chunk: int, arrays: Mapping[str, np.ndarray]) -> bytes:
        """Return the digest of the arrays of a chunk by name, with all NaN values treated as equal.

        It covers the sweep and the place of the chunk, so that no other chunk has the same digest.
        """
        digest = hashlib.sha256(f"{self.manifest['identity']} {chunk} ".encode())
        for name in sorted(arrays):
            values = np.ascontiguousarray(arrays[name])
            digest.update(f"{name} {values.dtype.str} {values.shape} ".encode())
            digest.update((np.where(np.isnan(values), np.nan, values) if values.dtype.kind == "f" else values).data)
        return digest.digest()

    def _part(self, name: str, chunk: int) -> Path:
        """Return the file of a chunk of an array, which is undivided along all other dimensions."""
        array = self._arrays[name]
        return self.folder / name / array.metadata.encode_chunk_key((chunk, *[0] * (array.ndim - 1)))

    def _mark(self, chunk: int) -> Path:
        return self.folder / "chunks" / "digest" / "c" / str(chunk)

    def _marked(self) -> Iterator[str]:
        """Yield the names of the existing digests."""
        folder = self._mark(0).parent
        try:
            with os.scandir(folder) as entries:
                names = [entry.name for entry in entries]
        except (FileNotFoundError, NotADirectoryError):
            return
        except OSError as error:
            raise OutputError(f"cannot be read: {reason_of(error)}", path=str(folder)) from None
        yield from (name for name in names if name.isascii() and name.isdecimal() and len(name) < 16)


def find(folder: Path) -> Store | None:
    """Return the sweep in a folder; None if a new one may be created.

    Raises
    ------
    OutputError
        If the name does not end in .zarr, the parent folder does not exist or belongs to another sweep, or the folder
        is not that of a sweep.
    """
    if folder.suffix.lower() != SUFFIX:
        raise OutputError(f"a sweep is written to a folder whose name ends in {SUFFIX}", path=str(folder))
    try:
        real_path = Path(os.path.realpath(folder))
        if not real_path.parent.is_dir():
            raise OutputError(f"the folder {real_path.parent} does not exist", path=str(folder))
        for parent in real_path.parents:
            if is_sweep(parent):
                message = f"the folder {parent} above is that of another sweep; give a name outside of it"
                raise OutputError(message, path=str(folder))
        if not real_path.exists() or (real_path.is_dir() and not any(real_path.iterdir())):
            if not os.access(real_path.parent, os.W_OK | os.X_OK):
                raise OutputError("nothing may be written in the folder above", path=str(folder))
            return None
    except (OSError, ValueError) as error:
        raise OutputError(f"cannot be read: {reason_of(error)}", path=str(folder)) from None
    try:
        has_manifest = "manifest" in attributes_in(folder / ROOT)
        reason = f"{ROOT} has no manifest"
    except OutputError as error:
        has_manifest, reason = False, f"{ROOT}: {error.message}"
    if not has_manifest:
        message = f"what is there is not a sweep of jounce, or is a damaged one ({reason}); give another name"
        raise OutputError(message, path=str(folder))
    store = Store(folder)
    store.manifest  # noqa: B018 - checks its digest
    return store


def create(folder: Path, files: Mapping[str, bytes]) -> Store:
    """Create the folder of a sweep with its initial files, atomically.

    Raises
    ------
    OutputError
        If the folder cannot be written.
    """
    real_path = Path(os.path.realpath(folder))
    scratch = real_path.with_name(f".jounce-{secrets.token_hex(6)}")
    try:
        with naming_path(folder), cleanup_on_signal(lambda: shutil.rmtree(scratch, ignore_errors=True)):
            for name, content in files.items():
                path = scratch / name
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(content)
            for path in scratch.rglob("*"):
                _sync(path)
            scratch.rename(real_path)
            _sync(real_path.parent)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
    return Store(folder)
