"""Centers and radii of gears, from the pins that hold them and the ratio of the pair."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.constraints.facts import facts_of
from jounce.mechanism import Mechanism
from jounce.mechanism.mechanism import GROUND
from jounce.mechanism.resolve import resolve
from jounce.plot.drawings.frames import guessed, points_at, within

THINNEST = 0.12  # drawn radius of a worm, as a fraction of the distance of the shafts

Center = Float[np.ndarray, " component"]
Pins = list[dict[str, Center]]  # the points of each revolute joint by body


def pitch_radii(
    mechanism: Mechanism, bodies: tuple[str, ...], ratio: float
) -> tuple[list[Center], tuple[float, float] | None]:
    """Return the centers of two gears, each in the frame of its body, and their pitch radii, m.

    Parameters
    ----------
    mechanism : Mechanism
        A planar mechanism.
    bodies : tuple of str
        Gears i and j, and the frame m that carries them, by default the ground.
    ratio : float
        ``-rho_i / rho_j`` for an external pair, ``rho_i / rho_j`` for an internal pair.

    Returns
    -------
    centers : list of numpy.ndarray
        Pin of each gear, or its origin without a pin.
    radii : tuple of float, or None
        None if gears with these centers and this ratio cannot exist: coincident centers, or a ratio of one.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot.drawings.gears import pitch_radii
    >>> train = jn.load("examples/epicyclic.yaml")  # teeth of 2 mm: 24 of the sun, 18 of the planet
    >>> centers, radii = pitch_radii(train, ("sun", "planet", "carrier"), -24 / 18)
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
    """Return the points of each revolute joint by body."""
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
    """Return the pin of a gear in its frame: to its carrier, to the ground, or to any other body."""
    holding = [pin for pin in pins if body in pin]
    for body_sought in (carrier, GROUND):
        for pin in holding:
            if body_sought in pin and body_sought != body:
                return pin[body]
    return holding[0][body] if holding else np.zeros(2)


def _seen_from(mechanism: Mechanism, pins: Pins, body: str, carrier: str, center: Center) -> Center:
    """Return the center of a gear in the frame of its carrier: from a pin, from two coaxial pins, or from the guess."""
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


def shaft_wheels(mechanism: Mechanism, gear: Any) -> tuple[list[Center], list[float]]:
    """Return the drawn centers of the wheels of two shafts in space, each in the frame of its body, and their radii, m.

    The rims touch, with radii in the ratio of the gear, if the axes permit: for intersecting axes, at the distance of
    the hinges from the intersection; for others, at the common perpendicular.

    Parameters
    ----------
    mechanism : Mechanism
        A spatial mechanism.
    gear : jounce.spatial.Gear
        A joint of the mechanism.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot.drawings.gears import shaft_wheels
    >>> zero, x, y = [0, 0, 0], [1, 0, 0], [0, 1, 0]
    >>> pair = jn.Mechanism(
    ...     space="spatial",
    ...     bodies={"pinion": jn.Body([-0.06, 0, 0]), "wheel": jn.Body([0, 0.04, 0])},
    ...     joints={
    ...         "A": jn.spatial.Revolute(("ground", "pinion"), [-0.06, 0, 0], zero, x, x),
    ...         "B": jn.spatial.Revolute(("ground", "wheel"), [0, 0.04, 0], zero, y, y),
    ...         "mesh": jn.spatial.Gear(("pinion", "wheel", "ground"), x, y, -2 / 3),
    ...     },
    ... )
    >>> centers, radii = shaft_wheels(pair, pair.joints["mesh"])
    >>> [round(radius, 6) for radius in radii]
    [0.04, 0.06]
    """
    parameters, frames = mechanism.parameter_values, guessed(mechanism)
    ratio = abs(float(np.asarray(resolve(gear.ratio, parameters))))
    points, axes = [], []
    for body, given in zip(gear.bodies[:2], (gear.axis_i, gear.axis_j), strict=True):
        axis = np.asarray(resolve(given, parameters), float)
        points.append(points_at(frames[body], _on_axis(mechanism, body, axis))[0])
        axes.append(frames[body][0, :, 1:] @ axis / np.linalg.norm(axis))
    if gear.point_m is not None:
        place = points_at(frames[gear.bodies[2]], np.asarray(resolve(gear.point_m, parameters), float))[0]
        centers = [point + (place - point) @ axis * axis for point, axis in zip(points, axes, strict=True)]
        radii = [float(np.linalg.norm(place - center)) for center in centers]
        return [within(frames[b], c[None])[0] for b, c in zip(gear.bodies, centers, strict=False)], radii
    offset, normal = points[1] - points[0], np.cross(*axes)
    sine = float(np.linalg.norm(normal))
    if sine < 1e-9:
        across = offset - (offset @ axes[0]) * axes[0]
        centers = [points[0], points[0] + across]
    else:  # the feet of the common perpendicular
        along = [np.linalg.det(np.stack([offset, axis, normal])) / sine**2 for axis in axes[::-1]]
        centers = [point + t * axis for point, t, axis in zip(points, along, axes, strict=True)]
    distance = float(np.linalg.norm(centers[1] - centers[0]))
    distances = [float((point - center) @ axis) for point, center, axis in zip(points, centers, axes, strict=True)]
    size = max(1e-300, *(float(np.max(np.abs(point))) for point in points))
    if distance > 1e-9 * size:
        thicknesses = np.maximum(np.array([ratio, 1.0]) / (1.0 + ratio), THINNEST)
        radii = (thicknesses / thicknesses.sum() * distance).tolist()
    else:
        lengths = [abs(distances[0]) * sine, abs(distances[1]) * sine / ratio]
        second = next((x for x in lengths if x > 1e-9 * size), 0.15 * size)
        radii = [ratio * second, second]
        for k, other in enumerate((second, ratio * second)):
            side = axes[k] if distances[k] >= 0 else -axes[k]
            centers[k] = centers[k] + side * other / (sine or 1.0)
    local_centers = [within(frames[b], c[None])[0] for b, c in zip(gear.bodies, centers, strict=False)]
    return local_centers, radii


def _on_axis(mechanism: Mechanism, body: str, axis: Center) -> Center:
    """Return a point of a body on one of its axes: that of a joint with this axis, or the origin."""
    for joint in mechanism.joints.values():
        for pair in facts_of(type(joint)).held_parallel:
            for owner, name, end in zip(joint.bodies, pair, "ij", strict=False):
                point = getattr(joint, f"point_{end}", None)
                if owner != body or point is None:
                    continue
                direction = np.asarray(resolve(getattr(joint, name), mechanism.parameter_values), float)
                if np.linalg.norm(np.cross(direction, axis)) <= 1e-9 * np.linalg.norm(direction) * np.linalg.norm(axis):
                    return np.asarray(resolve(point, mechanism.parameter_values), float)
    return np.zeros(3)
