"""Linkages that move although their joints are too many by the count, with their motion in closed form (mpmath).

The frames of all bodies are those of the ground at the start: joints are given by points and axes there.
"""

import mpmath
import numpy as np

import jounce as jn
from jounce import drivers, planar, spatial

mp = mpmath.mp
Z = (0.0, 0.0, 1.0)


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


def hinged_loop(hinges, law, *, size=1.0, guess=0.0, seed=0, **given):
    """Return a closed chain of bodies on hinges in space, the first hinge driven by an angle from where it is drawn.

    Parameters
    ----------
    hinges : sequence of tuple
        Point and axis of each; the ground is between the last and the first.
    size : float
        By which all lengths are multiplied.
    guess : float
        How far bodies are put from where they are drawn, rad and sizes.
    """
    count, random = len(hinges), np.random.default_rng(seed)
    names = ["ground", *(f"link{k}" for k in range(1, count)), "ground"]
    joints = {}
    for k, (point, axis) in enumerate(hinges):
        place = (size * np.asarray(point)).tolist()
        axis = np.asarray(axis).tolist()
        joints[f"R{k + 1}"] = spatial.Revolute((names[k], names[k + 1]), place, place, axis, axis)
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
            "out": jn.RelativeAngleOutput(("ground", names[-2]), last, across(last), across(last)),
            "tip": jn.PointOutput("link1", (size * np.asarray(hinges[1][0])).tolist()),
        },
        **given,
    )


def across(axis):
    """Return a unit vector perpendicular to an axis."""
    axis = np.asarray(axis, float)
    found = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    return (found / np.linalg.norm(found)).tolist()


def bennett_hinges(angle, twists, length=1.0, off=0.0):
    """Return the hinges of a Bennett linkage (1903): sides a, b of twists alpha, beta with a/sin = b/sin."""
    alpha, beta = twists
    lengths = [length, length * np.sin(beta) / np.sin(alpha)] * 2
    second = 2 * np.arctan(np.sin((beta + alpha) / 2) / np.sin((beta - alpha) / 2) / np.tan(angle / 2))
    angles = [angle, second, -angle, -second]
    hinges, gap = hinges_along(angles, lengths, [alpha, beta, alpha, beta])
    assert gap < 1e-12, gap
    if off:  # another twist of the last side: its two hinges are on the ground
        point, axis = hinges[0]
        x = transform(angles[3], 0.0, 0.0)
        along = (np.linalg.multi_dot([transform(*s) for s in zip(angles[:3], lengths[:3], [alpha, beta, alpha])]) @ x)[
            :3, 0
        ]
        turned = axis * np.cos(off) + np.cross(along, axis) * np.sin(off)
        hinges[0] = (point, turned)
    return hinges


def bennett_output(start, twists):
    """Return the turn of the last hinge from its start, for a turn of the first: tan tan = const, in mpmath."""
    alpha, beta = map(mp.mpf, twists)
    constant = mp.sin((beta + alpha) / 2) / mp.sin((beta - alpha) / 2)

    def angle(first):  # theta 4 = -theta 2, continuous where theta 1 passes half a turn
        return -2 * mp.atan2(constant * mp.cos(first / 2), mp.sin(first / 2))

    return lambda turn: angle(start + turn) - angle(mp.mpf(start))


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
