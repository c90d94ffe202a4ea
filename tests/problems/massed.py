"""The bank of mechanisms with masses: every body gets a mass, an inertia and a center of mass off its origin."""

import dataclasses

import numpy as np

import jounce as jn
from jounce import drivers, planar
from tests.problems.mechanisms import example

GRAVITY = {"planar": [0.3, -9.81], "spatial": [0.4, -0.7, -9.81]}  # along no axis
TIME_OF_LAW = "0.3 + 0.7*t + 0.4*sin(3*t)"


def massed(mechanism, seed=1):
    """Return a mechanism with random masses, those of its size."""
    random = np.random.default_rng(seed)
    bodies = {}
    for name, body in mechanism.bodies.items():
        center = random.uniform(-0.1, 0.1, 2 if mechanism.space == "planar" else 3)
        inertia = float(random.uniform(0.01, 0.05))
        if mechanism.space == "spatial":
            root = random.normal(size=(3, 3))
            spread = 0.01 * root @ root.T + 0.01 * np.eye(3)  # second moments: so that a body can have them
            inertia = (np.trace(spread) * np.eye(3) - spread).tolist()
        mass = float(random.uniform(0.5, 3.0))
        bodies[name] = dataclasses.replace(body, mass=mass, inertia=inertia, center_of_mass=center.tolist())
    return dataclasses.replace(mechanism, bodies=bodies, gravity=GRAVITY[mechanism.space])


def massed_example(name):
    """Return a mechanism of the bank with masses."""
    return massed(jn.load(example(name)))


def arm(**body):
    """An arm on a pin, turned by the law."""
    return jn.Mechanism(
        space="planar",
        gravity=[0.0, -9.81],
        bodies={"arm": jn.Body([0.0, 0.0], **body)},
        joints={"pin": planar.Revolute(("ground", "arm"), [0.2, 0.1], [0.0, 0.0])},
        drivers={"turn": drivers.CoordinateDriver(("ground", "arm"), "angle", TIME_OF_LAW)},
    )
