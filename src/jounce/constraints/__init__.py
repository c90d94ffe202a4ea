"""Joints and drivers: the catalogue of Sommer 2024, with one residual each, and the base of users' own."""

from jounce.constraints import drivers as drivers, planar as planar, spatial as spatial
from jounce.constraints.base import (
    AbstractConstraint as AbstractConstraint,
    MotionLaw as MotionLaw,
    Scalar as Scalar,
    Vector as Vector,
    catalogue as catalogue,
    rows as rows,
)
from jounce.constraints.cams import Cam as Cam
from jounce.constraints.ropes import Rope as Rope
from jounce.settings import compute_under_own_settings as _compute_under_own_settings

_compute_under_own_settings(__name__)
