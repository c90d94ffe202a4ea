"""The result of inverse kinematics: coordinates for each pose, with what is missed where there are none."""

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
    """Coordinates that bring a tool to poses, and how far it stays away where none do.

    Attributes
    ----------
    q : numpy.ndarray of shape (..., n)
        Coordinates, rad or m, in the order of ``robot.joint_names``; NaN where the status is not OK.
    status : numpy.ndarray of shape (...)
        A `Status` for each pose: OK; NOT_ASSEMBLED where nothing near the starts is nearer than `closest`;
        NOT_CONVERGED where the steps ended before that was certain.
    closest : numpy.ndarray of shape (..., n)
        The nearest coordinates found, those of `q` where there are some.
    distance, angle : numpy.ndarray of shape (...)
        How far the tool is from the pose at `closest`, m, and by what angle it is turned away, rad.
    singular : numpy.ndarray of bool, shape (...)
        Whether the tool loses a motion at `closest`, which joints bring about in general.
    singular_values : numpy.ndarray of shape (..., rank)
        Of the task there, the largest first, with lengths in sizes of the robot.
    shares : numpy.ndarray of shape (..., n)
        How joints move together, at the least singular value, while the tool moves least.
    joint_names : tuple of str
        The order of q.
    limited : numpy.ndarray of bool, shape (..., n)
        Which joints are at a limit at `closest`.
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
    limited: Bool[np.ndarray, "*batch n"]

    def __repr__(self) -> str:
        solved = int((self.status == Status.OK).sum())
        return f"<JointPoses: {solved} of {self.status.size} poses, {int(self.singular.sum())} singular>"

    def explain(self, *index: int) -> str:
        """Return in words what became of a pose: what is missed and why, and which joints lose a motion.

        Parameters
        ----------
        *index : int
            Of the pose in the batch; none for a single one.
        """
        lane: Any = index
        words = []
        if self.status[lane] == Status.OK:
            words.append("reached")
        else:
            gap = f"the nearest found is {self.distance[lane]:.3g} m and {self.angle[lane]:.3g} rad away"
            if self.status[lane] == Status.NOT_CONVERGED:
                words.append(f"not converged: {gap}; allow more steps, or give another start")
            else:
                words.append(f"not reached: {gap}, and nothing near it is nearer; move the pose, or try more starts")
            limiting = [name for name, at in zip(self.joint_names, self.limited[lane], strict=True) if at]
            if limiting:
                words.append(f"at their limits: {', '.join(limiting)}")
        if self.singular[lane]:
            lost = ", ".join(losing_joints(self.joint_names, self.shares[lane]))
            least, largest = self.singular_values[lane][-1], self.singular_values[lane][0]
            words.append(
                f"singular: the motions of {lost} cancel at the tool (singular values from {largest:.2g} down to "
                f"{least:.2g})"
            )
        return "; ".join(words)
