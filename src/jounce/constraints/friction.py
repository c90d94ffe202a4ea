"""Dry friction of joints: how surfaces in contact slide on each other, and how much they resist it.

What a joint exerts presses its surfaces together, and friction is in proportion to that. A joint that can have it says
in `slip` how its surfaces slide, linear in the velocities of its bodies; what presses them is its reaction force.
"""

import operator
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Float

from jounce.base.modules import Module
from jounce.constraints.base import Scalar
from jounce.errors import MechanismError
from jounce.jet import Jet, exp, sqrt
from jounce.rigid import PlanarPose
from jounce.rigid.pose import Pose

Velocities = Sequence[tuple[Jet, Jet]]
"""Of each body: velocity of the origin, and angular velocity, both global; or a displacement and a turn."""

NEAR = 0.09  # of the square of slip over speed: below, tanh(x) / x is taken by its series
TERMS = 13  # of that series


class Friction(Module):
    """Dry friction of a joint, Coulomb's law: in proportion to what presses its surfaces together, and against slip.

    It is ``mu |R| tanh(v / speed)`` along the slip v of a guide, and a moment ``mu r |R| tanh(omega r / speed)`` about
    a pin of radius r, R being the reaction force of the joint. Within some multiples of the speed it is less than
    Coulomb's, and at rest there is none: nothing sticks, but creeps. It is on both bodies, with opposite signs.

    Parameters
    ----------
    coefficient : float or expression
        Coefficient of friction mu, not negative.
    speed : float or expression
        Speed of slip at which it is 76 percent of Coulomb's, m/s; far below those of the motion.
    radius : float or expression, optional
        Of the surface that slides where the bodies turn, m: of the pin, the ball or the thread; guides have none.

    Examples
    --------
    >>> import jounce as jn
    >>> pin = jn.joints.Friction(coefficient=0.1, radius=0.012, speed=1e-3)
    >>> wheel = jn.Mechanism(
    ...     space="planar",
    ...     gravity=[0, -10.0],
    ...     bodies={"wheel": jn.Body([0, 0], mass=2.0, inertia=0.5)},
    ...     joints={"O": jn.planar.Revolute(("ground", "wheel"), [0, 0], [0, 0], friction=pin)},
    ...     drivers={"turn": jn.drivers.CoordinateDriver(("ground", "wheel"), "angle", motion="3*t")},
    ... )
    >>> torque = jn.driver_force(jn.solve(wheel, [1.0], order=2), "turn")
    >>> round(float(torque.values[0, 0]), 9)  # 0.1 * 12 mm * 20 N
    0.024
    """

    coefficient: Scalar
    speed: Scalar
    radius: Scalar = None

    dimensions = {"coefficient": "ratio", "speed": "speed", "radius": "length"}
    signs = {"coefficient": "not negative", "speed": "positive", "radius": "positive"}

    def resisting(self, slip: Float[Jet, "direction *batch"]) -> Float[Jet, "direction *batch"]:
        """Return the part of what presses that resists slip, in each direction of it."""
        relative = slip / self.speed
        if slip.shape[0] == 1:
            return _tanh(relative) * self.coefficient
        return relative * (_tanh_of_root(relative.dot(relative)) * self.coefficient)


def _tanh_of_root(square: Jet) -> Jet:
    """Return ``tanh(x) / x`` from the square of x, smooth at zero, where the root is not."""
    near = square.coefficients[0] < NEAR
    small, large = (_where(condition, square, 1e-2) for condition in (near, ~near))
    series = small * 0.0
    for term in _terms()[::-1]:
        series = series * small + term
    root = sqrt(large)
    return _where(near, series, _tanh(root) / root)


def _tanh(x: Jet) -> Jet:
    """Return the hyperbolic tangent by exponentials, whose coefficients keep their digits where it saturates.

    The recurrence of series by ``1 - tanh^2`` loses them, and has steps of simulations short far above the speed.
    """
    side = jnp.where(x.coefficients[0] < 0, -1.0, 1.0)
    left = exp(x * (-2.0 * side))
    return (1.0 - left) / (1.0 + left) * side


def _terms() -> list[float]:
    """Return the coefficients of ``tanh(x) / x`` by powers of the square of x, as ``tanh' = 1 - tanh^2`` has them."""
    coefficients = [1.0]
    for k in range(1, TERMS):
        coefficients.append(-sum(map(operator.mul, coefficients, coefficients[::-1])) / (2 * k + 1))
    return coefficients


def _where(condition: Any, jet: Jet, other: Any) -> Jet:
    """Return one jet where a condition holds, and elsewhere another one or a constant."""
    others = other if isinstance(other, Jet) else Jet.constant(jnp.full_like(jet.coefficients[0], other), jet.order)
    pairs = zip(jet.dense().coefficients, others.dense().coefficients, strict=True)
    return Jet(tuple(jnp.where(condition, a, b) for a, b in pairs))


def check_friction(joint: Any) -> None:
    """Raise MechanismError unless what a joint has as friction is one, with a radius where surfaces turn."""
    friction = joint.friction
    if friction is None:
        return
    if not isinstance(friction, Friction):
        message = "must be a jn.joints.Friction, in a file {coefficient: 0.1, radius: 12 mm, speed: 1 mm/s}"
        raise MechanismError(message, name="friction", value=friction)
    if joint.has_friction_radius and friction.radius is None:
        raise MechanismError("is missing: the bodies turn, on a surface of some radius", name="friction.radius")
    if not joint.has_friction_radius and friction.radius is not None:
        message = "is none of a guide, whose surfaces slide and do not turn: leave it out"
        raise MechanismError(message, name="friction.radius", value=friction.radius)


def velocities(bodies: Sequence[Pose]) -> Velocities:
    """Return how bodies move, one order shorter than their poses."""
    return [
        (
            b.position.differentiate(),
            b.angle.differentiate() if isinstance(b, PlanarPose) else b.global_angular_velocity(),
        )
        for b in bodies
    ]


def displacements(bodies: Sequence[Pose], changes: Sequence[Any]) -> Velocities:
    """Return by how much bodies are displaced and turned by changes that `varied` gave; None is no change."""
    velocities = []
    for body, change in zip(bodies, changes, strict=True):
        if change is None:
            still = Jet.constant(jnp.zeros_like(body.position.coefficients[0]), body.order)
            velocities.append((still, still[0] if isinstance(body, PlanarPose) else still))
        elif isinstance(body, PlanarPose):
            velocities.append((change.position, change.angle))
        else:
            velocities.append((change.position, body.direction(body.turning(change))))
    return velocities


def slip_velocity(joint: Any, bodies: Sequence[Pose]) -> Float[Jet, "direction *batch"]:
    """Return how fast the surfaces of a joint slide on each other, m/s, one order shorter than the poses."""
    return joint.slip(tuple(b.truncate(b.order - 1) for b in bodies), velocities(bodies))


def relative_turn(moving: Velocities) -> Jet:
    """Return the angular velocity of the second body relative to the first."""
    return moving[1][1] - moving[0][1]


def relative_velocity(bodies: Sequence[Pose], moving: Velocities, point_j: Any) -> Jet:
    """Return the velocity of a point of the second body relative to the first, global."""
    place = bodies[1].point(point_j)
    return _at(bodies[1], moving[1], place) - _at(bodies[0], moving[0], place)


def _at(body: Pose, moving: tuple[Jet, Jet], place: Jet) -> Jet:
    velocity, turning = moving
    lever = place - body.position
    if isinstance(body, PlanarPose):
        return velocity + lever.map(lambda c: jnp.stack([-c[1], c[0]])) * turning
    return velocity + turning.cross(lever)


class UnitFriction(Module):
    """Friction of one along a direction of slip, whatever slips: what any friction at rest is made of.

    Parameters
    ----------
    radius : float, optional
        As of `Friction`.
    direction : int
        Of slip.
    """

    radius: Any
    direction: int = eqx.field(static=True)

    def resisting(self, slip: Float[Jet, "direction *batch"]) -> Float[Jet, "direction *batch"]:
        """Return one in that direction, and nothing in the others."""
        none = jnp.zeros_like(slip.coefficients[0])
        return Jet.constant(none.at[self.direction].set(1.0), slip.order)


def pressing_force(
    joint: Any, bodies: Sequence[Pose], force: Float[Jet, "component *batch"]
) -> Float[Jet, "direction *batch"]:
    """Return what presses the surfaces of a joint, N, as a vector, from what it exerts on its second body, global.

    It is that force, unless the class has a `pressing` of its own.
    """
    return force if not hasattr(joint, "pressing") else joint.pressing(bodies, force)


def normal_force(joint: Any, bodies: Sequence[Pose], force: Float[Jet, "component *batch"]) -> Float[Jet, "*batch"]:
    """Return what presses the surfaces of a joint together, N, from what it exerts on its second body, global.

    It is the size of `pressing_force`. Where there is none, its rates are not determined, and those of zero are
    returned.
    """
    pressing = pressing_force(joint, bodies, force)
    square = pressing.dot(pressing)
    none = square.coefficients[0] == 0
    return _where(~none, sqrt(_where(~none, square, 1.0)), 0.0)
