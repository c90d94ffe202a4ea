"""Explicit geometric solutions of the output angles, as closed expressions of time on jets.

The solutions share no step with the solver: no constraint, no Jacobian, no iteration. Each solution comes from one
triangle or one closed vector loop, in a form without loss of digits: angles come from `atan2` of two lengths, never
from `acos` near its ends. Lengths are in m, angles in rad, time in s.
"""

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import jax
import numpy as np
from jaxtyping import Float

import jounce.jet as jet
from jounce.jet import Jet
from jounce.settings import under_own_settings

THETA_START, THETA_DELTA = math.radians(30), math.radians(60)
LANES = 1024  # instants evaluated together; with one width, each form compiles once

Number = Jet | jax.Array | float
Form = Callable[[Jet, Mapping[str, Any]], Jet]


def swing(time: Jet, period: Number) -> Jet:
    """Return the sine of the phase of a cycle, the time-dependent part of all driver motions (Sommer 2024, 56)."""
    return jet.sin(2 * math.pi * time / period)


def balanced_angle(x: Number, y: Number, z: Number, side: int) -> Jet:
    """Return the angle phi for which ``x cos(phi) + y sin(phi) = z``.

    Of the two solutions, `side` +1 selects the one ahead of the direction (x, y), -1 the one behind it.
    """
    root = side * jet.sqrt(x * x + y * y - z * z)
    return jet.atan2(y * z + x * root, x * z - y * root)


def opening_angle(distance: Jet, nearest: Number, farthest: Number) -> Jet:
    """Return the angle between 0 and pi at which two points are `distance` apart.

    One point turns about a fixed axis; the other is fixed. The angle starts where the points are `nearest`; half a turn
    later they are `farthest` apart. These three distances give the sine and the cosine of half the angle, up to a
    common factor, both without loss of digits at the ends.
    """
    sine = (distance - nearest) * (distance + nearest)
    cosine = (farthest - distance) * (farthest + distance)
    return 2 * jet.atan2(jet.sqrt(sine), jet.sqrt(cosine))


def four_bar(time: Jet, p: Mapping[str, Any]) -> Jet:
    """Return the angle of the rocker CD of the planar four-bar.

    The rod closes the triangle B, C, D: ``|D + CD (cos psi, sin psi) - B| = BC``.
    """
    theta = THETA_START + THETA_DELTA * swing(time, p["tau"])
    x, y = p["AB"] * jet.cos(theta) - p["AD"], p["AB"] * jet.sin(theta)  # from D to B
    z = (p["CD"] ** 2 - p["BC"] ** 2 + x * x + y * y) / (2 * p["CD"])
    return balanced_angle(x, y, z, side=-1)


def inverted_slider_crank(time: Jet, p: Mapping[str, Any]) -> Jet:
    """Return the angle of the link FG of the inverted slider-crank, from the triangle E, F, G.

    The sides EF and FG have given lengths, the side EG is driven; G is nearest to E at psi = pi.
    """
    distance = p["d_start"] + p["d_delta"] * swing(time, p["tau"])
    return math.pi - opening_angle(distance, p["EF"] - p["FG"], p["EF"] + p["FG"])


def rsur(time: Jet, p: Mapping[str, Any]) -> Jet:
    """Return the angle of the follower CD of the RSUR and the RSSR mechanism.

    B = (OA, AB cos theta, AB sin theta) and C = (CD sin psi, OD, CD cos psi) are BC apart.
    """
    theta = THETA_START + THETA_DELTA * swing(time, p["tau"])
    height, aside = p["AB"] * jet.sin(theta), p["OD"] - p["AB"] * jet.cos(theta)
    square = p["OA"] ** 2 + aside * aside + height * height  # of the distance from D to B
    z = (p["CD"] ** 2 - p["BC"] ** 2 + square) / (2 * p["CD"])
    return balanced_angle(height, p["OA"], z, side=-1)


def rspu(time: Jet, p: Mapping[str, Any]) -> Jet:
    """Return the angle of the crank AB of the RSPU mechanism, from the driven distance BD.

    B = (OA, AB cos theta, AB sin theta) is nearest to D = (0, OD, 0) at theta = 0.
    """
    distance = p["d_start"] + p["d_delta"] * swing(time, p["tau"])
    nearest = jet.sqrt(p["OA"] ** 2 + (p["OD"] - p["AB"]) ** 2)
    farthest = jet.sqrt(p["OA"] ** 2 + (p["OD"] + p["AB"]) ** 2)
    return opening_angle(distance, nearest, farthest)


@under_own_settings
def evaluate(
    form: Form, time: Float[np.ndarray, " time"], parameters: Mapping[str, float], order: int = 4
) -> Float[np.ndarray, "time {order}+1"]:
    """Return an output angle and its time derivatives from its explicit solution.

    Parameters
    ----------
    form : callable
        A closed form of this module.
    time : array_like of shape (time,)
        Instants, s.
    parameters : mapping of str to float
        Lengths, m, and the period of the driver, s, by their names in the mechanism file.
    order : int, default 4
        Highest derivative.

    Returns
    -------
    numpy.ndarray of shape (time, order + 1)
        Angle in rad and its derivatives by s. The angle is continuous in time.

    Examples
    --------
    >>> sides = {"EF": 0.07, "FG": 0.02, "d_start": 0.07, "d_delta": 0.01, "tau": 2.0}
    >>> psi = evaluate(inverted_slider_crank, np.array([0.0, 0.5]), sides, order=1)
    >>> psi.shape, f"{np.cos(psi[0, 0]):.12f}"
    ((2, 2), '-0.142857142857')
    """
    padded = np.pad(time, (0, -len(time) % LANES), mode="edge").reshape(-1, LANES)
    values = {name: float(value) for name, value in parameters.items()}
    parts = [np.asarray(_derivatives(form, part, values, order)) for part in padded]
    rows = np.concatenate(parts, axis=1)[:, : len(time)].T
    return np.concatenate([np.unwrap(rows[:, :1], axis=0), rows[:, 1:]], axis=1)


@partial(jax.jit, static_argnames=("form", "order"))
def _derivatives(form: Form, time: Any, parameters: Mapping[str, Any], order: int) -> Any:
    return form(Jet.variable(time, order), parameters).derivatives()
