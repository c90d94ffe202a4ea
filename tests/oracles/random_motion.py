"""Random motions for the oracles: the same motion as a NumPy state and as series in thirty digits."""

import numpy as np
from mpmath import mp, mpf

from tests.oracles import sommer_planar, sommer_spatial
from tests.oracles.mp_joints import PlanarPose, SpatialPose
from tests.oracles.mp_series import Series, sin_cos

ORDER = 4


def series_of(derivatives):
    """Return the series with the given plain derivatives."""
    return Series([mpf(float(d)) / mp.factorial(k) for k, d in enumerate(derivatives)])


def planar_body(rng):
    """Return a random planar state and its pose in series."""
    r, phi = rng.normal(size=(ORDER + 1, 2)), rng.normal(size=ORDER + 1)
    s, c = sin_cos(series_of(phi))
    pose = PlanarPose([series_of(r[:, 0]), series_of(r[:, 1]), c, s], mpf(float(phi[0])))
    return sommer_planar.Body(r, phi), pose


def quaternion_series(p, w):
    """Return the quaternion series with p' = p (0, w') / 2 from its first value and the series of w'."""
    table = [list(p)]
    for k in range(ORDER):
        total = [mpf(0)] * 4
        for m in range(k + 1):
            a, (x, y, z) = table[m], [c.c[k - m] for c in w]
            total[0] += -a[1] * x - a[2] * y - a[3] * z
            total[1] += a[0] * x + a[2] * z - a[3] * y
            total[2] += a[0] * y + a[3] * x - a[1] * z
            total[3] += a[0] * z + a[1] * y - a[2] * x
        table.append([c / (2 * (k + 1)) for c in total])
    return [Series(column) for column in zip(*table, strict=True)]


def spatial_body(rng, quaternion=None, w=None):
    """Return a random spatial state and its pose in series; the attitude and its rates may be given."""
    r = rng.normal(size=(ORDER + 1, 3))
    w = rng.normal(size=(ORDER, 3)) if w is None else w
    p = [mpf(float(x)) for x in (rng.normal(size=4) if quaternion is None else quaternion)]
    length = mp.sqrt(mp.fdot(p, p))
    p = quaternion_series([x / length for x in p], [series_of([*column, 0.0]) for column in w.T])
    pose = SpatialPose([series_of(column) for column in r.T] + p)
    A = np.array([[float(x.c[0]) for x in row] for row in pose.rows()])
    return sommer_spatial.Body(r, A, w), pose


def derivatives(series):
    """Return plain derivatives as floats."""
    return np.array([float(d) for d in series.derivatives()])
