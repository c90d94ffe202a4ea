"""Sommer 2024, sections 3 and 4: one function per numbered equation (9-58), as oracles for planar joints.

H.J. Sommer, Kinematic jerk and jounce for multibody dynamics with joint constraints, Mechanism and Machine Theory 196,
2024, 105613. Plain NumPy, written from the paper and corrected where its print is wrong (`equation_051`,
`equation_058`); `..._printed` is the wrong print, kept so that a test can show that it fails.

A body is a `Body(r, phi)`: ``r[k]`` (2,) in m and ``phi[k]`` in rad are the k-th time derivatives, k = 0..4.
``s_i, s_j`` are the points P in the frames of the bodies, ``a_i`` a vector fixed in body i, in its frame; ``f[k]`` is
the k-th time derivative of a driver. Right-hand sides of velocity, acceleration, jerk and jounce are called nu, gamma,
eta and sigma. A Jacobian is returned as one block of columns (x, y, phi) per body.
"""

from typing import NamedTuple

import numpy as np

R = np.array([[0.0, -1.0], [1.0, 0.0]])


class Body(NamedTuple):
    """Planar body: derivatives 0..4 of position (5, 2) and angle (5,)."""

    r: np.ndarray
    phi: np.ndarray


def equation_009(phi):
    """Attitude matrix A, rotator R and B = R A."""
    A = np.array([[np.cos(phi), -np.sin(phi)], [np.sin(phi), np.cos(phi)]])
    return A, R, R @ A


def _turned(i, s):
    """Return A s and B s."""
    A, _, B = equation_009(i.phi[0])
    return A @ s, B @ s


def equation_010(i, s_i):
    """Position of a point."""
    return i.r[0] + _turned(i, s_i)[0]


def equation_011(i, s_i):
    """Velocity of a point."""
    return i.r[1] + i.phi[1] * _turned(i, s_i)[1]


def equation_012(i, s_i):
    """Acceleration of a point."""
    As, Bs = _turned(i, s_i)
    return i.r[2] + i.phi[2] * Bs - i.phi[1] ** 2 * As


def equation_013(i, s_i):
    """Jerk of a point."""
    As, Bs = _turned(i, s_i)
    return i.r[3] + (i.phi[3] - i.phi[1] ** 3) * Bs - 3 * i.phi[1] * i.phi[2] * As


def equation_014(i, s_i):
    """Jounce of a point."""
    (As, Bs), p = _turned(i, s_i), i.phi
    return i.r[4] + (p[4] - 6 * p[1] ** 2 * p[2]) * Bs - (4 * p[1] * p[3] + 3 * p[2] ** 2 - p[1] ** 4) * As


def equation_015(i, j, s_i, s_j):
    """Relative position d."""
    return equation_010(j, s_j) - equation_010(i, s_i)


def equation_016(i, j, s_i, s_j):
    """Relative velocity d'."""
    return equation_011(j, s_j) - equation_011(i, s_i)


def equation_017(i, j, s_i, s_j):
    """Relative acceleration d''."""
    return equation_012(j, s_j) - equation_012(i, s_i)


def equation_018(i, j, s_i, s_j):
    """Relative jerk d'''."""
    return equation_013(j, s_j) - equation_013(i, s_i)


def _relative(i, j, s_i, s_j):
    """Return d, d', d'', d'''."""
    return [e(i, j, s_i, s_j) for e in (equation_015, equation_016, equation_017, equation_018)]


def equation_019(i, a_i):
    """Vector of body i in global directions."""
    return _turned(i, a_i)[0]


def equation_020(s_q, s_p):
    """Vector from point P to point Q of one body."""
    return s_q - s_p


def equation_021(i, j, s_i, s_j):
    """Revolute: constraint."""
    return equation_015(i, j, s_i, s_j)


def equation_022(i, j, s_i, s_j):
    """Revolute: Jacobian."""
    eye = np.eye(2)
    return np.column_stack([-eye, -_turned(i, s_i)[1]]), np.column_stack([eye, _turned(j, s_j)[1]])


def equation_023(i, j, s_i, s_j):
    """Revolute: gamma."""
    return j.phi[1] ** 2 * _turned(j, s_j)[0] - i.phi[1] ** 2 * _turned(i, s_i)[0]


def equation_024(i, j, s_i, s_j):
    """Revolute: eta."""

    def part(body, s):
        (As, Bs), p = _turned(body, s), body.phi
        return 3 * p[1] * p[2] * As + p[1] ** 3 * Bs

    return part(j, s_j) - part(i, s_i)


def equation_025(i, j, s_i, s_j):
    """Revolute: sigma."""

    def part(body, s):
        (As, Bs), p = _turned(body, s), body.phi
        return (4 * p[1] * p[3] + 3 * p[2] ** 2 - p[1] ** 4) * As + 6 * p[1] ** 2 * p[2] * Bs

    return part(j, s_j) - part(i, s_i)


def equation_026(i, j, s_i, s_j, length):
    """Double-revolute: constraint."""
    d = equation_015(i, j, s_i, s_j)
    return d @ d - length**2


def equation_027(i, j, s_i, s_j):
    """Double-revolute: Jacobian."""
    d = equation_015(i, j, s_i, s_j)
    return tuple(2 * d @ block for block in equation_022(i, j, s_i, s_j))


def equation_028(i, j, s_i, s_j):
    """Double-revolute: gamma."""
    d, v, _, _ = _relative(i, j, s_i, s_j)
    return 2 * d @ equation_023(i, j, s_i, s_j) - 2 * v @ v


def equation_029(i, j, s_i, s_j):
    """Double-revolute: eta."""
    d, v, a, _ = _relative(i, j, s_i, s_j)
    return -6 * v @ a + 2 * d @ equation_024(i, j, s_i, s_j)


def equation_030(i, j, s_i, s_j):
    """Double-revolute: sigma."""
    d, v, a, b = _relative(i, j, s_i, s_j)
    return -8 * v @ b - 6 * a @ a + 2 * d @ equation_025(i, j, s_i, s_j)


def equation_031(i, j, a_i, a_j):
    """Parallel-1: constraint."""
    return equation_019(i, a_i) @ R.T @ equation_019(j, a_j)


def equation_032(i, j, a_i, a_j):
    """Parallel-1: Jacobian."""
    slope = equation_019(i, a_i) @ equation_019(j, a_j)
    return np.array([0, 0, -slope]), np.array([0, 0, slope])


def equation_033():
    """Parallel-1: gamma, eta, sigma: zero where the constraint and its derivatives of lower order hold."""
    return 0.0, 0.0, 0.0


def equation_033_anywhere(i, j, a_i, a_j):
    """Parallel-1: gamma, eta, sigma at any state, on the constraint or not; not in the paper."""
    sine, cosine = equation_031(i, j, a_i, a_j), equation_019(i, a_i) @ equation_019(j, a_j)
    p = j.phi - i.phi
    return (
        sine * p[1] ** 2,
        3 * sine * p[1] * p[2] + cosine * p[1] ** 3,
        sine * (4 * p[1] * p[3] + 3 * p[2] ** 2 - p[1] ** 4) + 6 * cosine * p[1] ** 2 * p[2],
    )


def equation_034(i, j, s_i, s_j, a_i):
    """Parallel-2: constraint."""
    return equation_019(i, a_i) @ R.T @ equation_015(i, j, s_i, s_j)


def equation_035(i, j, s_i, s_j, a_i):
    """Parallel-2: Jacobian."""
    a, d = equation_019(i, a_i), equation_015(i, j, s_i, s_j)
    block_i, block_j = equation_022(i, j, s_i, s_j)
    return a @ R.T @ block_i - np.array([0, 0, a @ d]), a @ R.T @ block_j


def equation_036(i, j, s_i, s_j, a_i):
    """Parallel-2: gamma."""
    (d, v, _, _), p = _relative(i, j, s_i, s_j), i.phi
    return equation_019(i, a_i) @ (2 * p[1] * v + R.T @ (p[1] ** 2 * d + equation_023(i, j, s_i, s_j)))


def equation_037(i, j, s_i, s_j, a_i):
    """Parallel-2: eta."""
    (d, v, a, _), p = _relative(i, j, s_i, s_j), i.phi
    across = 3 * p[1] * a + 3 * p[2] * v - p[1] ** 3 * d
    along = 3 * p[1] * p[2] * d + 3 * p[1] ** 2 * v + equation_024(i, j, s_i, s_j)
    return equation_019(i, a_i) @ (across + R.T @ along)


def equation_038(i, j, s_i, s_j, a_i):
    """Parallel-2: sigma."""
    across, along = _jounce_parts(i, j, s_i, s_j)
    return equation_019(i, a_i) @ (across + R.T @ along)


def _jounce_parts(i, j, s_i, s_j):
    """Return the two brackets that equations 38 and 49 share."""
    (d, v, a, b), p = _relative(i, j, s_i, s_j), i.phi
    across = 4 * p[1] * b + 6 * p[2] * a + 4 * (p[3] - p[1] ** 3) * v - 6 * p[1] ** 2 * p[2] * d
    along = 6 * p[1] ** 2 * a + 12 * p[1] * p[2] * v + (4 * p[1] * p[3] + 3 * p[2] ** 2 - p[1] ** 4) * d
    return across, along + equation_025(i, j, s_i, s_j)


def equation_039(i, j, ratio, offset, f):
    """Relative coordinate driver: constraint (of angles)."""
    return j.phi[0] - ratio * i.phi[0] - offset - f[0]


def equation_040(f):
    """Relative coordinate driver: nu, gamma, eta, sigma."""
    return f[1], f[2], f[3], f[4]


def equation_041(i, j, m, ratio, offset):
    """Gear pair i, j on a rotating frame m: constraint."""
    return (j.phi[0] - m.phi[0]) - ratio * (i.phi[0] - m.phi[0]) - offset


def equation_042(ratio):
    """Gear pair on a rotating frame: Jacobian for i, j, m."""
    return np.array([0, 0, -ratio]), np.array([0, 0, 1.0]), np.array([0, 0, ratio - 1])


def equation_043():
    """Gear pair on a rotating frame: nu, gamma, eta, sigma."""
    return 0.0, 0.0, 0.0, 0.0


def equation_044(i, j, s_i, s_j, a_i, f):
    """Parallel-2 distance driver: constraint."""
    return equation_019(i, a_i) @ equation_015(i, j, s_i, s_j) / np.linalg.norm(a_i) - f[0]


def equation_045(i, j, s_i, s_j, a_i):
    """Parallel-2 distance driver: Jacobian."""
    a, d, length = equation_019(i, a_i), equation_015(i, j, s_i, s_j), np.linalg.norm(a_i)
    block_i, block_j = equation_022(i, j, s_i, s_j)
    return (a @ block_i + np.array([0, 0, a @ R.T @ d])) / length, a @ block_j / length


def equation_046(f):
    """Parallel-2 distance driver: nu."""
    return f[1]


def equation_047(i, j, s_i, s_j, a_i, f):
    """Parallel-2 distance driver: gamma."""
    (d, v, _, _), p = _relative(i, j, s_i, s_j), i.phi
    inner = -2 * R.T @ v * p[1] + (d * p[1] ** 2 + equation_023(i, j, s_i, s_j))
    return equation_019(i, a_i) @ inner / np.linalg.norm(a_i) + f[2]


def equation_048(i, j, s_i, s_j, a_i, f):
    """Parallel-2 distance driver: eta."""
    (d, v, a, _), p = _relative(i, j, s_i, s_j), i.phi
    across = 3 * a * p[1] + 3 * v * p[2] - d * p[1] ** 3
    along = 3 * d * p[1] * p[2] + 3 * v * p[1] ** 2 + equation_024(i, j, s_i, s_j)
    return equation_019(i, a_i) @ (-R.T @ across + along) / np.linalg.norm(a_i) + f[3]


def equation_049(i, j, s_i, s_j, a_i, f):
    """Parallel-2 distance driver: sigma."""
    across, along = _jounce_parts(i, j, s_i, s_j)
    return equation_019(i, a_i) @ (-R.T @ across + along) / np.linalg.norm(a_i) + f[4]


def equation_050(i, j, s_i, s_j, a_i, radius, offset):
    """Rolling along a line: constraint."""
    travel = equation_019(i, a_i) @ equation_015(i, j, s_i, s_j) / np.linalg.norm(a_i)
    return travel - radius * (j.phi[0] - i.phi[0]) - offset


def equation_051(i, j, s_i, s_j, a_i, radius):
    """Rolling along a line: Jacobian, with the radius outside the division by L."""
    block_i, block_j = equation_045(i, j, s_i, s_j, a_i)
    return block_i + np.array([0, 0, radius]), block_j - np.array([0, 0, radius])


def equation_051_printed(i, j, s_i, s_j, a_i, radius):
    """Rolling along a line: Jacobian as printed, the radius divided by L as well. Wrong unless L = 1."""
    length = np.linalg.norm(a_i)
    block_i, block_j = equation_045(i, j, s_i, s_j, a_i)
    return block_i + np.array([0, 0, radius]) / length, block_j - np.array([0, 0, radius]) / length


def equation_052(i, j, s_i, s_j, a_i):
    """Rolling along a line: nu, gamma, eta, sigma, the last three those of the distance driver at rest."""
    rest = np.zeros(5)
    return 0.0, *(e(i, j, s_i, s_j, a_i, rest) for e in (equation_047, equation_048, equation_049))


def equation_053(i, j, s_i, s_j, f):
    """Relative distance driver: constraint."""
    return equation_026(i, j, s_i, s_j, f[0])


def equation_054(i, j, s_i, s_j):
    """Relative distance driver: Jacobian."""
    return equation_027(i, j, s_i, s_j)


def equation_055(i, j, s_i, s_j, f):
    """Relative distance driver: nu, gamma, eta, sigma."""
    return (
        2 * f[0] * f[1],
        equation_028(i, j, s_i, s_j) + 2 * f[1] ** 2 + 2 * f[0] * f[2],
        equation_029(i, j, s_i, s_j) + 6 * f[1] * f[2] + 2 * f[0] * f[3],
        equation_030(i, j, s_i, s_j) + 6 * f[2] ** 2 + 8 * f[1] * f[3] + 2 * f[0] * f[4],
    )


def equation_056(t, start, delta, tau):
    """Driver: start + delta sin(2 pi t / tau) and its derivatives 1..4, shape (5, ...)."""
    rate = 2 * np.pi / tau
    x = rate * np.asarray(t, dtype=float)
    waves = [np.sin(x), np.cos(x), -np.sin(x), -np.cos(x), np.sin(x)]
    return np.stack([start * (k == 0) + delta * rate**k * wave for k, wave in enumerate(waves)])


def equation_057(u, h):
    """First and second derivatives by second-order central differences, from samples u[k-1], u[k], u[k+1]."""
    return (-u[0] + u[2]) / (2 * h), (u[0] - 2 * u[1] + u[2]) / h**2


def equation_058(u, h):
    """First and second derivatives by fourth-order central differences, from samples u[k-2] .. u[k+2]."""
    first = (u[0] - 8 * u[1] + 8 * u[3] - u[4]) / (12 * h)
    return first, (-u[0] + 16 * u[1] - 30 * u[2] + 16 * u[3] - u[4]) / (12 * h**2)


def equation_058_printed(u, h):
    """Fourth-order differences as printed, with the wrong sign of u[k+1] in the first derivative."""
    return (u[0] - 8 * u[1] - 8 * u[3] - u[4]) / (12 * h), equation_058(u, h)[1]
