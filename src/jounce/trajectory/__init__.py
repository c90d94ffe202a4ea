"""Motion laws: expressions, Python functions and splines through samples."""

from jounce.trajectory.expression import Expression as Expression
from jounce.trajectory.motion import (
    AbstractMotion as AbstractMotion,
    ExpressionMotion as ExpressionMotion,
    FunctionMotion as FunctionMotion,
    SplineMotion as SplineMotion,
)
