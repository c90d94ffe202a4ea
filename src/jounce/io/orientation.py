"""Orientations as a mechanism file writes them, turned into Euler parameters."""

from __future__ import annotations

import math
from collections.abc import Sequence

from jounce.errors import MechanismError

__all__ = ["AXES", "from_axis_angle", "from_euler", "from_quaternion"]

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}

Quaternion = tuple[float, float, float, float]
"""Euler parameters (e0, e1, e2, e3), the scalar first, of unit length."""


def _unit(vector: Sequence[float], what: str) -> tuple[float, ...]:
    size = math.hypot(*vector)
    if size == 0:
        raise MechanismError(f"{what} must not be of zero length", value=list(vector))
    if not math.isfinite(size):
        raise MechanismError(f"{what} must be finite", value=list(vector))
    return tuple(component / size for component in vector)


def from_quaternion(quaternion: Sequence[float]) -> Quaternion:
    """Return Euler parameters of unit length.

    Parameters
    ----------
    quaternion : sequence of 4 numbers
        e0, e1, e2, e3, the scalar first; any length but zero.

    Raises
    ------
    MechanismError
        All are zero.

    Examples
    --------
    >>> from_quaternion([2.0, 0.0, 0.0, 0.0])
    (1.0, 0.0, 0.0, 0.0)
    """
    unit = _unit(quaternion, "the Euler parameters")
    near = abs(math.hypot(*quaternion) - 1) < 1e-15  # what was written in full is read as it was
    e0, e1, e2, e3 = map(float, quaternion) if near else unit
    return (e0, e1, e2, e3)


def from_axis_angle(axis: Sequence[float], angle: float) -> Quaternion:
    """Return the Euler parameters of a turn by ``angle`` (rad) about an axis in the global frame.

    Raises
    ------
    MechanismError
        The axis is of zero length.

    Examples
    --------
    >>> from math import pi
    >>> [round(e, 12) for e in from_axis_angle([0.0, 0.0, 3.0], pi)]
    [0.0, 0.0, 0.0, 1.0]
    """
    x, y, z = _unit(axis, "the axis")
    half = math.sin(angle / 2)
    return (math.cos(angle / 2), half * x, half * y, half * z)


def from_euler(sequence: str, angles: Sequence[float]) -> Quaternion:
    """Return the Euler parameters of three turns about coordinate axes, one after the other.

    Parameters
    ----------
    sequence : str
        Three letters, neighbours different. Lower case (``zxz``): about the axes of the global frame, which stay
        (extrinsic). Upper case (``ZXZ``): about the axes of the body, which move (intrinsic). This is the convention of
        ``scipy.spatial.transform.Rotation.from_euler``.
    angles : sequence of 3 numbers
        rad, in the order of the letters.

    Raises
    ------
    MechanismError
        The sequence is not one of the 12 of either kind.

    Examples
    --------
    >>> from math import pi
    >>> [round(e, 3) for e in from_euler("ZXZ", [pi / 2, pi / 2, 0.0])]
    [0.5, 0.5, 0.5, 0.5]
    """
    letters = sequence.lower()
    same_case = sequence in (letters, letters.upper())
    if len(letters) != 3 or not same_case or set(letters) - AXES.keys():
        message = "a sequence of Euler angles has three letters, such as zxz (fixed axes) or ZXZ (moving axes)"
        raise MechanismError(message, value=sequence)
    if letters[0] == letters[1] or letters[1] == letters[2]:
        raise MechanismError("neighbouring axes of a sequence of Euler angles must differ", value=sequence)
    whole: Quaternion = (1.0, 0.0, 0.0, 0.0)
    for letter, angle in zip(letters, angles, strict=True):
        turn = from_axis_angle(AXES[letter], angle)
        whole = _product(turn, whole) if sequence.islower() else _product(whole, turn)
    return whole


def _product(p: Quaternion, q: Quaternion) -> Quaternion:
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    )
