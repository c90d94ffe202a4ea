"""Closed forms of energies in Negrean, Crisan and Vlase 2025, transcribed equation by equation for NumPy arrays.

Vectors are in any one frame of a body whose inertia tensor is given in it; w, a, j, s are angular velocity,
acceleration, jerk and jounce (second and third rates of acceleration), as components of absolute vectors.
"""

import numpy as np


def first_order(mass, inertia_at_origin, center, acceleration, w, a):
    """Return the acceleration energy of a body from the motion of its origin: N 105.

    `center` is the center of mass from the origin, `acceleration` that of the origin, the tensor is about the origin.
    """
    inertia = np.asarray(inertia_at_origin)
    moving = mass / 2 * acceleration @ acceleration
    moving += mass * acceleration @ np.cross(a, center) + mass * acceleration @ np.cross(w, np.cross(w, center))
    return moving + rotation_first_order(inertia, w, a)


def first_order_at_center(mass, inertia, acceleration, w, a):
    """Return the acceleration energy of a body from the motion of its center of mass: N 106."""
    return mass / 2 * acceleration @ acceleration + rotation_first_order(inertia, w, a)


def rotation_first_order(inertia, w, a):
    """Return the part of N 105 and 106 that belongs to rotation."""
    inertia = np.asarray(inertia)
    return a @ inertia @ a / 2 + a @ np.cross(w, inertia @ w) + (w @ w) * (w @ inertia @ w) / 2


def kinetic(mass, inertia, velocity, w):
    """Return the kinetic energy by Koenig's theorem: N 66."""
    return mass / 2 * velocity @ velocity + w @ np.asarray(inertia) @ w / 2


def one_axis(inertia, w, a, j=None, s=None):
    """Return the acceleration energies of a body that turns about one fixed axis: N 141, 142, 143.

    `inertia` is about the axis, ``M (x_C^2 + z_C^2) + I_y`` in the paper. N 143 is printed with two of its terms twice;
    here each stands once.
    """
    found = [a**2 + w**4]
    if j is not None:
        found.append(j**2 - 2 * w**3 * j + 9 * w**2 * a**2 + w**6)
    if s is not None:
        third = s**2 - 12 * w**2 * a * s + 30 * w**4 * a**2 + 16 * w**2 * j**2 + 24 * w * a**2 * j - 8 * w**5 * j
        found.append(third + 9 * a**4 + w**8)
    return [inertia / 2 * energy for energy in found]


def one_axis_torques(inertia, a, j, s):
    """Return inertia torque and its two rates about one fixed axis: N 144, 145, 146 without gravity."""
    return [inertia * a, inertia * j, inertia * s]


def printed_rotation_second_order(inertia, second_moments, w, a, j):
    """Return the rotational part of N 117 as printed, which lacks terms."""
    inertia = np.asarray(inertia)
    mixed = a @ np.cross(j, np.asarray(second_moments) @ w)
    return j @ inertia @ j / 2 + mixed + (w @ w) ** 2 * (w @ inertia @ w) / 2


def printed_rotation_third_order(inertia, second_moments, w, a, j, s):
    """Return the rotational part of N 119 as printed, which lacks terms."""
    inertia = np.asarray(inertia)
    mixed = 3 * s @ np.cross(w, np.asarray(second_moments) @ j)
    return s @ inertia @ s / 2 + mixed + (w @ w) ** 3 * (w @ inertia @ w) / 2
