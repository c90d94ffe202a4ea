"""Sommer 2024, appendix A: the derivations of eta and sigma of the revolute and spherical joints, term by term.

One function per equation, A1-A34. Bodies and points as in `sommer_planar` (A1-A16) and `sommer_spatial` (A17-A34).
What only repeats an equation of the paper calls it; the rest is written out from the appendix.
"""

import numpy as np

from tests.oracles import sommer_planar as planar, sommer_spatial as spatial


def appendix_01(gamma_rate, product):
    """Eta of the revolute joint from gamma' and (Phi_q q'')_q q'."""
    return gamma_rate - product


def appendix_02(i, j, s_i, s_j):
    """Revolute: Jacobian."""
    return planar.equation_022(i, j, s_i, s_j)


def appendix_03(i, j, s_i, s_j):
    """Revolute: gamma."""
    return planar.equation_023(i, j, s_i, s_j)


def _planar(term, i, j, s_i, s_j):
    """Return a term, of the angle's derivatives p, A s and B s, for body j less that for body i."""

    def part(body, s):
        A, _, B = planar.equation_009(body.phi[0])
        return term(body.phi, A @ s, B @ s)

    return part(j, s_j) - part(i, s_i)


def appendix_04(i, j, s_i, s_j):
    """Revolute: time derivative of gamma."""
    return _planar(lambda p, As, Bs: p[1] ** 3 * Bs + 2 * p[1] * p[2] * As, i, j, s_i, s_j)


def appendix_05(i):
    """Generalized accelerations of a planar body."""
    return np.append(i.r[2], i.phi[2])


def appendix_06(i, j, s_i, s_j):
    """Revolute: Phi_q q''."""
    return j.r[2] - i.r[2] + _planar(lambda p, As, Bs: p[2] * Bs, i, j, s_i, s_j)


def _planar_slopes(k, i, j, s_i, s_j):
    """Return the derivatives of Phi_q q^(k) with respect to the coordinates of i and j."""
    zero = np.zeros((2, 2))
    A_i, A_j = planar.equation_009(i.phi[0])[0], planar.equation_009(j.phi[0])[0]
    return np.column_stack([zero, i.phi[k] * A_i @ s_i]), np.column_stack([zero, -j.phi[k] * A_j @ s_j])


def appendix_07(i, j, s_i, s_j):
    """Revolute: derivatives of Phi_q q''."""
    return _planar_slopes(2, i, j, s_i, s_j)


def appendix_08(i, j, s_i, s_j):
    """Revolute: (Phi_q q'')_q q'."""
    return _planar(lambda p, As, Bs: -p[1] * p[2] * As, i, j, s_i, s_j)


def appendix_09(i, j, s_i, s_j):
    """Revolute: eta."""
    return _planar(lambda p, As, Bs: 3 * p[1] * p[2] * As + p[1] ** 3 * Bs, i, j, s_i, s_j)


def appendix_10(eta_rate, product):
    """Sigma of the revolute joint from eta' and (Phi_q q''')_q q'."""
    return eta_rate - product


def _eta_rate(p, As, Bs):
    slow = 3 * p[2] ** 2 * As + 3 * p[1] * p[3] * As
    return -(p[1] ** 4) * As + 6 * p[1] ** 2 * p[2] * Bs + slow


def appendix_11(i, j, s_i, s_j):
    """Revolute: time derivative of eta."""
    return _planar(_eta_rate, i, j, s_i, s_j)


def appendix_12(i):
    """Generalized jerks of a planar body."""
    return np.append(i.r[3], i.phi[3])


def appendix_13(i, j, s_i, s_j):
    """Revolute: Phi_q q'''."""
    return j.r[3] - i.r[3] + _planar(lambda p, As, Bs: p[3] * Bs, i, j, s_i, s_j)


def appendix_14(i, j, s_i, s_j):
    """Revolute: derivatives of Phi_q q'''."""
    return _planar_slopes(3, i, j, s_i, s_j)


def appendix_15(i, j, s_i, s_j):
    """Revolute: (Phi_q q''')_q q'."""
    return _planar(lambda p, As, Bs: -p[1] * p[3] * As, i, j, s_i, s_j)


def appendix_16(i, j, s_i, s_j):
    """Revolute: sigma."""
    return _planar(lambda p, As, Bs: _eta_rate(p, As, Bs) + p[1] * p[3] * As, i, j, s_i, s_j)


def appendix_17(gamma_rate, product):
    """Eta of the spherical joint from gamma' and (Phi_q q'')_q q'."""
    return gamma_rate - product


def appendix_18():
    """Spherical: Jacobian for r_i, r_j."""
    return spatial.equation_078()


def appendix_19(i, j, s_i, s_j):
    """Spherical: Jacobian for pi_i, pi_j."""
    return spatial.equation_079(i, j, s_i, s_j)


def appendix_20(i, j, s_i, s_j):
    """Spherical: gamma."""
    return spatial.equation_080(i, j, s_i, s_j)


def _spatial(term, i, j, s_i, s_j):
    """Return A times a term, of the skew matrices of angular velocity to jounce, times s, for i less that for j."""

    def part(body, s):
        return body.A @ term(*(spatial.equation_060(w) for w in body.w)) @ s

    return part(i, s_i) - part(j, s_j)


def appendix_21(i, j, s_i, s_j):
    """Spherical: time derivative of gamma."""
    return _spatial(lambda w, dw, ddw, dddw: dw @ w + w @ dw + w @ w @ w, i, j, s_i, s_j)


def appendix_22(i):
    """Generalized accelerations of a spatial body."""
    return np.append(i.r[2], i.w[1])


def appendix_23(i, j, s_i, s_j):
    """Spherical: Phi_q q''."""
    return j.r[2] - i.r[2] - _spatial(lambda w, dw, ddw, dddw: dw, i, j, s_i, s_j)


def _spatial_slopes(k, i, j, s_i, s_j):
    """Return the derivatives of Phi_q q^(k + 1) with respect to pi_i, pi_j; those to r_i, r_j are zero."""

    def part(body, s):
        w, s = spatial.equation_060(body.w[k]), spatial.equation_060(s)
        return body.A @ (w @ s - s @ w)

    return part(i, s_i), -part(j, s_j)


def appendix_24(i, j, s_i, s_j):
    """Spherical: derivatives of Phi_q q'' with respect to pi_i, pi_j."""
    return _spatial_slopes(1, i, j, s_i, s_j)


def appendix_25(i, j, s_i, s_j):
    """Spherical: (Phi_q q'')_q q'."""
    return -_spatial(lambda w, dw, ddw, dddw: w @ dw, i, j, s_i, s_j)


def appendix_26(i, j, s_i, s_j):
    """Spherical: eta."""
    return _spatial(lambda w, dw, ddw, dddw: 2 * w @ dw + dw @ w + w @ w @ w, i, j, s_i, s_j)


def appendix_27(eta_rate, product):
    """Sigma of the spherical joint from eta' and (Phi_q q''')_q q'."""
    return eta_rate - product


def appendix_28(i, j, s_i, s_j):
    """Spherical: time derivative of eta."""

    def part(body, s):
        return body.A @ (appendix_29(body) + spatial.equation_060(body.w[0]) @ spatial.equation_063(body)) @ s

    return part(i, s_i) - part(j, s_j)


def appendix_29(i):
    """Time derivative of the angular jerk product matrix H."""
    w, dw, ddw, _ = (spatial.equation_060(x) for x in i.w)
    return ddw @ w + 3 * dw @ dw + 2 * w @ ddw + dw @ w @ w + w @ dw @ w + w @ w @ dw


def appendix_30(i):
    """Generalized jerks of a spatial body."""
    return np.append(i.r[3], i.w[2])


def appendix_31(i, j, s_i, s_j):
    """Spherical: Phi_q q'''."""
    return j.r[3] - i.r[3] - _spatial(lambda w, dw, ddw, dddw: ddw, i, j, s_i, s_j)


def appendix_32(i, j, s_i, s_j):
    """Spherical: derivatives of Phi_q q''' with respect to pi_i, pi_j."""
    return _spatial_slopes(2, i, j, s_i, s_j)


def appendix_33(i, j, s_i, s_j):
    """Spherical: (Phi_q q''')_q q'."""
    return -_spatial(lambda w, dw, ddw, dddw: w @ ddw, i, j, s_i, s_j)


def appendix_34(i, j, s_i, s_j):
    """Spherical: sigma."""

    def matrix(w, dw, ddw, dddw):
        quadratic = ddw @ w + 3 * dw @ dw + 3 * w @ ddw
        return quadratic + dw @ w @ w + 2 * w @ dw @ w + 3 * w @ w @ dw + w @ w @ w @ w

    return _spatial(matrix, i, j, s_i, s_j)
