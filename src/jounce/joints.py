"""The catalogue of joints and drivers, and the base class of user-defined ones."""

import jounce.robot as _robot
from jounce.constraints import (
    AbstractConstraint as AbstractConstraint,
    Cam as Cam,
    Rope as Rope,
    Scalar as Scalar,
    Vector as Vector,
    drivers as drivers,
    planar as planar,
    rows as rows,
    spatial as spatial,
)
from jounce.constraints.friction import Friction as Friction, GearFriction as GearFriction
from jounce.trajectory import (
    ParametricCurve as ParametricCurve,
    SampledCurve as SampledCurve,
)

del _robot  # imported to reserve the type names of robot joints
