"""Random states of bodies for the oracles of S and, the same numbers, as poses for the library."""

import math

import jax.numpy as jnp
import numpy as np

from jounce.jet import Jet
from jounce.rigid import PlanarPose, SpatialPose
from jounce.testing.samples import BODIES, group_of
from tests.oracles import sommer_planar, sommer_spatial

ORDER = 4
FACTORIALS = np.array([math.factorial(k) for k in range(ORDER + 1)], float)
LAW = "f0 + f1*t + f2*t**2/2 + f3*t**3/6 + f4*t**4/24"  # at t = 0 it has the derivatives f0 .. f4


def planar_state(random):
    """Return a random planar body."""
    return sommer_planar.Body(random.normal(size=(ORDER + 1, 2)), random.normal(size=ORDER + 1))


def attitude(p):
    """Return the attitude matrix of Euler parameters, by its action on vectors."""
    p = p / np.linalg.norm(p)
    return np.array([v + 2 * np.cross(p[1:], np.cross(p[1:], v) + p[0] * v) for v in np.eye(3)]).T


def spatial_state(random, p=None, w=None):
    """Return a random spatial body, and its Euler parameters; they and the body angular velocity may be given."""
    p = random.normal(size=4) if p is None else p
    w = random.normal(size=(ORDER, 3)) if w is None else w
    return sommer_spatial.Body(random.normal(size=(ORDER + 1, 3)), attitude(p), w), p / np.linalg.norm(p)


def jet_of(derivatives):
    """Return the jet with plain derivatives along the leading axis."""
    return Jet(jnp.asarray(d / math.factorial(k)) for k, d in enumerate(derivatives))


def planar_pose(*bodies):
    """Return the pose of planar bodies, shape (2, bodies, 1)."""
    position = np.stack([b.r for b in bodies], axis=-1)[..., None]
    return PlanarPose.from_jets(jet_of(position), jet_of(np.stack([b.phi for b in bodies], axis=-1)[..., None]))


def spatial_pose(*bodies_and_quaternions, order=ORDER):
    """Return the pose of spatial bodies, shape (3, bodies, 1)."""
    bodies, quaternions = zip(*bodies_and_quaternions, strict=True)
    coordinates = {
        "position": jet_of(np.stack([b.r for b in bodies], axis=-1)[: order + 1, ..., None]),
        "quaternion": Jet([jnp.asarray(np.stack(quaternions, axis=-1)[..., None])]),
        "angular_velocity": jet_of(np.stack([b.w for b in bodies], axis=-1)[:order, ..., None]),
    }
    return SpatialPose.from_coordinates(coordinates)


class Reading:
    """What the library says of one joint or driver at a state: residual, Jacobian, and right sides of S.

    Attributes
    ----------
    residual : array of shape (rows,)
    jacobian : list of array of shape (rows, 3 or 6)
        One block for each body.
    rights : array of shape (4, rows)
        nu, gamma, eta and sigma: minus k! times the k-th coefficient with the k-th unknown set to zero.
    """

    def __init__(self, element_of, states, f=None):
        self.spatial = not isinstance(states[0], sommer_planar.Body)
        count, size = len(states), 6 if self.spatial else 3
        names = BODIES[1 : 1 + count]
        parameters = {} if f is None else {f"f{k}": float(x) for k, x in enumerate(f)}
        group = group_of([element_of(names)], "spatial" if self.spatial else "planar", parameters)
        lanes = ORDER + count * size  # lane k - 1: order k unknown; then one lane for each column of the Jacobian
        pose = self._pose(states, count, size, lanes)
        running = np.concatenate([np.ones(ORDER), np.zeros(count * size)])
        time = Jet((jnp.zeros((1, lanes)), jnp.asarray(running)[None], *[None] * (ORDER - 1)))
        values = np.array(group.residual(pose, time).dense().coefficients)[:, :, 0]
        self.residual = values[0, :, 0]
        self.rights = np.stack([-FACTORIALS[k] * values[k, :, k - 1] for k in range(1, ORDER + 1)])
        columns = values[1, :, ORDER:]
        self.jacobian = [columns[:, size * b : size * (b + 1)] for b in range(count)]

    def _pose(self, states, count, size, lanes):
        bodies = [s[0] for s in states] if self.spatial else states
        shifts = 3 if self.spatial else 2
        position = self._coefficients([b.r for b in bodies], lanes)
        turns = [np.concatenate([np.zeros((1, 3)), b.w]) if self.spatial else b.phi[:, None] for b in bodies]
        turn = self._coefficients(turns, lanes)
        for k in range(1, ORDER + 1):
            position[k, ..., k - 1] = 0
            turn[k, ..., k - 1] = 0
        position[1:, ..., ORDER:] = 0
        turn[1:, ..., ORDER:] = 0
        for b in range(count):
            for c in range(size):
                lane = ORDER + b * size + c
                (position[1, c] if c < shifts else turn[1, c - shifts])[b, lane] = 1.0
        position, turn = (np.pad(x, ((0, 0), (0, 0), (1, len(BODIES) - 1 - count), (0, 0))) for x in (position, turn))
        jets = [Jet(map(jnp.asarray, x)) for x in (position, turn)]
        if not self.spatial:
            return PlanarPose.from_jets(jets[0], jets[1][0])
        p = np.tile(np.array([1.0, 0, 0, 0])[:, None, None], (1, len(BODIES), lanes))
        for b, (_, quaternion) in enumerate(states, start=1):
            p[:, b] = quaternion[:, None]
        rate = Jet(jnp.asarray(k * x) for k, x in enumerate(turn) if k)  # turn[k] holds w'[k-1] / k
        return SpatialPose.from_coordinates(
            {"position": jets[0], "quaternion": Jet([jnp.asarray(p)]), "angular_velocity": rate}
        )

    def _coefficients(self, derivatives, lanes):
        whole = np.stack(derivatives, axis=-1) / FACTORIALS[:, None, None]
        return np.repeat(whole[..., None], lanes, axis=-1)
