"""Time stepping: choice, projection and check of steps, and their storage as polynomials."""

import enum
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.base.shapes import Numbers
from jounce.dynamics.forward.accelerations import Equations, Expansion, Flags, Indices, Lanes, State, expand
from jounce.execution.compilation import compiled
from jounce.execution.mapped import mapped
from jounce.integrate.steps import energy_balance, lookahead
from jounce.integrate.steps.lookahead import HARMLESS, JUMP, SHORTEST, steps_counted
from jounce.integrate.steps.methods import MARGIN, NEEDED, AbstractMethod, Number, near_singular
from jounce.integrate.steps.projection import projected
from jounce.integrate.steps.revolution_counts import AnglesOfForces, followed, measured
from jounce.jet import Jet
from jounce.kinematics.continuation.instant_program import of_design
from jounce.mechanism.transmissions.axis_angles import measures_angle

# relative to the time so far or the time left: a refused step that is shorter ends the run
SMALLEST_STEP = lookahead.FINEST / 8.0
# factor on a step that is tried again: not a power of two, so that it does not end where other steps have ended
REFUSED = 0.45
SHORT = 1.0 / 4.0  # of the longest step so far: shorter steps are allowed smaller errors, see `furthest`
STUCK = 64  # steps in a row that hardly advance and end a run: a force switches without end
AT_LEAST, AT_MOST = 64, 512  # least and most steps tried in a call; progress and events are checked between calls
NUMBERS = 2**16  # numbers of polynomials in a call: to allocate more takes longer than another call
FEW_RUNS, MANY_RUNS = 8, 64  # runs that XLA marches side by side; more do not fit into the cache
STUBBORN = 3  # refusals in a row that a smooth motion does not need: the step may begin at a kink


class Outcome(enum.IntEnum):
    """The outcome of a run."""

    RUNNING = 0
    ARRIVED = 1
    COLLAPSED = 2  # steps became too small to advance
    LOST = 3  # the motion is not finite from the start
    UNEXPANDED = 4  # the first attempt expands the motion at the start
    UNBALANCED = 5  # the energy would change, though nothing adds or removes energy


MOVING = np.array([Outcome.RUNNING, Outcome.UNEXPANDED])


class IntegratorState(NamedTuple):
    """The current state of a batch of runs."""

    time: Lanes  # s
    rest: Lanes  # rounding remainder of the time, to be added to it, s
    expansion: Expansion
    refused: Indices  # number of consecutive refusals from this state
    outcome: Indices  # see Outcome
    mobility: Float[Numbers, "body batch"]  # mobility of the bodies, from `mobility_of`
    singular: Flags  # whether the equations of motion are nearly singular
    blocked: Indices  # index of the force or law that blocks steps from this state, or -1
    angles: AnglesOfForces  # angles about axes that forces measure, with their revolutions, rad, from `measured`
    longest: Lanes  # longest step so far, s
    crossing: Indices  # number of consecutive negligibly short steps over an unresolved force or law
    short: Indices  # number of consecutive steps that hardly advance
    balance: energy_balance.Balance  # energy balance, if energy is conserved


class RunLimits(NamedTuple):
    """The end of runs, and bounds of their steps."""

    stop: Number  # s; the last step ends exactly at it
    tolerance: Number  # error of a step, rad or sizes of the mechanism
    longest: Number | Float[Numbers, "*batch"]  # longest step, s
    start: Number  # beginning of the runs, s


class DenseOutput(NamedTuple):
    """Consecutive steps as polynomials; while they are taken, the batch is the last axis.

    Attributes
    ----------
    start, length : array of shape (steps,)
        s; lengths are negative backward in time.
    polynomial : State
        Coefficients in the time from the start, (steps, order + 1, components, bodies).
    kink : array of int, shape (steps,)
        Index, in `watched_names`, of a force or law that a negligibly short step does not resolve, or -1.
    angles : tuple of array of shape (steps, instances)
        Angles about axes at the starts, rad, for each group of forces that measures them.
    """

    start: Float[Any, "steps *batch"]
    length: Float[Any, "steps *batch"]
    polynomial: State
    kink: Int[Any, "steps *batch"]
    angles: tuple[Float[Any, "steps instance *batch"], ...]

    @property
    def end(self) -> float:
        """End of the last step, s."""
        return float(self.start[-1] + self.length[-1])


def unexpanded(equations: Equations, state: State, time: Lanes, *, order: int) -> IntegratorState:
    """Return the start of runs from states on the constraints; the first attempt of `march` expands the motion.

    Angles about axes have the revolutions of their reference angles in the equations. All arrays but these angles are
    NumPy arrays.
    """
    *_, bodies, lanes = state.position.shape
    size, columns = equations.system.shape
    series = state.map(lambda known: np.zeros((order + 1, *known.shape)))
    for whole, known in zip(series, state, strict=True):
        whole[0] = known
    expansion = Expansion(series, np.zeros((1, columns // bodies, bodies, lanes)), np.zeros((1, size, lanes)))
    nothing, none = np.zeros(time.shape), np.zeros(time.shape, int)
    return IntegratorState(
        time=time,
        rest=nothing,
        expansion=expansion,
        refused=none,
        outcome=np.full(time.shape, int(Outcome.UNEXPANDED)),
        mobility=np.zeros((bodies + 1, lanes)),
        singular=np.zeros(time.shape, bool),
        blocked=np.full(time.shape, -1),
        angles=_measured(equations, state) if any(map(measures_angle, equations.system.forces)) else (),
        longest=nothing,
        crossing=none,
        short=none,
        balance=energy_balance.unknown(nothing),
    )


@compiled(narrow=True)
def _measured(equations: Equations, state: State) -> AnglesOfForces:
    return measured(equations, state)


@compiled("count")
def march(
    equations: Equations, current: IntegratorState, limits: RunLimits, *, method: AbstractMethod, count: int
) -> tuple[IntegratorState, tuple[DenseOutput, Bool[Numbers, "steps batch"]], Int[Numbers, ""]]:
    """Take up to `count` steps of a run; `march_runs` advances many runs.

    Parameters
    ----------
    equations : Equations
        Equations of motion of the mechanism.
    current : IntegratorState
        State to continue from.
    limits : RunLimits
        End of the run, and bounds of its steps.
    method : AbstractMethod
        Integration method.
    count : int
        Largest number of attempts.

    Returns
    -------
    current : IntegratorState
    steps : tuple of DenseOutput and array of bool, shape (steps, batch)
        Attempted steps in their order, and whether they were taken.
    tried : int
        Number of attempts.
    """
    attempt = _attempt(equations, current, limits, method)
    return attempts(attempt, current, room_for_steps(method, current, count), count)


def attempts(attempt: Callable[[Any], tuple[Any, Any]], current: Any, room: Any, count: int) -> tuple[Any, Any, Any]:
    """Return the state after up to `count` attempts, the buffer filled with their steps, and their number."""

    def unfinished(carry: Any) -> Any:
        current, _, tried = carry
        return jnp.any(jnp.isin(current.outcome, MOVING)) & (tried < count)

    def iterate(carry: Any) -> Any:
        current, previous, tried = carry
        current, steps = attempt(current)
        previous = jax.tree.map(lambda k, s: jax.lax.dynamic_update_index_in_dim(k, s, tried, 0), previous, steps)
        return current, previous, tried + 1

    return jax.lax.while_loop(unfinished, iterate, (current, room, 0))


@mapped(widths=(FEW_RUNS, MANY_RUNS))
def march_runs(
    shared: tuple[Any, RunLimits],
    lanes: tuple[dict[int, Any], IntegratorState],
    *,
    method: AbstractMethod,
    steps: int,
) -> tuple[IntegratorState, tuple[DenseOutput, Bool[Numbers, "steps batch"]]]:
    """Take steps as `march` does, for runs that differ in values of their mechanism, each until it ends.

    Parameters
    ----------
    shared : tuple
        Equations, or a tuple that begins with them; and limits, as for `march`.
    lanes : tuple
        For each run: its `own` values, as for `of_design`, and the state to continue from.
    method, steps
        As `method` and `count` of `march`.

    Returns
    -------
    current : IntegratorState
    steps : tuple
        As from `march`; after its end, a run repeats its last step as not taken.
    """
    (values, limits), (own, current) = shared, lanes
    equations, *_ = of_design(values, own)
    attempt = _attempt(equations, current, limits, method)

    def turn(k: Any, carry: Any) -> Any:
        current, previous = carry

        def stand(current: IntegratorState) -> tuple[IntegratorState, tuple[DenseOutput, Any]]:
            before = jnp.maximum(k - 1, 0)
            last, taken = (jax.tree.map(lambda part: part[before], x) for x in previous)
            return current, (last, jnp.zeros_like(taken))

        current, steps = jax.lax.cond(jnp.any(jnp.isin(current.outcome, MOVING)), attempt, stand, current)
        put = jax.lax.dynamic_update_index_in_dim  # one index for all runs; otherwise each run would need its own
        return current, jax.tree.map(lambda x, s: put(x, s, k, 0), previous, steps)

    return jax.lax.fori_loop(0, steps, turn, (current, room_for_steps(method, current, steps)))


def _attempt(
    equations: Equations, current: IntegratorState, limits: RunLimits, method: AbstractMethod
) -> Callable[[IntegratorState], tuple[IntegratorState, tuple[DenseOutput, Any]]]:
    """Return a function that attempts a step of each run that has not ended; arguments as for `march`."""
    stop, tolerance, longest, started = limits
    length, duration = equations.system.column_scale[0], jnp.abs(stop - started)
    order, bodies = len(current.expansion.state.position) - 1, current.expansion.state.position.shape[2]
    first_state = current.expansion.state.map(lambda part: part[0])
    checked = method.controlled and energy_balance.is_balanced(equations, first_state, current.time[None])

    def attempt(current: IntegratorState) -> tuple[IntegratorState, tuple[DenseOutput, Any]]:
        running, opening = (current.outcome == int(x) for x in (Outcome.RUNNING, Outcome.UNEXPANDED))
        left = stop - current.time - current.rest

        # length of the step: as far as the series converges, and as the lookahead permits
        usual = SHORT * current.longest
        start, reach, allowed = method.prepared(current.expansion, length, tolerance, current.singular, usual)
        wished = jnp.minimum(reach, jnp.minimum(longest, jnp.abs(left)))
        tried = wished * REFUSED ** current.refused.astype(float)
        step = jnp.sign(left) * tried
        angles = followed(equations, current.angles, start.state, step)
        if method.controlled:
            shortest = lookahead.finest(duration, current.time, current.crossing + current.refused)
            how = current.mobility, current.time, step, duration, allowed, shortest
            look = lookahead.look_ahead(equations, start.state, angles, *how)
        else:
            look = lookahead.Lookahead(step, jnp.ones(step.shape, bool), jnp.full(step.shape, -1), current.blocked)
        size = jnp.abs(look.step)
        last = size >= 0.999 * jnp.abs(left)  # no sliver of a step at the end
        step = jnp.where(last, left, jnp.sign(left) * size)
        since = step + current.rest
        time = jnp.where(last, stop, current.time + since)
        rest = jnp.where(last, 0.0, since - (time - current.time))
        step = jnp.where(running, step, 0.0)
        time, rest = (jnp.where(running, x, y) for x, y in ((time, current.time), (rest, current.rest)))

        # end of the step
        counted = equations.near(angles.at(step))
        arrived = method.arrive(counted, start, current.time, step)
        state, distance, inverse = projected(counted, arrived, time[None])
        state = jax.tree.map(lambda a, b: jnp.where(opening, a, b), arrived, state)  # already on the constraints
        expansion = expand(counted, state, time[None], order, inverse)
        acceleration, multipliers = expansion.acceleration[:1], expansion.multipliers[:1]  # no step needs their rates
        expansion = expansion._replace(acceleration=acceleration, multipliers=multipliers)
        error = method.error(start, expansion, step, length)
        polynomial = method.polynomial(start, expansion, step)

        # acceptance
        good = _finite(expansion) & jnp.isfinite(distance) & (error <= MARGIN * allowed) & running & look.resolved
        if method.controlled:
            suspect = (look.kink >= 0) & (size < tried) | (current.refused >= STUBBORN)
            kick = 0.5 * order * (order + 1) * error
            good = good & ~(suspect & _kick_matters(kick, step, duration, MARGIN * allowed, current))
            good = good & (distance <= jnp.maximum(JUMP, MARGIN * allowed))  # farther away, a motion law has jumped
        balanced, balance = jnp.ones(step.shape, bool), current.balance
        if checked:
            energies = energy_balance.energies(counted, counted.pose(state), Jet.variable(time[None], 1))
            kick = MARGIN * allowed * order / jnp.maximum(wished, 1e-300)
            leeway = kick * length * jnp.sqrt(equations.scale * bodies)
            balance, balanced = energy_balance.followed(current.balance, energies, leeway)
            at_start = energy_balance.initial_balance(energies)
            balance = jax.tree.map(lambda a, b: jnp.where(opening, a, b), at_start, balance)
            good = good & balanced

        # outcome of the run
        tiny = jnp.abs(step) < SMALLEST_STEP * jnp.maximum(jnp.abs(current.time), jnp.abs(stop - current.time))
        broken = current.balance.broken | (running & ~balanced)
        stopped = jnp.where(~broken, int(Outcome.COLLAPSED), int(Outcome.UNBALANCED))
        opened = jnp.where(_finite(expansion), int(Outcome.RUNNING), int(Outcome.LOST))
        outcome = jnp.where(good & last, int(Outcome.ARRIVED), current.outcome)
        outcome = jnp.where(running & ((~good & tiny) | (current.short >= STUCK)), stopped, outcome)
        outcome = jnp.where(opening, opened, outcome)
        farthest = jnp.where(reach > longest, jnp.minimum(jnp.minimum(reach, longest / SHORT), duration), jnp.abs(step))
        short = steps_counted(current.short, step, duration)
        limiting = jnp.where(look.limiting >= 0, look.limiting, current.blocked)
        singular = near_singular(equations, inverse)
        advanced = IntegratorState(
            time=time,
            rest=rest,
            expansion=expansion,
            refused=jnp.zeros_like(current.refused),
            outcome=outcome,
            mobility=lookahead.mobility_of(equations, inverse),
            singular=singular,
            blocked=jnp.where(short > 0, limiting, -1),
            angles=measured(counted, state),
            longest=jnp.maximum(current.longest, farthest),
            crossing=steps_counted(current.crossing, step, duration, look.kink >= 0),
            short=short,
            balance=balance._replace(broken=balance.broken & (short > 0)),
        )
        # a step that would end next to a singular position is tried again as one that passes it
        refused = current._replace(
            refused=current.refused + jnp.where(singular & ~current.singular, 0, 1),
            singular=current.singular | singular,
            outcome=outcome,
            blocked=jnp.where(look.resolved, current.blocked, look.limiting),
            balance=current.balance._replace(broken=broken),
        )
        steps = DenseOutput(current.time, step, polynomial, look.kink, current.angles), good
        return jax.tree.map(lambda a, b: jnp.where(good | opening, a, b), advanced, refused), steps

    return attempt


def steps_between_looks(numbers: int, *, watched: bool) -> int:
    """Return the number of steps tried in a call: few if an event may end the run, or if polynomials are long.

    Parameters
    ----------
    numbers : int
        Number of coefficients of the polynomials of a step.
    watched : bool
        Whether events are detected.
    """
    return AT_LEAST if watched else min(max(NUMBERS // numbers, AT_LEAST), AT_MOST)


def room_for_steps(
    method: AbstractMethod, current: IntegratorState, count: int
) -> tuple[DenseOutput, Bool[Numbers, "steps batch"]]:
    """Return an empty buffer for steps and whether they were taken."""
    time, expansion = current.time, current.expansion
    polynomial = jax.eval_shape(method.polynomial, expansion, expansion, time)
    room = DenseOutput(time, time, polynomial, current.blocked, current.angles), current.singular
    return jax.tree.map(lambda part: jnp.zeros((count, *part.shape), part.dtype), room)


def _kick_matters(kick: Lanes, step: Lanes, duration: Number, bound: Lanes, current: IntegratorState) -> Flags:
    """Return whether a kink at the beginning of a step displaces bodies by more than is harmless in the run.

    Beside a kink, the error of the accelerations at the end is not the next term of a series: `kick` is the
    displacement in the step by accelerations that are wrong throughout.
    """
    duration = jnp.maximum(duration, jnp.abs(step))
    moved = kick * duration / jnp.maximum(jnp.abs(step), SHORTEST * duration)
    return (moved > jnp.maximum(bound, HARMLESS)) & (jnp.abs(step) > SHORTEST * duration) & ~current.singular


def _finite(expansion: Expansion) -> Flags:
    needed = [x[:NEEDED] for x in jax.tree.leaves(expansion)]
    parts = [jnp.all(jnp.isfinite(x.reshape(-1, x.shape[-1])), axis=0) for x in needed]
    return jnp.all(jnp.stack(parts), axis=0)
