"""Workers of a sweep: the cores of this machine or a Dask cluster; chunks of a lost worker are computed by others."""

import logging
import multiprocessing
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from itertools import islice
from pathlib import Path
from typing import Any

from jounce.base.interrupts import interrupts_shielded
from jounce.errors import JounceError, UnsupportedError
from jounce.execution.threads import thread_count
from jounce.sweeps.chunks import Plan, compute_on_worker
from jounce.sweeps.manifest import versions

AHEAD = 2  # queued chunks for each thread of the cluster
POLL = 5.0  # s
PATIENCE = 60.0  # s without any worker
FOR_WORKERS = {
    "PJRT_NPROC": "1",  # a worker has one core, and more threads of XLA would take those of other workers
    "PYTHONSAFEPATH": "1",  # workers start by `python -c`, which would import a signal.py from the current folder
}
GUARD = "put what it does below 'if __name__ == \"__main__\":', or sweep with workers=0, in this process"
MISSING = "needs {}, which is not installed; install it with: pip install 'jounce[sweep]'"


class ClusterError(JounceError):
    """Raised if the cluster does not answer, or is lost."""


def check_installed(*packages: str) -> None:
    """Raise UnsupportedError unless packages are installed."""
    from importlib.util import find_spec

    missing_packages = [package for package in packages if find_spec(package) is None]
    if missing_packages:
        raise UnsupportedError(f"a sweep {MISSING.format(' and '.join(missing_packages))}")


def compute_on_cluster(
    plan: Plan,
    chunks: Iterable[int],
    done: Callable[[int], None],
    *,
    scheduler: str | None,
    workers: int | None,
    timeout: float,
    scratch: Path,
    user_files: Mapping[str, str] | None = None,
    prepare: Callable[[], object] | None = None,
) -> None:
    """Compute chunks on the workers of a cluster, which write their results.

    Parameters
    ----------
    plan : Plan
    chunks : iterable of int
        Chunks to compute.
    done : callable
        Called with each chunk once it is on the disk.
    scheduler : str, optional
        Address of a cluster; by default one is started on this machine.
    workers : int, optional
        Processes on this machine.
    timeout : float
        Longest time to wait for an answer, s.
    scratch : Path
        Folder for temporary files of workers on this machine.
    user_files : dict of str to str, optional
        Digests of Python files with classes of the user, by their paths.
    prepare : callable, optional
        Function that each worker calls first.

    Raises
    ------
    ClusterError
        If the cluster does not answer, or is lost.
    JounceError
        If a chunk cannot be computed or written.
    """
    import cloudpickle

    content = cloudpickle.dumps((prepare, user_files, cloudpickle.dumps(plan)))
    with _client(scheduler, workers, timeout, scratch) as client:
        if scheduler is not None:
            _check_releases(client, timeout)
        _compute(client, content, iter(chunks), done, threads=1 if scheduler is None else None)


def _check_releases(client: Any, timeout: float) -> None:
    """Raise ClusterError unless all workers have the same releases of numerical packages as this process.

    Workers that join later compare their releases with the manifest.
    """
    names = list(versions())
    try:
        releases = client.sync(client._get_versions, packages=names, callback_timeout=max(timeout, PATIENCE))
    except (OSError, TimeoutError) as error:
        raise _lost(error) from None
    client_releases = {name: releases["client"]["packages"].get(name) for name in names}  # in the same format
    for address, worker in sorted(releases["workers"].items()):
        packages = worker["packages"] if isinstance(worker, dict) else {}
        for name, release in client_releases.items():
            if packages.get(name) != release:
                installed = f"has {name} {packages[name]}" if packages.get(name) else f"has no {name}"
                message = f"the worker {address} {installed}, the client has {release}; all must have the same release"
                raise ClusterError(message, name="scheduler")


def _compute(
    client: Any, content: bytes, chunks: Iterator[int], done: Callable[[int], None], *, threads: int | None
) -> None:
    """Compute chunks, with a bounded number submitted at a time."""
    import distributed

    wait: Any = distributed.wait
    plan = client.submit(bytes, content, pure=False)  # a task, which the cluster repeats for new workers
    max_pending = max(2, AHEAD * sum(client.nthreads().values()))

    def submitted(count: int) -> set[Any]:
        return {client.submit(compute_on_worker, plan, chunk, threads, pure=False) for chunk in islice(chunks, count)}

    waiting, idle = submitted(max_pending), 0.0
    while waiting:
        try:
            finished = wait(waiting, timeout=POLL, return_when="FIRST_COMPLETED").done
            idle = 0.0
        except TimeoutError:
            finished = set()
            idle = 0.0 if client.status == "running" and client.nthreads() else idle + POLL
        except Exception as error:  # noqa: BLE001 - CancelledError and other exceptions of a lost connection
            raise _lost(error) from None
        for future in finished:
            if future.status != "finished":
                raise _reason(future)
            done(future.result())
        waiting -= finished
        if client.status != "running" or idle > PATIENCE:
            raise _lost(f"status {client.status}, no worker for {idle:g} s")
        waiting |= submitted(max_pending - len(waiting))


def _reason(future: Any) -> Exception:
    """Return the error of a task, with errors of Dask translated."""
    if future.status != "error":
        return _lost(future.status)
    error = future.exception()
    if isinstance(error, JounceError):
        return error
    if type(error).__name__ == "KilledWorker":
        return ClusterError("several workers ended while computing the same chunk; do they lack memory?")
    return error if isinstance(error, Exception) else RuntimeError(str(error))


def _lost(reason: object) -> ClusterError:
    message = str(reason).strip().partition("\n")[0].rstrip(": ") or type(reason).__name__
    return ClusterError(f"the cluster was lost: its scheduler or all of its workers do not answer ({message})")


@contextmanager
def _client(scheduler: str | None, workers: int | None, timeout: float, scratch: Path) -> Iterator[Any]:
    """Yield a client of a cluster, which is started on this machine unless an address is given."""
    from distributed import Client

    with _dask_silenced(), ExitStack() as closing:
        if scheduler is None:
            closing.enter_context(_environment())
            cluster = closing.enter_context(_local(thread_count(workers), scratch))
            yield closing.enter_context(Client(cluster))
            return
        try:
            client = closing.enter_context(Client(scheduler, timeout=timeout))
        except (OSError, ValueError, ImportError) as error:  # TimeoutError is an OSError
            text = str(error).strip().partition("\n")[0]
            message = f"no Dask scheduler answers within {timeout:g} s: {text or type(error).__name__}"
            raise ClusterError(message, name="scheduler", value=scheduler) from None
        try:
            client.wait_for_workers(1, timeout=timeout)
        except TimeoutError:
            message = f"the cluster has no workers, and none joined within {timeout:g} s"
            raise ClusterError(message, name="scheduler", value=scheduler) from None
        yield client


@contextmanager
def _environment() -> Iterator[None]:
    """Set environment variables for workers, and restore them afterwards, which Dask does not."""
    previous = {name: os.environ.get(name) for name in FOR_WORKERS}
    os.environ.update({name: os.environ.get(name) or value for name, value in FOR_WORKERS.items()})
    try:
        yield
    finally:
        for name, value in previous.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _local(count: int, scratch: Path) -> Any:
    """Start worker processes on this machine."""
    import dask.config
    from distributed import LocalCluster

    if getattr(multiprocessing.current_process(), "_inheriting", False):
        raise UnsupportedError(f"a worker process runs the script that starts it: {GUARD}")
    settings: dict[str, Any] = {"dashboard_address": None, "memory_limit": 0, "silence_logs": logging.CRITICAL}
    # the dashboard is off, but its server starts: on any port, for this machine only
    settings["scheduler_kwargs"] = {"dashboard": False, "dashboard_address": "127.0.0.1:0"}
    lean = {
        "temporary-directory": str(scratch),
        "distributed.worker.use-file-locking": False,  # no other process uses this folder
        "distributed.worker.profile.enabled": False,  # it samples all stacks a hundred times a second
        # without MALLOC_TRIM_THRESHOLD_ of Dask, with which every large array gets new pages
        "distributed.nanny.pre-spawn-environ": {name: os.environ[name] for name in FOR_WORKERS},
    }
    try:
        _track_quietly()
        with dask.config.set(lean), interrupts_shielded():
            return LocalCluster(n_workers=count, threads_per_worker=1, processes=True, **settings)
    except (OSError, RuntimeError) as error:
        raise ClusterError(f"the workers did not start ({error}); if this is a script: {GUARD}") from None


def _track_quietly() -> None:
    """Start the resource tracker, which removes semaphores after this process, with its warnings silenced.

    If a signal kills this process, semaphores are left to the tracker.
    """
    from multiprocessing import resource_tracker

    previous = sys.warnoptions
    sys.warnoptions = [*previous, "ignore:resource_tracker:UserWarning"]
    try:
        resource_tracker.ensure_running()
    finally:
        sys.warnoptions = previous


@contextmanager
def _dask_silenced() -> Iterator[None]:
    """Silence the messages of Dask on lost connections, which this package reports itself."""
    names = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] == "distributed"]
    levels = {name: logging.getLogger(name).level for name in names}
    for name in names:
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for name, level in levels.items():
            logging.getLogger(name).setLevel(level)
