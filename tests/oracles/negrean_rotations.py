"""Equations 1-58 of Negrean, Crisan and Vlase 2025 on rotations and points, as printed or as they must be.

Numbers go through mpmath, so that the same functions serve as values and, by Taylor series in many digits, as
derivatives of any order. Nothing here knows of the library.
"""

import math

import numpy as np
from mpmath import mp

from tests.oracles.mp_taylor import product

UNITS = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}
DIGITS = 40


def cross(a, b):
    """Return the vector product of two triples."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def skew(v):
    """Return the skew-symmetric matrix of a triple."""
    return mp.matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def array(matrix):
    """Return an mpmath matrix as an array of floats."""
    return np.array(matrix.tolist(), float)


def equation_011(axis, angle):
    """Return the simple rotation, each matrix written out as in textbooks."""
    c, s = mp.cos(angle), mp.sin(angle)
    return mp.matrix(
        {
            "x": [[1, 0, 0], [0, c, -s], [0, s, c]],
            "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
            "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
        }[axis]
    )


def equation_013(axis):
    """Return the operators Delta_yz, Delta_zx, Delta_xy: one unless the turn is about the axis that is missing."""
    return [0 if axis == missing else 1 for missing in "xyz"]


def equation_014(axis):
    """Return the operators Delta_x, Delta_y, Delta_z."""
    return [1 - delta for delta in equation_013(axis)]


def equation_012(axis, angle):
    """Return the generalized matrix of a simple rotation, by its nine entries."""
    yz, zx, xy = equation_013(axis)
    x, y, z = equation_014(axis)
    c, s = mp.cos, mp.sin
    return mp.matrix(
        [
            [c(angle * yz), -s(angle * z), s(angle * y)],
            [s(angle * z), c(angle * zx), -s(angle * x)],
            [-s(angle * y), s(angle * x), c(angle * xy)],
        ]
    )


def equation_015(axis, angle):
    """Return the diagonal matrix of 16, 18 and the skew-symmetric matrix of 17, added."""
    diagonal = mp.diag([mp.cos(angle * delta) for delta in equation_013(axis)])
    return diagonal + skew([mp.sin(angle * delta) for delta in equation_014(axis)])


def equation_019(axis, angle):
    """Return the rotation about a unit axis."""
    chi = mp.matrix(axis)
    return chi * chi.T * (1 - mp.cos(angle)) + mp.eye(3) * mp.cos(angle) + skew(axis) * mp.sin(angle)


def equation_020(sequence, angles):
    """Return the rotation of three simple ones, about moving axes (upper case) or about fixed ones."""
    turns = [equation_011(axis.lower(), angle) for axis, angle in zip(sequence, angles, strict=True)]
    first, second, third = turns if sequence.isupper() else turns[::-1]
    return first * second * third


def equation_030(sequence, angles):
    """Return the transfer matrix of a sequence about moving axes."""
    u, v, w = (mp.matrix(UNITS[axis.lower()]) for axis in sequence)
    first, second = (equation_011(axis.lower(), angle) for axis, angle in zip(sequence[:2], angles[:2], strict=True))
    columns = [u, first * v, first * second * w]
    return mp.matrix([[column[i] for column in columns] for i in range(3)])


def equation_034(axis, point, angle, revolute=True):
    """Return the vector b of screw parameters; for a prismatic axis, Delta = 0, what the printed one lacks."""
    chi = mp.matrix(axis)
    if not revolute:
        return chi * angle
    c, s = mp.cos(angle), mp.sin(angle)
    return (chi * chi.T * (angle - s) + mp.eye(3) * s + skew(axis) * (1 - c)) * mp.matrix(cross(point, axis))


def equation_032(screws, angles, start):
    """Return rotation and position of a chain of screws (axis, point, revolute) that takes `start` along."""
    rotation, position = mp.eye(3), mp.matrix([0, 0, 0])
    for (axis, point, revolute), angle in zip(screws, angles, strict=True):
        position += rotation * equation_034(axis, point, angle, revolute)
        if revolute:
            rotation = rotation * equation_019(axis, angle)
    return rotation, position + rotation * mp.matrix(start)


def equation_036(series):
    """Return the series of the angular velocity from that of a rotation matrix, (order + 1, 3, 3): R' R^T."""
    entries = [[list(series[:, i, j]) for j in range(3)] for i in range(3)]
    rates = [[[k * c for k, c in enumerate(entry)][1:] for entry in row] for row in entries]

    def spin(i, j):
        terms = [product(rates[i][k], entries[j][k][:-1]) for k in range(3)]
        return [mp.fsum(parts) for parts in zip(*terms, strict=True)]

    return np.array([spin(2, 1), spin(0, 2), spin(1, 0)]).T


def taylor(function, instant, order):
    """Return the Taylor coefficients of a function of time with values of any shape, in many digits."""
    with mp.workdps(DIGITS):
        shape = np.array(function(mp.mpf(instant))).shape
        entries = np.ndindex(shape) if shape else [()]
        known = {}

        def value(t):
            key = t, mp.prec  # mpmath raises its precision between differences
            if key not in known:
                known[key] = np.array(function(t), object)
            return known[key]

        columns = [mp.taylor(lambda t, e=e: value(t)[e], mp.mpf(instant), order) for e in entries]
        return np.array(columns, object).T.reshape(order + 1, *shape)


def derivatives(series):
    """Return the plain derivatives of a Taylor series as floats."""
    factorials = [math.factorial(k) for k in range(len(series))]
    return np.array([f * c for f, c in zip(factorials, series, strict=True)], float)


class Law:
    """Motion of some coordinates, ``a + b t + c sin(d t + e)``, on mpmath's numbers."""

    def __init__(self, seed, size=3):
        self.table = np.random.default_rng(seed).uniform(0.3, 1.1, size=(5, size))

    def __call__(self, t):
        return [a + b * t + c * mp.sin(d * t + e) for a, b, c, d, e in self.table.T.tolist()]
