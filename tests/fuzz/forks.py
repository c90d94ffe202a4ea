"""NetCDF files read by forks of one process, where starting one for each would take a second: of the same program."""

from __future__ import annotations

import contextlib
import struct
import subprocess
import sys
from collections.abc import Iterator

from jounce.io import hdf5_check

_SERVER = """
import io, os, select, signal, struct, sys
import h5netcdf, h5py, xarray
good = xarray.Dataset({"a": ("time", [1.0])}, {"time": [0.0]}).to_netcdf(engine="h5netcdf")
xarray.load_dataset(io.BytesIO(bytes(good)), engine="h5netcdf")  # what this imports, no fork does again
program, answers, questions = compile(sys.argv[1], "program", "exec"), os.dup(1), sys.stdin.buffer
while head := questions.read(16):
    size, seconds = struct.unpack("<qd", head)
    content = questions.read(size)
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        status = 1
        try:
            os.dup2(writing, 1)
            os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
            sys.argv, sys.stdin = ["-c", *sys.argv[2:]], io.TextIOWrapper(io.BytesIO(content))
            exec(program, {"__name__": "__main__"})
            status = 0
        except SystemExit as end:
            status = end.code
        finally:
            sys.stdout.flush()
            os._exit(status)
    os.close(writing)
    late = not select.select([reading], [], [], seconds)[0]  # it says something, or ends
    if late:
        os.kill(child, signal.SIGKILL)
    with open(reading, "rb") as stream:
        said = stream.read()
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    os.write(answers, struct.pack("<?iq", late, code, len(said)) + said)
"""
_ANSWER = struct.calcsize("<?iq")
SECONDS = 3.0


class Forks:
    """What reads a file as `hdf5_check` does, in a fork."""

    def __init__(self) -> None:
        self.server: subprocess.Popen[bytes] | None = None

    def __call__(self, content: bytes, _seconds: float) -> tuple[int, bytes]:
        if self.server is None or self.server.poll() is not None:
            command = [sys.executable, "-P", "-c", _SERVER, hdf5_check._PROGRAM]
            command += [str(hdf5_check.MEMORY), str(hdf5_check.LONGEST)]
            self.server = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        questions, answers = self.server.stdin, self.server.stdout
        assert questions is not None
        assert answers is not None
        questions.write(struct.pack("<qd", len(content), SECONDS) + content)
        questions.flush()
        late, code, size = struct.unpack("<?iq", answers.read(_ANSWER))
        said = answers.read(size)
        if late:
            raise subprocess.TimeoutExpired("fork", SECONDS)
        return code, said


_forks = Forks()


@contextlib.contextmanager
def forked() -> Iterator[None]:
    """Have NetCDF files read by forks meanwhile."""
    before = hdf5_check._read_by_another
    hdf5_check._read_by_another = _forks
    try:
        yield
    finally:
        hdf5_check._read_by_another = before
