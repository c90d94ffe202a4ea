"""The result of a robot simulation: coordinates with derivatives of any order, torques, energy and events."""

import dataclasses
import itertools
import math
from collections.abc import Iterable, Sequence
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.shapes import ArrayLike, Numbers
from jounce.errors import RobotError
from jounce.execution.backends import joined
from jounce.execution.mapped import Mapped, mapped
from jounce.integrate.marching.robot_marching import RobotProblem, RobotSteps
from jounce.integrate.marching.robot_state import RobotState, at
from jounce.integrate.results.simulation import at_steps, chosen_instants, status_of, steps_of
from jounce.integrate.steps.methods import Lanes
from jounce.jet import Jet, compose
from jounce.jet.derivatives import plain_derivatives
from jounce.kinematics import Status
from jounce.kinematics.results.tables import Tabulated
from jounce.robot.algorithms.base_motion import BaseMotion
from jounce.robot.algorithms.forward_dynamics import coordinates_of
from jounce.robot.algorithms.inverse_dynamics import inverse_dynamics
from jounce.robot.algorithms.wrench_laws import WrenchPart
from jounce.robot.algorithms.wrenches import Wrench
from jounce.robot.robot import Robot
from jounce.units.shown_units import derivatives_of, time_axes

if TYPE_CHECKING:
    import xarray

WIDTHS = (8, 64)  # instants computed together, for short and for long lists
MUCH_LONGER = 1e3  # ratio of the steps beside a jump to the step over it
CLOSE = 1e-5  # of the longest step: steps this close to a jump belong to it


class RobotSimulation(Tabulated):
    """The motion of a robot under forces of its joints, at the requested instants and at any other.

    At each instant the derivatives of every order follow from the equations of motion, not from the steps. `status`
    tells for each instant whether it was reached; values are NaN if it was not.

    Attributes
    ----------
    robot : Robot
        The robot.
    time : numpy.ndarray of shape (time,)
        s.
    order : int
        Highest derivative.
    q : numpy.ndarray of shape (time, order + 1, n)
        Coordinates and their derivatives, rad or m by s.
    base : BaseMotion or None
        Motion of a free base; its twist has derivatives to `order`, at least to 1.
    status : numpy.ndarray of shape (time,)
        A `Status` for each instant.
    faults : dict of int to str
        Failures by the index of the instant.
    events : list of list of float
        For each requested event, the times at which it happened, s.
    steps : RobotSteps
        Steps as polynomials.
    backend : str
        Backend that computed the steps and the values at instants: "llvm", "xla" (with the device unless it is the
        processor), or both.
    """

    def __init__(
        self,
        robot: Robot,
        problem: RobotProblem,
        steps: RobotSteps,
        instants: np.ndarray,
        order: int,
        ending: tuple[Status, str] = (Status.OK, ""),
        events: list[list[float]] | None = None,
        wrenches: tuple[Wrench, ...] = (),
        steps_backends: Iterable[str] = (),
    ):
        self._steps_backends = tuple(steps_backends)
        self.robot, self.time, self.order, self.steps = robot, instants, order, steps
        self.events = [] if events is None else events
        self._problem, self._ending, self._wrenches = problem, ending, wrenches
        reached, chosen = steps_of(steps, instants)
        elapsed = np.where(reached, instants - steps.start[chosen], 0.0)
        levels = max(order - 2, 0)

        def lanes_of(lanes: np.ndarray) -> Any:
            polynomial = jax.tree.map(lambda c: at_steps(c, chosen[lanes]), steps.polynomial)
            return polynomial, elapsed[lanes], instants[lanes]

        (state, q, twist), backend = expanded_robot.at_instants(problem, lanes_of, len(instants), order=levels)
        self._state = state
        self.backend = joined({backend, *self._steps_backends})
        self.q = plain_derivatives(q).transpose(2, 0, 1)[:, : order + 1]
        self.base: BaseMotion | None = None
        if twist is not None:
            rates = plain_derivatives(twist).transpose(2, 0, 1)
            self.base = BaseMotion(state.position.T.copy(), state.quaternion.T.copy(), rates)
        is_finite = np.isfinite(self.q).all(axis=(1, 2))
        self.status, self.faults = status_of(steps, instants, reached, ending)
        self.status[reached & ~is_finite] = int(Status.UNDEFINED)
        self.q[~reached] = np.nan
        if self.base is not None:
            for part in (self.base.position, self.base.quaternion, self.base.twist):
                part[~reached] = np.nan

    def __repr__(self) -> str:
        solved = int((self.status == Status.OK).sum())
        return (
            f"<RobotSimulation of {self.robot.name}: {solved} of {len(self.time)} instants to order {self.order}, "
            f"{len(self.steps.start)} steps>"
        )

    @property
    def ended_at(self) -> float:
        """Time to which the motion was followed, s."""
        return self.steps.end

    @property
    def kinks(self) -> list[float]:
        """Times of jumps and kinks of forces, s, at which derivatives do not exist."""
        length, kink = np.abs(self.steps.length), self.steps.kink
        ends = self.steps.start + self.steps.length
        indices = [k for k in np.flatnonzero(kink) if k == 0 or length[: k + 1].max() > MUCH_LONGER * length[k]]
        close = [a for a, b in itertools.pairwise(indices) if abs(ends[b] - ends[a]) <= CLOSE * length.max()]
        return [float(ends[k]) for k in indices if k not in close]

    @cached_property
    def torque(self) -> Float[np.ndarray, "time level n"]:
        """Torques and forces of the joints with rates to `order` - 2, (time, order - 1, n), N m or N by s.

        They include those required by driven joints. With drives, they are the torques before armature inertia,
        damping and friction.
        """
        pairs = zip(self._wrenches, self._problem.wrenches.parts, strict=True)
        wrenches = [self._along_motion(*pair) for pair in pairs]
        torques = inverse_dynamics(
            self.robot, self.q, drives=self._problem.equations.drives, base=self._cut_base(), wrenches=wrenches,
            time=self.time if self._wrenches else None,
        )  # fmt: skip
        return np.asarray(torques if self.base is None else torques[..., 6:])

    def _along_motion(self, wrench: Wrench, parts: Sequence[WrenchPart]) -> Wrench:
        """Return a wrench with parts that depend on the state replaced by their values along the motion."""
        values = {name: self._along(part) for name, part in zip(("force", "torque"), parts, strict=True)}
        return dataclasses.replace(wrench, **values)

    def _along(self, part: WrenchPart) -> Any:
        """Return the derivatives of a function of time and state along the motion; a part of time alone unchanged."""
        given = part.constant if part.function is None else part.at
        if not part.of_state:
            return given
        levels = max(self.order - 1, 1)

        factorials = jnp.array([math.factorial(k) for k in range(self.order + 1)], float)

        def derivatives(time: Any, q: Any) -> Any:
            coefficients = q / factorials[:, None]

            def component(i: int, elapsed: Any) -> Any:
                q_there, rate = coefficients[-1], jnp.zeros(q.shape[1:])
                for coefficient in coefficients[-2::-1]:  # Horner's rule, and its derivative
                    rate = rate * elapsed + q_there
                    q_there = q_there * elapsed + coefficient
                return jnp.asarray(given(time + elapsed, q_there, rate), float)[i]

            zero = Jet.variable(jnp.zeros(()), levels - 1)
            return jnp.stack([compose(partial(component, i), zero).derivatives() for i in range(3)], axis=-1)

        return np.asarray(jax.vmap(derivatives)(jnp.asarray(self.time), jnp.asarray(self.q)))

    def _cut_base(self) -> BaseMotion | None:
        if self.base is None:
            return None
        return BaseMotion(self.base.position, self.base.quaternion, self.base.twist[:, : max(self.order, 1)])

    @cached_property
    def applied(self) -> Float[np.ndarray, "time n"]:
        """Forces of the joint laws, (time, n), N m or N; zero for driven joints."""
        return np.where(self.status == Status.OK, self._in_states(forces_at), np.nan).T

    @property
    def energy(self) -> Float[np.ndarray, " time"]:
        """Kinetic energy and potential energy in gravity, J, shape (time,)."""
        return self._energies.sum(axis=0)

    @property
    def kinetic_energy(self) -> Float[np.ndarray, " time"]:
        """Kinetic energy, with that of armatures if drives are included, J, shape (time,)."""
        return self._energies[0]

    @cached_property
    def _energies(self) -> Float[np.ndarray, "2 time"]:
        energies = np.stack(self._in_states(energy_at))
        return np.where(self.status == Status.OK, energies, np.nan)

    def _in_states(self, function: Mapped) -> Any:
        """Return the values of a function of the problem and of the state at all instants."""
        return function.along(self._problem, (self._state, self.time))

    def at(self, time: ArrayLike, order: int | None = None) -> "RobotSimulation":
        """Return the same simulation at other instants, without integrating again.

        Parameters
        ----------
        time : array_like of shape (time,)
            Instants, s; values outside of the simulated time are NaN.
        order : int, optional
            Highest derivative; by default that of this simulation.
        """
        instants = chosen_instants(time, RobotError)
        order = self.order if order is None else order
        outcome = self._ending, self.events, self._wrenches, self._steps_backends
        return RobotSimulation(self.robot, self._problem, self.steps, instants, order, *outcome)

    @property
    def dataset(self) -> "xarray.Dataset":
        """Coordinates as an `xarray.Dataset`, a variable for each joint with dimensions time and derivative."""
        import xarray

        axes = time_axes(self.time, self.order + 1)
        variables = {}
        for k, name in enumerate(self.robot.joint_names):
            unit = "rad" if self.robot.joints[name].turning else "m"
            attributes = {"units": unit, "long_name": derivatives_of(name)}
            variables[name] = (tuple(axes), self.q[:, :, k], attributes)
        metadata = {"title": self.robot.name, "source": "jounce", "backend": self.backend}
        return xarray.Dataset(variables, axes, attrs=metadata)


@mapped(widths=WIDTHS)
def expanded_robot(
    problem: RobotProblem, lanes: tuple[RobotState, Lanes, Lanes], order: int
) -> tuple[RobotState, Float[Numbers, "level n batch"], Any]:
    """Return states at instants, and their Taylor coefficients from the equations of motion.

    Parameters
    ----------
    problem : RobotProblem
        Equations and laws of the robot.
    lanes : tuple
        For each instant: the polynomial of its step, the time since the beginning of the step, s, and the instant, s.
    order : int
        Coefficients of the coordinates have orders to `order` + 2, those of the twist of a free base to `order` + 1.
    """
    polynomial, elapsed, time = lanes
    state = at(polynomial, elapsed)
    series = problem.series(state, time[None], order)
    q = coordinates_of(series, order)
    if series.twist is None:
        return state, q, None
    rate = series.accelerations.base
    assert rate is not None
    return state, q, jnp.concatenate([series.twist[: order + 1], rate[order:] / (order + 1)])


@mapped(widths=WIDTHS)
def energy_at(problem: RobotProblem, lanes: tuple[RobotState, Lanes]) -> tuple[Lanes, Lanes]:
    """Return kinetic and potential energy in states at instants, J."""
    state, _ = lanes
    return problem.equations.energy(problem.motion(state))


@mapped(widths=WIDTHS)
def forces_at(problem: RobotProblem, lanes: tuple[RobotState, Lanes]) -> Float[Numbers, "n batch"]:
    """Return the forces of the joint laws in states at instants, N m or N."""
    state, time = lanes
    return problem.forces(time[None], state.coordinates, state.rates)
