"""Many simulations of one robot in joint coordinates that differ in where they begin and in masses of links."""

import functools
import inspect
from collections.abc import Callable, Mapping
from typing import Any, ParamSpec, TypeVar

import jax.numpy as jnp
import numpy as np

from jounce.base.shapes import ArrayLike, is_traced
from jounce.errors import JounceError, RobotError, no_such
from jounce.execution.backends import joined
from jounce.execution.threads import Threads, thread_count
from jounce.integrate.marching.robot_state import start_levels
from jounce.integrate.results.batch import Batch
from jounce.integrate.results.robot_sensitivities import TracedRobotBatch, of_traced_robots
from jounce.integrate.results.robot_simulation import RobotSimulation
from jounce.integrate.simulate_robot import simulate_robot
from jounce.integrate.steps.methods import AbstractMethod
from jounce.integrate.steps.options import checked_options, instants_of
from jounce.kinematics.families.parameter_values import checked_values
from jounce.mechanism import TimeGrid
from jounce.robot.robot import Robot

RATE, MASS = ".rate", ".mass"

P = ParamSpec("P")
R = TypeVar("R")


def of_traced_robot_batches(guarded: Callable[P, R]) -> Callable[P, R]:
    """Return what simulates batches, also of robots of which JAX traces something; their joints are outputs."""
    signature = inspect.signature(guarded)

    @functools.wraps(guarded)
    def door(*arguments: P.args, **keywords: P.kwargs) -> R:
        robot: Any = arguments[0] if arguments else keywords.get("mechanism")
        if not isinstance(robot, Robot) or robot.closures or not is_traced((robot.tree, arguments[1:], keywords)):
            return guarded(*arguments, **keywords)
        bound = signature.bind(*arguments, **keywords)
        bound.apply_defaults()
        given = dict(bound.arguments)
        values, motions = simulate_robots(given.pop("mechanism"), **given.pop("robot"), **given)
        q = jnp.stack([motion.q for motion in motions])
        outputs = {name: q[..., k] for k, name in enumerate(robot.joint_names)}
        batch: Any = TracedRobotBatch(robot, motions[0].time, motions[0].order, values, outputs)
        return batch

    return door


def batch_of_robot(robot: Robot, values: dict[str, np.ndarray], runs: list[RobotSimulation]) -> Batch:
    """Return the runs of a robot, its joints as outputs."""
    q = np.stack([run.q for run in runs])
    outputs = {name: q[..., k] for k, name in enumerate(runs[0].robot.joint_names)}
    steps, status = np.array([len(run.steps.start) for run in runs]), np.stack([run.status for run in runs])
    backend = joined(name for run in runs for name in run.backend.split(", "))
    return Batch(runs[0].time, values, outputs, status, steps, robot, runs[0].order, backend)


def simulate_robots(
    robot: Robot,
    parameters: Mapping[str, Any],
    time: ArrayLike | TimeGrid | None,
    order: int,
    *,
    method: AbstractMethod | None,
    tolerance: float,
    longest_step: float,
    **options: Any,
) -> tuple[dict[str, Any], list[Any]]:
    """Return what runs differ in, by name, and each run; see `jounce.simulate_batch`.

    Runs of which JAX traces something are motions that have derivatives.

    Raises
    ------
    RobotError
        A name is none of those that runs may differ in, values are not finite or of unequal number, or a mass is none.
    """
    order, method = checked_options(order, method, tolerance, longest_step)
    options |= {"method": method, "tolerance": float(tolerance), "longest_step": float(longest_step)}
    instants = instants_of(time, {})
    if options.get("base") is not None:
        message = "a batch has no free base by quaternions; give the robot one by robot.with_floating_base()"
        raise RobotError(message, name="base")
    state = options.pop("state", None)
    traced = is_traced((dict(parameters), robot.tree, state))
    values = _checked(robot, parameters)
    start = start_levels(robot, state)

    def begun(k: int) -> tuple[Robot, Any]:
        state, changed = start.copy(), robot
        for name, given in values.items():
            joint, level = (name.removesuffix(RATE), 1) if name not in robot.joint_names else (name, 0)
            if joint in robot.joint_names:
                column = robot.joint_names.index(joint)
                if traced:
                    state = jnp.asarray(state).at[level, column].set(given[k])
                else:
                    state[level, column] = given[k]
            else:
                mass = given[k] if traced else float(given[k])
                changed = changed.with_inertia(name.removesuffix(MASS), mass=mass)
        return changed, state

    starts = []
    for k in range(len(next(iter(values.values())))):
        try:
            starts.append(begun(k))
        except JounceError as error:
            error.name = f"runs.{k}" if error.name is None else f"runs.{k}.{error.name}"
            raise

    if traced:  # one after another, as JAX traces in one thread; what fails has no derivatives, and raises
        follow = of_traced_robots(simulate_robot)
        return values, [follow(own, instants, order, state=state, **options) for own, state in starts]

    def run(at: tuple[Robot, np.ndarray]) -> RobotSimulation:
        return simulate_robot(at[0], instants, order, state=at[1], strict=False, **options)

    with Threads(thread_count()) as pool:
        return values, list(pool.map(run, starts))


def _checked(robot: Robot, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return what runs differ in, by name, each of shape (runs,)."""
    massive = [name for name, link in robot.links.items() if link.inertia is not None]
    valid = [*robot.joint_names, *(x + RATE for x in robot.joint_names), *(x + MASS for x in massive)]

    def check(name: str) -> None:
        if name not in valid:
            message = no_such("joint, JOINT.rate or LINK.mass", name, valid)
            raise RobotError(message, name="parameters", value=name)

    return checked_values(parameters, "run", check, RobotError)
