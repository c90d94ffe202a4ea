"""The forms of output in a mechanism file, each with its class: of motions, of forces and of energies."""

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
"""The word for ``quantity`` in a file (None when there is none) and the class of each output."""

HOLDERS = {
    "driver": "a driver",
    "joint": "a joint",
    "force": "a force",
    "bodies": "bodies",
    "body": "a body",
    "mechanism": "the mechanism",
    "of": "an output",
}
"""The keys that say what an output is of, and their words; the first that is there counts."""


def output_holder(kind: type[AbstractQuantity]) -> str:
    """Return the key that says what an output of a class is of, one of ``HOLDERS``."""
    return getattr(kind, "source", "body" if kind.body_count == 1 else "bodies")


def output_tag(quantity: object, holder: str) -> str:
    """Return the name of a form of output, by its quantity and the key that says what it is of."""
    return f"{quantity or 'point'} of {HOLDERS[holder]}"


def output_types(space: str) -> dict[str, tuple[str | None, type[AbstractQuantity]]]:
    """Return the forms of output that exist in a space, by tag: the word for ``quantity``, and the class."""
    return {
        output_tag(quantity, output_holder(kind)): (quantity, kind)
        for quantity, kind in OUTPUTS
        if kind.space in ("", space)
    }
