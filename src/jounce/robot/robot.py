"""The robot as its user sees it: what it is made of, and the mechanism that it is."""

from typing import Any

from jounce.mechanism import Mechanism
from jounce.robot.closed_loops.closed_loop import mechanism
from jounce.robot.closed_loops.closures import GivenCoordinates
from jounce.robot.model.abstract_robot import AbstractRobot


class Robot(AbstractRobot):
    """A serial or tree-shaped robot of rigid links, on a fixed base unless given a floating one.

    Parameters
    ----------
    name : str
        What it is called.
    links : sequence of Link
        One of them, the base, is no joint's child.
    joints : sequence of Joint
        Every link but the base is the child of exactly one.
    gravity : array_like of shape (3,), default (0, 0, -9.81)
        Acceleration of free fall in the frame of the base, m/s^2.
    closures : sequence of Closure, default none
        What closes loops of the tree. A robot that has some moves as a mechanism does (`mechanism`); the functions on
        coordinates refuse it, as its coordinates depend on one another, and take `opened` instead.
    strict : bool, default True
        Refuse joints that move no mass. Otherwise they are kept (`massless_joints`): inverse dynamics gives them no
        torque, and a simulation in which they are free is refused, since nothing determines their acceleration.
    couplings : sequence of Tendon or BallDrive, default none
        What acts on several joints at once.

    Attributes
    ----------
    joint_names : tuple of str
        Moving joints that follow no other, parents before children, branches in the order given: the order of q.
    base : str
        The link that does not move.
    frames : dict of str to Frame
        Where each link is in the bodies of the tree.

    Raises
    ------
    RobotError
        If names repeat or lead nowhere, the joints form a loop or several trees, a joint moves no mass and the robot
        is strict, a joint follows one that cannot be followed, or a closure joins links that move as one.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])
    >>> pendulum = jn.Robot(
    ...     "pendulum", [jn.Link("base"), jn.Link("rod", rod)], [jn.Joint("pin", "base", "rod", axis=[0, 1, 0])]
    ... )
    >>> pendulum.joint_names
    ('pin',)
    """

    def mechanism(self, q: GivenCoordinates = None, **settings: Any) -> Mechanism:
        """Return the `jounce.Mechanism` that the robot is, with its masses, for `jounce.solve`; loops may be closed.

        See Also
        --------
        jounce.robot.closed_loops.closed_loop.mechanism : What there is to set: drivers, outputs, time, and so on.
        """
        return mechanism(self, q, **settings)
