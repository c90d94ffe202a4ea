"""Mechanisms: named bodies, joints, drivers, outputs and parameters, and their numeric model."""

from jounce.mechanism.building.builder import Model as Model, build as build
from jounce.mechanism.laws.driver_outputs import (
    DriverAngleOutput as DriverAngleOutput,
    DriverDisplacementOutput as DriverDisplacementOutput,
)
from jounce.mechanism.laws.output_drivers import with_output_drivers as with_output_drivers
from jounce.mechanism.mechanism import Body as Body, Mechanism as Mechanism, check_mechanism as check_mechanism
from jounce.mechanism.outputs.attitude_outputs import (
    EulerAnglesOutput as EulerAnglesOutput,
    EulerParametersOutput as EulerParametersOutput,
    RelativeEulerAnglesOutput as RelativeEulerAnglesOutput,
    RelativeEulerParametersOutput as RelativeEulerParametersOutput,
    RelativeRotationMatrixOutput as RelativeRotationMatrixOutput,
    RotationMatrixOutput as RotationMatrixOutput,
)
from jounce.mechanism.outputs.base import (
    AbstractMotionOutput as AbstractMotionOutput,
    AbstractOutput as AbstractOutput,
    AbstractQuantity as AbstractQuantity,
    AngleOutput as AngleOutput,
    AngularVelocityOutput as AngularVelocityOutput,
    DistanceOutput as DistanceOutput,
    ParameterOutput as ParameterOutput,
    ParametersOutput as ParametersOutput,
    PlanarRelativeAngleOutput as PlanarRelativeAngleOutput,
    PointOutput as PointOutput,
    RelativeAngleOutput as RelativeAngleOutput,
)
from jounce.mechanism.outputs.derivative_outputs import DerivativeOutput as DerivativeOutput
from jounce.mechanism.outputs.linkage_outputs import (
    InstantCenterOutput as InstantCenterOutput,
    ProjectedAngleOutput as ProjectedAngleOutput,
    RollCenterOutput as RollCenterOutput,
    SpatialInstantCenterOutput as SpatialInstantCenterOutput,
    SymmetricRollCenterOutput as SymmetricRollCenterOutput,
)
from jounce.mechanism.time import TimeGrid as TimeGrid, time_grid as time_grid
from jounce.settings import compute_under_own_settings as _compute_under_own_settings

_compute_under_own_settings(__name__)
