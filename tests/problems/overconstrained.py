"""Linkages that move although their joints are too many by the count, with their motion in closed form (mpmath).

The frames of all bodies are those of the ground at the start: joints are given by points and axes there.
"""

import dataclasses
from collections.abc import Callable

import mpmath
import numpy as np

import jounce as jn
from jounce import drivers, planar, spatial

mp = mpmath.mp
ORIGIN, X, Y, Z = [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]


@dataclasses.dataclass(frozen=True)
class Case:
    """A linkage, how many of its equations are redundant, and one of its outputs as a function of time."""

    mechanism: jn.Mechanism
    redundant: int
    output: str
    motion: Callable
    component: int | None = None  # of a point
    still: tuple[int, ...] = ()  # components of it that do not move


def transform(angle, length, twist):
    """Return the homogeneous transform from a hinge to the next: turn about z, shift along x, twist about x."""
    c, s, ca, sa = np.cos(angle), np.sin(angle), np.cos(twist), np.sin(twist)
    return np.array([[c, -s * ca, s * sa, length * c], [s, c * ca, -c * sa, length * s], [0, sa, ca, 0], [0, 0, 0, 1]])


def hinges_along(angles, lengths, twists):
    """Return points and axes of the hinges of a closed chain, and by how much it does not close."""
    frame, found = np.eye(4), []
    for step in zip(angles, lengths, twists, strict=True):
        found.append((frame[:3, 3], frame[:3, 2]))
        frame = frame @ transform(*step)
    return found, np.abs(frame - np.eye(4)).max()


def hinged_loop(hinges, law, *, size=1.0, guess=0.0, off=0.0, seed=0, **given):
    """Return a closed chain of bodies on hinges in space, the first hinge driven by an angle from where it is drawn.

    Parameters
    ----------
    hinges : sequence of tuple
        Point and axis of each; the ground is between the last and the first.
    size : float
        By which all lengths are multiplied.
    guess : float
        How far bodies are put from where they are drawn, rad and sizes.
    off : float
        By which the axis of the first hinge is turned about x on the ground alone, rad: another twist of that side.
    """
    count, random = len(hinges), np.random.default_rng(seed)
    names = ["ground", *(f"link{k}" for k in range(1, count)), "ground"]
    joints = {}
    for k, (point, axis) in enumerate(hinges):
        place = (size * np.asarray(point)).tolist()
        axis = np.asarray(axis).tolist()
        drawn = [0.0, -np.sin(off), np.cos(off)] if k == 0 else axis  # the first is along z
        joints[f"R{k + 1}"] = spatial.Revolute((names[k], names[k + 1]), place, place, drawn, axis)
    bodies = {}
    for name in names[1:-1]:
        turn = guess * random.normal(size=3)
        bodies[name] = jn.Body(
            (guess * size * random.normal(size=3)).tolist(), orientation=[1.0, *(0.5 * turn).tolist()], mass=1.0
        )
    first, last = ((np.asarray(hinges[k][1]) * sign).tolist() for k, sign in ((0, 1.0), (-1, -1.0)))
    vectors = [across(first), across(first)]
    return jn.Mechanism(
        space="spatial",
        bodies=bodies,
        joints=joints,
        drivers={"turn": drivers.RotationDriver(("ground", "link1"), first, law, *vectors)} if law else {},
        outputs={
            "out": jn.outputs.RelativeAngleOutput(("ground", names[-2]), last, across(last), across(last)),
            "tip": jn.outputs.PointOutput("link1", (size * np.asarray(hinges[1][0])).tolist()),
        },
        **given,
    )


def across(axis):
    """Return a unit vector perpendicular to an axis."""
    axis = np.asarray(axis, float)
    found = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    return (found / np.linalg.norm(found)).tolist()


def bennett_hinges(angle, twists, length=1.0):
    """Return the hinges of a Bennett linkage (1903): sides a, b of twists alpha, beta with a/sin = b/sin."""
    alpha, beta = twists
    lengths = [length, length * np.sin(beta) / np.sin(alpha)] * 2
    second = 2 * np.arctan(np.sin((beta + alpha) / 2) / np.sin((beta - alpha) / 2) / np.tan(angle / 2))
    angles = [angle, second, -angle, -second]
    hinges, gap = hinges_along(angles, lengths, [alpha, beta, alpha, beta])
    assert gap < 1e-12, gap
    return hinges


def bennett_second(first, second):
    """Return the angle of the second hinge for that of the first: tan tan = const, continuous, in mpmath."""
    constant = mp.sin((mp.mpf(second) + first) / 2) / mp.sin((mp.mpf(second) - first) / 2)

    def angle(theta):
        turns = mp.floor(theta / (2 * mp.pi))  # it turns back by a turn for each
        half = theta / 2 - turns * mp.pi
        return 2 * mp.atan2(constant * mp.cos(half), mp.sin(half)) - 2 * mp.pi * turns * mp.sign(constant)

    return angle


def bricard_hinges(angle, twist, length=1.0):
    """Return the hinges of a threefold-symmetric Bricard linkage (Chen, You and Tarnai 2005), and its other angle."""
    other = float(bricard_angle(twist)(mp.mpf(angle)))
    hinges, gap = hinges_along([angle, other] * 3, [length] * 6, [twist, -twist] * 3)
    assert gap < 1e-12, gap
    return hinges


def bricard_angle(twist):
    """Return the second angle of a threefold-symmetric Bricard linkage for the first, in mpmath.

    cos^2 a + sin^2 a (cos t + cos f) + (1 + cos^2 a) cos t cos f - 2 cos a sin t sin f = 0.
    """
    c2, s2, c = mp.cos(twist) ** 2, mp.sin(twist) ** 2, mp.cos(twist)

    def angle(first):
        x, y = s2 + (1 + c2) * mp.cos(first), -2 * c * mp.sin(first)
        rest = -(c2 + s2 * mp.cos(first))
        return mp.atan2(y, x) - mp.acos(rest / mp.sqrt(x * x + y * y))

    return angle


LAW, TURN = "0.3*t + 0.4*sin(t)", lambda t: mp.mpf("0.3") * t + mp.mpf("0.4") * mp.sin(t)


def bennett(twists=(0.9, 1.4), start=1.2, law=LAW, **given):
    """A Bennett linkage: four hinges whose axes are neither parallel nor meet."""
    second = bennett_second(*twists)
    loop = hinged_loop(bennett_hinges(start, twists), law, **given)
    return Case(loop, 3, "out", lambda t: second(mp.mpf(start)) - second(start + TURN(t)))


def bricard(twist=1.2, start=1.0, **given):
    """A threefold-symmetric Bricard linkage of six hinges."""
    second = bricard_angle(mp.mpf(twist))
    loop = hinged_loop(bricard_hinges(start, twist), "0.4*sin(t)", **given)

    def motion(t):
        return second(start + mp.mpf("0.4") * mp.sin(t)) - second(mp.mpf(start))

    return Case(loop, 1, "out", motion)


def goldberg(twists=(0.9, 1.4, 0.6), start=1.2, corner=0.4, **given):
    """A Goldberg linkage (1943): two Bennett linkages have a side and its two hinges in common, and lose the side.

    At one of these hinges a side of each, alpha and gamma, are made one, bent by a corner: that is the ground.
    """
    alpha, beta, gamma = twists
    a, b, c = (float(np.sin(twist) / np.sin(beta)) for twist in twists)
    second, fourth = bennett_second(alpha, beta), bennett_second(beta, gamma)
    angle = float(second(mp.mpf(start)))
    inner, outer = angle - corner, float(fourth(mp.mpf(angle - corner)))
    at_second = transform(0.0, a, alpha)
    third = at_second @ transform(angle, b, beta)
    side = third @ transform(outer, c, gamma)
    frames = [np.eye(4), third @ transform(-start, a, alpha), third, side, side @ transform(-inner, b, beta)]
    loop = hinged_loop([(frame[:3, 3], frame[:3, 2]) for frame in frames], LAW, **given)

    def motion(t):
        return fourth(mp.mpf(angle - corner)) - fourth(second(start - TURN(t)) - corner)

    return Case(loop, 2, "out", motion)


def sarrus(**given):
    """A Sarrus linkage (1853): two pairs of plates on parallel hinges lead a platform along a straight line."""
    del given
    height, half = 2 * np.sin(0.6), np.cos(0.6)
    bodies, joints = {"platform": jn.Body(ORIGIN, mass=1.0)}, {}
    for name, out, axis in (("x", X, Y), ("y", Y, [-1.0, 0.0, 0.0])):
        out = np.asarray(out)
        foot, knee = out * 1.0, out * (1.0 + half) + np.array([0, 0, height / 2])
        head = out * 1.0 + np.array([0, 0, height])
        bodies |= {f"lower_{name}": jn.Body(ORIGIN, mass=1.0), f"upper_{name}": jn.Body(ORIGIN, mass=1.0)}
        chain = ("ground", f"lower_{name}", f"upper_{name}", "platform")
        for k, point in enumerate((foot, knee, head)):
            place = point.tolist()
            joints[f"{name}{k + 1}"] = spatial.Revolute(chain[k : k + 2], place, place, axis, axis)
    mechanism = jn.Mechanism(
        space="spatial",
        bodies=bodies,
        joints=joints,
        drivers={"turn": drivers.RotationDriver(("ground", "lower_x"), [0.0, -1.0, 0.0], LAW)},
        outputs={"lift": jn.outputs.PointOutput("platform", ORIGIN)},
    )
    start = mp.mpf("0.6")
    return Case(mechanism, 1, "lift", lambda t: 2 * (mp.sin(start + TURN(t)) - mp.sin(start)), 2, (0, 1))


def parallelogram(cranks=3):
    """A parallelogram in the plane with more cranks than two; its coupler is carried along a circle."""
    bodies, joints = {"coupler": jn.Body([np.cos(0.7), np.sin(0.7)], mass=1.0)}, {}
    for k in range(cranks):
        name = f"crank{k + 1}"
        bodies[name] = jn.Body([1.5 * k, 0.0], angle=0.7, mass=1.0)
        joints[f"O{k + 1}"] = planar.Revolute(("ground", name), [1.5 * k, 0.0], [0.0, 0.0])
        joints[f"A{k + 1}"] = planar.Revolute((name, "coupler"), [1.0, 0.0], [1.5 * k, 0.0])
    mechanism = jn.Mechanism(
        space="planar",
        bodies=bodies,
        joints=joints,
        drivers={"turn": drivers.CoordinateDriver(("ground", "crank1"), "angle", f"0.7 + {LAW}")},
        outputs={"coupler": jn.outputs.PointOutput("coupler", [0.0, 0.0])},
    )
    return Case(mechanism, cranks - 2, "coupler", lambda t: mp.sin(mp.mpf("0.7") + TURN(t)), 1)


def double_cardan(shift=0.6):
    """Two parallel shafts in bearings and one between them with two Hooke joints: both turn alike."""
    middle = np.array([1.0, shift, 0.0]) / np.hypot(1.0, shift)
    across_ = [-float(middle[1]), float(middle[0]), 0.0]
    end = [1.0, shift, 0.0]
    mechanism = jn.Mechanism(
        space="spatial",
        bodies={name: jn.Body(ORIGIN, mass=1.0) for name in ("input", "middle", "output")},
        joints={
            "front": spatial.Revolute(("ground", "input"), [-1.0, 0, 0], [-1.0, 0, 0], X, X),
            "first": spatial.Universal(("input", "middle"), ORIGIN, ORIGIN, Z, across_),
            "second": spatial.Universal(("middle", "output"), end, end, across_, Z),
            "back": spatial.Revolute(("ground", "output"), [2.0, shift, 0], [2.0, shift, 0], X, X),
        },
        drivers={"turn": drivers.RotationDriver(("ground", "input"), X, LAW)},
        outputs={"angle": jn.outputs.RelativeAngleOutput(("ground", "output"), X)},
    )
    return Case(mechanism, 1, "angle", TURN)


def scott_russell(size=1.0):
    """A straight-line linkage of Scott Russell in space: hinges all along z, both ends of the rod on guides."""

    def at(*point):
        return [size * x for x in point] + [0.0]

    c, s = float(np.cos(0.7)), float(np.sin(0.7))
    place = {"crank": at(0, 0), "rod": at(c, s), "along": at(2 * c, 0), "up": at(0, 2 * s)}
    turned = {"crank": 0.7, "rod": -0.7, "along": 0.0, "up": 0.0}
    bodies = {name: jn.Body(p, orientation={"axis": Z, "angle": turned[name]}, mass=1.0) for name, p in place.items()}
    hinge = {"axis_i": Z, "axis_j": Z}
    mechanism = jn.Mechanism(
        space="spatial",
        bodies=bodies,
        joints={
            "O": spatial.Revolute(("ground", "crank"), at(0, 0), at(0, 0), **hinge),
            "A": spatial.Revolute(("crank", "rod"), at(1, 0), at(0, 0), **hinge),
            "B": spatial.Revolute(("rod", "along"), at(1, 0), at(0, 0), **hinge),
            "C": spatial.Revolute(("rod", "up"), at(-1, 0), at(0, 0), **hinge),
            "guide": spatial.Prismatic(("ground", "along"), at(0, 0), at(0, 0), X, X, Y, Y),
            "rail": spatial.Prismatic(("ground", "up"), at(0, 0), at(0, 0), Y, Y, Z, Z),
        },
        drivers={"turn": drivers.RotationDriver(("ground", "crank"), Z, f"0.7 + {LAW}")},
        outputs={"end": jn.outputs.PointOutput("rod", at(-1, 0))},
    )
    return Case(mechanism, 7, "end", lambda t: size * 2 * mp.sin(mp.mpf("0.7") + TURN(t)), 1, (0, 2))


def four_bar_of_hinges(size=1.0, law=f"0.7 + {LAW}", masses=False, space="spatial"):
    """A planar four-bar of four hinges in space, or in the plane; lengths 1, 3, 2.5 and 2 between the pins."""
    # where the coupler is at the start, by the closed form
    c = closing(1.0, 3.0, 2.5, 2.0, 0.7)
    poses = {"crank": ((0, 0), 0.7), "coupler": ((np.cos(0.7), np.sin(0.7)), c[0]), "rocker": ((2.5, 0), c[1])}
    centers = {"crank": (0.5, 0.0), "coupler": (1.5, 0.2), "rocker": (1.0, -0.1)}
    bodies, joints = {}, {}
    for name, ((x, y), angle) in poses.items():
        flat = space == "planar"
        given = {"mass": 2.0, "inertia": 0.3 * size**2 if flat else [0.1 * size**2, 0.2 * size**2, 0.3 * size**2]}
        given["center_of_mass"] = [size * v for v in centers[name]] + [0.0] * (not flat)
        place = [size * float(x), size * float(y)]
        turned = {"angle": float(angle)} if flat else {"orientation": {"axis": Z, "angle": float(angle)}}
        bodies[name] = jn.Body(place + [0.0] * (not flat), **turned, **(given if masses else {}))
    pins = {
        "A": ("ground", "crank", 0, 0),
        "B": ("crank", "coupler", 1, 0),
        "C": ("coupler", "rocker", 3, 2),
        "D": ("ground", "rocker", 2.5, 0),
    }
    for name, (first, second, x, y) in pins.items():
        if space == "planar":
            joints[name] = planar.Revolute((first, second), [size * x, 0.0], [size * y, 0.0])
        else:
            joints[name] = spatial.Revolute((first, second), [size * x, 0, 0], [size * y, 0, 0], Z, Z)
    driven = (
        drivers.CoordinateDriver(("ground", "crank"), "angle", law)
        if space == "planar"
        else drivers.RotationDriver(("ground", "crank"), Z, law)
    )
    return jn.Mechanism(
        space=space,
        bodies=bodies,
        joints=joints,
        drivers={"turn": driven} if law else {},
        outputs={
            "C": jn.outputs.PointOutput("rocker", [2.0 * size, 0.0] if space == "planar" else [2.0 * size, 0.0, 0.0])
        },
        gravity=([0.0, -9.81] if space == "planar" else [0.0, -9.81, 0.0]) if masses else None,
    )


def closing(crank, coupler, ground, rocker, angle):
    """Return the angles of coupler and rocker of a planar four-bar, open, for that of the crank."""
    lib = mp if isinstance(angle, mpmath.mpf) else np
    x, y = ground - crank * lib.cos(angle), -crank * lib.sin(angle)
    far = x * x + y * y
    acos = mp.acos if lib is mp else np.arccos
    atan2 = mp.atan2 if lib is mp else np.arctan2
    inner = acos((far + coupler**2 - rocker**2) / (2 * coupler * lib.sqrt(far)))
    first = atan2(y, x) + inner
    up, right = crank * lib.sin(angle) + coupler * lib.sin(first), crank * lib.cos(angle) + coupler * lib.cos(first)
    return first, atan2(up, right - ground)
