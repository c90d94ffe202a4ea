"""Motion laws in time or along a coordinate: expressions, profiles, splines, pieces, measured samples."""

from jounce.trajectory import (
    AbstractMotion as AbstractMotion,
    Continuity as Continuity,
    CycloidalMotion as CycloidalMotion,
    Expression as Expression,
    ExpressionMotion as ExpressionMotion,
    FollowingMotion as FollowingMotion,
    FunctionMotion as FunctionMotion,
    HermiteMotion as HermiteMotion,
    IntegratedMotion as IntegratedMotion,
    MeasuredMotion as MeasuredMotion,
    OutputMotion as OutputMotion,
    PiecewiseMotion as PiecewiseMotion,
    PolynomialMotion as PolynomialMotion,
    RestToRestMotion as RestToRestMotion,
    Segment as Segment,
    SegmentedMotion as SegmentedMotion,
    SplineMotion as SplineMotion,
    TrapezoidalMotion as TrapezoidalMotion,
    continuity as continuity,
    motion_profile as motion_profile,
)
