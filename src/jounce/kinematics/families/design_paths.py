"""Continuation of many designs side by side, and solution of all grid instants from their anchors.

Each lane is a design with its own steps. The programs that solve an instant and decide about a step are those of a
single motion; see `instant_program` and `step_control`. A design that comes to a singular position, or is otherwise out
of the ordinary, is left to be solved individually.
"""

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.execution.mapped import at_lanes
from jounce.execution.threads import Threads
from jounce.jet.derivatives import plain_derivatives
from jounce.jet.turns import shifted_by_turns
from jounce.kinematics.continuation.correct_and_differentiate import SolvedState
from jounce.kinematics.continuation.path_following import (
    SAMPLES_A_STEP,
    SMALLEST_STEP,
    blended_attitudes,
    is_next_to_singular,
)
from jounce.kinematics.continuation.solver import Solver
from jounce.kinematics.continuation.step_control import (
    ExpansionPoint,
    StepLimits,
    StopReason,
    initial_control,
    next_controls,
)
from jounce.kinematics.families.design_assembly import Coordinates
from jounce.kinematics.families.varied_tree import VariedTree
from jounce.kinematics.position_analysis.solve_buffers import SolveBuffer, solve_in_buffers
from jounce.kinematics.status import Status
from jounce.mechanism.transmissions.axis_angles import measures_angle, raw_angles
from jounce.mechanism.transmissions.turn_counting import counted_along

MOST_STEPS = 10_000  # of a design; one that needs more is solved individually
FEWEST_TOGETHER, MOST_TOGETHER = 512, 1024  # designs followed together, unless there are fewer
MOST_BLOCKS = 16  # of a family: more and smaller blocks take longer, fewer leave threads idle
LARGEST_BLOCK = 4  # multiple of the size of a block of a long grid: each instant is read by the next one only

Lanes = Float[np.ndarray, " design"]
Indices = Int[np.ndarray, " lane"]


class Anchors(NamedTuple):
    """Anchors of designs that were followed together, sorted by design and instant.

    Attributes
    ----------
    designs : array of int
        Designs, ascending.
    begins : array of int
        Index of the first anchor of each design, and last the number of anchors.
    instant : array of shape (anchors,)
        Time, s.
    order : array of shape (anchors,)
        Index of each anchor in `states`.
    states : tuple
        Data from which predictions start, of all anchors of the group, in the order of its steps, anchors last.
    """

    designs: Indices
    begins: Int[np.ndarray, " design_and_one"]
    instant: Float[np.ndarray, " anchor"]
    order: Int[np.ndarray, " anchor"]
    states: SolvedState

    @property
    def owner(self) -> Int[np.ndarray, " anchor"]:
        """Index of the design of each anchor, within `designs`."""
        return np.repeat(np.arange(len(self.designs)), np.diff(self.begins))

    def parts(self, size: int) -> Iterator["Anchors"]:
        """Yield the anchors in parts of `size` designs."""
        for k in range(0, len(self.designs), size):
            begins = self.begins[k : k + size + 1]
            window = slice(begins[0], begins[-1])
            fields = self.instant[window], self.order[window], self.states
            yield Anchors(self.designs[k : k + size], begins - begins[0], *fields)


class DesignPaths:
    """The motions of many designs, followed from their assemblies to the last instant.

    Parameters
    ----------
    solver : Solver
        The solver of the designs.
    systems : VariedTree
        Systems of the designs to be solved, a lane for each.
    instants : array of shape (designs, time)
        Instants of each design, s. The motions start at the first one.
    last : float
        Last instant of the motions, s.

    Attributes
    ----------
    individual : array of bool, shape (designs,)
        Whether each design is left to be solved individually.
    """

    def __init__(self, solver: Solver, systems: VariedTree, instants: Float[np.ndarray, "design time"], last: float):
        self.solver, self.systems = solver, systems
        self._ends = float(instants[0, 0]), last
        self.individual = np.zeros(len(instants), bool)
        self._instants, self._rank = instants, None
        if np.any(instants[:, 1:] < instants[:, :-1]):
            order = np.argsort(instants, axis=1, kind="stable")
            self._instants, self._rank = np.take_along_axis(instants, order, axis=1), np.argsort(order, axis=1)
        self._groups: list[Anchors] = []
        self._arrival: Any = None  # any arrival, for the shapes of its arrays

    def follow(self, coordinates: Coordinates, plain: Bool[np.ndarray, " design"], threads: int) -> None:
        """Follow the plain designs from their assembled coordinates."""
        self.individual |= ~plain
        lanes = np.flatnonzero(plain)
        size = min(max(FEWEST_TOGETHER, -(-len(lanes) // threads)), MOST_TOGETHER)
        groups = [lanes[k : k + size] for k in range(0, len(lanes), size)]
        with Threads(threads, compiled=self.solver.is_compiled) as pool:
            self._groups = list(pool.map(lambda group: self._followed(coordinates, group), groups))

    def _followed(self, coordinates: Coordinates, lanes: Indices) -> Anchors:
        """Follow designs, and return the anchors of those that are not left to be solved individually."""
        solver, (first, last) = self.solver, self._ends
        steps: list[tuple[Indices, Lanes, SolvedState]] = []  # designs, instants and states of the anchors
        limits = StepLimits(np.asarray(last), np.asarray(SMALLEST_STEP * (last - first)))
        source = solver.needed(solver.still({name: x[..., lanes] for name, x in coordinates.items()}))
        values = self.systems.own(lanes)
        start = np.full(len(lanes), first)
        control = initial_control(
            ExpansionPoint(start, *[np.full(len(lanes), x) for x in (np.inf, np.inf, 0.0)]), start
        )
        decide = next_controls.program(
            limits, jax.tree.map(lambda x: x[:1], (control, control.crawled, control.expansion_point))
        )
        for _ in range(MOST_STEPS):
            if not lanes.size:
                break
            step = control.target - control.expansion_point.instant
            arrival = solver.program((source, step, control.target, values, np.ones(len(lanes), bool)))
            self._arrival = arrival
            end_point: Any = ExpansionPoint(control.target, arrival.safe_step, arrival.radius, arrival.det_rate)
            is_start: Any = control.step == 0
            control, taken = decide((control, arrival.status, end_point))
            unsuitable = taken & ((arrival.status != Status.OK) | is_next_to_singular(end_point, is_start))
            ended = control.ending != StopReason.UNFINISHED
            self.individual[lanes[unsuitable | ended & (control.ending != StopReason.ARRIVED)]] = True
            new_source = solver.needed(arrival.state(slice(None) if taken.all() else taken))
            steps.append((lanes[taken], end_point.instant[taken], new_source))
            source = new_source if taken.all() else _replaced(source, taken, new_source)
            if (remaining := ~(ended | unsuitable)).all():
                continue
            lanes = lanes[remaining]
            control, source, values = at_lanes((control, source, values), remaining)
        self.individual[lanes] = True
        return self._sorted(steps)

    def _sorted(self, steps: Sequence[tuple[Indices, Lanes, SolvedState]]) -> Anchors:
        """Return the anchors of steps, without those of designs left to be solved individually."""
        owners, instants, states = zip(*steps, strict=True)
        owner = np.concatenate(owners)
        order = np.argsort(owner, kind="stable")  # the instants of a design ascend from step to step
        order = order[~self.individual[owner[order]]]
        designs, begins = np.unique(owner[order], return_index=True)
        states = jax.tree.map(lambda *parts: np.concatenate(parts, axis=-1), *states)
        return Anchors(designs, np.append(begins, len(order)), np.concatenate(instants)[order], order, states)

    def solved(self, threads: int) -> tuple[list[list[np.ndarray]], Int[np.ndarray, "design time"]]:
        """Return the outputs of all designs, and their status.

        Outputs are arrays of shape (designs, time, order + 1, components), for each instance of each group. A design
        with a failed instant is left to be solved individually, too.
        """
        count, times = self._instants.shape
        status = np.full((count, times), int(Status.NOT_REACHED))
        designs = np.flatnonzero(~self.individual)
        if not designs.size:
            return [], status
        levels, width = self.solver.finite_order + 1, self.solver.program.width
        fewest = max(1, self.solver.longest_stride * width // times)
        size = min(max(fewest, min(len(designs) // MOST_BLOCKS, LARGEST_BLOCK * fewest)), len(designs))
        size -= size % width if size > width else 0
        blocks = [block for group in self._groups for block in group.parts(size)]
        anchor_count, like = max(len(block.instant) for block in blocks), self._arrival.state(slice(1))
        results = [np.empty((levels, *x.shape[1:-1], count, times)) for x in like[1]]

        def new() -> SolveBuffer:
            return SolveBuffer(self.solver, like, size * times, anchor_count)

        def put(block: Anchors, state: tuple[Any, tuple[np.ndarray, ...], Any], outcome: Indices) -> None:
            lanes = _slice_of(block.designs)
            status[lanes] = self._as_given(outcome.reshape(-1, times), block.designs)
            for result, part in zip(results, state[1], strict=True):
                with np.errstate(over="ignore"):  # of failed instants
                    derivatives = plain_derivatives(part[:levels], out=part[:levels])
                values = derivatives.reshape(*derivatives.shape[:-1], -1, times)
                result[..., lanes, :] = self._as_given(values, block.designs)

        with Threads(threads, compiled=self.solver.is_compiled) as pool:
            for _ in solve_in_buffers(new, blocks, self._load, put, pool.map):
                pass
        outputs = [[np.transpose(x, (2, 3, 0, 1)) for x in np.moveaxis(result, 2, 0)] for result in results]
        for group in self._groups:
            if group.designs.size:
                self._count_turns(outputs, group)
        self.individual |= (status != Status.OK).any(axis=1)
        return outputs, status

    def _as_given(self, values: Any, block: Indices) -> np.ndarray:
        """Return values of designs at their instants, (..., designs, time), in the order of the given instants."""
        if self._rank is None:
            return values
        rank = self._rank[block]
        return np.take_along_axis(values, rank.reshape(*[1] * (values.ndim - 2), *rank.shape), axis=-1)

    def _load(self, buffer: SolveBuffer, block: Anchors) -> int:
        """Load all instants of designs; each starts from the instant before, or from the nearest anchor."""
        instants = self._instants[block.designs]
        count, times = instants.shape
        length = -(-times // max(1, buffer.width // count))  # of a piece of a motion, such that all lanes are used
        buffer.put_anchors([[np.take(leaf, block.order, axis=-1)] for leaf in jax.tree.leaves(block.states)])
        nearest = _nearest(block.owner, block.instant, instants, self._ends)
        to_anchor = instants - block.instant[nearest]
        to_one_before = np.empty(instants.shape)
        np.subtract(instants[:, 1:], instants[:, :-1], out=to_one_before[:, 1:])
        to_one_before[:, _begins(times, length)] = np.inf
        is_near = to_one_before <= np.abs(to_anchor)
        source, step = np.where(is_near, -1, nearest), np.where(is_near, to_one_before, to_anchor)
        rounds = _rounds(count, times, length, buffer.width)
        buffer.load(instants.ravel(), (source.ravel(), step.ravel()), rounds, self.systems.own(block.designs))
        return count * times

    def _count_turns(self, outputs: list[list[np.ndarray]], anchors: Anchors) -> None:
        """Add to angles about axes the turns made along the anchors of their designs."""
        if not any(map(measures_angle, self.solver.model.system.outputs)):
            return
        designs, owner, times = anchors.designs, anchors.owner, anchors.instant
        system = self.systems.at(designs[owner])
        measuring = [(g, output) for g, output in zip(system.outputs, outputs, strict=True) if measures_angle(g)]
        series = np.nan_to_num(anchors.states[0]["quaternion"][..., anchors.order], nan=0.0, posinf=0.0, neginf=0.0)
        index = np.arange(len(owner))
        next_anchor = np.where(np.append(owner[1:] != owner[:-1], True), index, index + 1)  # the last anchor: itself

        def instants(anchor: Indices, fraction: Lanes) -> Lanes:
            return times[anchor] + fraction * (times[next_anchor[anchor]] - times[anchor])

        for counted, output in measuring:

            def measured(anchor: Indices, fraction: Lanes, group: Any = counted) -> Float[np.ndarray, "angle lane"]:
                ends = anchor, next_anchor[anchor]
                attitudes = blended_attitudes(times, series, ends, instants(anchor, fraction))
                anchor_group = jax.tree.map(lambda leaf: leaf if np.shape(leaf)[-1] == 1 else leaf[..., anchor], group)
                return raw_angles([anchor_group], {"quaternion": attitudes})[0]

            first_angles = np.broadcast_to(counted.element.datum.near, (counted.instances, len(owner)))
            samples = counted_along(measured, owner, first_angles, SAMPLES_A_STEP)
            sample_points = owner[samples.path], instants(samples.path, samples.share)
            nearest = _nearest(*sample_points, self._instants[designs], self._ends)
            for values, angle in zip(output, samples.angle, strict=True):
                expected = self._as_given(angle[nearest], designs)
                values[designs, :, 0, 0] = shifted_by_turns(values[designs, :, 0, 0], expected)


@lru_cache(maxsize=16)
def _rounds(count: int, times: int, length: int, width: int) -> Int[np.ndarray, "round lane"]:
    """Return the indices of the instants of designs in the order of solution.

    Each lane solves a piece of a motion with `length` instants, one after another. Spare lanes repeat the last piece.
    """
    starts = (np.arange(count)[:, None] * times + _begins(times, length)).ravel()
    starts = starts[np.minimum(np.arange(-(-len(starts) // width) * width), len(starts) - 1)]
    pieces = starts[:, None] + np.arange(length)
    return np.ascontiguousarray(pieces.reshape(-1, width, length).swapaxes(1, 2).reshape(-1, width))


def _begins(times: int, length: int) -> Indices:
    """Return the first instants of the pieces of a motion; the last pieces overlap unless `length` divides `times`."""
    return np.minimum(np.arange(0, times, length), times - length)


def _nearest(
    owner: Int[np.ndarray, " anchor"],
    anchors: Float[np.ndarray, " anchor"],
    instants: Float[np.ndarray, "design time"],
    ends: tuple[float, float],
) -> Int[np.ndarray, "design time"]:
    """Return the index of the nearest anchor of the same design for each instant; anchors are sorted.

    One number encodes design and instant, so that a single search finds the changes of the nearest anchor.
    """
    (first, last), times = ends, instants.shape[1]
    scale = 0.5 / max(last - first, 1e-300)
    encoded = np.arange(len(instants))[:, None] + scale * (instants - first)
    middle = owner[:-1] + scale * (0.5 * (anchors[:-1] + anchors[1:]) - first)
    changes = np.searchsorted(encoded.ravel(), middle, side="right")
    changes = np.where(owner[1:] == owner[:-1], changes, owner[1:] * times)
    return np.repeat(np.arange(len(anchors)), np.diff(changes, prepend=0, append=instants.size)).reshape(instants.shape)


def _slice_of(designs: Indices) -> slice | Indices:
    """Return consecutive designs as a slice, which indexes faster; others unchanged."""
    first, last = int(designs[0]), int(designs[-1])
    return slice(first, last + 1) if last - first + 1 == len(designs) else designs


def _replaced(state: Any, lanes: Any, new: Any) -> Any:
    """Return a state with some lanes replaced."""

    def replaced(values: np.ndarray, part: np.ndarray) -> np.ndarray:
        values = values.copy()
        values[..., lanes] = part
        return values

    return jax.tree.map(replaced, state, new)
