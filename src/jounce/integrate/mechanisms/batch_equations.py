"""The equations of motion and the initial states of all runs of a batch, from values of parameters."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jounce.constraints.base import value_fields
from jounce.dynamics.forward.accelerations import Equations, State
from jounce.dynamics.forward.initial_state import consistent_start, with_rates
from jounce.dynamics.forward.saddle_fronts import SaddleFronts
from jounce.dynamics.masses import gravity_of, masses_of
from jounce.errors import JounceError, MobilityError
from jounce.execution.compilation import LARGE
from jounce.execution.mapped import Mapped, mapped
from jounce.integrate.marching.marching import FEW_RUNS, MANY_RUNS
from jounce.integrate.results.simulation import expanded
from jounce.integrate.steps.events import pose_coordinates
from jounce.integrate.steps.projection import projected
from jounce.jet import Jet
from jounce.jet.turns import shifted_by_turns
from jounce.kinematics.continuation.instant_program import of_design
from jounce.kinematics.families.varied_tree import VariedTree
from jounce.kinematics.status import Status
from jounce.mechanism import Mechanism, Model, build
from jounce.mechanism.building.starting_guess import starting_guess
from jounce.mechanism.system import POSITION_COMPONENTS
from jounce.mechanism.transmissions.axis_angles import measures_angle, raw_angles

STAGES = 8  # of the continuation in the parameters from those of the first run
LARGEST_STAGE = 0.5  # rad, of a driver in a stage, so that revolutions of angles about axes can be counted


Turns = tuple[Float[np.ndarray, "instance run"], ...]
"""Angles about axes with their revolutions, rad, for each group that measures them."""


class ParametricMechanism:
    """A mechanism with values for each run, last, where these depend on parameters.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism with the values of one run.
    model : Model
        Model built from it.
    names : tuple of str
        Parameters that differ between runs.
    """

    def __init__(self, mechanism: Mechanism, model: Model, names: tuple[str, ...]):
        self.mechanism, self.model, self.names = mechanism, model, names
        self.scale = masses_of(mechanism).scale(model.length)
        self.saddle = SaddleFronts.of(model.system.pattern)
        self._nominal = self._made(mechanism, model)

    def _made(self, mechanism: Mechanism, model: Model) -> tuple[Equations, Any]:
        system = dataclasses.replace(model.system, outputs=())
        masses, gravity = masses_of(mechanism), gravity_of(mechanism)
        return Equations(system, masses, gravity, self.scale, model.pose_type, self.saddle), model.system.outputs

    def of(self, rows: np.ndarray) -> VariedTree:
        """Return equations of motion and outputs for parameters, (runs, parameters), with one lane for each run."""
        if self._has_values_of_guess() and self.guesses_differ(rows):
            return VariedTree.joined([self._of_one_run(row) for row in rows.tolist()], self._nominal)

        def made(row: Any) -> tuple[Equations, Any]:
            varied = self.varied(row)
            return self._made(varied, build(varied, like=self.model))

        return VariedTree.traced(made, rows, self._nominal)

    def _of_one_run(self, row: Sequence[float]) -> tuple[Equations, Any]:
        """Return equations and outputs of one run, with values that follow from its own starting guess."""
        varied = self.varied(row)
        system = dataclasses.replace(self.model.system, groups=build(varied).system.groups)
        return self._made(varied, build(varied, like=dataclasses.replace(self.model, system=system)))

    def varied(self, row: Any) -> Mechanism:
        """Return the mechanism with the parameters of one run."""
        return self.mechanism.with_parameters(**dict(zip(self.names, row, strict=True)))

    def guesses_differ(self, rows: np.ndarray) -> bool:
        """Return whether the starting guess of the bodies differs between runs."""
        components = POSITION_COMPONENTS[self.mechanism.space]
        guesses = (starting_guess(m, m.parameter_values, components) for m in map(self.varied, rows.tolist()))
        first = jax.tree.leaves(next(guesses))
        return any(not np.array_equal(a, b) for g in guesses for a, b in zip(jax.tree.leaves(g), first, strict=True))

    def _has_values_of_guess(self) -> bool:
        """Return whether the starting guess determines the offset of a joint, or the sign of its Euler parameters."""
        joints = self.mechanism.joints.values()
        offset = any("offset" in value_fields(type(j)) and getattr(j, "offset", 0.0) is None for j in joints)
        return offset or any(hasattr(j, "sense") for j in joints)


def mapped_runs(
    function: Mapped, tree: VariedTree, runs: np.ndarray, shared: tuple[Any, ...], lanes: tuple[Any, ...], **static: Any
) -> tuple[Any, str]:
    """Return the result of a function for some runs, and the name of its backend.

    The function receives the shared values of `tree`, from `ParametricMechanism.of`, before `shared`, and the values of
    each run before `lanes`, as for `of_design`.
    """
    shared, lanes = (tree.at(runs[:1]), *shared), (tree.own(runs), *lanes)
    program = function.program(shared, lanes, large=LARGE, **static)
    return program(lanes), program.backend


class BatchStart:
    """Consistent initial states of runs: positions by continuation from the first run, and least velocities.

    If bodies are free to move and their starting guess differs, each run is assembled from its own guess instead.

    Parameters
    ----------
    parametric : ParametricMechanism
        The mechanism of the runs.
    with_conditions : ParametricMechanism
        The same with the initial conditions as drivers.
    state : State
        Initial state of the first run.
    rows : array of shape (runs, parameters)
        Parameters of all runs.
    instant : float
        s.
    """

    def __init__(
        self,
        parametric: ParametricMechanism,
        with_conditions: ParametricMechanism,
        state: State,
        rows: np.ndarray,
        instant: float,
    ):
        self._parametric, self._state, self._rows, self._instant = parametric, state, rows, instant
        self.failed: dict[int, Status] = {}  # runs without an initial state, with the reason
        self._made, self._stages = parametric.of(rows), list[VariedTree]()
        equations, coordinates = with_conditions.model.system.shape
        rank = with_conditions.model.system.rank
        if (equations if rank is None else rank) < coordinates and parametric.guesses_differ(rows):
            return
        final_tree = with_conditions.of(rows)
        count = max(STAGES, int(np.ceil(self._turned(final_tree.at(slice(None))[0], len(rows)) / LARGEST_STAGE)))
        change = (rows - rows[0]) / count
        self._stages = [with_conditions.of(rows[0] + stage * change) for stage in range(1, count)] + [final_tree]

    def _turned(self, equations: Equations, count: int) -> float:
        """Return the largest difference of drivers of angles about axes between the first run and any other, rad."""
        clock, largest = Jet([np.full((1, 1), self._instant)]), 0.0
        for group in filter(measures_angle, equations.system.groups):
            law = np.asarray(group.element.motion(clock).coefficients[0])
            law = np.broadcast_to(law, (group.instances, count))
            largest = max(largest, float(np.max(np.abs(law - law[:, :1]))))
        return largest if np.isfinite(largest) else 0.0

    def of(self, runs: np.ndarray) -> tuple[State, Turns, Turns]:
        """Return the initial states of some runs, and the angles about axes that forces and outputs measure."""
        equations, outputs = self._made.at(runs)
        measuring = [group for group in (*equations.system.forces, *outputs) if measures_angle(group)]
        angles = [np.broadcast_to(group.element.datum.near, (group.instances, len(runs))) for group in measuring]
        state = self._state.map(lambda part: np.repeat(np.asarray(part), len(runs), axis=-1))
        continued = np.full(len(runs), bool(self._stages))
        for stage in self._stages:
            (state, reached), _ = mapped_runs(followed, stage, runs, (np.asarray(self._instant),), (state,))
            continued &= reached
            if measuring:
                coordinates = pose_coordinates(state.map(lambda part: np.asarray(part)[None]))
                raw = raw_angles(measuring, {"quaternion": coordinates["quaternion"][0]})
                angles = [shifted_by_turns(angle, reference) for reference, angle in zip(angles, raw, strict=True)]
        count = len([group for group in equations.system.forces if measures_angle(group)])
        start = jax.tree.map(np.array, (state, tuple(angles[:count]), tuple(angles[count:])))
        for run in np.unique(runs[~continued]).tolist():
            self._put_one(start, runs == run, run)
        return start

    def _put_one(self, starts: tuple[State, Turns, Turns], lanes: Bool[np.ndarray, " lane"], run: int) -> None:
        """Set the initial state of a run that continuation did not reach, from its own guess; NaN if that fails."""
        try:
            start = consistent_start(self._parametric.varied(self._rows[run].tolist()), self._instant)
        except JounceError as error:
            reason = Status.SINGULAR if isinstance(error, MobilityError) else Status.INADMISSIBLE
            self.failed[run] = getattr(error, "status", None) or reason
            for part in starts[0]:
                part[..., lanes] = np.nan
            return
        system = start.model.system
        turns = [group.element.datum.near for group in (*system.forces, *system.outputs) if measures_angle(group)]
        for array, part in zip(jax.tree.leaves(starts), (*start.state, *turns), strict=True):
            array[..., lanes] = part


@mapped(widths=(FEW_RUNS, MANY_RUNS))
def followed(shared: tuple[Any, Any], lanes: tuple[dict[int, Any], State]) -> tuple[State, Any]:
    """Return states on the constraints with least velocities, and whether each was reached.

    Parameters
    ----------
    shared : tuple
        Equations, or a tuple that begins with them; and the instant, s.
    lanes : tuple
        For each run: its `design` values, as for `of_design`, and a state nearby.
    """
    (values, instant), (design, state) = shared, lanes
    equations, *_ = of_design(values, design)
    clock = jnp.broadcast_to(instant, (1, state.position.shape[-1]))

    def at_rest(state: State) -> State:
        return state._replace(velocity=jnp.zeros_like(state.velocity), spin=jnp.zeros_like(state.spin))

    reached, distance, _ = projected(equations, at_rest(state), clock)
    return with_rates(equations, at_rest(reached), clock), jnp.isfinite(distance)


@mapped(widths=(FEW_RUNS, MANY_RUNS))
def outputs_of_runs(
    shared: tuple[tuple[Equations, Any]], lanes: tuple[dict[int, Any], tuple[Any, ...]], *, order: int
) -> tuple[Any, ...]:
    """Return the series of the outputs of runs, as `expanded` does.

    Parameters
    ----------
    shared : tuple
        Equations and outputs.
    lanes : tuple
        For each run: its `design` values, as for `of_design`, and the lanes of `expanded`.
    order
        As for `expanded`.
    """
    (values,), (design, motion) = shared, lanes
    _, _, series, _ = expanded.function(of_design(values, design), motion, order)
    return series
