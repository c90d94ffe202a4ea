"""Small motions of linkages in one coordinate, by Lagrange's equation in mpmath: an oracle that shares no code."""

import mpmath as mp

DIGITS = 40


class SprungFourBar:
    """A planar four-bar ABCD in gravity: a spring from the crank's middle to the ground, one on the rocker's angle.

    The energy is a function of the crank's angle, and so is the generalized mass, as the kinetic energy is quadratic in
    its rate. Derivatives are numerical ones, of 40 digits.
    """

    lengths = {"AB": "0.3", "BC": "0.9", "CD": "0.7", "AD": "1.0"}
    masses = {"crank": ("1.5", "0.02"), "coupler": ("2.0", "0.15"), "rocker": ("1.2", "0.06")}  # kg, kg m^2
    centers = {"crank": ("0.14", "0.02"), "coupler": ("0.4", "0.05"), "rocker": ("0.33", "-0.03")}  # m
    spring = {"anchor": ("-0.2", "0.9"), "stiffness": "120", "length": "0.5"}
    turn = {"stiffness": "6.5", "angle": "1.3"}
    gravity = "9.81"

    def angles(self, crank):
        """Angles of coupler and rocker, the coupler's joint C above the line BD."""
        a, b, c, d = (mp.mpf(self.lengths[k]) for k in ("AB", "BC", "CD", "AD"))
        x, y = d - a * mp.cos(crank), -a * mp.sin(crank)  # from B to D
        distance = mp.sqrt(x * x + y * y)
        coupler = mp.atan2(y, x) + mp.acos((b * b + distance**2 - c * c) / (2 * b * distance))
        rocker = mp.atan2(a * mp.sin(crank) + b * mp.sin(coupler), a * mp.cos(crank) + b * mp.cos(coupler) - d)
        return coupler, rocker

    def centers_at(self, crank):
        """Centers of mass and angles of the bodies."""
        coupler, rocker = self.angles(crank)
        a, d = mp.mpf(self.lengths["AB"]), mp.mpf(self.lengths["AD"])
        origins = {"crank": (0, 0), "coupler": (a * mp.cos(crank), a * mp.sin(crank)), "rocker": (d, 0)}
        found = []
        for (name, angle), (mass, inertia) in zip(
            (("crank", crank), ("coupler", coupler), ("rocker", rocker)), self.masses.values(), strict=True
        ):
            u, v = map(mp.mpf, self.centers[name])
            x = origins[name][0] + u * mp.cos(angle) - v * mp.sin(angle)
            y = origins[name][1] + u * mp.sin(angle) + v * mp.cos(angle)
            found.append((mp.mpf(mass), mp.mpf(inertia), x, y, angle))
        return found

    def energy(self, crank):
        """Potential energy of weight and springs, J."""
        weight = sum(m * mp.mpf(self.gravity) * y for m, _, _, y, _ in self.centers_at(crank))
        half = mp.mpf(self.lengths["AB"]) / 2
        x, y = (mp.mpf(c) - half * f(crank) for c, f in zip(self.spring["anchor"], (mp.cos, mp.sin), strict=True))
        elongation = mp.sqrt(x * x + y * y) - mp.mpf(self.spring["length"])
        turned = self.angles(crank)[1] - mp.mpf(self.turn["angle"])
        return (
            weight
            + mp.mpf(self.spring["stiffness"]) * elongation**2 / 2
            + mp.mpf(self.turn["stiffness"]) * turned**2 / 2
        )

    def mass(self, crank):
        """Generalized mass of the crank's angle, kg m^2."""
        total = mp.mpf(0)
        for k in range(3):
            m, inertia, *_ = self.centers_at(crank)[k]
            dx, dy, dangle = (mp.diff(lambda q, i=i, k=k: self.centers_at(q)[k][i], crank) for i in (2, 3, 4))
            total += m * (dx**2 + dy**2) + inertia * dangle**2
        return total

    def rest(self, near):
        """Angle of the crank at the equilibrium near an angle, and the square of the angular frequency there."""
        with mp.workdps(DIGITS):
            crank = mp.findroot(lambda q: mp.diff(self.energy, q), mp.mpf(near), tol=mp.mpf(10) ** -(DIGITS // 2 + 5))
            square = mp.diff(self.energy, crank, 2) / self.mass(crank)
            return float(crank), float(square)
