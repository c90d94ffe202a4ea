"""The work of one chunk of designs: computed, summarised and written where it is computed, by one worker or another."""

import dataclasses
import re
import threading
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np

from jounce.design.design_space import Grid, Sobol
from jounce.errors import JounceError, OutputError
from jounce.kinematics.threads import thread_count
from jounce.sweeps.manifest import check_same_arithmetic
from jounce.sweeps.problems import Designs, Problem, Quantity
from jounce.sweeps.statistics import kept_values
from jounce.sweeps.store import Store

_computing = threading.Lock()
"""One chunk at a time is computed in a process, whose threads share it: memory is bounded by the processes."""
_DESIGN = re.compile(r"\(design (\d+):")


@dataclasses.dataclass(frozen=True, eq=False)
class Plan:
    """What is computed, of which designs, and where it goes.

    Parameters
    ----------
    problem : Problem
    space : Grid or Sobol
        Designs.
    quantities : tuple of Quantity
        Of the problem.
    folder : Path
        Of the sweep, which is there.
    chunk : int
        Designs that are computed together.
    histories : bool
        Whether all instants are kept.
    names : tuple of str
        Arrays in which the parameters are kept.
    identity : str
        Of the folder's manifest.
    """

    problem: Problem
    space: Grid | Sobol
    quantities: tuple[Quantity, ...]
    folder: Path
    chunk: int
    histories: bool
    names: tuple[str, ...]
    identity: str

    @property
    def chunks(self) -> int:
        """How many chunks there are."""
        return -(-self.space.count // self.chunk)

    def size(self, chunk: int) -> int:
        """Return how many designs a chunk has; the last one may have fewer."""
        return min(self.chunk, self.space.count - chunk * self.chunk)

    @cached_property
    def store(self) -> Store:
        """Where the results go.

        Raises
        ------
        OutputError
            This process sees another folder than the one that began the sweep, or none, or rounds otherwise.
        """
        store = Store(self.folder)
        try:
            same = store.manifest["identity"] == self.identity
        except (KeyError, ValueError):
            same = False
        if not same:
            message = "a worker does not see this folder; workers on other machines need one that all of them share"
            raise OutputError(message, path=str(self.folder))
        check_same_arithmetic(store.manifest, str(self.folder))
        return store

    def compute(self, chunk: int, threads: int | None = None) -> None:
        """Compute a chunk and write it, unless it is there.

        Raises
        ------
        JounceError
            No mechanism may have the parameters, or a result cannot be written.
        """
        if self.store.is_done(chunk):
            return
        start = chunk * self.chunk
        designs = self.space.values(start, start + self.size(chunk))
        with _computing:  # and another one is computed while this one is written
            arrays = self._computed(designs, start, thread_count(threads))
        self.store.write(chunk, start, arrays)

    def _computed(self, designs: Designs, start: int, threads: int) -> dict[str, np.ndarray]:
        """Return all arrays of some designs, the first of which has a number."""
        count = len(designs[next(iter(designs))])
        spare = self.chunk - count if self.chunks > 1 else 0  # one shape of all chunks compiles once
        filled = {name: np.concatenate([x, np.repeat(x[-1:], spare)]) for name, x in designs.items()}
        try:
            found = self.problem.histories(filled, threads)
        except JounceError as error:
            error.message = _DESIGN.sub(lambda m: f"(design {int(m[1]) + start}:", error.message)
            raise
        settings = (self.quantities, self.problem.levels, self.problem.instants)
        kept = kept_values(found, *settings, histories=self.histories)
        return {name: x[:count] for name, x in kept.items()} | dict(zip(self.names, designs.values(), strict=True))


@lru_cache(maxsize=1)
def _loaded(content: bytes) -> Plan:
    import pickle

    prepare, user_files, plan = pickle.loads(content)
    if prepare is not None:
        prepare()
    if user_files:
        from jounce.io.mechanisms.user_classes import import_file
        from jounce.kinematics.store import keep_programs

        keep_programs(None)  # what is compiled may be other than this package says
        for path in user_files:
            import_file(path)
    return pickle.loads(plan)


def compute_on_worker(content: bytes, chunk: int, threads: int | None) -> int:
    """Compute a chunk of a pickled plan in a worker of a cluster, with some threads or all that it has."""
    from distributed import get_worker

    _loaded(content).compute(chunk, get_worker().state.nthreads if threads is None else threads)
    return chunk
