"""The result of inverse kinematics: coordinates for each pose, with the remaining error where a pose is not reached."""

import dataclasses
from typing import Any

import numpy as np
from jaxtyping import Bool, Int

from jounce.base.display import Displayed
from jounce.base.shapes import Array
from jounce.kinematics import Status
from jounce.planning.tool_paths.task_rank import losing_joints


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class JointPoses(Displayed):
    """Coordinates that bring a tool to poses, and the remaining errors of poses that are not reached.

    Attributes
    ----------
    q : numpy.ndarray of shape (..., n)
        Coordinates, rad or m, in the order of ``robot.joint_names``; NaN where the status is not OK.
    status : numpy.ndarray of shape (...)
        A `Status` for each pose: OK; NOT_ASSEMBLED if `closest` is a local minimum of the error; NOT_CONVERGED if the
        steps ended before a minimum was certain.
    closest : numpy.ndarray of shape (..., n)
        Coordinates nearest to the pose that were found; those of `q` for a reached pose. Where it is not reached,
        joints that follow several may be beyond their ranges by a ten-thousandth of the error that is left.
    distance, angle : numpy.ndarray of shape (...)
        Distance, m, and angle, rad, between tool and pose at `closest`.
    singular : numpy.ndarray of bool, shape (...)
        Whether `closest` is a singular position, in which the tool loses a motion that it has in general.
    singular_values : numpy.ndarray of shape (..., rank)
        Singular values of the task at `closest`, the largest first, with lengths in sizes of the robot.
    shares : numpy.ndarray of shape (..., n)
        Right singular vector of the least singular value: the joint motion that moves the tool least.
    joint_names : tuple of str
        Names of the joints, in the order of q.
    limited : numpy.ndarray of bool, shape (..., m)
        Whether each joint of `limited_names` is at a limit at `closest`.
    limited_names : tuple of str
        The joints, and behind them those with limits that follow several.
    """

    q: Array[np.ndarray, "*batch n"]
    status: Int[np.ndarray, "*batch"]
    closest: Array[np.ndarray, "*batch n"]
    distance: Array[np.ndarray, "*batch"]
    angle: Array[np.ndarray, "*batch"]
    singular: Bool[np.ndarray, "*batch"]
    singular_values: Array[np.ndarray, "*batch rank"]
    shares: Array[np.ndarray, "*batch n"]
    joint_names: tuple[str, ...]
    limited: Bool[np.ndarray, "*batch m"]
    limited_names: tuple[str, ...]

    def __repr__(self) -> str:
        count = int((self.status == Status.OK).sum())
        return f"<JointPoses: {count} of {self.status.size} poses, {int(self.singular.sum())} singular>"

    def explain(self, *index: int) -> str:
        """Return the result for a pose in words: the remaining error and its cause, and the joints that lose a motion.

        Parameters
        ----------
        *index : int
            Index of the pose in the batch; none for a single pose.
        """
        lane: Any = index
        phrases = []
        if self.status[lane] == Status.OK:
            phrases.append("reached")
        else:
            gap = f"the nearest found is {self.distance[lane]:.3g} m and {self.angle[lane]:.3g} rad away"
            if self.status[lane] == Status.NOT_CONVERGED:
                phrases.append(f"not converged: {gap}; allow more steps, or give another start")
            else:
                phrases.append(f"not reached: {gap}, and nothing near it is nearer; move the pose, or try more starts")
            limiting = [name for name, flag in zip(self.limited_names, self.limited[lane], strict=True) if flag]
            if limiting:
                phrases.append(f"at their limits: {', '.join(limiting)}")
        if self.singular[lane]:
            names = ", ".join(losing_joints(self.joint_names, self.shares[lane]))
            smallest, largest = self.singular_values[lane][-1], self.singular_values[lane][0]
            phrases.append(
                f"singular: the motions of {names} cancel at the tool (singular values from {largest:.2g} down to "
                f"{smallest:.2g})"
            )
        return "; ".join(phrases)
