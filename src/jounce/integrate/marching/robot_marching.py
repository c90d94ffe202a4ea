"""Steps of a robot in joint coordinates: Taylor series of its motion, checked along each step before it is taken.

There are no constraints, and so no projection. A pulse or jump of a force ahead is not contained in the series, but it
shows as a difference between the accelerations of the equations of motion and those of the series: the step ends before
it.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.base.modules import Module, with_fields
from jounce.base.shapes import Numbers
from jounce.execution.compilation import LARGE, compiled
from jounce.execution.llvm.text.values import UnsupportedOperationError
from jounce.integrate.marching.exact_numbers import ExactNumbers, forms_of
from jounce.integrate.marching.marching import SHORT as UNUSUAL, Outcome, RunLimits, attempts
from jounce.integrate.marching.robot_state import RobotState, at, polynomial_of, rates_at
from jounce.integrate.steps.lookahead import HARMLESS, NEAR, POINTS, RUN_POINTS, SHORTEST, finest, steps_counted
from jounce.integrate.steps.methods import MARGIN, NEEDED, ROUNDING, Lanes, furthest
from jounce.jet.programs.series import Recursion
from jounce.jet.programs.still_entries import ConstantEntries
from jounce.robot.algorithms.motion_series import MotionSeries, constant_motion, motion_series
from jounce.robot.algorithms.wrench_laws import WrenchLaws
from jounce.robot.model.joint_laws import AbstractJointLaws
from jounce.robot.recursions.tree_equations import TreeEquations, TreeState, Unknowns, free_base

SMOOTH_POINTS = 3  # points of a step without jumps, where the error of the series is largest at the end
STUCK = 64  # steps in a row that hardly advance and end a run: a force switches without end
STUCK_STEP = 10 * SHORTEST  # of the run: sticking joints switch after steps little longer than the shortest
AGAIN = 10  # steps over a jump in a row that may end without a finite value, before the run is given up
SHORT = 1e-5  # of the step that the series allows: a shorter step leads over a jump
STEEP = 1e-3  # of the usual step: a force that makes a step shorter may jump
UNSEEN = 1e-12  # displacement of a joint that a step may overlook, rad or sizes of the robot; less beside a jump
NOISE = 32.0  # multiple of the residual at the start of a series that counts as rounding along the step


class RobotProblem(Module):
    """The equations of motion and the laws of forces and motions of a robot.

    Attributes
    ----------
    equations : TreeEquations
        Equations of motion of the tree.
    forces : AbstractJointLaws
        Laws of the joint forces.
    prescribed : AbstractJointLaws
        Laws of the coordinates of driven joints; their second derivatives enter the equations.
    scale : array of shape (n,)
        Unit of each coordinate: 1 rad, or the size of the robot.
    length : float
        Size of the robot, m.
    wrenches : WrenchLaws
        Laws of the wrenches on links.
    """

    equations: TreeEquations
    forces: AbstractJointLaws
    prescribed: AbstractJointLaws
    scale: Float[Numbers, " n"]
    length: Float[Numbers, ""] | float
    wrenches: WrenchLaws = WrenchLaws(())

    @property
    def blind(self) -> bool:
        """Whether no law varies, so that a series cannot overlook anything."""
        return not (self.forces.changing or self.prescribed.changing or self.wrenches.changing)

    @property
    def smooth(self) -> bool:
        """Whether the equations consist of sums and products of coordinates, rates, sines and cosines only."""
        return self.blind and not (self.equations.drives and self.equations.tree.shape.rubbing)

    def motion(self, state: RobotState) -> TreeState:
        """Return the motion of all bodies."""
        base = None
        if state.position is not None:
            base = free_base(state.position, state.quaternion, state.twist)
        return self.equations.motion(state.coordinates, state.rates, base)

    def applied(self, motion: TreeState, time: Float[Numbers, "1 batch"]) -> tuple[Unknowns, tuple[Any, ...]]:
        """Return the joint forces and wrenches in a state; the forces of driven joints are zero, as they follow."""
        mask = 1.0 - jnp.asarray(self.equations.driven)[:, None]
        forces = mask * self.forces(time, motion.coordinates, motion.rates)
        pushes = self.wrenches(time[0], motion.coordinates, motion.rates)
        return Unknowns(forces, None if motion.base is None else jnp.zeros_like(motion.base.twist)), pushes

    def series(
        self,
        state: RobotState,
        time: Float[Numbers, "1 batch"],
        order: int,
        *,
        reversible: bool = False,
        still: ConstantEntries | None = None,
    ) -> MotionSeries:
        """Return the series of the motion; the order is that of the accelerations."""
        ticking = jnp.concatenate([time[None], jnp.ones((1, *time.shape)), jnp.zeros((max(order - 1, 0), *time.shape))])
        driven = self._prescribed_accelerations(state, time, order)
        given = ticking[: order + 1], driven, order
        motion = self.motion(state)
        return motion_series(self.equations, motion, self.applied, *given, reversible=reversible, still=still)

    def made_for(self, exact: ExactNumbers) -> "RobotProblem":
        """Return the problem with exact numbers as constants of a program."""
        return with_fields(self, equations=exact.put(self.equations))

    def still(self, exact: ExactNumbers) -> ConstantEntries | None:
        """Return the entries that stay constant in any motion, given only the exact numbers; None if that fails."""
        from jounce.execution.llvm.certain_numbers import certain_numbers

        base = with_fields(forms_of(self), equations=exact.known(self.equations))
        state, time = RobotState(*[np.full((len(self.scale), 1), np.nan)] * 2), np.full((1, 1), np.nan)
        program, form = jax.make_jaxpr(RobotProblem.motion, return_shape=True)(base, state)
        try:
            values = certain_numbers(program, jax.tree.leaves((base, state)))
            motion = jax.tree.unflatten(jax.tree.structure(form), values)
            trial = Unknowns(state.rates, None)
            return constant_motion(lambda problem: (problem.equations, problem.applied), base, motion, trial, time)
        except UnsupportedOperationError:
            return None

    def prescribed_series(self, like: Any, time: Any, order: int) -> Any:
        """Return the series of the prescribed coordinates, zero for the others, (order + 1, n, batch)."""
        start = jnp.broadcast_to(jnp.zeros_like(like), (order + 1, *like.shape))
        if not self.prescribed.changing:
            return start.at[0].set(self.prescribed(time, like, like))
        recursion = Recursion(lambda t: self.prescribed(t, jnp.zeros_like(like), jnp.zeros_like(like)), (time,), order)
        if not order:
            return start.at[0].set(recursion.outputs)

        def level(k: Any, carry: Any) -> Any:
            history, coefficients = carry
            ticks = jnp.where(k == 1, jnp.ones_like(time), jnp.zeros_like(time))
            outputs, newest = recursion.advanced(history, k, (ticks,))
            coefficients = jax.lax.dynamic_update_index_in_dim(coefficients, outputs, k, 0)
            return recursion.noted(history, k, newest), coefficients

        first = recursion.history, start.at[0].set(recursion.outputs)
        return jax.lax.fori_loop(1, order + 1, level, first)[1]

    def _prescribed_accelerations(self, state: RobotState, time: Any, order: int) -> Any:
        if not self.prescribed.changing:
            return jnp.zeros((order + 1, *state.coordinates.shape))
        coordinates = self.prescribed_series(state.coordinates, time, order + 2)
        numbers = jnp.arange(1.0, order + 2)
        return coordinates[2:] * (numbers * (numbers + 1.0))[:, None, None]

    def departures(self, state: RobotState, rates: RobotState, time: Any) -> tuple[Any, Any]:
        """Return the differences between accelerations of the equations and of a path, and the latter, both scaled.

        Both have shape (n or n + 6, batch).
        """
        motion = self.motion(state)
        trial = Unknowns(rates.rates, rates.twist)
        if self.prescribed.changing:  # prescribed accelerations do not follow from the equations
            driven = self._prescribed_accelerations(state, time, 0)[0]
            mask = jnp.asarray(self.equations.driven)[:, None]
            gap = mask * (driven - rates.rates)
            trial = trial._replace(joints=trial.joints + gap)
        else:
            gap = jnp.zeros_like(rates.rates)
        forces, pushes = self.applied(motion, time)
        missing = jax.tree.map(jnp.subtract, forces, self.equations.needed(motion, trial, pushes))
        change = self.equations.factored(motion).solve(missing)
        parts, scales = [change.joints + gap], [jnp.asarray(self.scale)[:, None]]
        sizes = [rates.rates]
        if change.base is not None:
            parts.append(change.base)
            sizes.append(rates.twist)
            scales.append(jnp.where(jnp.arange(6.0)[:, None] < 3, self.length, 1.0))
        scale = jnp.concatenate(scales)
        return jnp.concatenate(parts) / scale, jnp.concatenate(sizes) / scale


class RobotSteps(NamedTuple):
    """Consecutive steps as polynomials in the time from their beginnings, (steps, order + 1, n).

    While they are taken, there is an additional last axis of length one.
    """

    start: Float[Any, "steps *batch"]
    length: Float[Any, "steps *batch"]
    polynomial: RobotState
    kink: Bool[Any, "steps *batch"]  # whether the step is a negligibly short one over a jump

    @property
    def end(self) -> float:
        """End of the last step, s."""
        return float(self.start[-1] + self.length[-1])


class Progress(NamedTuple):
    """The current state of a run."""

    time: Lanes  # s, of shape (1,)
    state: RobotState
    outcome: Int[Numbers, ""]
    stuck: Int[Numbers, ""]  # consecutive steps of negligible length
    crossing: Int[Numbers, ""]  # consecutive steps over a jump
    rest: Lanes  # rounding remainder of the time, to be added to it, s
    longest: Lanes  # longest step so far, s


def _departures(problem: RobotProblem, polynomial: RobotState, time: Any, elapsed: Any, *, one_by_one: bool) -> Any:
    """Return `RobotProblem.departures` at points of a step, all at once or one after another."""

    def at_points(elapsed: Any) -> Any:
        state, rates = at(polynomial, elapsed), rates_at(polynomial, elapsed)
        return problem.departures(state, rates, (time + elapsed)[None])

    if not one_by_one:
        return at_points(elapsed)
    return [jnp.moveaxis(x[..., 0], 0, -1) for x in jax.lax.map(at_points, elapsed[:, None])]


def _sizes(problem: RobotProblem, polynomial: RobotState) -> Any:
    """Return the sizes of the position coefficients from order one on, rad or sizes of the robot."""
    levels = len(polynomial.rates)
    numbers = jnp.arange(1.0, levels + 1)[:, None]
    scale = jnp.asarray(problem.scale)[None, :, None]
    sizes = jnp.max(jnp.abs(polynomial.rates) / scale, axis=1, initial=0.0) / numbers
    if polynomial.position is None:
        return sizes
    translation = jnp.max(jnp.abs(polynomial.position[1:]), axis=1) / problem.length
    rotation = 2.0 * jnp.max(jnp.abs(polynomial.quaternion[1:]), axis=1)
    twist = jnp.max(jnp.abs(polynomial.twist[:, 3:]), axis=1) / numbers
    sizes = jnp.maximum(sizes, twist)
    return jnp.concatenate([jnp.maximum(sizes[:-1], jnp.maximum(translation, rotation)), sizes[-1:]])


@compiled("order", "count", "exact", otherwise={"exact": None})
def march_robot(
    problem: RobotProblem,
    current: Progress,
    limits: RunLimits,
    *,
    order: int,
    count: int,
    exact: ExactNumbers | None = None,
) -> tuple[Progress, tuple[RobotSteps, Bool[Numbers, "steps 1"]], Int[Numbers, ""]]:
    """Take up to `count` steps of a run.

    Parameters
    ----------
    problem : RobotProblem
        Equations and laws of the robot.
    current : Progress
        State to continue from.
    limits : RunLimits
        End of the run, and bounds of its steps.
    order : int
        Order of the series of accelerations.
    count : int
        Largest number of attempts.
    exact : ExactNumbers, optional
        Exact numbers of the robot for which the program is compiled.

    Returns
    -------
    current : Progress
    steps : tuple of RobotSteps and array of bool, shape (steps, 1)
        Attempted steps in their order, and whether they were taken.
    tried : int
        Number of attempts.
    """
    problem, still = (problem, None) if exact is None else (problem.made_for(exact), problem.still(exact))
    stop, tolerance, longest, started = limits
    duration = jnp.abs(stop - started)
    points = SMOOTH_POINTS if problem.smooth else POINTS

    small = 9 * problem.equations.tree.shape.bodies <= LARGE  # axes of all bodies, as single numbers
    one_by_one = problem.smooth and exact is not None and small

    def look(polynomial: RobotState, time: Any, step: Any, first: Any, usual: Any) -> tuple[Any, Any]:
        """Return the error at some points of a step, relative to the allowed error, and whether all values are finite.

        A wrong velocity acts until the end of the run, so jumps count by the displacement until then. The residual at
        the beginning, where the series satisfies the equations, is rounding.
        """
        fractions = jnp.concatenate([jnp.zeros(1), (first + jnp.arange(1.0, points + 1)) / _point_count(step)])
        elapsed = jnp.minimum(fractions, 1.0) * step
        gap, size = _departures(problem, polynomial, time, elapsed, one_by_one=one_by_one)
        rounding = NOISE * jnp.max(jnp.abs(gap[:, 0])) + ROUNDING * jnp.max(jnp.abs(size))
        largest = jnp.maximum(jnp.max(jnp.abs(gap[:, 1:])) - rounding, 0.0)
        local = largest * step**2 / (order * (order + 1.0)) / (MARGIN * tolerance)
        harmless = jnp.clip(UNSEEN * jnp.abs(step) / (STEEP * usual), HARMLESS, UNSEEN)
        lasting = largest * jnp.abs(step) * duration / jnp.maximum(tolerance, harmless)
        return jnp.maximum(local, lasting), jnp.all(jnp.isfinite(gap))

    def _point_count(step: Any) -> Any:
        return float(points) if problem.blind else jnp.maximum(RUN_POINTS * jnp.abs(step) / duration, points)

    def fits(polynomial: RobotState, time: Any, step: Any, usual: Any) -> tuple[Any, Any, Any]:
        """Return whether a step satisfies the equations throughout, is finite, and crosses a jump.

        On a step of negligible length, an error can only be a jump.
        """

        def further(carry: Any) -> Any:
            first, error, finite = carry
            crossed, is_finite = look(polynomial, time, step, first, usual)
            return first + points, jnp.maximum(error, crossed), finite & is_finite

        def open_(carry: Any) -> Any:
            first, error, finite = carry
            return (first < _point_count(step)) & finite & (error <= 1.0)

        _, error, finite = jax.lax.while_loop(open_, further, (jnp.zeros(()), jnp.zeros(()), jnp.ones((), bool)))
        return finite & (error <= 1.0), finite, (error > 0.0) & (jnp.abs(step) <= SHORTEST * duration)

    def attempt(current: Progress) -> tuple[Progress, tuple[RobotSteps, Any]]:
        time, remaining = current.time, stop - current.time[0] - current.rest[0]
        full_series = polynomial_of(problem.series(current.state, time[None], order, still=still))
        sizes = _sizes(problem, full_series)
        defined = jnp.all(jnp.isfinite(sizes[:NEEDED]))
        sizes = jnp.where(jnp.isfinite(sizes), sizes, jnp.inf)
        # beside a jump the upper terms are growing rounding: steps that these shorten would never leave the jump
        bound, lasting = (HARMLESS, duration) if problem.smooth else (0.0, None)
        allowed = jnp.full(time.shape, jnp.maximum(tolerance, bound))
        used, reach = furthest(sizes, allowed, UNUSUAL * current.longest, lasting)
        polynomial = jax.tree.map(lambda c: jnp.where(used[: len(c), None], c, 0.0), full_series)
        step = jnp.minimum(jnp.minimum(reach[0], longest), jnp.abs(remaining))
        step = jnp.where(step >= 0.999 * jnp.abs(remaining), jnp.abs(remaining), step)
        shortest, planned = finest(duration, time, current.crossing)[0], step
        direction, usual = jnp.sign(remaining), jnp.maximum(current.longest[0], step)

        def narrowed(carry: Any) -> Any:
            low, high, jumps = carry
            step = jnp.where(low > 0, 0.5 * (low + high), 0.5 * high)
            accepted, finite, jump = fits(polynomial, time[0], direction * step, usual)
            is_taken = accepted | ((step <= shortest) & finite)
            return jnp.where(is_taken, step, low), jnp.where(is_taken, high, step), jnp.where(is_taken, jump, jumps)

        def open_(carry: Any) -> Any:
            low, high, _ = carry
            narrowing = (high - low > NEAR * low) & (low < STEEP * usual)  # to a jump; steep forces need none
            return jnp.where(low > 0, (low < high) & narrowing, high > 0.25 * shortest)

        accepted, _, jumps = fits(polynomial, time[0], direction * step, usual)
        low, _, jumps = jax.lax.while_loop(open_, narrowed, (jnp.where(accepted, step, 0.0), step, jumps))
        step = jnp.where(low > 0, low, shortest)
        last = step >= jnp.abs(remaining)
        arrived = at(polynomial, direction * step[None])
        elapsed = direction * step + current.rest[0]
        time_after = jnp.where(last, stop, time[0] + elapsed)
        rest = jnp.where(last, 0.0, elapsed - (time_after - time[0]))
        short = (step < SHORT * planned) & ~last
        stuck = steps_counted(current.stuck, step, duration, longest=STUCK_STEP)
        moves = defined & (low > 0) & (stuck < STUCK)
        # the value at the very end of a step over a jump is not finite
        retry = defined & (low == 0.0) & (stuck < STUCK) & (current.crossing < AGAIN)
        outcome = jnp.where(last, int(Outcome.ARRIVED), int(Outcome.RUNNING))
        failed = jnp.where(retry, int(Outcome.RUNNING), jnp.where(defined, int(Outcome.COLLAPSED), int(Outcome.LOST)))
        outcome = jnp.where(moves, outcome, failed)
        crossing = steps_counted(current.crossing, step, duration, jumps | (low == 0.0))
        longest_so_far = jnp.maximum(current.longest, step)
        after = Progress(time_after[None], arrived, outcome, stuck, crossing, rest[None], longest_so_far)
        steps = RobotSteps(time, direction * step[None], polynomial, (short | jumps)[None])
        unmoved = current._replace(outcome=outcome, crossing=crossing)
        return jax.tree.map(lambda a, b: jnp.where(moves, a, b), after, unmoved), (steps, moves[None])

    flags, numbers = jnp.zeros((count, 1), bool), jnp.zeros((count, 1))
    polynomial = jax.tree.map(lambda x: jnp.zeros((count, order + 2, *x.shape)), current.state)
    return attempts(attempt, current, (RobotSteps(numbers, numbers, polynomial, flags), flags), count)
