"""Published benchmarks of multibody dynamics in the judge's own formulation: each function returns a closed `Problem`.

Every number is taken in decimals as published. Planar bodies in absolute coordinates are (x, y, angle) of the centre of
mass, spatial ones are (x, y, z) of the centre of mass and four Euler parameters with their normalisation as a constraint.
"""

from mpmath import mp

from tests.oracles.mp_dynamics import Problem, Rate, cos, node, sin, sqrt

ANDREWS = {
    **{"m1": "0.04325", "m2": "0.00365", "m3": "0.02373", "m4": "0.00706", "m5": "0.07050", "m6": "0.00706"},
    **{"m7": "0.05498", "i1": "2.194e-6", "i2": "4.410e-7", "i3": "5.255e-6", "i4": "5.667e-7", "i5": "1.169e-5"},
    **{"i6": "5.667e-7", "i7": "1.912e-5", "xa": "-0.06934", "ya": "-0.00227", "xb": "-0.03635", "yb": "0.03273"},
    **{"xc": "0.014", "yc": "0.072", "c0": "4530", "l0": "0.07785", "mom": "0.033", "d": "0.028", "da": "0.0115"},
    **{"e": "0.02", "ea": "0.01421", "rr": "0.007", "ra": "0.00092", "ss": "0.035", "sa": "0.01874"},
    **{"sb": "0.01043", "sc": "0.018", "sd": "0.02", "ta": "0.02308", "tb": "0.00916", "u": "0.04", "ua": "0.01228"},
    **{"ub": "0.00449", "zf": "0.02", "zt": "0.04", "fa": "0.01421"},
}
ANDREWS_NAMES = ("beta", "Theta", "gamma", "Phi", "delta", "Omega", "epsilon")
ANDREWS_START = (  # of the test set, to about 28 digits
    "-0.0617138900142764496358948458001",
    "0",
    "0.455279819163070380255912382449",
    "0.222668390165885884674473185609",
    "0.487364979543842550225598953530",
    "-0.222668390165885884674473185609",
    "1.23054744454982119249735015568",
)


def andrews():
    """Andrews' squeezing mechanism in seven angles with six constraints: the formulation of the IVP test set."""
    n = {name: mp.mpf(value) for name, value in ANDREWS.items()}
    problem = Problem()
    beta, theta, gamma, phi, delta, omega, epsilon = q = problem.coordinates(7)
    second, fourth, sixth = beta + theta, phi + delta, omega + epsilon
    links = (beta, second, gamma, fourth, delta, sixth, epsilon)
    crank = [n["rr"] * cos(beta), n["rr"] * sin(beta)]
    centres = [
        (n["ra"] * cos(beta), n["ra"] * sin(beta)),
        (crank[0] - n["da"] * cos(second), crank[1] - n["da"] * sin(second)),
        (n["xb"] + n["sa"] * sin(gamma) + n["sb"] * cos(gamma), n["yb"] - n["sa"] * cos(gamma) + n["sb"] * sin(gamma)),
        (
            n["xa"] + n["zt"] * cos(delta) + (n["e"] - n["ea"]) * sin(fourth),
            n["ya"] + n["zt"] * sin(delta) - (n["e"] - n["ea"]) * cos(fourth),
        ),
        (n["xa"] + n["ta"] * cos(delta) - n["tb"] * sin(delta), n["ya"] + n["ta"] * sin(delta) + n["tb"] * cos(delta)),
        (
            n["xa"] + n["u"] * sin(epsilon) + (n["zf"] - n["fa"]) * cos(sixth),
            n["ya"] - n["u"] * cos(epsilon) + (n["zf"] - n["fa"]) * sin(sixth),
        ),
        (
            n["xa"] + n["ua"] * sin(epsilon) - n["ub"] * cos(epsilon),
            n["ya"] - n["ua"] * cos(epsilon) - n["ub"] * sin(epsilon),
        ),
    ]
    for k, (centre, angle) in enumerate(zip(centres, links, strict=True), 1):
        for coordinate in centre:
            problem.inertia(n[f"m{k}"], coordinate)
        problem.inertia(n[f"i{k}"], angle)
    problem.force(n["mom"], beta)
    spring = sqrt(
        _squared(
            n["xb"] + n["sd"] * cos(gamma) + n["sc"] * sin(gamma) - n["xc"],
            n["yb"] + n["sd"] * sin(gamma) - n["sc"] * cos(gamma) - n["yc"],
        )
    )
    problem.force((spring - n["l0"]) * -n["c0"], spring)
    tip = [crank[0] - n["d"] * cos(second), crank[1] - n["d"] * sin(second)]
    ends = [
        (n["xb"] + n["ss"] * sin(gamma), n["yb"] - n["ss"] * cos(gamma)),
        (
            n["xa"] + n["e"] * sin(fourth) + n["zt"] * cos(delta),
            n["ya"] - n["e"] * cos(fourth) + n["zt"] * sin(delta),
        ),
        (
            n["xa"] + n["zf"] * cos(sixth) + n["u"] * sin(epsilon),
            n["ya"] + n["zf"] * sin(sixth) - n["u"] * cos(epsilon),
        ),
    ]
    for end in ends:
        for a, b in zip(tip, end, strict=True):
            problem.constraint(a - b)
    assert len(q) == 7
    return problem.close()


def _squared(x, y):
    return x * x + y * y


class Planar:
    """Rigid body of the plane in absolute coordinates; points are given in its own frame, of which the origin is free."""

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
    """Rigid body of space in absolute coordinates: centre of mass and Euler parameters; inertia principal, in its axes."""

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


def andrews_absolute():
    """Andrews' squeezing mechanism in absolute coordinates: ten pins, of which all reactions follow.

    Returns the problem, the seven bodies and the names of the pins in the order of the multipliers (x and y of each).
    """
    n = {name: mp.mpf(value) for name, value in ANDREWS.items()}
    problem = Problem()
    centers = [
        (n["ra"], 0),
        (-n["da"], 0),
        (n["sb"], -n["sa"]),
        (0, n["ea"] - n["e"]),
        (n["ta"], n["tb"]),
        (n["zf"] - n["fa"], 0),
        (-n["ub"], -n["ua"]),
    ]
    bodies = [Planar(problem, n[f"m{k}"], n[f"i{k}"], c) for k, c in enumerate(centers, 1)]
    k1, k2, k3, k4, k5, k6, k7 = bodies
    ground = {name: [node(n[f"x{name}"]), node(n[f"y{name}"])] for name in "abc"}
    pins = {
        "O": ([node(0), node(0)], k1.point(0, 0)),
        "crank": (k1.point(n["rr"], 0), k2.point(0, 0)),
        "B": (ground["b"], k3.point(0, 0)),
        "A5": (ground["a"], k5.point(0, 0)),
        "A7": (ground["a"], k7.point(0, 0)),
        "E": (k5.point(n["zt"], 0), k4.point(0, 0)),
        "H": (k7.point(0, -n["u"]), k6.point(0, 0)),
        "P3": (k2.point(-n["d"], 0), k3.point(0, -n["ss"])),
        "P4": (k2.point(-n["d"], 0), k4.point(0, -n["e"])),
        "P6": (k2.point(-n["d"], 0), k6.point(n["zf"], 0)),
    }
    for first, second in pins.values():
        join(problem, first, second)
    problem.force(n["mom"], k1.angle)
    end = k3.point(n["sd"], -n["sc"])
    spring = sqrt(_squared(end[0] - n["xc"], end[1] - n["yc"]))
    problem.force((spring - n["l0"]) * -n["c0"], spring)
    return problem.close(), bodies, list(pins)


def andrews_poses(bodies, q, v):
    """Return absolute coordinates and their rates from the seven angles and their rates, by finite closed forms."""
    n = {name: mp.mpf(value) for name, value in ANDREWS.items()}
    beta, theta, gamma, phi, delta, omega, epsilon = q
    db, dt, dg, dp, dd, do, de = v
    angles = [beta, beta + theta, gamma, phi + delta, delta, omega + epsilon, epsilon]
    rates = [db, db + dt, dg, dp + dd, dd, do + de, de]
    a, b = (n["xa"], n["ya"]), (n["xb"], n["yb"])
    unit = [(mp.cos(x), mp.sin(x)) for x in (beta, delta, epsilon)]
    origins = [
        ((0, 0), (0, 0)),
        ((n["rr"] * unit[0][0], n["rr"] * unit[0][1]), (-n["rr"] * db * unit[0][1], n["rr"] * db * unit[0][0])),
        (b, (0, 0)),
        (
            (a[0] + n["zt"] * unit[1][0], a[1] + n["zt"] * unit[1][1]),
            (-n["zt"] * dd * unit[1][1], n["zt"] * dd * unit[1][0]),
        ),
        (a, (0, 0)),
        (
            (a[0] + n["u"] * unit[2][1], a[1] - n["u"] * unit[2][0]),
            (n["u"] * de * unit[2][0], n["u"] * de * unit[2][1]),
        ),
        (a, (0, 0)),
    ]
    position, velocity = [], []
    for body, (origin, moving), angle, rate in zip(bodies, origins, angles, rates, strict=True):
        pose = body.at(*origin, angle)
        position += pose
        velocity += [moving[0] - rate * (pose[1] - origin[1]), moving[1] + rate * (pose[0] - origin[0]), rate]
    return position, velocity


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
    """IFToMM benchmark A05, the stiff governor: coordinates are the angle of the shaft, the falls of both rods, the slider.

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
        length = sqrt(_squared(reach, height))
        force = (length - mp.mpf("0.5")) * -mp.mpf(stiffness) - Rate(length) * mp.mpf(damping)
        problem.force(force, length)
    return problem.close()


def governor_start():
    """Return position and velocity: rods 30 degrees below the horizontal, slider at 0.5 m, turning at 2 pi rad/s."""
    return [0, mp.pi / 6, mp.pi / 6, mp.mpf("0.5")], [2 * mp.pi, 0, 0, 0]


def spatial_slider_crank():
    """IFToMM benchmark, spatial rigid slider-crank: returns the problem and its bodies (crank, rod, slider).

    The crank (0.08 m, about x through (0, 0.1, 0.12), its centre of mass on the axis) starts upright; the rod (0.3 m) hangs on a ball
    at the crank and a universal joint at the slider, which moves along x; weight acts along -z on crank and rod.
    """
    problem = Problem()
    angle, x = problem.coordinates(2)
    rod = Spatial(problem, "0.5", ("0.0004", "0.004", "0.004"))
    problem.inertia("0.0001", angle)
    problem.inertia(2, x)
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
