"""Simulation of robots and mechanisms with elastic drives, under torques of their motors."""

from collections.abc import Mapping
from typing import Unpack, overload

from jounce.base.shapes import ArrayLike
from jounce.errors import JounceError
from jounce.integrate import RobotSimulation, Simulation
from jounce.integrate.steps.options import SimulationOptions
from jounce.mechanism import Mechanism
from jounce.mechanism.time import TimeLike
from jounce.planning.elastic.drives import Drive
from jounce.planning.elastic.mechanism import simulate_elastic_mechanism
from jounce.planning.elastic.robot import simulate_elastic_robot
from jounce.robot import Robot

OWN = ("torque", "state", "driven", "drives", "base", "initial")  # what this simulation sets itself


@overload
def simulate_elastic(
    system: Robot,
    drives: Mapping[str, Drive],
    time: TimeLike,
    torque: object = None,
    state: ArrayLike | None = None,
    *,
    order: int = 2,
    losses: bool = True,
    friction: bool = True,
    **options: Unpack[SimulationOptions],
) -> RobotSimulation: ...
@overload
def simulate_elastic(
    system: Mechanism,
    drives: Mapping[str, Drive],
    time: TimeLike | None = None,
    torque: object = None,
    state: ArrayLike | None = None,
    *,
    order: int = 2,
    losses: bool = True,
    friction: bool = True,
    **options: Unpack[SimulationOptions],
) -> Simulation: ...
def simulate_elastic(
    system: Robot | Mechanism,
    drives: Mapping[str, Drive],
    time: TimeLike | None = None,
    torque: object = None,
    state: ArrayLike | None = None,
    *,
    order: int = 2,
    losses: bool = True,
    friction: bool = True,
    **options: Unpack[SimulationOptions],
) -> RobotSimulation | Simulation:
    """Return the motion of a robot or mechanism with elastic drives under torques of its motors.

    The model is that of `feedforward`: each rotor has only the spin about its own axis, and drives its link through a
    spring and a damper.

    Parameters
    ----------
    system : Robot or Mechanism
        A mechanism whose drivers prescribe distances, slides or coordinates; rigid ones go on prescribing.
    drives : dict of str to Drive
        By names of joints or drivers. Elastic ones need rotors with inertia.
    time : array_like of shape (time,)
        Instants, s; the first is the start. Those of the mechanism unless given.
    torque : mapping of str to law, or callable
        Of the motors, seen at the joints, N m or N: for each name a law of time, an expression of ``t``, a function of
        time by operations of JAX or a number, as `Feedforward.torque_laws` gives them; none unless given. Of a robot
        also a function of time, q, q', theta and theta' of one sample, by operations of JAX, that returns n torques.
    state : array_like of shape (2, 2, n), optional
        At the start: q and q', and theta and theta', as `Feedforward.start` has them. Unless given, springs are
        relaxed, a robot is at rest at zero and a mechanism moves as its laws say. Of a robot also (2, n), with relaxed
        springs.
    order : int, default 2
        Highest derivative of the results.
    losses : bool, default True
        Whether damping and friction of the robot file count, as in `feedforward`.
    friction : bool, default True
        Whether Coulomb friction counts; a motor that turns back sticks where torques that depend only on time take it
        through zero.
    **options
        As of `simulate`: method, tolerance, events, longest_step, strict, progress.

    Returns
    -------
    RobotSimulation or Simulation
        Of the robot with one more joint for each elastic one, ``NAME_motor``, or of the mechanism with one more body,
        ``NAME_motor``.

    Raises
    ------
    RobotError, MechanismError, UnsupportedError
        If an argument does not fit.
    SolveError
        If the motion cannot be followed to an instant, as for `simulate`.
    """
    for name in OWN:
        if name in options:
            raise JounceError("is set by this simulation itself", name=name)
    if isinstance(system, Robot):
        given = system, drives, time, torque, state, order, options
        return simulate_elastic_robot(*given, losses=losses, friction=friction)
    if isinstance(system, Mechanism):
        return simulate_elastic_mechanism(system, drives, time, torque, state, order, options)
    raise JounceError("must be a Robot or a Mechanism", name="system", value=type(system).__name__)
