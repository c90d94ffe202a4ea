"""The energy balance along the steps of a motion: without sources and losses the energy must not change.

Steps end on the constraints whatever those were in between. A joint that jumps, or has a kink at which velocities must
jump, therefore leaves no trace in positions and velocities, but changes the energy.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jounce.base.shapes import Numbers
from jounce.dynamics.energy.energies import body_energy
from jounce.dynamics.forward.accelerations import Equations, Flags, Instants, Lanes, State
from jounce.dynamics.friction.coupling import has_friction
from jounce.forces.base import AbstractForce
from jounce.integrate.steps.exact_programs import uses
from jounce.integrate.steps.lookahead import constraints_to_watch
from jounce.jet import Jet, dot
from jounce.mechanism.system import Group
from jounce.rigid.pose import Pose

# part of the largest kinetic energy and of the largest change of the potential: rounding of the sum
ENERGY_TOLERANCE = 1e-8
OFFSET = 1e-12  # part of all energies that counts as rounding, however little energy is exchanged
EXCHANGED = 1e-13  # relative difference of the power of a force and the rate of its stored energy that is rounding


class Energies(NamedTuple):
    """Energies in states, J, of shape (batch,).

    Attributes
    ----------
    kinetic, potential : array
        Kinetic energy, and potential energy in gravity and springs.
    size : array
        Sum of the absolute values of all energies.
    exchanging : array of bool
        Whether a force supplies or dissipates energy that it does not store.
    """

    kinetic: Lanes
    potential: Lanes
    size: Lanes
    exchanging: Flags


class Balance(NamedTuple):
    """The energy balance of runs up to their current states; arrays of shape (batch,).

    Attributes
    ----------
    start : Energies
        Energies at the start.
    exchanged : array
        Largest of the kinetic energy and the change of the potential energy so far, J.
    leeway : array
        Change of the energy that the allowed errors of the steps permit, J.
    open : array of bool
        Whether energy has been supplied or dissipated.
    broken : array of bool
        Whether a step nearby was refused because the energy would have changed.
    """

    start: Energies
    exchanged: Lanes
    leeway: Lanes
    open: Flags
    broken: Flags


def is_balanced(equations: Equations, state: State, time: Instants) -> bool:
    """Return whether the energy balance of a mechanism is checked.

    It is checked if no law of time moves the mechanism, all forces state their stored energy, and the series could
    overlook a joint or loops could change their assembly at a singular position. The check costs less than a tenth of a
    step.
    """
    at_rest, pose = equations.pose_at_rest(state.position, state.attitude), equations.pose(state)
    groups, forces = equations.system.groups, equations.system.forces
    has_loops = sum(group.instances for group in groups) > state.position.shape[-2]  # more joints than bodies
    if (
        any(map(has_friction, groups))
        or not (has_loops or constraints_to_watch(equations, state, time))
        or any(_is_moved(group, at_rest, time) for group in groups)
    ):
        return False

    def power(group: Group) -> Callable[[Instants], Numbers]:
        return lambda t: group.power(pose, Jet.variable(t, 1)).coefficients[0]

    states_energy = all(type(group.element).energy is not AbstractForce.energy for group in forces)
    return states_energy and not any(uses(jax.make_jaxpr(power(group))(time)) for group in forces)


def _is_moved(group: Group, at_rest: Pose, time: Instants) -> bool:
    """Return whether the residual of joints or drivers depends on time."""
    return uses(jax.make_jaxpr(lambda t: group.residual(at_rest, Jet([t])).coefficients[0])(time))


def energies(equations: Equations, pose: Pose, clock: Jet) -> Energies:
    """Return the energies in poses with velocities, and whether a force supplies or dissipates energy."""
    lanes = clock.shape[-1]
    masses, gravity = equations.masses, equations.gravity
    translation, rotation = body_energy(pose, *masses, 0)
    kinetic = jnp.sum(translation.coefficients[0] + rotation.coefficients[0], axis=0)
    lifted = -masses.mass * dot(pose.point(masses.center), gravity).coefficients[0]
    size, potential, exchanging = kinetic + jnp.sum(jnp.abs(lifted), axis=0), jnp.sum(lifted, axis=0), jnp.zeros(lanes)
    for group in equations.system.forces:
        stored, power = group.energy(pose, clock).dense(), group.power(pose, clock).coefficients[0]
        value, rate = (jnp.broadcast_to(c, (group.instances, lanes)) for c in stored.coefficients[:2])
        gap = jnp.abs(power + rate) - EXCHANGED * (jnp.abs(power) + jnp.abs(rate))
        potential, size = potential + jnp.sum(value, axis=0), size + jnp.sum(jnp.abs(value), axis=0)
        exchanging = jnp.maximum(exchanging, jnp.max(jnp.where(jnp.isfinite(gap), gap, 1.0), axis=0))
    return Energies(kinetic, potential, size, exchanging > 0)


def initial_balance(energies: Energies) -> Balance:
    """Return the energy balance at the start of runs."""
    zeros = jnp.zeros_like(energies.kinetic)
    return Balance(energies, energies.kinetic, zeros, energies.exchanging, zeros > 0)


def unknown(zeros: Lanes) -> Balance:
    """Return a placeholder of zeros for the energy balance before the start."""
    none = np.zeros(zeros.shape, bool)
    return Balance(Energies(zeros, zeros, zeros, none), zeros, zeros, none, none)


def followed(balance: Balance, energies: Energies, leeway: Lanes) -> tuple[Balance, Flags]:
    """Return the balance with one more state, and whether it holds.

    Parameters
    ----------
    balance : Balance
        Energy balance so far.
    energies : Energies
        Energies at the end of a step.
    leeway : array of shape (batch,)
        Change of a velocity by the allowed error of the step, times the square root of a mass.
    """
    change = energies.potential - balance.start.potential
    exchanged = jnp.maximum(balance.exchanged, jnp.maximum(energies.kinetic, jnp.abs(change)))
    allowed = balance.leeway + leeway * (jnp.sqrt(2.0 * exchanged) + leeway)
    opened = balance.open | energies.exchanging
    gap = jnp.abs(change + energies.kinetic - balance.start.kinetic)
    conserved = gap <= ENERGY_TOLERANCE * exchanged + OFFSET * jnp.maximum(energies.size, balance.start.size) + allowed
    return Balance(balance.start, exchanged, allowed, opened, balance.broken), conserved | opened
