"""Two gears with losses, by hand and in many digits: judge of the friction of gears.

Turned gear one carries a center of mass beside its axis, as gear two does. The torque that gear two needs is passed on
by the teeth, and what gear one needs more, by the direction of power, is written out. Rates come from differencing in
fifty digits.
"""

from mpmath import mp, mpf

DIGITS = 50
LAW = "1.5*t + 0.4*sin(3*t)"
GRAVITY, SPEED = mpf("9.81"), mpf(2)
FORWARD, BACKWARD = mpf("0.9"), mpf("0.7")


def angle(t):
    return mpf("1.5") * t + mpf("0.4") * mp.sin(3 * t)


def torque(t, ring):
    ratio = mpf("0.5") if ring else -mpf("0.5")
    turned, turning, faster = (mp.diff(angle, t, k) for k in range(3))

    def needed(mass, inertia, center, phi, alpha):
        """Of a gear about its axis: inertia is about the center of mass."""
        x, y = center
        about = inertia + mass * (x * x + y * y)
        return about * alpha + mass * GRAVITY * (x * mp.cos(phi) - y * mp.sin(phi))

    load = -4 + 6 * mp.sin(5 * t)
    second = needed(mpf(3), mpf("0.09"), (-mpf("0.02"), mpf("0.05")), ratio * turned, ratio * faster) - load
    passed = ratio * second
    side = mp.tanh(turning / SPEED)
    onward, back = 1 / FORWARD - 1, 1 - BACKWARD
    lost = side * (abs(passed) * (onward + back) / 2 + passed * side * (onward - back) / 2)
    return needed(mpf(1), mpf("0.02"), (mpf("0.03"), mpf("0.01")), turned, faster) + passed + lost


def driver_torque(instant, order, *, ring):
    """Return the torque that turns gear one so, and its rates to an order."""
    with mp.workdps(DIGITS):
        return [float(x) for x in mp.diffs(lambda t: torque(t, ring), mpf(instant), order)]
