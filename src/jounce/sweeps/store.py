"""The folder of a sweep: a Zarr hierarchy that appears whole, is filled by chunks, and knows which are on the disk.

The array ``chunks/digest`` has the digest of every chunk, in a file of its own that is written last, when the arrays of
the chunk are on the disk: what it names is whole. What a process that was killed has left half done has no digest, and
is computed again.

Nothing in the folder is taken on trust: each file is compared with what it must hold, no link is followed where
something is written, and nothing is opened that is no regular file.
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
    """The folder of a sweep that is there.

    Parameters
    ----------
    folder : Path
        Ends in .zarr.
    """

    def __init__(self, folder: Path):
        self.folder = folder
        self._written: dict[str, Any] | None = None  # arrays over the designs, opened when they are first written

    @cached_property
    def manifest(self) -> dict[str, Any]:
        """What the sweep is, as it was written when it began.

        Raises
        ------
        OutputError
            It is not there, or was changed since.
        """
        return self.reread()

    def reread(self) -> dict[str, Any]:
        """Return the manifest that is there now."""
        path = self.folder / ROOT
        try:
            manifest = parsed(attributes_in(path)["manifest"], path)
        except KeyError:
            raise OutputError("has no manifest of a sweep", path=str(path)) from None
        return intact(manifest, str(path))

    @cached_property
    def _arrays(self) -> dict[str, Any]:
        """Arrays over the designs, whose descriptions were compared before."""
        import zarr

        arrays: dict[str, Any] = dict(zarr.open_group(self.folder, mode="r+", use_consolidated=True).arrays())
        return {name: x for name, x in arrays.items() if (x.metadata.dimension_names or ("",))[0] == "design"}

    def write(self, chunk: int, start: int, arrays: Mapping[str, np.ndarray]) -> None:
        """Write the arrays of a chunk, whose first design is `start`; it is done once all is on the disk.

        Raises
        ------
        OutputError
            The disk is full, or what else the system says.
        """
        with naming_path(self.folder):
            with ThreadPoolExecutor(1) as pool:  # whose thread has no event loop yet, as that of a notebook has
                pool.submit(asyncio.run, self._put(start, arrays)).result()
            for name in arrays:
                _sync(self._part(name, chunk))
            self._mark(chunk).parent.mkdir(exist_ok=True)
            put(self._mark(chunk), self._digest(chunk, arrays))

    async def _put(self, start: int, arrays: Mapping[str, np.ndarray]) -> None:
        """Put the arrays of a chunk to their files all at once: one after another takes twice as long."""
        import zarr.api.asynchronous

        if self._written is None:
            group = await zarr.api.asynchronous.open_group(self.folder, mode="r+", use_consolidated=True)
            self._written = {name: array async for name, array in group.arrays()}
        whole = self._written
        await asyncio.gather(*(whole[name].setitem(slice(start, start + len(x)), x) for name, x in arrays.items()))

    def is_done(self, chunk: int) -> bool:
        """Tell whether a chunk is on the disk."""
        return self._mark(chunk).is_file()

    def is_whole(self, chunk: int, start: int, count: int) -> bool:
        """Tell whether the arrays of a chunk that is done, of so many designs, are those that were written."""
        parts = [self._part(name, chunk) for name in self._arrays]
        try:
            if any(part.exists() and not part.is_file() for part in parts):  # what equals the fill value has no file
                return False
            arrays = {name: array[start : start + count] for name, array in self._arrays.items()}
            digest = read_file(self._mark(chunk), DIGEST, is_input=False)
            return self._digest(chunk, arrays) == digest
        except Exception:  # noqa: BLE001 - whatever is wrong with its files, it is computed again
            return False

    def restore(self, files: Mapping[str, bytes]) -> list[str]:
        """Write files that were there before any chunk again unless they hold what they must; return whose they are.

        Raises
        ------
        OutputError
            Something else has the place of a file or a folder, and would have to be removed.
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
        """Yield the folders that hold the files of a sweep, now or when it is done."""
        for name in files:
            parents = Path(name).parents[:-1]
            yield from (self.folder / parent for parent in parents)
            if parents and Path(name).name == ROOT:
                yield self.folder / parents[0] / "c"

    def _expected_content(self, path: Path, content: bytes) -> bytes | None:
        """Return what a file must hold, None where it does; what others wrote about the whole sweep stays."""
        try:
            there = read_file(path, LARGEST_ROOT, error=OutputError, is_input=False)
        except OutputError:
            return content
        if there == content:
            return None
        if path.name != ROOT:
            return content
        expected = json.loads(content)
        try:
            present = parsed(there, path)
        except OutputError:
            return content
        if path.parent == self.folder and isinstance(attributes := present.get("attributes"), dict):
            own = {name: attributes.get(name) for name in ("manifest", "checksum")}
            expected["attributes"] = attributes | expected["attributes"] | own
        return None if present == expected else json.dumps(expected, indent=1).encode()

    def forget(self, chunk: int) -> None:
        """Have a chunk computed again.

        Raises
        ------
        OutputError
            Its digest cannot be removed.
        """
        with naming_path(self._mark(chunk)):
            self._mark(chunk).unlink(missing_ok=True)

    def done(self, count: int) -> np.ndarray:
        """Tell which of the chunks were put on the disk."""
        done = np.zeros(count, bool)
        done[[chunk for chunk in map(int, self._marked()) if chunk < count]] = True
        return done

    def is_empty(self) -> bool:
        """Tell whether there is nothing but what was there before any chunk."""
        if next(self._marked(), None) is not None:
            return False
        with naming_path(self.folder):
            entries = [entry for entry in self.folder.iterdir() if not entry.name.startswith(SCRATCH)]
            own = {ROOT: True} | {x.name: is_blank(x) for x in entries if x.is_dir() and not x.is_symlink()}
        return all(own.get(entry.name, False) for entry in entries)

    def remove(self) -> None:
        """Remove the folder, which no other process may be writing to."""
        with self.locked(), naming_path(self.folder):
            shutil.rmtree(self.folder)

    def finish(self, count: int) -> str:
        """Return the digest of the digests of all chunks, and put it into the manifest, whatever is there.

        Raises
        ------
        OutputError
            A digest is gone, or the manifest cannot be written.
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
            for left in self.folder.rglob("*.partial"):  # by processes that were killed
                left.unlink(missing_ok=True)
        return checksum

    @contextmanager
    def scratch(self) -> Iterator[Path]:
        """Give a folder for what workers keep meanwhile; it goes also where a signal ends the process.

        Only what kills the process at once leaves it behind, for the next one to remove.
        """
        with naming_path(self.folder):
            path = Path(tempfile.mkdtemp(prefix=SCRATCH, dir=self.folder))
        try:
            with cleanup_on_signal(lambda: shutil.rmtree(path, ignore_errors=True)):
                yield path
        finally:
            shutil.rmtree(path, ignore_errors=True)

    def clear(self) -> None:
        """Remove what processes that were killed have left for their workers."""
        for left in self.folder.glob(f"{SCRATCH}*"):
            shutil.rmtree(left, ignore_errors=True)

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
        with naming_path(self.folder):
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

    def _part(self, name: str, chunk: int) -> Path:
        """Return the file of a chunk of an array, which is whole along all other dimensions."""
        array = self._arrays[name]
        return self.folder / name / array.metadata.encode_chunk_key((chunk, *[0] * (array.ndim - 1)))

    def _mark(self, chunk: int) -> Path:
        return self.folder / "chunks" / "digest" / "c" / str(chunk)

    def _marked(self) -> Iterator[str]:
        """Yield the names of the digests that are there."""
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
    """Return the sweep in a folder, None where it may be made.

    Raises
    ------
    OutputError
        The name does not end in .zarr, the folder above does not exist or belongs to another sweep, or what is there is
        no sweep.
    """
    if folder.suffix.lower() != SUFFIX:
        raise OutputError(f"a sweep is written to a folder whose name ends in {SUFFIX}", path=str(folder))
    try:
        real = Path(os.path.realpath(folder))
        if not real.parent.is_dir():
            raise OutputError(f"the folder {real.parent} does not exist", path=str(folder))
        for above in real.parents:
            if is_sweep(above):
                message = f"the folder {above} above is that of another sweep; give a name outside of it"
                raise OutputError(message, path=str(folder))
        if not real.exists() or (real.is_dir() and not any(real.iterdir())):
            if not os.access(real.parent, os.W_OK | os.X_OK):
                raise OutputError("nothing may be written in the folder above", path=str(folder))
            return None
    except (OSError, ValueError) as error:
        raise OutputError(f"cannot be read: {reason_of(error)}", path=str(folder)) from None
    try:
        present = "manifest" in attributes_in(folder / ROOT)
        reason = f"{ROOT} has no manifest"
    except OutputError as error:
        present, reason = False, f"{ROOT}: {error.message}"
    if not present:
        message = f"what is there is not a sweep of jounce, or is a damaged one ({reason}); give another name"
        raise OutputError(message, path=str(folder))
    store = Store(folder)
    store.manifest  # noqa: B018 - it is compared with its digest
    return store


def create(folder: Path, files: Mapping[str, bytes]) -> Store:
    """Make the folder of a sweep, with some files in it; it appears whole or not at all.

    Raises
    ------
    OutputError
        It cannot be written.
    """
    real = Path(os.path.realpath(folder))
    scratch = real.with_name(f".jounce-{secrets.token_hex(6)}")
    try:
        with naming_path(folder), cleanup_on_signal(lambda: shutil.rmtree(scratch, ignore_errors=True)):
            for name, content in files.items():
                path = scratch / name
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(content)
            for path in scratch.rglob("*"):
                _sync(path)
            scratch.rename(real)
            _sync(real.parent)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
    return Store(folder)
