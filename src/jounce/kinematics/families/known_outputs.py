"""Outputs of a motion at the instants at which all of them exist."""

import copy
from typing import Any

import numpy as np

from jounce.errors import SolveError
from jounce.kinematics.results.motion import Motion


def with_outputs(motion: Motion) -> tuple[Motion, dict[str, Any]]:
    """Return all outputs of a motion, and it with the status of instants at which some of them do not exist."""
    try:
        return motion, dict(motion.outputs.items())
    except SolveError as error:
        if error.instants is None:
            raise
        failed = copy.copy(motion)
        failed.__dict__.pop("dataset", None)
        failed.derived, failed._known_outputs, failed.status = {}, {}, np.array(motion.status)
        failed.status[error.instants] = int(error.status)
        return failed, dict(failed.outputs.items())
