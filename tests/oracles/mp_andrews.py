"""Andrews' squeezing mechanism in two formulations: the seven angles of the IVP test set, and absolute coordinates."""

from mpmath import mp

from tests.oracles.mp_benchmarks import Planar, join, squared
from tests.oracles.mp_dynamics import Problem, cos, node, sin, sqrt

PARAMETERS = dict(
    pair.split("=")
    for pair in """
    m1=0.04325 m2=0.00365 m3=0.02373 m4=0.00706 m5=0.07050 m6=0.00706 m7=0.05498 i1=2.194e-6 i2=4.410e-7
    i3=5.255e-6 i4=5.667e-7 i5=1.169e-5 i6=5.667e-7 i7=1.912e-5 xa=-0.06934 ya=-0.00227 xb=-0.03635 yb=0.03273
    xc=0.014 yc=0.072 c0=4530 l0=0.07785 mom=0.033 d=0.028 da=0.0115 e=0.02 ea=0.01421 rr=0.007 ra=0.00092
    ss=0.035 sa=0.01874 sb=0.01043 sc=0.018 sd=0.02 ta=0.02308 tb=0.00916 u=0.04 ua=0.01228 ub=0.00449 zf=0.02
    zt=0.04 fa=0.01421
    """.split()
)
NAMES = ("beta", "Theta", "gamma", "Phi", "delta", "Omega", "epsilon")
START = (  # of the test set, to about 28 digits
    "-0.0617138900142764496358948458001",
    "0",
    "0.455279819163070380255912382449",
    "0.222668390165885884674473185609",
    "0.487364979543842550225598953530",
    "-0.222668390165885884674473185609",
    "1.23054744454982119249735015568",
)

PUBLISHED_ANGLES = (  # of the test set at t = 0.03
    *("15.81077119629904", "-15.75637105984298", "0.04082224013073101", "-0.5347301163226948", "0.5244099658805304"),
    *("0.5347301163226948", "1.048080741042263"),
)
PUBLISHED_RATES = (
    *("1139.920302151208", "-1424.379294994111", "11.03291221937134", "19.29337464421385", "0.5735699284790808"),
    *("-19.29337464421385", "0.3231791658026955"),
)


def angles():
    """Andrews' squeezing mechanism in seven angles with six constraints: the formulation of the IVP test set."""
    n = {name: mp.mpf(value) for name, value in PARAMETERS.items()}
    problem = Problem()
    beta, theta, gamma, phi, delta, omega, epsilon = q = problem.coordinates(7)
    second, fourth, sixth = beta + theta, phi + delta, omega + epsilon
    links = (beta, second, gamma, fourth, delta, sixth, epsilon)
    crank = [n["rr"] * cos(beta), n["rr"] * sin(beta)]
    centers = [
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
    for k, (center, angle) in enumerate(zip(centers, links, strict=True), 1):
        for coordinate in center:
            problem.inertia(n[f"m{k}"], coordinate)
        problem.inertia(n[f"i{k}"], angle)
    problem.force(n["mom"], beta)
    spring = sqrt(
        squared(
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


def absolute():
    """Andrews' squeezing mechanism in absolute coordinates: ten pins, of which all reactions follow.

    Returns the problem, the seven bodies and the names of the pins in the order of the multipliers (x and y of each).
    """
    n = {name: mp.mpf(value) for name, value in PARAMETERS.items()}
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
    spring = sqrt(squared(end[0] - n["xc"], end[1] - n["yc"]))
    problem.force((spring - n["l0"]) * -n["c0"], spring)
    return problem.close(), bodies, list(pins)


def poses(bodies, q, v):
    """Return absolute coordinates and their rates from the seven angles and their rates, by finite closed forms."""
    n = {name: mp.mpf(value) for name, value in PARAMETERS.items()}
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
