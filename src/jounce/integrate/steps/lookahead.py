"""Lookahead: the check of forces, motion laws and joints along a step before it is taken.

A pulse that lies ahead in time or space leaves no trace in a Taylor series, and both ends of a long step may lie beside
it. Forces and laws are therefore evaluated along the polynomial of the step at many instants, and compared with their
interpolation from a few nodes, which is accurate to rounding for a function that is analytic over the step. If they
differ, and the difference would move the mechanism, the step is halved. The same applies if the residual of a joint
does not vanish along the step, for joints that a series could overlook (`is_plain`). Few instants do for forces such as
those of springs, whose only singularities are zeros of radicands and denominators, over steps without such a zero.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.dynamics.forward.accelerations import Equations, Flags, Indices, Instants, Inverse, Lanes, State
from jounce.dynamics.forward.ground import with_ground
from jounce.integrate.steps.events import INTERPOLATION, NODES
from jounce.integrate.steps.exact_programs import is_plain, radicands_and_denominators
from jounce.integrate.steps.methods import MARGIN, Number, evaluated
from jounce.integrate.steps.revolution_counts import Angles
from jounce.jet import Jet
from jounce.mechanism import Model
from jounce.mechanism.building.builder import group_rows, named_groups
from jounce.mechanism.building.element_indices import force_names
from jounce.mechanism.laws.driver_outputs import is_turning
from jounce.mechanism.system import Group, law_left_out
from jounce.mechanism.transmissions.axis_angles import with_turns

POINTS = 32  # of a step that are evaluated
ROUNDS_OF_JOINTS = 4  # factor on their number if joints are watched
RUN_POINTS = 8192  # least number of points in the whole run, if there are few steps
HARMLESS = 1e-15  # displacement of a body that may be overlooked, rad or sizes of the mechanism
ELLIPSE = 1.1  # parameter (sum of semi-axes) of the Bernstein ellipse around a step that has to be free of zeros
SHAKE = 2.0**-51  # relative change of state and time that measures the rounding error of a force
SPARSE = 7  # every so many nodes are changed, in both directions, as a jump beside a node shows in one only
_SHAKEN = (np.tile(NODES[::SPARSE], 2), np.repeat([SHAKE, -SHAKE], len(NODES[::SPARSE])))
NOISE = 16.0  # multiple of the measured rounding error up to which a difference counts as rounding
FAINT = 1e-13  # part of a force: rounding error of its interpolation
SHORTEST = 1e-12  # part of the run: the longest step over a jump of a force
FINEST = 2.0**-60  # part of the run: the first length tried for such a step, about the rounding of positions and times
COARSER = 4.0  # factor on that length after a step that has not crossed the jump, whose position depends on rounding
AWAY = 1e-9  # part of the run: a longer step leaves the last jump behind
JUMP = 1e-6  # largest jump of a motion law or a joint in so short a step, rad or sizes of the mechanism
GAP = 1e-12  # largest residual of joints along a step unless the tolerance allows more, rad or sizes of the mechanism
NEAR = 1.0 / 16.0  # relative distance to the first unresolved point at which a step ends


BodyMobility = Float[Numbers, "body batch"]
"""Mobility of each body, the ground first, from `mobility_of`."""

Signals = Float[Numbers, "instance batch"]
"""One number for each force and law."""


class Lookahead(NamedTuple):
    """The result of a lookahead; arrays of shape (batch,)."""

    step: Lanes  # s, shortened if needed
    resolved: Flags  # whether forces and laws are resolved over the step
    kink: Indices  # index in `watched_names` of a force or law that a negligibly short step does not resolve, or -1
    limiting: Indices  # index of the force or law that shortened the step


def mobility_of(equations: Equations, inverse: Inverse) -> BodyMobility:
    """Return the mobility of each body, from the inverse of the matrix of the equations.

    It is the largest acceleration, rad or sizes of the mechanism by s^2, caused by a unit force on one of the scaled
    coordinates of the body; for a large mechanism, a bound of it.
    """
    columns, count = equations.system.shape[1], equations.coordinates
    responses = inverse.responses(columns)[0]
    responses = responses.reshape(-1, count, responses.shape[-1])
    return with_ground(jnp.max(responses, axis=1)[None])[0] / equations.scale


def watched_names(model: Model) -> list[str]:
    """Return the names of the forces, drivers and constraints of a model, in the order of the lookahead."""
    constraints = [name for _, members in named_groups(model) for name in members]
    return [f"forces.{name}" for name in force_names(model)] + list(model.drivers) + constraints


def constraints_to_watch(
    equations: Equations, state: State, time: Instants
) -> dict[int, Float[Numbers, "row instance 1"]]:
    """Return the groups of constraints with residuals that a series could overlook, with the scales of their rows.

    Residuals of drivers are taken without their laws, which are watched separately.
    """
    pose, clock = equations.pose_at_rest(state.position, state.attitude), Jet([time])
    names, first = {}, 0
    for k, group in enumerate(equations.system.groups):
        part = law_left_out(group) if group.is_driver else group
        program = jax.make_jaxpr(lambda pose, clock, part=part: part.residual(pose, clock).coefficients[0])(pose, clock)
        rows, count = program.out_avals[0].shape[0], group.instances
        if not is_plain(program):
            names[k] = equations.system.row_scale[first : first + rows * count].reshape(rows, count, -1)
        first += rows * count
    return names


def hiding_names(model: Model, equations: Equations, state: State, time: Instants) -> list[str]:
    """Return the names of the constraints that a series could overlook."""
    rows, hidden = group_rows(model), constraints_to_watch(equations, state, time)
    return [name for k in hidden for name in model.rows[rows[k]][: model.system.groups[k].instances]]


def look_ahead(
    equations: Equations,
    path: State,
    angles: Angles,
    mobility: BodyMobility,
    time: Lanes,
    step: Lanes,
    duration: Number,
    bound: Lanes,
    shortest: Lanes,
) -> Lookahead:
    """Return the longest step over which all forces, motion laws and joints are resolved.

    Parameters
    ----------
    equations : Equations
        Equations of motion of the mechanism.
    path : State
        Polynomials of the step in the time from its beginning, (order + 1, components, bodies, batch).
    angles : Angles
        Angles that forces measure along the step.
    mobility : array of shape (bodies, batch)
        Mobility of the bodies, from `mobility_of`.
    time, step : array of shape (batch,)
        Beginning and length of the step, s; the length is negative backward in time.
    duration : float
        Duration of the whole run, s: longer steps relative to it are evaluated at more points.
    bound : array of shape (batch,)
        Displacement of a body that may be overlooked, rad or sizes of the mechanism.
    shortest : array of shape (batch,)
        Length of a step that may cross a jump of a force, s, from `finest`.
    """
    signals, blank = _Signals(equations, path, angles, time), jnp.full(step.shape, -1)
    if not signals.numbers.size:
        return Lookahead(step, jnp.ones(step.shape, bool), blank, blank)
    bound = jnp.maximum(bound, HARMLESS)

    def seen(part: Any) -> Lookahead:
        departure, displacement = signals.departure(part * step, duration, mobility)
        is_short = jnp.abs(part * step) <= shortest
        ratio = jnp.where(jnp.isfinite(displacement), displacement / signals.allowed(bound, is_short), jnp.inf)
        resolved, index = jnp.all(ratio <= 1.0, axis=0), jnp.asarray(signals.numbers)[jnp.argmax(ratio, axis=0)]
        return Lookahead(part, resolved, jnp.where(jnp.any(departure > 0, axis=0), index, -1), index)

    def open_(low: Any, high: Any) -> Any:
        return jnp.where(low > 0, high - low > NEAR * low, high * jnp.abs(step) > 0.25 * shortest)

    def narrowed(carry: Any) -> tuple[Any, ...]:
        low, high, best, is_started = carry
        inside = jnp.where(open_(low, high), jnp.where(low > 0, 0.5 * (low + high), 0.5 * high), low)
        result = seen(jnp.where(is_started, inside, 1.0))
        is_better = result.resolved & (result.step > low)
        best = jax.tree.map(lambda new, old: jnp.where(is_better | ~is_started, new, old), result, best)
        limiting = jnp.where(result.resolved, best.limiting, result.limiting)
        high = jnp.where(result.resolved, high, result.step)
        return jnp.where(is_better, result.step, low), high, best._replace(limiting=limiting), jnp.ones((), bool)

    def unfinished(carry: Any) -> Any:
        low, high, _, is_started = carry
        return ~is_started | jnp.any(open_(low, high))

    # the whole step is the first iteration of the loop, so that the large code of `seen` is compiled once
    none, ones = jnp.zeros(step.shape), jnp.ones(step.shape)
    blank_result = Lookahead(none, jnp.zeros(step.shape, bool), blank, blank)
    low, high, best, _ = jax.lax.while_loop(unfinished, narrowed, (none, ones, blank_result, jnp.zeros((), bool)))
    kink = jnp.where(best.resolved, best.kink, -1)
    return Lookahead(step * jnp.where(low > 0, low, high), low > 0, kink, best.limiting)


def finest(duration: Numbers, time: Numbers, crossing: Numbers) -> Numbers:
    """Return the allowed length of a step over a jump, s, after `crossing` steps that have not crossed it."""
    fraction = jnp.minimum(FINEST * COARSER ** crossing.astype(float), SHORTEST)
    return fraction * jnp.maximum(duration, jnp.abs(time))


def steps_counted(
    before: Numbers, step: Numbers, duration: Numbers, count: Numbers | bool = True, longest: float = SHORTEST
) -> Numbers:
    """Return the number of consecutive short steps, incremented if the step is short and `count` is true.

    A step is short if it is at most `longest` times the duration.
    """
    is_short = jnp.abs(step) <= longest * duration
    return jnp.where(is_short & count, before + 1, jnp.where(jnp.abs(step) > AWAY * duration, 0, before))


class _Signals:
    """The watched values along a step: forces, motion laws, and residuals of joints that a series could overlook.

    Arrays have the instances and the batch last. `numbers` has the index of each instance in `watched_names`.
    """

    def __init__(self, equations: Equations, path: State, angles: Angles, time: Lanes):
        forces, groups = equations.system.forces, equations.system.groups
        drivers = tuple(group for group in groups if group.is_driver)
        counts = [group.instances for group in (*forces, *drivers, *groups)]
        watched = constraints_to_watch(equations, path.map(lambda part: part[0]), time[None])
        joints = [groups[k] for k in watched]
        bodies = sorted({body for group in (*forces, *joints) for slot in group.bodies for body in slot} - {0})
        columns = {body: k for k, body in enumerate([0, *bodies])}

        def among_these(group: Group) -> Group:
            return Group(group.element, tuple(tuple(columns[body] for body in slot) for slot in group.bodies))

        self._equations, self._time, self._drivers, self._given = equations, time, drivers, forces
        self._angles = angles
        self._forces = [among_these(group) for group in forces]
        self._joints = [(among_these(group), scale) for group, scale in zip(joints, watched.values(), strict=True)]
        self._path = path.map(lambda part: part[:, :, np.array(bodies, int) - 1])  # of the bodies that these act on
        first, law_count = np.cumsum([0, *counts]), len(forces) + len(drivers)
        group_indices = [*range(law_count), *(law_count + k for k in watched)]
        self.numbers = np.concatenate([np.arange(first[k], first[k + 1]) for k in group_indices] + [np.zeros(0, int)])
        length = equations.system.column_scale[0]
        steady = [jnp.full(group.instances, 1.0 if is_turning(group.element) else length) for group in drivers]
        joint_limits = jnp.ones(sum(group.instances for group in joints))
        unlimited = jnp.full(sum(counts[: len(forces)]), jnp.inf)
        self._noisiest = jnp.concatenate([unlimited, *(JUMP * part for part in (*steady, joint_limits))])
        self._split = sum(counts[: len(forces)]), sum(counts[:law_count])

    def allowed(self, bound: Lanes, short: Flags) -> Signals:
        """Return the allowed departures; over the shortest steps forces may jump, laws and joints hardly."""
        forces, laws = self._split
        index = np.arange(len(self.numbers))[:, None]
        bounds = jnp.where(index < laws, bound[None], jnp.maximum(MARGIN * bound, GAP)[None])
        jump = jnp.where(index < forces, jnp.finfo(float).max, jnp.maximum(JUMP, bound)[None])
        return jnp.where(short[None], jump, bounds)

    def departure(self, step: Lanes, duration: Number, mobility: BodyMobility) -> tuple[Signals, Signals]:
        """Return the departures of forces and laws from their interpolation, and the displacements that they cause.

        The departures of joints are their residuals. Possible rounding is subtracted. Displacements are in rad or sizes
        of the mechanism; that of a force is the effect of its departure on bodies until the end of the run.
        """
        points, shakes = (np.concatenate(parts) for parts in zip((NODES, 0.0 * NODES), _SHAKEN, strict=True))
        signals = jax.vmap(lambda s, shake: self._values(s * step, shake))(points, shakes)
        knots, perturbed = signals[: len(NODES)], signals[len(NODES) :]
        coefficients = _combined(INTERPOLATION, knots)
        if self._joints:
            is_followed = (np.arange(len(self.numbers)) < self._split[1])[None, None, :, None]
            coefficients = jnp.where(is_followed, coefficients, 0.0)
        fewest = ROUNDS_OF_JOINTS if self._joints else 1
        rounds_needed = jnp.max(jnp.where(duration > 0, jnp.abs(step) / duration, 0.0)) * (RUN_POINTS / POINTS)
        rounds_needed = jnp.where(self._is_analytic(step), 0.0, rounds_needed)
        rounds = jnp.clip(jnp.ceil(rounds_needed), fewest, RUN_POINTS // POINTS)
        count = rounds * POINTS
        size = jnp.max(jnp.abs(knots), axis=0)
        perturbed = jnp.abs(perturbed.reshape(2, -1, *perturbed.shape[1:]) - knots[None, ::SPARSE])
        noise = NOISE * jnp.max(jnp.min(perturbed, axis=0), axis=0) + FAINT * size
        noise = jnp.minimum(noise, self._noisiest[None, :, None])  # a jump at a node is no rounding

        def look(k: Any, carry: tuple[Any, Any]) -> tuple[Any, Any]:
            fractions = (k * POINTS + jnp.arange(POINTS)).astype(float) / (count - 1.0)  # both ends too
            signals = jax.vmap(lambda s: self._values(s * step, 0.0))(fractions)
            gap = jnp.abs(signals - _combined(_chebyshev(2.0 * fractions - 1.0).T, coefficients))
            gap = jnp.maximum(gap - jnp.maximum(noise[None], FAINT * jnp.abs(signals)), 0.0)
            return jnp.maximum(carry[0], jnp.max(gap, axis=0)), carry[1] + jnp.sum(gap, axis=0)

        largest, total = jax.lax.fori_loop(0, rounds.astype(int), look, (jnp.zeros_like(size), jnp.zeros_like(size)))
        largest, mean = jnp.max(largest, axis=0), jnp.max(total, axis=0) / count
        return largest, self._moved(largest, mean * jnp.abs(step * duration)[None], mobility)

    def _is_analytic(self, step: Lanes) -> Any:
        """Return whether forces, laws and joints are analytic in an ellipse around the step: such hide no pulse.

        They are if they have no operations but those of `radicands_and_denominators`, and if these have no zero there:
        the constant in their Chebyshev series then exceeds the sum of all other terms at any point of the ellipse.
        """

        def divisors(elapsed: Any) -> Any:
            return radicands_and_denominators(lambda *given: self._parts(*given), *self._state(elapsed, 0.0))

        if jax.eval_shape(divisors, step) is None:
            return False
        is_nonzero = [jnp.ones((), bool)]
        for values in jax.vmap(lambda s: divisors(s * step))(NODES):
            series = jnp.abs(jnp.sum(INTERPOLATION[:, :, None] * values.reshape(1, len(NODES), -1), axis=1))
            largest = ELLIPSE ** np.arange(1, len(series))  # of the Chebyshev polynomials in the ellipse
            is_nonzero.append(jnp.all(series[0] > jnp.sum(largest[:, None] * series[1:], axis=0)))
        return jnp.all(jnp.stack(is_nonzero))

    def _moved(self, largest: Signals, impulse: Signals, mobility: BodyMobility) -> Signals:
        """Return the displacements of bodies by departures of forces, from their impulses in N s^2, and of laws."""
        length, parts, first = self._equations.system.column_scale[0], [], 0
        for group in self._given:
            response = jnp.max(jnp.stack([mobility[np.array(slot)] for slot in group.bodies]), axis=0)
            lever = length if group.element.unit == "N" else 1.0
            parts.append(impulse[first : first + group.instances] * response * lever)
            first += group.instances
        for group in self._drivers:
            departure = largest[first : first + group.instances]
            parts.append(departure if is_turning(group.element) else departure / length)
            first += group.instances
        return jnp.concatenate([*parts, largest[first:]])

    def _values(self, elapsed: Lanes, shake: Float[Numbers, ""] | float) -> Float[Numbers, "component instance batch"]:
        """Return the watched values at a time from the beginning of the step.

        With `shake`, time and all coordinates have relative changes of this size, with different signs.
        """
        parts = self._parts(*self._state(elapsed, shake))
        row_count = max(len(part) for part in parts)
        padded = [jnp.pad(part, ((0, row_count - len(part)), (0, 0), (0, 0))) for part in parts]
        return jnp.concatenate([jnp.broadcast_to(p, (*p.shape[:2], elapsed.shape[-1])) for p in padded], axis=1)

    def _state(self, elapsed: Lanes, shake: Any) -> tuple[Lanes, State | None, Any]:
        """Return the instant, the state of the bodies that forces and joints act on, and the angles they measure."""
        time = (self._time + elapsed) * (1.0 + shake)
        if not (self._forces or self._joints):
            return time, None, None
        state = evaluated(self._path, elapsed).map(lambda part: part * (1.0 + shake * _signs(part.shape[:2])))
        return time, state, self._angles.at(elapsed)

    def _parts(self, time: Lanes, state: State | None, turns: Any) -> list[Any]:
        """Return the watched values, (components, instances, batch) of each group."""
        clock, parts = Jet.variable(time[None], 1), []
        pose: Any = None if state is None else self._equations.pose(state)
        if self._forces:
            parts += [group.force(pose, clock).coefficients[0] for group in with_turns(self._forces, turns)]
        for group in self._drivers:
            law = group.element.motion(clock).coefficients[0]
            parts.append(jnp.broadcast_to(law, (group.instances, time.shape[-1]))[None])
        for group, scale in self._joints:
            parts.append(group.residual(pose.truncate(0), clock.truncate(0)).coefficients[0] * scale)
        return parts


def _combined(
    weights: Float[Numbers, "place node"], values: Float[Numbers, "node component instance batch"]
) -> Float[Numbers, "place component instance batch"]:
    """Return weighted sums of values, written out, since XLA would call a library for a matrix product."""
    return jnp.sum(weights[:, :, None, None, None] * values[None], axis=1)


def _signs(shape: tuple[int, ...]) -> Float[np.ndarray, "component body 1"]:
    """Return irregular signs for components of bodies, to which no force is likely to be blind."""
    components, bodies = (np.arange(n) for n in shape)
    return np.where(np.sin(1.0 + 3.0 * components[:, None] + 5.0 * bodies**2) > 0, 1.0, -1.0)[:, :, None]


def _chebyshev(x: Float[Numbers, " place"]) -> Float[Numbers, "polynomial place"]:
    """Return the Chebyshev polynomials at some points."""
    polynomials = [jnp.ones_like(x), x]
    while len(polynomials) < len(INTERPOLATION):
        polynomials.append(2.0 * x * polynomials[-1] - polynomials[-2])
    return jnp.stack(polynomials)
