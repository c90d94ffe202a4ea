"""Mass matrices of bodies, against the forces of inertia that they have when they begin to move."""

import numpy as np
import pytest

from jounce.dynamics.forward.loads import inertia_forces, mass_matrices
from jounce.dynamics.masses import Masses
from jounce.jet import Jet
from jounce.rigid import PlanarPose, SpatialPose
from tests.problems.robots import random_inertia

BODIES, BATCH = 3, 4
RANDOM = np.random.default_rng(3)


def masses_in(size):
    """Return the masses of bodies of several parts each, of which the last has no size and the first no mass."""
    bodies = [random_inertia(RANDOM) for _ in range(BODIES)]
    center = np.stack([np.asarray(body.center_of_mass)[:size] for body in bodies], axis=-1)
    tensors = [np.asarray(body.tensor) for body in bodies]
    moments = np.stack([(0.5 * np.trace(t) * np.eye(3) - t)[:size, :size] for t in tensors], axis=-1)
    moments[..., -1] = 0.0
    mass = np.array([0.0, bodies[1].mass, bodies[2].mass])
    moments[..., 0] = 0.0
    return Masses(mass[:, None], center[..., None], moments[..., None])


def at_rest(kind):
    if kind is PlanarPose:
        return PlanarPose.from_jets(*(Jet(RANDOM.normal(size=(1, *shape, BODIES, BATCH))) for shape in ((2,), ())))
    return SpatialPose.at(*(RANDOM.normal(size=(size, BODIES, BATCH)) for size in (3, 4)))


@pytest.mark.parametrize("kind", [PlanarPose, SpatialPose])
def test_mass_matrices_are_how_forces_of_inertia_follow_accelerations(kind):
    pose = at_rest(kind)
    masses, split = masses_in(pose.shifts), pose.shifts
    found = np.asarray(mass_matrices(pose, masses))
    size = split + pose.turns
    assert found.shape == (size, size, BODIES, BATCH)
    still = np.zeros((size, BODIES, BATCH))
    for k, direction in enumerate(np.eye(size)):
        unit = np.broadcast_to(direction[:, None, None], still.shape)
        moving = pose.extended(still[:split], still[split:]).extended(0.5 * unit[:split], 0.5 * unit[split:])
        force, moment = inertia_forces(moving, masses, 0.0)
        expected = np.concatenate([force.coefficients[0], moment.coefficients[0]])
        np.testing.assert_allclose(found[:, k], expected, rtol=0, atol=1e-14)
