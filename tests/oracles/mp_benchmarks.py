"""Published benchmarks of multibody dynamics in the judge's own formulation: each function returns a closed `Problem`.

Every number is taken in decimals as published. Planar bodies in absolute coordinates are (x, y, angle) of the center
of mass, spatial ones (x, y, z) and four Euler parameters, with their normalization as a constraint.
"""

from mpmath import mp

from tests.oracles.mp_dynamics import Problem, Rate, cos, node, sin, sqrt


def squared(x, y):
    return x * x + y * y


class Planar:
    """Rigid body of the plane in absolute coordinates; points are given in a frame of its own, anywhere on it."""

    def __init__(self, problem, mass, inertia, center=("0", "0")):
        self.x, self.y, self.angle = self.coordinates = problem.coordinates(3)
        self.center = [mp.mpf(c) for c in center]
        for weight, function in ((mass, self.x), (mass, self.y), (inertia, self.angle)):
            problem.inertia(weight, function)

    def point(self, x, y):
        """Return the place of a point."""
        a, b = mp.mpf(x) - self.center[0], mp.mpf(y) - self.center[1]
        c, s = cos(self.angle), sin(self.angle)
        return [self.x + a * c - b * s, self.y + a * s + b * c]

    def at(self, x, y, angle):
        """Return the coordinates of a body of which the origin is at a place, turned by an angle."""
        a, b = self.center
        c, s = mp.cos(angle), mp.sin(angle)
        return [mp.mpf(x) + a * c - b * s, mp.mpf(y) + a * s + b * c, mp.mpf(angle)]


class Spatial:
    """Rigid body of space in absolute coordinates, center of mass and Euler parameters; inertia in principal axes."""

    def __init__(self, problem, mass, inertia, center=("0", "0", "0")):
        self.coordinates = problem.coordinates(7)
        self.position, (a, b, c, d) = self.coordinates[:3], self.coordinates[3:]
        self.center = [mp.mpf(x) for x in center]
        self.columns = [
            [a * a + b * b - c * c - d * d, 2 * (b * c + a * d), 2 * (b * d - a * c)],
            [2 * (b * c - a * d), a * a - b * b + c * c - d * d, 2 * (c * d + a * b)],
            [2 * (b * d + a * c), 2 * (c * d - a * b), a * a - b * b - c * c + d * d],
        ]
        for x in self.position:
            problem.inertia(mass, x)
        inertia = [mp.mpf(x) for x in inertia]
        for moment, column in zip(inertia, self.columns, strict=True):
            for entry in column:
                problem.inertia(sum(inertia) / 2 - moment, entry)
        problem.constraint(a * a + b * b + c * c + d * d - 1)

    def direction(self, vector):
        """Return a vector fixed in the body, in global axes."""
        v = [mp.mpf(x) for x in vector]
        return [sum((c[k] * x for c, x in zip(self.columns, v, strict=True)), node(0)) for k in range(3)]

    def point(self, *point):
        """Return the place of a point."""
        arm = self.direction([mp.mpf(x) - c for x, c in zip(point, self.center, strict=True)])
        return [x + r for x, r in zip(self.position, arm, strict=True)]


def join(problem, a, b):
    """Let two points coincide, the second on the body that is acted upon; its reaction is minus the multipliers."""
    for x, y in zip(a, b, strict=True):
        problem.constraint(y - x)


def double_four_bar():
    """Two four-bars in a row, IFToMM benchmark A02 with N = 2: five uniform rods of 1 m and 1 kg, gravity 9.81 m/s^2.

    In the angles of the five rods: the uprights from the ground at x = 0, 1 and 2, and the two bars upon them.
    """
    problem = Problem()
    a, b, c, upper, lower = problem.coordinates(5)
    third, half = mp.mpf(1) / 12, mp.mpf(1) / 2
    feet = [(mp.mpf(k) + cos(x), sin(x)) for k, x in enumerate((a, b, c))]
    for k, x in enumerate((a, b, c)):
        rod(problem, k + half * cos(x), half * sin(x), x, third)
    for (x, y), angle in ((feet[0], upper), (feet[1], lower)):
        rod(problem, x + half * cos(angle), y + half * sin(angle), angle, third)
    for k, angle in enumerate((upper, lower)):
        join(problem, (feet[k][0] + cos(angle), feet[k][1] + sin(angle)), feet[k + 1])
    return problem.close()


def rod(problem, x, y, angle, moment, mass="1", gravity="9.81"):
    """Add a rod with its weight."""
    for weight, function in ((mass, x), (mass, y), (moment, angle)):
        problem.inertia(weight, function)
    problem.force(-mp.mpf(mass) * mp.mpf(gravity), y)


def double_four_bar_start():
    """Return position and velocity: uprights upright, the tips moving to the right at 1 m/s."""
    right = mp.pi / 2
    return [right, right, right, 0, 0], [-1, -1, -1, 0, 0]


def parallel_four_bar():
    """The double four-bar in one coordinate: the uprights stay parallel, the bars level, so that nothing is singular.

    Returns the problem and the place of the tip of the first upright.
    """
    problem = Problem()
    (angle,) = problem.coordinates(1)
    tip = [problem.watch(cos(angle)), problem.watch(sin(angle))]
    for k in range(3):
        rod(problem, k + cos(angle) / 2, sin(angle) / 2, angle, mp.mpf(1) / 12)
    for _ in range(2):
        rod(problem, cos(angle), sin(angle), node(0), 0)
    return problem.close(), tip


def double_pendulum():
    """Two point masses of 1 kg on massless rods of 1 m, in absolute angles from the downward vertical."""
    problem = Problem()
    a, b = problem.coordinates(2)
    first = (sin(a), -cos(a))
    second = (first[0] + sin(b), first[1] - cos(b))
    for x, y in (first, second):
        problem.inertia(1, x)
        problem.inertia(1, y)
        problem.force("-9.81", y)
    return problem.close()


GOVERNOR = {"stiffness": "8e5", "damping": "4e4"}


def flyball_governor(stiffness=GOVERNOR["stiffness"], damping=GOVERNOR["damping"]):
    """IFToMM benchmark A05, the stiff governor, in the angle of the shaft, the falls of both rods and the slider.

    A rod hangs at 0.05 m from the axis at the top of the shaft (1 m), by `fall` below the horizontal, with a ball of
    5 kg at its end; spring and damper lead from its middle to the slider, 0.05 m from the axis, at height `s`.
    """
    problem = Problem()
    shaft, right, left, s = problem.coordinates(4)
    bar, ball, slider = mp.mpf("0.3"), mp.mpf(5), mp.mpf(3)
    across, along = bar / 12 * (1 + mp.mpf("0.01") ** 2), bar / 6 * mp.mpf("0.01") ** 2
    outward = (cos(shaft), sin(shaft))
    tangent = (-sin(shaft), cos(shaft), node(0))
    problem.inertia(along + slider * mp.mpf("0.1") ** 2 / 6, shaft)
    problem.inertia(slider, s)
    problem.force(slider * -mp.mpf("9.81"), s)
    for side, fall in ((1, right), (-1, left)):
        d = [side * outward[0] * cos(fall), side * outward[1] * cos(fall), -sin(fall)]
        f = [side * outward[0] * sin(fall), side * outward[1] * sin(fall), cos(fall)]
        hinge = [mp.mpf("0.05") * side * outward[0], mp.mpf("0.05") * side * outward[1], node(1)]
        for mass, arm in ((bar, "0.5"), (ball, 1)):
            place = [h + mp.mpf(arm) * x for h, x in zip(hinge, d, strict=True)]
            for x in place:
                problem.inertia(mass, x)
            problem.force(mass * -mp.mpf("9.81"), place[2])
        for weight, axis in ((across - along / 2, d), (along / 2, tangent), (along / 2, f)):
            for x in axis:
                problem.inertia(weight, x)
        height = 1 - mp.mpf("0.5") * sin(fall) - s
        reach = mp.mpf("0.5") * cos(fall)
        length = sqrt(squared(reach, height))
        force = (length - mp.mpf("0.5")) * -mp.mpf(stiffness) - Rate(length) * mp.mpf(damping)
        problem.force(force, length)
    return problem.close()


def governor_start():
    """Return position and velocity: rods 30 degrees below the horizontal, slider at 0.5 m, turning at 2 pi rad/s."""
    return [0, mp.pi / 6, mp.pi / 6, mp.mpf("0.5")], [2 * mp.pi, 0, 0, 0]


def spatial_slider_crank(stiffness=0, damping=0):
    """IFToMM benchmark, spatial rigid slider-crank: returns the problem and crank angle, slide and rod.

    The crank (0.08 m, about x through (0, 0.1, 0.12), its center of mass on the axis) starts upright; the rod (0.3 m)
    hangs on a ball at the crank and on a universal joint at the slider, which moves along x; weight acts along -z.
    Unlike in the benchmark, a spring with a damper may hold the slider to x = 0.2 m.
    """
    problem = Problem()
    angle, x = problem.coordinates(2)
    rod = Spatial(problem, "0.5", ("0.0004", "0.004", "0.004"))
    problem.inertia("0.0001", angle)
    problem.inertia(2, x)
    problem.force((x - mp.mpf("0.2")) * -mp.mpf(stiffness) - Rate(x) * mp.mpf(damping), x)
    problem.force(mp.mpf("-0.5") * mp.mpf("9.81"), rod.position[2])
    tip = [node(0), mp.mpf("0.1") - mp.mpf("0.08") * sin(angle), mp.mpf("0.12") + mp.mpf("0.08") * cos(angle)]
    join(problem, tip, rod.point("-0.15", 0, 0))
    join(problem, [x, node(0), node(0)], rod.point("0.15", 0, 0))
    problem.constraint(rod.direction((0, 1, 0))[0])
    return problem.close(), (angle, x, rod)


def slider_crank_start(problem):
    """Return position and velocity: crank upright, turning at 6 rad/s, the rod's y axis normal to the slide."""
    x = [mp.mpf(2) / 3, -mp.mpf(1) / 3, -mp.mpf(2) / 3]
    across = mp.sqrt(x[1] ** 2 + x[2] ** 2)
    y = [mp.mpf(0), -x[2] / across, x[1] / across]
    z = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]
    scalar = mp.sqrt(1 + x[0] + y[1] + z[2]) / 2
    turn = [(y[2] - z[1]) / (4 * scalar), (z[0] - x[2]) / (4 * scalar), (x[1] - y[0]) / (4 * scalar)]
    guess = [0, mp.mpf("0.2"), mp.mpf("0.1"), mp.mpf("0.05"), mp.mpf("0.1"), scalar, *turn]
    return problem.consistent(guess, [6] + [0] * 8, fixed=(0,))


STEWART = {"RB": "0.3", "RP": "0.2", "L": "0.445", "a": "0.02", "tau": "2", "mass": "12", "height": "0.02"}
STEWART_INERTIA = ("0.15", "0.18", "0.3")
STEWART_FEET = (("10", "50"), ("110", "70"), ("130", "170"), ("230", "190"), ("250", "290"), ("350", "310"))


def stewart():
    """The platform of the bank with a mass: six prescribed leg lengths, whose multipliers are minus the leg forces."""
    n = {name: mp.mpf(value) for name, value in STEWART.items()}
    problem = Problem()
    plate = Spatial(problem, n["mass"], STEWART_INERTIA, ("0", "0", n["height"]))
    problem.force(-n["mass"] * mp.mpf("9.81"), plate.position[2])
    for k, (below, above) in enumerate(STEWART_FEET):
        low, high = (mp.mpf(x) * mp.pi / 180 for x in (below, above))
        foot = [n["RB"] * mp.cos(low), n["RB"] * mp.sin(low), 0]
        top = plate.point(n["RP"] * mp.cos(high), n["RP"] * mp.sin(high), 0)
        d = [t - f for t, f in zip(top, foot, strict=True)]
        phase = 50 * k * mp.pi / 180
        law = n["L"] + n["a"] * sin(problem.time * (2 * mp.pi / n["tau"]) + phase)
        problem.constraint(sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) - law)
    return problem.close(), plate


def free_four_bar():
    """Four-bar of uniform rods (0.3, 0.7 and 0.5 m; 1, 2 and 1.5 kg) on a base of 0.6 m, in the angles of the rods."""
    problem = Problem()
    crank, coupler, rocker = problem.coordinates(3)
    a, b, c, base = (mp.mpf(x) for x in ("0.3", "0.7", "0.5", "0.6"))
    end = (a * cos(crank), a * sin(crank))
    rod(problem, a / 2 * cos(crank), a / 2 * sin(crank), crank, a**2 / 12)
    place = (end[0] + b / 2 * cos(coupler), end[1] + b / 2 * sin(coupler))
    rod(problem, *place, coupler, 2 * b**2 / 12, mass=2)
    mass = mp.mpf("1.5")
    rod(problem, base + c / 2 * cos(rocker), c / 2 * sin(rocker), rocker, mass * c**2 / 12, mass=mass)
    tip = (end[0] + b * cos(coupler), end[1] + b * sin(coupler))
    join(problem, tip, (base + c * cos(rocker), c * sin(rocker)))
    return problem.close()


def spatial_double_pendulum():
    """Two bodies on crossed hinges: the first turns about the global y axis, the second about the x axis of the first.

    Their frames lie in the hinges; at rest both hang down along -z. Returns the problem and the tip of the second.
    """
    problem = Problem()
    first, second = problem.coordinates(2)
    c, s, d, e = cos(first), sin(first), cos(second), sin(second)
    zero, one = node(0), node(1)
    a = [[c, zero, -s], [zero, one, zero], [s, zero, c]]  # columns: the axes of the first body
    b = [a[0], _mix(a[1], d, a[2], e), _mix(a[1], -e, a[2], d)]
    hinge = [x * mp.mpf("-0.5") for x in a[2]]
    for axes, origin, mass, moments in (
        (a, [zero] * 3, "2", ("0.03", "0.04", "0.02")),
        (b, hinge, "1.5", ("0.05", "0.02", "0.06")),
    ):
        center = [o + x * mp.mpf("-0.3") for o, x in zip(origin, axes[2], strict=True)]
        for x in center:
            problem.inertia(mass, x)
        problem.force(mp.mpf(mass) * mp.mpf("-9.81"), center[2])
        moments = [mp.mpf(x) for x in moments]
        for moment, axis in zip(moments, axes, strict=True):
            for x in axis:
                problem.inertia(sum(moments) / 2 - moment, x)
    tip = [problem.watch(h + x * mp.mpf("-0.6")) for h, x in zip(hinge, b[2], strict=True)]
    return problem.close(), tip


def _mix(a, c, b, s):
    return [x * c + y * s for x, y in zip(a, b, strict=True)]
