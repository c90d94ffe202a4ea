"""Quaternions of poses in robot files."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from jounce.io.robots.elements.faults import NOT_UNIT
from jounce.io.robots.elements.xml_elements import Element

LEAST = 1e-9
ROUNDED = 0.01  # deviation of the length by rounding to two decimals


def rotation_of(quaternion: Sequence[float], element: Element, *name: str) -> Float[np.ndarray, "3 3"]:
    """Return the rotation matrix of a quaternion x, y, z, w; a length that is far from 1 is recorded as a fault.

    Raises
    ------
    RobotFileError
        If the quaternion is zero, or a recorded fault is an error.
    """
    from scipy.spatial.transform import Rotation

    length = math.hypot(*quaternion)
    if length < LEAST:
        raise element.error("quat_xyzw must not be zero", *name, value=list(quaternion))
    if abs(length - 1) > ROUNDED and element.faults is not None:
        message = f"the quaternion has the length {length:.6g}, not 1; divide it by that, or see what it should be"
        element.faults.add(NOT_UNIT, ".".join(name), element.error(message, *name, value=list(quaternion)))
    return Rotation.from_quat(quaternion).as_matrix()
