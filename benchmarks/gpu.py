"""The same programs on a CUDA device, in double precision, beside the cores of its machine, each in its own process.

Of each work, what a user calls is timed, arrays going to the device and coming back; and the compiled program alone,
its arrays on the device, at the width that fills it. Errors are against references of the tests, and how far the
device's results are from the processor's.
"""

import os
from collections.abc import Callable, Iterator
from functools import cache, partial
from typing import Any

import jax
import numpy as np

import jounce as jn
from benchmarks.arm import REFERENCE, arm, motion
from benchmarks.cases import EXAMPLES, CannotRunError, Case, Cases, Contestant
from benchmarks.processes import Worker
from benchmarks.references import KINEMATIC, error_of, largest_error
from jounce.kinematics.continuation.instant_program import advance_instant

os.environ.setdefault("XLA_PYTHON_CLIENT_PREALLOCATE", "false")  # several processes share the device
ON_CPU, ON_GPU = {"JAX_PLATFORMS": "cpu"}, {"JAX_PLATFORMS": "cuda,cpu"}
NEIGHBORS = 2001  # solved instants that the program alone starts from
FACTORIALS = np.array([1.0, 1.0, 2.0, 6.0, 24.0])  # derivatives from Taylor coefficients


def solve(name: str, instants: int) -> Callable[[], Any]:
    """Return what solves a mechanism as a user does; within a worker."""
    mechanism, time = jn.load(EXAMPLES / f"{name}.yaml"), np.linspace(0.0, 2.0, instants)
    return lambda: jn.solve(mechanism, time).outputs["psi"]


def program(name: str, lanes: int) -> Callable[[], Any]:
    """Return the compiled program alone: instants with all their derivatives from solved neighbors; within a worker.

    It returns what it solves, or raises ArithmeticError where an instant is not solved.
    """
    mechanism, time = jn.load(EXAMPLES / f"{name}.yaml"), np.linspace(0.0, 2.0, NEIGHBORS)
    motion = jn.solve(mechanism, time)
    model, groups = motion.model, motion._groups
    turning = [jets for jets, group in zip(groups.values(), model.system.outputs, strict=True) if group.element.turning]
    instants = np.linspace(0.0, 2.0, lanes)
    source = np.rint(instants * (NEIGHBORS - 1) / 2.0).astype(int)
    coordinates = {part: motion.poses[1][part] for part in model.pose_type.predictor}
    known = jax.tree.map(lambda x: x[..., source], (coordinates, tuple(turning), np.zeros(NEIGHBORS)))
    given = jax.device_put((known, instants - time[source], instants))
    place, names = next((k, names) for k, names in enumerate(groups) if "psi" in names)

    def run() -> Any:
        settings = np.asarray(1e-12), np.asarray(True), np.asarray(4)  # tolerance, refined, highest derivative wanted
        how = ("pose_type", model.pose_type), ("order", 4)
        arrival = advance_instant.on_xla((model.system, *settings), (*given, None, np.zeros(lanes, bool)), how)
        return jax.block_until_ready((arrival.outputs[place], arrival.status))

    jets, status = run()
    if np.any(status):
        raise ArithmeticError(f"{np.count_nonzero(status)} of {lanes} instants were not solved")
    found = np.asarray(jets)[:, 0, names.index("psi")].T * FACTORIALS

    def repeated() -> Any:
        run()
        return found

    return repeated


def torques(samples: int, inside: bool) -> Callable[[], Any]:
    """Return what computes torques and two rates of the panda: as called, or within `jax.jit` on the device."""
    robot, (q, _) = arm(), motion(samples)
    if not inside:
        return lambda: jn.inverse_dynamics(robot, q, drives=False)
    compiled, given = jax.jit(lambda q: jn.inverse_dynamics(robot, q, drives=False)), jax.device_put(q)
    return lambda: jax.block_until_ready(compiled(given))


@cache
def gpu() -> str:
    """Return the name of the first CUDA device.

    Raises
    ------
    CannotRunError
        If there is none, with what JAX says about it.
    """
    try:
        return jax.devices("cuda")[0].device_kind
    except RuntimeError as failure:
        raise CannotRunError(f"no CUDA device: {failure}") from None


def works(quick: bool) -> Iterator[tuple[str, str, int, tuple[Any, ...], Callable[[Any], float], str]]:
    """Yield title, task, size, arguments, error and reference of each work."""
    count = 10_001 if quick else 200_001
    for name, title in (("four_bar", "four-bar"), ("rsur", "RSUR")):
        error = error_of(name, np.linspace(0.0, 2.0, count), "psi")
        for task, of in (("solve", "as called"), ("program", "on the device its program alone")):
            yield f"{title} to jounce, {of}, {count:,} instants", task, count, (name, count), error, KINEMATIC
    expected = motion(21)[1]

    def error_of_torque(found: Any) -> float:
        return largest_error(found[: len(expected)], expected)

    for inside, of in ((False, "as called"), (True, "within jax.jit")):
        title = f"torque and two rates of the panda, {of}, {count:,} samples"
        yield title, "torques", count, (count, inside), error_of_torque, REFERENCE


def cases(quick: bool) -> Cases:
    """Yield each work on the device, on all cores of the machine, and on one; nothing but the reason without one."""
    try:
        gpu()
    except CannotRunError:
        yield Case("RSUR, four-bar and panda", [Contestant("jounce on a CUDA device", gpu)])
        return
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    for title, task, count, arguments, error, reference in works(quick):

        def by(
            environment: dict[str, str], given: int | None, task: str = task, arguments: tuple[Any, ...] = arguments
        ) -> Callable[[], Callable[[], Any]]:
            task = "solve" if task == "program" and environment == ON_CPU else task  # XLA's is not what solves there
            worker = partial(Worker, f"benchmarks.gpu:{task}", *arguments, environment=environment, cores=given)
            return lambda: worker().run

        alone = [Contestant("its program alone, on the device", by(ON_GPU, None, "program"), error, aim=2.0)]
        yield Case(
            title,
            [
                Contestant(f"jounce on {gpu()}", by(ON_GPU, None), error),
                *(alone if task == "solve" else ()),
                Contestant(f"jounce on {cores} cores", by(ON_CPU, None), error),
                Contestant("jounce on one core", by(ON_CPU, 1), error),
            ],
            count=count,
            unit="sample" if task == "torques" else "instant",
            reference=reference,
            clock="wall time",
            rounds=5,
        )
