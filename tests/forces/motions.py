"""Poses of bodies that move by the functions of the oracle."""

import jax
import jax.numpy as jnp
import numpy as np

import jounce as jn
from jounce.execution.compilation import compiler_options
from jounce.mechanism import build
from jounce.rigid import PlanarPose, SpatialPose
from tests.oracles.mp_wrenches import Moving, rates

INSTANT = 0.7
ORDER = 3


def moving_bodies(seed, components, count=2):
    rng = np.random.default_rng(seed)
    return [Moving.random(rng, components) for _ in range(count)]


def jet_of(function):
    """Return the jet of a list of functions, shape (components, 1)."""
    return jn.Jet.from_derivatives(np.array(rates(function, INSTANT, ORDER))[..., None])


def pose_of(bodies, components):
    """Return the pose of the ground and of moving bodies, shape (..., bodies, 1)."""
    position = [jet_of(lambda t, b=b: [x(t) for x in b.position[:components]]) for b in bodies]
    position = _together([position[0] * 0.0, *position])
    if components == 2:
        angle = [jet_of(lambda t, b=b: [b.angles[0](t)]) for b in bodies]
        return PlanarPose.from_jets(position, _together([angle[0] * 0.0, *angle])[0])
    spin = [jet_of(lambda t, b=b: b.seen(b.spin(t), t)).truncate(ORDER - 1) for b in bodies]
    quaternion = [_quaternion(np.array(b.attitude(INSTANT).tolist(), float)) for b in bodies]
    quaternion = jnp.stack([jnp.array([1.0, 0, 0, 0]), *quaternion], axis=1)[..., None]
    jets = {"position": position, "quaternion": jn.Jet([quaternion, *[None] * ORDER])}
    return SpatialPose.from_coordinates(jets | {"angular_velocity": _together([spin[0] * 0.0, *spin])})


def _together(jets):
    columns = zip(*(jet.dense().coefficients for jet in jets), strict=True)
    return jn.Jet([jnp.stack(column, axis=1) for column in columns])


def _quaternion(attitude):
    """Return Euler parameters of a matrix whose trace is not near -1."""
    e0 = np.sqrt(1 + np.trace(attitude)) / 2
    skew = attitude - attitude.T
    return jnp.array([e0, skew[2, 1] / (4 * e0), skew[0, 2] / (4 * e0), skew[1, 0] / (4 * e0)])


def system_of(forces, components, parameters=()):
    """Return the system of two free bodies, a and b, with forces."""
    origin = [0.0] * components
    mechanism = jn.Mechanism(
        space="planar" if components == 2 else "spatial",
        bodies={"a": jn.Body(origin), "b": jn.Body(origin)},
        joints={},
        forces=forces,
        parameters=dict(parameters),
    )
    model = build(mechanism)
    return model.system, model


def applied(system, pose):
    """Return the plain derivatives of the generalized forces, shape (order, coordinates, bodies)."""
    time = jn.Jet.variable(jnp.full((1, 1), INSTANT), pose.order)
    return np.asarray(quickly(lambda p: system.applied_forces(p, time).derivatives())(pose))[..., 0]


def quickly(function):
    """Compile as the solvers do, in half the time."""
    return jax.jit(function, compiler_options=compiler_options())
