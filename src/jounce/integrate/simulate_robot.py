"""From a robot and the forces of its joints to its motion, in joint coordinates."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypedDict

import jax
import numpy as np

from jounce.base.activity import Count
from jounce.base.shapes import ArrayLike, is_traced
from jounce.errors import MechanismError, RobotError, UnsupportedError, check_name, flag
from jounce.execution.backends import backend_of
from jounce.integrate.marching.exact_numbers import ExactNumbers
from jounce.integrate.marching.joint_events import JointEvent, JointEventDetector
from jounce.integrate.marching.marching import Outcome, RunLimits, steps_between_looks
from jounce.integrate.marching.robot_marching import STUCK, Progress, RobotProblem, RobotSteps, march_robot
from jounce.integrate.marching.robot_state import RobotState
from jounce.integrate.results.robot_simulation import RobotSimulation
from jounce.integrate.steps.events import EventLog
from jounce.integrate.steps.methods import AbstractMethod, Taylor
from jounce.kinematics import Status
from jounce.kinematics.position_analysis.solve import raise_for_status
from jounce.robot.algorithms.base_motion import BaseMotion, base_arrays, base_body
from jounce.robot.algorithms.wrench_laws import wrench_laws
from jounce.robot.algorithms.wrenches import Wrench
from jounce.robot.model.arguments import checked_state, floats
from jounce.robot.model.joint_laws import GivenLaws, joint_laws
from jounce.robot.model.robot_size import robot_size
from jounce.robot.recursions.tree_equations import TreeEquations
from jounce.robot.robot import Robot
from jounce.trajectory.laws.user_laws import tried_law
from jounce.trajectory.motion import AbstractMotion

MOST = 1_000_000


class RobotOptions(TypedDict, total=False):
    """The options of `jounce.simulate` that are for robots in joint coordinates."""

    state: ArrayLike | Mapping[str, float] | None
    torque: GivenLaws | None
    driven: Mapping[str, Any] | None
    drives: bool
    base: BaseMotion | None
    wrenches: Sequence[Wrench]


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
    method: AbstractMethod | None = None,
    tolerance: float = 1e-15,
    events: Sequence[JointEvent] = (),
    longest_step: float = np.inf,
    strict: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> RobotSimulation:
    """Return the motion of a robot; see `jounce.simulate`, which checks what is common to all simulations."""
    if robot.closures:
        message = "this robot has loops; simulate the mechanism that it is: jn.simulate(robot.mechanism(...), ...)"
        raise RobotError(message, name=robot.name, value=list(robot.closures))
    problem = _problem(robot, torque, driven, flag("drives", drives, error=RobotError), base, wrenches)
    start = _start(robot, problem, state, base, float(instants[0]))
    for event in events:
        if not isinstance(event, JointEvent):
            raise RobotError("must be a jn.integrate.JointEvent", name="events", value=event)
    detectors = [JointEventDetector(event, robot) for event in events]
    if isinstance(method, Taylor) and method.step is not None:
        longest_step = float(method.step)
    elif method is not None and not isinstance(method, Taylor):
        raise RobotError("robots are simulated by jn.Taylor", name="method", value=type(method).__name__)
    terms = (method or Taylor()).expansion_order(tolerance)
    run = _Run(problem, tolerance, longest_step, terms - 1, detectors)
    with Count("simulating", report=progress) as tell:
        run.go(start, instants, tell)
    pushed = tuple(wrenches)
    outcome = run.ending, run.events.happened, pushed, run.backends
    simulation = RobotSimulation(robot, problem, run.steps, instants, order, *outcome)
    if strict and run.events.stopped_at is None:
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
    prescribed = joint_laws(names, {name: _law_of_time(name, law) for name, law in given.items()}, "driven")
    mask = np.array([float(name in given) for name in names])
    length = robot_size(robot)
    scale = np.array([1.0 if robot.joints[name].turning else length for name in names])
    body = None if base is None else base_body(robot)
    pushes, frames, global_axes = wrench_laws(robot, wrenches, free=base is not None)
    equations = TreeEquations(tree, mask, body, frames, global_axes, drives)
    return RobotProblem(equations, joint_laws(names, torque), prescribed, scale, np.float64(length), pushes)


def _law_of_time(name: str, law: Any) -> AbstractMotion | str | float:
    if isinstance(law, AbstractMotion | str | int | float):
        return law
    if not callable(law):
        message = "must be a law of time: a motion law, an expression of t, a function of time, or a number"
        raise RobotError(message, name=f"driven.{name}", value=law)
    try:
        return tried_law(law)
    except MechanismError as error:
        raise RobotError(error.message, name=f"driven.{name}", value=law) from None


def _start(
    robot: Robot,
    problem: RobotProblem,
    state: ArrayLike | Mapping[str, float] | None,
    base: BaseMotion | None,
    instant: float,
) -> RobotState:
    """Return the state at the beginning: at rest at coordinates zero unless given, driven joints on their laws."""
    n = len(robot.joint_names)
    if isinstance(state, Mapping):
        state = [robot.coordinates(**state), np.zeros(n)]
    levels = np.zeros((2, n)) if state is None else np.asarray(floats("state", state))
    levels = np.array(checked_state(robot, levels))
    if levels.shape != (2, n) or not np.isfinite(levels).all():
        raise RobotError(f"must hold finite q and q', the shape (2, {n})", name="state", value=levels.tolist())
    mask = np.asarray(problem.equations.driven)
    if mask.any():
        time = np.array([[instant]])
        laws = np.asarray(problem.prescribed_series(np.zeros((n, 1)), time, 1))[..., 0]
        levels = np.where(mask > 0, laws, levels)
    q, rates = levels[0][:, None], levels[1][:, None]
    if base is None:
        return RobotState(q, rates)
    pose, twist = (np.asarray(x) for x in base_arrays(base, (), 1))
    if not (np.isfinite(pose).all() and np.isfinite(twist).all()):
        raise RobotError("must be finite", name="base")
    return RobotState(q, rates, pose[0, :3, None], pose[0, 3:, None], twist[0][:, None])


class _Run:
    """One run: its steps so far, the events in them, and how it ended."""

    def __init__(
        self, problem: RobotProblem, tolerance: float, longest: float, order: int, detectors: list[JointEventDetector]
    ):
        self.problem, self.tolerance, self.longest, self.order = problem, tolerance, longest, order
        self.events, self.exact = EventLog(detectors), ExactNumbers.of_parallel(problem.equations)
        numbers = (order + 2) * 2 * len(problem.scale)
        self.count = steps_between_looks(numbers, watched=bool(detectors))
        self.parts: list[RobotSteps] = []
        self.ending = (Status.OK, "")
        self.backends: set[str] = set()

    @property
    def steps(self) -> RobotSteps:
        """All steps taken."""
        return jax.tree.map(lambda *parts: np.concatenate(parts), *self.parts)

    def go(self, start: RobotState, instants: np.ndarray, progress: Callable[[int, int], None] | None) -> None:
        """March from the first to the last instant."""
        begun, stop = float(instants[0]), float(instants[-1])
        direction = 1.0 if stop >= begun else -1.0
        running, none = (np.asarray(value) for value in (int(Outcome.RUNNING), 0))
        nothing = np.zeros(1)
        current, total = Progress(np.array([begun]), start, running, none, none, nothing, nothing), 0
        while int(current.outcome) == Outcome.RUNNING and self.events.stopped_at is None:
            current, steps, taken = self._marched(current, begun, stop)
            self.backends.add(backend_of(current))
            count = int(taken)
            total += count
            if count:
                cut = jax.tree.map(lambda x, count=count: np.asarray(x)[:count], steps)
                self.parts.append(self.events.noted(cut))
            if total > MOST:
                self.ending = (Status.COLLAPSED, f"after {total} steps")
                break
            if progress is not None:
                progress(int(np.sum(direction * instants <= direction * float(current.time[0]))), len(instants))
        if not self.parts:
            at_rest = jax.tree.map(lambda x: np.asarray(x)[None, None, :, 0], start)
            self.parts.append(RobotSteps(np.array([begun]), np.zeros(1), at_rest, np.zeros(1, bool)))
        if int(current.outcome) in (Outcome.COLLAPSED, Outcome.LOST):
            self.ending = self._explained(current)

    def _marched(self, current: Progress, begun: float, stop: float) -> Any:
        limits = np.float64(begun), RunLimits(*map(np.float64, (stop, self.tolerance, self.longest)))
        try:
            how: Any = {"order": self.order, "count": self.count, "exact": self.exact}
            return march_robot(self.problem, current, *limits, **how)
        except TypeError as error:
            if "has no rule for Taylor series" not in str(error):
                raise
            message = f"{error}; a law of a joint uses it: write it with other operations"
            raise UnsupportedError(message, name="torque") from error

    def _explained(self, current: Progress) -> tuple[Status, str]:
        """Return why steps did not go on."""
        time = float(current.time[0])
        if int(current.stuck) >= STUCK // 2:
            words = (
                f"a force of a joint switches without end at t = {time:g} s, as friction of a joint that sticks does: "
                "smooth it, as by tanh(v/v0)"
            )
            return Status.COLLAPSED, words
        if int(current.outcome) == Outcome.LOST:
            words = f"accelerations at t = {time:g} s are not finite: a force is not, or nothing resists a joint"
            return Status.INADMISSIBLE, words
        return Status.COLLAPSED, f"at t = {time:g} s"
