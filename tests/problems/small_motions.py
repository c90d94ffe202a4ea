"""Mechanisms whose small motions have closed forms."""

import itertools

import numpy as np

import jounce as jn
from jounce import forces, planar, spatial
from jounce.rigid.euler_parameters import from_rotation_matrices
from tests.oracles.mp_small_motions import SprungFourBar


def sprung_four_bar(size=1.0, turn=0.0, crank=2.0, driven=False):
    """The four-bar of the oracle, whose unit of length is `size` of a metre, all of it turned in the plane.

    Mass stays, so that stiffness by length is the same, and moments and torsional stiffness go with the square.
    """
    b = SprungFourBar
    length = {name: float(value) * size for name, value in b.lengths.items()}
    coupler, rocker = (float(x) for x in b().angles(crank))
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])

    def body(name, position, angle):
        mass, inertia = map(float, b.masses[name])
        center = [float(c) * size for c in b.centers[name]]
        place = (rotation @ position).tolist()
        return jn.Body(place, angle=angle + turn, mass=mass, inertia=inertia * size**2, center_of_mass=center)

    tip = length["AB"] * np.array([np.cos(crank), np.sin(crank)])
    anchor = (rotation @ [float(c) * size for c in b.spring["anchor"]]).tolist()
    pivot = (rotation @ [length["AD"], 0.0]).tolist()
    crank_drive = {"drive": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", f"{crank + turn} + 0.3*t")}
    return jn.Mechanism(
        space="planar",
        gravity=(rotation @ [0.0, -float(b.gravity) * size]).tolist(),
        bodies={
            "crank": body("crank", [0.0, 0.0], crank),
            "coupler": body("coupler", tip, coupler),
            "rocker": body("rocker", [length["AD"], 0.0], rocker),
        },
        joints={
            "A": planar.Revolute(("ground", "crank"), [0, 0], [0, 0]),
            "B": planar.Revolute(("crank", "coupler"), [length["AB"], 0], [0, 0]),
            "C": planar.Revolute(("coupler", "rocker"), [length["BC"], 0], [length["CD"], 0]),
            "D": planar.Revolute(("ground", "rocker"), pivot, [0, 0]),
        },
        drivers=crank_drive if driven else {},
        forces={
            "spring": forces.Spring(
                ("ground", "crank"), anchor, [length["AB"] / 2, 0], float(b.spring["stiffness"]),
                float(b.spring["length"]) * size,
            ),
            "turn": forces.TorsionalSpring(
                ("ground", "rocker"), float(b.turn["stiffness"]) * size**2, float(b.turn["angle"]) + turn
            ),
        },
        outputs={"psi": jn.outputs.AngleOutput("rocker"), "C": jn.outputs.PointOutput("coupler", [length["BC"], 0])},
    )  # fmt: skip


def chain(masses, stiffnesses, dampings, right_wall=False):
    """Bodies 1 m apart on a rail, with springs and dampers from a wall to the first, between neighbors, to a wall."""
    count = len(masses)
    names = [f"m{k}" for k in range(count)]
    pairs = [("ground", names[0], [-1.0, 0.0], 1.0)]
    pairs += [(a, b, [0.0, 0.0], 1.0) for a, b in itertools.pairwise(names)]
    pairs += [("ground", names[-1], [float(count), 0.0], -1.0)] if right_wall else []
    springs = {
        f"k{n}": forces.SlideSpring((i, j), point, [0, 0], [1, 0], k, free, c)
        for n, ((i, j, point, free), k, c) in enumerate(zip(pairs, stiffnesses, dampings, strict=True))
    }
    bodies = {name: jn.Body([0.03 + k, 0.0], mass=masses[k], inertia=0.1) for k, name in enumerate(names)}
    return jn.Mechanism(
        space="planar",
        bodies=bodies,
        joints={f"rail_{n}": planar.Prismatic(("ground", n), [0, 0], [0, 0], [1, 0], [1, 0]) for n in names},
        forces=springs,
        outputs={n: jn.outputs.PointOutput(n, [0, 0]) for n in names},
    )


def hanging_chain(count, length=0.3, mass=0.7, gravity=9.81):
    """Point masses on massless rods, one below the other, guessed askew."""
    bodies, joints = {}, {}
    place = np.zeros(2)
    for k in range(count):
        angle = -np.pi / 2 + 0.1 * (-1) ** k
        bodies[f"rod{k}"] = jn.Body(place.tolist(), angle=angle, mass=mass, center_of_mass=[length, 0])
        joints[f"J{k}"] = planar.Revolute(
            ("ground" if k == 0 else f"rod{k - 1}", f"rod{k}"), [0, 0] if k == 0 else [length, 0], [0, 0]
        )
        place = place + length * np.array([np.cos(angle), np.sin(angle)])
    return jn.Mechanism(space="planar", gravity=[0, -gravity], bodies=bodies, joints=joints)


def spherical_pendulum(axes=None, length=0.8, mass=1.3, inertia=0.05):
    """A bob on a ball joint, its frame drawn along the columns of a rotation, hanging along the global -z."""
    axes = np.eye(3) if axes is None else axes
    return jn.Mechanism(
        space="spatial",
        gravity=[0, 0, -9.81],
        bodies={
            "bob": jn.Body(
                [0, 0, 0],
                orientation=from_rotation_matrices(axes).tolist(),
                mass=mass,
                inertia=[inertia] * 3,
                center_of_mass=(axes.T @ [0.3 * length, 0, -length * np.sqrt(1 - 0.09)]).tolist(),
            )
        },
        joints={"ball": spatial.Spherical(("ground", "bob"), [0, 0, 0], [0, 0, 0])},
    )


def column(load, stiffness=2.0, length=0.5, mass=0.4, damping=0.0):
    """Ziegler's column: two rods of point masses 2 m and m with springs in the joints, pushed along the upper one."""
    joint = {"stiffness": stiffness, "damping": damping}
    return jn.Mechanism(
        space="planar",
        bodies={
            "lower": jn.Body([0, 0], mass=2 * mass, center_of_mass=[length, 0]),
            "upper": jn.Body([length, 0], mass=mass, center_of_mass=[length, 0]),
        },
        joints={
            "A": planar.Revolute(("ground", "lower"), [0, 0], [0, 0]),
            "B": planar.Revolute(("lower", "upper"), [length, 0], [0, 0]),
        },
        forces={
            "a": forces.TorsionalSpring(("ground", "lower"), **joint),
            "b": forces.TorsionalSpring(("lower", "upper"), **joint),
            "push": forces.PointForce("upper", [length, 0], [-load, 0.0], frame="body"),
        },
        outputs={"lower": jn.outputs.AngleOutput("lower"), "upper": jn.outputs.AngleOutput("upper")},
    )


def whirling(cone=0.6, length=0.8, mass=1.3, gravity=9.81):
    """A conical pendulum: a point mass on a rod hinged to a light shaft, started in its steady cone."""
    rate, fall = np.sqrt(gravity / (length * np.cos(cone))), np.pi / 2 - cone
    return jn.Mechanism(
        space="spatial",
        gravity=[0, 0, -gravity],
        bodies={
            "shaft": jn.Body([0, 0, 0], mass=1e-9, inertia=[1e-9] * 3),
            "bob": jn.Body(
                [0, 0, 0], orientation={"axis": [0, 1, 0], "angle": fall}, mass=mass, inertia=[1e-12] * 3,
                center_of_mass=[length, 0, 0],
            ),
        },
        joints={
            "bearing": spatial.Revolute(("ground", "shaft"), [0, 0, 0], [0, 0, 0], [0, 0, 1], [0, 0, 1]),
            "hinge": spatial.Revolute(("shaft", "bob"), [0, 0, 0], [0, 0, 0], [0, 1, 0], [0, 1, 0]),
        },
        initial={
            "spin": jn.drivers.RotationDriver(("ground", "shaft"), [0, 0, 1], f"{rate}*t"),
            "fall": jn.drivers.RotationDriver(("shaft", "bob"), [0, 1, 0], f"{fall}", [1, 0, 0], [1, 0, 0]),
        },
        outputs={
            "turn": jn.outputs.RelativeAngleOutput(("ground", "shaft"), [0, 0, 1]),
            "fall": jn.outputs.RelativeAngleOutput(("shaft", "bob"), [0, 1, 0], [1, 0, 0], [1, 0, 0]),
        },
    ), rate  # fmt: skip
