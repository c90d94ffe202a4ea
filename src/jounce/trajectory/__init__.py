"""Motion laws: expressions, Python functions, splines, profiles; and trajectories, one law for each joint."""

from jounce.settings import compute_under_own_settings as _compute_under_own_settings
from jounce.trajectory.curves import ParametricCurve as ParametricCurve, SampledCurve as SampledCurve
from jounce.trajectory.joint_trajectory import JointTrajectory as JointTrajectory
from jounce.trajectory.law_checks.smoothness import (
    Continuity as Continuity,
    DerivativeJumps as DerivativeJumps,
    continuity as continuity,
)
from jounce.trajectory.laws.composed import (
    FollowingMotion as FollowingMotion,
    OutputMotion as OutputMotion,
)
from jounce.trajectory.laws.integrated import IntegratedMotion as IntegratedMotion
from jounce.trajectory.laws.piecewise import PiecewiseMotion as PiecewiseMotion
from jounce.trajectory.laws.polynomial import PolynomialMotion as PolynomialMotion
from jounce.trajectory.laws.profiles import (
    AbstractProfile as AbstractProfile,
    CycloidalMotion as CycloidalMotion,
    RestToRestMotion as RestToRestMotion,
    motion_profile as motion_profile,
)
from jounce.trajectory.laws.segment_pieces import Segment as Segment
from jounce.trajectory.laws.segments import SegmentedMotion as SegmentedMotion
from jounce.trajectory.laws.trapezoid import TrapezoidalMotion as TrapezoidalMotion
from jounce.trajectory.motion import (
    AbstractMotion as AbstractMotion,
    ExpressionMotion as ExpressionMotion,
    FunctionMotion as FunctionMotion,
    SplineMotion as SplineMotion,
)
from jounce.trajectory.sampled.hermite import HermiteMotion as HermiteMotion
from jounce.trajectory.sampled.hermite_spline import HermiteSplineMotion as HermiteSplineMotion
from jounce.trajectory.sampled.measured import MeasuredMotion as MeasuredMotion
from jounce.units.expression import Expression as Expression

_compute_under_own_settings(__name__)
