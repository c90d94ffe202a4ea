"""Joints that follow several others and have limits of their own, which no limits of these stand for."""

import dataclasses

import numpy as np
from jaxtyping import Float

from jounce.dynamics.limits.limit_jumps import SMALL, Infinite, Jumps
from jounce.robot.model.links_and_joints import UNLIMITED, Joint, Limits
from jounce.robot.robot import Robot


@dataclasses.dataclass(frozen=True, eq=False)
class SharedFollowers:
    """Joints that follow several others and have limits: columns behind those of the coordinates of a robot.

    Parameters
    ----------
    joints : tuple of Joint
    weights : array of shape (joint, coordinate)
        How they follow.
    offset : array of shape (joint,)
    """

    joints: tuple[Joint, ...]
    weights: Float[np.ndarray, "follower coordinate"]
    offset: Float[np.ndarray, " follower"]

    @classmethod
    def of(cls, robot: Robot) -> "SharedFollowers":
        """Return those of a robot."""
        weights, offset, joints = [], [], []
        for joint in robot.moving_joints:
            limits = dataclasses.replace(joint.limits, effort=None, effort_rate=None)
            if joint.mimic is not None and joint.mimic.several and limits != UNLIMITED:
                joints.append(dataclasses.replace(joint, limits=limits))
                weights.append([joint.mimic.weights.get(name, 0.0) for name in robot.joint_names])
                offset.append(joint.mimic.offset)
        table = np.array(weights, float).reshape(-1, len(robot.joint_names))
        return cls(tuple(joints), table, np.array(offset, float))

    @property
    def names(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(joint.name for joint in self.joints)

    @property
    def limits(self) -> dict[str, Limits]:
        """Their limits of motion; the followed joints have those of the drives."""
        return {joint.name: joint.limits for joint in self.joints}

    @property
    def ranges(self) -> tuple[Float[np.ndarray, " follower"], Float[np.ndarray, " follower"]]:
        """Their ranges, infinite without limits."""
        lower = [-np.inf if joint.limits.lower is None else joint.limits.lower for joint in self.joints]
        upper = [np.inf if joint.limits.upper is None else joint.limits.upper for joint in self.joints]
        return np.array(lower, float), np.array(upper, float)

    def moving(self, columns: list[int]) -> list[int]:
        """Return the numbers of the followers that move with some coordinates."""
        return [k for k, row in enumerate(self.weights) if row[columns].any()]

    def with_followers(
        self, q: Float[np.ndarray, "time derivative coordinate"]
    ) -> Float[np.ndarray, "time derivative column"]:
        """Return coordinates with derivatives, followed by those of the shared followers."""
        follower_values = q @ self.weights.T
        follower_values[:, 0] += self.offset
        return np.concatenate([q, follower_values], axis=-1)

    def infinite(self, infinite: Infinite, jumps: Jumps) -> Infinite:
        """Return which quantities are infinite where coordinates jump, followed by those of the shared followers."""
        before, after = (self.with_followers(x) for x in (jumps.before, jumps.after))
        sizes = np.abs(jumps.after - jumps.before) @ np.abs(self.weights).T
        cancels = np.abs(after - before)[:, :, len(self.weights.T) :] <= SMALL * sizes  # jumps that cancel
        follower_values = after[:, :, len(self.weights.T) :]
        follower_values[cancels] = before[:, :, len(self.weights.T) :][cancels]
        follower_jumps = Jumps(jumps.times, before, after)
        signs, slowing = (np.zeros((len(jumps.times), 6, len(self.joints))) for _ in range(2))
        for level in (1, 2, 3):
            signs[:, level] = follower_jumps.above(level)[:, len(self.weights.T) :]
        slowing[:, 1], slowing[:, 2] = before[:, 1, len(self.weights.T) :], signs[:, 2]
        pairs = ((infinite.signs, signs), (infinite.before, slowing))
        return Infinite(infinite.times, *(np.concatenate(x, axis=-1) for x in pairs))
