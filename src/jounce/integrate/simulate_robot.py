"""The simulation of a robot under joint forces, in joint coordinates."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypedDict

import jax
import numpy as np
from jaxtyping import Float, Int

from jounce.base.activity import Count
from jounce.base.shapes import ArrayLike, is_traced
from jounce.errors import JounceError, MechanismError, RobotError, UnsupportedError, check_name, did_you_mean, flag
from jounce.integrate.marching.exact_numbers import ExactNumbers
from jounce.integrate.marching.joint_events import JointEvent, JointEventDetector
from jounce.integrate.marching.marching import Outcome, RunLimits, steps_between_looks
from jounce.integrate.marching.robot_marching import STUCK, Progress, RobotProblem, RobotSteps, march_robot
from jounce.integrate.marching.robot_state import RobotState, start_levels
from jounce.integrate.marching.runs import AbstractRun
from jounce.integrate.results.robot_simulation import RobotSimulation
from jounce.integrate.steps.methods import AbstractMethod, Taylor
from jounce.integrate.steps.options import SimulationOptions
from jounce.kinematics import Status
from jounce.kinematics.position_analysis.solve import raise_for_status
from jounce.robot.algorithms.base_motion import BaseMotion, base_arrays, base_body
from jounce.robot.algorithms.wrench_laws import wrench_laws
from jounce.robot.algorithms.wrenches import Wrench
from jounce.robot.model.joint_laws import GivenLaws, joint_laws
from jounce.robot.model.robot_size import robot_size
from jounce.robot.recursions.tree_equations import TreeEquations
from jounce.robot.robot import Robot
from jounce.trajectory.laws.user_laws import law_or_number

MOST = 1_000_000  # attempted steps of a run
SHARES = np.linspace(0.0, 1.0, 33)  # of a step, at which driven joints are compared with their laws
ASTRAY = 1e-9  # rad or sizes of the robot, or 100 tolerances: farther from its law a driven joint has left it
ROUNDS = 8  # of as many instants each, between two of these, to find when it left it


class RobotOptions(TypedDict, total=False):
    """The options of `jounce.simulate` that are for robots in joint coordinates."""

    state: ArrayLike | Mapping[str, float] | None
    torque: GivenLaws | None
    driven: Mapping[str, Any] | None
    drives: bool
    base: BaseMotion | None
    wrenches: Sequence[Wrench]


ROBOT_OPTIONS = tuple(RobotOptions.__annotations__)


class RobotSimulationOptions(SimulationOptions, RobotOptions, total=False):
    """All options of `jounce.simulate` for robots."""


def check_robot_options(mechanism: object, given: Mapping[str, Any]) -> None:
    """Raise JounceError for an unknown option, or for an option of robots in the simulation of a mechanism."""
    for name in given:
        if name not in ROBOT_OPTIONS:
            raise JounceError(f"simulate has no such option; {did_you_mean(name, ROBOT_OPTIONS)}", name=name)
        if not isinstance(mechanism, Robot):
            message = "belongs to simulations of robots in joint coordinates; a mechanism has forces and `initial`"
            raise MechanismError(message, name=name)


def simulate_robot(
    robot: Robot,
    instants: np.ndarray,
    order: int,
    *,
    state: ArrayLike | Mapping[str, float] | None = None,
    torque: GivenLaws | None = None,
    driven: Mapping[str, Any] | None = None,
    drives: bool = True,
    base: BaseMotion | None = None,
    wrenches: Sequence[Wrench] = (),
    method: AbstractMethod,
    tolerance: float,
    events: Sequence[JointEvent] = (),
    longest_step: float,
    strict: bool,
    progress: Callable[[int, int], None] | None = None,
) -> RobotSimulation:
    """Return the motion of a robot; see `jounce.simulate`, which checks the options of all simulations."""
    if robot.closures:
        message = "this robot has loops; simulate the mechanism that it is: jn.simulate(robot.mechanism(...), ...)"
        raise RobotError(message, name=robot.name, value=list(robot.closures))
    problem = _problem(robot, torque, driven, flag("drives", drives, error=RobotError), base, wrenches)
    start = _start(robot, problem, state, base, float(instants[0]))
    for event in events:
        if not isinstance(event, JointEvent):
            raise RobotError("must be a jn.integrate.JointEvent", name="events", value=event)
    detectors = [JointEventDetector(event, robot) for event in events]
    if not isinstance(method, Taylor):
        raise RobotError("robots are simulated by jn.Taylor", name="method", value=type(method).__name__)
    longest = longest_step if method.step is None else method.step
    limits = RunLimits(*map(np.float64, (instants[-1], tolerance, longest, instants[0])))
    run = RobotRun(problem, robot.joint_names, start, method.expansion_order(tolerance) - 1, limits, detectors)
    with Count("simulating", report=progress) as tell:
        run.go(instants, tell)
    outcome = run.ending, run.happened, tuple(wrenches), run.backends
    simulation = RobotSimulation(robot, problem, run.steps, instants, order, *outcome)
    if strict and run.stopped_at is None:
        raise_for_status(simulation)
    return simulation


def _problem(
    robot: Robot,
    torque: GivenLaws | None,
    driven: Mapping[str, Any] | None,
    drives: bool,
    base: BaseMotion | None,
    wrenches: Sequence[Wrench],
) -> RobotProblem:
    if is_traced(robot.tree):
        raise UnsupportedError("simulations of robots are not differentiated; jn.forward_dynamics is", name=robot.name)
    names, tree = robot.joint_names, robot.tree
    given = {} if driven is None else driven
    if not isinstance(given, Mapping):
        raise RobotError("must be a mapping of joints to laws of time", name="driven", value=driven)
    for name in given:
        check_name("moving joint", name, names, RobotError, name="driven")
    laws = {name: law_or_number("driven", name, law, RobotError) for name, law in given.items()}
    prescribed = joint_laws(names, laws, "driven")
    mask = np.array([float(name in given) for name in names])
    length = robot_size(robot)
    scale = np.array([1.0 if robot.joints[name].turning else length for name in names])
    body = None if base is None else base_body(robot)
    pushes, frames, global_axes = wrench_laws(robot, wrenches, free=base is not None)
    equations = TreeEquations(tree, mask, body, frames, global_axes, drives)
    return RobotProblem(equations, joint_laws(names, torque), prescribed, scale, np.float64(length), pushes)


def _start(
    robot: Robot,
    problem: RobotProblem,
    state: ArrayLike | Mapping[str, float] | None,
    base: BaseMotion | None,
    instant: float,
) -> RobotState:
    """Return the initial state, with driven joints on their laws."""
    levels, mask = start_levels(robot, state), np.asarray(problem.equations.driven)
    if mask.any():
        time = np.array([[instant]])
        laws = np.asarray(problem.prescribed_series(np.zeros_like(levels[:1].T), time, 1))[..., 0]
        levels = np.where(mask > 0, laws, levels)
    q, rates = levels[0][:, None], levels[1][:, None]
    if base is None:
        return RobotState(q, rates)
    pose, twist = (np.asarray(x) for x in base_arrays(base, (), 1))
    if not (np.isfinite(pose).all() and np.isfinite(twist).all()):
        raise RobotError("must be finite", name="base")
    return RobotState(q, rates, pose[0, :3, None], pose[0, 3:, None], twist[0][:, None])


class RobotRun(AbstractRun):
    """A run of a robot by series of a fixed order."""

    def __init__(
        self,
        problem: RobotProblem,
        names: Sequence[str],
        start: RobotState,
        order: int,
        limits: RunLimits,
        detectors: list[JointEventDetector],
    ):
        running, none, zeros = np.asarray(int(Outcome.RUNNING)), np.asarray(0), np.zeros(1)
        initial = Progress(np.array([limits.start]), start, running, none, none, zeros, zeros)
        super().__init__(initial, limits, detectors)
        self.problem, self.names, self.tried = problem, names, 0
        self.left = ""  # the driven joint that left its law, in words
        count = steps_between_looks((order + 2) * 2 * len(problem.scale), watched=bool(detectors))
        self._settings: Any = {"order": order, "count": count, "exact": ExactNumbers.of_parallel(problem.equations)}

    def attempted(self) -> tuple[Any, tuple[Any, Any], Any]:
        """See `AbstractRun`."""
        try:
            current, steps, count = march_robot(self.problem, self.current, self.limits, **self._settings)
        except TypeError as error:
            if "has no rule for Taylor series" not in str(error):
                raise
            message = f"{error}; a law of a joint uses it: write it with other operations"
            raise UnsupportedError(message, name="torque") from error
        self.tried += int(count)
        if self.tried > MOST and int(current.outcome) == Outcome.RUNNING:
            current = current._replace(outcome=np.asarray(int(Outcome.COLLAPSED)))
        return current, steps, count

    def _march(self) -> RobotSteps | None:
        """Attempt some steps, and return them up to the first instant at which a driven joint leaves its law.

        The equations have accelerations of laws only, so that a jump of a law or of its velocity leaves no other trace.
        """
        steps = super()._march()
        if steps is None or not self.problem.prescribed.changing:
            return steps
        starts, lengths = steps.start, steps.length
        errors = self._departures(steps, np.repeat(np.arange(len(starts)), len(SHARES)), np.tile(SHARES, len(starts)))
        errors, limit = errors.reshape(-1, len(starts), len(SHARES)), max(ASTRAY, 100.0 * float(self.limits.tolerance))
        is_astray = np.abs(errors - errors[..., :1]) > limit
        if not is_astray.any():
            return steps
        step = int(np.argmax(is_astray.any(axis=(0, 2))))
        point = int(np.argmax(is_astray[:, step].any(axis=0)))
        joint, (low, high) = int(np.argmax(is_astray[:, step, point])), SHARES[point - 1 : point + 1]
        for _ in range(ROUNDS):
            fractions = low + SHARES * (high - low)
            gap = self._departures(steps, np.full(len(SHARES), step), fractions)[joint] - errors[joint, step, 0]
            point = max(int(np.argmax(np.abs(gap) > limit)), 1)
            low, high = fractions[point - 1 : point + 1]
        instant = starts[step] + low * lengths[step]
        self.left = f"driven.{self.names[joint]}: the law or its velocity jumps at t = {instant:g} s: make it smooth"
        self.current = self.current._replace(outcome=np.asarray(int(Outcome.COLLAPSED)))
        cut = jax.tree.map(lambda part: part[: step + 1], steps)
        return cut._replace(length=np.append(lengths[:step], low * lengths[step]))

    def _departures(
        self, steps: RobotSteps, indices: Int[np.ndarray, " point"], fractions: Float[np.ndarray, " point"]
    ) -> Float[np.ndarray, "joint point"]:
        """Return the laws of driven joints minus their coordinates at shares of steps, rad or sizes of the robot."""
        elapsed = fractions * steps.length[indices]
        path = np.zeros((len(self.problem.scale), len(elapsed)))
        for coefficient in np.moveaxis(steps.polynomial.coordinates, 0, -1)[::-1]:
            path = path * elapsed + coefficient[:, indices]
        laws = np.asarray(self.problem.prescribed((steps.start[indices] + elapsed)[None], path, path))
        deviation = np.asarray(self.problem.equations.driven)[:, None] * (laws - path)
        return deviation / np.asarray(self.problem.scale)[:, None]

    def initial_step(self) -> RobotSteps:
        """See `AbstractRun`."""
        at_rest = jax.tree.map(lambda x: np.asarray(x)[None, None, :, 0], self.current.state)
        return RobotSteps(np.array([self.limits.start]), np.zeros(1), at_rest, np.zeros(1, bool))

    def explained(self) -> tuple[Status, str]:
        """See `AbstractRun`."""
        time = float(self.current.time[0])
        if self.left:
            return Status.COLLAPSED, self.left
        if self.tried > MOST:
            return Status.COLLAPSED, f"after {self.tried} steps"
        if int(self.current.stuck) >= STUCK // 2:
            fault = (
                f"a force of a joint switches without end at t = {time:g} s, as friction of a joint that sticks does: "
                "smooth it, as by tanh(v/v0), or leave out the drives"
            )
            return Status.COLLAPSED, fault
        if int(self.current.outcome) == Outcome.LOST:
            fault = f"accelerations at t = {time:g} s are not finite: a force is not, or nothing resists a joint"
            return Status.INADMISSIBLE, fault
        return Status.COLLAPSED, f"at t = {time:g} s"
