"""Closed forms of the mechanisms of the gallery, on power series in time of many digits, without the library."""

from mpmath import mp, mpf

from tests.oracles.mp_series import Series, atan2, cos, sin, sqrt, tan

PI = mp.pi


def at(t, order):
    """Return the time as a series around an instant."""
    return Series([mpf(float(t)), mpf(1), *[mpf(0)] * (order - 1)])


def plus(p, q):
    return [a + b for a, b in zip(p, q, strict=True)]


def minus(p, q):
    return [a - b for a, b in zip(p, q, strict=True)]


def scaled(p, factor):
    return [a * factor for a in p]


def dot(p, q):
    products = [a * b for a, b in zip(p, q, strict=True)]
    return sum(products[1:], products[0])


def cross(p, q):
    return [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]


def length(p):
    return sqrt(dot(p, p))


def placed(origin, unit, place):
    """Return a point given along a unit vector and to the left of it."""
    along, left = place
    return [origin[0] + unit[0] * along - unit[1] * left, origin[1] + unit[1] * along + unit[0] * left]


def meeting(p, r, q, s, side):
    """Return where circles about p and q meet, to the left of the way from p to q (side 1) or to the right (-1)."""
    way = minus(q, p)
    distance = length(way)
    unit = scaled(way, 1 / distance)
    along = (distance * distance + r * r - s * s) / (2 * distance)
    return placed(p, unit, (along, side * sqrt(r * r - along * along)))


def third(p, q, p0, q0, r0):
    """Return the third point of a rigid triangle that two points carry, known in one position."""
    first = [mpf(x) for x in minus(q0, p0)]
    square = dot(first, first)
    to = [mpf(x) for x in minus(r0, p0)]
    along, left = dot(first, to) / square, (first[0] * to[1] - first[1] * to[0]) / square
    return placed(p, minus(q, p), (along, left))


def mm(*values):
    """Return millimeters, given as decimals in text, in metres."""
    found = [mpf(value) / 1000 for text in values for value in text.split()]
    return found if len(found) > 1 else found[0]


def peaucellier(t):
    r, L, s = mm("75 200 80")
    half = (52 * PI / 180) * sin(PI * t) / 2
    x = (L * L - s * s) / (2 * r)
    return {"P": [0 * t + x, x * tan(half)], "B": scaled([cos(half), sin(half)], 2 * r * cos(half))}


def jansen(t):
    a, b, c, d, e, f, g, h, i, j, k, lower, m = mm("38 41.5 39.3 40.1 55.8 39.4 36.7 65.7 49 50 61.9 7.8 15")
    pin = scaled([cos(PI * t), sin(PI * t)], m)
    frame = [0 * t - a, 0 * t - lower]
    top, ankle = meeting(frame, b, pin, j, 1), meeting(frame, c, pin, k, -1)
    left = meeting(frame, d, top, e, 1)
    knee = meeting(left, f, ankle, g, -1)
    return {"foot": meeting(knee, h, ankle, i, -1)}


def klann(t):
    axle, C, A, B = mm("41.395 26.641"), mm("36.033 25.415"), mm("27.690 19.705"), mm("27.690 31.092")
    E, K, H = mm("21.501 22.089"), mm("10.879 21.918"), mm("19.432 32.923")
    foot = [mpf(0), mpf(0)]
    turn = minus(C, axle)
    pin = placed([0 * t + axle[0], 0 * t + axle[1]], [cos(PI * t), sin(PI * t)], turn)
    fixed = [[0 * t + x for x in point] for point in (A, B)]
    elbow = meeting(pin, length(minus(C, E)), fixed[0], length(minus(A, E)), -1)
    knee = third(pin, elbow, C, E, K)
    hip = meeting(knee, length(minus(K, H)), fixed[1], length(minus(B, H)), 1)
    return {"foot": third(knee, hip, K, H, foot), "knee": knee}


def stephenson(t):
    r = mm("40")
    gamma = 72 * PI / 180
    theta = PI * t + PI / 3
    pin = scaled([cos(theta), sin(theta)], r)
    fixed = [0 * t + 2 * r, 0 * t]
    joint = meeting(pin, r * 5 / 2, fixed, r * 5 / 2, 1)
    P = placed(pin, scaled(minus(joint, pin), 1 / (r * 5 / 2)), (r * 5 / 2 * (1 - cos(gamma)), r * 5 / 2 * sin(gamma)))
    G = [0 * t + r * mpf("2.418"), 0 * t + r * mpf("2.748")]
    F = meeting(P, r * mpf("3.11"), G, r * 5 / 2, -1)
    arm = minus(F, G)
    return {"P": P, "F": F, "output_angle": atan2(arm[1], arm[0], near=4)}


def radial_engine(t):
    r, rod, knuckle = mm("60 220 55")
    theta = 20 * PI * t + PI / 2
    pin = scaled([cos(theta), sin(theta)], r)
    top = pin[1] + sqrt(rod * rod - pin[0] * pin[0])
    unit = scaled(minus([0 * t, top], pin), 1 / rod)
    strokes = {"stroke1": top}
    for k in range(1, 5):
        turn = 72 * k * PI / 180
        at_pin = placed(pin, unit, (knuckle * cos(turn), knuckle * sin(turn)))
        bore = [-sin(turn), cos(turn)]
        off = at_pin[0] * bore[1] - at_pin[1] * bore[0]
        strokes[f"stroke{k + 1}"] = dot(at_pin, bore) + sqrt((rod - knuckle) ** 2 - off * off)
    return strokes


def wolfrom(t):
    sun = 4 * (PI * t - sin(PI * t))
    carrier = sun / (1 + mpf(60) / 12)  # Willis: a fixed ring of 60 teeth, a sun of 12
    planet = carrier * (1 - mpf(60) / 24)
    return {"sun_angle": sun, "carrier_angle": carrier, "output_angle": carrier + (planet - carrier) * 21 / 57}


def epicyclic(t):
    sun, carrier = PI * t + sin(PI * t) * 2 / 5, sin(PI * t / 2) ** 2 / 2
    ring = carrier - (sun - carrier) * 24 / 60
    return {"ring": ring, "planet": carrier - (sun - carrier) * 24 / 18}


def double_cardan(t):
    theta = 2 * PI * t + sin(PI * t) * 3 / 10
    beta = PI / 6
    return {
        "theta": theta,
        "psi": theta,
        "middle_angle": atan2(sin(theta), cos(theta) * cos(beta), near=theta.c[0]),
    }


def delta(t):
    base, platform, arm, rod = mm("200 50 300 700")
    laws = [sin(2 * PI * t), sin(2 * PI * t - 2 * PI / 3), sin(4 * PI * t + PI / 3)]
    centers = []
    for k, law in enumerate(laws):
        q, turn = (law * 22 + 20) * PI / 180, 2 * k * PI / 3
        reach = arm * cos(q) + (base - platform)
        centers.append([reach * cos(turn), reach * sin(turn), -arm * sin(q)])
    v, w = minus(centers[1], centers[0]), minus(centers[2], centers[0])
    vv, ww, vw = dot(v, v), dot(w, w), dot(v, w)
    whole = vv * ww - vw * vw
    foot = plus(scaled(v, (vv - vw) * ww / (2 * whole)), scaled(w, (ww - vw) * vv / (2 * whole)))
    normal = cross(v, w)  # upward; the platform hangs below
    drop = sqrt((rod * rod - dot(foot, foot)) / dot(normal, normal))
    return {"platform": minus(plus(centers[0], foot), scaled(normal, drop))}


def delta_pick(t):
    """Return the angles of the motors on the way there: each arm meets the sphere of its rods about the platform."""
    base, platform, arm, rod, reach, lift, belt, aside = mm("200 50 300 700 150 25 650 20")

    def risen(start, stop):
        u = (t - mpf(start)) / (mpf(stop) - mpf(start))
        return u**4 * (35 - 84 * u + 70 * u**2 - 20 * u**3)  # 4-5-6-7

    up = risen("0", "0.06") if t.c[0] < mpf("0.06") else 1 + 0 * t if t.c[0] < mpf("0.14") else 1 - risen("0.14", "0.2")
    x, y, z = 2 * reach * risen("0.03", "0.17") - reach, aside + 0 * t, lift * up - belt
    angles = {}
    for k in range(3):
        turn = 2 * k * PI / 3
        out = x * cos(turn) + y * sin(turn) + platform - base
        side = y * cos(turn) - x * sin(turn)
        along = (out * out + side * side + z * z + arm * arm - rod * rod) / (2 * arm)
        angles[f"motor{k + 1}"] = atan2(-z, out) - atan2(sqrt(out * out + z * z - along * along), along)
    return angles


def valve_train(t):
    base, lift, rod, height, half, tip, top = mm("16 6.5 200 240 25 35 20")
    tappet = base + lift * ((1 + cos(50 * PI * t + PI / 2)) / 2) ** 4
    pin = meeting([0 * t, tappet + top], rod, [0 * t + half, 0 * t + height], half, 1)
    slope = (height - pin[1]) / (half - pin[0])
    return {"tappet": [0 * t, tappet], "valve": [0 * t + half + tip, height + tip * slope]}


def excavator(t):
    """Return the teeth, and the mechanical energy with the lengths of the cylinders."""
    number = mpf
    boom, stick, bucket, horn = number("5.7"), number("2.9"), number("1.45"), number("0.45")
    rocker = link = number("0.6")
    phase = PI * t / 4
    lengths = [
        number("2.83") - number("0.12") * cos(phase + number("2.6")),
        number("3.35") - number("0.35") * cos(phase),
        number("2.4") - number("0.33") * cos(phase - number("0.8")),
    ]
    zero = 0 * t
    ground = [zero, zero]

    def unit(origin, place, local):
        """Return the x axis of a body with its origin and another of its points."""
        return minus(third(origin, place, [mpf(0), mpf(0)], local, [mpf(1), mpf(0)]), origin)

    eye = [number("2.35"), number("0.95")]
    base = [zero + number("0.35"), zero - number("0.75")]
    x1 = unit(ground, meeting(ground, length(eye), base, lengths[0], 1), eye)
    D = scaled(x1, boom)
    end = [number("-0.75"), number("-0.15")]
    base = placed(ground, x1, (number("2.6"), number("1.25")))
    x2 = unit(D, meeting(D, length(end), base, lengths[1], -1), end)
    E, K = placed(D, x2, (stick, 0)), placed(D, x2, (number("2.5"), number("0.12")))
    J = placed(D, x2, (number("0.25"), number("0.5")))
    M = meeting(K, rocker, J, lengths[2], -1)
    x3 = scaled(minus(M, K), 1 / rocker)
    N = meeting(M, link, E, horn, 1)
    turn = 95 * PI / 180
    x4 = unit(E, N, [horn * cos(turn), horn * sin(turn)])
    bodies = [
        (ground, x1, 1650, 4700, ("2.7", "0.65")),
        (D, x2, 800, 680, ("0.9", "0.15")),
        (K, x3, 60, 2, ("0.3", "0")),
        (E, x4, 750, 210, ("0.7", "0.25")),
    ]
    energy = None
    for origin, axis, mass, inertia, place in bodies:
        center = placed(origin, axis, [number(x) for x in place])
        speed = [x.differentiate() for x in center]
        spin = atan2(axis[1], axis[0]).differentiate()
        weight = Series((center[1] * (number("9.81") * mass)).c[:-1])
        part = dot(speed, speed) * mass / 2 + spin * spin * inertia / 2 + weight
        energy = part if energy is None else energy + part
    return {"teeth": placed(E, x4, (bucket, 0))}, energy, lengths
