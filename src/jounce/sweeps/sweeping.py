"""A sweep over all designs of a grid or a sample, on all cores or on a cluster, into a folder that can be continued."""

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool

from jounce.base.activity import Count
from jounce.design.tolerances.design_space import sample_space
from jounce.design.tolerances.variations import read_variations
from jounce.errors import DamageWarning, JounceError, MechanismError, OutputError, TrajectoryError, whole_number
from jounce.integrate.steps.methods import AbstractMethod
from jounce.io.files.reading import name_of, recording
from jounce.mechanism import Mechanism
from jounce.mechanism.time import TimeLike
from jounce.robot.robot import Robot
from jounce.sweeps.chunks import Plan
from jounce.sweeps.cluster import check_installed, compute_on_cluster
from jounce.sweeps.layout import check_room
from jounce.sweeps.manifest import LARGEST_CHUNK, check_same, manifest_of
from jounce.sweeps.problems import Motions, Problem, Quantity, Simulations, Torques
from jounce.sweeps.store import Store, create, find
from jounce.trajectory.joint_trajectory import JointTrajectory

if TYPE_CHECKING:
    import xarray

USUAL_CHUNK, SMALLEST_CHUNK = 1024, 16
NUMBERS = 4_000_000  # in the histories of a chunk
LEAST_CHUNKS = 8  # so that several workers have work


def sweep(
    model: Mechanism | Robot | str | PathLike[str],
    vary: Mapping[str, Any],
    out: str | PathLike[str],
    time: TimeLike | None = None,
    order: int = 4,
    *,
    trajectory: JointTrajectory | str | PathLike[str] | None = None,
    sample: str | None = None,
    simulate: bool = False,
    method: AbstractMethod | None = None,
    tolerance: float | None = None,
    histories: bool = False,
    workers: int | None = None,
    scheduler: str | None = None,
    timeout: float = 10.0,
    chunk: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> "xarray.Dataset":
    """Compute up to millions of designs and store their results in a Zarr folder, which the same call can continue.

    Worker processes compute chunks of designs and write them as they finish; memory does not grow with the number of
    designs. Chunks on the disk are not computed again, even after a process was killed. To the last bit, results do not
    depend on the number of workers or the order of the chunks.

    Parameters
    ----------
    model : Mechanism, Robot or path
        The model, or its file.
    vary : dict of str to object
        Variations of parameters: those of the mechanism, or for a robot ``payload.LINK`` (kg, in the origin of the
        link), ``armature.JOINT``, ``damping.JOINT``, ``friction.JOINT`` and ``speed``, a factor on that of the
        trajectory. Each is a text such as ``"3cm:5cm:101"``, (low, high, count), or a list of values, SI; with a
        sample, ``"LOW:HIGH"`` or (low, high), ``"normal:SIGMA"`` or ``"uniform:HALFWIDTH"``.
    out : path
        A folder with a name ending in .zarr. An unfinished sweep with the same settings in it is continued.
    time : array_like of shape (time,), optional
        Instants, s; by default those of the mechanism or the trajectory.
    order : int, default 4
        Highest derivative of the motion; torques of a robot have two less.
    trajectory : JointTrajectory or path, optional
        Motion of a robot.
    sample : str, optional
        ``sobol:COUNT`` draws designs from the ranges; otherwise all combinations of the values are computed.
    simulate : bool, default False
        Move the mechanism by its forces, see `simulate_batch`, rather than by its drivers, see `solve_batch`.
    method : AbstractMethod, optional
        Integrator of simulations.
    tolerance : float, optional
        Tolerance of `solve_batch` or `simulate_batch`.
    histories : bool, default False
        Store all instants in addition to statistics over time.
    workers : int, optional
        Number of processes on this machine, by default one for each core. 0 computes in this process, without Dask.
    scheduler : str, optional
        Address of a Dask cluster, such as ``tcp://host:8786``, whose workers share the folder.
    timeout : float, default 10
        Longest time to wait for an answer of the cluster, s.
    chunk : int, optional
        Number of designs computed together; by default chosen by the size of the results.
    progress : callable, optional
        Called with the number of designs on the disk and their total.

    Returns
    -------
    xarray.Dataset
        Lazily opened results: for each output NAME the arrays NAME_peak, NAME_peak_time, NAME_rms, NAME_min and
        NAME_max with the dimensions design and derivative, SI; failed_instants and first_status of every design, see
        `Status`. A design that was not solved at all instants has no statistics. With histories also NAME (design,
        time, derivative) and status (design, time). The attribute ``checksum`` identifies the sweep.

    Raises
    ------
    OutputError
        If the folder contains another sweep or other files, or cannot be written; finished chunks are kept.
    MechanismError, RobotError, TrajectoryError
        If a parameter does not exist, or the model cannot be computed.
    JounceError
        If the cluster does not answer.
    UnsupportedError
        If Zarr or Dask is not installed.

    Examples
    --------
    >>> import tempfile
    >>> import jounce as jn
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     four_bar, vary = jn.load("examples/four_bar.yaml"), {"BC": "13cm:15cm:5"}
    ...     found = jn.sweep(four_bar, vary, f"{folder}/sweep.zarr", [0.0, 0.5], 1, workers=0).load()
    >>> dict(found["psi_peak"].sizes), int(found["failed_instants"].max())
    ({'design': 5, 'derivative': 2}, 0)
    """
    with recording() as files:
        problem, title = _problem(model, trajectory, time, order, simulate, method, tolerance)
    prepared = prepare(
        problem, vary, Path(name_of(out, OutputError)), title, files, sample=sample, histories=histories, chunk=chunk
    )
    with Count("sweeping", "designs", progress) as tell:
        run(prepared, workers=workers, scheduler=scheduler, timeout=timeout, progress=tell)
    return opened(prepared.folder)


def prepare(
    problem: Problem,
    vary: Mapping[str, Any],
    folder: Path,
    title: str,
    files: Mapping[str, str],
    *,
    sample: str | None = None,
    histories: bool = False,
    chunk: int | None = None,
) -> Plan:
    """Return the plan of a sweep, in a new folder or in that of the same sweep begun before.

    Raises
    ------
    JounceError
        As for `sweep`, except for errors of workers.
    """
    check_installed("zarr")
    existing = find(folder)
    variations = read_variations(vary, problem.reader)
    unknown_names = [name for name in variations if name not in problem.nominal]
    if unknown_names:
        problem.reader(unknown_names[0], "0")  # raises the error with the known names
    space = sample_space(variations, sample, problem.nominal)
    quantities = problem.quantities()
    instants = problem.instants
    chunk = _chunk(chunk, existing, space.count, quantities, len(instants) * problem.levels)
    options = {**problem.options(), "histories": histories, "chunk": chunk}
    manifest = manifest_of(title, problem, files, space, instants, options)
    plan = Plan(problem, space, quantities, folder.absolute(), chunk, histories, manifest["identity"])
    if existing is None or (existing.is_empty() and _differs(existing, manifest, folder)):
        check_room(folder, plan.variables, space.count, chunk)
        if existing is not None:
            existing.remove()  # an earlier attempt without results
        create(folder, plan.files(manifest))
    else:
        check_same(existing.manifest, manifest, str(folder))
    return plan


def run(
    plan: Plan,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    timeout: float = 10.0,
    progress: Callable[[int, int], None] | None = None,
    user_files: Mapping[str, str] | None = None,
    prepare_worker: Callable[[], object] | None = None,
) -> str:
    """Compute the missing chunks, and return the checksum of the sweep.

    Raises
    ------
    JounceError
        As for `sweep`; finished chunks are kept.
    """
    store = plan.store
    with store.locked():
        store.clear()
        is_done = _whole(plan)
        tracker = _Progress(plan, sum(map(plan.size, np.flatnonzero(is_done).tolist())), progress)
        queue = (chunk for chunk in range(plan.chunks) if not is_done[chunk])
        if not is_done.all():
            with tracker.resumable():
                if workers == 0 and scheduler is None:
                    for chunk in queue:
                        plan.compute(chunk)
                        tracker(chunk)
                else:
                    check_installed("zarr", "distributed")
                    processes = None if workers is None else whole_number("workers", workers, 1, error=JounceError)
                    setup = {"scheduler": scheduler, "workers": processes, "timeout": timeout}
                    with store.scratch() as scratch:
                        setup["scratch"] = scratch
                        compute_on_cluster(plan, queue, tracker, **setup, user_files=user_files, prepare=prepare_worker)
        return store.finish(plan.chunks)


def _whole(plan: Plan) -> Bool[np.ndarray, " chunk"]:
    """Return the mask of complete chunks on the disk; defective chunks are discarded with a warning.

    Defective metadata and coordinates are rewritten, also with a warning.
    """
    store = plan.store
    if changed := store.restore(plan.files(store.manifest)):
        message = f"{plan.folder}: files of {', '.join(changed)} were lost or changed since, which are written again"
        warnings.warn(DamageWarning(message), stacklevel=2)
    is_done = store.done(plan.chunks)
    damaged = [k for k in np.flatnonzero(is_done).tolist() if not store.is_whole(k, k * plan.chunk, plan.size(k))]
    for chunk in damaged:
        store.forget(chunk)
        is_done[chunk] = False
    if damaged:
        count = sum(map(plan.size, damaged))
        message = f"{plan.folder}: files of {count} designs were lost or changed since, which are computed again"
        warnings.warn(DamageWarning(message), stacklevel=2)
    return is_done


def opened(folder: Path) -> "xarray.Dataset":
    """Return the lazily opened result of a sweep."""
    import xarray

    return xarray.open_zarr(folder, consolidated=True, chunks={} if _has_dask() else None)


def _differs(existing: Store, manifest: Mapping[str, Any], folder: Path) -> bool:
    try:
        check_same(existing.manifest, manifest, str(folder))
    except OutputError:
        return True
    return False


class _Progress:
    """Progress of a sweep."""

    def __init__(self, plan: Plan, done: int, progress: Callable[[int, int], None] | None):
        self.plan, self.done, self.progress = plan, done, progress
        if progress is not None and done:
            progress(done, plan.space.count)

    def __call__(self, chunk: int) -> None:
        self.done += self.plan.size(chunk)
        if self.progress is not None:
            self.progress(self.done, self.plan.space.count)

    @contextmanager
    def resumable(self) -> Any:
        """Add to errors that finished chunks are kept."""
        try:
            yield
        except JounceError as error:
            error.message += (
                f"; {self.done} of {self.plan.space.count} designs are done and kept, and the same command goes on"
            )
            raise


def _problem(
    model: Any, trajectory: Any, time: Any, order: int, simulate: bool, method: Any, tolerance: float | None
) -> tuple[Problem, str]:
    """Return the problem of a sweep, and its title."""
    model = _read(model) if isinstance(model, str | PathLike) else model
    options = {} if tolerance is None else {"tolerance": tolerance}
    if isinstance(model, Robot):
        return robot_problem(model, trajectory, time, order), model.name
    if trajectory is not None:
        raise TrajectoryError("a trajectory goes with a robot, not with a mechanism", name="trajectory")
    if simulate:
        return Simulations(model, time, order, **options, method=method), _title(model)
    if method is not None:
        raise MechanismError("a method goes with a simulation: simulate=True", name="method", value=method)
    return Motions(model, time, order, **options), _title(model)


def robot_problem(
    robot: Robot, trajectory: JointTrajectory | str | PathLike[str] | None, time: TimeLike | None, order: int
) -> Torques:
    """Return the problem of the torques of a robot, with rates to two orders less than the motion."""
    order = whole_number("order", order, 2, 30, error=MechanismError)
    if trajectory is None:
        raise TrajectoryError("a robot is swept on a trajectory: give trajectory", name="trajectory")
    if isinstance(trajectory, str | PathLike):
        from jounce.io import load_trajectory

        trajectory = load_trajectory(trajectory, robot=robot)
    return Torques(robot, trajectory, time, order - 2)


def _read(path: str | PathLike[str]) -> Mechanism | Robot:
    from jounce.io import load, load_robot
    from jounce.io.files import ROBOT_FILES

    return load_robot(path) if Path(path).suffix.lower() in ROBOT_FILES else load(path)


def _title(mechanism: Mechanism) -> str:
    return getattr(mechanism, "title", "") or "designs of a mechanism"


def _chunk(size: int | None, existing: Store | None, count: int, quantities: Sequence[Quantity], rows: int) -> int:
    """Return the number of designs of a chunk: the given one, that of a begun sweep, or by the size of results."""
    if size is not None:
        return whole_number("chunk", size, 1, LARGEST_CHUNK, error=MechanismError)
    if existing is not None:
        return existing.manifest["options"]["chunk"]
    numbers = rows * sum(math.prod(quantity.shape) for quantity in quantities)
    max_count = min(USUAL_CHUNK, NUMBERS // numbers, max(4 * SMALLEST_CHUNK, -(-count // LEAST_CHUNKS)))
    return 1 << max(SMALLEST_CHUNK, max_count).bit_length() - 1


def _has_dask() -> bool:
    from importlib.util import find_spec

    return find_spec("dask") is not None
