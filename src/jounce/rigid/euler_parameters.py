"""Euler parameters from the forms in which files and users write orientations."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.base.shapes import by_component
from jounce.errors import MechanismError, show_value, unknown
from jounce.rigid.rotations import check_sequence

FORMS: dict[str, tuple[str, ...]] = {
    "quaternion": ("quaternion",),
    "euler": ("euler", "angles"),
    "axis": ("axis", "angle"),
}
"""The forms of an orientation by the key that identifies them, with the keys of each form."""

Quaternion = tuple[float, float, float, float]
"""Euler parameters (e0, e1, e2, e3), scalar first, of unit length."""


def form_of(keys: Mapping[str, Any]) -> str | None:
    """Return the form of an orientation by its keys, or None if no key identifies it.

    Raises
    ------
    MechanismError
        If a key does not belong to the form, or one is missing; the name of the error is the key.
    """
    form = next((form for form in FORMS if form in keys), None)
    valid = FORMS[form] if form else [key for names in FORMS.values() for key in names]
    for key in keys:
        if key not in valid:
            raise MechanismError(unknown(f"key {show_value(key)}", key, valid), name=str(key))
    for key in valid if form else ("quaternion",):
        if key not in keys:
            raise MechanismError("is missing", name=key)
    return form


def euler_parameters(orientation: Any) -> Quaternion:
    """Return the Euler parameters of an orientation in any of its forms.

    Parameters
    ----------
    orientation : sequence of 4 numbers, or dict
        Euler parameters; or ``{"quaternion": ...}``, ``{"axis": ..., "angle": ...}`` or ``{"euler": ..., "angles":
        ...}`` with numbers, angles in rad.

    Returns
    -------
    tuple of 4 float
        e0, e1, e2, e3, scalar first, of unit length.

    Raises
    ------
    MechanismError
        If the form is unknown, or its numbers do not define an orientation.

    Examples
    --------
    >>> euler_parameters({"axis": [0.0, 0.0, 1.0], "angle": 0.0})
    (1.0, 0.0, 0.0, 0.0)
    """
    if not isinstance(orientation, Mapping):
        return from_quaternion(_numbers(orientation, 4, "the Euler parameters"))
    form = form_of(orientation)
    if form == "quaternion":
        return from_quaternion(_numbers(orientation["quaternion"], 4, "the Euler parameters"))
    if form == "euler":
        return from_euler(orientation["euler"], _numbers(orientation["angles"], 3, "the Euler angles"))
    (angle,) = _numbers([orientation["angle"]], 1, "the angle")
    return from_axis_angle(_numbers(orientation["axis"], 3, "the axis"), angle)


def _numbers(values: Any, count: int, phrase: str) -> list[float]:
    """Return finite numbers, or raise a MechanismError that names them as `phrase`."""
    if phrase != "the Euler angles":  # these follow the order of the rotations, whatever their labels
        values = by_component(None, values, MechanismError)
    try:
        numbers = [float(value) for value in values]
    except (TypeError, ValueError):
        numbers = []
    if isinstance(values, str) or len(numbers) != count:
        raise MechanismError(f"{phrase} must be {'one number' if count == 1 else f'{count} numbers'}", value=values)
    if not all(map(math.isfinite, numbers)):
        raise MechanismError(f"{phrase} must be finite", value=numbers)
    return numbers


def _unit(vector: Sequence[float], phrase: str) -> tuple[float, ...]:
    size = math.hypot(*vector)
    if size == 0:
        raise MechanismError(f"{phrase} must not be of zero length", value=list(vector))
    if not math.isfinite(size):
        raise MechanismError(f"{phrase} must be finite", value=list(vector))
    return tuple(component / size for component in vector)


def from_quaternion(quaternion: Sequence[float]) -> Quaternion:
    """Return Euler parameters of unit length.

    Parameters
    ----------
    quaternion : sequence of 4 numbers
        e0, e1, e2, e3, scalar first, of any nonzero length.

    Raises
    ------
    MechanismError
        If all are zero.

    Examples
    --------
    >>> from_quaternion([2.0, 0.0, 0.0, 0.0])
    (1.0, 0.0, 0.0, 0.0)
    """
    unit = _unit(quaternion, "the Euler parameters")
    is_unit = abs(math.hypot(*quaternion) - 1) < 1e-15  # values written in full are kept unchanged
    e0, e1, e2, e3 = map(float, quaternion) if is_unit else unit
    return (e0, e1, e2, e3)


def from_axis_angle(axis: Sequence[float], angle: float) -> Quaternion:
    """Return the Euler parameters of a rotation by ``angle`` (rad) about an axis in the global frame.

    Raises
    ------
    MechanismError
        If the axis has zero length.

    Examples
    --------
    >>> from math import pi
    >>> [round(e, 12) for e in from_axis_angle([0.0, 0.0, 3.0], pi)]
    [0.0, 0.0, 0.0, 1.0]
    """
    x, y, z = _unit(axis, "the axis")
    sine = math.sin(0.5 * angle)
    return (math.cos(0.5 * angle), sine * x, sine * y, sine * z)


def from_rotation_matrices(matrices: Float[np.ndarray, "*batch 3 3"]) -> Float[np.ndarray, "*batch 4"]:
    """Return the Euler parameters, (..., 4), of rotation matrices, (..., 3, 3); the largest of each is positive."""
    from scipy.spatial.transform import Rotation

    flat = Rotation.from_matrix(matrices.reshape(-1, 3, 3)).as_quat(scalar_first=True)
    return flat.reshape(*matrices.shape[:-2], 4)


def from_euler(sequence: str, angles: Sequence[float]) -> Quaternion:
    """Return the Euler parameters of three successive rotations about coordinate axes.

    Parameters
    ----------
    sequence : str
        Three letters, neighbors different. Lower case (``zxz``): about the fixed axes of the global frame (extrinsic).
        Upper case (``ZXZ``): about the moving axes of the body (intrinsic). This is the convention of
        ``scipy.spatial.transform.Rotation.from_euler``.
    angles : sequence of 3 numbers
        Angles, rad, in the order of the letters.

    Raises
    ------
    MechanismError
        If the sequence is not one of the 12 of either kind.

    Examples
    --------
    >>> from math import pi
    >>> [round(e, 3) for e in from_euler("ZXZ", [pi / 2, pi / 2, 0.0])]
    [0.5, 0.5, 0.5, 0.5]
    """
    check_sequence(sequence, MechanismError, name=None)
    from scipy.spatial.transform import Rotation

    e0, e1, e2, e3 = Rotation.from_euler(sequence, list(angles)).as_quat(scalar_first=True).tolist()
    return (e0, e1, e2, e3)
