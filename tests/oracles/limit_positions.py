"""Limit positions of the crank of simple linkages in closed form: where the rest of the linkage is stretched or folded.

Each function returns all values of the driven angle at which the crank stands, in (-pi, pi]; each belongs to exactly
one configuration. Nothing here comes from jounce.
"""

import mpmath
import numpy as np

DIGITS = 50


def four_bar(a, b, c, d):
    """Crank a, coupler b, rocker c, ground d: coupler and rocker in line (Grashof 1883)."""
    with mpmath.workdps(DIGITS):
        a, b, c, d = map(mpmath.mpf, (a, b, c, d))
        cosines = [(a * a + d * d - (b + side * c) ** 2) / (2 * a * d) for side in (1, -1)]
        return _both([mpmath.acos(x) for x in cosines if abs(x) < 1])


def slider_crank(a, b, e):
    """Crank a at the origin, rod b, slider on the line y = e: the rod across the line."""
    with mpmath.workdps(DIGITS):
        a, b, e = map(mpmath.mpf, (a, b, e))
        sines = [(e + side * b) / a for side in (1, -1)]
        angles = [mpmath.asin(x) for x in sines if abs(x) < 1]
        return np.array([float(_principal(x)) for angle in angles for x in (angle, mpmath.pi - angle)])


def rssr(a, r, rod, center, axis):
    """Crank a about z at the origin, rocker r about an axis through a center: the tip in the plane of axis and rod.

    With p the tip of the crank as seen from the center, the rocker's circle and the sphere of the rod touch where
    ``(p.p + r^2 - l^2)^2 = 4 r^2 |p x n|^2``, a quartic in the tangent of half the angle.
    """
    with mpmath.workdps(DIGITS):
        n = mpmath.matrix(list(map(mpmath.mpf, map(float, axis))))
        n = n / mpmath.norm(n)
        d = [mpmath.mpf(float(x)) for x in center]
        a, r, rod = map(mpmath.mpf, map(float, (a, r, rod)))
        one, cos, sin = [1, 0, 1], [1, 0, -1], [0, 2, 0]  # times 1 + t^2, by powers of t

        def add(*terms):
            size = max(len(x) for _, x in terms)
            return [sum(w * (x[k] if k < len(x) else 0) for w, x in terms) for k in range(size)]

        def product(x, y):
            found = [mpmath.mpf(0)] * (len(x) + len(y) - 1)
            for i, u in enumerate(x):
                for j, v in enumerate(y):
                    found[i + j] += u * v
            return found

        p = [add((a, cos), (-d[0], one)), add((a, sin), (-d[1], one)), add((-d[2], one))]
        square = add((a * a + d[0] ** 2 + d[1] ** 2 + d[2] ** 2, one), (-2 * a * d[0], cos), (-2 * a * d[1], sin))
        height = add(*((n[k], p[k]) for k in range(3)))
        away = add((1, product(square, one)), (-1, product(height, height)))  # |p x n|^2
        gap = add((1, square), (r * r - rod * rod, one))
        quartic = add((1, product(gap, gap)), (-4 * r * r, away))
        roots = mpmath.polyroots(quartic[::-1], maxsteps=500, extraprec=400)
        real = [mpmath.re(x) for x in roots if abs(mpmath.im(x)) < mpmath.mpf(10) ** (-DIGITS // 2)]
        return np.array([float(2 * mpmath.atan(x)) for x in real])


def _both(angles):
    return np.array([float(side * x) for x in angles for side in (1, -1)])


def _principal(angle):
    return angle - 2 * mpmath.pi * mpmath.ceil((angle - mpmath.pi) / (2 * mpmath.pi))
