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

OWN = ("torque", "state", "driven", "drives", "base", "initial")  # options that this simulation sets itself


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
        The system. Elastic drivers of a mechanism must be of distances, slides or coordinates; rigid drivers keep
        prescribing their coordinates.
    drives : dict of str to Drive
        Drives by name of the joint or driver. Elastic drives need rotors with inertia.
    time : array_like of shape (time,)
        Instants, s; the first is the start. By default those of the mechanism.
    torque : mapping of str to law, or callable
        Motor torques, as seen at the joints, N m or N: for each name a law of time, such as those of
        `Feedforward.torque_laws`, an expression of ``t``, a function of time by operations of JAX, or a number; zero by
        default. For a robot also a function of time, q, q', theta and theta' of one sample, by operations of JAX, that
        returns n torques.
    state : array_like of shape (2, 2, n), optional
        Start state: q and q', then theta and theta', like `Feedforward.start`. By default, springs are relaxed, a robot
        is at rest at zero, and a mechanism moves by its laws. For a robot also (2, n), with relaxed springs.
    order : int, default 2
        Highest derivative of the results.
    losses : bool, default True
        Whether to include damping and friction of the robot file, as in `feedforward`.
    friction : bool, default True
        Whether to include Coulomb friction; a motor that reverses under a torque of time alone then sticks as the
        torque passes zero.
    **options
        Options of `simulate`: method, tolerance, events, longest_step, strict, progress.

    Returns
    -------
    RobotSimulation or Simulation
        Motion of the robot with one more joint, ``NAME_motor``, for each elastic joint, or of the mechanism with one
        more body, ``NAME_motor``, for each elastic driver.

    Raises
    ------
    RobotError, MechanismError, UnsupportedError
        If an argument does not fit.
    SolveError
        If the motion cannot be continued to an instant, as for `simulate`.
    """
    for name in OWN:
        if name in options:
            raise JounceError("is set by this simulation itself", name=name)
    if isinstance(system, Robot):
        arguments = system, drives, time, torque, state, order, options
        return simulate_elastic_robot(*arguments, losses=losses, friction=friction)
    if isinstance(system, Mechanism):
        return simulate_elastic_mechanism(system, drives, time, torque, state, order, options)
    raise JounceError("must be a Robot or a Mechanism", name="system", value=type(system).__name__)
