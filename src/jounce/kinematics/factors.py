"""The factorisation of a mechanism's Jacobian: dense where it is small, front by front where that is less work.

With redundant constraints, which agree, it has more rows than columns, and its equations are solved in least squares.
"""

from jounce.jet import Jet
from jounce.kinematics.frontal import FrontalFactor
from jounce.kinematics.least_squares import LeastSquaresFactor
from jounce.kinematics.linear import DenseFactor
from jounce.mechanism.system import System
from jounce.rigid.pose import Pose

Factor = DenseFactor | FrontalFactor | LeastSquaresFactor


def factored(system: System, pose: Pose, time: Jet) -> Factor:
    """Return the factored Jacobian at a pose of order zero."""
    if system.fronts is None:
        return _dense(system).of(system.jacobian(pose, time))
    return FrontalFactor.of(system.fronts, system.entries(pose, time), system.row_scale)


def blank_factor(system: System, lanes: int) -> Factor:
    """Return a placeholder for the factors of a batch, to start a loop with."""
    if system.fronts is None:
        return _dense(system).blank(system.shape, lanes)
    return FrontalFactor.blank(system.fronts, lanes)


def _dense(system: System) -> type[DenseFactor] | type[LeastSquaresFactor]:
    return DenseFactor if system.rank is None else LeastSquaresFactor
