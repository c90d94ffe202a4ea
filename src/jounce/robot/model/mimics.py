"""Joints that follow others: linear relations between coordinates."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from jounce.errors import RobotError
from jounce.rigid.inertia import finite_numbers


@dataclasses.dataclass(frozen=True)
class Mimic:
    """A joint that follows another one, or several: its coordinate is ``offset`` and the sum of ``multiplier * q``.

    Parameters
    ----------
    joint : str or sequence of str
        Names of the joints that are followed; these follow no other.
    multiplier : float or sequence of float, default 1
        By how much faster this one moves than each; one number is that of all.
    offset : float, default 0
        Its coordinate where those of the others are zero, rad or m.

    Raises
    ------
    RobotError
        If a number is not finite, there are not as many as joints, or these are none, or one of them twice.

    Examples
    --------
    >>> import jounce as jn
    >>> jn.robot.Mimic(["hip", "knee"], [-1.0, 0.5], offset=0.1).weights
    {'hip': -1.0, 'knee': 0.5}
    """

    joint: Any
    multiplier: Any = 1.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        names = [self.joint] if isinstance(self.joint, str) else list(self.joint)
        if not names or len(set(names)) < len(names):
            raise RobotError("must be a joint, or different ones", name="mimic.joint", value=self.joint)
        numbers = finite_numbers("mimic.multiplier", self.multiplier, (), (len(names),))
        multipliers = tuple(float(x) for x in np.broadcast_to(numbers, len(names)))
        object.__setattr__(self, "joint", tuple(names) if len(names) > 1 else names[0])
        object.__setattr__(self, "multiplier", multipliers if len(names) > 1 else multipliers[0])
        object.__setattr__(self, "offset", float(finite_numbers("mimic.offset", self.offset, ())))

    @property
    def several(self) -> bool:
        """Whether more than one joint is followed."""
        return not isinstance(self.joint, str)

    @property
    def weights(self) -> dict[str, float]:
        """The multipliers, by the names of the joints that are followed."""
        return dict(zip(self.joint, self.multiplier, strict=True)) if self.several else {self.joint: self.multiplier}

    def after(self, mimics: Mapping[str, "Mimic"]) -> "Mimic":
        """Return how the joint follows the leaders of those that it follows and that follow others."""
        weights, offset = {}, self.offset
        for name, weight in self.weights.items():
            mimic = mimics.get(name) or Mimic(name)
            offset += weight * mimic.offset
            for leader, factor in mimic.weights.items():
                weights[leader] = weights.get(leader, 0.0) + weight * factor
        return Mimic(tuple(weights), tuple(weights.values()), offset)

    def held(self, positions: Mapping[str, float]) -> "Mimic | float":
        """Return how the joint follows those that are not held; its coordinate if all are."""
        offset = self.offset + sum(weight * positions[x] for x, weight in self.weights.items() if x in positions)
        left = {name: weight for name, weight in self.weights.items() if name not in positions}
        return Mimic(tuple(left), tuple(left.values()), offset) if left else offset


def leaders(mimics: Mapping[str, Mimic]) -> dict[str, Mimic]:
    """Return what joints follow, by name: those that follow a follower made to follow its leader; each follows one.

    Circles are left as they are, for the robot to refuse.
    """
    mimic_of: dict[str, Mimic] = {}
    for name in mimics:
        chain: dict[str, Mimic] = {}  # from a follower to the first joint that is known, or leads
        while name in mimics and name not in mimic_of and name not in chain:
            chain[name] = mimics[name]
            name = mimics[name].joint
        circle = name in chain
        for follower, mimic in reversed(chain.items()):
            mimic_of[follower] = mimic if circle else mimic.after(mimic_of)
    return mimic_of
