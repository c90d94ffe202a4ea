"""Appendix A of S against what the library reads off jets: Jacobian, gamma, eta and sigma, and the terms between."""

import numpy as np

import jounce as jn
from tests.constraints.test_sommer import ROUNDING, SEEDS, Planar, Spatial
from tests.oracles import sommer_appendix as appendix


def near(found, right):
    np.testing.assert_allclose(found, right, rtol=0, atol=ROUNDING * (1 + np.abs(right).max()))


@SEEDS
def test_equations_a1_to_a16_revolute(seed):
    case = Planar(seed)
    reading, two = case.read(jn.planar.Revolute, case.s_i, case.s_j), case.two
    _, gamma, eta, sigma = reading.rights
    J = np.hstack(reading.jacobian)
    velocity = np.concatenate([[*b.r[1], b.phi[1]] for b in (case.i, case.j)])
    near(J, np.hstack(appendix.appendix_02(*two)))
    near(gamma, appendix.appendix_03(*two))
    for rates, product, slopes, along, rate, right, composed, printed in (
        (
            appendix.appendix_05,
            appendix.appendix_06,
            appendix.appendix_07,
            appendix.appendix_08,
            appendix.appendix_04,
            eta,
            appendix.appendix_01,
            appendix.appendix_09,
        ),
        (
            appendix.appendix_12,
            appendix.appendix_13,
            appendix.appendix_14,
            appendix.appendix_15,
            appendix.appendix_11,
            sigma,
            appendix.appendix_10,
            appendix.appendix_16,
        ),
    ):
        near(J @ np.concatenate([rates(case.i), rates(case.j)]), product(*two))
        near(np.hstack(slopes(*two)) @ velocity, along(*two))
        near(right, composed(rate(*two), np.hstack(slopes(*two)) @ velocity))
        near(right, printed(*two))


@SEEDS
def test_equations_a17_to_a34_spherical(seed):
    case = Spatial(seed)
    reading, two = case.read(jn.spatial.Spherical, case.s_i, case.s_j), case.two
    _, gamma, eta, sigma = reading.rights
    (r_i, r_j), (pi_i, pi_j) = appendix.appendix_18(), appendix.appendix_19(*two)
    J = np.hstack(reading.jacobian)
    near(J, np.hstack([r_i, pi_i, r_j, pi_j]))
    near(gamma, appendix.appendix_20(*two))
    spin = np.concatenate([case.i.w[0], case.j.w[0]])
    for rates, product, slopes, along, rate, right, composed, printed in (
        (
            appendix.appendix_22,
            appendix.appendix_23,
            appendix.appendix_24,
            appendix.appendix_25,
            appendix.appendix_21,
            eta,
            appendix.appendix_17,
            appendix.appendix_26,
        ),
        (
            appendix.appendix_30,
            appendix.appendix_31,
            appendix.appendix_32,
            appendix.appendix_33,
            appendix.appendix_28,  # with A29, the rate of H
            sigma,
            appendix.appendix_27,
            appendix.appendix_34,
        ),
    ):
        near(J @ np.concatenate([rates(case.i), rates(case.j)]), product(*two))
        near(np.hstack(slopes(*two)) @ spin, along(*two))
        near(right, composed(rate(*two), np.hstack(slopes(*two)) @ spin))
        near(right, printed(*two))
