"""Mechanisms with masses and forces, written in Python, of which free motion is known: closed forms or references.

Values that tests vary are parameters, so that a change of them compiles nothing again. Every mechanism has one initial
condition for each degree of freedom.
"""

import json

import numpy as np

import jounce as jn
from jounce import drivers, forces, planar, spatial
from tests.problems.mechanisms import REFERENCES

GRAVITY = 9.81


def dynamic_reference(name):
    """Return instants and, by kind and name, plain derivatives, (instant, derivative), as the nearest doubles."""
    stored = json.loads((REFERENCES / "dynamics" / f"{name}.json").read_text(encoding="utf-8"))["instants"]
    kinds = {
        kind: {name: np.array([instant[kind][name] for instant in stored], dtype=float) for name in stored[0][kind]}
        for kind in stored[0]
        if kind != "time"
    }
    return np.array([float(instant["time"]) for instant in stored]), kinds


def simple_pendulum(angle=0.0, rate=0.0, length=1.0, mass=1.0):
    """A point mass on a massless rod; `angle` in rad from the horizontal, `rate` in rad/s, at the start."""
    return jn.Mechanism(
        space="planar",
        gravity=[0, -GRAVITY],
        parameters={"length": length, "mass": mass, "angle": angle, "rate": rate},
        bodies={"bob": jn.Body([0, 0], "angle", mass="mass", center_of_mass=["length", 0])},
        joints={"pivot": planar.Revolute(("ground", "bob"), [0, 0], [0, 0])},
        initial={"start": drivers.CoordinateDriver(("ground", "bob"), "angle", "angle + rate*t")},
        outputs={"angle": jn.outputs.AngleOutput("bob"), "place": jn.outputs.PointOutput("bob", ["length", 0])},
    )


def double_pendulum(first=0.0, second=0.0, first_rate=0.0, second_rate=0.0):
    """Two point masses of 1 kg on massless rods of 1 m; angles in rad from the horizontal at the start."""
    start = {"first": first, "second": second, "first_rate": first_rate, "second_rate": second_rate}
    return jn.Mechanism(
        space="planar",
        gravity=[0, -GRAVITY],
        parameters=start,
        bodies={
            "upper": jn.Body([0, 0], "first", mass=1.0, center_of_mass=[1, 0]),
            "lower": jn.Body(["cos(first)", "sin(first)"], "second", mass=1.0, center_of_mass=[1, 0]),
        },
        joints={
            "A": planar.Revolute(("ground", "upper"), [0, 0], [0, 0]),
            "B": planar.Revolute(("upper", "lower"), [1, 0], [0, 0]),
        },
        initial={
            "one": drivers.CoordinateDriver(("ground", "upper"), "angle", "first + first_rate*t"),
            "two": drivers.CoordinateDriver(("ground", "lower"), "angle", "second + second_rate*t"),
        },
        outputs={
            "a": jn.outputs.AngleOutput("upper"),
            "b": jn.outputs.AngleOutput("lower"),
            "tip": jn.outputs.PointOutput("lower", [1, 0]),
        },
    )


def spatial_double_pendulum():
    """Two bodies on crossed hinges, swinging in space: reference `spatial_double_pendulum`."""
    y, x, origin = [0, 1, 0], [1, 0, 0], [0, 0, 0]
    hinges = {"A": (("ground", "first"), origin, y), "B": (("first", "second"), [0, 0, -0.5], x)}
    across = {"A": [0, 0, 1], "B": [0, 0, 1]}
    half = 0.6  # rad, half of the starting angle of the first body
    return jn.Mechanism(
        space="spatial",
        gravity=[0, 0, -GRAVITY],
        bodies={
            "first": jn.Body(
                origin,
                orientation=[np.cos(half), 0, np.sin(half), 0],
                mass=2.0,
                inertia=[0.03, 0.04, 0.02],
                center_of_mass=[0, 0, -0.3],
            ),
            "second": jn.Body(
                [-0.5 * np.sin(2 * half), 0, -0.5 * np.cos(2 * half)],
                orientation=np.outer([np.cos(half), np.sin(half)], [np.cos(0.25), np.sin(0.25)]).ravel()
                * [1, 1, 1, -1],
                mass=1.5,
                inertia=[0.05, 0.02, 0.06],
                center_of_mass=[0, 0, -0.3],
            ),
        },
        joints={
            name: spatial.Revolute(bodies, point, origin, axis, axis) for name, (bodies, point, axis) in hinges.items()
        },
        initial={
            f"start {name}": drivers.RotationDriver(bodies, axis, law, across[name], across[name])
            for (name, (bodies, _, axis)), law in zip(hinges.items(), ("1.2", "0.5 + 2*t"), strict=True)
        },
        outputs={
            "first": jn.outputs.RelativeAngleOutput(("ground", "first"), y, across["A"], across["A"]),
            "second": jn.outputs.RelativeAngleOutput(("first", "second"), x, across["B"], across["B"]),
            "tip": jn.outputs.PointOutput("second", [0, 0, -0.6]),
        },
    )


def free_four_bar():
    """A four-bar of uniform rods, released at rest with the crank at 1 rad: reference `free_four_bar`."""
    a, b, c = 0.3, 0.7, 0.5
    rods = {"crank": (1.0, a), "coupler": (2.0, b), "rocker": (1.5, c)}
    places = {"crank": [0, 0], "coupler": [a * np.cos(1), a * np.sin(1)], "rocker": [0.6, 0]}
    angles = {"crank": 1.0, "coupler": 0.272185800403052, "rocker": 1.07851087617515}
    return jn.Mechanism(
        space="planar",
        gravity=[0, -GRAVITY],
        bodies={
            name: jn.Body(places[name], angles[name], None, mass, mass * length**2 / 12, [length / 2, 0])
            for name, (mass, length) in rods.items()
        },
        joints={
            "A": planar.Revolute(("ground", "crank"), [0, 0], [0, 0]),
            "B": planar.Revolute(("crank", "coupler"), [a, 0], [0, 0]),
            "C": planar.Revolute(("rocker", "coupler"), [c, 0], [b, 0]),
            "D": planar.Revolute(("ground", "rocker"), [0.6, 0], [0, 0]),
        },
        initial={"start": drivers.CoordinateDriver(("ground", "crank"), "angle", 1.0)},
        outputs={name: jn.outputs.AngleOutput(name) for name in rods},
    )


def spatial_slider_crank(stiffness=0.0, damping=0.0):
    """The spatial slider-crank of IFToMM, with a spring and damper on its slider: reference `slider_crank_spring`."""
    x, y, z, origin = [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]
    turned = [0.88845071, -0.20973476, 0.39732724, -0.093796237]
    return jn.Mechanism(
        space="spatial",
        gravity=[0, 0, -GRAVITY],
        parameters={"stiffness": stiffness, "damping": damping},
        bodies={
            "crank": jn.Body([0, 0.1, 0.12], mass=0.12, inertia=[0.0001, 0.00001, 0.0001]),
            "rod": jn.Body([0, 0.1, 0.2], None, turned, 0.5, [0.0004, 0.004, 0.004], [0.15, 0, 0]),
            "slider": jn.Body([0.2, 0, 0], mass=2.0, inertia=[0.0001, 0.0001, 0.0001]),
        },
        joints={
            "A": spatial.Revolute(("ground", "crank"), [0, 0.1, 0.12], origin, x, x),
            "B": spatial.Spherical(("crank", "rod"), [0, 0, 0.08], origin),
            "C": spatial.Universal(("slider", "rod"), origin, [0.3, 0, 0], x, y),
            "guide": spatial.Prismatic(("ground", "slider"), origin, origin, x, x, y, y),
        },
        forces={
            "spring": forces.SlideSpring(("ground", "slider"), origin, origin, x, "stiffness", 0.2, "damping"),
        },
        initial={"start": drivers.RotationDriver(("ground", "crank"), x, "6*t", z, z)},
        outputs={
            "angle": jn.outputs.RelativeAngleOutput(("ground", "crank"), x, z, z),
            "slide": jn.outputs.PointOutput("slider", origin),
            "center": jn.outputs.PointOutput("rod", [0.15, 0, 0]),
        },
    )


def thrown_stone():
    """A stone that falls and turns evenly: x = 1 + 2 t, y = 2 + 5 t - g t^2 / 2, angle = 0.5 - 3 t."""
    return jn.Mechanism(
        space="planar",
        gravity=[0.0, -GRAVITY],
        bodies={"stone": jn.Body([1.0, 2.0], 0.5, mass=3.0, inertia=0.4)},
        joints={},
        initial={
            "x": drivers.CoordinateDriver(("ground", "stone"), "x", "1 + 2*t"),
            "y": drivers.CoordinateDriver(("ground", "stone"), "y", "2 + 5*t"),
            "turn": drivers.CoordinateDriver(("ground", "stone"), "angle", "0.5 - 3*t"),
        },
    )


def rolling_disc():
    """A disc of 2 kg and radius 0.3 m that rolls on a line, on a spring of 50 N/m: see `rolling_motion`."""
    return jn.Mechanism(
        space="planar",
        gravity=[0, -GRAVITY],
        bodies={"disc": jn.Body([0.4, 0.3], mass=2.0, inertia=0.09)},
        joints={
            "contact": planar.Rolling(("ground", "disc"), [0, 0.3], [0, 0], [1, 0], 0.3, 0.4),
            "height": planar.Parallel2(("ground", "disc"), [0, 0.3], [0, 0], [1, 0]),
        },
        forces={"spring": forces.SlideSpring(("ground", "disc"), [0, 0.3], [0, 0], [1, 0], 50.0)},
        initial={"start": drivers.SlideDriver(("ground", "disc"), [0, 0.3], [0, 0], [1, 0], "0.4 + 0.7*t")},
        outputs={"place": jn.outputs.PointOutput("disc", [0, 0]), "angle": jn.outputs.AngleOutput("disc")},
    )


def rolling_motion(time, order):
    """Return x of the disc's center and its derivatives in closed form, (time, order + 1)."""
    frequency = np.sqrt(50.0 / (2.0 + 0.09 / 0.3**2))
    k = np.arange(order + 1)
    phase = frequency * np.asarray(time)[:, None] + k * np.pi / 2
    return frequency**k * (0.4 * np.cos(phase) + 0.7 / frequency * np.sin(phase))


def gear_pair():
    """Two gears, 0.02 and 0.5 kg m^2 with radii 0.1 and 0.25 m; 3 N m drive the first from rest: see `gear_motion`."""
    return jn.Mechanism(
        space="planar",
        bodies={
            "pinion": jn.Body([0, 0], mass=1.0, inertia=0.02),
            "wheel": jn.Body([0.35, 0], mass=6.0, inertia=0.5),
        },
        joints={
            "A": planar.Revolute(("ground", "pinion"), [0, 0], [0, 0]),
            "B": planar.Revolute(("ground", "wheel"), [0.35, 0], [0, 0]),
            "mesh": planar.Coordinate(("pinion", "wheel"), "angle", ratio=-0.4, offset=0.0),
        },
        forces={"motor": forces.Torque(("ground", "pinion"), 3.0)},
        initial={"start": drivers.CoordinateDriver(("ground", "pinion"), "angle", 0.0)},
        outputs={"pinion": jn.outputs.AngleOutput("pinion"), "wheel": jn.outputs.AngleOutput("wheel")},
    )


def gear_motion(time, order):
    """Return the angle of the pinion and its derivatives in closed form, (time, order + 1)."""
    acceleration, time = 3.0 / (0.02 + 0.4**2 * 0.5), np.asarray(time)
    found = np.zeros((len(time), order + 1))
    for k, values in enumerate((acceleration * time**2 / 2, acceleration * time, acceleration)[: order + 1]):
        found[:, k] = values
    return found
