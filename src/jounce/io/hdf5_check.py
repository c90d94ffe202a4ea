"""NetCDF files checked by a process of their own: in a damaged file, HDF5 may hang or crash."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from jounce.errors import OutputError

SECONDS, BYTES_A_SECOND = 20.0, 10e6
MEMORY = 2**30  # bytes, in addition to a few times the size of the file
LONGEST = 300  # characters of a message of the library
_PROGRAM = """
import io, sys
content = sys.stdin.buffer.read()
try:
    import resource
    used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + int(sys.argv[1]) + 8 * len(content),) * 2)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
except (ImportError, OSError, ValueError):
    pass  # no such limits on this system
import h5py, xarray

def elsewhere(name, item):
    if isinstance(item, h5py.Dataset) and (item.external or item.is_virtual):
        return name

def leading(name, link):
    if isinstance(link, h5py.ExternalLink):
        return name

try:
    with h5py.File(io.BytesIO(content), "r") as file:
        if (name := file.visititems_links(leading) or file.visititems(elsewhere)) is not None:
            raise ValueError(f"{name} is in another file, and no others are opened")
    xarray.load_dataset(io.BytesIO(content), engine="h5netcdf", decode_times=False)
except Exception as error:
    print(ascii(f"{type(error).__name__}: {error}"[:int(sys.argv[2])])[1:-1])
    sys.exit(3)
"""


def check_readable(content: bytes, path: str) -> None:
    """Raise OutputError unless a separate process reads the content of a NetCDF file in reasonable time.

    Parameters
    ----------
    content : bytes
        Content of the file.
    path : str
        Path of the file, for messages.

    Raises
    ------
    OutputError
        If the content is damaged, is not NetCDF, or refers to other files.
    """
    seconds = SECONDS + len(content) / BYTES_A_SECOND
    try:
        status, message = _read_by_another(content, seconds)
    except subprocess.TimeoutExpired:
        raise OutputError(f"is damaged: HDF5 did not finish reading it in {seconds:.0f} s", path=path) from None
    except OSError as error:
        raise OutputError(f"cannot be read: no process can be started to look at it: {error}", path=path) from None
    if status == 3:
        text = " ".join(message.decode(errors="replace").split())
        raise OutputError(f"is damaged, or is not a file of results: {text}", path=path)
    if status != 0:
        raise OutputError("is damaged: the process in which HDF5 reads it crashes", path=path)


def _read_by_another(content: bytes, seconds: float) -> tuple[int, bytes]:
    """Return the exit status and the standard output of a process that reads a file."""
    if not Path(sys.executable or "").name.startswith("python"):  # it may be an application with embedded Python
        raise OSError("this program is no interpreter of Python")
    command = [sys.executable, "-P", "-c", _PROGRAM, str(MEMORY), str(LONGEST)]
    result = subprocess.run(command, input=content, capture_output=True, timeout=seconds, check=False)
    return result.returncode, result.stdout
