"""Code that was written, run and compared with the equations as numbers."""

import numpy as np

import jounce as jn
from jounce.dynamics.forward.mechanism_state import at_state


def random_states(mechanism, order, random):
    """Return a random state of all bodies, with so many derivatives, which fulfills no joint."""
    components = 2 if mechanism.space == "planar" else 3
    state = {}
    for name in mechanism.bodies:
        position = random.uniform(-1, 1, (order + 1, components))
        if components == 2:
            state[name] = {"position": position, "angle": random.uniform(-1, 1, order + 1)}
            continue
        quaternion = random.normal(size=4)
        quaternion /= np.linalg.norm(quaternion)
        spin = random.uniform(-1, 1, (order, 3))
        state[name] = {"position": position, "orientation": {"quaternion": quaternion}, "angular_velocity": spin}
        if not order:
            del state[name]["angular_velocity"]
    return state


def between_free_bodies(element, space):
    """Return a mechanism of an element between free bodies."""
    size = 2 if space == "planar" else 3
    bodies = {name: jn.Body([0.3 * k + 0.1, 0.2, 0.1][:size]) for k, name in enumerate(element.bodies)}
    joints, drivers = ({}, {"it": element}) if element.role == "driver" else ({"it": element}, {})
    return jn.Mechanism(space=space, bodies=bodies, joints=joints, drivers=drivers)


def coordinates(equations):
    """Return the coordinates q of code, (time, coordinate), from equations as numbers."""
    attitude = equations.attitude.values if "attitude" in equations else equations.angle.values[..., None]
    return np.concatenate([equations.position.values, attitude], axis=-1).reshape(len(equations.time), -1)


def differences(module, equations, *, by_terms=False):
    """Return by how much code differs from numbers: residual, Jacobian, right sides, each over the size of its row.

    With `by_terms` the size of right sides is at least that of the terms of ``Phi_q q^(k)``, where these cancel.
    """
    q, found = coordinates(equations), []
    moving, sides = (from_one(x) for x in (equations.velocities, equations.right_side))
    for k, t in enumerate(equations.time.values.tolist()):
        terms = by_terms * (np.nan_to_num(np.abs(moving[k])) @ np.abs(equations.jacobian.values[k]).T)
        pairs = (
            (module["residual"](t, q[k]), equations.residual.values[k], (), 1.0),
            (module["jacobian"](t, q[k]), equations.jacobian.values[k], (1,), 1.0),
            (module["right_side"](t, q[k], moving[k])[: len(sides[k])], sides[k], (0,), terms.max(axis=0, initial=1.0)),
        )
        for got, expected, axis, least in pairs:
            expected = np.nan_to_num(expected[: len(got)], nan=0.0)
            size = np.maximum(np.max(np.abs(expected), axis=axis, keepdims=True, initial=1.0), least)
            assert got.shape == expected.shape
            found.append(np.max(np.abs(got - expected) / size, initial=0.0))
    return np.array(found).reshape(-1, 3)


def from_one(variable):
    """Return the derivatives from the first on; with multipliers beside them, tables begin with the order zero."""
    return variable.sel(derivative=slice(1, None)).values


def imbalances(module, equations):
    """Return by how much ``M q^(k+2) + Phi_q^T lambda^(k) = forces(k)`` fails, (time, order); compare mass matrices.

    The multipliers are those of inverse or forward dynamics, which share no program with the code.
    """
    q, moving, found = coordinates(equations), from_one(equations.velocities), []
    for k, t in enumerate(equations.time.values.tolist()):
        known = equations.multipliers.values[k]
        known = known[~np.isnan(known).any(axis=1)]
        mass, jacobian = module["mass_matrix"](t, q[k]), module["jacobian"](t, q[k])
        forces = module["forces"](t, q[k], moving[k], known)
        count = min(len(forces), len(known), len(moving[k]) - 1)
        parts = np.array([[mass @ moving[k][n + 1], jacobian.T @ known[n], -forces[n]] for n in range(count)])
        sizes = np.maximum(np.abs(parts).max(axis=(1, 2)), np.abs(known[:count]).max(axis=1))
        found.append(np.abs(parts.sum(axis=1)).max(axis=1) / np.maximum(sizes, 1e-3))
        if "mass_matrix" in equations:
            np.testing.assert_allclose(mass, equations.mass_matrix.values[k], rtol=0, atol=1e-13 * np.abs(mass).max())
    return np.array(found)


def run(text):
    """Return the names that a module of Python defines."""
    names = {}
    exec(compile(text, "<written>", "exec"), names)
    return names


def at(mechanism, state, time):
    """Return a state as a motion of one instant, by which angles about axes are counted as the numbers have them."""
    return at_state(mechanism, state, time)[0]
