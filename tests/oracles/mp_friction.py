"""A slider-crank with dry friction in its pins and its guide, by hand and in many digits: judge of friction.

The balances of the three bodies are written out; what friction adds to them follows the size of the forces in the pins
and in the guide, which are found by iteration. Rates come from differencing in fifty digits.
"""

from mpmath import mp, mpf

DIGITS = 50
CRANK, ROD, CENTER = mpf("0.1"), mpf("0.3"), mpf("0.12")  # m
MASSES = {"crank": mpf(1), "rod": mpf("0.7"), "piston": mpf(2)}
INERTIA = {"crank": mpf("0.01"), "rod": mpf("0.004")}  # kg m^2, of the rod about its center of mass
GRAVITY, MU, RADIUS, SPEED = mpf("9.81"), mpf("0.1"), mpf("0.012"), mpf("0.02")


def crank_angle(t):
    return mpf("0.5") + 20 * t + 3 * mp.sin(7 * t)


def forces(t, crank_angle=crank_angle):
    """Return the torque of the driver, and the force of each joint on its second body: pins O, A, B, and the guide."""

    def rod_angle(t):
        return -mp.asin(CRANK * mp.sin(crank_angle(t)) / ROD)

    def slide(t):
        return CRANK * mp.cos(crank_angle(t)) + ROD * mp.cos(rod_angle(t))

    def center(t):
        a, b = crank_angle(t), rod_angle(t)
        return mp.matrix([CRANK * mp.cos(a) + CENTER * mp.cos(b), CRANK * mp.sin(a) + CENTER * mp.sin(b)])

    a, b = crank_angle(t), rod_angle(t)
    turning, swinging = mp.diff(crank_angle, t), mp.diff(rod_angle, t)
    alpha, beta = mp.diff(crank_angle, t, 2), mp.diff(rod_angle, t, 2)
    moved = [mp.diff(lambda x, k=k: center(x)[k], t, 2) for k in (0, 1)]
    sped, speed = mp.diff(slide, t, 2), mp.diff(slide, t)

    def resisting(slip):
        return MU * mp.tanh(slip / SPEED)

    of_pin = [RADIUS * resisting(RADIUS * w) for w in (turning, swinging - turning, -swinging)]
    # unknowns: torque, Ox, Oy, Ax, Ay, Bx, By, N of the guide (on crank, rod, piston, piston)
    matrix, load = mp.zeros(8, 8), mp.zeros(8, 5)  # load without friction, and that of each normal force of one
    lever = CRANK * mp.cos(a), CRANK * mp.sin(a)
    to_a = -CENTER * mp.cos(b), -CENTER * mp.sin(b)
    to_b = (ROD - CENTER) * mp.cos(b), (ROD - CENTER) * mp.sin(b)
    matrix[0, 1] = matrix[1, 2] = 1  # crank: O - A = m g, its center of mass is in O
    matrix[0, 3] = matrix[1, 4] = -1
    load[1, 0] = MASSES["crank"] * GRAVITY
    matrix[2, 0], matrix[2, 3], matrix[2, 4] = 1, lever[1], -lever[0]
    load[2, 0] = INERTIA["crank"] * alpha
    load[2, 1], load[2, 2] = of_pin[0], -of_pin[1]
    for k in (0, 1):  # rod: A - B = m (a - g)
        matrix[3 + k, 3 + k], matrix[3 + k, 5 + k] = 1, -1
        load[3 + k, 0] = MASSES["rod"] * (moved[k] + (GRAVITY if k else 0))
    matrix[5, 3], matrix[5, 4] = -to_a[1], to_a[0]
    matrix[5, 5], matrix[5, 6] = to_b[1], -to_b[0]
    load[5, 0] = INERTIA["rod"] * beta
    load[5, 2], load[5, 3] = of_pin[1], -of_pin[2]
    matrix[6, 5] = matrix[7, 6] = matrix[7, 7] = 1  # piston
    load[6, 0] = MASSES["piston"] * sped
    load[6, 4] = resisting(speed)
    load[7, 0] = MASSES["piston"] * GRAVITY
    found = mp.inverse(matrix) * load
    normal = mp.zeros(4, 1)
    for _ in range(70):
        whole = found * mp.matrix([1, *normal])
        pressed = [mp.sqrt(whole[k] ** 2 + whole[k + 1] ** 2) for k in (1, 3, 5)]
        normal = mp.matrix([*pressed, abs(whole[7])])
    return whole


def driver_torque(instant, order, crank_angle=crank_angle):
    """Return the torque that moves the crank so, and its rates to an order."""
    with mp.workdps(DIGITS):
        return [float(x) for x in mp.diffs(lambda t: forces(t, crank_angle)[0], mpf(instant), order)]


def torque_of_series(coefficients, order):
    """Return the torque and its rates where the angle of the crank has these Taylor coefficients."""
    with mp.workdps(DIGITS):
        powers = [mpf(float(c)) for c in coefficients][::-1]
        return driver_torque(0, order, lambda t: mp.polyval(powers, t))
