"""The programs of a run, compiled while its start is looked for."""

import threading
from collections.abc import Callable
from contextlib import ExitStack

import jax
import numpy as np
from jaxtyping import Float

from jounce.dynamics.forward.accelerations import Equations, State
from jounce.dynamics.forward.initial_state import ConsistentStart, at_rest, equations_of
from jounce.dynamics.masses import gravity_of, required_masses
from jounce.execution.backends import is_wanted
from jounce.execution.compilation import check_wanted
from jounce.execution.device import resident
from jounce.execution.llvm.modules import telling
from jounce.execution.rehearsal import first_time, rehearsed
from jounce.integrate.marching.marching import DenseOutput, IntegratorState, Outcome, march, unexpanded
from jounce.integrate.marching.user_methods import integrator
from jounce.integrate.results.simulation import FEW_INSTANTS, derivatives_of_motion, motion_at
from jounce.integrate.steps.events import pose_coordinates
from jounce.integrate.steps.methods import AbstractMethod
from jounce.kinematics.position_analysis.forces_at_rest import ask_forces_at_rest
from jounce.mechanism import Mechanism, Model
from jounce.mechanism.builder import released

STEPS = 64  # tried between two looks at progress and events


class ProgramsAhead(ExitStack):
    """The programs of the steps of a run, and of the motion within them, compiled in threads until this context ends.

    Parameters
    ----------
    mechanism : Mechanism
        What is to move.
    instants : array of shape (time,)
        At which the motion is wanted, s.
    order : int
        Highest derivative of the outputs.
    method : AbstractMethod
        How steps are taken.
    tolerance, longest : float
        Of the error of a step, and the longest one, s.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        instants: Float[np.ndarray, " time"],
        order: int,
        method: AbstractMethod,
        tolerance: float,
        longest: float,
    ):
        super().__init__()
        self._mechanism, self._instants = mechanism, instants
        self._order, self._max_order = order, derivatives_of_motion(mechanism, order)
        self._method, self._limits = method, (tolerance, longest)
        self._expansion = method.expansion_order(tolerance)
        self._pending = False

    def begin(self, model: Model) -> None:
        """Begin with what is built already, if the programs depend on nothing else."""
        self._pending = first_time("march", model.system, self._expansion, self._max_order, self._method)
        if not self._pending:
            return
        model = released(model) if self._mechanism.initial else model
        rows, columns = model.system.shape
        if rows > columns and model.system.rank is None:
            return  # which rows are redundant is found by a number that only the assembled bodies show
        masses, gravity = required_masses(self._mechanism, "the equations of motion"), gravity_of(self._mechanism)
        self._compile(resident(equations_of(model, masses, gravity)), model, at_rest(model, model.guess))

    def go_on(self, start: ConsistentStart) -> None:
        """Begin with the start, if that was not possible before."""
        if self._pending:
            self._compile(start.equations, start.model, start.state)

    def _compile(self, equations: Equations, model: Model, state: State) -> None:
        self._pending = False
        first, last = self._instants[:1], self._instants[-1]  # of the types that the run has: XLA tells them apart

        def begun() -> IntegratorState:
            return unexpanded(equations, state, first, order=self._expansion)

        def arrived() -> None:
            current = begun()
            current = current._replace(outcome=np.full_like(current.outcome, int(Outcome.ARRIVED)))
            method = integrator(self._method, equations, current)
            march(equations, current, last, *self._limits, method=method, count=STEPS)

        def evaluated() -> None:
            dense = self._one_step(begun(), last - first[0])
            outputs, some = model.system.outputs, self._instants[: FEW_INSTANTS + 1]
            motion_at(equations, outputs, dense, some, np.zeros(len(some), int), self._max_order)

        def forces() -> None:
            coordinates = pose_coordinates(state.map(lambda part: np.asarray(part)[None]))
            pose = {
                name: part[0] for name, part in coordinates.items() if len(part)
            }  # angular velocities begin one later
            ask_forces_at_rest(self._mechanism, model, pose, self._instants, self._order, self._max_order + 1)

        before = None
        for program in (arrived, forces, evaluated):  # those that LLVM takes longest for are written first
            before = self._after(before, program)

    def _after(self, before: threading.Event | None, program: Callable[[], None]) -> threading.Event:
        """Begin with programs as soon as those before are written, which LLVM then compiles; and tell when they are."""
        written = threading.Event()

        def compile_in_turn() -> None:
            if before is not None and is_wanted():
                before.wait()
            try:
                check_wanted()  # the start may have been refused meanwhile
                with telling(written.set):
                    program()
            finally:
                written.set()

        self.enter_context(rehearsed(compile_in_turn, wanted=True))
        return written

    def _one_step(self, current: IntegratorState, length: float) -> DenseOutput:
        """Return one step, at rest, in the form of those that will be taken."""
        form = jax.eval_shape(self._method.polynomial, current.expansion, current.expansion, current.time)
        zeros = jax.tree.map(lambda x: np.zeros((1, *x.shape[:-1])), form)
        for part, known in zip(zeros, current.expansion.state, strict=True):
            part[0, 0] = np.asarray(known)[0, ..., 0]
        angles = tuple(np.asarray(part).T for part in current.angles)
        return DenseOutput(np.asarray(current.time), np.full(1, length), zeros, np.full(1, -1), angles)
