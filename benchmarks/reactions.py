"""Multipliers of a slider-crank with two rates, beside a hand-written NumPy solver that differences them.

The peer is what one writes without this package: positions in closed form, the Jacobian and gamma of this one mechanism
by hand, NumPy's batched LAPACK, and rates from central differences of fourth order of the multipliers, which take four
more solves of every instant. jounce reads a file and takes no difference. Both are vectorised over all instants.
Run: ``python benchmarks/reactions.py``.
"""

import dataclasses
from pathlib import Path

from timing import race, report, use_one_core

use_one_core()

import numpy as np  # noqa: E402

import jounce as jn  # noqa: E402

INSTANTS = 10_000
R, L, E = 0.05, 0.15, 0.01  # m: crank, rod, offset of the slider
MASS, INERTIA, GRAVITY = (1.2, 0.8, 2.0), (0.002, 0.003, 0.001), 9.81
TAU = 1.0
PEER = "NumPy by hand: torque, and two rates by differences"


def law(t):
    """Return the crank angle and two derivatives."""
    w = 2 * np.pi / TAU
    s, c = np.sin(w * t), np.cos(w * t)
    return np.pi / 6 + w * t + 0.3 * s, w + 0.3 * w * c, -0.3 * w * w * s


def solved_by_hand(t):
    """Return the multipliers of all nine constraints, the driver's last, shape (instants, 9).

    Coordinates are x, y, angle of crank (about its pin), rod and slider; centres of mass lie in the origins.
    """
    theta, speed, acceleration = law(t)
    s, c = np.sin(theta), np.cos(theta)
    sine = (E - R * s) / L
    phi = np.arcsin(sine)
    cosine = np.cos(phi)
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


def differenced(t, h):
    """Return the multipliers and two rates by central differences of fourth order."""
    far, near, here, after, further = (solved_by_hand(t + k * h) for k in (-2, -1, 0, 1, 2))
    first = (far - 8 * near + 8 * after - further) / (12 * h)
    second = (-far + 16 * near - 30 * here + 16 * after - further) / (12 * h * h)
    return here, first, second


def mechanism():
    """Return the example with masses, its centres of mass in the origins of the bodies."""
    bare = jn.load(Path(__file__).parents[1] / "examples" / "slider_crank.yaml")
    bodies = {
        name: dataclasses.replace(body, mass=mass, inertia=inertia)
        for (name, body), mass, inertia in zip(bare.bodies.items(), MASS, INERTIA, strict=True)
    }
    return dataclasses.replace(bare, bodies=bodies, outputs={}, gravity=[0.0, -GRAVITY])


def torque(motion):
    """Return the driver's torque and its rates, computed anew."""
    motion.derived.clear()
    return jn.driver_force(motion, "theta").values


def main() -> None:
    """Print the errors of the differences and the ratios of time."""
    model = mechanism()
    time = np.linspace(0.0, 2 * TAU, INSTANTS)
    motion = jn.solve(model, time, order=4)
    exact = torque(motion)
    sizes = np.abs(exact).max(axis=0)
    by_hand = -solved_by_hand(time)[:, 8]  # the driver's multiplier is minus its torque
    print(f"torque, largest difference from NumPy, normalised: {np.abs(by_hand - exact[:, 0]).max() / sizes[0]:.1e}")
    for h in (1e-2, 1e-3, 1e-4):
        errors = [np.abs(-part[:, 8] - exact[:, k]).max() / sizes[k] for k, part in enumerate(differenced(time, h))]
        print(f"differences with h = {h:g} s: yank off by {errors[1]:.1e}, second rate by {errors[2]:.1e}")
    competitors = {
        PEER: lambda: differenced(time, 1e-3),
        "NumPy by hand: torque only": lambda: solved_by_hand(time),
        "jounce: torque, yank, second rate of a solved motion": lambda: torque(motion),
        "jounce: the same with the solve of the motion to jounce": lambda: torque(jn.solve(model, time, order=4)),
    }
    report(f"slider-crank, {INSTANTS} instants, one core", race(competitors), INSTANTS, PEER)


if __name__ == "__main__":
    main()
