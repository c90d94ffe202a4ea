"""Factorization of the Jacobian of a mechanism: dense if small, multifrontal where that is less work.

Redundant constraints that agree give more rows than columns; such systems are solved by least squares.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Bool

from jounce.base.shapes import Numbers
from jounce.jet import Jet
from jounce.linear_algebra.frontal import FrontalFactor
from jounce.linear_algebra.least_squares import LeastSquaresFactor
from jounce.linear_algebra.linear import DenseFactor
from jounce.linear_algebra.reflections import ReflectedFactor
from jounce.mechanism.system import System
from jounce.rigid.pose import Pose

Factor = DenseFactor | ReflectedFactor | FrontalFactor | LeastSquaresFactor
STALE = 1e-9  # relative error of solutions that one refinement reduces to its square


def factored(system: System, pose: Pose, time: Jet) -> Factor:
    """Return the factored Jacobian at a pose of order zero."""
    if system.fronts is not None:
        return FrontalFactor.of(system.fronts, system.entries(pose, time), system.row_scale)
    matrix = system.jacobian(pose, time)
    if system.rank is not None:
        return LeastSquaresFactor.of(matrix)
    return ReflectedFactor.of(matrix, system.elimination_order) if system.reflected else DenseFactor.of(matrix)


def refactored(system: System, pose: Pose, time: Jet, old: Factor, forced: Bool[Numbers, ""]) -> Factor:
    """Return the factored Jacobian at a pose of order zero, given factors at a pose nearby.

    Unless `forced`, the given factors are kept with the new matrices, if refinement makes their solutions exact to
    rounding.
    """
    if not isinstance(old, DenseFactor | ReflectedFactor):
        return factored(system, pose, time)
    reused = old.refining(system.jacobian(pose, time))
    stale = jnp.any(~(reused.defect() <= STALE))
    return jax.lax.cond(forced | stale, reused.renewed, lambda: reused)


def blank_factor(system: System, lanes: int) -> Factor:
    """Return placeholder factors of a batch, to start a loop."""
    if system.fronts is not None:
        return FrontalFactor.blank(system.fronts, lanes)
    if system.rank is not None:
        return LeastSquaresFactor.blank(system.shape, lanes)
    if system.reflected:
        return ReflectedFactor.blank(system.elimination_order, lanes)
    return DenseFactor.blank(system.shape, lanes)
