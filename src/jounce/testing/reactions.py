"""Equilibrium of the reactions of joints and drivers, and of forces, along random motions with random multipliers.

The motions do not fulfill the constraints, so the checks do not depend on the solution of a mechanism.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from jounce.constraints.base import ROLES
from jounce.dynamics.inverse.motion_forces import MotionForces
from jounce.jet import Jet
from jounce.kinematics import Motion
from jounce.mechanism import Body, Mechanism, build
from jounce.testing.samples import BODIES, INDEX, INSTANT, pose_of, random_motion
from jounce.testing.subject import Subject

RATES = 1  # checked derivatives of reactions


def equilibrium(subject: Subject) -> None:
    """Check that the reactions of a joint have no resultant, and that their power is that of the multipliers."""
    random = subject.random()
    element = subject.samples.element(random)
    pose, forces = acting({"joint": element}, subject.space, RATES, random)
    spins = spins_of(pose)
    exerted = resultant(forces, "joint", element, pose, random, spins)
    size = max(exerted.size, 1e-300)
    subject.same(exerted.force / size, 0 * exerted.force, 1e-13, "the reactions have a resultant force")
    subject.same(exerted.moment / size, 0 * exerted.moment, 1e-12, "the reactions have a resultant moment")
    power, scale = power_of_element(forces, "joint", element, pose), size * np.abs(spins).max()
    message = "the power of the reactions is not that of the multipliers on the residual"
    subject.same(exerted.power / scale, power / scale, 1e-12, message)


class Resultant(NamedTuple):
    """The resultant of a joint, driver or force on all its bodies, as Taylor coefficients, the levels first.

    Attributes
    ----------
    force, moment : array
        Resultant force, and moment about the origin.
    power : array
        Power supplied to the bodies.
    size : float
        Magnitude of the largest contribution.
    """

    force: Any
    moment: Any
    power: Any
    size: float


def acting(
    elements: Mapping[str, Any], space: str, rates: int, random: np.random.Generator
) -> tuple[Any, MotionForces]:
    """Return the pose of four bodies in a random motion, and the forces between them with random multipliers."""
    roles = {role: {n: e for n, e in elements.items() if (e.role or "joint") == role} for role in ROLES}
    mechanism = Mechanism(
        space=space,
        bodies={name: Body([0.0] * (2 if space == "planar" else 3), mass=1.0) for name in BODIES[1:]},
        joints=roles["joint"],
        drivers=roles["driver"],
        forces=roles["force"],
    )
    model = build(mechanism)
    series = random_motion(random, space, rates + 2, degree=3)
    pose = pose_of({name: _with_carriages(x, len(mechanism.bodies) - len(BODIES) + 1) for name, x in series.items()})
    coordinates = {name: np.stack(jet.dense().coefficients) for name, jet in pose.coordinates().items()}
    motion = Motion(mechanism, model, np.array([INSTANT]), rates + 2, (coordinates, ()), np.zeros(1, int), {})
    forces = MotionForces(motion)
    rows = len(model.rows)
    balancing = random.normal(size=(1, rates + 1, rows + len(forces.friction.names), 1))
    forces.__dict__ |= {"_balancing": balancing, "multipliers": balancing[0, :, :rows]}
    return pose, forces


def _with_carriages(series: np.ndarray, count: int) -> np.ndarray:
    """Return the motion of bodies and carriages; carriages rest at the start of the last body."""
    still = np.zeros_like(series[..., -1:, :])
    still[0] = series[0, ..., -1:, :]
    return np.concatenate([series, *[still] * count], axis=-2)


def spins_of(pose: Any) -> np.ndarray:
    """Return Taylor coefficients of the angular velocities of all bodies, (levels, components, bodies, batch)."""
    planar = hasattr(pose, "angle")
    spins = pose.angle.differentiate().map(lambda c: c[None]) if planar else pose.global_angular_velocity()
    return np.stack(spins.dense().coefficients)


def resultant(
    forces: MotionForces, name: str, element: Any, pose: Any, random: np.random.Generator, spins: np.ndarray
) -> Resultant:
    """Return the resultant of a joint, driver or force, from moments about random points of bodies and the ground."""
    force: Any = 0.0
    moment: Any = 0.0
    power: Any = 0.0
    size = 0.0
    load = element.role == "force" and len(element.bodies) == 1
    bodies = element.bodies if load else (*element.bodies, "ground")
    for body in dict.fromkeys(bodies):
        point, index = random.uniform(-1, 1, len(pose.position.coefficients[0])), INDEX[body]
        place = pose.take((index,)).point(point[:, None, None])
        path, speed = (np.stack(x.dense().coefficients)[..., 0] for x in (place, place.differentiate()))
        part, turning = (np.asarray(x) for x in forces.reaction(name, index, None, point))
        lever = convolved(cross, path, part)
        force, moment = force + part, moment + turning + lever
        power = power + convolved(scalar, part, speed) + convolved(scalar, turning, spins[:, :, index])
        size = max(size, *(float(np.abs(x).max()) for x in (part, turning, lever)))
    return Resultant(force, moment, power, size)


def power_of_element(forces: MotionForces, name: str, element: Any, pose: Any) -> np.ndarray:
    """Return Taylor coefficients of the power that a joint, driver or force supplies to all bodies, (levels, time)."""
    clock = Jet.variable(np.full((1, 1), INSTANT), pose.order)
    if element.role == "force":
        index, instance = forces._force_index(name)
        power = forces.model.system.forces[index].power(pose, clock)
        return np.stack(power.dense().coefficients)[: forces.levels, instance]
    place, frozen = forces.indices[name], Jet.constant(clock.coefficients[0], pose.order)
    rate = forces.model.system.groups[place.group].residual(pose, frozen).differentiate()
    rates = np.stack(rate.dense().coefficients)[:, :, place.instance]
    power = -convolved(scalar, forces.multipliers[:, list(place.own_rows)], rates)
    if name in forces.friction.names:
        taken = forces.friction.resisted(place.group)[:, place.instance, :1]
        power = power - convolved(scalar, forces.friction.normal_force(name), taken[:, None])
    return power


def convolved(product: Callable[..., Any], a: Any, b: Any) -> np.ndarray:
    """Return Taylor coefficients of a product of series, the levels first."""
    return np.stack([sum(product(a[j], b[k - j]) for j in range(k + 1)) for k in range(min(len(a), len(b)))])


def cross(a: Any, b: Any) -> Any:
    """Return the vector product along the first axis, in the plane its third component."""
    return np.cross(a, b, axis=0) if len(a) == 3 else (a[0] * b[1] - a[1] * b[0])[None]


def scalar(a: Any, b: Any) -> Any:
    """Return the scalar product along the first axis."""
    return (a * b).sum(axis=0)
