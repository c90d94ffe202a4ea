"""The equations of motion as an ordinary differential equation, for the solvers of diffrax."""

import dataclasses
import importlib
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.shapes import ArrayLike, Numbers, seconds
from jounce.dynamics.forward.accelerations import Equations, State
from jounce.dynamics.forward.initial_state import ConsistentStart, consistent_start
from jounce.errors import MechanismError
from jounce.integrate.marching.marching import DenseOutput
from jounce.integrate.results.simulation import Simulation
from jounce.integrate.steps.projection import normalized
from jounce.integrate.steps.revolution_counts import measured
from jounce.jet import Jet
from jounce.mechanism import Mechanism
from jounce.mechanism.transmissions.axis_angles import measures_angle


def ode_term(mechanism: Mechanism, time: float = 0.0) -> "OrdinaryEquation":
    """Return the equations of motion of a mechanism as ``y' = f(t, y, args)``, for the solvers of diffrax.

    Accelerations come from the same matrix as in `simulate`, but without projection: bodies drift off the constraints
    within the tolerance of the solver. The extra ``jounce[integrators]`` installs diffrax.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism with masses; its `initial` conditions determine the initial state.
    time : float, default 0
        The start, s.

    Returns
    -------
    OrdinaryEquation
        The term, the initial state, and a method that converts the result of a solver.

    Raises
    ------
    MechanismError
        If diffrax is not installed, or the mechanism is not valid.
    AssemblyError, MobilityError
        As for `simulate`.

    Examples
    --------
    >>> import diffrax, jax
    >>> import jounce as jn
    >>> pendulum = jn.Mechanism(
    ...     space="planar",
    ...     gravity=[0, -9.81],
    ...     bodies={"rod": jn.Body([0, 0], mass=2.0, inertia=0.5, center_of_mass=[1, 0])},
    ...     joints={"O": jn.planar.Revolute(("ground", "rod"), [0, 0], [0, 0])},
    ...     outputs={"angle": jn.outputs.AngleOutput("rod")},
    ... )
    >>> equation = jn.integrate.ode_term(pendulum)
    >>> with jax.enable_x64(True):  # diffrax computes in the precision that JAX is set to
    ...     solution = diffrax.diffeqsolve(
    ...         equation.term, diffrax.Dopri8(), 0.0, 1.0, None, equation.state, args=equation.equations,
    ...         stepsize_controller=diffrax.PIDController(rtol=1e-10, atol=1e-10),
    ...     )
    >>> motion = equation.motion(solution.ts, solution.ys, order=3)
    >>> fall = jn.simulate(pendulum, [0.0, 1.0], order=3)
    >>> bool(abs(motion.outputs["angle"] - fall.outputs["angle"][1:]).max() < 1e-7)
    True
    """
    try:
        diffrax: Any = importlib.import_module("diffrax")
    except ImportError:
        message = 'ode_term needs the package diffrax, which is not installed: pip install "jounce[integrators]"'
        raise MechanismError(message) from None
    start = consistent_start(mechanism, float(time))
    state: State | CountedState = State(*(jnp.asarray(part[..., 0]) for part in start.state))
    equations = jax.device_put(start.equations)  # diffrax takes arrays of JAX
    if angles := measured(equations, start.state):
        start_angles = tuple(part[..., 0] for part in angles)
        state = CountedState(state.position, state.attitude, state.velocity, state.spin, start_angles)
    return OrdinaryEquation(diffrax.ODETerm(state_rates), state, equations, mechanism, start)


class CountedState(NamedTuple):
    """A state with the angles about axes that forces measure, since positions give them only up to whole revolutions.

    Attributes
    ----------
    position, attitude, velocity, spin : array of shape (components, bodies)
        As in `State`.
    angles : tuple of array of shape (instances,)
        rad; integrated from their rates, they need only be right to within half a turn.
    """

    position: Numbers
    attitude: Numbers
    velocity: Numbers
    spin: Numbers
    angles: tuple[Float[Numbers, " instance"], ...]


@dataclasses.dataclass(frozen=True, eq=False)
class OrdinaryEquation:
    """The equations of motion as an ordinary differential equation.

    Parameters
    ----------
    term : diffrax.ODETerm
        Term whose `args` are the equations of motion.
    state : State or CountedState
        Initial state: arrays of shape (components, bodies), with angles if forces in space measure them.
    equations : Equations
        To pass as ``args``: a pytree of masses, lengths and other values, which can be changed or differentiated by.
    mechanism : Mechanism
        The mechanism.
    start : ConsistentStart
        The mechanism with its consistent initial state.
    """

    term: Any
    state: State | CountedState
    equations: Equations
    mechanism: Mechanism
    start: ConsistentStart

    def motion(self, time: ArrayLike, states: State | CountedState, order: int = 4) -> Simulation:
        """Return the states of a solver as a motion, with derivatives of any order.

        The states are projected onto the constraints; their derivatives follow from the equations of motion.

        Parameters
        ----------
        time : array of shape (time,)
            ``solution.ts``, s.
        states : State or CountedState
            ``solution.ys``: arrays of shape (time, components, bodies).
        order : int, default 4
            Highest derivative of the outputs.
        """
        instants = seconds("time", time, MechanismError)
        polynomial = State(*states[:4]).map(lambda part: np.asarray(part)[:, None])
        angles = tuple(np.asarray(part) for part in states.angles) if isinstance(states, CountedState) else ()
        dense = DenseOutput(instants, np.zeros_like(instants), polynomial, np.full(len(instants), -1), angles)
        return Simulation(self.mechanism, self.start, dense, instants, order)


def state_rates(time: Any, state: State | CountedState, equations: Equations) -> State | CountedState:
    """Return the rate of a state, arrays of shape (components, bodies): ``f(t, y, args)``.

    Parameters
    ----------
    time : float
        s.
    state : State or CountedState
        Positions and velocities.
    equations : Equations
        Equations of motion of the mechanism.
    """
    if isinstance(state, CountedState):
        equations = equations.near(tuple(part[..., None] for part in state.angles))
    rate, full_state = _rates(time, State(*state[:4]), equations)
    if not isinstance(state, CountedState):
        return rate
    pose, clock = equations.pose(full_state), Jet.variable(jnp.reshape(jnp.asarray(time, float), (1, 1)), 1)
    measuring = [group for group in equations.system.forces if measures_angle(group)]
    angle_rates = (group.velocity(pose, clock).coefficients[0][0, :, 0] for group in measuring)
    return CountedState(*rate, tuple(angle_rates))


def _rates(time: Any, state: State, equations: Equations) -> tuple[State, State]:
    """Return the rate of a state, and the state with normalized Euler parameters as a batch of one."""
    state = state.map(lambda part: part[..., None])
    state = state._replace(attitude=normalized(state.attitude))
    clock = jnp.reshape(jnp.asarray(time, float), (1, 1))
    trial = jnp.zeros((equations.coordinates, *state.position.shape[1:])), jnp.zeros((equations.system.shape[0], 1))
    forces, second, attitude_rate = equations.balance(state, *trial, clock)
    factor, shifts = equations.factored(state, clock), equations.pose_type.shifts
    acceleration, _, _ = equations.solved_at_start(factor.solve, state, clock, forces, second)
    rate = State(state.velocity, attitude_rate, acceleration[:shifts], acceleration[shifts:])
    return jax.tree.map(lambda part: part[..., 0], rate), state
