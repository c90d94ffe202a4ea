"""Forward dynamics of constrained mechanisms: accelerations and multipliers with all their rates, from one matrix.

The equations of motion ``M q'' + Phi_q^T lambda = Q`` and ``Phi'' = 0`` are written once, on plain values. On series
their coefficient k is affine in the unknowns ``(q''[k], lambda[k])``, with the same matrix
``[[M, Phi_q^T], [Phi_q, 0]]`` at every order: the "hyper-dynamic" equations that Sommer 2024, section 7, announces.
"""

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Bool, Float, Int

from jounce.base.modules import Module, field
from jounce.base.shapes import Numbers
from jounce.dynamics.forward.ground import turns_with_ground, with_ground
from jounce.dynamics.forward.loads import inertia_forces, mass_matrices
from jounce.dynamics.forward.saddle_fronts import SaddleFactor, SaddleFronts, SaddleInverse
from jounce.dynamics.forward.saddle_point import (
    BodyMatrices,
    ByBody,
    Column,
    DenseInverse,
    Jacobian,
    MassMatrix,
    ReducedFactor,
    as_column,
    block_diagonal,
    by_body,
    in_basis,
    saddle_point,
)
from jounce.dynamics.friction.coupling import has_friction
from jounce.dynamics.friction.free_motion import FreeFriction, with_friction
from jounce.dynamics.masses import Gravity, Masses
from jounce.jet import Jet
from jounce.jet.coefficients import padded_series
from jounce.jet.programs.series import Recursion
from jounce.linear_algebra.least_squares import range_basis
from jounce.linear_algebra.linear import DenseFactor
from jounce.mechanism.system import System
from jounce.mechanism.transmissions.axis_angles import with_turns
from jounce.rigid import PlanarPose
from jounce.rigid.pose import Pose
from jounce.rigid.spatial import quaternion_change

Instants = Float[Numbers, "1 batch"]
Lanes = Float[Numbers, " batch"]
"""One number for each run of a batch, as in `Flags` and `Indices`."""
Flags = Bool[Numbers, " batch"]
Indices = Int[Numbers, " batch"]
Factor = DenseFactor | SaddleFactor | ReducedFactor
Inverse = DenseInverse | SaddleInverse
"""Inverse matrix of the equations of motion, for many right-hand sides that arrive one after the other."""
Matrices = Float[Numbers, "size size batch"]
"""Matrices of the equations of motion."""
Rows = Float[Numbers, "row batch"]
Shifts = Float[Numbers, "shift body batch"]
"""One vector for each body, such as a position or a velocity."""
Turns = Float[Numbers, "turn body batch"]
"""One rotation, or rate of it, for each body: one component in the plane, three in space."""
Attitudes = Float[Numbers, "attitude body batch"]
"""Angles, with one component, or Euler parameters, with four."""


class State(NamedTuple):
    """Positions and velocities of the moving bodies; shapes (components, bodies, batch).

    Attributes
    ----------
    position, velocity : array
        Positions and velocities of the origins of the body frames, in the global frame, m and m/s.
    attitude : array
        Angles, (1, bodies, batch) in rad, or Euler parameters, (4, bodies, batch).
    spin : array
        Rate of the angle, or angular velocity in body axes, rad/s.
    """

    position: Numbers
    attitude: Numbers
    velocity: Numbers
    spin: Numbers

    def map(self, function: Callable[[Any], Any]) -> "State":
        """Apply a function to each array."""
        return State(*map(function, self))


class Expansion(NamedTuple):
    """Taylor coefficients of a motion about an instant, as a step of an integrator uses and stores them."""

    state: State  # arrays of shape (order + 1, components, bodies, batch)
    acceleration: Float[Numbers, "order coordinate body batch"]
    multipliers: Float[Numbers, "order row batch"]  # of the scaled rows, over the scale of the masses


class Equations(Module):
    """The equations of motion of a mechanism.

    Parameters
    ----------
    system : System
        Joints, drivers and forces.
    masses : Masses
        Masses of all bodies, the ground first.
    gravity : array of shape (components, 1, 1)
        m/s^2.
    scale : float
        Scale of the masses, by which the equations are divided, kg.
    pose_type : type
        PlanarPose or SpatialPose.
    saddle : SaddleFronts, optional
        Plan of elimination for the matrix of a large mechanism.
    """

    system: System
    masses: Masses
    gravity: Gravity
    scale: float | Float[Numbers, ""]
    pose_type: type = field(static=True)
    saddle: SaddleFronts | None = None

    @property
    def coordinates(self) -> int:
        """Number of coordinates of a body."""
        return self.pose_type.shifts + self.pose_type.turns

    def near(self, angles: tuple[Float[Numbers, "_ batch"], ...]) -> "Equations":
        """Return the equations whose forces count revolutions from the given angles about their axes.

        `angles` has one array of shape (instances, batch), rad, for each group of forces that measure such angles.
        """
        if not angles:
            return self
        system = dataclasses.replace(self.system, forces=with_turns(self.system.forces, angles))
        return dataclasses.replace(self, system=system)

    def pose(self, state: State) -> Pose:
        """Return the pose of all bodies with velocities, the ground first."""
        return self.extended(self.pose_at_rest(state.position, state.attitude), state.velocity, state.spin)

    def extended(self, pose: Pose, shift: Shifts, turn: Turns) -> Pose:
        """Return a pose with one more Taylor coefficient for the moving bodies."""
        return pose.extended(with_ground(shift), with_ground(turn))

    def pose_at_rest(self, position: Shifts, attitude: Attitudes) -> Pose:
        """Return the pose of order zero of all bodies, the ground first."""
        planar = self.pose_type is PlanarPose
        return self.pose_type.at_unit(
            with_ground(position), with_ground(attitude)[0] if planar else turns_with_ground(attitude)
        )

    def attitude_of(self, pose: Pose) -> Attitudes:
        """Return the attitude of the moving bodies, as `State` stores it, from a pose of order zero."""
        if isinstance(pose, PlanarPose):
            return pose.angle.coefficients[0][None, 1:]
        return pose.quaternion.coefficients[0][:, 1:]

    def balance(
        self, state: State, acceleration: ByBody, multipliers: Rows, time: Instants
    ) -> tuple[ByBody, Rows, Attitudes]:
        """Return the residuals of the equations of motion, and the rate of the attitude.

        Returns
        -------
        forces : array of shape (coordinates, bodies, batch)
            ``M q'' - Q + Phi_q^T lambda``, over the scale of the masses.
        second : array of shape (rows, batch)
            ``Phi''`` of the scaled rows.
        attitude_rate : array
            Rate of the attitude, in its shape.
        """
        shifts = self.pose_type.shifts
        # built once, so that common subexpressions are the same objects and are evaluated once
        rest_pose = self.pose_at_rest(state.position, state.attitude)
        moving_pose = self.extended(rest_pose, state.velocity, state.spin)
        pose = self.extended(moving_pose, acceleration[:shifts] / 2.0, acceleration[shifts:] / 2.0)
        clock = Jet.variable(time, 2)
        second = 2.0 * self.system.residual(pose, clock).dense().coefficients[2]
        force, moment = inertia_forces(pose, self.masses, self.gravity)
        inertia = jnp.concatenate([force.coefficients[0], moment.coefficients[0]])[:, 1:]
        instant = clock.truncate(0)
        friction = FreeFriction(self.system, moving_pose, instant)

        def loosened(change: Any) -> Any:
            return [self.system.variation(rest_pose, change, instant).coefficients[0], *friction.slips(change)]

        weights = [multipliers]
        if friction.groups:
            weights += friction.resisting(friction.normal_forces(multipliers))
        forces = inertia / self.scale + conjugate(loosened, rest_pose, weights)[:, 1:]
        applied = self.system.applied_forces(moving_pose, clock.truncate(1)).coefficients[0]
        forces = forces - applied[:, 1:] / self.scale
        return forces, second, self.attitude_rate(state)

    def attitude_rate(self, state: State) -> Attitudes:
        """Return the rate of the attitude of a state."""
        return state.spin if self.pose_type is PlanarPose else quaternion_change(state.attitude, state.spin)

    def matrix(self, state: State, time: Instants) -> Matrices:
        """Return the scaled matrix of accelerations and multipliers; combinations of rows if some are redundant."""
        return _matrix(self, state, time)

    def factored(self, state: State, time: Instants) -> Factor:
        """Return the factors of `matrix`, which solve for the multipliers of all rows."""
        if self.system.rank is not None:
            jacobian = self.jacobian(state, time)
            return ReducedFactor.of(self.mass_matrix(state), jacobian, range_basis(jacobian, self.system.rank))
        if self.saddle is None:
            return DenseFactor.of(self.matrix(state, time))
        entries = self.system.entries(self.pose_at_rest(state.position, state.attitude), Jet([time]))
        return self.saddle.factored(self._masses(state), entries, self.system.column_scale, self.system.row_scale)

    def blank_factor(self, lanes: int) -> Factor:
        """Return a placeholder for the factors of a batch, as the initial value of a loop."""
        if self.system.rank is not None:
            return ReducedFactor.blank(self.system.shape, self.system.rank, lanes)
        size = sum(self.system.shape)
        return DenseFactor.blank((size, size), lanes) if self.saddle is None else self.saddle.blank(lanes)

    def jacobian(self, state: State, time: Instants) -> Jacobian:
        """Return the scaled Jacobian of the constraints, shape (rows, columns, batch)."""
        return self.system.jacobian(self.pose_at_rest(state.position, state.attitude), Jet([time]))

    def mass_matrix(self, state: State) -> MassMatrix:
        """Return the mass matrix over the scale of the masses, scaled."""
        return block_diagonal(self._masses(state), self.system.column_scale)

    def _masses(self, state: State) -> BodyMatrices:
        """Return the mass matrices of the moving bodies over the scale of the masses."""
        return mass_matrices(self.pose_at_rest(state.position, state.attitude), self.masses)[:, :, 1:] / self.scale

    def unknowns(self, solve: Callable[[Rows], Rows], forces: ByBody, second: Rows) -> tuple[ByBody, Rows]:
        """Return the changes of accelerations and multipliers that make the residuals of `balance` vanish.

        Parameters
        ----------
        solve : callable
            Solver of the scaled equations for right-hand sides.
        forces, second : array
            Residuals, as `balance` returns them.
        """
        scale, columns = self.system.column_scale, self.system.shape[1]
        solution = -solve(jnp.concatenate([as_column(forces, scale), second]))
        return by_body(solution[:columns], scale), solution[columns:]

    def solved_at_start(
        self, solve: Callable[[Rows], Rows], state: State, time: Instants, forces: ByBody, second: Rows
    ) -> tuple[ByBody, Rows, Callable[[ByBody, Rows], tuple[ByBody, Rows]]]:
        """Return accelerations and multipliers of a state, and the solver for their coefficients of higher orders.

        Parameters
        ----------
        solve, forces, second
            As for `unknowns`; the residuals are those at zero accelerations and multipliers.
        state : State
            State of the bodies.
        time : array of shape (1, batch)
            The instant, s.
        """
        solution = partial(self.unknowns, solve)
        frictionless = solution(forces, second)
        if not any(map(has_friction, self.system.groups)):
            return *frictionless, solution
        friction = FreeFriction(self.system, self.pose(state), Jet([time]))

        def felt(normal: Any) -> Any:
            return conjugate(friction.slips, self.pose(state).truncate(0), friction.resisting(normal))[:, 1:]

        return with_friction(solution, frictionless, friction, felt)

    def least_change(self, factor: Factor, gap: Rows) -> Column:
        """Return the scaled change of coordinates, of least kinetic energy, that closes a gap of the scaled rows."""
        columns = self.system.shape[1]
        return factor.solve(-jnp.concatenate([jnp.zeros((columns, gap.shape[-1])), gap]))[:columns]

    def with_rates(self, factor: Factor, state: State, time: Instants) -> State:
        """Return the state with the least change of its velocities that satisfies the rates of all constraints."""
        rate = self.system.residual(self.pose(state), Jet.variable(time, 1)).dense().coefficients[1]
        change = by_body(self.least_change(factor, rate), self.system.column_scale)
        shifts = self.pose_type.shifts
        return state._replace(velocity=state.velocity + change[:shifts], spin=state.spin + change[shifts:])


# Functions that several programs share (the start, the steps, dense output) are jitted, so that JAX traces them once.


@jax.jit
def _matrix(equations: Equations, state: State, time: Instants) -> Matrices:
    jacobian, rank = equations.jacobian(state, time), equations.system.rank
    jacobian = jacobian if rank is None else in_basis(range_basis(jacobian, rank), jacobian)
    return saddle_point(equations.mass_matrix(state), jacobian)


@jax.jit
def _balance(
    equations: Equations, state: State, acceleration: ByBody, multipliers: Rows, time: Instants
) -> tuple[ByBody, Rows, Attitudes]:
    return equations.balance(state, acceleration, multipliers, time)


def conjugate(variation: Callable[[Pose], Any], pose: Pose, weights: Any) -> ByBody:
    """Return the generalized forces on the bodies by the transposed variation, such as ``Phi_q^T lambda``.

    Parameters
    ----------
    variation : callable
        Linear function from a change of the pose to the variation of the quantities conjugate to the weights.
    pose : SpatialPose or PlanarPose
        Pose of order zero.
    weights : array, or list of arrays
        Weights, such as multipliers, in the shapes of the variation.
    """
    shifts = pose.shifts
    example = jax.ShapeDtypeStruct((shifts + pose.turns, *pose.position.shape[1:]), jnp.float64)
    transposed = jax.linear_transpose(lambda v: variation(pose.varied(Jet([v[:shifts]]), Jet([v[shifts:]]))), example)
    return transposed(weights)[0]


def inverted(factor: Factor) -> Inverse:
    """Return the inverse of factors, for many right-hand sides that arrive one after the other."""
    return factor.inverted() if isinstance(factor, SaddleFactor) else DenseInverse(factor.inverse())


def expand(
    equations: Equations,
    state: State,
    time: Instants,
    order: int,
    inverse: Inverse | None = None,
    *,
    reversible: bool = False,
) -> Expansion:
    """Return the Taylor coefficients of the motion through a state, to an order.

    Parameters
    ----------
    equations : Equations
        Equations of motion of the mechanism.
    state : State
        State that satisfies the constraints and their rates.
    time : array of shape (1, batch)
        The instant, s.
    order : int
        Highest coefficient of positions and velocities, at least 1.
    inverse : DenseInverse or SaddleInverse, optional
        Inverse matrix of the equations at this state, if it is known.
    reversible : bool, default False
        Whether JAX can differentiate the result in reverse mode.
    """
    count, bodies, lanes = equations.coordinates, *state.position.shape[1:]
    known_inverse = inverted(equations.factored(state, time)) if inverse is None else inverse

    def program(*leaves: Any) -> Any:
        return _balance(equations, State(*leaves[:4]), *leaves[4:])

    trial = jnp.zeros((count, bodies, lanes)), jnp.zeros((len(equations.system.row_scale), lanes))
    forces, second, _ = program(*state, *trial, time)
    acceleration, multipliers, solution = equations.solved_at_start(known_inverse.solve, state, time, forces, second)
    recursion = Recursion(program, (*state, acceleration, multipliers, time), order - 1, reversible=reversible)
    shifts = equations.pose_type.shifts

    def raised(lower: State, acceleration: Any, attitude_rate: Any, k: Any) -> State:
        """Return the state of order k from the coefficients of order k - 1 of its rates."""
        rates = State(lower.velocity, attitude_rate, acceleration[:shifts], acceleration[shifts:])
        return rates.map(lambda c: c / k)

    def level(k: Any, carry: Any) -> Any:
        history, coefficients, series, rates = carry
        ticking = jnp.where(k == 1, jnp.ones_like(time), jnp.zeros_like(time))
        (forces, second, attitude_rate), newest = recursion.advanced(history, k, (*coefficients, None, None, ticking))
        acceleration, multipliers = solution(forces, second)
        newest = recursion.corrected(newest, (None,) * 4 + (acceleration, multipliers, None))
        history = recursion.noted(history, k, newest)
        coefficients = raised(coefficients, acceleration, attitude_rate, k + 1)
        update = jax.lax.dynamic_update_index_in_dim
        series = State(*(update(s, c, k + 1, 0) for s, c in zip(series, coefficients, strict=True)))
        return history, coefficients, series, update(rates, multipliers, k, 0)

    coefficients = raised(state, acceleration, recursion.outputs[2], 1)
    series = State(*(padded_series([c, d], order + 1) for c, d in zip(state, coefficients, strict=True)))
    rates = padded_series([multipliers], order)
    _, _, series, rates = jax.lax.fori_loop(1, order, level, (recursion.history, coefficients, series, rates))
    numbers = jnp.arange(1.0, order + 1)[:, None, None, None]
    accelerations = numbers * jnp.concatenate([series.velocity[1:], series.spin[1:]], axis=1)
    return Expansion(series, accelerations, rates)
