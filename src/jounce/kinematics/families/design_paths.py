"""Many designs followed side by side, each in steps of its own, and all instants of a grid solved from their anchors.

A lane is a design. The programs that solve an instant and decide about a step are those of a single motion; see
`instant_program` and `step_control`. A design that is out of the ordinary, as it comes to a singular position, is left
to be solved individually.
"""

import itertools
from functools import lru_cache
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.execution.threads import Threads
from jounce.jet.derivatives import plain_derivatives
from jounce.jet.turns import brought_near
from jounce.kinematics.continuation.correct_and_differentiate import SolvedState
from jounce.kinematics.continuation.path_following import (
    SAMPLES_A_STEP,
    SMALLEST_STEP,
    blended_attitudes,
    is_spoiled_outside,
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
from jounce.kinematics.families.design_values import Designs
from jounce.kinematics.position_analysis.solve_buffers import SolveBuffer, solve_in_buffers
from jounce.kinematics.status import Status
from jounce.mechanism.transmissions.axis_angles import measures_angle, raw_angles
from jounce.mechanism.transmissions.turn_counting import counted_along

MOST_STEPS = 10_000  # of a design; one that needs more is left to be solved individually
TOGETHER = 512  # designs that are followed together

Lanes = Float[np.ndarray, " design"]
Indices = Int[np.ndarray, " lane"]


class Anchors(NamedTuple):
    """Instants of designs that one step has solved: the designs, rising, the instants, s, and the states."""

    owner: Indices
    instant: Float[np.ndarray, " lane"]
    state: SolvedState


class Group(NamedTuple):
    """Designs that are followed together, and the anchors that each step has made."""

    designs: Indices
    steps: list[Anchors]

    def anchors_of(
        self, designs: Indices
    ) -> tuple[
        Int[np.ndarray, " anchor"], Float[np.ndarray, " anchor"], list[list[np.ndarray]], Int[np.ndarray, " anchor"]
    ]:
        """Return the anchors of some of the designs.

        Returns
        -------
        owner, instant : array
            The design of each, among these designs, and its instant, s.
        parts : list of list of array
            The parts of each leaf of their states.
        order : array of int
            The order that sorts them by design and instant.
        """
        first, last = designs[0], designs[-1]
        owners, instants, states = [], [], []
        for owner, instant, state in self.steps:
            some: Any = slice(*np.searchsorted(owner, (first, last + 1)))
            if last - first + 1 > len(designs):
                some = some.start + np.flatnonzero(np.isin(owner[some], designs))
            owners.append(np.searchsorted(designs, owner[some]))
            instants.append(instant[some])
            states.append([leaf[..., some] for leaf in jax.tree.leaves(state)])
        owner, instant = np.concatenate(owners), np.concatenate(instants)
        return owner, instant, [*map(list, zip(*states, strict=True))], np.lexsort((instant, owner))


class DesignPaths:
    """The motions of many designs, followed from where each is assembled to the last instant.

    Parameters
    ----------
    solver : Solver
        The solver of the designs.
    designs : Designs
        The designs to be solved.
    instants : array of shape (designs, time)
        Instants of each design, s; the motions start at the first one.
    last : float
        The instant to which they are followed, s.

    Attributes
    ----------
    individual : array of bool, shape (designs,)
        The designs that are left to be solved individually.
    """

    def __init__(self, solver: Solver, designs: Designs, instants: Float[np.ndarray, "design time"], last: float):
        self.solver, self.designs = solver, designs
        self._ends = float(instants[0, 0]), last
        self.individual = np.zeros(len(designs.rows), bool)
        order = np.argsort(instants, axis=1, kind="stable")
        self._instants = np.take_along_axis(instants, order, axis=1)
        self._rank = np.argsort(order, axis=1) if np.any(np.diff(order, axis=1) < 0) else None
        self._groups: list[Group] = []

    def follow(self, coordinates: Coordinates, plain: Bool[np.ndarray, " design"], threads: int) -> None:
        """Follow the designs from where they are assembled, those that are plain."""
        self.individual |= ~plain
        lanes = np.flatnonzero(plain)
        groups = [lanes[k : k + TOGETHER] for k in range(0, len(lanes), TOGETHER)]
        with Threads(threads, compiled=self.solver.is_compiled) as pool:
            self._groups = list(pool.map(lambda group: self._followed(coordinates, group), groups))

    def _followed(self, coordinates: Coordinates, lanes: Indices) -> Group:
        """Follow some designs."""
        solver, (first, last), group = self.solver, self._ends, Group(lanes, [])
        limits = StepLimits(np.asarray(last), np.asarray(SMALLEST_STEP * (last - first)))
        known = solver.needed(solver.still({name: x[..., lanes] for name, x in coordinates.items()}))
        start = np.full(len(lanes), first)
        control = initial_control(
            ExpansionPoint(start, *[np.full(len(lanes), x) for x in (np.inf, np.inf, 0.0)]), start
        )
        decide = next_controls.program(
            limits, jax.tree.map(lambda x: x[:1], (control, control.crawled, control.expansion_point))
        )
        for _ in range(MOST_STEPS):
            if not lanes.size:
                return group
            away, own = control.target - control.expansion_point.instant, self.designs.own(lanes)
            arrival = solver.program((known, away, control.target, own, np.ones(len(lanes), bool)))
            there: Any = ExpansionPoint(control.target, arrival.safe_step, arrival.radius, arrival.det_rate)
            begins: Any = control.step == 0
            control, taken = decide((control, arrival.status, there))
            unlike = taken & ((arrival.status != Status.OK) | is_spoiled_outside(there, begins, last))
            ended = control.ending != StopReason.UNFINISHED
            self.individual[lanes[unlike | ended & (control.ending != StopReason.ARRIVED)]] = True
            reached = arrival.state(slice(None) if taken.all() else taken)
            group.steps.append(Anchors(lanes[taken], there.instant[taken], reached))
            known = solver.needed(reached) if taken.all() else _replaced(known, taken, solver.needed(reached))
            if (left := ~(ended | unlike)).all():
                continue
            lanes = lanes[left]
            control, known = jax.tree.map(lambda x, some=left: x[..., some], (control, known))
        self.individual[lanes] = True
        return group

    def solved(self, threads: int) -> tuple[list[list[np.ndarray]], Int[np.ndarray, "design time"]]:
        """Return the outputs of all designs, and their status.

        Outputs are arrays of shape (designs, time, order + 1, components), for each instance of each group. A design
        with an instant that is not solved at once is left to be solved individually, too.
        """
        count, times = self._instants.shape
        status = np.full((count, times), int(Status.NOT_REACHED))
        designs = np.flatnonzero(~self.individual)
        if not designs.size:
            return [], status
        levels, width = self.solver.finite_order + 1, self.solver.program.width
        size = min(max(1, self.solver.longest_stride * width // times), len(designs))
        size -= size % width if size > width else 0
        items: list[tuple[Group, Indices]] = []
        for group in self._groups:
            some = group.designs[~self.individual[group.designs]]
            items += [(group, some[k : k + size]) for k in range(0, len(some), size)]
        steps = itertools.chain(*(group.steps for group in self._groups))
        each = sum((np.bincount(step.owner, minlength=count) for step in steps), np.zeros(count, int))
        most = max(int(each[block].sum()) for _, block in items)
        like = self._groups[0].steps[0].state
        wholes = [np.full((levels, *x.shape[1:-1], count, times), np.nan) for x in like[1]]

        def new() -> SolveBuffer:
            return SolveBuffer(self.solver, like, size * times, most)

        def put(item: tuple[Group, Indices], state: SolvedState, outcome: Indices) -> None:
            block = item[1]
            status[block] = self._as_given(outcome.reshape(len(block), times), block)
            for whole, part in zip(wholes, state[1], strict=True):
                with np.errstate(over="ignore"):  # of what failed
                    derivatives = plain_derivatives(part[:levels])
                values = derivatives.reshape(*derivatives.shape[:-1], len(block), times)
                whole[..., block, :] = self._as_given(values, block)

        with Threads(threads, compiled=self.solver.is_compiled) as pool:
            for _ in solve_in_buffers(new, items, self._begin, put, pool.map):
                pass
        outputs = [[np.transpose(x, (2, 3, 0, 1)) for x in np.moveaxis(whole, 2, 0)] for whole in wholes]
        for group in self._groups:
            some = group.designs[~self.individual[group.designs]]
            if some.size:
                self._count_turns(outputs, group, some)
        self.individual |= (status != Status.OK).any(axis=1)
        return outputs, status

    def _as_given(self, values: Any, block: Indices) -> np.ndarray:
        """Return values of some designs at their instants, (..., designs, time), in the order of the given instants."""
        if self._rank is None:
            return values
        rank = self._rank[block]
        return np.take_along_axis(values, rank.reshape(*[1] * (values.ndim - 2), *rank.shape), axis=-1)

    def _begin(self, buffer: SolveBuffer, item: tuple[Group, Indices]) -> int:
        """Load all instants of some designs; each starts from the one before, or from the nearest anchor."""
        group, block = item
        instants = self._instants[block]
        count, times = instants.shape
        pieces = min(max(1, buffer.width // count), times)  # of a motion, so that lanes are in use
        length = -(-times // pieces)
        owner, at, parts, order = group.anchors_of(block)
        buffer.put_anchors(parts)
        nearest = _nearest(owner[order], at[order], instants, self._ends)
        to_anchor = instants - at[order][nearest]
        to_one_before = np.diff(instants, axis=1, prepend=np.inf)
        to_one_before[:, ::length] = np.inf
        near = np.abs(to_one_before) <= np.abs(to_anchor)
        before = np.arange(-1, count * times - 1).reshape(count, times)
        source = np.where(near, before, buffer.size + order[nearest])
        step = np.where(near, to_one_before, to_anchor)
        own = {k: np.repeat(x, times, axis=-1) for k, x in self.designs.own(block).items()}
        buffer.load(instants.ravel(), (source.ravel(), step.ravel()), _rounds(count, times, length, buffer.width), own)
        return count * times

    def _count_turns(self, outputs: list[list[np.ndarray]], group: Group, designs: Indices) -> None:
        """Give angles about axes the turns that they make along the anchors of their designs."""
        if not any(map(measures_angle, self.solver.model.system.outputs)):
            return
        owner, at, parts, order = group.anchors_of(designs)
        owner, at = owner[order], at[order]
        system = self.designs.system(designs[owner])
        measuring = [(g, output) for g, output in zip(system.outputs, outputs, strict=True) if measures_angle(g)]
        leaves = [np.concatenate(part, axis=-1)[..., order] for part in parts]
        coordinates = jax.tree.unflatten(jax.tree.structure(group.steps[0].state), leaves)[0]
        series = np.nan_to_num(coordinates["quaternion"], nan=0.0, posinf=0.0, neginf=0.0)
        here = np.arange(len(owner))
        following = np.where(np.append(owner[1:] != owner[:-1], True), here, here + 1)  # or itself, the last one

        def instants(anchor: Indices, share: Lanes) -> Lanes:
            return at[anchor] + share * (at[following[anchor]] - at[anchor])

        for counted, output in measuring:

            def measured(anchor: Indices, share: Lanes, group: Any = counted) -> Float[np.ndarray, "angle lane"]:
                ends = anchor, following[anchor]
                attitudes = blended_attitudes(at, series, ends, instants(anchor, share))
                own = jax.tree.map(lambda leaf: leaf if np.shape(leaf)[-1] == 1 else leaf[..., anchor], group)
                return raw_angles([own], {"quaternion": attitudes})[0]

            begun = np.broadcast_to(counted.element.datum.near, (counted.instances, len(owner)))
            samples = counted_along(measured, owner, begun, SAMPLES_A_STEP)
            known = owner[samples.path], instants(samples.path, samples.share)
            nearest = _nearest(*known, self._instants[designs], self._ends)
            for values, angle in zip(output, samples.angle, strict=True):
                expected = self._as_given(angle[nearest], designs)
                values[designs, :, 0, 0] = brought_near(values[designs, :, 0, 0], expected)


@lru_cache(maxsize=16)
def _rounds(count: int, times: int, length: int, width: int) -> Int[np.ndarray, "round lane"]:
    """Return the indices of the instants of designs in the order of solution.

    A lane takes up a piece of a motion of this length, one instant after another. At its end, and where lanes are left
    over, the last one is solved again.
    """
    first = (np.arange(count)[:, None] * times + np.arange(0, times, length)).ravel()
    first = first[np.minimum(np.arange(-(-len(first) // width) * width), len(first) - 1)]
    last = first // times * times + times - 1
    pieces = np.minimum(first[:, None] + np.arange(length), last[:, None])
    return np.ascontiguousarray(pieces.reshape(-1, width, length).swapaxes(1, 2).reshape(-1, width))


def _nearest(
    owner: Int[np.ndarray, " anchor"],
    at: Float[np.ndarray, " anchor"],
    instants: Float[np.ndarray, "design time"],
    ends: tuple[float, float],
) -> Int[np.ndarray, "design time"]:
    """Return the anchor of its design that is nearest to each instant, by index; anchors are in order.

    One number encodes owner and instant, so that one search finds all.
    """
    first, last = ends
    scale, design = 0.5 / max(last - first, 1e-300), np.arange(len(instants))[:, None]
    after = np.searchsorted(owner + scale * (at - first), design + scale * (instants - first))
    begin, end = (np.searchsorted(owner, design, side=side) for side in ("left", "right"))
    before, after = np.clip(after - 1, begin, end - 1), np.clip(after, begin, end - 1)
    return np.where(instants - at[before] <= at[after] - instants, before, after)


def _replaced(state: Any, lanes: Any, new: Any) -> Any:
    """Return a state with that of some lanes in its place."""

    def replaced(whole: np.ndarray, part: np.ndarray) -> np.ndarray:
        whole = whole.copy()
        whole[..., lanes] = part
        return whole

    return jax.tree.map(replaced, state, new)
