"""The robot class of the public interface, with its conversion to a mechanism."""

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
        Name of the robot.
    links : sequence of Link
        Links, one of which, the base, is not the child of a joint.
    joints : sequence of Joint
        Joints, of which every link but the base is the child of exactly one.
    gravity : array_like of shape (3,), default (0, 0, -9.81)
        Acceleration of free fall in the frame of the base, m/s^2.
    closures : sequence of Closure, default none
        Constraints between links that close loops of the tree. The coordinates of a robot with closures depend on one
        another: use its `mechanism`, or `opened`, the tree without closures, for functions on coordinates.
    strict : bool, default True
        Refuse joints that move no mass. Otherwise they are kept (`massless_joints`): inverse dynamics gives them no
        torque, and a simulation with such a joint free is refused, as its acceleration is undetermined.
    couplings : sequence of Tendon or BallDrive, default none
        Tendons and drives of balls, which act on several joints at once.

    Attributes
    ----------
    joint_names : tuple of str
        Moving joints that follow no other, parents before children, branches in the order given: the order of q.
    base : str
        Name of the link that does not move.
    frames : dict of str to Frame
        Frame of each link in its body of the tree.

    Raises
    ------
    RobotError
        If names repeat or do not exist, the joints form a loop or several trees, a joint moves no mass and `strict` is
        True, a joint follows one that cannot be followed, or a closure joins links that move as one.

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
        """Return the robot as a `jounce.Mechanism`, with masses and closed loops, for `jounce.solve`.

        See Also
        --------
        jounce.robot.closed_loops.closed_loop.mechanism : The settings: drivers, outputs, time, and so on.
        """
        return mechanism(self, q, **settings)
