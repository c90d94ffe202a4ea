"""A NetCDF file written part by part along time, with the memory of a single part.

HDF5 never writes to the disk, because on a full disk it does not close its file, prints to standard error, and may end
the process. HDF5 lays out the file in memory, with everything but the values along time, whose places stay empty. The
file on the disk has its full length from the start, so that a lack of space is found at once, and plain writes put the
values into their places.
"""

from __future__ import annotations

import errno
import io
import os
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    import xarray

BLOCK = 2**14  # bytes
NO_SUCH_CALL = (errno.EOPNOTSUPP, errno.EINVAL, errno.ENOSYS)  # errors of file systems that cannot reserve space


class NetcdfParts:
    """A NetCDF file of known length, into which parts along time are written.

    Parameters
    ----------
    stream : io.FileIO
        New file, unbuffered.
    example : bytes
        Content of a NetCDF file that equals the whole one except for its instants.
    count : int
        Number of instants of the whole file.
    """

    def __init__(self, stream: io.FileIO, example: Any, count: int):
        layout = _layout(example, count)
        self._stream, self._offsets = stream, layout.offsets
        _reserve(stream, layout.size)
        for number, block in layout.blocks.items():
            _write_at(stream, number * BLOCK, memoryview(block)[: layout.size - number * BLOCK])

    def put(self, part: xarray.Dataset, first: int) -> None:
        """Write the values of a part; `first` is the index of its first instant in the whole file."""
        for name, (offset, dims, dtype) in self._offsets.items():
            values = np.ascontiguousarray(part[name].transpose(*dims).values, dtype)
            _write_at(self._stream, offset + first * values[0].nbytes, values.reshape(-1).view(np.uint8))


class _Layout(NamedTuple):
    """A NetCDF file without its values along time.

    Attributes
    ----------
    size : int
        Size of the whole file, bytes.
    blocks : dict of int to bytearray
        Content except these values, by block number; a missing block holds only such values.
    offsets : dict of str to tuple
        Offset of the values, dimensions and type of each variable along time.
    """

    size: int
    blocks: dict[int, bytearray]
    offsets: dict[str, tuple[int, tuple[str, ...], np.dtype]]


def _layout(example: Any, count: int) -> _Layout:
    """Return the layout of a file like the example, with another number of instants."""
    import h5netcdf

    file, offsets = _SparseFile(), {}
    with h5netcdf.File(io.BytesIO(example), "r") as sample, h5netcdf.File(file, "w") as target:
        ordered = sorted(sample.dimensions.items(), key=lambda named: named[1]._dimid)
        target.dimensions = {name: count if name == "time" else dimension.size for name, dimension in ordered}
        target.attrs.update(sample.attrs)
        for name, given in sample.variables.items():
            has_time = "time" in given.dimensions
            attributes = dict(given.attrs)
            missing = attributes.pop("_FillValue", None)
            settings = {"dcpl": _preallocated_properties()} if has_time else {}
            variable = target.create_variable(name, given.dimensions, given.dtype, fillvalue=missing, **settings)
            variable.attrs.update(attributes)
            if not has_time:
                variable[...] = given[...]
                continue
            offset = variable._h5ds.id.get_offset()
            offsets[name] = offset, given.dimensions, variable.dtype
    return _Layout(file.size, file.blocks, offsets)


def _preallocated_properties() -> Any:
    """Return the properties of a variable whose space is allocated from the start, and not filled."""
    import h5py

    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    properties.set_layout(h5py.h5d.CONTIGUOUS)
    properties.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    properties.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    return properties


def _reserve(stream: io.FileIO, size: int) -> None:
    """Set the length of a file, and reserve the space for it if the system can."""
    stream.truncate(size)
    if hasattr(os, "posix_fallocate"):
        try:
            os.posix_fallocate(stream.fileno(), 0, size)
        except OSError as error:
            if error.errno not in NO_SUCH_CALL:
                raise


def _write_at(stream: io.FileIO, offset: int, values: Any) -> None:
    stream.seek(offset)
    remaining = memoryview(values)
    while remaining.nbytes:
        remaining = remaining[stream.write(remaining) :]


class _SparseFile(io.RawIOBase):
    """A file in memory that stores only written blocks; the rest is zero."""

    def __init__(self) -> None:
        self.blocks: dict[int, bytearray] = {}
        self.size = self._position = 0

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        self._position = offset + (0, self._position, self.size)[whence]
        return self._position

    def tell(self) -> int:
        return self._position

    def truncate(self, size: int | None = None) -> int:
        self.size = self._position if size is None else size
        return self.size

    def readinto(self, into: Any) -> int:
        view = memoryview(into).cast("B")
        length = max(0, min(len(view), self.size - self._position))
        for start, number, part in self._parts(length):
            block = self.blocks.get(number)
            view[start : start + len(part)] = bytes(len(part)) if block is None else block[part.start : part.stop]
        self._position += length
        return length

    def write(self, values: Any) -> int:
        view = memoryview(values).cast("B")
        for start, number, part in self._parts(len(view)):
            block = self.blocks.setdefault(number, bytearray(BLOCK))
            block[part.start : part.stop] = view[start : start + len(part)]
        self._position += len(view)
        self.size = max(self.size, self._position)
        return len(view)

    def _parts(self, length: int) -> Iterator[tuple[int, int, range]]:
        """Yield the blocks of a span of bytes from the position: start in the span, number, bytes of the block."""
        start = 0
        while start < length:
            number, offset = divmod(self._position + start, BLOCK)
            part = range(offset, min(BLOCK, offset + length - start))
            yield start, number, part
            start += len(part)
