"""Many simulations of one robot in joint coordinates, with different initial states and link masses."""

import inspect
from collections.abc import Callable, Mapping
from typing import Any

import jax.numpy as jnp
import numpy as np

from jounce.base.shapes import ArrayLike, is_traced
from jounce.errors import JounceError, RobotError, no_such
from jounce.execution.backends import joined
from jounce.execution.threads import Threads, thread_count
from jounce.integrate.marching.robot_state import start_levels
from jounce.integrate.results.batch import Batch
from jounce.integrate.results.robot_sensitivities import TracedRobotMotion, traced_robot_motion
from jounce.integrate.results.robot_simulation import RobotSimulation
from jounce.integrate.simulate_robot import simulate_robot
from jounce.integrate.steps.methods import AbstractMethod
from jounce.integrate.steps.options import checked_options, instants_of
from jounce.kinematics.families.parameter_values import by_parameter, checked_values
from jounce.mechanism import TimeGrid
from jounce.robot.robot import Robot

RATE, MASS = ".rate", ".mass"


def traced_robot_batch(guarded: Callable[..., Any], robot: Robot, *arguments: Any, **keywords: Any) -> Batch:
    """Return a batch of a robot with traced values, by the function under its guard against tracers."""
    return inspect.unwrap(guarded)(robot, *arguments, **keywords)


def simulate_robots(
    robot: Robot,
    parameters: Any,
    time: ArrayLike | TimeGrid | None,
    order: int,
    *,
    method: AbstractMethod | None,
    tolerance: float,
    longest_step: float,
    **options: Any,
) -> Batch:
    """Return the runs of a robot, with its joints as outputs; see `jounce.simulate_batch`.

    Outputs are JAX arrays with derivatives if JAX traces any values.

    Raises
    ------
    RobotError
        If a name is not that of a parameter of runs, values are not finite, their numbers differ, or a mass is not
        valid.
    """
    order, method = checked_options(order, method, tolerance, longest_step)
    options |= {"method": method, "tolerance": float(tolerance), "longest_step": float(longest_step)}
    instants = instants_of(time, {})
    if options.get("base") is not None:
        message = "a batch has no free base by quaternions; give the robot one by robot.with_floating_base()"
        raise RobotError(message, name="base")
    state = options.pop("state", None)
    parameters = by_parameter(parameters, "run", RobotError)
    traced = is_traced((parameters, robot.tree, state))
    values = _checked(robot, parameters)
    start = start_levels(robot, state)

    def start_of_run(k: int) -> tuple[Robot, Any]:
        levels, variant = [list(level) for level in start], robot
        for name, given in values.items():
            value = given[k] if traced else float(given[k])
            joint, level = (name.removesuffix(RATE), 1) if name not in robot.joint_names else (name, 0)
            if joint in robot.joint_names:
                levels[level][robot.joint_names.index(joint)] = value
            else:
                variant = variant.with_inertia(name.removesuffix(MASS), mass=value)
        return variant, levels

    starts = []
    for k in range(len(next(iter(values.values())))):
        try:
            starts.append(start_of_run(k))
        except JounceError as error:
            error.name = f"runs.{k}" if error.name is None else f"runs.{k}.{error.name}"
            raise

    def run(start: tuple[Robot, Any]) -> RobotSimulation:
        return simulate_robot(start[0], instants, order, state=start[1], **options)

    def traced_run(start: tuple[Robot, Any]) -> TracedRobotMotion:
        return traced_robot_motion(simulate_robot, start[0], instants, order, state=start[1], **options)

    options["strict"] = traced  # a traced run that fails has no derivatives, and raises
    q: Any
    if traced:  # one after another, since JAX traces in one thread
        motions = list(map(traced_run, starts))
        runs, q = [motion.simulation for motion in motions], jnp.stack([motion.q for motion in motions])
    else:
        with Threads(thread_count()) as pool:
            runs = list(pool.map(run, starts))
        q = np.stack([run.q for run in runs])
    outputs = {name: q[..., k] for k, name in enumerate(robot.joint_names)}
    steps, status = np.array([len(run.steps.start) for run in runs]), np.stack([run.status for run in runs])
    backend = joined(name for run in runs for name in run.backend.split(", "))
    return Batch(instants, values, outputs, status, steps, robot, order, backend)


def _checked(robot: Robot, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters of runs by name, each of shape (runs,)."""
    massive = [name for name, link in robot.links.items() if link.inertia is not None]
    valid = [*robot.joint_names, *(x + RATE for x in robot.joint_names), *(x + MASS for x in massive)]

    def check(name: str) -> None:
        if name not in valid:
            message = no_such("joint, JOINT.rate or LINK.mass", name, valid)
            raise RobotError(message, name="parameters", value=name)

    return checked_values(parameters, "run", check, RobotError)
