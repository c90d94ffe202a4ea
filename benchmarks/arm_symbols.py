"""Inverse dynamics of a chain of hinges as CasADi expressions, with the figures of one robot in them."""

from typing import Any

import numpy as np


def symbolic_torques(model: Any, q: Any, v: Any, a: Any) -> Any:
    """Return the torques for a model of Pinocchio; zeros and ones of its geometry drop out."""
    import casadi

    def figures(x: Any) -> Any:
        rounded = np.round(x)
        return casadi.SX(casadi.DM(np.where(np.abs(x - rounded) < 1e-11, rounded, x)))

    gravity = casadi.SX(casadi.DM(-model.gravity.linear))
    spin, spin_rate, rise, carried = casadi.SX.zeros(3), casadi.SX.zeros(3), gravity, []
    for k in range(1, model.njoints):
        place, body, i = model.jointPlacements[k], model.inertias[k], k - 1
        shift, center = figures(place.translation), figures(body.lever)
        sine, cosine = casadi.sin(q[i]), casadi.cos(q[i])
        turn = casadi.vertcat(
            casadi.horzcat(cosine, -sine, 0), casadi.horzcat(sine, cosine, 0), casadi.horzcat(0, 0, 1)
        )
        rotation = figures(place.rotation) @ turn
        rise = rise + casadi.cross(spin_rate, shift) + casadi.cross(spin, casadi.cross(spin, shift))
        spin, spin_rate, rise = rotation.T @ spin, rotation.T @ spin_rate, rotation.T @ rise
        along = casadi.vertcat(0, 0, v[i])
        spin_rate = spin_rate + casadi.cross(spin, along) + casadi.vertcat(0, 0, a[i])
        spin = spin + along
        inertia = figures(body.inertia)
        rate = casadi.cross(spin_rate, center) + casadi.cross(spin, casadi.cross(spin, center))
        force = body.mass * (rise + rate)
        momentum = inertia @ spin
        moment = inertia @ spin_rate + casadi.cross(spin, momentum) + casadi.cross(center, force)
        carried.append((rotation, shift, force, moment))
    force, moment, torque = casadi.SX.zeros(3), casadi.SX.zeros(3), []
    for rotation, shift, own_force, own_moment in reversed(carried):
        force, moment = force + own_force, moment + own_moment
        torque.append(moment[2])
        force = rotation @ force
        moment = rotation @ moment + casadi.cross(shift, force)
    return casadi.vertcat(*reversed(torque))
