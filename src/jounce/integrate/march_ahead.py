"""The program of the steps, compiled while the start is looked for."""

from contextlib import ExitStack
from typing import Any

import jax
import numpy as np

from jounce.dynamics.forward import Equations, State
from jounce.dynamics.masses import gravity_of, required_masses
from jounce.dynamics.start import ConsistentStart, at_rest, equations_of
from jounce.integrate.marching import DenseOutput, IntegratorState, Outcome, march, unexpanded
from jounce.integrate.methods import AbstractMethod
from jounce.kinematics.device import resident
from jounce.kinematics.rehearsal import first_time, rehearsed
from jounce.mechanism import Mechanism, Model
from jounce.mechanism.builder import released

STEPS = 64  # tried between two looks at progress and events


class MarchAhead(ExitStack):
    """The program of the steps of a run, compiled in another thread until this context ends.

    Parameters
    ----------
    mechanism : Mechanism
        What is to move.
    span : tuple of float
        From where to where, s.
    method : AbstractMethod
        How steps are taken.
    tolerance, longest : float
        Of the error of a step, and the longest one, s.
    """

    def __init__(
        self, mechanism: Mechanism, span: tuple[float, float], method: AbstractMethod, tolerance: float, longest: float
    ):
        super().__init__()
        self.new = False  # whether there was no such program before
        self._mechanism, self._span, self._method, self._limits = mechanism, span, method, (tolerance, longest)
        self._order = method.expansion_order(tolerance)
        self._begun = False

    def begin(self, model: Model) -> None:
        """Begin with what is built already, if the program depends on nothing else."""
        self.new = first_time("march", model.system, self._order, self._method)
        if not self.new:
            return
        model = released(model) if self._mechanism.initial else model
        rows, columns = model.system.shape
        if rows > columns and model.system.rank is None:
            return  # which rows are redundant is found by a number that only the assembled bodies show
        masses, gravity = required_masses(self._mechanism, "the equations of motion"), gravity_of(self._mechanism)
        self._compile(resident(equations_of(model, masses, gravity)), at_rest(model, model.guess))

    def follow_up(self, start: ConsistentStart) -> None:
        """Begin with the start, if that was not possible before."""
        if not self._begun:
            self._compile(start.equations, start.state)

    def _compile(self, equations: Equations, state: State) -> None:
        self._begun = True
        first, last = self._span

        def arrived() -> Any:
            current = unexpanded(equations, state, np.array([first]), order=self._order)
            current = current._replace(outcome=np.full_like(current.outcome, int(Outcome.ARRIVED)))
            return march(equations, current, last, *self._limits, method=self._method, count=STEPS)

        self.enter_context(rehearsed(arrived, wanted=True))

    def one_step(self, start: ConsistentStart) -> DenseOutput:
        """Return one step of the whole length, at rest, in the form of those that will be taken."""
        first, last = self._span
        current: IntegratorState = unexpanded(start.equations, start.state, np.array([first]), order=self._order)
        form = jax.eval_shape(self._method.polynomial, current.expansion, current.expansion, current.time)
        still = jax.tree.map(lambda x: np.zeros((1, *x.shape[:-1])), form)
        for part, known in zip(still, start.state, strict=True):
            part[0, 0] = np.asarray(known)[..., 0]
        angles = tuple(np.asarray(part).T for part in current.angles)
        return DenseOutput(np.asarray(current.time), np.full(1, last - first), still, np.full(1, -1), angles)
