"""What a step would pass over unseen: forces, motion laws and joints, looked at along its path before it is taken.

A Taylor series knows what it has met. A pulse that lies ahead, in time or in place, leaves no trace in it, and both
ends of a long step may lie beside the pulse. So forces and laws are evaluated on the polynomial of the step at many
instants, and compared with the polynomial through a few of them: what is analytic over a step is given by these to
rounding. Where they disagree, and where that would move the mechanism, the step is halved. So it is where the residual
of a joint does not vanish all along: of those that a series could overlook, as `is_plain` tells.
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
from jounce.integrate.steps.exact_programs import is_plain
from jounce.integrate.steps.methods import MARGIN, Number, evaluated
from jounce.integrate.steps.revolution_counts import Angles
from jounce.jet import Jet
from jounce.mechanism import Model
from jounce.mechanism.building.builder import group_rows, named_groups
from jounce.mechanism.building.element_indices import force_names
from jounce.mechanism.laws.driver_outputs import is_turning
from jounce.mechanism.system import Group, law_left_out
from jounce.mechanism.transmissions.axis_angles import with_turns

POINTS = 32  # of a step at which it is looked at
ROUNDS_OF_JOINTS = 4  # factor on their number where joints are looked at
RUN_POINTS = 8192  # points in the whole run at least, where there are few steps
HARMLESS = 1e-15  # displacement of a body by something overlooked that does no harm, rad or sizes of the mechanism
SHAKE = 2.0**-51  # relative change of state and time by which the rounding error of a force is measured
SPARSE = 7  # one node in so many serves that, changed both ways: a jump beside it shows in one direction only
_SHAKEN = (np.tile(NODES[::SPARSE], 2), np.repeat([SHAKE, -SHAKE], len(NODES[::SPARSE])))
NOISE = 16.0  # multiple of the measured change up to which a difference counts as rounding
FAINT = 1e-13  # part of a force: rounding error of the polynomial through its values
SHORTEST = 1e-12  # part of the run: the longest step over a jump of a force
FINEST = 2.0**-60  # part of the run: the first length tried for such a step, about the rounding of positions and times
COARSER = 4.0  # factor on that length each time that it has not led over the jump, whose place depends on rounding
AWAY = 1e-9  # part of the run: after a step so long the last jump is left behind
JUMP = 1e-6  # largest jump of a motion law or a joint in so short a step, rad or sizes of the mechanism
GAP = 1e-12  # largest residual of joints on the way unless the tolerance allows more, rad or sizes of the mechanism
NEAR = 1.0 / 16.0  # part of the way to where forces and laws are no longer known: a step ends that close to it


BodyMobility = Float[Numbers, "body batch"]
"""How readily each body moves, the ground first, as `mobility_of` gives it."""

Signals = Float[Numbers, "instance batch"]
"""One number for each force and law."""


class Lookahead(NamedTuple):
    """What was seen ahead; arrays of shape (batch,)."""

    step: Lanes  # s, shortened where needed
    resolved: Flags  # whether forces and laws are known over it
    kink: Indices  # index in `watched_names` of one that is not, over a step too short to matter, or -1
    limiting: Indices  # index of the one for which it was shortened


def mobility_of(equations: Equations, inverse: Inverse) -> BodyMobility:
    """Return how readily generalized forces on each body move the mechanism, from the inverse of the matrix.

    The largest acceleration, in rad or sizes of the mechanism by s^2, by a force of one on one of the scaled
    coordinates of the body; of a large mechanism, a bound for it.
    """
    columns, count = equations.system.shape[1], equations.coordinates
    responses = inverse.responses(columns)[0]
    responses = responses.reshape(-1, count, responses.shape[-1])
    return with_ground(jnp.max(responses, axis=1)[None])[0] / equations.scale


def watched_names(model: Model) -> list[str]:
    """Return the names of the forces, drivers and constraints of a model, in the order in which they are looked at."""
    constraints = [name for _, members in named_groups(model) for name in members]
    return [f"forces.{name}" for name in force_names(model)] + list(model.drivers) + constraints


def constraints_to_watch(
    equations: Equations, state: State, time: Instants
) -> dict[int, Float[Numbers, "row instance 1"]]:
    """Return which groups of constraints have residuals that a series could overlook, and the scales of their rows.

    The law of a driver is looked at by itself.
    """
    pose, clock = equations.pose_at_rest(state.position, state.attitude), Jet([time])
    names, first = {}, 0
    for k, group in enumerate(equations.system.groups):
        bare = law_left_out(group) if group.is_driver else group
        program = jax.make_jaxpr(lambda pose, clock, bare=bare: bare.residual(pose, clock).coefficients[0])(pose, clock)
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
    """Return how far a step may go so that no force, no motion law and no joint on its way stays unseen.

    Parameters
    ----------
    equations : Equations
        Of the mechanism.
    path : State
        Polynomials of the step in the time from its beginning, (order + 1, components, bodies, batch).
    angles : Angles
        That forces measure along it.
    mobility : array of shape (bodies, batch)
        As `mobility_of` gives it.
    time, step : array of shape (batch,)
        Where the step begins, and its length, negative backward in time, s.
    duration : float
        Of the whole run, s: the longer the step in it, the more points it is looked at.
    bound : array of shape (batch,)
        By how much a body may move otherwise than seen, rad or sizes of the mechanism.
    shortest : array of shape (batch,)
        Step that may lead over a jump of a force, s: `finest`.
    """
    signals, blank = _Signals(equations, path, angles, time), jnp.full(step.shape, -1)
    if not signals.numbers.size:
        return Lookahead(step, jnp.ones(step.shape, bool), blank, blank)
    bound = jnp.maximum(bound, HARMLESS)

    def seen(part: Any) -> Lookahead:
        away, moved = signals.departure(part * step, duration, mobility)
        short = jnp.abs(part * step) <= shortest
        over = jnp.where(jnp.isfinite(moved), moved / signals.allowed(bound, short), jnp.inf)
        resolved, index = jnp.all(over <= 1.0, axis=0), jnp.asarray(signals.numbers)[jnp.argmax(over, axis=0)]
        return Lookahead(part, resolved, jnp.where(jnp.any(away > 0, axis=0), index, -1), index)

    def open_(low: Any, high: Any) -> Any:
        return jnp.where(low > 0, high - low > NEAR * low, high * jnp.abs(step) > 0.25 * shortest)

    def narrowed(carry: Any) -> tuple[Any, ...]:
        low, high, best, begun = carry
        inside = jnp.where(open_(low, high), jnp.where(low > 0, 0.5 * (low + high), 0.5 * high), low)
        look = seen(jnp.where(begun, inside, 1.0))
        better = look.resolved & (look.step > low)
        best = jax.tree.map(lambda new, old: jnp.where(better | ~begun, new, old), look, best)
        limiting = jnp.where(look.resolved, best.limiting, look.limiting)
        high = jnp.where(look.resolved, high, look.step)
        return jnp.where(better, look.step, low), high, best._replace(limiting=limiting), jnp.ones((), bool)

    def unfinished(carry: Any) -> Any:
        low, high, _, begun = carry
        return ~begun | jnp.any(open_(low, high))

    # the whole step is the first round of the loop, so that what is seen is a part of the program once, and a large one
    none, whole = jnp.zeros(step.shape), jnp.ones(step.shape)
    nothing = Lookahead(none, jnp.zeros(step.shape, bool), blank, blank)
    low, high, best, _ = jax.lax.while_loop(unfinished, narrowed, (none, whole, nothing, jnp.zeros((), bool)))
    kink = jnp.where(best.resolved, best.kink, -1)
    return Lookahead(step * jnp.where(low > 0, low, high), low > 0, kink, best.limiting)


def finest(duration: Numbers, time: Numbers, crossing: Numbers) -> Numbers:
    """Return how long a step over a jump may be, s, after so many that have not led over it."""
    longer = jnp.minimum(FINEST * COARSER ** crossing.astype(float), SHORTEST)
    return longer * jnp.maximum(duration, jnp.abs(time))


def steps_counted(
    before: Numbers, step: Numbers, duration: Numbers, count: Numbers | bool = True, longest: float = SHORTEST
) -> Numbers:
    """Return how many short steps follow one another, with one more where `count` says so.

    Short are steps of at most a part of the run, `longest`.
    """
    short = jnp.abs(step) <= longest * duration
    return jnp.where(short & count, before + 1, jnp.where(jnp.abs(step) > AWAY * duration, 0, before))


class _Signals:
    """What is looked at along the path of a step: forces, motion laws, and joints that a series could overlook.

    Arrays have the instances and the batch last. `numbers` tells where each instance is in `watched_names`.
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
        first, plain = np.cumsum([0, *counts]), len(forces) + len(drivers)
        seen = [*range(plain), *(plain + k for k in watched)]
        self.numbers = np.concatenate([np.arange(first[k], first[k + 1]) for k in seen] + [np.zeros(0, int)])
        length = equations.system.column_scale[0]
        steady = [jnp.full(group.instances, 1.0 if is_turning(group.element) else length) for group in drivers]
        rest = jnp.ones(sum(group.instances for group in joints))
        free = jnp.full(sum(counts[: len(forces)]), jnp.inf)
        self._noisiest = jnp.concatenate([free, *(JUMP * part for part in (*steady, rest))])
        self._split = sum(counts[: len(forces)]), sum(counts[:plain])

    def allowed(self, bound: Lanes, short: Flags) -> Signals:
        """Return what may be overlooked; over the shortest steps forces may jump, laws and joints hardly."""
        forces, laws = self._split
        index = np.arange(len(self.numbers))[:, None]
        least = jnp.where(index < laws, bound[None], jnp.maximum(MARGIN * bound, GAP)[None])
        jump = jnp.where(index < forces, jnp.finfo(float).max, jnp.maximum(JUMP, bound)[None])
        return jnp.where(short[None], jump, least)

    def departure(self, step: Lanes, duration: Number, mobility: BodyMobility) -> tuple[Signals, Signals]:
        """Return how far forces and laws are from the polynomials through the nodes of a step, and what that moves.

        Of joints, how far they are from being fulfilled. What may be rounding is taken off. The second is in rad or
        sizes of the mechanism: of a force, what its departure over the step moves bodies by in the whole run.
        """
        points, shakes = (np.concatenate(parts) for parts in zip((NODES, 0.0 * NODES), _SHAKEN, strict=True))
        signals = jax.vmap(lambda s, shake: self._values(s * step, shake))(points, shakes)
        knots, shaken = signals[: len(NODES)], signals[len(NODES) :]
        coefficients = _combined(INTERPOLATION, knots)
        if self._joints:
            followed = (np.arange(len(self.numbers)) < self._split[1])[None, None, :, None]
            coefficients = jnp.where(followed, coefficients, 0.0)
        least = ROUNDS_OF_JOINTS if self._joints else 1
        rounds_needed = jnp.max(jnp.where(duration > 0, jnp.abs(step) / duration, 0.0)) * (RUN_POINTS / POINTS)
        rounds = jnp.clip(jnp.ceil(rounds_needed), least, RUN_POINTS // POINTS)
        count = rounds * POINTS
        size = jnp.max(jnp.abs(knots), axis=0)
        shaken = jnp.abs(shaken.reshape(2, -1, *shaken.shape[1:]) - knots[None, ::SPARSE])
        noise = NOISE * jnp.max(jnp.min(shaken, axis=0), axis=0) + FAINT * size
        noise = jnp.minimum(noise, self._noisiest[None, :, None])  # what jumps where it is looked at is no rounding

        def look(k: Any, carry: tuple[Any, Any]) -> tuple[Any, Any]:
            share = (k * POINTS + jnp.arange(POINTS)).astype(float) / (count - 1.0)  # both ends too
            signals = jax.vmap(lambda s: self._values(s * step, 0.0))(share)
            away = jnp.abs(signals - _combined(_chebyshev(2.0 * share - 1.0).T, coefficients))
            away = jnp.maximum(away - jnp.maximum(noise[None], FAINT * jnp.abs(signals)), 0.0)
            return jnp.maximum(carry[0], jnp.max(away, axis=0)), carry[1] + jnp.sum(away, axis=0)

        largest, total = jax.lax.fori_loop(0, rounds.astype(int), look, (jnp.zeros_like(size), jnp.zeros_like(size)))
        largest, mean = jnp.max(largest, axis=0), jnp.max(total, axis=0) / count
        return largest, self._moved(largest, mean * jnp.abs(step * duration)[None], mobility)

    def _moved(self, largest: Signals, impulse: Signals, mobility: BodyMobility) -> Signals:
        """Return by how much bodies move for departures of forces, by their impulses in N s^2, and of laws."""
        length, parts, first = self._equations.system.column_scale[0], [], 0
        for group in self._given:
            reached = jnp.max(jnp.stack([mobility[np.array(slot)] for slot in group.bodies]), axis=0)
            lever = length if group.element.unit == "N" else 1.0
            parts.append(impulse[first : first + group.instances] * reached * lever)
            first += group.instances
        for group in self._drivers:
            departure = largest[first : first + group.instances]
            parts.append(departure if is_turning(group.element) else departure / length)
            first += group.instances
        return jnp.concatenate([*parts, largest[first:]])

    def _values(self, since: Lanes, shake: Float[Numbers, ""] | float) -> Float[Numbers, "component instance batch"]:
        """Return forces and laws a time after the beginning of the step.

        With `shake`, time and all coordinates are changed relatively by so much, this way and that.
        """
        lanes = since.shape[-1]
        clock = Jet.variable(((self._time + since) * (1.0 + shake))[None], 1)
        parts: list[Any] = []
        pose: Any = None
        if self._forces or self._joints:
            state = evaluated(self._path, since).map(lambda part: part * (1.0 + shake * _signs(part.shape[:2])))
            pose = self._equations.pose(state)
        if self._forces:
            forces = with_turns(self._forces, self._angles.at(since))
            parts += [group.force(pose, clock).coefficients[0] for group in forces]
        for group in self._drivers:
            law = group.element.motion(clock).coefficients[0]
            parts.append(jnp.broadcast_to(law, (group.instances, lanes))[None])
        for group, scale in self._joints:
            parts.append(group.residual(pose.truncate(0), clock.truncate(0)).coefficients[0] * scale)
        most = max(len(part) for part in parts)
        padded = [jnp.pad(part, ((0, most - len(part)), (0, 0), (0, 0))) for part in parts]
        return jnp.concatenate([jnp.broadcast_to(p, (*p.shape[:2], lanes)) for p in padded], axis=1)


def _combined(
    weights: Float[Numbers, "place node"], values: Float[Numbers, "node component instance batch"]
) -> Float[Numbers, "place component instance batch"]:
    """Return sums of values with weights; for a product of matrices XLA would call a library."""
    return jnp.sum(weights[:, :, None, None, None] * values[None], axis=1)


def _signs(shape: tuple[int, ...]) -> Float[np.ndarray, "component body 1"]:
    """Return signs for components of bodies, without a pattern that a force may be blind to."""
    components, bodies = (np.arange(n) for n in shape)
    return np.where(np.sin(1.0 + 3.0 * components[:, None] + 5.0 * bodies**2) > 0, 1.0, -1.0)[:, :, None]


def _chebyshev(x: Float[Numbers, " place"]) -> Float[Numbers, "polynomial place"]:
    """Return the Chebyshev polynomials at some places."""
    polynomials = [jnp.ones_like(x), x]
    while len(polynomials) < len(INTERPOLATION):
        polynomials.append(2.0 * x * polynomials[-1] - polynomials[-2])
    return jnp.stack(polynomials)
