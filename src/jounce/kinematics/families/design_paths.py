"""Many designs followed side by side, each in steps of its own, and all instants of a grid solved from their anchors.

What decides about a step of one design alone decides here too, lane by lane; see `continuation_steps` and `advance`. A
design that is out of the ordinary, as it comes to a singular position, is left to be solved alone.
"""

import itertools
from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.execution.compilation import compiled
from jounce.execution.threads import Threads
from jounce.jet.derivatives import plain_derivatives
from jounce.jet.turns import brought_near
from jounce.kinematics.continuation.continuation_steps import GROWTH, LARGEST_TURNOVER, PASSAGE, SLIVER
from jounce.kinematics.continuation.correct_and_differentiate import (
    SAFE_FRACTION,
    SolvedState,
    StepResult,
    predicts_turns,
    solved_batch,
)
from jounce.kinematics.continuation.path_following import PLACES, SMALLEST_STEP, blended_attitudes
from jounce.kinematics.continuation.predictor import hidden_by_laws
from jounce.kinematics.continuation.singularity_distance import turnovers_of
from jounce.kinematics.continuation.solver import Solver
from jounce.kinematics.families.design_values import Coordinates, Designs
from jounce.kinematics.status import Status
from jounce.mechanism.axis_angles import measures_angle, raw_angles
from jounce.mechanism.system import Group, System
from jounce.mechanism.turn_counting import counted_along
from jounce.rigid.pose import Pose
from jounce.shapes import Numbers

ANCHOR_ORDER = 6  # of the series at the anchors, at least: few carry many instants
MOST_STEPS = 10_000  # of a design; one that needs more is left to be solved alone
WIDEST = 512  # lanes
LOTS = 8  # of so many, solved in one call

Lanes = Float[np.ndarray, " design"]
Indices = Int[np.ndarray, " lane"]


class Places(NamedTuple):
    """Where designs have come to, an entry for each; see `continuation_steps.Place`."""

    instant: Lanes
    safe_step: Lanes
    radius: Lanes
    turnover: Lanes
    largest: Lanes  # step that the last one allows, s


@compiled("pose_type", "order")
def advance_designs(
    system: System,
    known: Any,
    step: Float[Numbers, " batch"],
    instant: Float[Numbers, " batch"],
    settings: tuple[Any, Any, Any],
    *,
    pose_type: type[Pose],
    order: int,
) -> StepResult:
    """Solve an instant of each of many designs from one solved before, and survey all of them; see `advance`."""
    coordinates, angles, sign = known
    arrival, factor, reached = solved_batch(
        system, coordinates, angles, sign, step, instant, *settings, pose_type=pose_type, order=order
    )
    status = hidden_by_laws(system, arrival.status, instant, step, order)
    return arrival._replace(turnover=turnovers_of(system, pose_type, reached, factor, instant), status=status)


@compiled("varied", "pose_type", "order")
def _solve_designs(
    system: System,
    known: Any,
    step: Float[Numbers, " lane"],
    instant: Float[Numbers, " lane"],
    settings: tuple[Any, Any, Any],
    lots: Int[Numbers, ""],
    *,
    varied: tuple[int, ...],
    pose_type: type[Pose],
    order: int,
) -> tuple[tuple[Any, ...], Any]:
    """Solve an instant in each lane, of one design or another, from one solved before: lot after lot of `WIDEST`.

    Parameters
    ----------
    lots : int
        Those that are solved; lanes beyond them are left at zero.
    varied : tuple of int
        Which leaves of the system have lanes.

    Returns
    -------
    tuple of tuple of array of shape (lane, order + 1, components), and array of shape (lane,)
        Derivatives of the outputs, for each instance of each group, and status.
    """
    leaves, structure = jax.tree.flatten(system)
    width = min(WIDEST, len(step))

    def solved(lot: Any) -> Any:
        def some(x: Any) -> Any:
            return jax.lax.dynamic_slice_in_dim(x, lot * width, width, axis=-1)

        own = [some(leaf) if k in varied else leaf for k, leaf in enumerate(leaves)]
        coordinates, angles, sign = jax.tree.map(some, known)
        arrival, _, _ = solved_batch(
            jax.tree.unflatten(structure, own),
            coordinates,
            angles,
            sign,
            some(step),
            some(instant),
            *settings,
            pose_type=pose_type,
            order=order,
        )
        rows = [jnp.transpose(plain_derivatives(jets), (2, 3, 0, 1)) for jets in arrival.outputs]
        return tuple(tuple(row) for row in rows), arrival.status

    def go_on(lot: Any, found: Any) -> Any:
        put = jax.lax.dynamic_update_slice_in_dim
        return jax.tree.map(lambda whole, part: put(whole, part, lot * width, 0), found, solved(lot))

    blank = jax.tree.map(lambda x: jnp.zeros((len(step), *x.shape[1:]), x.dtype), jax.eval_shape(solved, 0))
    return jax.lax.fori_loop(0, lots, go_on, blank)


class DesignPaths:
    """The motions of many designs, followed from where each is put together to the last instant.

    Parameters
    ----------
    solver : Solver
        Of the model by which the designs are measured.
    designs : Designs
        What is solved.
    instants : array of shape (designs, time)
        Of each, s; from the first one they are followed.
    last : float
        To which they are followed, s.

    Attributes
    ----------
    apart : array of bool, shape (designs,)
        Those that are left to be solved alone.
    """

    def __init__(self, solver: Solver, designs: Designs, instants: Float[np.ndarray, "design time"], last: float):
        self.solver, self.designs, self.instants = solver, designs, instants
        self._ends = float(instants[0, 0]), last
        count = len(designs.rows)
        self.apart = np.zeros(count, bool)
        self._settings = tuple(map(np.asarray, (solver.tolerance, solver.refine, solver.wanted)))
        self._order = max(solver.order, ANCHOR_ORDER)
        self._width = min(WIDEST, max(16, 1 << (count - 1).bit_length()))
        self._anchors: list[tuple[Indices, Float[np.ndarray, " lane"], SolvedState]] = []
        self._turning = [k for k, group in enumerate(solver.model.system.outputs) if predicts_turns(group)]

    def follow(self, coordinates: Coordinates, plain: Bool[np.ndarray, " design"]) -> None:
        """Follow the designs from where they are put together, those that are plain."""
        self.apart |= ~plain
        first, last = self._ends
        count = len(plain)
        known = self._known_at_the_start(coordinates)
        places = Places(*(np.full(count, x) for x in (first, np.inf, np.inf, 0.0, np.inf)))
        step, target = np.zeros(count), np.full(count, first)
        begun = np.zeros(count, bool)
        active = ~self.apart
        for _ in range(MOST_STEPS):
            lanes = np.flatnonzero(active)
            if not lanes.size:
                break
            arrived = self._advanced(known, step, target, lanes)
            taken = (arrived.status == Status.OK) & (step[lanes] * np.abs(arrived.turnover) <= LARGEST_TURNOVER)
            hopeless = ~begun[lanes] | (arrived.status == Status.UNDEFINED)
            stuck = ~taken & (hopeless | (step[lanes] < SMALLEST_STEP * (last - first)))
            self.apart[lanes[stuck]] = True
            self._keep(places, known, arrived, (step, target), (lanes[taken], np.flatnonzero(taken)))
            begun[lanes[taken]] = True
            halved = lanes[~taken & ~stuck]
            step[halved] *= 0.5
            target[halved] = places.instant[halved] + step[halved]
            onwards = lanes[taken]
            step[onwards], target[onwards] = self._planned(places, onwards)
            active = ~self.apart & (places.instant < last) | ~self.apart & ~begun
        self.apart |= active

    def solved(self, threads: int) -> tuple[list[list[np.ndarray]], Int[np.ndarray, "design time"]]:
        """Return the outputs of all designs, and their status.

        Outputs are arrays of shape (designs, time, order + 1, components), for each instance of each group. A design of
        which an instant is not solved at once is left to be solved alone, too.
        """
        count, times = self.instants.shape
        design = np.repeat(np.flatnonzero(~self.apart), times)
        instant = self.instants[~self.apart].ravel()
        levels = self.solver.wanted + 1
        status = np.full((count, times), int(Status.NOT_REACHED))
        outputs: list[list[np.ndarray]] = []
        if not design.size:
            return outputs, status
        owners, at, store = self._store()
        source = _nearest(owners, at, design, instant)
        away = instant - at[source]
        order = np.argsort(np.abs(away), kind="stable")  # lanes that take as many iterations go together
        where = np.tile(np.arange(times), count - int(self.apart.sum()))
        width = min(WIDEST, max(16, 1 << (len(order) - 1).bit_length()))
        at_once = width * LOTS if len(order) > width else width
        parts = [order[k : k + at_once] for k in range(0, len(order), at_once)]
        varied, kind = self.designs.varied, self.solver.model.pose_type

        def solve(part: Indices) -> Any:
            some = _filled(part, at_once)
            known = jax.tree.map(lambda x: x[..., source[some]], store)
            system = self.designs.system(design[some])
            lots = np.asarray(-(-len(part) // width))
            found = _solve_designs(
                system,
                known,
                away[some],
                instant[some],
                self._settings,
                lots,
                varied=varied,
                pose_type=kind,
                order=self.solver.order,
            )
            return jax.tree.map(lambda x: np.asarray(x)[: len(part)], found)

        with Threads(threads) as pool:
            for part, (found, outcome) in zip(parts, pool.map(solve, parts), strict=True):
                if not outputs:
                    outputs = [[np.full((count, times, levels, x.shape[2]), np.nan) for x in group] for group in found]
                these = design[part], where[part]
                status[these] = outcome
                for into, rows in zip(itertools.chain(*outputs), itertools.chain(*found), strict=True):
                    into[these] = rows[:, :levels]
        self._count_turns(outputs, (owners, at, store[0]), (design, where, instant))
        self.apart |= (status != Status.OK).any(axis=1)
        return outputs, status

    def _count_turns(
        self,
        outputs: list[list[np.ndarray]],
        anchors: tuple[Int[np.ndarray, " anchor"], Float[np.ndarray, " anchor"], Mapping[str, Any]],
        lanes: tuple[Indices, Indices, Float[np.ndarray, " lane"]],
    ) -> None:
        """Give angles about axes the turns that they make along the anchors; lanes are designs, indices, instants."""
        (owners, at, coordinates), (design, where, instant) = anchors, lanes
        pairs = zip(self.designs.system(owners).outputs, outputs, strict=True)
        measuring = [(group, found) for group, found in pairs if measures_angle(group)]
        if not measuring:
            return
        series = np.nan_to_num(coordinates["quaternion"], nan=0.0, posinf=0.0, neginf=0.0)
        here = np.arange(len(owners))
        following = np.where(np.append(owners[1:] != owners[:-1], True), here, here + 1)  # or itself, the last one

        def instants(anchor: Indices, share: Lanes) -> Lanes:
            return at[anchor] + share * (at[following[anchor]] - at[anchor])

        for group, found in measuring:

            def measured(anchor: Indices, share: Lanes, group: Group = group) -> Float[np.ndarray, "angle lane"]:
                ends = anchor, following[anchor]
                attitudes = blended_attitudes(at, series, ends, instants(anchor, share))
                own = jax.tree.map(lambda leaf: leaf if np.shape(leaf)[-1] == 1 else leaf[..., anchor], group)
                return raw_angles([own], {"quaternion": attitudes})[0]

            begun = np.broadcast_to(group.element.datum.near, (group.instances, len(owners)))
            places = counted_along(measured, owners, begun, PLACES)
            nearest = _nearest(owners[places.path], instants(places.path, places.share), design, instant)
            for values, angle in zip(found, places.angle, strict=True):
                values[design, where, 0, 0] = brought_near(values[design, where, 0, 0], angle[nearest])

    def _known_at_the_start(self, coordinates: Coordinates) -> SolvedState:
        """Return what the first instant is predicted from: bodies at rest, and the turns that are known of angles."""
        levels, count = self._order + 1, len(self.apart)
        names = self.solver.model.pose_type.predictor
        still = {n: np.stack([coordinates[n], *[np.zeros_like(coordinates[n])] * (levels - 1)]) for n in names}
        groups = self.solver.model.system.outputs
        angles = (np.zeros((levels, 1, groups[k].instances, count)) for k in self._turning)
        return still, tuple(angles), np.zeros(count)

    def _advanced(self, known: SolvedState, step: Lanes, target: Lanes, lanes: Indices) -> StepResult:
        parts = []
        for k in range(0, len(lanes), self._width):
            lot = lanes[k : k + self._width]
            some = _filled(lot, self._width)
            kind, order = self.solver.model.pose_type, self._order
            found = advance_designs(
                self.designs.system(some),
                jax.tree.map(lambda x, s=some: x[..., s], known),
                step[some],
                target[some],
                self._settings,
                pose_type=kind,
                order=order,
            )
            parts.append(jax.tree.map(np.asarray, found))
        return jax.tree.map(lambda *xs: np.concatenate(xs, axis=-1)[..., : len(lanes)], *parts)

    def _keep(
        self,
        places: Places,
        known: SolvedState,
        arrived: StepResult,
        tried: tuple[Lanes, Lanes],
        taken: tuple[Any, Any],
    ) -> None:
        """Put designs where their steps led to, which become anchors; `taken` are designs and their lanes."""
        (step, target), (chosen, some) = tried, taken
        growth = np.where(step[chosen] > 0, GROWTH * step[chosen], np.inf)
        found = (target[chosen], *(x[some] for x in (arrived.safe_step, arrived.radius, arrived.turnover)), growth)
        for into, values in zip(places, found, strict=True):
            into[chosen] = values
        names = self.solver.model.pose_type.predictor
        coordinates = {name: arrived.coordinates[name][..., some] for name in names}
        state = (coordinates, tuple(arrived.outputs[k][..., some] for k in self._turning), arrived.sign[some])

        def put(whole: np.ndarray, part: np.ndarray) -> None:
            whole[..., chosen] = part

        jax.tree.map(put, known, state)
        self._anchors.append((chosen, found[0], state))

    def _planned(self, places: Places, lanes: Indices) -> tuple[Lanes, Lanes]:
        """Return the next steps of designs and where they lead; see `continuation_steps`."""
        instant, safe_step, radius, turnover, largest = (part[lanes] for part in places)
        rate = np.abs(turnover)
        reach = np.where(rate > 0, 1 / np.where(rate > 0, rate, 1.0), np.inf)
        first, last = self._ends
        left = last - instant
        step = np.minimum(np.minimum(safe_step, SAFE_FRACTION * reach), np.minimum(largest, left))
        ahead = (turnover < 0) & (reach < PASSAGE * radius)
        short = (step <= SMALLEST_STEP * (last - first)) & (left > 0)
        self.apart[lanes[(ahead | short) & (left > 0)]] = True
        step = np.where(left - step < SLIVER * step, left, step)
        return step, np.where(step == left, last, instant + step)

    def _store(self) -> tuple[Int[np.ndarray, " anchor"], Float[np.ndarray, " anchor"], SolvedState]:
        """Return the anchors of all designs, by design and instant: whose they are, when, and their states."""
        owners = np.concatenate([whose for whose, _, _ in self._anchors])
        at = np.concatenate([when for _, when, _ in self._anchors])
        order = np.lexsort((at, owners))
        state = jax.tree.map(
            lambda *xs: np.concatenate(xs, axis=-1)[..., order], *(state for _, _, state in self._anchors)
        )
        return owners[order], at[order], state


def _nearest(
    owners: Int[np.ndarray, " anchor"],
    at: Float[np.ndarray, " anchor"],
    design: Indices,
    instant: Float[np.ndarray, " lane"],
) -> Indices:
    """Return the anchor of its design that is nearest to each instant, by index; anchors are in order."""
    begin, end = (np.searchsorted(owners, design, side=side) for side in ("left", "right"))
    low, high = begin.copy(), end.copy()
    while (low < high).any():  # bisection, of all at once
        middle = (low + high) // 2
        right = (low < high) & (at[np.minimum(middle, len(at) - 1)] < instant)
        low, high = np.where(right, middle + 1, low), np.where(right | (low >= high), high, middle)
    before, after = np.maximum(low - 1, begin), np.minimum(low, end - 1)
    return np.where(instant - at[before] <= at[after] - instant, before, after)


def _filled(lanes: Indices, width: int) -> Int[np.ndarray, " {width}"]:
    """Return lanes, of which the last is repeated up to a width."""
    return lanes[np.minimum(np.arange(width), len(lanes) - 1)]
