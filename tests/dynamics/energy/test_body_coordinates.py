"""Equations of motion from energies where drivers do not prescribe all that moves: in the coordinates of the bodies."""

import numpy as np
import pytest

import jounce as jn
from jounce.dynamics import (
    gibbs_appell,
    gravity_forces,
    higher_order,
    lagrange,
    mangeron_nielsen,
    newton_euler,
    virtual_work,
)
from tests.problems.mechanisms import example

TIMES = [0.0, 0.2, 0.5]
FORMS = {
    "mangeron": lambda motion: mangeron_nielsen(motion, m=2)[:, 0],
    "gibbs": lambda motion: gibbs_appell(motion)[:, 0],
    "gibbs_4": lambda motion: gibbs_appell(motion, m=4)[:, 0],
    "higher": lambda motion: higher_order(motion, k=1, m=3),
    "newton": lambda motion: newton_euler(motion)[:, 0],
    "work": lambda motion: virtual_work(motion)[:, 0],
}


def puck():
    """A body that its spring pulls across a plane, its center of mass off its origin."""
    return jn.Mechanism(
        space="planar",
        gravity=[0.0, -9.81],
        bodies={"puck": jn.Body([0.3, 0.1], angle=0.4, mass=2.0, inertia=0.3, center_of_mass=[0.1, -0.05])},
        joints={},
        forces={"pull": jn.forces.Spring(("ground", "puck"), [0, 0], [0.2, 0.1], stiffness=40.0, length=0.2)},
    )


def close(found, expected, size=1e-11):
    np.testing.assert_allclose(found, expected, rtol=0, atol=size * np.abs(expected).max())


@pytest.mark.slow
def test_a_free_body_feels_weight_and_spring():
    """By their closed forms, and by all forms of the equations alike."""
    motion = jn.simulate(puck(), TIMES)
    found = lagrange(motion, rates=1)
    assert found.column.values.tolist() == ["puck.x", "puck.y", "puck.angle"]
    assert found.unit.values.tolist() == ["N", "N", "N*m"]
    equations = jn.constraint_equations(motion)
    place, angle = equations.position.values[:, 0], equations.angle.values[:, 0]
    cosine, sine = np.cos(angle), np.sin(angle)

    def turned(x, y):
        return np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)

    end, arm = place + turned(0.2, 0.1), turned(0.1, -0.05)
    length = np.linalg.norm(end, axis=1, keepdims=True)
    pull = -40.0 * (length - 0.2) * end / length
    weight = np.array([0.0, -2.0 * 9.81])
    lever = end - place
    moment = lever[:, 0] * pull[:, 1] - lever[:, 1] * pull[:, 0] + arm[:, 0] * weight[1]
    close(found[:, 0].values, np.column_stack([pull + weight, moment]))
    for form in FORMS.values():
        close(form(motion).values, found[:, 0].values)
    close(higher_order(motion, k=2).values, found[:, 1].values)
    further = lagrange(motion, rates=2)
    for balance in (newton_euler(motion, rates=2), virtual_work(motion, rates=2)):
        assert balance.column.equals(found.column)
        assert balance.unit.equals(found.unit)
        for rate in (1, 2):
            close(balance[:, rate].values, further[:, rate].values)
    held = gravity_forces(motion, rates=1)
    close(held[:, 0].values, -np.column_stack([np.tile(weight, (3, 1)), arm[:, 0] * weight[1]]))
    speed = equations.velocities.sel(derivative=1).values[:, 2]
    turning = 2.0 * 9.81 * turned(0.05, 0.1)[:, 0] * speed  # of the center of mass about the origin
    close(held[:, 1].values, np.column_stack([np.zeros((3, 2)), turning]))
    for form in (lagrange, newton_euler):
        with pytest.raises(jn.errors.MechanismError, match="order: this needs a motion of order"):
            form(motion, rates=9)


@pytest.mark.parametrize(
    "name", ["double_pendulum", *(pytest.param(x, marks=pytest.mark.slow) for x in ("andrews", "flyball_governor"))]
)
def test_inertia_and_constraints_balance_what_is_applied(name):
    """``Q + Phi_q^T lambda`` is what is applied, which works at the rate of the kinetic energy."""
    motion = jn.simulate(jn.load(example(name)), np.linspace(0, 0.02, 3))
    equations = jn.constraint_equations(motion)
    inertia = lagrange(motion, rates=1)
    power = (inertia[:, 0].values * equations.velocities.sel(derivative=1).values).sum(axis=1)
    energy = jn.energy.kinetic_energy(motion).total
    close(power, energy.values[:, 1])
    for form in FORMS.values():
        close(form(motion).values, inertia[:, 0].values)
    jacobian, multipliers = equations.jacobian.values, equations.multipliers.values[:, 0]
    applied = inertia[:, 0].values + np.einsum("trc,tr->tc", jacobian, multipliers)
    bodies = motion.mechanism.bodies
    if name == "double_pendulum":  # weight alone
        for k, body in enumerate(bodies.values()):
            close(applied[:, 3 * k + 1], np.full(3, -9.81 * float(body.mass)))


@pytest.mark.slow
def test_a_free_body_in_space():
    """Euler's equations about the origin, and the same by all forms; slopes are those of turns away from the motion."""
    tensor = np.array([[0.5, 0.02, -0.01], [0.02, 0.4, 0.03], [-0.01, 0.03, 0.3]])
    body = jn.Body([0, 0, 0], mass=2.0, inertia=tensor.tolist(), center_of_mass=[0.1, 0.2, -0.1])
    spring = jn.forces.Spring(("ground", "top"), [0, 0, 1], [0.2, 0.3, 0.1], stiffness=30.0, length=0.1)
    top = jn.Mechanism(space="spatial", gravity=[0, 0, -9.81], bodies={"top": body}, joints={}, forces={"pull": spring})
    motion = jn.simulate(top, TIMES)
    equations = jn.constraint_equations(motion)
    found = lagrange(motion)[:, 0].values
    mass, velocities = equations.mass_matrix.values, equations.velocities
    second, w = velocities.sel(derivative=2).values, velocities.sel(derivative=1).values[:, 3:]
    center = np.array([0.1, 0.2, -0.1])
    about = tensor + 2.0 * (center @ center * np.eye(3) - np.outer(center, center))
    from scipy.spatial.transform import Rotation

    turns = Rotation.from_quat(equations.attitude.values[:, 0, [1, 2, 3, 0]])
    bias = np.hstack([turns.apply(2.0 * np.cross(w, np.cross(w, center))), np.cross(w, w @ about)])
    close(found, np.einsum("tij,tj->ti", mass, second) + bias)
    further = lagrange(motion, rates=2)
    for rate in (1, 2):
        close(newton_euler(motion, rates=2)[:, rate].values, further[:, rate].values)
    weight = turns.inv().apply([0.0, 0.0, 2.0 * 9.81])
    held = np.hstack([np.tile([0.0, 0.0, 2.0 * 9.81], (3, 1)), np.cross(center, weight)])
    close(gravity_forces(motion)[:, 0].values, held)
    for form in FORMS.values():
        close(form(motion).values, found, 1e-10)
