"""Torque of a slider-crank's driver with two rates, beside a hand-written NumPy solver that differences multipliers.

The peer is what one writes without this package: positions in closed form, the Jacobian and gamma of this one mechanism
by hand, NumPy's batched LAPACK, and rates from central differences of fourth order of the multipliers, which take four
more solves of every instant. jounce reads a file and takes no difference. Both are vectorized over all instants.
"""

import dataclasses
from typing import Any

import numpy as np
from mpmath import mp, mpf

import jounce as jn
from benchmarks.cases import EXAMPLES, Case, Cases, Contestant, ready
from benchmarks.references import largest_error
from tests.oracles import friction_circles
from tests.oracles.mp_series import Series, cos, sin, sqrt

R, L, E = 0.05, 0.15, 0.01  # m: crank, rod, offset of the slider
MASS, INERTIA, GRAVITY = (1.2, 0.8, 2.0), (0.002, 0.003, 0.001), 9.81
START = 1.4  # rad, of the four-bar's crank: from there all pins slip, so that the largest of the torques moves it
STEP = 1e-3  # s, of the differences: a larger one is worse for the first rate, a smaller one for the second


def law(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the crank angle and two derivatives."""
    w = 2 * np.pi
    s, c = np.sin(w * t), np.cos(w * t)
    return np.pi / 6 + w * t + 0.3 * s, w + 0.3 * w * c, -0.3 * w * w * s


def solved_by_hand(t: np.ndarray) -> np.ndarray:
    """Return the multipliers of all nine constraints, the driver's last, shape (instants, 9).

    Coordinates are x, y, angle of crank (about its pin), rod and slider; centers of mass lie in the origins.
    """
    theta, speed, acceleration = law(t)
    s, c = np.sin(theta), np.cos(theta)
    sine = (E - R * s) / L
    cosine = np.cos(np.arcsin(sine))
    n = len(t)
    jacobian = np.zeros((n, 9, 9))
    jacobian[:, 0, 0] = jacobian[:, 1, 1] = 1.0  # A
    jacobian[:, 2, 0] = jacobian[:, 3, 1] = -1.0  # B: rod origin on the crank's end
    jacobian[:, 2, 2], jacobian[:, 3, 2] = R * s, -R * c
    jacobian[:, 2, 3] = jacobian[:, 3, 4] = 1.0
    jacobian[:, 4, 3] = jacobian[:, 5, 4] = -1.0  # C: slider on the rod's end
    jacobian[:, 4, 5], jacobian[:, 5, 5] = L * sine, -L * cosine
    jacobian[:, 4, 6] = jacobian[:, 5, 7] = 1.0
    jacobian[:, 6, 7] = jacobian[:, 7, 8] = 1.0  # guide
    jacobian[:, 8, 2] = 1.0  # driver
    right = np.zeros((n, 9))
    right[:, 8] = speed
    velocity = np.linalg.solve(jacobian, right[..., None])[..., 0]
    gamma = np.zeros((n, 9))
    gamma[:, 2], gamma[:, 3] = -R * c * velocity[:, 2] ** 2, -R * s * velocity[:, 2] ** 2
    gamma[:, 4], gamma[:, 5] = -L * cosine * velocity[:, 5] ** 2, -L * sine * velocity[:, 5] ** 2
    gamma[:, 8] = acceleration
    accelerations = np.linalg.solve(jacobian, gamma[..., None])[..., 0]
    mass = np.array([x for m, i in zip(MASS, INERTIA, strict=True) for x in (m, m, i)])
    weight = np.array([x for m in MASS for x in (0.0, -m * GRAVITY, 0.0)])
    load = weight - mass * accelerations
    return np.linalg.solve(np.swapaxes(jacobian, 1, 2), load[..., None])[..., 0]


def differenced(t: np.ndarray) -> np.ndarray:
    """Return the torque and two rates by central differences of fourth order, shape (instants, 3)."""
    far, near, here, after, further = (-solved_by_hand(t + k * STEP)[:, 8] for k in (-2, -1, 0, 1, 2))
    first = (far - 8 * near + 8 * after - further) / (12 * STEP)
    second = (-far + 16 * near - 30 * here + 16 * after - further) / (12 * STEP * STEP)
    return np.stack([here, first, second], axis=1)


def mechanism() -> jn.Mechanism:
    """Return the example with masses, its centers of mass in the origins of the bodies."""
    bare = jn.load(EXAMPLES / "slider_crank.yaml")
    bodies = {
        name: dataclasses.replace(body, mass=mass, inertia=inertia)
        for (name, body), mass, inertia in zip(bare.bodies.items(), MASS, INERTIA, strict=True)
    }
    return dataclasses.replace(bare, bodies=bodies, outputs={}, gravity=[0.0, -GRAVITY])


def exact(time: np.ndarray) -> np.ndarray:
    """Return the torque and two rates in fifty digits: power is the rate of the energy, (instants, 3)."""

    def torque(t: float) -> list[Any]:
        lapse = Series([mpf(float(t)), mpf(1), *[mpf(0)] * 3])
        theta = lapse * (2 * mp.pi) + 0.3 * sin(lapse * (2 * mp.pi)) + mp.pi / 6
        sine = (E - R * sin(theta)) / L
        rise, cosine = R * sin(theta), sqrt(1 - sine * sine)  # of the crank's end; of the rod's angle
        speed, across = theta.differentiate(), (R * cos(theta)).differentiate()
        turn = sine.differentiate() / Series(cosine.c[:-1])
        along = (R * cos(theta) + L * cosine).differentiate()
        up = rise.differentiate()
        squares = (INERTIA[0] / 2, speed), (INERTIA[1] / 2, turn), (MASS[1] / 2, across), (MASS[1] / 2, up)
        kinetic = sum((x * x * size for size, x in squares), along * along * (MASS[2] / 2))
        energy = kinetic + Series(rise.c[:-1]) * (MASS[1] * GRAVITY)
        return (energy.differentiate() / Series(speed.c[:-1])).derivatives()

    with mp.workdps(50):
        return np.array([[float(x) for x in torque(t)] for t in time])


def four_bar(rubbing: bool) -> jn.Mechanism:
    """Return the four-bar of the friction circles, whose rocker bears 3 N m, with friction in its four pins or not."""
    pins = {
        name: jn.joints.Friction(0.2, 1e-8, size / 0.2) if rubbing else None
        for name, size in friction_circles.CIRCLES.items()
    }
    crank, coupler, rocker, ground = (getattr(friction_circles, x) for x in ("CRANK", "COUPLER", "ROCKER", "GROUND"))
    revolute, origin = jn.planar.Revolute, [0.0, 0.0]
    return jn.Mechanism(
        space="planar",
        bodies={
            "crank": jn.Body(origin, angle=START),
            "coupler": jn.Body([crank * np.cos(START), crank * np.sin(START)], angle=0.6),
            "rocker": jn.Body([ground, 0], angle=1.5),
        },
        joints={
            "A": revolute(("ground", "crank"), origin, origin, friction=pins["A"]),
            "B": revolute(("crank", "coupler"), [crank, 0], origin, friction=pins["B"]),
            "C": revolute(("rocker", "coupler"), [rocker, 0], [coupler, 0], friction=pins["C"]),
            "D": revolute(("ground", "rocker"), [ground, 0], origin, friction=pins["D"]),
        },
        drivers={"theta": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", motion=f"{START} + 0.2*t")},
        forces={"load": jn.forces.Torque(("ground", "rocker"), 3.0)},
    )


def cases(quick: bool) -> Cases:
    """Yield the torque with two rates of a solved motion, and with its solution; and with friction in the pins."""
    model = mechanism()
    time = np.linspace(0.0, 2.0, 2001 if quick else 10_001)
    motion = jn.solve(model, time, order=4)
    expected, lanes = exact(time[::400]), slice(None, None, 400)

    def torque(motion: Any) -> Any:
        motion.derived.clear()  # computed anew
        return jn.driver_force(motion, "theta").values

    def error(found: Any) -> float:
        return largest_error(found[lanes], expected)

    peer = Contestant("NumPy by hand, rates by differences", ready(lambda: differenced(time)), error)
    ours = {
        "of a solved motion": lambda: torque(motion),
        "with the solution to jounce": lambda: torque(jn.solve(model, time, order=4)),
    }
    for what, run in ours.items():
        yield Case(
            f"driver torque and two rates of a slider-crank, {what}, {len(time):,} instants",
            [Contestant("jounce", ready(run), error), peer],
            count=len(time),
            unit="instant",
            reference="the power balance in fifty digits, by the peak of each derivative",
        )
    motions = [jn.solve(four_bar(rubbing), time, order=4) for rubbing in (True, False)]
    circles = np.array([friction_circles.torques(START + 0.2 * t, 3.0).max() for t in time[lanes]])
    rubbing, smooth = (ready(lambda motion=motion: torque(motion)) for motion in motions)
    yield Case(
        f"driver torque and two rates of a four-bar with friction in its pins, {len(time):,} instants",
        [
            Contestant("jounce", rubbing, lambda found: largest_error(found[lanes, :1], circles[:, None])),
            Contestant("jounce, without friction", smooth, aim=1.5),
        ],
        count=len(time),
        unit="instant",
        reference="friction circles in closed form",
    )
