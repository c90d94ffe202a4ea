"""Sommer 2024, section 2: equations 1-8 for any constraint Phi(q, t), by nested directional derivatives in JAX.

``(Phi_q a)_q b`` is the derivative along b of the derivative along a, both held constant. ``rates`` holds the first
four derivatives of q. A coordinate space is told by ``tangent(q, v)``, the velocity that v stands for: v itself for
true coordinates (planar bodies); ``A skew(w')`` for an attitude A with body-fixed angular velocity.

Beyond the paper: with body-fixed angular velocities the derivatives along a and along b do not commute, and the printed
forms of equations 4 and 5, which merge them, are wrong; `equation_004_body_axes` and `equation_005_body_axes` keep the
order of the factors. Equations 6-8, with the order as printed, hold for both.
"""

import jax


def true_coordinates(q, v):
    """Return the velocity of true coordinates: v itself."""
    return v


class Derivatives:
    """Constraint Phi(q, t) at a state, with its derivatives along rates and time."""

    def __init__(self, phi, q, t, tangent=true_coordinates):
        self.phi, self.q, self.t, self.tangent = phi, q, t, tangent

    def __call__(self, *along, times=0):
        """Return (..((Phi_q a)_q b)..), differentiated `times` times in t; a is the first of `along`."""
        g = self.phi
        for v in along:
            g = self._along(g, v)
        for _ in range(times):
            g = self._in_time(g)
        return g(self.q, self.t)

    def _along(self, g, v):
        return lambda q, t: jax.jvp(lambda x: g(x, t), (q,), (self.tangent(q, v),))[1]

    @staticmethod
    def _in_time(g):
        return lambda q, t: jax.jvp(lambda s: g(q, s), (t,), (1.0,))[1]


def equation_001(phi, q, t):
    """The constraint itself."""
    return phi(q, t)


def equation_002(D):
    """Right-hand side of velocity, nu."""
    return -D(times=1)


def equation_003(D, rates):
    """Right-hand side of acceleration, gamma."""
    (v, *_) = rates
    return -D(v, v) - 2 * D(v, times=1) - D(times=2)


def equation_004(D, rates):
    """Right-hand side of jerk, eta, as printed: for true coordinates only."""
    v, a, *_ = rates
    fixed = -3 * D(v, a) - D(v, v, v)
    return fixed - 3 * D(a, times=1) - 3 * D(v, v, times=1) - 3 * D(v, times=2) - D(times=3)


def equation_004_body_axes(D, rates):
    """Right-hand side of jerk, eta, with the order of the factors kept: for body-fixed angular velocities too."""
    v, a, *_ = rates
    fixed = -2 * D(a, v) - D(v, a) - D(v, v, v)
    return fixed - 3 * D(a, times=1) - 3 * D(v, v, times=1) - 3 * D(v, times=2) - D(times=3)


def _rheonomic_jounce(D, v, a, b, mixed):
    """Return the terms of sigma that hold a derivative in time."""
    once = -4 * D(b, times=1) - 4 * mixed - 4 * D(v, v, v, times=1)
    return once - 6 * D(a, times=2) - 6 * D(v, v, times=2) - 4 * D(v, times=3) - D(times=4)


def equation_005(D, rates):
    """Right-hand side of jounce, sigma, as printed: for true coordinates only."""
    v, a, b, *_ = rates
    fixed = -4 * D(b, v) - 3 * D(a, a) - 6 * D(v, v, a) - D(v, v, v, v)
    return fixed + _rheonomic_jounce(D, v, a, b, 3 * D(v, a, times=1))


def equation_005_body_axes(D, rates):
    """Right-hand side of jounce, sigma, with the order of the factors kept: for body-fixed angular velocities too."""
    v, a, b, *_ = rates
    fixed = -3 * D(b, v) - D(v, b) - 3 * D(a, a) - 3 * D(a, v, v) - 2 * D(v, a, v) - D(v, v, a) - D(v, v, v, v)
    return fixed + _rheonomic_jounce(D, v, a, b, 2 * D(a, v, times=1) + D(v, a, times=1))


def equation_006(D, rates):
    """Gamma of a constraint independent of time."""
    return -D(rates[0], rates[0])


def _rate_of(expression, D, rates):
    """Return the time derivative of an expression of D and the first rates, along the motion, time held still."""

    def moved(q, *lower):
        return expression(Derivatives(D.phi, q, D.t, D.tangent), lower)

    n = len(rates) - 1
    return jax.jvp(moved, (D.q, *rates[:n]), (D.tangent(D.q, rates[0]), *rates[1 : n + 1]))[1]


def equation_007(D, rates):
    """Eta of a constraint independent of time, from the time derivative of gamma."""
    return _rate_of(equation_006, D, rates[:2]) - D(rates[1], rates[0])


def equation_008(D, rates):
    """Sigma of a constraint independent of time, from the time derivative of eta."""
    return _rate_of(equation_007, D, rates[:3]) - D(rates[2], rates[0])
