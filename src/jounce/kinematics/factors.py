"""The factorisation of a mechanism's Jacobian: dense where it is small, front by front where that is less work."""

from jounce.jet import Jet
from jounce.kinematics.frontal import FrontalFactor
from jounce.kinematics.linear import DenseFactor
from jounce.mechanism.system import System
from jounce.rigid.pose import Pose

Factor = DenseFactor | FrontalFactor


def factored(system: System, pose: Pose, time: Jet) -> Factor:
    """Return the factored Jacobian at a pose of order zero."""
    if system.fronts is None:
        return DenseFactor.of(system.jacobian(pose, time))
    return FrontalFactor.of(system.fronts, system.entries(pose, time), system.row_scale)


def blank_factor(system: System, lanes: int) -> Factor:
    """Return a placeholder for the factors of a batch, to start a loop with."""
    if system.fronts is None:
        return DenseFactor.blank(system.shape, lanes)
    return FrontalFactor.blank(system.fronts, lanes)
