"""Joints of an MJCF file that follow others or are held, by equalities of joints and of tendons along joints."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from jounce.errors import RobotFileError
from jounce.io.robots.mjcf.files import line_of
from jounce.robot.model.mimics import Mimic

INACTIVE = "remove it, or set active='false'"
ROUNDING = 1e-12  # of what is summed up: less than this is nothing
NO_CLOSURE = f"has no equivalent joint or closure; {INACTIVE}"


def tied_tendons(spec: Any, mujoco: Any, path: str) -> set[str]:
    """Return the names of the tendons in active equalities, which must run along joints.

    Raises
    ------
    RobotFileError
        If one runs between sites.
    """
    joint_tendons = {t.name for t in spec.tendons if all(part.type == mujoco.mjtWrap.mjWRAP_JOINT for part in t.path)}
    tied: set[str] = set()
    for equality in spec.equalities:
        if equality.active and equality.type == mujoco.mjtEq.mjEQ_TENDON:
            names = {name for name in (equality.name1, equality.name2) if name}
            if names & {tendon.name for tendon in spec.tendons} - joint_tendons:
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
    kind = mujoco.mjtWrap.mjWRAP_JOINT
    return {t.name for t in spec.tendons if len(t.path) and all(part.type == kind for part in t.path)}


class JointRelations:
    """Relations of joints by equalities: held joints, and joints that follow others.

    Each equality is a linear equation of coordinates, and makes one more joint follow those that are left in it.

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
        on_joints = model.actuator_trntype == int(mujoco.mjtTrn.mjTRN_JOINT)
        self.actuated = set(model.actuator_trnid[on_joints, 0].tolist())
        self.followers: dict[int, tuple[dict[int, float], float]] = {}  # away from the pose of the file

    def reference(self, joint: int) -> float:
        """Return the coordinate of a joint of one axis in the pose of the file."""
        return float(self.model.qpos0[self.model.jnt_qposadr[joint]])

    @property
    def fixed(self) -> dict[str, float]:
        """The coordinates of joints that are held."""
        return {
            self.names[joint]: self.reference(joint) + start
            for joint, (slopes, start) in self.followers.items()
            if not slopes
        }

    @property
    def mimics(self) -> dict[str, Mimic]:
        """What joints follow, which follow no other."""
        return {
            self.names[joint]: Mimic(
                [self.names[leader] for leader in slopes],
                list(slopes.values()),
                self.reference(joint) + start - sum(slope * self.reference(k) for k, slope in slopes.items()),
            )
            for joint, (slopes, start) in self.followers.items()
            if slopes
        }

    def add_joints(self, k: Any, location: Mapping[str, Any]) -> None:
        """Add an equality of one joint, or of two: ``q_1 - ref_1 = a_0 + a_1 (q_2 - ref_2)``."""
        first, second = int(self.model.eq_obj1id[k]), int(self.model.eq_obj2id[k])
        constant, slope = self._line(k, "joint", second >= 0, location)
        self._tie({first: 1.0} if second < 0 else {first: 1.0, second: -slope}, constant, location, {first})

    def add_tendons(self, k: Any, location: Mapping[str, Any]) -> None:
        """Add an equality of one tendon, or of two, whose lengths are weighted sums of coordinates.

        ``L_1 - ref_1 = a_0 + a_1 (L_2 - ref_2)``: the last joint follows the others, unless it follows some already; of
        three or more, the last one without an actuator, if there is one.
        """
        model = self.model
        first, second = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        constant, slope = self._line(k, "tendon", second >= 0, location)
        weights: dict[int, float] = {}
        for tendon, factor in ((first, 1.0), (second, -slope)):
            start = model.tendon_adr[tendon]
            for part in range(start, start + model.tendon_num[tendon]) if tendon >= 0 else ():
                joint = int(model.wrap_objid[part])
                weights[joint] = weights.get(joint, 0.0) + factor * float(model.wrap_prm[part])
        self._tie(weights, constant, location)

    def _line(self, k: Any, kind: str, two: bool, location: Mapping[str, Any]) -> tuple[float, float]:
        """Return the first two coefficients of an equality, of which only those count that it needs."""
        constant, slope, *curve = (float(number) for number in self.model.eq_data[k][:5])
        if two and any(curve):
            message = f"a {kind} can follow another linearly only; make the last three of polycoef zero"
            raise RobotFileError(message, **location, value=self.model.eq_data[k][:5].tolist())
        return constant, slope

    def _tie(
        self, weights: Mapping[int, float], constant: float, location: Mapping[str, Any], first: Collection[int] = ()
    ) -> None:
        """Take the equation that weighted coordinates, away from the pose of the file, sum up to a constant.

        Of the joints that are left in it one follows: those of `first` go before those without an actuator, if there
        are three or more, these before those of the equation itself, and the last ones before others.
        """
        for joint, weight in weights.items():
            if weight and int(self.model.jnt_type[joint]) not in self.single:
                message = "an equality cannot tie a joint of several coordinates; close a loop by connect or weld"
                raise RobotFileError(f"{message}, or {INACTIVE}", **location, value=self.names[joint])
        remaining, offset, sizes = dict[int, float](), constant, dict[int, float]()
        for joint, weight in weights.items():
            slopes, start = self.followers.get(joint, ({joint: 1.0}, 0.0))
            offset -= weight * start
            for leader, slope in slopes.items():
                remaining[leader] = remaining.get(leader, 0.0) + weight * slope
                sizes[leader] = sizes.get(leader, 0.0) + abs(weight * slope)
        remaining = {joint: weight for joint, weight in remaining.items() if abs(weight) > ROUNDING * sizes[joint]}
        if not remaining:
            size = abs(constant) + sum(abs(w * self.followers[j][1]) for j, w in weights.items() if j in self.followers)
            if abs(offset) > ROUNDING * size:
                tied = [self.names[joint] for joint, weight in weights.items() if weight]
                message = f"contradicts the equalities before it, by {offset:.6g}; {INACTIVE}"
                raise RobotFileError(message, **location, value=tied)
            return
        passive = set(remaining) - self.actuated if len(remaining) > 2 else set[int]()
        follower = max(remaining, key=lambda j: (j in first, j in passive, j in weights, list(remaining).index(j)))
        divisor = remaining.pop(follower)
        tie = ({joint: -weight / divisor for joint, weight in remaining.items()}, offset / divisor)
        for joint, (slopes, start) in self.followers.items():
            if follower in slopes:
                factor = slopes.pop(follower)
                for leader, slope in tie[0].items():
                    slopes[leader] = slopes.get(leader, 0.0) + factor * slope
                self.followers[joint] = ({k: x for k, x in slopes.items() if x}, start + factor * tie[1])
        self.followers[follower] = tie
