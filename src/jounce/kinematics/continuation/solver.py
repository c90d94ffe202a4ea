"""The solver of a mechanism: prediction, correction and differentiation of instants under given settings."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from functools import cached_property, partial
from typing import Any

import jax
import numpy as np
from jaxtyping import Float, Int

from jounce.base.padding import padded
from jounce.execution.mapped import OnLlvm, OnXla, Rounds
from jounce.execution.translated import WhenMade
from jounce.kinematics.continuation.continuation_steps import NOWHERE, StepState, TakenSteps, take_steps
from jounce.kinematics.continuation.correct_and_differentiate import (
    LARGEST_GAP,
    Settings,
    SolvedState,
    StepResult,
    predictor,
)
from jounce.kinematics.continuation.instant_program import advance_instant, round_width
from jounce.kinematics.continuation.step_control import ExpansionPoint, StepLimits, initial_control
from jounce.kinematics.status import Status
from jounce.mechanism import Model

SMALL_BATCH = 16  # lanes of a short grid and of anchors; each batch width compiles once
LONGEST_RUN = 32  # batches
RUN_ENTRIES = 2**20  # largest count of numbers that a run stores; runs of large mechanisms are shorter
BLOCK_ENTRIES = 2**19  # numbers of the coordinates that a thread solves at once, to fit into the cache
XLA_BLOCK_ENTRIES = 2**21  # the same for XLA, whose rounds are wider and whose calls take longer
FEWEST_FROM_ANCHORS = 64  # instants of a long grid that machine code starts from anchors
MOST_SIDE_BY_SIDE, CALL_ENTRIES = 1024, 2**21  # instants in a call of machine code, and numbers of their coordinates
# columns of a Jacobian up to which machine code keeps all numbers in scalars; beyond, such code is longer and no faster
FEW_COLUMNS = 18
LARGE = 64  # least size of an array that machine code keeps in memory
LARGE_BESIDE_TABLES = 128  # the same for small mechanisms whose laws interpolate many samples
NO_GRID = np.empty(0)


@dataclasses.dataclass(frozen=True)
class Solver:
    """A model with the settings of its solution."""

    model: Model
    order: int
    tolerance: float
    refine: bool = True
    finite_order: int = 0  # highest derivative that must be finite
    own: Mapping[int, Any] | None = None  # values of one of many designs, see `of_design`

    def __call__(
        self,
        source_data: SolvedState,
        step: Float[np.ndarray, " batch"],
        instant: Float[np.ndarray, " batch"],
        *,
        search: bool = False,
    ) -> StepResult:
        """Solve instants from the data of solved ones.

        With few instants, `search` has the meaning it has in `advance`.
        """
        lanes = len(instant)
        if lanes <= SMALL_BATCH:
            source, step, instant = jax.tree.map(lambda x: padded(x, SMALL_BATCH), (source_data, step, instant))
            run = _run_from(source, (0.0,) * 4, step=step, instant=instant)
            arrival = self._take_steps(run, NO_GRID, 1, search=search).last
        else:
            arrival = self.program((source_data, step, instant, None, np.zeros(step.shape, bool)))
        return jax.tree.map(lambda x: np.asarray(x)[..., :lanes], arrival)

    def still(self, coordinates: Mapping[str, Any], lanes: int | None = None) -> SolvedState:
        """Return the state of an unsolved position, with zero derivatives; or `lanes` copies of it."""
        levels, system = self.order + 1, self.model.system
        count: int = np.shape(coordinates["position"])[-1] if lanes is None else lanes
        jets = {name: np.zeros((levels, *np.shape(x)[:-1], count)) for name, x in coordinates.items()}
        for name, x in coordinates.items():
            jets[name][0] = x
        outputs = tuple(np.zeros((levels, 1, group.instances, count)) for group in system.outputs)
        return jets, outputs, np.zeros(count)

    def needed(self, solved: SolvedState) -> SolvedState:
        """Return the data of solved instants from which others are predicted, see `predictor`."""
        return predictor(self.model.system, self.model.pose_type, solved)

    def rounds(
        self,
        sources_data: SolvedState,
        state: tuple[Any, Any, Any],
        step: Float[np.ndarray, " time"],
        instant: Float[np.ndarray, " time"],
        status: Int[np.ndarray, " time"],
        sources: Int[np.ndarray, " time"],
        design: Mapping[int, np.ndarray] | None,
    ) -> Rounds:
        """Return a runner that solves instants of a grid in rounds.

        Parameters
        ----------
        sources_data : tuple
            Data of the source instants from which others are predicted, see `needed`.
        state : tuple
            Arrays for the jets of coordinates by name and of outputs, and for the sign, of all instants; None where not
            needed.
        step, instant : array of shape (time,)
            Time step from the source, and the instant itself, s.
        status : array of int, shape (time,)
            Array for the outcome of each instant.
        sources : array of int, shape (time,)
            Index in `sources_data` of the source of each instant; below zero for its lane in the round before.
        design : dict of int to array
            Values of the design of each instant (see `of_design`), or None for one design.
        """
        coordinates, outputs, sign = state
        blank: dict[str, Any] = dict.fromkeys(StepResult._fields)
        results = {"coordinates": coordinates, "outputs": outputs, "status": status, "sign": sign}
        results = StepResult(**(blank | results))
        leaves, form = jax.tree.flatten(results, is_leaf=lambda x: x is None)
        numbered: Any = jax.tree.unflatten(form, np.arange(len(leaves))[:, None])
        links = [int(x[0]) for x in jax.tree.leaves(self.needed(numbered.state(slice(None))))]
        return self.program.rounds((sources_data, (step, instant, design), np.zeros(1, bool)), results, sources, links)

    def take_steps(self, run: StepState, grid: Float[np.ndarray, " time"], stop: float, smallest: float) -> TakenSteps:
        """Continue a run, and solve the next grid instants as far as they fit; see `continuation_steps`."""
        run = run._replace(next_up=np.zeros((), int))
        return self._take_steps(run, grid, self._batches, stop=stop, smallest=smallest)

    def prepare(self) -> None:
        """Compile the program of runs, unless it exists; nothing is solved."""
        run = self.run_at(self.model.guess, 0.0)
        self._take_steps(run, NO_GRID, 0, only_made=True)

    def run_from(
        self, solved: SolvedState, expansion_point: Sequence[float], largest: float, crawled: int = 0
    ) -> StepState:
        """Return the run from a solved instant, an expansion point; the first step is at most `largest`, s."""
        source = jax.tree.map(lambda x: padded(x, SMALL_BATCH), self.needed(solved))
        return _run_from(source, expansion_point, largest=largest, crawled=crawled)

    def run_at(self, coordinates: Mapping[str, Any], instant: float) -> StepState:
        """Return the run that begins by solving an instant from a position assembled at it."""
        source = self.needed(self.still(coordinates, SMALL_BATCH))
        return _run_from(source, (instant, 0.0, 0.0, 0.0), instant=np.full(SMALL_BATCH, instant))

    @property
    def backend(self) -> str:
        """Backend that solves the instants of a long grid."""
        return self.program.backend

    @property
    def is_compiled(self) -> bool:
        """Whether machine code, available before the first instant, solves a long grid."""
        return isinstance(self.program, OnLlvm)

    @cached_property
    def from_anchors(self) -> int:
        """Least number of grid instants that start from anchors, unless the cache holds no such block."""
        return FEWEST_FROM_ANCHORS if self.is_compiled else self.program.width

    @cached_property
    def longest_stride(self) -> int:
        """Largest distance of instants that start from anchors, such that the cache holds a block."""
        entries = BLOCK_ENTRIES if self.is_compiled else XLA_BLOCK_ENTRIES
        return 2 ** int(math.log2(max(1, entries // (self._entries * self.program.width))))

    @cached_property
    def together(self) -> int:
        """Largest number of instants solved in one call outside of rounds."""
        if not self.is_compiled:
            return SMALL_BATCH  # with the program of runs, which exists already
        return max(FEWEST_FROM_ANCHORS, min(MOST_SIDE_BY_SIDE, CALL_ENTRIES // self._entries))

    @cached_property
    def program(self) -> OnLlvm | OnXla:
        """The program that solves many instants."""
        system = self.model.system
        zeros, state = np.zeros(1), self.still(self.model.guess)
        instants = self.needed(state), zeros, zeros, self.own, np.zeros(1, bool)
        small = system.shape[1] <= FEW_COLUMNS
        laws = [getattr(group.element, "motion", ()) for group in system.groups]
        tables = max(map(np.size, jax.tree.leaves(laws)), default=0) > LARGE
        options: dict[str, Any] = {"large": (LARGE_BESIDE_TABLES if tables else None) if small else LARGE}
        options |= {"width": partial(round_width, system), "pose_type": self.model.pose_type, "order": self.order}
        return advance_instant.program((system, self._settings), instants, **options)

    @cached_property
    def _batches(self) -> int:
        """Largest number of batches of a run; static, so that each mechanism compiles one program."""
        return min(LONGEST_RUN, max(1, RUN_ENTRIES // (SMALL_BATCH * self._entries)))

    @cached_property
    def _entries(self) -> int:
        """Count of numbers that describe the motion of all bodies at an instant."""
        return (self.order + 1) * sum(x.size for x in self.model.guess.values())

    @cached_property
    def _settings(self) -> Settings:
        return Settings(*map(np.asarray, (self.tolerance, self.refine, self.finite_order)))

    def _take_steps(
        self,
        run: StepState,
        grid: Float[np.ndarray, " time"],
        batch_limit: int,
        *,
        stop: float = 0.0,
        smallest: float = 0.0,
        search: bool = True,
        only_made: bool = False,
    ) -> Any:
        length = (self._batches + 1) * (SMALL_BATCH - 1)
        window = np.full(length, np.inf)
        window[: len(grid)] = grid[:length]
        call = take_steps.prepare if only_made else take_steps
        native = WhenMade(lambda: self.program.name if isinstance(self.program, OnLlvm) else None)
        options = {"pose_type": self.model.pose_type, "order": self.order, "batches": self._batches, "native": native}
        limits = StepLimits(np.asarray(stop), np.asarray(smallest))
        bounds = limits, self._settings, np.asarray(search), np.asarray(batch_limit)
        return call(self.model.system, run, window, *bounds, **options)

    def fault(self, arrival: StepResult, lane: int) -> str:
        """Return the origin of a failure: a driver without a permitted value, an output, or the farthest body."""
        refused = np.flatnonzero(~arrival.admissible[:, lane])
        if refused.size:
            return ", ".join(self.model.drivers[k] for k in refused)
        if arrival.status[lane] == Status.INCONSISTENT:
            return self._contradicting(np.asarray(arrival.gaps[..., lane]))
        if arrival.status[lane] == Status.UNDEFINED and arrival.finite[0, lane]:
            names = [name for group in self.model.outputs for name in group]
            return f"output {names[int(np.argmin(arrival.finite[1:, lane]))]}"
        return f"body {self.model.bodies[int(arrival.body[lane])]}"

    def _contradicting(self, gaps: Float[np.ndarray, "2 row"]) -> str:
        """Return the joints and drivers that contradict each other, with the size of their gap, in words."""
        size, ratios = gaps
        largest = [self.model.rows[k] for k in np.argsort(-ratios) if ratios[k] > 0.1 * ratios.max()]
        names = dict.fromkeys(sorted(largest, key=lambda name: name not in self.model.drivers))  # drivers first
        gap = size.max()
        phrase = f"open by {gap:.2g} rad, or sizes of the mechanism" if gap > LARGEST_GAP else "in their rates"
        return f"{', '.join(list(names)[:4])} ({phrase})"


def _run_from(
    source: SolvedState,
    expansion_point: Sequence[float],
    *,
    step: Any = None,
    instant: Any = None,
    largest: float = np.inf,
    crawled: int = 0,
) -> StepState:
    """Return a run at its beginning, with its first step, if given."""
    zeros = np.zeros(SMALL_BATCH)
    instants = zeros if instant is None else instant
    control = initial_control(ExpansionPoint(*map(np.asarray, expansion_point)), np.asarray(instants[0]))
    control = control._replace(largest=np.asarray(largest), crawled=np.asarray(crawled))
    decided, first = np.asarray(instant is not None), np.zeros((), int)
    return StepState(source, control, zeros if step is None else step, instants, decided, first, NOWHERE)
