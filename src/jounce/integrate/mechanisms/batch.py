"""Many simulations of one mechanism side by side, with different parameters."""

import functools
from collections.abc import Mapping
from typing import Any, Unpack

import jax
import numpy as np

from jounce.base.padding import power_of_two
from jounce.base.shapes import ArrayLike, Labeled, Refused
from jounce.dynamics.forward.accelerations import State
from jounce.dynamics.forward.initial_state import consistent_start, initial_as_drivers
from jounce.execution.backends import joined
from jounce.execution.threads import Threads, thread_count
from jounce.integrate.marching.marching import (
    MOVING,
    DenseOutput,
    IntegratorState,
    Outcome,
    RunLimits,
    march_runs,
    unexpanded,
)
from jounce.integrate.marching.user_methods import integrator
from jounce.integrate.mechanisms.batch_equations import (
    BatchStart,
    ParametricMechanism,
    Turns,
    mapped_runs,
    outputs_of_runs,
)
from jounce.integrate.results.batch import Batch
from jounce.integrate.results.robot_sensitivities import of_traced_robots
from jounce.integrate.results.simulation import derivatives_of_motion
from jounce.integrate.robot_batch import simulate_robots, traced_robot_batch
from jounce.integrate.simulate_robot import RobotOptions, check_robot_options
from jounce.integrate.steps.events import pose_coordinates
from jounce.integrate.steps.methods import AbstractMethod
from jounce.integrate.steps.options import checked_options, instants_of
from jounce.integrate.steps.revolution_counts import POINTS_IN_STEP, attitudes_at
from jounce.jet.derivatives import plain_derivatives
from jounce.jet.turns import shifted_by_turns, whole_periods
from jounce.kinematics import Status
from jounce.kinematics.families.parameter_values import check_parameter, checked_values
from jounce.kinematics.results.pose_outputs import output_series
from jounce.mechanism import Mechanism, TimeGrid, build, check_mechanism
from jounce.mechanism.building.builder import with_reference
from jounce.mechanism.building.preconditions import concrete
from jounce.mechanism.carriages import check_without_ends
from jounce.mechanism.laws.law_checks import check_laws
from jounce.mechanism.transmissions.axis_angles import measures_angle, raw_angles
from jounce.mechanism.transmissions.turn_counting import counted_along
from jounce.robot.robot import Robot

LANES = 128  # runs advanced in one call: more need memory, fewer more time in Python
STEPS = 16  # attempts before runs that have ended make room for others


@of_traced_robots(traced_robot_batch)
@concrete
def simulate_batch(
    mechanism: Mechanism | Robot,
    parameters: Mapping[str, ArrayLike] | Labeled | Refused,
    time: ArrayLike | TimeGrid | None = None,
    order: int = 4,
    *,
    method: AbstractMethod | None = None,
    tolerance: float = 1e-15,
    longest_step: float = np.inf,
    **robot: Unpack[RobotOptions],
) -> Batch:
    """Return many simulations of a mechanism that differ in its parameters, or of a robot, computed side by side.

    Initial conditions differ if their laws have parameters. The programs are compiled once for all runs.

    Parameters
    ----------
    mechanism : Mechanism or Robot
        As for `simulate`.
    parameters : dict of str to array_like of shape (runs,), or pandas.DataFrame
        Values of some parameters in each run, SI; the columns of a table are parameters. For a robot: coordinates at
        the start, by the name of the joint; velocities at the start, ``JOINT.rate``; and masses, ``LINK.mass``, with
        unchanged moments about the center of mass.
    time, order, method, tolerance, longest_step
        As for `simulate`; each run has its own steps.
    **robot
        For robots, the same in all runs: as for `simulate`, except ``base``. The ``state`` applies to joints that the
        parameters do not name.

    Returns
    -------
    Batch
        A run that fails does not stop the others, but has a `status`. If JAX traces parameters, ``state`` or inertias
        of a robot, ``outputs`` are JAX arrays with derivatives, and a run that fails raises an error.

    Raises
    ------
    JounceError
        If a parameter does not exist, values are not finite, or their numbers differ; and as for `simulate`.

    Examples
    --------
    >>> import jounce as jn
    >>> pendulum = jn.Mechanism(
    ...     space="planar",
    ...     gravity=[0, -9.81],
    ...     parameters={"lift": 0.1},
    ...     bodies={"rod": jn.Body([0, 0], mass=2.0, inertia=0.5, center_of_mass=[1, 0])},
    ...     joints={"O": jn.planar.Revolute(("ground", "rod"), [0, 0], [0, 0])},
    ...     initial={"rise": jn.drivers.CoordinateDriver(("ground", "rod"), "angle", motion="lift")},
    ...     outputs={"angle": jn.outputs.AngleOutput("rod")},
    ... )
    >>> jn.simulate_batch(pendulum, {"lift": [0.1, 0.2, 0.3]}, [0.0, 0.5]).outputs["angle"].shape
    (3, 2, 5)
    """
    check_robot_options(mechanism, robot)
    if isinstance(mechanism, Robot):
        options: Any = {"method": method, "tolerance": tolerance, "longest_step": longest_step, **robot}
        return simulate_robots(mechanism, parameters, time, order, **options)
    check_mechanism(mechanism)
    check_without_ends(mechanism, "a batch of simulations")
    values = checked_values(parameters, "run", functools.partial(check_parameter, mechanism))
    names, rows = tuple(values), np.stack(list(values.values()), axis=-1)
    first = mechanism.with_parameters(**dict(zip(names, rows[0].tolist(), strict=True)))
    order, method = checked_options(order, method, tolerance, longest_step)
    instants = instants_of(mechanism.time if time is None else time, first.parameter_values)
    check_laws(mechanism, instants, order, forces=True)
    nominal = consistent_start(first, float(instants[0]))
    parametric = ParametricMechanism(first, nominal.model, names)
    with_conditions = parametric
    if first.initial:
        model, _ = with_reference(build(initial_as_drivers(first)), nominal.model.reference, float(instants[0]))
        with_conditions = ParametricMechanism(initial_as_drivers(first), model, names)
    limits = RunLimits(instants[-1], float(tolerance), float(longest_step), instants[0])
    runs = _Runs(parametric, rows, instants, order, limits, method)

    starts = BatchStart(parametric, with_conditions, nominal.state, rows, float(instants[0]))

    def start_runs(indices: np.ndarray) -> None:
        runs.start_runs(indices, *starts.of(indices))

    first_chunk, *others = runs.chunks(np.arange(len(rows)))
    start_runs(first_chunk)  # allocates the arrays for all runs
    with Threads(thread_count()) as pool:
        list(pool.map(start_runs, others))
        while len(runs.moving):
            list(pool.map(runs.advance, runs.chunks(runs.moving)))
    status = runs.status
    for run, reason in starts.failed.items():
        status[run, 0] = int(reason)
    return Batch(instants, values, runs.outputs, status, runs.steps, mechanism, order, joined(runs.backends))


class _Runs:
    """The runs of a batch; those that have not ended are advanced side by side, each at its own time.

    Only outputs at the requested instants are stored, not the steps; their derivatives follow from the equations of
    motion.
    """

    def __init__(
        self,
        parametric: ParametricMechanism,
        rows: np.ndarray,
        instants: np.ndarray,
        order: int,
        limits: RunLimits,
        method: AbstractMethod,
    ):
        self.parametric, self.instants, self.order = parametric, instants, order
        self.limits, self.method = limits, method
        self.width = min(LANES, power_of_two(len(rows)))
        self.steps, self.backends = np.zeros(len(rows), int), set[str]()
        self._made = parametric.of(rows)
        self._reached = np.zeros((len(rows), len(instants)), bool)
        self._direction = np.sign(limits.stop - limits.start)
        self._expansion = max(derivatives_of_motion(parametric.mechanism, order), 2)  # 2 for the count of revolutions
        self._current: Any = None
        self._values: dict[int, np.ndarray] = {}  # of each group, (runs, time, order + 1, components, outputs)
        self._step_start = np.full(len(rows), instants[0])  # of the last step of each run
        self._angles: dict[int, np.ndarray] = {}  # series of turning outputs at the start of the last step
        outputs = parametric.model.system.outputs
        self._measuring = [index for index, group in enumerate(outputs) if measures_angle(group)]
        self._turns: dict[int, np.ndarray] = {}  # angles about axes at the end of the last step, (instances, runs)

    @property
    def moving(self) -> np.ndarray:
        """The runs that have not ended."""
        return np.flatnonzero(np.isin(self._current.outcome, MOVING))

    @property
    def status(self) -> np.ndarray:
        """See `Batch`."""
        status = np.where(self._reached, int(Status.OK), int(Status.NOT_REACHED))
        stuck = np.flatnonzero(~self._reached.all(axis=1))
        unbalanced = self._current.outcome[stuck] == Outcome.UNBALANCED
        reasons = np.where(unbalanced, int(Status.UNBALANCED), int(Status.COLLAPSED))
        status[stuck, np.argmin(self._reached[stuck], axis=1)] = reasons
        for values in self._values.values():
            finite = np.isfinite(values[:, :, : self.order + 1]).all(axis=(2, 3, 4))
            status[self._reached & ~finite] = int(Status.UNDEFINED)
        return status

    @property
    def outputs(self) -> dict[str, np.ndarray]:
        """See `Batch`."""
        values_by_name = {}
        for index, values in self._values.items():
            for k, name in enumerate(self.parametric.model.outputs[index]):
                derivatives = np.moveaxis(np.asarray(plain_derivatives(np.moveaxis(values[..., k], 2, 0))), 0, 2)
                values_by_name[name] = derivatives[..., 0] if derivatives.shape[-1] == 1 else derivatives
        return {name: values_by_name[name] for name in self.parametric.mechanism.outputs if name in values_by_name}

    def chunks(self, runs: np.ndarray) -> list[np.ndarray]:
        """Return runs in chunks of one size; the last chunk repeats its last run."""
        return [runs[np.minimum(np.arange(k, k + self.width), len(runs) - 1)] for k in range(0, len(runs), self.width)]

    def start_runs(self, runs: np.ndarray, state: State, of_forces: Turns, of_outputs: Turns) -> None:
        """Start runs from states on the constraints, with given revolutions of angles about axes."""
        equations, time = self._made.at(runs)[0].near(of_forces), np.full(len(runs), self.instants[0])
        current = unexpanded(equations, state, time, order=self.method.expansion_order(float(self.limits.tolerance)))
        current, first_angles = jax.tree.map(np.asarray, current), dict(zip(self._measuring, of_outputs, strict=True))
        if self._current is None:
            self._current = jax.tree.map(lambda x: np.zeros((*x.shape[:-1], len(self.steps)), x.dtype), current)
            self._turns = {index: np.zeros((len(angle), len(self.steps))) for index, angle in first_angles.items()}
        self._put(runs, current)
        for index, angle in first_angles.items():
            self._turns[index][:, runs] = angle
        self._note(runs, np.zeros(len(runs), int), current.expansion.state, time, current.angles, first_angles)

    def advance(self, runs: np.ndarray) -> None:
        """Advance runs by some steps, and store their outputs at the instants that they pass."""
        current = jax.tree.map(lambda x: x[..., runs], self._current)
        method = integrator(self.method, self._made.at(runs)[0], current)
        shared, options = (RunLimits(*map(np.asarray, self.limits)),), {"method": method, "steps": STEPS}
        result, backend = mapped_runs(march_runs, self._made, runs, shared, (current,), **options)
        self.backends.add(backend)
        current, (steps, taken) = result
        self._put(runs, current)
        self.steps[runs] += taken.sum(axis=0)
        angles = self._counted(runs, steps)
        starts, times = self._direction * steps.start, self._direction * self.instants
        end = self._direction * current.time + 1e-14 * np.abs(current.time)
        visited = np.flatnonzero((times >= starts[0].min()) & (times <= end.max()))
        passed = taken & (starts <= times[visited, None, None])  # instants, steps, runs
        step = passed.shape[1] - 1 - np.argmax(passed[:, ::-1], axis=1)
        instant, lane = np.nonzero(passed.any(axis=1) & (times[visited, None] <= end))
        step = step[instant, lane]
        polynomial = steps.polynomial.map(lambda part: np.moveaxis(part[step, ..., lane], 0, -1))
        before = {index: series[..., step, lane] for index, series in angles.items()}
        elapsed, length = self.instants[visited[instant]] - steps.start[step, lane], steps.length[step, lane]
        fraction = elapsed / np.where(length == 0.0, 1.0, length)
        before |= self._counted_about_axes(runs, steps, taken, (step, lane, fraction))
        force_angles = tuple(part[step, :, lane].T for part in steps.angles)
        self._note(runs[lane], visited[instant], polynomial, steps.start[step, lane], force_angles, before)
        failed = runs[current.outcome == Outcome.LOST]
        self._reached[failed] = False
        for values in self._values.values():
            values[failed] = np.nan

    def _put(self, runs: np.ndarray, current: IntegratorState) -> None:
        for array, part in zip(jax.tree.leaves(self._current), jax.tree.leaves(current), strict=True):
            array[..., runs] = part

    def _counted(self, runs: np.ndarray, steps: DenseOutput) -> dict[int, np.ndarray]:
        """Return the series of turning outputs at the starts of steps, revolutions counted; steps and runs last."""
        counted = {}
        time = np.concatenate([self._step_start[runs][None], steps.start])
        self._step_start[runs] = time[-1]
        _, outputs = self._made.at(np.tile(runs, len(steps.start)))
        for index, group in enumerate(outputs):
            if group.element.turning and not measures_angle(group):
                state = steps.polynomial.map(lambda part: np.moveaxis(part[:, :3], 0, -2))
                state = state.map(lambda part: part.reshape(*part.shape[:-2], -1))
                (series,) = output_series((group,), pose_coordinates(state), self.parametric.model.pose_type)
                series = np.array(series).reshape(*series.shape[:-1], *steps.start.shape)
                last = self._angles.setdefault(index, np.full((*series.shape[:-2], len(self.steps)), np.nan))
                path = np.concatenate([last[..., runs][..., None, :], series], axis=-2)
                series[0] -= np.cumsum(turned(path[..., :-1, :], path[..., 1:, :], np.diff(time, axis=0)), axis=-2)
                last[..., runs] = series[..., -1, :]
                counted[index] = series
        return counted

    def _counted_about_axes(
        self,
        runs: np.ndarray,
        steps: DenseOutput,
        taken: np.ndarray,
        positions: tuple[np.ndarray, np.ndarray, np.ndarray],
    ) -> dict[int, np.ndarray]:
        """Return angles about axes near positions, (instances, positions) for each group of outputs; update the counts.

        Positions are given by step, lane and share of the step.
        """
        lane, step = np.nonzero(taken.T)
        if not lane.size:
            return {}
        number = np.zeros(taken.shape, int)
        number[step, lane] = np.arange(len(lane))
        last = np.append(lane[1:] != lane[:-1], True)  # of the steps of a run
        counted_angles = {}
        for index, turns in self._turns.items():

            def measured(which_step: np.ndarray, fraction: np.ndarray, index: int = index) -> np.ndarray:
                k, r = step[which_step], lane[which_step]
                attitudes = attitudes_at(
                    steps.polynomial.attitude[k, ..., r],
                    fraction * steps.length[k, r],
                )
                _, outputs = self._made.at(runs[r])
                return raw_angles([outputs[index]], {"quaternion": attitudes})[0]

            counted = counted_along(measured, lane, turns[:, runs[lane]], POINTS_IN_STEP)
            counted_angles[index] = counted.near(number[positions[0], positions[1]], positions[2])
            turns[:, runs[lane[last]]] = counted.near(np.flatnonzero(last), np.ones(last.sum()))
        return counted_angles

    def _note(
        self,
        runs: np.ndarray,
        instant_indices: np.ndarray,
        polynomial: State,
        starts: np.ndarray,
        angles: tuple[np.ndarray, ...],
        before: dict[int, np.ndarray],
    ) -> None:
        """Store the outputs of runs at instants, given by index, from the polynomials of steps and their starts.

        `angles` are those that forces measure at the starts. `before` has the series of turning outputs at the starts,
        except at the initial instant, and the angles about axes near the instants.
        """
        for lanes in self.chunks(np.arange(len(runs))):
            turned_by = tuple(angle[:, lanes] for angle in angles)
            time = self.instants[instant_indices[lanes]]
            elapsed = time - starts[lanes]
            motion = turned_by, polynomial.map(lambda part, lanes=lanes: part[..., lanes]), elapsed, time
            results, backend = mapped_runs(
                outputs_of_runs, self._made, runs[lanes], (), (motion,), order=self._expansion
            )
            self.backends.add(backend)
            for index, series in enumerate(map(np.array, results)):
                if index in self._turns:
                    series[0, 0] = shifted_by_turns(series[0, 0], before[index][:, lanes])
                elif index in before:
                    series[0] -= turned(before[index][..., lanes], series, elapsed)
                values = np.moveaxis(series[: self.order + 1], -1, 0)
                if index not in self._values:
                    self._values[index] = np.full((*self._reached.shape, *values.shape[1:]), np.nan)
                self._values[index][runs[lanes], instant_indices[lanes]] = values
            self._reached[runs[lanes], instant_indices[lanes]] = True


def turned(before: np.ndarray, after: np.ndarray, elapsed: np.ndarray) -> np.ndarray:
    """Return the whole revolutions, in rad, to subtract from an angle to continue an earlier one.

    Parameters
    ----------
    before, after : array of shape (order + 1, ...)
        Taylor coefficients of the angle, to the second at least; where `before` is NaN, no turns are counted.
    elapsed : array
        Time from the earlier to the later angle, s.
    """
    rise = elapsed / 2 * (before[1] + after[1]) + elapsed**2 / 6 * (before[2] - after[2])
    return np.nan_to_num(whole_periods(after[0] - before[0] - rise))
