"""Frames of bodies and positions of their points: in a motion, as assembled at the start, and at the starting guess.

A frame consists of the origin of a body, m, and its axes, in columns: (time, components, 1 + components).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.execution.mapped import Mapped
from jounce.jet import Jet
from jounce.jet.algebra import stacked
from jounce.kinematics import Motion
from jounce.kinematics.assembly.assemble import assemble
from jounce.kinematics.curves.choice import chosen
from jounce.mechanism import Mechanism, build, with_output_drivers
from jounce.mechanism.building.starting_guess import starting_guess
from jounce.mechanism.mechanism import GROUND
from jounce.mechanism.system import POSITION_COMPONENTS
from jounce.mechanism.time import first_instant
from jounce.rigid import PlanarPose, SpatialPose

ASSEMBLY_TOLERANCE = 1e-10  # rad, or sizes of the mechanism

Frame = Float[np.ndarray, "time components columns"]
"""Origin and axes of a body."""


def assembled(mechanism: Mechanism) -> dict[str, Frame]:
    """Return the frames of all bodies, the ground first, assembled near the starting guess at the first instant.

    The mechanism need not be fully driven; initial conditions count as drivers.

    Raises
    ------
    AssemblyError
        If the bodies cannot be assembled.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot.drawings.frames import assembled
    >>> assembled(jn.load("examples/four_bar.yaml"))["crank"][0, :, 1].round(6).tolist()  # x axis
    [0.866025, 0.5]
    """
    converted = with_output_drivers(mechanism)
    started = dataclasses.replace(converted, drivers={**converted.drivers, **converted.initial}, initial={})
    first = first_instant(mechanism.time, mechanism.parameter_values)
    model, coordinates = assemble(build(chosen(started, first)), first, ASSEMBLY_TOLERANCE, free=True)
    return _by_body(mechanism, _frames.along((), coordinates, pose_type=model.pose_type))


def guessed(mechanism: Mechanism) -> dict[str, Frame]:
    """Return the frames of all bodies, the ground first, at the starting guess.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot.drawings.frames import guessed
    >>> guessed(jn.load("examples/four_bar.yaml"))["rocker"][0, :, 0].round(6).tolist()  # origin
    [0.1321, 0.0]
    """
    guess = starting_guess(mechanism, mechanism.parameter_values, POSITION_COMPONENTS[mechanism.space])
    pose_type = PlanarPose if mechanism.space == "planar" else SpatialPose
    return _by_body(mechanism, _frames.along((), guess, pose_type=pose_type))


def frames(motion: Motion) -> dict[str, Frame]:
    """Return the frames of all bodies of a motion, the ground first; NaN at unsolved instants."""
    if "frames" not in motion.derived:
        pose_type, coordinates = motion.poses
        first = {name: derivatives[0] for name, derivatives in coordinates.items()}
        poses = _frames.along((), first, pose_type=pose_type)
        motion.derived["frames"] = np.where(np.asarray(motion.status) == 0, poses, np.nan)
    return _by_body(motion.mechanism, motion.derived["frames"])


def _by_body(mechanism: Mechanism, poses: Any) -> dict[str, Frame]:
    by_time, names = np.moveaxis(np.asarray(poses), -1, 0), (GROUND, *mechanism.rigid_bodies)
    return {body: by_time[..., k] for k, body in enumerate(names)}


@Mapped
def _frames(_: tuple[()], coordinates: Mapping[str, Any], *, pose_type: Any) -> Any:
    """Return the origins and axes of all bodies, shape (components, 1 + components, bodies, time)."""
    pose = pose_type.from_coordinates({name: Jet((value,)) for name, value in coordinates.items()})
    columns = [pose.position, *(pose.direction(unit) for unit in np.eye(pose_type.shifts))]
    return jnp.stack([stacked(column)[0] for column in columns], axis=1)


def points_at(
    frame: Frame, points: Float[np.ndarray, "*points components"]
) -> Float[np.ndarray, "time *points components"]:
    """Return points of a body in the global frame."""
    rotated = np.einsum("tck,...k->t...c", frame[:, :, 1:], points)
    return rotated + frame[:, :, 0].reshape(len(frame), *[1] * (points.ndim - 1), -1)


def within(frame: Frame, points: Float[np.ndarray, "time components"]) -> Float[np.ndarray, "time components"]:
    """Return global points in the frame of a body."""
    return np.einsum("tkc,tk->tc", frame[:, :, 1:], points - frame[:, :, 0])


def frame_along(axis: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """Return three orthogonal unit vectors, in rows, the first one along an axis of any length.

    Examples
    --------
    >>> frame_along(np.array([0.0, 0.0, 2.0])).tolist()
    [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]
    """
    first = axis / np.linalg.norm(axis)
    second = np.cross(first, np.eye(3)[np.argmin(np.abs(first))])
    second /= np.linalg.norm(second)
    return np.stack([first, second, np.cross(first, second)])
