"""Equations 65-146 of Negrean, Crisan and Vlase 2025 for NumPy arrays and fifty digits: right forms, and printed ones.

A random motion of one body (`BodyMotion`) is built from Leibniz's rule alone. Robots are those of `mp_robot`; partial
derivatives of their energies are central differences in fifty digits. Nothing here knows of the library.
"""

import math

import numpy as np
from mpmath import mp, mpf

from tests.oracles.mp_robot import State
from tests.oracles.mp_series import Series

STEP = "1e-20"  # of central differences: their error is some 1e-38 of the value


def skew(a):
    """Return the matrix of the vector product."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


class BodyMotion:
    """A random body and its motion: derivatives of the origin r, of the rotation matrix R, and of w, all in the base.

    The body is a cloud of points, with its mass, center of mass and second moments about that.
    """

    def __init__(self, seed, order=8):
        rng = np.random.default_rng(seed)
        self.r, self.w = rng.normal(size=(order + 1, 3)), rng.normal(size=(order, 3))
        R = [np.linalg.qr(rng.normal(size=(3, 3)))[0]]
        R[0] *= np.linalg.det(R[0])
        for k in range(order):  # R' = skew(w) R
            R.append(sum(math.comb(k, j) * skew(self.w[j]) @ R[k - j] for j in range(k + 1)))
        self.R = np.array(R)
        self.masses, self.points = rng.uniform(0.2, 1.0, 6), rng.normal(size=(6, 3))
        self.mass = self.masses.sum()
        self.center = self.masses @ self.points / self.mass
        arms = self.points - self.center
        self.second_moments = np.einsum("p,pi,pj->ij", self.masses, arms, arms)

    def point(self, k, local):
        """Return the k-th derivative of points given in the body, (..., 3)."""
        return self.r[k] + local @ self.R[k].T

    def cloud_energy(self, p, n=0, points=None):
        """Return the n-th rate of the acceleration energy of order p by its definition: N 65, 83, 116, 118, 120."""
        points = self.points if points is None else points
        return product_rate(lambda k: self.point(p + 1 + k, points), n, lambda a, b: self.masses @ (a * b).sum(axis=1))

    def trace_energy(self, p, n=0):
        """Return the same by the pseudo-inertia J (N 109): 1/2 trace of the rate of T^(p+1) J T^(p+1)^T, N 107."""
        J = np.zeros((4, 4))
        c = np.append(self.center, 1.0)
        J[:3, :3] = self.second_moments
        J = J + self.mass * np.outer(c, c)
        T = [np.hstack([R, r[:, None]]) for R, r in zip(self.R, self.r, strict=True)]
        return product_rate(lambda k: T[p + 1 + k], n, lambda A, B: np.trace(A @ J @ B.T))

    def printed_107(self, p, n=0):
        """Return N 107 as printed, last form: origin and rotation apart, and no term between them."""
        moments = self.second_moments + self.mass * np.outer(self.center, self.center)
        turning = product_rate(lambda k: self.R[p + 1 + k], n, lambda A, B: np.trace(A @ moments @ B.T))
        return turning + product_rate(lambda k: self.r[p + 1 + k], n, lambda a, b: self.mass * a @ b)

    def printed_107_middle(self, p, n=0):
        """Return N 107 as printed, second form, of a body that turns about its center of mass."""
        high = self.R[p + n + 1]
        return np.trace(high @ self.second_moments @ high.T) / 2

    def rotation(self, p, n=0):
        """Return the n-th rate of the energy of the turning about the center of mass."""
        return product_rate(lambda k: self.R[p + 1 + k], n, lambda A, B: np.trace(A @ self.second_moments @ B.T))

    @property
    def inertia(self):
        """Inertia tensor about the center of mass, in the base: N 72."""
        S = self.R[0] @ self.second_moments @ self.R[0].T
        return np.trace(S) * np.eye(3) - S

    @property
    def moments(self):
        """Second moments about the center of mass, in the base: N 109."""
        return self.R[0] @ self.second_moments @ self.R[0].T


def product_rate(factor, n, product):
    """Return 1/2 of the n-th derivative of the product of something with itself, by Leibniz's rule."""
    return 0.5 * sum(math.comb(n, k) * product(factor(k), factor(n - k)) for k in range(n + 1))


def body_axes(body):
    """Return plain derivatives of the components of w in the body, which differ from the components of w''."""
    found = []
    for n in range(len(body.w)):
        found.append(sum(math.comb(n, k) * body.R[n - k].T @ body.w[k] for k in range(n + 1)))
    return np.array(found)


def printed_rotation(p, inertia, moments, w):
    """Return the rotational part of the closed forms of E_2, E_3, E_4 as printed: N 117, 119, 121.

    `w` holds the angular velocity and its derivatives, in any one set of axes.
    """
    mixed = {
        2: lambda: w[1] @ np.cross(w[2], moments @ w[0]),
        3: lambda: 3 * w[3] @ np.cross(w[0], moments @ w[2]),
        4: lambda: 0.0,
    }[p]()
    return w[p] @ inertia @ w[p] / 2 + mixed + (w[0] @ w[0]) ** p * (w[0] @ inertia @ w[0]) / 2


def printed_rotation_any_order(p, inertia, w):
    """Return the rotational part of E_p as printed: N 122, with its product of angular velocities."""
    return w[p] @ inertia @ w[p] / 2 + (w[0] @ w[0]) ** p * (w[0] @ inertia @ w[0])


def second_order_rotation(moments, w):
    """Return the rotational part of E_2 as it must be: 1/2 trace(M S M^T), in place of N 117."""
    spin, turn, jerk = (skew(x) for x in w[:3])
    M = jerk + 2 * turn @ spin + spin @ turn + spin @ spin @ spin
    return np.trace(M @ moments @ M.T) / 2


def translation_factor(delta):
    """Return the factor of translation of N 73, ``(-1)^D (1 - D) / (1 + 3 D)``: D of N 74 with signs restored."""
    return (-1.0) ** delta * (1 - delta) / (1 + 3 * delta)


# robots in fifty digits


def energy(robot, q, p, n=0):
    """Return the n-th rate of the acceleration energy of order p of all bodies; q holds plain derivatives by joint."""
    length = p + n + 2
    rows = [[*list(row)[:length], *[mpf(0)] * (length - len(row))] for row in q]
    state = State(robot, [Series([mpf(d) / mp.factorial(k) for k, d in enumerate(row)]) for row in rows])
    parts = [part for k in range(len(robot.bodies)) if robot.bodies[k].mass for part in state.energies(k, p)]
    return mp.factorial(n) * mp.fsum(part.c[n] for part in parts)


def slope(robot, q, p, n, m):
    """Return the derivatives of `energy` with respect to the m-th derivative of each coordinate."""
    step, found = mpf(STEP), []
    for j in range(len(q)):
        sides = []
        for sign in (1, -1):
            moved = [list(row) for row in q]
            moved[j][m] = moved[j][m] + sign * step
            sides.append(energy(robot, moved, p, n))
        found.append((sides[0] - sides[1]) / (2 * step))
    return np.array([float(x) for x in found])


def inertia_forces(robot, q, rates):
    """Return generalized inertia forces and their rates by virtual work, (rates + 1, joints)."""
    state = State(robot.without_gravity(), [Series([d / mp.factorial(k) for k, d in enumerate(row)]) for row in q])
    return np.array([[float(d) for d in force.derivatives()[: rates + 1]] for force in state.forces()]).T


def higher_order(robot, q, k, m, coefficients):
    """Return N 134 with the given coefficients: the (k-1)-th rate of the generalized inertia forces."""
    scale = math.factorial(k - 1) * math.factorial(m) / math.factorial(m + k - 1)
    terms = [c * slope(robot, q, p, m + k - 2 * p - 1, m) for p, c in zip(range(1, k + 1), coefficients, strict=True)]
    return scale * sum(terms[1:], terms[0])
