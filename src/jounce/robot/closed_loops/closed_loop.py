"""A robot as a mechanism: bodies with masses, joints, closed loops, and drivers that prescribe coordinates."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from jounce.base.shapes import ArrayLike
from jounce.errors import AssemblyWarning, JounceError, RobotError, check_name, flag, warn_caller
from jounce.forces import AbstractForce
from jounce.jet import Jet
from jounce.mechanism import Body, Mechanism, time_grid
from jounce.mechanism.mechanism import names_column
from jounce.mechanism.redundant_reactions import RedundantReactions
from jounce.mechanism.resolve import resolve_motion
from jounce.mechanism.time import TimeLike
from jounce.rigid.inertia import vector_numbers
from jounce.robot.closed_loops.closures import GivenCoordinates, Loops, given_coordinates
from jounce.robot.closed_loops.loop_following import drawn_position, position_at
from jounce.robot.closed_loops.mechanism_parts import RobotParts, on_body
from jounce.robot.model.abstract_robot import AbstractRobot
from jounce.trajectory.joint_trajectory import JointTrajectory

DRIVE, START = "_drive", "_start"


def mechanism(
    robot: AbstractRobot,
    q: GivenCoordinates = None,
    *,
    drivers: Mapping[str, Any] | JointTrajectory | None = None,
    initial: Mapping[str, Any] | None = None,
    forces: Mapping[str, AbstractForce] | None = None,
    outputs: Mapping[str, Any] | None = None,
    parameters: Mapping[str, Any] | None = None,
    time: TimeLike | None = None,
    drives: bool = True,
    redundant_reactions: RedundantReactions | None = None,
) -> Mechanism:
    """Return a robot as a spatial mechanism, with masses and gravity, its loops closed.

    Each moving link becomes a body of the same name and frame, which includes the links fixed to it; the base is the
    ground. Joints and closures keep their names. The six joints of a floating base become a free body, and the three
    turns of a ball one spherical joint, unless one of their coordinates is driven. A closure constrains only the
    directions that the joints leave free (`closure_wrenches`), so that the joints alone bear the reactions in the
    others. With `redundant_reactions` it constrains all its directions, and that choice determines its reactions.

    Parameters
    ----------
    robot : Robot
        The robot, with closures or without.
    q : array_like of shape (n,) or dict of str to float, optional
        Coordinates near which the mechanism is assembled; by default the start positions of the joints: zero, or the
        pose of an MJCF file. Driven joints start at the start values of their laws, and the others move until the loops
        are closed. By default, a robot whose start positions close the loops stays in that assembly while the driven
        joints move to their start values.
    drivers : dict of str to law, or JointTrajectory, optional
        Laws of coordinates, by name of the joint: expressions of t, functions of time, motions or numbers; rad or m.
        The driver of joint A is named ``A_drive``, and its force is the torque or force of the joint.
    initial : dict of str to law, optional
        Coordinates prescribed at the start of a simulation only, named ``A_start``.
    forces : dict of str to AbstractForce, optional
        Applied forces; their bodies are moving links, or ``"ground"``.
    outputs : dict of str to AbstractOutput or str, optional
        Requested outputs; a string is the name of a joint, for its coordinate. By default the coordinates of all
        `joint_names`, under their names, with a ``_`` appended to those that name a column of results, such as
        ``time``. Angles start between minus half a turn and half a turn.
    parameters : dict of str to number or expression, optional
        Named values for laws and forces.
    time : array_like or TimeGrid, optional
        Instants to solve for, s; by default those of a trajectory.
    drives : bool, default True
        Include the drives: armature inertias, each as that of a rotor on the ground, the body ``A_rotor``, which the
        constraint ``A_gear`` turns with the joint; viscous damping, Coulomb friction and springs, as forces named
        ``A_damping``, ``A_friction`` and ``A_spring``; and the losses of drives of balls, ``A_ball``. Friction has the
        sign of the velocity and is zero at rest. The lift of links that feel less than all of gravity, ``LINK_lift``,
        is included in any case.
    redundant_reactions : {"unique", "least_norm"} or dict of str to dict, optional
        As of `Mechanism`: reactions without a unique value are NaN, those of least norm, or as stiffnesses of joints
        share them. The redundant equations of closures must then agree to 1e-9, as those of any mechanism.

    Returns
    -------
    Mechanism
        The mechanism, square if as many joints are driven as the robot has degrees of freedom.

    Raises
    ------
    RobotError
        If a name or a value does not fit the robot, or the loops cannot be closed near q.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])
    >>> links, pin = [jn.Link("base"), jn.Link("rod", rod)], jn.Joint("pin", "base", "rod", axis=[0, -1, 0])
    >>> pendulum = jn.Robot("pendulum", links, [pin]).mechanism(drivers={"pin": "0.5*t**2"})
    >>> motion = jn.solve(pendulum, [0.0, 1.0], order=2)
    >>> motion.outputs["pin"].round(12).tolist()
    [[0.0, 0.0, 1.0], [0.5, 1.0, 1.0]]
    """
    drives = flag("drives", drives, error=RobotError)
    if time is None:
        time = getattr(drivers, "times", None)
    laws = {"drivers": getattr(drivers, "laws", drivers) or {}, "initial": initial or {}}
    driven = {name: law for kind in laws.values() for name, law in kind.items()}
    for kind, named_laws in laws.items():
        for name in named_laws:
            check_name("moving joint that follows no other", name, robot.joint_names, RobotError, name=kind)
    needed = {*driven, *(x for x in (outputs or {}).values() if isinstance(x, str))}
    parts = RobotParts(robot, needed, forces, outputs, drives)
    selected = _coordinate_outputs(parts.coordinates) if outputs is None else outputs
    start = _start(robot, q, driven, parameters or {}, time)
    joints = parts.joints()
    if robot.closures:
        loops = Loops(robot)
        free = np.array([name not in driven for name in robot.joint_names], bool)
        start = _closed_start(robot, loops, start, free, drawn=q is None)
        borne = loops.wrenches if redundant_reactions else [needed for needed, _ in loops.independent(start)]
        pairs = zip(robot.closures.values(), borne, strict=True)
        joints |= {closure.name: parts.closure(closure, needed) for closure, needed in pairs if len(needed)}
    return Mechanism(
        space="spatial",
        bodies=parts.bodies(start),
        joints=joints,
        drivers={name + DRIVE: parts.driver(name, law) for name, law in laws["drivers"].items()},
        initial={name + START: parts.driver(name, law) for name, law in laws["initial"].items()},
        forces={**(forces or {}), **parts.losses()},
        outputs={name: parts.output(name, x) if isinstance(x, str) else x for name, x in selected.items()},
        parameters=parameters or {},
        gravity=robot.gravity.tolist(),
        time=time,
        redundant_reactions=redundant_reactions or "unique",
        title=robot.name,
    )


def _coordinate_outputs(joints: tuple[str, ...]) -> dict[str, str]:
    """Return joints by the names of their outputs: the joint's own name, unless a column of results has it."""
    outputs = {}
    for joint in joints:
        name = joint
        while names_column(name) or (name != joint and name in joints):
            name += "_"
        outputs[name] = joint
    return outputs


def _start(
    robot: AbstractRobot, q: Any, laws: Mapping[str, Any], parameters: Mapping[str, Any], time: Any
) -> np.ndarray:
    """Return the start coordinates: those given, with the values of the laws for driven joints."""
    start = given_coordinates(robot, q)
    if laws:
        values = Mechanism(
            space="spatial", bodies={"any": Body([0.0] * 3)}, joints={}, parameters=parameters
        ).parameter_values
        instant = Jet([np.full((1, 1), 0.0 if time is None else time_grid(time, values)[0])])
        for name, law in laws.items():
            try:
                value = float(np.squeeze(resolve_motion(law, values)(instant).coefficients[0]))
            except JounceError as error:
                raise error.located(name=f"drivers.{name}") from None
            if not np.isfinite(value):
                message = f"the law has no finite value at t = {float(instant.coefficients[0][0, 0]):g} s"
                raise RobotError(message, name=f"drivers.{name}", value=value)
            start[robot.joint_names.index(name)] = value
    return start


def _closed_start(
    robot: AbstractRobot, loops: Loops, start: np.ndarray, free: np.ndarray, *, drawn: bool
) -> np.ndarray:
    """Return start coordinates at which the loops are closed, in the assembly in which the robot is drawn, if in one.

    The driven joints move from the drawn pose to the start values of their laws. If they cannot, a warning says so.
    """
    position = drawn_position(loops, given_coordinates(robot, None), free) if drawn else None
    if position is None:
        return loops.closed(start, free)
    reached = position_at(loops, position, start, free)
    if reached is not None:
        return reached
    closed = loops.closed(start, free)
    driven = ", ".join(name for name, is_free in zip(robot.joint_names, free, strict=True) if not is_free)
    warn_caller(
        AssemblyWarning(
            f"{robot.name}: the loops, which the file draws closed, may start in another assembly: they could not be "
            f"kept closed while the driven joints ({driven}) moved from there to their start; give coordinates q of "
            "the other joints near those wanted, or start the drives nearer to the pose drawn"
        )
    )
    return closed


def body_point(robot: AbstractRobot, link: str, point: ArrayLike = (0.0, 0.0, 0.0)) -> tuple[str, np.ndarray]:
    """Return the body of the mechanism that includes a link, and a point of the link in the frame of that body.

    Parameters
    ----------
    robot : Robot
        The robot.
    link : str
        Name of the link; the base and links fixed to it are the ground.
    point : array_like of shape (3,), default the origin
        The point, in the frame of the link, m.

    Returns
    -------
    tuple of str and array of shape (3,)
        Name of the body, and the point in its frame, m.

    Raises
    ------
    RobotError
        If the link does not exist.

    Examples
    --------
    >>> import jounce as jn
    >>> arm = jn.load_robot("examples/robots/planar_arm.xml")
    >>> body, point = jn.robot.body_point(arm, "ram", [0.1, 0, 0])
    >>> body, point.tolist()
    ('ram', [0.1, 0.0, 0.0])
    """
    check_name("link", link, robot.links, RobotError, name="link")
    body, position, rotation = on_body(robot, link)
    return body, position + rotation @ vector_numbers("point", point, (3,))
