"""Contact forces of cams as outputs: signed, along the coordinate of the follower, with rates."""

from typing import Any

import numpy as np

from jounce.base.modules import field
from jounce.base.shapes import Numbers
from jounce.constraints import Cam
from jounce.dynamics.inverse.motion_forces import MotionForces
from jounce.dynamics.inverse.outputs.components import RATES, AbstractForceOutput
from jounce.dynamics.inverse.outputs.output_words import lift_off_words
from jounce.errors import MechanismError
from jounce.kinematics import Motion
from jounce.mechanism.laws.driver_outputs import is_turning


class _CamOutput(AbstractForceOutput):
    joint: str = field(static=True)

    source = "joint"

    def _check_named(self, element: Any) -> None:
        if not isinstance(element, Cam):
            message = "is not a cam, and only cams have a contact force; take its reaction"
            raise MechanismError(message, name="joint", value=self.joint)
        if is_turning(element.follower) != (self.unit == "N*m"):
            kind, quantity = ("turns", "contact_torque") if self.unit == "N" else ("slides", "contact")
            raise MechanismError(f"the follower of this cam {kind}; take its {quantity}", name="quantity")

    def coefficients(self, motion: Motion) -> Numbers:
        """Return the Taylor coefficients of the contact force or torque on the follower, (levels, 1, time)."""
        size = motion.model.length if self.unit == "N*m" else 1.0
        return MotionForces.of(motion).unique(lambda forces: forces.driver_force(self.joint), size)

    def remark(self, motion: Motion, values: np.ndarray) -> str:
        """Return the reason for NaN values, or the instants at which the follower lifts off."""
        return super().remark(motion, values) or lift_off_words(motion.time, values[:, 0])


class CamForceOutput(_CamOutput):
    """Force of a cam along the coordinate of its follower, N; positive if it increases the coordinate."""

    unit = "N"
    rate_names = ("force", *RATES)


class CamTorqueOutput(_CamOutput):
    """Torque of a cam along the angle of its follower, N m; positive if it increases the angle."""

    unit = "N*m"
    rate_names = ("torque", *RATES)
