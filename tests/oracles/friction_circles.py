"""A four-bar with friction by friction circles: judge of friction where bodies have no weight.

The coupler bears two forces alone, so that they act along one line, a tangent of the friction circles of its pins; the
force of the ground on crank and rocker passes their pins at the radius of the circles there, mu r.
"""

import itertools

import numpy as np

CRANK, COUPLER, ROCKER, GROUND = 0.1, 0.32, 0.25, 0.3  # m
CIRCLES = {"A": 0.004, "B": 0.003, "C": 0.005, "D": 0.002}  # m, radii of the friction circles


def torques(angle: float, moment: float) -> np.ndarray:
    """Return the torques on the crank that balance a moment on the rocker, for each tangent on each side."""
    b = CRANK * np.array([np.cos(angle), np.sin(angle)])
    away = np.array([GROUND, 0.0]) - b
    distance = np.hypot(*away)
    inner = np.arccos((distance**2 + ROCKER**2 - COUPLER**2) / (2 * distance * ROCKER))
    direction = np.arctan2(-away[1], -away[0]) - inner  # of the rocker
    c = np.array([GROUND, 0.0]) + ROCKER * np.array([np.cos(direction), np.sin(direction)])
    span, found = np.hypot(*(c - b)), []
    for at_a, at_b, at_c, at_d in itertools.product((1, -1), repeat=4):
        # the line passes B at the distance p and C at q, on the sides that the signs tell
        p, q = at_b * CIRCLES["B"], at_c * CIRCLES["C"]
        line = np.arctan2(*(c - b)[::-1]) - np.arcsin((q - p) / span)
        along, normal = np.array([np.cos(line), np.sin(line)]), np.array([-np.sin(line), np.cos(line)])
        on_line = b - p * normal
        arm_a = on_line[0] * along[1] - on_line[1] * along[0]
        arm_d = (on_line[0] - GROUND) * along[1] - on_line[1] * along[0]
        force = moment / (arm_d + at_d * CIRCLES["D"])  # of the rocker on the coupler, along the line
        found.append(-force * (arm_a + at_a * CIRCLES["A"]))
    return np.array(found)
