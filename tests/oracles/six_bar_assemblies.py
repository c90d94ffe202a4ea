"""All assemblies of a Stephenson III six-bar driven at its link, by elimination with many digits.

The tip R of the driven link is known. The coupler, at an angle phi, joins the crank's tip B with C on the rocker's
circle about D, and its point P with a rod to R. Both conditions are linear in cos(phi) and sin(phi), so that Cramer's
rule leaves one equation in the crank's angle, of degree six in the tangent of its half: at most six assemblies. Nothing
here comes from jounce.
"""

import mpmath

DIGITS, SAMPLES = 60, 32


def crank_angles(a, b, c, d, px, py, l, r, qx, qy, link):  # noqa: E741 - the names of the problem
    """Return the angles of the crank of all assemblies at an angle of the link, rad."""
    with mpmath.workdps(DIGITS):
        a, b, c, d, px, py, l, r, qx, qy, link = map(mpmath.mpf, map(float, (a, b, c, d, px, py, l, r, qx, qy, link)))  # noqa: E741
        tip = qx + l * mpmath.cos(link), qy + l * mpmath.sin(link)

        def left(z):
            cosine, sine = (z + 1 / z) / 2, (z - 1 / z) / (2j)
            bx, by = a * cosine, a * sine
            rows = []
            for (ux, uy), (tx, ty), length in (((b, 0), (d, 0), c), ((px, py), tip, r)):
                x, y = bx - tx, by - ty  # |(x, y) + turn(u)|^2 = length^2
                rows.append((2 * (x * ux + y * uy), 2 * (y * ux - x * uy), length**2 - x * x - y * y - ux**2 - uy**2))
            (a1, b1, c1), (a2, b2, c2) = rows
            det = a1 * b2 - a2 * b1
            return (c1 * b2 - c2 * b1) ** 2 + (a1 * c2 - a2 * c1) ** 2 - det**2

        unit = [mpmath.expjpi(mpmath.mpf(2 * k) / SAMPLES) for k in range(SAMPLES)]
        values = [left(z) for z in unit]
        half = SAMPLES // 2
        coefficients = [
            sum(v * mpmath.expjpi(-mpmath.mpf(2 * k * n) / SAMPLES) for k, v in enumerate(values)) / SAMPLES
            for n in range(-half + 1, half)
        ]
        size = max(map(abs, coefficients))
        kept = [k for k, x in enumerate(coefficients) if abs(x) > size * mpmath.mpf(10) ** (-DIGITS // 2)]
        polynomial = coefficients[kept[0] : kept[-1] + 1]
        roots = mpmath.polyroots(polynomial[::-1], maxsteps=1000, extraprec=400)
        near = mpmath.mpf(10) ** (-DIGITS // 3)
        return [float(mpmath.arg(z)) for z in roots if abs(abs(z) - 1) < near], len(polynomial) - 1
