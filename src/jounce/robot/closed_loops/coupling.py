"""The coordinate of a joint as a function of the poses of two bodies: driven, coupled to another, or an output."""

import dataclasses
from fractions import Fraction
from typing import Any

import jax.numpy as jnp

from jounce.base.modules import field
from jounce.base.shapes import Numbers
from jounce.constraints import AbstractConstraint, Scalar, Vector
from jounce.constraints.angles import relative_angle
from jounce.constraints.planar import slide
from jounce.errors import MechanismError, check_choice
from jounce.jet import Jet, wrap
from jounce.jet.turns import WHOLE_TURN
from jounce.mechanism import AbstractOutput
from jounce.rigid import PlanarPose, SpatialPose
from jounce.rigid.body_arrays import each_jet

KINDS = ("turn-turn", "turn-slide", "slide-turn", "slide-slide")
ROLES = "ijmn"
AT_REST = "0"
NO_PERIOD = 1e300  # larger than the range of any equation
LARGEST_DENOMINATOR = 1000  # of ratios of whole numbers


@dataclasses.dataclass(frozen=True, eq=False)
class JointPlacement:
    """A moving joint between two bodies of a mechanism, in the frames of these bodies.

    Parameters
    ----------
    bodies : tuple of str
        Names of the two bodies.
    turning : bool
        Whether the coordinate is an angle.
    point : array of shape (3,)
        Origin of the joint on the first body; on the second body it is the origin of the frame.
    axis_i, axis_j : array of shape (3,)
        Axis on each body.
    vector_i, vector_j : array of shape (3,)
        Perpendiculars to the axis that coincide at coordinate zero.
    """

    bodies: tuple[str, str]
    turning: bool
    point: Any
    axis_i: Any
    axis_j: Any
    vector_i: Any
    vector_j: Any


def coordinate(
    body_i: SpatialPose, body_j: SpatialPose, turning: bool, parts: tuple[Numbers, Numbers, Numbers, Numbers]
) -> Jet:
    """Return the coordinate of a joint, rad up to whole turns, or m."""
    point, axis, vector_i, vector_j = parts
    if turning:
        return relative_angle(body_i, body_j, axis, vector_i, vector_j)
    return slide(body_i, body_j, point, jnp.zeros_like(point), axis)


def at_rest(like: SpatialPose) -> SpatialPose:
    """Return the identity pose, at rest, with the shape and the order of another pose."""
    zero = jnp.zeros_like(like.position.coefficients[0])
    identity = SpatialPose.at(zero, jnp.concatenate([jnp.ones_like(zero[:1]), zero]))
    return each_jet(lambda jet: Jet.constant(jet.coefficients[0], like.order), identity)


class CoupledJoints(AbstractConstraint, type="coupled", space="spatial"):
    """A joint follows another one: ``weight_2 q_2 - weight_1 q_1 = offset``, up to whole periods.

    Angles of turning joints are known up to whole turns. By default the period is one turn if both joints turn and
    have whole weights, and otherwise a turn of the turning joint times its weight, so that a continuous motion stays
    consistent over many turns.

    Role 0 as the parent of the second joint is inertial space, which takes no reaction. The rotors that represent
    armature inertia, whose force depends on the rate of a coordinate alone, turn against it.
    """

    roles: str = field(static=True)  # parent and child of each joint among the bodies i, j, m, n, such as ijim; ij0m
    kinds: str = field(static=True)  # of each joint, turn or slide, such as turn-slide
    point_1: Vector
    axis_1: Vector
    vector_1: Vector
    opposite_1: Vector
    point_2: Vector
    axis_2: Vector
    vector_2: Vector
    opposite_2: Vector
    weight_1: Scalar
    weight_2: Scalar
    offset: Scalar
    period: Scalar = None

    body_count = 3
    body_counts = (3, 4)  # two joints may share one
    dimensions = {
        **dict.fromkeys(("point_1", "point_2"), "length"),
        **dict.fromkeys((f"{word}_{k}" for word in ("axis", "vector", "opposite") for k in (1, 2)), "direction"),
        **dict.fromkeys(("weight_1", "weight_2", "offset", "period"), "any"),
    }

    def __check_init__(self):
        check_choice("kinds", self.kinds, KINDS, MechanismError)
        roles = ROLES[: len(self.bodies)]
        pairs = {self.roles[:2], self.roles[2:]}
        used_roles = {*self.roles[:2], *self.roles[2:].removeprefix(AT_REST)}
        if len(self.roles) != 4 or used_roles != set(roles) or any(len({*pair}) != 2 for pair in pairs):
            message = (
                f"must name two bodies of each joint by {', '.join(roles)}, such as ijim, or 0 for the third at rest"
            )
            raise MechanismError(message, name="roles", value=self.roles)

    def residual(self, *bodies_and_time: Any) -> Jet:
        """Return the deviation of the second joint from following the first."""
        poses = dict(zip(ROLES, bodies_and_time, strict=False)) | {AT_REST: at_rest(bodies_and_time[0])}
        bodies = [poses[role] for role in self.roles]
        turning = [kind == "turn" for kind in self.kinds.split("-")]
        first = (self.point_1, self.axis_1, self.vector_1, self.opposite_1)
        second = (self.point_2, self.axis_2, self.vector_2, self.opposite_2)
        leader = coordinate(bodies[0], bodies[1], turning[0], first)
        follower = coordinate(bodies[2], bodies[3], turning[1], second)
        excess = self.weight_2 * follower - self.weight_1 * leader - self.offset
        return wrap(excess, self._period(*turning)) if any(turning) or self.period is not None else excess

    @property
    def unfelt(self) -> tuple[int, ...]:
        """Positions in `bodies` of those whose reaction moments the ground does not receive."""
        return (ROLES.index(self.roles[3]),) if self.roles[2] == AT_REST else ()

    def _period(self, leader_turns: bool, follower_turns: bool) -> Any:
        """Return the change of the equation when a turning joint makes a whole turn."""
        if self.period is not None:
            return self.period
        weight = jnp.abs(self.weight_2 if follower_turns else self.weight_1)
        if leader_turns and follower_turns:
            are_integers = (self.weight_1 == jnp.round(self.weight_1)) & (self.weight_2 == jnp.round(self.weight_2))
            weight = jnp.where(are_integers, 1.0, weight)
        return jnp.where(weight == 0, NO_PERIOD, WHOLE_TURN * weight)


def coupled(
    leader: JointPlacement, follower: JointPlacement, multiplier: float, offset: float, *, in_space: bool = False
) -> CoupledJoints:
    """Return the constraint that makes a joint follow another: ``q_2 = multiplier q_1 + offset``.

    With `in_space`, the parent of the follower is inertial space, which takes no reaction.

    Between turning joints, a multiplier that is not a ratio with a denominator of at most a thousand is valid only
    within half a turn either side of zero.
    """
    bodies = list(dict.fromkeys([*leader.bodies, *follower.bodies[in_space:]]))
    follower_roles = [AT_REST if in_space and k == 0 else ROLES[bodies.index(x)] for k, x in enumerate(follower.bodies)]
    weights = (multiplier, 1.0)
    if leader.turning and follower.turning:
        ratio = Fraction(multiplier).limit_denominator(LARGEST_DENOMINATOR)
        if abs(ratio - Fraction(multiplier)) <= 1e-15 * abs(Fraction(multiplier)):
            weights = (float(ratio.numerator), float(ratio.denominator))
    return CoupledJoints(
        tuple(bodies),
        "".join([*(ROLES[bodies.index(body)] for body in leader.bodies), *follower_roles]),
        "-".join("turn" if joint.turning else "slide" for joint in (leader, follower)),
        *(leader.point, leader.axis_i, leader.vector_i, leader.vector_j),
        *(follower.point, follower.axis_i, follower.vector_i, follower.vector_j),
        weight_1=weights[0],
        weight_2=weights[1],
        offset=offset * weights[1],
    )


class SlideOutput(AbstractOutput):
    """Signed distance from a point of body i to a point of body j along a direction of body i, m."""

    point_i: Vector  # m, in the frame of each body
    point_j: Vector
    vector_i: Vector

    body_count = 2

    def evaluate(self, body_i: PlanarPose | SpatialPose, body_j: PlanarPose | SpatialPose) -> Jet:
        """Return the signed distance."""
        return slide(body_i, body_j, self.point_i, self.point_j, self.vector_i)
