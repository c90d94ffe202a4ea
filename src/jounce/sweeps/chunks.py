"""The work of one chunk of designs: a worker computes, summarizes and writes it."""

import dataclasses
import os
import re
import threading
from collections.abc import Mapping
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from jounce.base.padding import padded
from jounce.design.tolerances.design_space import Grid, Sobol
from jounce.errors import JounceError, MechanismFileError, OutputError
from jounce.execution.threads import thread_count
from jounce.io.files.reading import recording
from jounce.sweeps.layout import axes_of, files_of
from jounce.sweeps.manifest import check_same_arithmetic
from jounce.sweeps.problems import Designs, Problem, Quantity
from jounce.sweeps.statistics import Variable, stored_values, variables_of
from jounce.sweeps.store import Store

_computing = threading.Lock()
"""Lock under which a process computes one chunk at a time, with all its threads, to bound memory."""
_DESIGN = re.compile(r"\(design (\d+):")


@dataclasses.dataclass(frozen=True, eq=False)
class Plan:
    """Plan of a sweep: the problem, the designs, and the folder of the results.

    Parameters
    ----------
    problem : Problem
    space : Grid or Sobol
        Designs.
    quantities : tuple of Quantity
        Quantities of the problem.
    folder : Path
        Existing folder of the sweep.
    chunk : int
        Number of designs computed together.
    histories : bool
        Whether to keep all instants.
    identity : str
        Identity in the manifest of the folder.
    """

    problem: Problem
    space: Grid | Sobol
    quantities: tuple[Quantity, ...]
    folder: Path
    chunk: int
    histories: bool
    identity: str

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields for another process, which itself checks whether it sees the folder."""
        return {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}

    @cached_property
    def variables(self) -> list[Variable]:
        """Arrays over the designs, parameters first."""
        arguments = (self.quantities, list(self.space.variations), self.problem.levels, len(self.problem.instants))
        return variables_of(*arguments, histories=self.histories)

    @cached_property
    def names(self) -> list[str]:
        """Names of the arrays of the parameters."""
        return [variable.name for variable in self.variables[: len(self.space.variations)]]

    def files(self, manifest: Mapping[str, Any]) -> dict[str, bytes]:
        """Return the files of the folder before any chunk is computed."""
        axes = axes_of(self.quantities, self.problem.instants, self.problem.levels)
        return files_of(manifest, self.variables, axes, count=self.space.count, chunk=self.chunk)

    @property
    def chunks(self) -> int:
        """Number of chunks."""
        return -(-self.space.count // self.chunk)

    def size(self, chunk: int) -> int:
        """Return the number of designs of a chunk, which may be smaller for the last one."""
        return min(self.chunk, self.space.count - chunk * self.chunk)

    @cached_property
    def store(self) -> Store:
        """Store of the results.

        Raises
        ------
        OutputError
            If this process sees no folder or another one than the process that began the sweep, or rounds differently.
        """
        self._check_there()
        store = Store(self.folder)
        check_same_arithmetic(store.manifest, str(self.folder))
        return store

    def _check_there(self) -> None:
        """Raise OutputError unless the folder, seen from this process, is that of this sweep."""
        try:
            is_same = Store(self.folder).manifest["identity"] == self.identity
        except OutputError:
            is_same = False
        if not is_same:
            message = "a worker does not see this sweep there; workers on other machines need a folder that all share"
            raise OutputError(message, path=str(self.folder))

    def compute(self, chunk: int, threads: int | None = None) -> None:
        """Compute a chunk and write it, unless it exists.

        Raises
        ------
        JounceError
            If the parameters are not admissible, or a result cannot be written.
        """
        if self.store.is_done(chunk):
            return
        start = chunk * self.chunk
        designs = self.space.values(start, start + self.size(chunk))
        with _computing:  # the next chunk is computed while this one is written
            arrays = self._computed(designs, start, thread_count(threads))
        self._check_there()  # again, as a new client may have replaced the sweep of a killed one
        self.store.write(chunk, start, arrays)

    def _computed(self, designs: Designs, start: int, threads: int) -> dict[str, np.ndarray]:
        """Return all arrays of some designs, the first of which has the number `start`."""
        count = len(designs[next(iter(designs))])
        length = self.chunk if self.chunks > 1 else count  # chunks of one shape share a compiled program
        try:
            histories = self.problem.histories({k: padded(x, length) for k, x in designs.items()}, threads)
        except JounceError as error:
            error.message = _DESIGN.sub(lambda m: f"(design {int(m[1]) + start}:", error.message)
            raise
        settings = (self.quantities, self.problem.levels, self.problem.instants)
        stored = stored_values(histories, *settings, histories=self.histories)
        return {name: x[:count] for name, x in stored.items()} | dict(zip(self.names, designs.values(), strict=True))


@lru_cache(maxsize=1)
def _loaded(content: bytes) -> Plan:
    prepare, user_files, plan = _unpickled(content)
    if prepare is not None:
        prepare()
    if user_files:
        from jounce.io.mechanisms.user_classes import import_file

        for path, digest in user_files.items():
            with recording() as files:
                try:
                    import_file(path)
                except JounceError as error:
                    error.message += " (seen from a worker)"
                    raise
            if files[os.path.realpath(path)] != digest:
                message = "is another file where a worker is; all must have the same one, under the same path"
                raise MechanismFileError(message, path=path)
    return _unpickled(plan)


def _unpickled(content: bytes) -> Any:
    import pickle

    try:
        return pickle.loads(content)
    except Exception as error:  # noqa: BLE001 - unpickling runs code of the user
        text = " ".join(f"{type(error).__name__}: {error}".split())
        message = (
            f"a worker cannot load what is to be computed ({text}); it needs the same release of jounce as the client, "
            "and the modules that your own classes are from"
        )
        raise JounceError(message) from None


def compute_on_worker(content: bytes, chunk: int, threads: int | None) -> int:
    """Compute a chunk of a pickled plan in a worker of a cluster, by default with all its threads."""
    from distributed import get_worker

    _loaded(content).compute(chunk, get_worker().state.nthreads if threads is None else threads)
    return chunk
