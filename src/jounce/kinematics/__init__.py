"""Kinematics: assembly, positions, all derivatives from one factorization, diagnosis, and the result."""

from jounce.base.moved_names import renamed as _renamed
from jounce.kinematics.assembly.mobility import Branch as Branch, Mobility as Mobility, mobility as mobility
from jounce.kinematics.cams import (
    Extreme as Extreme,
    OscillatingFollower as OscillatingFollower,
    PlateCam as PlateCam,
    TranslatingFollower as TranslatingFollower,
    Undercut as Undercut,
    plate_cam as plate_cam,
)
from jounce.kinematics.curves.assembly_modes import (
    Assemblies as Assemblies,
    Assembly as Assembly,
    assemblies as assemblies,
)
from jounce.kinematics.curves.branches import trace as trace
from jounce.kinematics.curves.crossings import ChangePoint as ChangePoint
from jounce.kinematics.curves.curve import Curve as Curve
from jounce.kinematics.curves.limits import CurveBranch as CurveBranch, LimitPosition as LimitPosition
from jounce.kinematics.families.solve_batch import solve_batch as solve_batch
from jounce.kinematics.position_analysis.chunked_motion import (
    ChunkedMotion as ChunkedMotion,
    needs_chunks as needs_chunks,
)
from jounce.kinematics.position_analysis.solve import (
    raise_for_status as raise_for_status,
    solve as solve,
    solve_in_chunks as solve_in_chunks,
)
from jounce.kinematics.results.motion import Motion as Motion
from jounce.kinematics.status import Status as Status
from jounce.settings import compute_under_own_settings as _compute_under_own_settings

_compute_under_own_settings(__name__)

__getattr__ = _renamed(__name__, {"Stretches": "ChunkedMotion", "solve_in_stretches": "solve_in_chunks"})
