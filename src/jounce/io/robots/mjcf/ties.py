"""Joints of an MJCF file that follow others or are held, by equalities of joints and of tendons along joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from jounce.errors import RobotFileError
from jounce.io.robots.mjcf.files import line_of
from jounce.robot.model.links_and_joints import Mimic

INACTIVE = "remove it, or set active='false'"
NO_CLOSURE = f"has no equivalent joint or closure; {INACTIVE}"


def tied_tendons(spec: Any, mujoco: Any, path: str) -> set[str]:
    """Return the names of the tendons in active equalities, which must run along joints.

    Raises
    ------
    RobotFileError
        If one runs between sites.
    """
    along = {t.name for t in spec.tendons if all(part.type == mujoco.mjtWrap.mjWRAP_JOINT for part in t.path)}
    tied: set[str] = set()
    for equality in spec.equalities:
        if equality.active and equality.type == mujoco.mjtEq.mjEQ_TENDON:
            names = {name for name in (equality.name1, equality.name2) if name}
            if names & {tendon.name for tendon in spec.tendons} - along:
                name = f"equality.{equality.name}" if equality.name else "equality"
                message = f"an active equality of a tendon between sites {NO_CLOSURE}"
                raise RobotFileError(message, path=path, line=line_of(equality.info), name=ascii(name)[1:-1])
            tied |= names
    return tied


def linear_tendons(spec: Any, mujoco: Any) -> set[str]:
    """Return the names of the tendons along joints, whose lengths are weighted sums of coordinates.

    All tendons get names.
    """
    for k, tendon in enumerate(spec.tendons):
        tendon.name = tendon.name or f"tendon_{k}"
    along = mujoco.mjtWrap.mjWRAP_JOINT
    return {t.name for t in spec.tendons if len(t.path) and all(part.type == along for part in t.path)}


class JointRelations:
    """Relations of joints by equalities: held joints, and joints that follow others.

    Parameters
    ----------
    model, mujoco
        Compiled model, and the package.
    names : sequence of str
        Names of the joints, by number.
    """

    def __init__(self, model: Any, mujoco: Any, names: Sequence[str]):
        self.model, self.names = model, names
        self.single = {int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)}
        self.fixed: dict[str, float] = {}
        self.mimics: dict[str, Mimic] = {}

    def reference(self, joint: int) -> float:
        """Return the coordinate of a joint of one axis in the pose of the file."""
        return float(self.model.qpos0[self.model.jnt_qposadr[joint]])

    def add_joints(self, k: Any, location: Mapping[str, Any]) -> None:
        """Add an equality of one joint, or of two: ``q_1 - ref_1 = a_0 + a_1 (q_2 - ref_2)``."""
        first, second = int(self.model.eq_obj1id[k]), int(self.model.eq_obj2id[k])
        coefficients = self.model.eq_data[k][:5]
        self._check_free(first, (first,) if second < 0 else (first, second), location)
        start = self.reference(first) + float(coefficients[0])
        if second < 0:
            self.fixed[self.names[first]] = start
        elif any(coefficients[2:]):
            message = "a joint can follow another linearly only; make the last three of polycoef zero"
            raise RobotFileError(message, **location, value=coefficients.tolist())
        else:
            self._follow(first, second, float(coefficients[1]), start)

    def add_tendons(self, k: Any, location: Mapping[str, Any]) -> None:
        """Add an equality of one tendon, or of two, whose lengths are weighted sums of coordinates.

        ``L_1 - ref_1 = a_0 + a_1 (L_2 - ref_2)``: of two joints, the second follows the first, unless it follows
        another.
        """
        model = self.model
        first, second = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        constant, slope, *curve = (float(number) for number in model.eq_data[k][:5])
        if second >= 0 and any(curve):
            message = "a tendon can follow another linearly only; make the last three of polycoef zero"
            raise RobotFileError(message, **location, value=model.eq_data[k][:5].tolist())
        weights: dict[int, float] = {}
        for tendon, factor in ((first, 1.0), (second, -slope)):
            start = model.tendon_adr[tendon]
            for part in range(start, start + model.tendon_num[tendon]) if tendon >= 0 else ():
                joint = int(model.wrap_objid[part])
                weights[joint] = weights.get(joint, 0.0) + factor * float(model.wrap_prm[part])
        tied = [joint for joint, weight in weights.items() if weight]
        if len(tied) not in (1, 2):
            message = f"a joint can follow one other only, and this ties another number of them; {INACTIVE}"
            raise RobotFileError(message, **location, value=[self.names[joint] for joint in tied])
        leader, follower = tied[0], tied[-1]
        if self.names[follower] in self.mimics:
            leader, follower = follower, leader
        self._check_free(follower, tied, location)
        start = self.reference(follower) + constant / weights[follower]
        if len(tied) == 1:
            self.fixed[self.names[follower]] = start
        else:
            self._follow(follower, leader, -weights[leader] / weights[follower], start)

    def _follow(self, joint: int, leader: int, slope: float, start: float) -> None:
        """Make a joint follow another; it is at `start` if the other is in the pose of the file."""
        self.mimics[self.names[joint]] = Mimic(self.names[leader], slope, start - slope * self.reference(leader))

    def _check_free(self, joint: int, tied: Sequence[int], location: Mapping[str, Any]) -> None:
        name = self.names[joint]
        if {int(self.model.jnt_type[j]) for j in tied} - self.single or name in self.mimics or name in self.fixed:
            message = "ties a joint of several coordinates, or one that is tied already"
            raise RobotFileError(message, **location, value=name)
