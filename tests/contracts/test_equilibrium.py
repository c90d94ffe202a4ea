"""Laws of equilibrium: what is exerted has no resultant, and momentum changes by what is applied and by the ground.

Both hold with their rates. The second shares nothing with reactions but the motion.
"""

import dataclasses
import math

import numpy as np
import pytest

import jounce as jn
from jounce import drivers, forces, planar, spatial
from jounce.constraints.base import ROLES, catalogue
from jounce.testing.reactions import acting, convolved, cross, power_of_element, resultant, spins_of
from jounce.testing.samples import BODIES
from tests.constraints.test_wheels import sleigh
from tests.contracts.test_frames import MECHANISMS, TURNED
from tests.problems.bank import OWN

pytestmark = pytest.mark.long

RATES = 4
RATES_OF_ONE = {"planar": RATES, "spatial": 2}  # of a joint alone: in space, angles about axes compile long
ORDER = RATES + 2  # of motions: forces use up two
FEWER = 3  # of motions that compile long


class OwnRatio(jn.joints.AbstractConstraint, space="planar"):
    """A place along x that follows the product of a height over a line and the angle of another body, all global."""

    def residual(self, body_i, body_j, time):
        return body_j.position[0] - body_i.angle * (0.5 + body_j.position[1])


class OwnPush(jn.forces.AbstractForce, space="planar"):
    """A force along x by how far a point of one body is beyond the origin of another."""

    point_j: jn.joints.Vector

    def displacement(self, body_i, body_j, time):
        return body_j.point(self.point_j)[0] - body_i.position[0]

    def force(self, displacement, velocity, time):
        return time - 3.0 * displacement - 0.2 * velocity


class OwnHeight(jn.joints.AbstractConstraint, space="spatial"):
    """A height over the ground by the way that another body has gone along x."""

    def residual(self, body_i, body_j, time):
        return body_j.position[2] - 0.3 * body_i.position[0]


def by_coordinates():
    """Joints and drivers of the plane by coordinates of single bodies, in each form, and own ones."""
    found = {f"coordinate_{word}": planar.Coordinate(BODIES[1:3], word, 0.4) for word in ("angle", "x", "y")}
    found |= {f"driver_{word}": drivers.CoordinateDriver(BODIES[1:3], word, "t", 0.4) for word in ("angle", "x", "y")}
    return found | {"own": OwnRatio(BODIES[1:3]), "parabola": OWN(BODIES[1:3], [0.3, -0.2], 0.7)}


def is_carried(element):
    """Gears and belts on bodies that others carry, and teeth, which press apart: right in whole mechanisms only."""
    toothed = isinstance(element, planar.Belt) or (isinstance(element, planar.Gear) and element.ratio is None)
    return toothed or isinstance(element, spatial.Gear) or getattr(element, "pressure_angle", None) is not None


def subjects(space):
    """Every joint, driver and force of the catalogue in all its forms, and own ones: each from one moving body to the
    next, and with one of its bodies the ground.
    """
    if space == "planar":
        found = by_coordinates() | {"push": OwnPush(BODIES[1:3], [0.5, 0.2])}
    else:
        rack = dataclasses.replace(MECHANISMS["shafts"]().joints["teeth"], pressure_angle=None, friction=None)
        found = {"own": OwnHeight(BODIES[1:3]), "rack": rack, "wheel": sleigh(TURNED).joints["track"]}
    for mechanism in (make() for make in MECHANISMS.values()):
        if mechanism.space == space:
            given = {**mechanism.joints, **mechanism.drivers, **mechanism.forces}
            given = {name: element for name, element in given.items() if not is_carried(element)}
            found |= {f"{name}_{len(found)}": element for name, element in given.items()}
    placed = {}
    for name, element in found.items():
        count = len(element.bodies)
        places = {"": BODIES[1 : 1 + count]}
        if count > 1:
            places |= {"_from_ground": BODIES[:count], "_to_ground": (*BODIES[2 : 1 + count], BODIES[0])}
        for word, bodies in places.items():
            placed[name + word] = dataclasses.replace(element, bodies=bodies)
    return placed


@pytest.mark.slow
@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_what_is_exerted_has_no_resultant_and_the_power_of_what_it_works_on(space):
    """About the origin, from moments about random points of all bodies, the ground among them.

    The power on the bodies is that of the multipliers on the residual with its law held, and of the forces.
    """
    random = np.random.default_rng(5)
    elements, rates = subjects(space), RATES_OF_ONE[space]
    pose, found = acting(elements, space, rates, np.random.default_rng(3))
    missing = {kind for role in ROLES for kind in catalogue(space, role).values()} - {spatial.Gear, planar.Belt}
    spins = spins_of(pose)
    for name, element in elements.items():
        exerted = resultant(found, name, element, pose, random, spins)
        size = exerted.size
        assert size > 1e-3, name
        assert exerted.power.shape[0] == rates + 1
        if element.role != "force" or len(element.bodies) > 1:
            assert np.abs(exerted.force).max() <= 1e-13 * size, name
            assert np.abs(exerted.moment).max() <= 1e-12 * size, name
        expected, bound = power_of_element(found, name, element, pose), 1e-12 * size * np.abs(spins).max()
        np.testing.assert_allclose(exerted.power, expected, rtol=0, atol=bound, err_msg=name)
        missing.discard(type(element))
    assert not missing


def pair():
    """A pinion and a rack by ratios alone, unbalanced, a lift by its height, and a spring and a wind."""
    massive = {"mass": 1.3, "inertia": 0.2, "center_of_mass": [0.1, -0.05]}
    return jn.Mechanism(
        space="planar",
        gravity=[0.3, -9.81],
        bodies={
            "pinion": jn.Body([0.2, 0.1], **massive),
            "wheel": jn.Body([0.5, 0.1], **massive),
            "rack": jn.Body([0.0, 0.4], **massive),
            "lift": jn.Body([-1.0, 0.3], **massive),
        },
        joints={
            "A": planar.Revolute(("ground", "pinion"), [0.2, 0.1], [0, 0]),
            "B": planar.Revolute(("ground", "wheel"), [0.5, 0.1], [0, 0]),
            "guide": planar.Prismatic(("ground", "rack"), [0, 0.4], [0, 0], [1, 0], [1, 0]),
            "mesh": planar.Coordinate(("pinion", "wheel"), "angle", -0.5),
            "teeth": planar.Coordinate(("pinion", "rack"), "x", -0.1),
            "post": planar.Prismatic(("ground", "lift"), [-1, 0], [0, 0], [0, 1], [0, 1]),
        },
        drivers={
            "motor": drivers.CoordinateDriver(("ground", "pinion"), "angle", "2*t + sin(3*t)"),
            "hoist": drivers.CoordinateDriver(("ground", "lift"), "y", "0.3 + 0.1*sin(2*t)"),
        },
        forces={
            "spring": forces.Spring(("ground", "lift"), [0, 0], [0.1, 0], 50.0, 0.4, 2.0),
            "wind": forces.PointForce("rack", [0.1, 0.2], ["t - x", "0.3 - vx"]),
        },
    )


def falling():
    """The same without motor and hoist: it moves by its weight."""
    driven = pair()
    start = {name: dataclasses.replace(driver, motion="0.3") for name, driver in driven.drivers.items()}
    return dataclasses.replace(driven, drivers={}, initial=start)


def loop():
    """A robot of rods on hinges with springs whose loop is closed, one half out of gravity, as a mechanism."""
    rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0.01, 1 / 12, 1 / 12])
    links = [jn.Link("base"), *(jn.Link(name, rod) for name in ("crank", "rod")), jn.Link("rocker", rod, gravity=0.4)]
    held = {"stiffness": 3.0, "spring_reference": 0.2, "damping": 0.3}
    joints = [jn.Joint("A", "base", "crank", **held), jn.Joint("B", "crank", "rod", position=[1, 0, 0], **held)]
    joints.append(jn.Joint("D", "base", "rocker", position=[1, 1, 0], **held))
    tip = jn.robot.Closure("C", ("rod", "rocker"), points=[[1, 0, 0], [1, 0, 0]])
    robot = jn.Robot("four-bar", links, joints, gravity=[1.0, -9.0, -2.0], closures=[tip])
    spring = forces.Spring(("ground", "rod"), [0, 2, 0.3], [0.4, 0.1, 0], 20.0, 1.0, 0.5)
    return robot.mechanism({"B": 0.4}, drivers={"A": "0.1 + 0.4*sin(t)"}, forces={"spring": spring})


MOTIONS = {
    "pair": lambda: jn.solve(pair(), [0.1, 0.7], ORDER),
    "pair that falls": lambda: jn.simulate(falling(), [0.0, 0.2], order=ORDER),
    "plane": lambda: jn.solve(MECHANISMS["plane"](), [0.0, 0.3, 0.8], ORDER),
    "teeth": lambda: jn.solve(MECHANISMS["teeth"](), [0.0, 0.3, 0.8], ORDER),
    "lines": lambda: jn.solve(MECHANISMS["lines"](), [0.0, 0.3, 0.8], ORDER),
    "shafts": lambda: jn.solve(MECHANISMS["shafts"](), [0.0, 0.3, 0.8], ORDER),
    "cams": lambda: jn.solve(MECHANISMS["cams"](), [0.0, 0.3, 0.8], FEWER),
    "wheels": lambda: jn.simulate(sleigh(TURNED), [0.0, 0.4, 1.1], order=FEWER),
    "robot with a loop": lambda: jn.solve(loop(), [0.0, 0.8], ORDER),
}


@pytest.mark.parametrize("name", ["pair", *(pytest.param(name, marks=pytest.mark.slow) for name in [*MOTIONS][1:])])
def test_momentum_changes_by_what_is_applied_and_what_the_ground_gives(name):
    motion = MOTIONS[name]()
    assert (motion.status == 0).all()
    point = np.array([0.3, -0.2, 0.4])[: 2 if motion.mechanism.space == "planar" else 3]
    ground = [taylor(x.values) for x in dataclasses.astuple(jn.dynamics.ground_reaction(motion, point))]
    levels = len(ground[0])
    fewer = name in ("cams", "wheels")  # those of cams have outputs of forces: two more orders
    assert levels == (FEWER if fewer else RATES) + 1
    changes, applied = balance_of_bodies(motion, point), loads(motion, point, levels)
    for whole, load, part in zip(changes, applied, ground, strict=True):
        change = whole[:levels]
        size = np.abs(change).max(axis=(1, 2)) + np.abs(load).max(axis=(1, 2)) + np.abs(part).max(axis=(1, 2))
        assert (size > 0).all()
        assert (np.abs(change - load + part).max(axis=(1, 2)) <= 1e-11 * np.maximum.accumulate(size)).all()
    total = np.zeros_like(ground[0])
    given = {**motion.mechanism.joints, **motion.mechanism.drivers, **motion.mechanism.forces}
    for word, element in given.items():
        if not isinstance(element, forces.PointForce | forces.Moment):
            total = total + taylor(jn.joint_reaction(motion, word, "ground").force.values)
    np.testing.assert_allclose(total, ground[0], atol=1e-12 * np.abs(total).max())


def taylor(derivatives):
    """Taylor coefficients, (levels, components, time), from plain derivatives, the time first; those of forces."""
    found = np.moveaxis(derivatives, 0, -1)[: RATES + 1]
    factorials = np.array([math.factorial(k) for k in range(len(found))])
    return (found / factorials.reshape(-1, *[1] * (found.ndim - 1))).reshape(len(found), -1, len(derivatives))


def rate(series):
    """Taylor coefficients of the rate of a series."""
    return series[1:] * np.arange(1, len(series)).reshape(-1, *[1] * (series.ndim - 1))


def attitudes(motion):
    """Taylor coefficients of the attitude matrices of all bodies, (levels, c, c, bodies, time), from angles or Euler
    parameters alone.
    """
    coordinates = motion.poses[1]
    if "angle" in coordinates:
        angle = np.asarray(coordinates["angle"])
        turn = [np.exp(1j * angle[0])]
        for k in range(1, len(angle)):
            turn.append(sum(1j * j * angle[j] * turn[k - j] for j in range(1, k + 1)) / k)
        turn = np.array(turn)
        return np.stack([np.stack([turn.real, -turn.imag], 1), np.stack([turn.imag, turn.real], 1)], 1)
    e = np.moveaxis(np.asarray(coordinates["quaternion"]), 1, 0)

    def p(i, j):
        return convolved(np.multiply, e[i], e[j])

    rows = [
        [p(0, 0) + p(1, 1) - p(2, 2) - p(3, 3), 2 * (p(1, 2) - p(0, 3)), 2 * (p(1, 3) + p(0, 2))],
        [2 * (p(1, 2) + p(0, 3)), p(0, 0) - p(1, 1) + p(2, 2) - p(3, 3), 2 * (p(2, 3) - p(0, 1))],
        [2 * (p(1, 3) - p(0, 2)), 2 * (p(2, 3) + p(0, 1)), p(0, 0) - p(1, 1) - p(2, 2) + p(3, 3)],
    ]
    return np.stack([np.stack(row, 1) for row in rows], 1)


def balance_of_bodies(motion, point):
    """Taylor coefficients of the rates of momentum, and of angular momentum about a fixed point, less their weights.

    Momentum is that of mass elements: of a body with second moments S about its center, ``x x'^T`` sums up to
    ``A S A'^T`` besides that of the center.
    """
    size = len(point)
    turned, origins = attitudes(motion), np.asarray(motion.poses[1]["position"])
    gravity = np.asarray(motion.mechanism.gravity)[:, None]
    force, moment = (np.zeros((1, count, 1)) for count in (size, 1 if size == 2 else 3))
    for k, body in enumerate(motion.mechanism.bodies.values(), start=1):
        if body.mass is None:  # such as a bead
            continue
        matrix, center = (
            turned[:, :, :, k],
            np.zeros(size) if body.center_of_mass is None else np.asarray(body.center_of_mass),
        )
        path = origins[:, :, k] + np.einsum("lijt,j->lit", matrix, center)
        path[0] -= point[:, None]
        push = rate(rate(path)) * body.mass
        push[0] -= body.mass * gravity
        if size == 2:
            spread = np.eye(2) * body.inertia / 2
        else:
            inertia = np.asarray(body.inertia)
            inertia = np.diag(inertia) if inertia.ndim == 1 else inertia
            spread = np.trace(inertia) / 2 * np.eye(3) - inertia
        spread = np.einsum("lijt,jk->likt", matrix, spread)
        turning = convolved(lambda a, b: np.einsum("ijt,kjt->ikt", a, b), spread, rate(rate(matrix)))
        axes = [(0, 1)] if size == 2 else [(1, 2), (2, 0), (0, 1)]
        spin = np.stack([turning[:, i, j] - turning[:, j, i] for i, j in axes], axis=1)
        force, moment = force + push, moment + convolved(cross, path, push) + spin
    return force[: RATES + 1], moment[: RATES + 1]


def loads(motion, point, levels):
    """Taylor coefficients of the total force and moment of the loads on single bodies, which come from outside."""
    turned, size = attitudes(motion), len(point)
    force = np.zeros((levels, size, len(motion.time)))
    moment = np.zeros((levels, 1 if size == 2 else 3, len(motion.time)))
    for name, load in motion.mechanism.forces.items():
        if len(load.bodies) > 1:
            continue
        push = taylor(jn.dynamics.applied_force(motion, name).values)
        index = [*motion.mechanism.bodies].index(load.bodies[0]) + 1
        matrix = turned[:, :, :, index]
        if getattr(load, "frame", "") == "body":
            push = convolved(lambda a, b: np.einsum("ijt,jt->it", a, b), matrix, push)
        if load.unit == "N*m":
            moment = moment + push
            continue
        path = np.asarray(motion.poses[1]["position"])[:, :, index] + np.einsum("lijt,j->lit", matrix, load.point)
        path[0] -= point[:, None]
        force, moment = force + push, moment + convolved(cross, path, push)
    return force, moment
