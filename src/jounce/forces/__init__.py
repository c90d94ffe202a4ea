"""Applied forces: springs, actuators and loads, each a displacement and a law on jets, and the base of users' own."""

from jounce.forces.actuators import (
    DistanceForce as DistanceForce,
    SlideForce as SlideForce,
    SpatialTorque as SpatialTorque,
    Torque as Torque,
)
from jounce.forces.base import (
    AbstractForce as AbstractForce,
    Law as Law,
    Laws as Laws,
    force_catalogue as force_catalogue,
)
from jounce.forces.laws import (
    AbstractLaw as AbstractLaw,
    ExpressionLaw as ExpressionLaw,
    FunctionLaw as FunctionLaw,
    TimeLaw as TimeLaw,
    VectorLaw as VectorLaw,
)
from jounce.forces.loads import (
    Moment as Moment,
    PointForce as PointForce,
    SpatialMoment as SpatialMoment,
    SpatialPointForce as SpatialPointForce,
)
from jounce.forces.springs import (
    SlideSpring as SlideSpring,
    SpatialTorsionalSpring as SpatialTorsionalSpring,
    Spring as Spring,
    TorsionalSpring as TorsionalSpring,
)
from jounce.settings import compute_under_own_settings as _compute_under_own_settings

_compute_under_own_settings(__name__)
