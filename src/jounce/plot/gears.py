"""Where gears stand and how large they are: it follows from the pins that hold them and from the ratio of the pair."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.constraints.facts import facts_of
from jounce.mechanism import Mechanism
from jounce.mechanism.mechanism import GROUND
from jounce.mechanism.resolve import resolve
from jounce.plot.frames import guessed, points_at, within

__all__ = ["pitch_radii"]

Center = Float[np.ndarray, "2"]
Pins = list[dict[str, Center]]  # the points of each revolute joint by body


def pitch_radii(
    mechanism: Mechanism, bodies: tuple[str, ...], ratio: float
) -> tuple[list[Center], tuple[float, float] | None]:
    """Return the centres of two gears, each in the frame of its body, and their pitch radii, m.

    Parameters
    ----------
    mechanism : Mechanism
        Planar.
    bodies : tuple of str
        Gears i and j, and the frame m that carries them; the ground unless named.
    ratio : float
        ``-rho_i / rho_j`` of gears that mesh outside each other, ``rho_i / rho_j`` of one inside the other.

    Returns
    -------
    centres : list of numpy.ndarray
        Where each is pinned; its origin where it is not.
    radii : tuple of float, or None
        None where no gears with this ratio can stand so: two bodies on one centre, or turning alike.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot.gears import pitch_radii
    >>> train = jn.load("examples/epicyclic.yaml")  # teeth of 2 mm: 24 of the sun, 18 of the planet
    >>> centres, radii = pitch_radii(train, ("sun", "planet", "carrier"), -24 / 18)
    >>> [round(radius, 6) for radius in radii]
    [0.024, 0.018]
    """
    carrier = bodies[2] if len(bodies) > 2 else GROUND
    pins = _pins(mechanism)
    centers = [_center(pins, body, carrier) for body in bodies[:2]]
    points = [_seen_from(mechanism, pins, body, carrier, center) for body, center in zip(bodies, centers, strict=False)]
    distance = float(np.linalg.norm(points[1] - points[0]))
    largest = max(1e-300, *(float(np.max(np.abs(point))) for point in points))
    if distance <= 1e-9 * largest or ratio in (0.0, 1.0):
        return centers, None
    second = distance / abs(1.0 - ratio)
    return centers, (abs(ratio) * second, second)


def _pins(mechanism: Any) -> Pins:
    """Return the points of all revolute joints by body."""
    parameters = mechanism.parameter_values
    return [
        {
            body: np.asarray(resolve(point, parameters), float)
            for body, point in zip(joint.bodies, (joint.point_i, joint.point_j), strict=True)
        }
        for joint in mechanism.joints.values()
        if facts_of(type(joint)).pair == "revolute"
    ]


def _center(pins: Pins, body: str, carrier: str) -> Center:
    """Return the point of a gear at which it is pinned: to its carrier, to the ground, or to any other body."""
    holding = [pin for pin in pins if body in pin]
    for body_sought in (carrier, GROUND):
        for pin in holding:
            if body_sought in pin and body_sought != body:
                return pin[body]
    return holding[0][body] if holding else np.zeros(2)


def _seen_from(mechanism: Mechanism, pins: Pins, body: str, carrier: str, center: Center) -> Center:
    """Return the centre of a gear in the frame of its carrier: by a pin, by two on one line, else by the guess."""
    holding = [pin for pin in pins if body in pin and np.array_equal(pin[body], center)]
    for pin in holding:
        if carrier in pin:
            return pin[carrier]
    for pin in holding:
        (other,) = set(pin) - {body}
        for second in pins:
            if other in second and carrier in second and np.allclose(second[other], pin[other], rtol=0, atol=1e-12):
                return second[carrier]
    frames = guessed(mechanism)
    (point,) = points_at(frames[body], center)
    return within(frames[carrier], point[None])[0]
