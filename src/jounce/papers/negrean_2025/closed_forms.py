"""Energies and torques of a link that turns about one fixed axis, as the paper prints them: equations 141-146."""

import numpy as np
from jaxtyping import Float

from jounce.base.shapes import ArrayLike
from jounce.jet import Jet, sine_cosine


def energies(inertia: float, motion: ArrayLike) -> Float[np.ndarray, "*batch 3"]:
    """Return the acceleration energies of orders 1 to 3: Negrean 2025, equations 141-143.

    Two terms of equation 143 are printed twice in the text at hand; they count once.

    Parameters
    ----------
    inertia : float
        Moment of inertia about the axis, kg m^2.
    motion : array_like of shape (..., 5 or more)
        Angle, speed, acceleration, jerk and jounce, rad by s.

    Returns
    -------
    array of shape (..., 3)
        Acceleration energies, kg m^2 / s^4, / s^6 and / s^8.

    Examples
    --------
    >>> energies(2.0, [0.0, 1.0, 3.0, 2.0, 0.0]).tolist()
    [10.0, 82.0, 1480.0]
    """
    w, a, j, s = np.moveaxis(np.asarray(motion, float), -1, 0)[1:5]
    square = a**2 + w**4
    second = j**2 - 2 * w**3 * j + 9 * w**2 * a**2 + w**6
    third = s**2 + w**8 - 8 * w**5 * j + 30 * w**4 * a**2 - 12 * w**2 * a * s
    third = third + 16 * w**2 * j**2 + 24 * w * a**2 * j + 9 * a**4
    return inertia / 2 * np.stack([square, second, third], axis=-1)


def gravity_torques(
    mass: float, center: tuple[float, float], gravity: float, motion: ArrayLike, rates: int = 2
) -> Float[np.ndarray, "*batch rates"]:
    """Return the torque that holds the link against its weight, and its rates: Q_g of Negrean 2025, 144-146.

    The paper does not write this torque out. The axis y is horizontal, the link turns from x toward -z, and z is up at
    angle zero, so that the center of mass has the height ``z_C cos q - x_C sin q``.

    Parameters
    ----------
    mass : float
        Mass, kg.
    center : tuple of float
        Coordinates x_C and z_C of the center of mass, m.
    gravity : float
        Gravitational acceleration, downwards, m/s^2.
    motion : array_like of shape (..., rates + 1 or more)
        Angle and its derivatives, rad by s.
    rates : int, default 2
        Number of rates.

    Returns
    -------
    array of shape (..., rates + 1)
        Torque and its rates, N m by s.

    Examples
    --------
    >>> gravity_torques(2.0, (0.5, 0.0), 10.0, [0.0, 3.0], rates=1).tolist()
    [-10.0, 0.0]
    """
    derivatives = np.moveaxis(np.asarray(motion, float), -1, 0)[: rates + 1]
    sine, cosine = sine_cosine(Jet.from_derivatives(derivatives))
    slope = sine * -center[1] - cosine * center[0]
    return np.moveaxis(np.asarray((slope * (mass * gravity)).derivatives()), 0, -1)


def torques(inertia: float, motion: ArrayLike, gravity: ArrayLike) -> Float[np.ndarray, "*batch rates"]:
    """Return the driving torque and its rates: Negrean 2025, equations 144-146, with the part of gravity.

    Parameters
    ----------
    inertia : float
        Moment of inertia about the axis, kg m^2.
    motion : array_like of shape (..., rates + 3 or more)
        Angle and its derivatives, rad by s.
    gravity : array_like of shape (..., rates + 1)
        Torques against gravity, N m by s.

    Returns
    -------
    array of shape (..., rates + 1)
        Torque and its rates, N m by s.

    Examples
    --------
    >>> torques(2.0, [0.0, 1.0, 3.0, 2.0], [1.0, 0.0]).tolist()
    [7.0, 4.0]
    """
    gravity = np.asarray(gravity, float)
    return inertia * np.asarray(motion, float)[..., 2 : 2 + gravity.shape[-1]] + gravity
