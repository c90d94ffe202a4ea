"""Sommer 2024, section 5: one function per numbered equation (59-111), as oracles for spatial joints.

Plain NumPy, written from the paper and corrected where its print is wrong (`equation_069`, `equation_097`,
`equation_101`); `..._printed` is the wrong print, kept so that a test can show that it fails.

A body is a `Body(r, A, w)`: ``r[k]`` (3,) the k-th derivative of position in m, k = 0..4; ``A`` (3, 3) the attitude;
``w[k]`` (3,) the k-th derivative of body-fixed angular velocity in rad/s, k = 0..3. ``s_i, s_j`` are the points P and
``a_i, a_j`` fixed vectors, in the frames of the bodies; ``f[k]`` is the k-th derivative of a driver. Right-hand sides
of velocity, acceleration, jerk and jounce are called nu, gamma, eta and sigma. A Jacobian comes in the two parts that
the paper numbers apart: for r_i and r_j, and for pi_i and pi_j (body-fixed small rotations).
"""

from typing import NamedTuple

import numpy as np


class Body(NamedTuple):
    """Spatial body: derivatives of position (5, 3), attitude (3, 3), derivatives of body angular velocity (4, 3)."""

    r: np.ndarray
    A: np.ndarray
    w: np.ndarray


def equation_059(i, s_i):
    """Position of a point."""
    return i.r[0] + i.A @ s_i


def equation_060(w):
    """Skew-symmetric matrix of a vector: skew(w) x = w cross x."""
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def _skews(i):
    """Return the skew-symmetric matrices of angular velocity, acceleration, jerk, jounce."""
    return [equation_060(w) for w in i.w]


def equation_061(i, s_i):
    """Velocity of a point."""
    return i.r[1] + i.A @ _skews(i)[0] @ s_i


def _U(i):
    """Return the matrix of acceleration, skew(w') + skew(w) skew(w)."""
    w, dw, _, _ = _skews(i)
    return dw + w @ w


def equation_062(i, s_i):
    """Acceleration of a point."""
    return i.r[2] + i.A @ _U(i) @ s_i


def equation_063(i):
    """Angular jerk product matrix H."""
    w, dw, _, _ = _skews(i)
    return 2 * w @ dw + dw @ w + w @ w @ w


def equation_064(i, s_i):
    """Jerk of a point."""
    return i.r[3] + i.A @ (equation_063(i) + _skews(i)[2]) @ s_i


def equation_065(i):
    """Angular jounce product matrix W."""
    w, dw, ddw, _ = _skews(i)
    quadratic = ddw @ w + 3 * dw @ dw + 3 * w @ ddw
    return quadratic + dw @ w @ w + 2 * w @ dw @ w + 3 * w @ w @ dw + w @ w @ w @ w


def equation_066(i, s_i):
    """Jounce of a point."""
    return i.r[4] + i.A @ (equation_065(i) + _skews(i)[3]) @ s_i


def equation_067(i, j, s_i, s_j):
    """Relative position d."""
    return equation_059(j, s_j) - equation_059(i, s_i)


def equation_068(i, j, s_i, s_j):
    """Relative velocity d'."""
    return equation_061(j, s_j) - equation_061(i, s_i)


def equation_069(i, j, s_i, s_j):
    """Relative acceleration d'', all terms of body i with a minus."""
    return equation_062(j, s_j) - equation_062(i, s_i)


def equation_069_printed(i, j, s_i, s_j):
    """Relative acceleration as printed, with a plus before both rotational terms of body i."""
    return equation_062(j, s_j) - i.r[2] + i.A @ _U(i) @ s_i


def equation_070(i, j, s_i, s_j):
    """Relative jerk d'''."""
    return equation_064(j, s_j) - equation_064(i, s_i)


def _relative(i, j, s_i, s_j):
    """Return d, d', d'', d'''."""
    return [e(i, j, s_i, s_j) for e in (equation_067, equation_068, equation_069, equation_070)]


def equation_071(i, a_i):
    """Vector of body i in global directions."""
    return i.A @ a_i


def equation_072(s_q, s_p):
    """Vector from point P to point Q of one body."""
    return s_q - s_p


def equation_073(A, w):
    """Global angular velocity from body axes; with ``A.T`` back."""
    return A @ w


def equation_074(A, dw):
    """Global angular acceleration from body axes; with ``A.T`` back."""
    return A @ dw


def equation_075(A, w, dw, ddw, back=False):
    """Global angular jerk from body axes or, with ``back``, body axes from global ones."""
    if back:
        return A.T @ (ddw - np.cross(w, dw))
    return A @ (ddw + np.cross(w, dw))


def equation_076(A, w, dw, ddw, dddw, back=False):
    """Global angular jounce from body axes or, with ``back``, body axes from global ones."""
    s, ds = equation_060(w), equation_060(dw)
    if back:
        return A.T @ (dddw - 2 * s @ ddw - (ds - s @ s) @ dw)
    return A @ (dddw + 2 * s @ ddw + (ds + s @ s) @ dw)


def equation_077(i, j, s_i, s_j):
    """Spherical: constraint."""
    return equation_067(i, j, s_i, s_j)


def equation_078():
    """Spherical: Jacobian for r_i, r_j."""
    return -np.eye(3), np.eye(3)


def equation_079(i, j, s_i, s_j):
    """Spherical: Jacobian for pi_i, pi_j."""
    return i.A @ equation_060(s_i), -j.A @ equation_060(s_j)


def equation_080(i, j, s_i, s_j):
    """Spherical: gamma."""
    w_i, w_j = _skews(i)[0], _skews(j)[0]
    return i.A @ w_i @ w_i @ s_i - j.A @ w_j @ w_j @ s_j


def equation_081(i, j, s_i, s_j):
    """Spherical: eta."""
    return i.A @ equation_063(i) @ s_i - j.A @ equation_063(j) @ s_j


def equation_082(i, j, s_i, s_j):
    """Spherical: sigma."""
    return i.A @ equation_065(i) @ s_i - j.A @ equation_065(j) @ s_j


def equation_083(i, j, s_i, s_j, length):
    """Double-spherical: constraint."""
    d = equation_067(i, j, s_i, s_j)
    return d @ d - length**2


def equation_084(i, j, s_i, s_j):
    """Double-spherical: Jacobian for r_i, r_j."""
    d = equation_067(i, j, s_i, s_j)
    return -2 * d, 2 * d


def equation_085(i, j, s_i, s_j):
    """Double-spherical: Jacobian for pi_i, pi_j."""
    d = equation_067(i, j, s_i, s_j)
    return tuple(2 * d @ block for block in equation_079(i, j, s_i, s_j))


def equation_086(i, j, s_i, s_j):
    """Double-spherical: gamma."""
    d, v, _, _ = _relative(i, j, s_i, s_j)
    return -2 * v @ v + 2 * d @ equation_080(i, j, s_i, s_j)


def equation_087(i, j, s_i, s_j):
    """Double-spherical: eta."""
    d, v, a, _ = _relative(i, j, s_i, s_j)
    return -6 * v @ a + 2 * d @ equation_081(i, j, s_i, s_j)


def equation_088(i, j, s_i, s_j):
    """Double-spherical: sigma."""
    d, v, a, b = _relative(i, j, s_i, s_j)
    return -6 * a @ a - 8 * v @ b + 2 * d @ equation_082(i, j, s_i, s_j)


def equation_089(i, j, a_i, a_j):
    """Dot-1: constraint."""
    return equation_071(i, a_i) @ equation_071(j, a_j)


def equation_090():
    """Dot-1: Jacobian for r_i, r_j."""
    return np.zeros(3), np.zeros(3)


def equation_091(i, j, a_i, a_j):
    """Dot-1: Jacobian for pi_i, pi_j."""
    return -a_j @ j.A.T @ i.A @ equation_060(a_i), -a_i @ i.A.T @ j.A @ equation_060(a_j)


def equation_092(i, j, a_i, a_j):
    """Dot-1: gamma."""
    (w_i, *_), (w_j, *_), T = _skews(i), _skews(j), j.A.T @ i.A
    return -a_j @ (T @ w_i @ w_i + 2 * w_j.T @ T @ w_i + w_j @ w_j @ T) @ a_i


def equation_093(i, j, a_i, a_j):
    """Dot-1: eta."""
    (w_i, dw_i, *_), (w_j, dw_j, *_), T = _skews(i), _skews(j), j.A.T @ i.A
    return (
        -a_j @ T @ equation_063(i) @ a_i
        - a_i @ T.T @ equation_063(j) @ a_j
        - 3 * a_j @ (w_j @ w_j - dw_j) @ T @ w_i @ a_i
        - 3 * a_i @ (w_i @ w_i - dw_i) @ T.T @ w_j @ a_j
    )


def equation_094(i, j, a_i, a_j):
    """Dot-1: sigma."""
    (w_i, dw_i, ddw_i, _), (w_j, dw_j, ddw_j, _), T = _skews(i), _skews(j), j.A.T @ i.A
    return (
        -a_j @ T @ equation_065(i) @ a_i
        - a_i @ T.T @ equation_065(j) @ a_j
        + 4 * a_j @ w_j @ T @ (equation_063(i) + ddw_i) @ a_i
        + 4 * a_i @ w_i @ T.T @ (equation_063(j) + ddw_j) @ a_j
        - 6 * a_j @ (w_j @ w_j - dw_j) @ T @ (w_i @ w_i + dw_i) @ a_i
    )


def equation_095(i, j, s_i, s_j, a_i):
    """Dot-2: constraint."""
    return equation_071(i, a_i) @ equation_067(i, j, s_i, s_j)


def equation_096(i, a_i):
    """Dot-2: Jacobian for r_i, r_j."""
    a = equation_071(i, a_i)
    return -a, a


def equation_097(i, j, s_i, s_j, a_i):
    """Dot-2: Jacobian for pi_i, pi_j; the second is plus a_i^T times that of the spherical joint."""
    d = equation_067(i, j, s_i, s_j)
    block_i = a_i @ equation_060(s_i) - d @ i.A @ equation_060(a_i)
    return block_i, equation_071(i, a_i) @ equation_079(i, j, s_i, s_j)[1]


def equation_097_printed(i, j, s_i, s_j, a_i):
    """Dot-2: Jacobian as the last printed form has it, with a minus."""
    return equation_097(i, j, s_i, s_j, a_i)[0], -equation_071(i, a_i) @ equation_079(i, j, s_i, s_j)[1]


def equation_098(i, j, s_i, s_j, a_i):
    """Dot-2: gamma."""
    (d, v, _, _), w = _relative(i, j, s_i, s_j), _skews(i)[0]
    return -2 * v @ i.A @ w @ a_i - d @ i.A @ w @ w @ a_i + equation_071(i, a_i) @ equation_080(i, j, s_i, s_j)


def equation_099(i, j, s_i, s_j, a_i):
    """Dot-2: eta."""
    (d, v, a, _), w = _relative(i, j, s_i, s_j), _skews(i)[0]
    turning = -3 * a @ i.A @ w - 3 * v @ i.A @ _U(i) - d @ i.A @ equation_063(i)
    return turning @ a_i + equation_071(i, a_i) @ equation_081(i, j, s_i, s_j)


def equation_100(i, j, s_i, s_j, a_i):
    """Dot-2: sigma."""
    (d, v, a, b), (w, _, ddw, _) = _relative(i, j, s_i, s_j), _skews(i)
    slow = -4 * b @ i.A @ w - 6 * a @ i.A @ _U(i)
    fast = -4 * v @ i.A @ (ddw + equation_063(i)) - d @ i.A @ equation_065(i)
    return (slow + fast) @ a_i + equation_071(i, a_i) @ equation_082(i, j, s_i, s_j)


def equation_101(p, u, f):
    """Fixed revolute rotation driver: constraint, from Euler parameters p = (e0, e1, e2, e3) and unit axis u."""
    return 2 * np.arctan2(u @ p[1:], p[0]) - f[0]


def equation_101_printed(p, u, f):
    """Rotation driver as printed, sin(theta / 2) = abs(e): the sign of theta is lost. The axis u plays no part."""
    return 2 * np.arctan2(np.linalg.norm(p[1:]), p[0]) - f[0]


def equation_102(u):
    """Fixed revolute rotation driver: Jacobian for r_i, pi_i."""
    return np.zeros(3), u


def equation_103(f):
    """Fixed revolute rotation driver: nu, gamma, eta, sigma."""
    return f[1], f[2], f[3], f[4]


def equation_104(i, j, s_i, s_j, f):
    """Relative distance driver: constraint."""
    return equation_083(i, j, s_i, s_j, f[0])


def equation_105(i, j, s_i, s_j):
    """Relative distance driver: Jacobian for r_i, r_j."""
    return equation_084(i, j, s_i, s_j)


def equation_106(i, j, s_i, s_j):
    """Relative distance driver: Jacobian for pi_i, pi_j."""
    return equation_085(i, j, s_i, s_j)


def equation_107(i, j, s_i, s_j, f):
    """Relative distance driver: nu, gamma, eta, sigma."""
    return (
        2 * f[0] * f[1],
        equation_086(i, j, s_i, s_j) + 2 * f[1] ** 2 + 2 * f[0] * f[2],
        equation_087(i, j, s_i, s_j) + 6 * f[1] * f[2] + 2 * f[0] * f[3],
        equation_088(i, j, s_i, s_j) + 6 * f[2] ** 2 + 8 * f[1] * f[3] + 2 * f[0] * f[4],
    )


def equation_108(i, j, s_i, s_j, a_i, f):
    """Dot-2 distance driver: constraint."""
    return equation_095(i, j, s_i, s_j, a_i) / np.linalg.norm(a_i) - f[0]


def equation_109(i, a_i):
    """Dot-2 distance driver: Jacobian for r_i, r_j."""
    return tuple(block / np.linalg.norm(a_i) for block in equation_096(i, a_i))


def equation_110(i, j, s_i, s_j, a_i):
    """Dot-2 distance driver: Jacobian for pi_i, pi_j."""
    return tuple(block / np.linalg.norm(a_i) for block in equation_097(i, j, s_i, s_j, a_i))


def equation_111(i, j, s_i, s_j, a_i, f):
    """Dot-2 distance driver: nu, gamma, eta, sigma."""
    length = np.linalg.norm(a_i)
    return f[1], *(
        e(i, j, s_i, s_j, a_i) / length + f[k] for k, e in ((2, equation_098), (3, equation_099), (4, equation_100))
    )
