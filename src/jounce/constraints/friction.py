"""Dry friction of joints: sliding of surfaces in contact, and its resistance.

The reaction of a joint presses its surfaces together, and friction is proportional to it. A joint that may have
friction defines `slip`, the sliding of its surfaces, linear in the velocities of its bodies; its reaction force is the
normal force. Gear teeth take a share of the power that they transmit: a gear defines the transmitted torque in
`passed_on`.
"""

import operator
from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.modules import Module, belongs_to_package, field
from jounce.base.shapes import is_traced
from jounce.constraints.base import Scalar
from jounce.errors import MechanismError, UnsupportedError
from jounce.jet import Jet, cross, exp, sqrt
from jounce.rigid import PlanarPose
from jounce.rigid.pose import Pose

Velocities = Sequence[tuple[Jet, Jet]]
"""Velocity of the origin, and angular velocity, of each body, both global; or displacement and rotation."""

NEAR = 0.09  # squared ratio of slip to speed below which tanh(x) / x is computed by its series
TERMS = 13  # of that series


class Friction(Module):
    """Dry friction of a joint by Coulomb's law: proportional to the normal force, and opposite to slip.

    It is ``mu |R| tanh(v / speed)`` along the slip v of a guide, and a moment ``mu r |R| tanh(omega r / speed)`` about
    a pin of radius r, with R the reaction force of the joint. Up to a few multiples of the speed it is less than
    Coulomb's friction, and at rest it is zero: nothing sticks, but creeps. It acts on both bodies, with opposite signs.

    Parameters
    ----------
    coefficient : float or expression
        Coefficient of friction mu, not negative.
    speed : float or expression
        Speed of slip at which friction is 76 percent of Coulomb's, m/s; choose it far below the speeds of the motion.
    radius : float or expression, optional
        Radius of the sliding surface where the bodies turn, m: of the pin, the ball or the thread; guides have none.

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
        """Return the ratio of friction to the normal force, opposite to slip, in each direction of slip."""
        relative = slip / self.speed
        if slip.shape[0] == 1:
            return _tanh(relative) * self.coefficient
        return relative * (_tanh_of_root(relative.dot(relative)) * self.coefficient)


class GearFriction(Module):
    """Friction of gear teeth: a torque opposite to the rotation of gear i, proportional to the transmitted torque.

    The output power is the input power times the efficiency: `efficiency` if gear i drives gear j, and `backward` if
    gear j drives gear i, both relative to the frame that carries the gears. A worm has a coefficient and a lead angle
    instead, from which both follow as for a screw: ``tan(lead) / tan(lead + rho)`` if the worm, gear i, drives, and
    ``tan(lead - rho) / tan(lead)`` if its wheel does, with ``tan(rho) = coefficient / cos(pressure_angle)``. With zero
    or less backward, the gears are self-locking: gear j cannot move gear i, and even under a load that pushes it, gear
    i must be driven. Up to a few multiples of the speed friction is less, and at rest it is zero: nothing sticks, but
    creeps. Niemann and Winter, Maschinenelemente 3.

    Parameters
    ----------
    speed : float or expression
        Angular velocity of gear i relative to the frame, rad/s, at which friction is about 76 percent of its full
        value; choose it far below those of the motion.
    efficiency : float or expression, optional
        Efficiency of power from gear i to gear j: above 0, at most 1.
    backward : float or expression, optional
        Efficiency of power from gear j to gear i, at most 1; by default as forward.
    coefficient, lead_angle : float or expression, optional
        In place of efficiencies: coefficient of friction of the flanks of worm i, and its lead angle at the pitch
        radius, rad.
    pressure_angle : float or expression, optional
        Pressure angle of the normal section of its thread, rad; zero by default.

    Raises
    ------
    MechanismError
        If there are neither efficiencies nor a coefficient with a lead angle, or both.

    Examples
    --------
    >>> import jounce as jn
    >>> worm = jn.joints.GearFriction(speed=0.1, coefficient=0.12, lead_angle=0.1)
    >>> [round(float(x), 4) for x in worm.efficiencies]  # it locks itself
    [0.4499, -0.1937]
    """

    speed: Scalar
    efficiency: Scalar = None
    backward: Scalar = None
    coefficient: Scalar = None
    lead_angle: Scalar = None
    pressure_angle: Scalar = None

    dimensions = {
        "speed": "angular speed",
        "efficiency": "ratio",
        "backward": "ratio",
        "coefficient": "ratio",
        "lead_angle": "angle",
        "pressure_angle": "angle",
    }
    signs = {
        "speed": "positive",
        "efficiency": "efficiency",
        "backward": "at most 1",
        "coefficient": "not negative",
        "lead_angle": "lead angle",
        "pressure_angle": "pressure angle",
    }

    def __check_init__(self):
        given = [name for name in ("efficiency", "coefficient") if getattr(self, name) is not None]
        if len(given) != 1:
            message = "gears have either an efficiency, or a coefficient of friction and a lead angle, as worms do"
            raise MechanismError(message, name="efficiency", value=self.efficiency)
        if self.coefficient is not None and self.lead_angle is None:
            message = "is missing: the efficiency of a worm follows from its coefficient and its lead angle"
            raise MechanismError(message, name="lead_angle")
        fields = ("lead_angle", "pressure_angle") if self.coefficient is None else ("backward",)
        for name in fields:
            if getattr(self, name) is not None:
                message = f"does not go with {given[0]}: leave it out"
                raise MechanismError(message, name=name, value=getattr(self, name))

    @property
    def losses(self) -> tuple[Any, Any]:
        """Shares of the transmitted torque lost at full speed: mean of forward and backward, and half the difference.

        At rest, the loss may be any torque within the mean on both sides of half the difference.
        """
        forward, backward = self.efficiencies
        forward_loss, backward_loss = 1.0 / forward - 1.0, 1.0 - backward
        return 0.5 * (forward_loss + backward_loss), 0.5 * (forward_loss - backward_loss)

    @property
    def efficiencies(self) -> tuple[Any, Any]:
        """Efficiencies if gear i drives gear j, and if gear j drives gear i."""
        if self.coefficient is None:
            return self.efficiency, self.efficiency if self.backward is None else self.backward
        xp = jnp if is_traced((self.coefficient, self.pressure_angle, self.lead_angle)) else np
        slope = self.coefficient if self.pressure_angle is None else self.coefficient / xp.cos(self.pressure_angle)
        rise = xp.tan(self.lead_angle)
        return rise * (1.0 - slope * rise) / (rise + slope), (rise - slope) / (rise * (1.0 + slope * rise))

    def resisting(self, slip: Float[Jet, "direction *batch"]) -> Float[Jet, "direction *batch"]:
        """Return the share of the lost torque that opposes the rotation of gear i."""
        return _tanh(slip / self.speed)

    def lost(self, passed: Float[Jet, "*batch"], resisting: Float[Jet, "*batch"]) -> Float[Jet, "*batch"]:
        """Return the torque lost at gear i at full speed, N m, from the transmitted torque and `resisting`.

        Without transmitted torque, the rates of the loss are not determined; those of zero are returned.
        """
        mean, difference = self.losses
        return passed * (resisting * difference + mean * jnp.sign(passed.coefficients[0]))


def friction_class(kind: type[Any]) -> type[Any]:
    """Return the friction class of a class of joints."""
    return GearFriction if hasattr(kind, "passed_on") else Friction


def _tanh_of_root(square: Jet) -> Jet:
    """Return ``tanh(x) / x`` from the square of x; smooth at zero, unlike the root."""
    is_small = square.coefficients[0] < NEAR
    small, large = (where(condition, square, 1e-2) for condition in (is_small, ~is_small))
    series = small * 0.0
    for term in _terms()[::-1]:
        series = series * small + term
    root = sqrt(large)
    return where(is_small, series, _tanh(root) / root)


def _tanh(x: Jet) -> Jet:
    """Return the hyperbolic tangent by exponentials, whose coefficients keep their digits where it saturates.

    The recurrence by ``1 - tanh^2`` loses them, and makes steps of simulations short far above the speed.
    """
    side = jnp.where(x.coefficients[0] < 0, -1.0, 1.0)
    decay = exp(x * (-2.0 * side))
    return (1.0 - decay) / (1.0 + decay) * side


def _terms() -> list[float]:
    """Return the coefficients of ``tanh(x) / x`` in powers of the square of x, from ``tanh' = 1 - tanh^2``."""
    coefficients = [1.0]
    for k in range(1, TERMS):
        coefficients.append(-sum(map(operator.mul, coefficients, coefficients[::-1])) / (2 * k + 1))
    return coefficients


def where(condition: Any, jet: Jet, other: Any) -> Jet:
    """Return a jet where a condition holds, and another jet or a constant elsewhere."""
    other_jet = other if isinstance(other, Jet) else Jet.constant(jnp.full_like(jet.coefficients[0], other), jet.order)
    pairs = zip(jet.dense().coefficients, other_jet.dense().coefficients, strict=True)
    return Jet(tuple(jnp.where(condition, a, b) for a, b in pairs))


def check_friction(joint: Any) -> None:
    """Raise MechanismError unless the friction of a joint is of the right class, with a radius if surfaces rotate."""
    friction = joint.friction
    if friction is None:
        return
    required = friction_class(type(joint))
    if not isinstance(friction, required):
        gears = "{efficiency: 0.95, speed: 1 rad/s}"
        form = gears if required is GearFriction else "{coefficient: 0.1, radius: 12 mm, speed: 1 mm/s}"
        message = f"must be a jn.joints.{required.__name__}, in a file {form}"
        raise MechanismError(message, name="friction", value=friction)
    if required is GearFriction:
        return
    if joint.has_friction_radius and friction.radius is None:
        raise MechanismError("is missing: the bodies turn, on a surface of some radius", name="friction.radius")
    if not joint.has_friction_radius and friction.radius is not None:
        message = "does not apply to a guide, whose surfaces slide and do not turn: leave it out"
        raise MechanismError(message, name="friction.radius", value=friction.radius)


def check_no_own_code(joint: Any) -> None:
    """Raise UnsupportedError for users' methods of slip, normal force or friction law.

    Such methods are not traced when a model is built, so that changes of captured numbers would go unnoticed.
    """
    friction = getattr(joint, "friction", None)
    if friction is None or not (hasattr(joint, "slip") or hasattr(joint, "passed_on")):
        return
    if not belongs_to_package(type(friction)):
        message = "a law of friction of your own is not supported: give a jn.joints.Friction, or apply a force"
        raise UnsupportedError(message, name="friction", value=type(friction).__name__)
    for name in ("slip", "pressing", "passed_on"):
        if not belongs_to_package(getattr(type(joint), name, check_no_own_code)):
            message = f"a joint of your own cannot have friction, as its `{name}` is yours: apply a force instead"
            raise UnsupportedError(message, name="friction")


def velocities(bodies: Sequence[Pose]) -> Velocities:
    """Return the velocities of bodies, one order shorter than their poses."""
    return [
        (
            b.position.differentiate(),
            b.angle.differentiate() if isinstance(b, PlanarPose) else b.global_angular_velocity(),
        )
        for b in bodies
    ]


def displacements(bodies: Sequence[Pose], changes: Sequence[Any]) -> Velocities:
    """Return displacements and rotations of bodies by variations from `varied`; None is no variation."""
    velocities = []
    for body, change in zip(bodies, changes, strict=True):
        if change is None:
            zero = Jet.constant(jnp.zeros_like(body.position.coefficients[0]), body.order)
            velocities.append((zero, zero[0] if isinstance(body, PlanarPose) else zero))
        elif isinstance(body, PlanarPose):
            velocities.append((change.position, change.angle))
        else:
            velocities.append((change.position, body.direction(body.turning(change))))
    return velocities


def slip_velocity(joint: Any, bodies: Sequence[Pose]) -> Float[Jet, "direction *batch"]:
    """Return the slip velocity of the surfaces of a joint, m/s, one order shorter than the poses."""
    return joint.slip(tuple(b.truncate(b.order - 1) for b in bodies), velocities(bodies))


def relative_turn(moving: Velocities) -> Jet:
    """Return the angular velocity of the second body relative to the first."""
    return moving[1][1] - moving[0][1]


def relative_velocity(bodies: Sequence[Pose], moving: Velocities, point_j: Any) -> Jet:
    """Return the velocity of a point of the second body relative to the first, in global components."""
    place = bodies[1].point(point_j)
    return velocity_at(bodies[1], moving[1], place) - velocity_at(bodies[0], moving[0], place)


def line_turn(bodies: Sequence[Pose], moving: Velocities, point_i: Any, point_j: Any) -> Jet:
    """Return the angular velocity of the line from a point of the first planar body to one of the second."""
    points = [body.point(point) for body, point in zip(bodies, (point_i, point_j), strict=False)]
    first, second = (
        velocity_at(body, twist, place) for body, twist, place in zip(bodies, moving, points, strict=False)
    )
    line = points[1] - points[0]
    return cross(line, second - first) / line.dot(line)


def velocity_at(body: Pose, moving: tuple[Jet, Jet], place: Jet) -> Jet:
    """Return the global velocity of the body-fixed point at a given place."""
    velocity, turning = moving
    lever = place - body.position
    if isinstance(body, PlanarPose):
        return velocity + lever.map(lambda c: jnp.stack([-c[1], c[0]])) * turning
    return velocity + turning.cross(lever)


class UnitFriction(Module):
    """Unit friction along one direction of slip, of which any friction at rest is composed.

    Parameters
    ----------
    radius : float, optional
        Radius, as in `Friction`.
    direction : int
        Index of the direction of slip.
    """

    radius: Any
    direction: int = field(static=True)

    def resisting(self, slip: Float[Jet, "direction *batch"]) -> Float[Jet, "direction *batch"]:
        """Return one in that direction, and zero in the others."""
        none = jnp.zeros_like(slip.coefficients[0])
        return Jet.constant(none.at[self.direction].set(1.0), slip.order)


def pressing_force(
    joint: Any, bodies: Sequence[Pose], force: Float[Jet, "component *batch"]
) -> Float[Jet, "direction *batch"]:
    """Return the force that presses the surfaces of a joint, N, from its global reaction on the second body.

    It is that reaction, unless the class defines `pressing`.
    """
    return force if not hasattr(joint, "pressing") else joint.pressing(bodies, force)


def normal_force(joint: Any, bodies: Sequence[Pose], force: Float[Jet, "component *batch"]) -> Float[Jet, "*batch"]:
    """Return the normal force of the surfaces of a joint, N, from its global reaction on the second body.

    It is the norm of `pressing_force`. If that is zero, its rates are not determined; those of zero are returned.
    """
    pressing = pressing_force(joint, bodies, force)
    square = pressing.dot(pressing)
    none = square.coefficients[0] == 0
    return where(~none, sqrt(where(~none, square, 1.0)), 0.0)
