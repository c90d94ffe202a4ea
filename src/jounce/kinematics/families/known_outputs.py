"""Outputs of a motion at the instants at which they all exist."""

from typing import Any

from jounce.errors import SolveError
from jounce.kinematics.results.motion import Motion
from jounce.kinematics.status import Status


def with_outputs(motion: Motion) -> tuple[Motion, dict[str, Any]]:
    """Return a motion with the status of instants at which forces do not exist, and all its outputs."""
    try:
        return motion, dict(motion.outputs.items())
    except SolveError as error:
        if error.status != Status.LOCKED or error.motion is None:
            raise
        return error.motion, dict(error.motion.outputs.items())
