"""The forms of outputs in a mechanism file, and their classes."""

from __future__ import annotations

import jounce.dynamics as dynamics
import jounce.mechanism as mechanism
from jounce.dynamics.energy.energy_outputs import ENERGY_OUTPUTS
from jounce.mechanism import AbstractQuantity
from jounce.robot.closed_loops.coupling import SlideOutput

OUTPUTS: tuple[tuple[str | None, type[AbstractQuantity]], ...] = (
    (None, mechanism.PointOutput),
    ("angle", mechanism.AngleOutput),
    ("angle", mechanism.PlanarRelativeAngleOutput),
    ("angle", mechanism.RelativeAngleOutput),
    ("angular_velocity", mechanism.AngularVelocityOutput),
    ("distance", mechanism.DistanceOutput),
    ("euler_parameters", mechanism.EulerParametersOutput),
    ("euler_parameters", mechanism.RelativeEulerParametersOutput),
    ("rotation_matrix", mechanism.RotationMatrixOutput),
    ("rotation_matrix", mechanism.RelativeRotationMatrixOutput),
    ("euler_angles", mechanism.EulerAnglesOutput),
    ("euler_angles", mechanism.RelativeEulerAnglesOutput),
    ("slide", SlideOutput),
    ("projected_angle", mechanism.ProjectedAngleOutput),
    ("instant_center", mechanism.InstantCenterOutput),
    ("instant_center", mechanism.SpatialInstantCenterOutput),
    ("roll_center", mechanism.RollCenterOutput),
    ("roll_center", mechanism.SymmetricRollCenterOutput),
    ("derivative", mechanism.DerivativeOutput),
    ("parameter", mechanism.ParameterOutput),
    ("parameters", mechanism.ParametersOutput),
    ("angle", mechanism.DriverAngleOutput),
    ("displacement", mechanism.DriverDisplacementOutput),
    ("force", dynamics.DriverForceOutput),
    ("torque", dynamics.DriverTorqueOutput),
    ("force", dynamics.JointForceOutput),
    ("reaction", dynamics.JointForceOutput),
    ("torque", dynamics.JointTorqueOutput),
    ("contact", dynamics.CamForceOutput),
    ("contact_torque", dynamics.CamTorqueOutput),
    ("reaction", dynamics.GroundForceOutput),
    ("torque", dynamics.GroundTorqueOutput),
    ("force", dynamics.AppliedForceOutput),
    ("torque", dynamics.AppliedTorqueOutput),
    *ENERGY_OUTPUTS,
)
"""The value of ``quantity`` in a file (None if it has none) and the class of each output."""

HOLDERS = {
    "driver": "a driver",
    "joint": "a joint",
    "force": "a force",
    "bodies": "bodies",
    "body": "a body",
    "mechanism": "the mechanism",
    "of": "an output",
}
"""Keys that state the source of an output, and their words; the first key present counts."""


def output_holder(kind: type[AbstractQuantity]) -> str:
    """Return the key that states the source of an output of a class, one of ``HOLDERS``."""
    return getattr(kind, "source", "body" if kind.body_count == 1 else "bodies")


def output_tag(quantity: object, holder: str) -> str:
    """Return the tag of a form of output, by its quantity and the key that states its source."""
    return f"{quantity or 'point'} of {HOLDERS[holder]}"


def output_types(space: str) -> dict[str, tuple[str | None, type[AbstractQuantity]]]:
    """Return the forms of outputs in a space, by tag: the value of ``quantity``, and the class."""
    return {
        output_tag(quantity, output_holder(kind)): (quantity, kind)
        for quantity, kind in OUTPUTS
        if kind.space in ("", space)
    }
