"""The result of a simulation: a motion with dense output, energy, drift and events."""

from functools import cached_property, partial
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.base.shapes import Array, ArrayLike, Numbers, seconds
from jounce.dynamics.forward.accelerations import Equations, Lanes, State, expand
from jounce.dynamics.forward.initial_state import ConsistentStart
from jounce.dynamics.motion_values import Coordinates, cut, pose_of
from jounce.errors import JounceError, MechanismError
from jounce.execution.backends import joined
from jounce.execution.mapped import mapped
from jounce.integrate.marching.marching import DenseOutput
from jounce.integrate.marching.robot_marching import RobotSteps
from jounce.integrate.marching.smoothness_breaks import breaks
from jounce.integrate.steps import revolution_counts
from jounce.integrate.steps.energy_balance import energies
from jounce.integrate.steps.events import WIDTHS, in_pieces, pose_coordinates, series_of
from jounce.integrate.steps.lookahead import watched_names
from jounce.integrate.steps.methods import evaluated, expanded_about, near_singular
from jounce.integrate.steps.projection import normalized, projected
from jounce.integrate.steps.revolution_counts import POINTS_IN_STEP, AnglesOfForces
from jounce.jet import Jet
from jounce.jet.derivatives import plain_derivatives
from jounce.jet.turns import counted_by_rates, shifted_by_turns
from jounce.kinematics import Motion, Status
from jounce.kinematics.results.pose_outputs import output_series
from jounce.mechanism import Mechanism
from jounce.mechanism.outputs.base import lost_orders
from jounce.mechanism.system import Group
from jounce.mechanism.transmissions.axis_angles import AttitudeHistory, measures_angle, with_turns

# ratio of the steps before and after a jump or kink to the step over it; a steep force takes several short steps
MUCH_LONGER = 1e3
FEW_INSTANTS = 8  # width of a program for a few instants, such as those at the end of a long run
APPROACH = 4  # steps up to a jump or kink, each of which may be much shorter than the one before it
STRAYED = 1e-9  # correction of positions beyond which the projection may have left them, rad or sizes of the mechanism
AMPLIFIED = 1e3  # largest plausible ratio of a correction to the gap that it closes
SINGULAR = 1e3  # least response to a unit gap, in largest masses, beside a singular position
RADIUS = 0.1  # response at about one radius of the series from a singular position; it grows with the inverse square


class Simulation(Motion):
    """The motion of a mechanism under its forces, at the requested instants and at any other.

    It has all attributes and methods of `Motion`. At each instant the derivatives of every order follow from the
    equations of motion, not from the steps.

    Attributes
    ----------
    energy : numpy.ndarray of shape (time,)
        Kinetic energy, potential energy in gravity, and energy stored in springs, J.
    drift : numpy.ndarray of shape (time,)
        Largest residual of all joints and drivers on positions, rad or sizes of the mechanism.
    mobility : str
        Degrees of freedom and the bodies that have them.
    events : list of list of float
        For each requested event, the times at which it happened, s.
    kinks : list of tuple of float and str
        Times of jumps and kinks of forces, s, with their names, and of some of motion laws.
    dense_output : DenseOutput
        The steps as polynomials.
    steps_backend : str
        Backend that took the steps; empty for steps of another solver. `backend` includes that of the motion at the
        instants.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        start: ConsistentStart,
        dense: DenseOutput,
        instants: np.ndarray,
        order: int,
        ending: tuple[Status, str] = (Status.OK, ""),
        events: list[list[float]] | None = None,
        steps_backend: str = "",
    ):
        self.dense_output, self._start, self.steps_backend = dense, start, steps_backend
        self.events = [] if events is None else events
        self._ending = ending
        reached, chosen = steps_of(dense, instants)

        def lanes_of(lanes: np.ndarray) -> Any:
            steps, times = chosen[lanes], instants[lanes]
            polynomial = dense.polynomial.map(lambda part: at_steps(part, steps))
            return tuple(part[steps].T for part in dense.angles), polynomial, times - dense.start[steps], times

        outputs, levels = start.model.system.outputs, {"order": derivatives_of_motion(mechanism, order)}
        outcome, backend = expanded.at_instants((start.equations, outputs), lanes_of, len(instants), **levels)
        state, self._angles, outputs_found, response = outcome
        near = response > SINGULAR
        self.singular_distance = np.where(near, np.sqrt(RADIUS / np.where(near, response, 1.0)), 1.0)
        groups = tuple(
            self._counted(group, series, instants) for group, series in zip(outputs, outputs_found, strict=True)
        )
        status, faults = status_of(dense, instants, reached, ending)
        unknown = reached & ~np.isfinite(np.concatenate([p.reshape(-1, len(instants)) for p in state])).all(axis=0)
        for names, series in zip(start.model.outputs, groups, strict=True):
            nonfinite = ~np.isfinite(series[: order + 1]).all(axis=(0, 1)) & reached & ~unknown  # (outputs, time)
            undefined = np.flatnonzero(nonfinite.any(axis=0))
            status[undefined] = int(Status.UNDEFINED)
            faults |= {int(lane): f"output {names[int(np.argmax(nonfinite[:, lane]))]}" for lane in undefined}
        if unknown.any():  # the state is known, but not its derivatives
            reason = ending[0] if ending[0] == Status.LOCKED else Status.INADMISSIBLE
            status[unknown], faults[int(np.argmax(unknown))] = int(reason), ending[1]
        values = tuple(plain_derivatives(np.asarray(series)) for series in groups)
        super().__init__(
            mechanism, start.model, instants, order, (partial(pose_coordinates, state), values), status, faults
        )
        self.backend = joined({backend, *filter(None, steps_backend.split(", "))})

    def __repr__(self) -> str:
        return f"<Simulation{super().__repr__()[7:-1]}, {self.steps} steps>"

    @property
    def mobility(self) -> str:
        """Degrees of freedom and the bodies that have them, in words."""
        return self._start.mobility

    @property
    def equations(self) -> Equations:
        """The equations of motion."""
        return self._start.equations

    def steps_at(self, instants: np.ndarray) -> np.ndarray:
        """Return the index of the step of each instant."""
        return steps_of(self.dense_output, instants)[1]

    def output_values(self, group: int) -> np.ndarray:
        """Return the derivatives of the outputs of a group, (order + 1, components, instances, time)."""
        return list(self._groups.values())[group]

    @property
    def steps(self) -> int:
        """Number of steps taken."""
        return len(self.dense_output.start)

    @property
    def kinks(self) -> list[tuple[float, str]]:
        """Times of jumps and kinks of forces, s, with names; derivatives of the motion do not exist at them.

        The step over a jump or kink is so short that it costs no digits, and the next step may be long again. Kinks of
        motion laws are listed if such a step notes them; `jounce.laws.continuity` finds all.
        """
        kink, length = self.dense_output.kink, np.abs(self.dense_output.length)
        names = watched_names(self._start.model)
        before = [length[max(k - APPROACH, 0) : k].max(initial=0.0) for k in range(len(length) - 1)]
        limits = MUCH_LONGER * length[:-1]
        indices = np.flatnonzero((kink[:-1] >= 0) & (length[1:] > limits) & (np.array(before) > limits))
        delays = {int(k): float(self.dense_output.length[k]) for k in indices}
        # series that the next step does not continue give the time, and after a long approach they alone show the kink
        delays |= {x.step: x.since for x in breaks(self.dense_output, float(self.model.length)) if kink[x.step] >= 0}
        return [(float(self.dense_output.start[k] + delays[k]), names[kink[k]]) for k in sorted(delays)]

    @property
    def ended_at(self) -> float:
        """Time to which the motion was followed, s."""
        return self.dense_output.end

    def at(self, time: ArrayLike, order: int | None = None) -> "Simulation":
        """Return the same simulation at other instants, without integrating again.

        Parameters
        ----------
        time : array_like of shape (time,)
            Instants, s; values outside of the simulated time are NaN.
        order : int, optional
            Highest derivative; by default that of this simulation.
        """
        instants = chosen_instants(time, MechanismError)
        order = self.order if order is None else order
        outcome = self._ending, self.events, self.steps_backend
        return Simulation(self.mechanism, self._start, self.dense_output, instants, order, *outcome)

    @property
    def energy(self) -> Array[np.ndarray, " time"]:
        """Kinetic energy, potential energy in gravity, and energy stored in springs, J, shape (time,)."""
        return self._checked[0]

    @property
    def drift(self) -> Array[np.ndarray, " time"]:
        """Largest residual of joints and drivers, rad or sizes of the mechanism, shape (time,)."""
        return self._checked[1]

    @property
    def kinetic_energy(self) -> Array[np.ndarray, " time"]:
        """Kinetic energy, J, shape (time,)."""
        return self._checked[2]

    @cached_property
    def forces(self) -> tuple[Group, ...]:
        """The applied forces, in the groups of the model, with the revolutions of angles about axes at each instant."""
        return with_turns(self.model.system.forces, self._angles)

    @cached_property
    def _attitudes(self) -> AttitudeHistory:
        """The attitudes of all bodies in space along the steps, or at the states of another solver."""
        dense = self.dense_output
        if not dense.length.any():
            return AttitudeHistory(self._attitudes_at(dense.start), dense.start)
        instants = (dense.start[:, None] + dense.length[:, None] * (np.arange(POINTS_IN_STEP) / POINTS_IN_STEP)).ravel()
        instants = np.append(instants, dense.end)
        samples = revolution_counts.attitudes_along(dense.polynomial.attitude, dense.length, POINTS_IN_STEP)
        return AttitudeHistory(samples, instants, between=self._attitudes_at)

    def _attitudes_at(self, instants: Float[np.ndarray, " time"]) -> Float[np.ndarray, "4 bodies time"]:
        dense, chosen = self.dense_output, self.steps_at(instants)
        return revolution_counts.attitudes_at(dense.polynomial.attitude[chosen], instants - dense.start[chosen])

    def _coefficients(self, group: Group) -> np.ndarray:
        pose_type, coordinates = self.poses
        (series,) = series_of((group,), coordinates, pose_type)
        return self._counted(group, series, self.time)

    def _counted(
        self, group: Group, series: Float[np.ndarray, "order component instance time"], instants: np.ndarray
    ) -> Float[np.ndarray, "order component instance time"]:
        """Return the series of outputs at instants, with revolutions of angles counted from step to step."""
        dense = self.dense_output
        if not group.element.turning:
            return series
        if not dense.length.any():  # no steps: states of another solver
            series[0] = counted_by_rates(series[0], series[1], instants)
            return series
        if measures_angle(group):
            (counted,) = self._attitudes.counting((group,), instants)
            series[0, 0] = shifted_by_turns(series[0, 0], counted.element.datum.near)
            return series
        kind = self._start.model.pose_type
        pieces = in_pieces(group, dense.polynomial, dense.length, 1, kind, lambda x: x[1:2])
        nodes, node_values = pieces.time(dense.start, dense.length), pieces.series[:2]
        node_values = node_values.reshape(*node_values.shape[:3], -1)
        counted = counted_by_rates(node_values[0], node_values[1], nodes)
        index = np.abs(nodes[None] - instants[:, None]).argmin(axis=1)
        expected = counted[..., index] + (instants - nodes[index]) * 0.5 * (node_values[1][..., index] + series[1])
        series[0] = shifted_by_turns(series[0], expected)
        return series

    @cached_property
    def _checked(self) -> list[np.ndarray]:
        """Energy, drift and kinetic energy."""
        pose_type, coordinates = self.poses
        lanes = self._angles, cut(coordinates, 1), self.time
        checks = _checks.along(self._start.equations, lanes, pose_type=pose_type)
        return [np.where(self.status == Status.OK, part, np.nan) for part in checks]


def chosen_instants(time: ArrayLike, error: type[JounceError]) -> Float[np.ndarray, " time"]:
    """Return the instants at which a simulation is evaluated again, s; raise `error` if there is none."""
    instants = np.atleast_1d(seconds("time", time, error))
    if instants.ndim != 1 or not instants.size:
        raise error("must be an instant, or a list of at least one", name="time", value=time)
    return instants


def steps_of(dense: DenseOutput | RobotSteps, instants: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return whether the steps reach each instant, and the index of its step."""
    start, end = dense.start, dense.end
    if dense.length[0] < 0:
        start, end, instants = -start, -end, -instants
    rounding = 1e-14 * max(abs(start.item(0)), abs(end))
    reached = (instants - start[0] >= -rounding) & (instants - end <= rounding)
    chosen = np.searchsorted(start, instants, side="right") - 1
    return reached, np.maximum(np.minimum(chosen, len(start) - 1), 0)


def status_of(
    dense: DenseOutput | RobotSteps,
    instants: Float[np.ndarray, " time"],
    reached: Bool[np.ndarray, " time"],
    ending: tuple[Status, str],
) -> tuple[Int[np.ndarray, " time"], dict[int, str]]:
    """Return the status of instants, with the reason of the end at the first one beyond the last step, and faults."""
    status = np.where(reached, int(Status.OK), int(Status.NOT_REACHED))
    if ending[0] == Status.OK:
        return status, {}
    unreached = np.flatnonzero(~reached & (np.abs(instants - dense.start[0]) > abs(dense.end - dense.start[0])))
    if not unreached.size:
        return status, {}
    status[unreached[0]] = int(ending[0])
    return status, {int(unreached[0]): ending[1]}


def at_steps(part: np.ndarray, chosen: Int[np.ndarray, " batch"]) -> np.ndarray:
    """Return the entries of chosen steps, with the step axis moved from first to last."""
    last = (*range(1, part.ndim), 0)
    if len(chosen) < len(part):
        return part[chosen].transpose(last)
    return part.transpose(last).take(chosen, axis=-1)  # contiguous; transposing so many entries later takes longer


def derivatives_of_motion(mechanism: Mechanism, order: int) -> int:
    """Return the order of the motion that outputs with derivatives up to an order require."""
    return order + max(1, lost_orders(mechanism.outputs.values()))


@mapped(widths=(FEW_INSTANTS, *WIDTHS), narrow=True)
def expanded(
    shared: tuple[Equations, tuple[Group, ...]], lanes: tuple[AnglesOfForces, State, Lanes, Lanes], order: int
) -> tuple[State, AnglesOfForces, tuple[Float[Numbers, "_ _ _ batch"], ...], Lanes]:
    """Return the Taylor coefficients of the motion at instants, from the equations of motion.

    Next to a singular position, where rounding decides the coefficients of the equations, they are those of the step;
    so are positions and velocities where the projection onto the constraints would leave them.

    Parameters
    ----------
    shared : tuple
        Equations, and outputs.
    lanes : tuple
        For each instant: angles about axes that forces measure at the beginning of its step, the polynomial of the
        step, the time since its beginning, s, and the instant.
    order : int
        Highest coefficient.

    Returns
    -------
    state : State
        Coefficients, (order + 1, components, bodies, instants).
    angles : tuple of array
        Angles about axes that forces measure at the instants.
    outputs : tuple of array
        Series of the outputs, as from `output_series`.
    response : array
        Largest response to a unit gap of a constraint, in largest masses.
    """
    (equations, outputs), (angles, polynomial, step, instants) = shared, lanes
    equations = equations.near(angles)
    first_angles = revolution_counts.measured(equations, polynomial.map(lambda part: part[0]))
    counted = equations.near(revolution_counts.followed(equations, first_angles, polynomial, step).at(step))
    arrived = evaluated(polynomial, step)
    state, correction, inverse = projected(counted, arrived, instants[None])
    residual = counted.system.residual(counted.pose_at_rest(arrived.position, arrived.attitude), Jet([instants[None]]))
    gap = jnp.max(jnp.abs(residual.coefficients[0]), axis=0, initial=0.0)
    is_lost = ~(correction <= jnp.maximum(STRAYED, AMPLIFIED * gap))  # by a projection at a singular position
    state = State(*(jnp.where(is_lost, x, y) for x, y in zip(arrived, state, strict=True)))
    state = state._replace(attitude=normalized(state.attitude))
    series = expand(counted, state, instants[None], order, inverse).state
    if len(polynomial.position) > order:  # steps of another solver have fewer coefficients
        singular = near_singular(counted, inverse) | is_lost
        step_series = expanded_about(polynomial, step, order)
        series = State(
            *(jnp.concatenate([x[:1], jnp.where(singular, y, x)[1:]]) for x, y in zip(series, step_series, strict=True))
        )
    outputs_found = output_series(outputs, pose_coordinates(series), equations.pose_type)
    response = jnp.where(is_lost, jnp.inf, inverse.responses(counted.system.shape[1])[1])
    return series, revolution_counts.measured(counted, state), outputs_found, response


@mapped(widths=(FEW_INSTANTS, *WIDTHS))
def _checks(
    equations: Equations, lanes: tuple[AnglesOfForces, Coordinates, Lanes], pose_type: type
) -> tuple[Lanes, Lanes, Lanes]:
    """Return the energy, the largest residual and the kinetic energy."""
    angles, coordinates, instants = lanes
    equations, pose, clock = equations.near(angles), pose_of(coordinates, pose_type), Jet.variable(instants[None], 1)
    kinetic, potential, *_ = energies(equations, pose, clock)
    gaps = equations.system.residual(pose, clock).coefficients[0]
    return kinetic + potential, jnp.max(jnp.abs(gaps), axis=0, initial=0.0), kinetic
