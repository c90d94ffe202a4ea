"""Curves of configurations: the positions of a mechanism with one driver free, through dead and change points."""

from jounce.kinematics.curves.assembly_modes import (
    Assemblies as Assemblies,
    Assembly as Assembly,
    assemblies as assemblies,
)
from jounce.kinematics.curves.branches import trace as trace
from jounce.kinematics.curves.crossings import ChangePoint as ChangePoint
from jounce.kinematics.curves.curve import Curve as Curve, CurveBranch as CurveBranch
from jounce.kinematics.curves.limits import LimitPosition as LimitPosition
