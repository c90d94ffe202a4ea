"""NetCDF files read first by a process of their own: HDF5 may wait for ever in a damaged file, or end its process."""

from __future__ import annotations

import subprocess
import sys

from jounce.errors import OutputError

SECONDS, BYTES_A_SECOND = 20.0, 10e6
MEMORY = 2**30  # bytes beside a few times the file
LONGEST = 300  # characters of a message of the library
_PROGRAM = """
import io, sys
content = sys.stdin.buffer.read()
try:
    import resource
    used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + int(sys.argv[1]) + 8 * len(content),) * 2)
except (ImportError, OSError, ValueError):
    pass  # no such limit on this system
import xarray
try:
    xarray.load_dataset(io.BytesIO(content), engine="h5netcdf")
except Exception as error:
    print(f"{type(error).__name__}: {error}"[:int(sys.argv[2])])
    sys.exit(3)
"""


def check_readable(content: bytes, path: str) -> None:
    """Raise OutputError unless a process of its own reads the content of a NetCDF file in reasonable time.

    Parameters
    ----------
    content : bytes
        Of the file.
    path : str
        The file, for messages.

    Raises
    ------
    OutputError
        The content is damaged, or not one of NetCDF.
    """
    command = [sys.executable, "-P", "-c", _PROGRAM, str(MEMORY), str(LONGEST)]
    seconds = SECONDS + len(content) / BYTES_A_SECOND
    try:
        done = subprocess.run(command, input=content, capture_output=True, timeout=seconds, check=False)
    except subprocess.TimeoutExpired:
        raise OutputError(f"is damaged: HDF5 does not come to an end with it in {seconds:.0f} s", path=path) from None
    except OSError as error:
        raise OutputError(f"cannot be read: no process can be started to look at it: {error}", path=path) from None
    if done.returncode == 3:
        said = ascii(" ".join(done.stdout.decode(errors="replace").split()))[1:-1]
        raise OutputError(f"is damaged, or no file of results: {said}", path=path)
    if done.returncode != 0:
        raise OutputError("is damaged: HDF5 ends the process that reads it", path=path)
