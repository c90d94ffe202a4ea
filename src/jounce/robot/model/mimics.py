"""Joints that follow others: linear relations between coordinates."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from jounce.errors import RobotError
from jounce.rigid.inertia import finite_numbers


@dataclasses.dataclass(frozen=True)
class Mimic:
    """A joint that follows another, or several: its coordinate is ``offset`` plus the sum of ``multiplier * q``.

    Parameters
    ----------
    joint : str or sequence of str
        Names of the followed joints, which follow no other joint.
    multiplier : float or sequence of float, default 1
        Speed of the follower relative to each followed joint; one number applies to all.
    offset : float, default 0
        Coordinate of the follower if those of the followed joints are zero, rad or m.

    Raises
    ------
    RobotError
        If a number is not finite, their number differs from that of the joints, no joint is given, or one twice.

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
        """Whether the joint follows more than one joint."""
        return not isinstance(self.joint, str)

    @property
    def weights(self) -> dict[str, float]:
        """Multipliers, by the names of the followed joints."""
        return dict(zip(self.joint, self.multiplier, strict=True)) if self.several else {self.joint: self.multiplier}

    def after(self, mimics: Mapping[str, "Mimic"]) -> "Mimic":
        """Return the mimic with followers among the followed joints replaced by their leaders."""
        weights, offset = {}, self.offset
        for name, weight in self.weights.items():
            mimic = mimics.get(name) or Mimic(name)
            offset += weight * mimic.offset
            for leader, factor in mimic.weights.items():
                weights[leader] = weights.get(leader, 0.0) + weight * factor
        return Mimic(tuple(weights), tuple(weights.values()), offset)

    def held(self, positions: Mapping[str, float]) -> "Mimic | float":
        """Return the mimic without the held joints, or the coordinate if all followed joints are held."""
        offset = self.offset + sum(weight * positions[x] for x, weight in self.weights.items() if x in positions)
        left = {name: weight for name, weight in self.weights.items() if name not in positions}
        return Mimic(tuple(left), tuple(left.values()), offset) if left else offset


def leaders(mimics: Mapping[str, Mimic]) -> dict[str, Mimic]:
    """Return the mimics of joints by name, each of one joint, with followers of a follower following its leader.

    Circles stay unchanged; the robot rejects them.
    """
    resolved: dict[str, Mimic] = {}
    for name in mimics:
        chain: dict[str, Mimic] = {}  # from a follower to the first joint that is done, or follows no other
        while name in mimics and name not in resolved and name not in chain:
            chain[name] = mimics[name]
            name = mimics[name].joint
        circle = name in chain
        for follower, mimic in reversed(chain.items()):
            resolved[follower] = mimic if circle else mimic.after(resolved)
    return resolved
