"""Outputs that are forces, asked for while bodies rest: for the programs that they need of any motion."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from jounce.kinematics.results.actuation import actuated
from jounce.kinematics.results.motion import Motion
from jounce.mechanism import AbstractMotionOutput, Mechanism, Model
from jounce.mechanism.axis_angles import AttitudeHistory
from jounce.mechanism.time import Instants

FEW = 2  # instants: forces are computed for many at a time, however few there are


def ask_forces_at_rest(
    mechanism: Mechanism, model: Model, pose: Mapping[str, Any], instants: Instants, order: int, levels: int
) -> None:
    """Compute the outputs of a mechanism that are forces, with its bodies at rest, and drop what is found.

    Parameters
    ----------
    mechanism : Mechanism
        Drivers that follow from its outputs are found first, as of any motion.
    model : Model
        Of its bodies, with outputs that such drivers follow from held.
    pose : mapping of str to array
        Coordinates of all bodies at one instant, the ground first, with a last axis of length one.
    instants : array of shape (time,)
        s; a few of them are enough.
    order : int
        Highest derivative of the outputs.
    levels : int
        How many Taylor coefficients the motion has.
    """
    outputs = [x for x in mechanism.outputs.values() if isinstance(x, AbstractMotionOutput) and x.of_forces]
    if not outputs:
        return
    times = np.asarray(instants[:FEW])
    coordinates = {name: np.zeros((levels, *part.shape[:-1], len(times))) for name, part in pose.items()}
    for name, part in pose.items():
        coordinates[name][0] = part
    history = None
    if "quaternion" in pose:
        coordinates["angular_velocity"] = np.zeros_like(coordinates["position"][1:])
        history = AttitudeHistory(coordinates["quaternion"][0, ..., :1], np.zeros(1))
    groups = tuple(np.zeros((levels, 1, group.instances, len(times))) for group in model.system.outputs)
    status = np.zeros(len(times), int)
    motion = actuated(Motion(mechanism, model, times, order, (coordinates, groups), status, {}, history=history))
    for output in outputs:
        output.coefficients(motion)
