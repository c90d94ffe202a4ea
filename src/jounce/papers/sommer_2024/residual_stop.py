"""The probable stopping rule of figures 4, 6, 10 and 12 of the paper: the largest residual, lengths in centimeters.

The paper does not say what its assembly tolerance bounds. With a plain Newton-Raphson iteration that stops as soon as
the largest residual of all constraints is within the tolerance, errors stop falling at the tolerances of the paper, if
lengths are in cm, the unit of the paper. Each instant starts from the position at the preceding instant.
"""

import dataclasses
import tempfile
from importlib.resources import as_file
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.dynamics.motion_values import Coordinates, cut, pose_of
from jounce.execution.compilation import compiled
from jounce.io import load
from jounce.jet import Jet
from jounce.jet.algebra import stacked
from jounce.jet.derivatives import plain_derivatives
from jounce.kinematics import Motion, solve
from jounce.kinematics.continuation.jacobian_factors import factored
from jounce.mechanism import Mechanism
from jounce.mechanism.system import System
from jounce.papers.sommer_2024.cases import MECHANISMS, QUANTITIES, ValidationCase, nominal_time, normalized_rmse
from jounce.rigid.pose import Pose

MOST = 10  # limit on corrections; rounding keeps residuals above the smallest tolerances

Lanes = Float[Numbers, " time"]


class ResidualStop:
    """A simulation of the paper with positions only as accurate as a largest residual.

    Parameters
    ----------
    case : ValidationCase
        The simulation.
    """

    def __init__(self, case: ValidationCase):
        mechanism, self.time = in_centimeters(case), nominal_time()
        motion = solve(mechanism, self.time, order=0)
        self.pose_type, exact = motion.poses
        before = np.maximum(np.arange(len(self.time)) - 1, 0)
        self.start = {name: np.asarray(values)[..., before] for name, values in cut(exact, 0).items()}
        self.system = _plain(motion)
        names = [name for group in motion.model.outputs for name in group]
        sizes = [group.instances for group in motion.model.system.outputs]
        group = int(np.searchsorted(np.cumsum(sizes), names.index(case.output), side="right"))
        self.output = group, names.index(case.output) - sum(sizes[:group])
        self.right = case.explicit(mechanism, self.time)

    def error(self, tolerance: float) -> Float[np.ndarray, "4"]:
        """Return the normalized RMSE of velocity to jounce, with the largest residual within a tolerance.

        Parameters
        ----------
        tolerance : float
            Largest residual in the units of the paper: cm, cm^2, rad and products of unit vectors.
        """
        computed = self.angle(tolerance)
        return normalized_rmse(computed, self.right)[1:]

    def angle(self, tolerance: float) -> Float[np.ndarray, "time 5"]:
        """Return the output angle and its derivatives to jounce, rad by s."""
        positions = self.start
        for _ in range(MOST):
            size, corrected = _corrected(self.system, positions, self.time, self.pose_type)
            is_moving = np.asarray(size) > tolerance
            if not is_moving.any():
                break
            pairs = ((name, values, corrected[name]) for name, values in positions.items())
            positions = {name: np.where(is_moving, np.asarray(moved), values) for name, values, moved in pairs}
        series = _outputs(self.system, positions, self.time, self.pose_type, self.output[0])
        return np.asarray(plain_derivatives(np.asarray(series)[:, 0, self.output[1]])).T


def in_centimeters(case: ValidationCase) -> Mechanism:
    """Return the mechanism of a simulation with the numbers of its lengths in cm."""
    with as_file(MECHANISMS / f"{case.name}.yaml") as path:
        text = path.read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"{case.name}.yaml"
        file.write_text(text.replace(" cm", " m"), encoding="utf-8")
        return load(file)


def _plain(motion: Motion) -> System:
    """Return the system of a motion with residuals and coordinates without scaling."""
    system, count = motion.model.system, motion.poses[0].shifts + motion.poses[0].turns
    ones = np.ones((system.shape[0], 1)), np.ones(count)
    return dataclasses.replace(system, forces=(), fronts=None, row_scale=ones[0], column_scale=ones[1])


@compiled("pose_type")
def _corrected(system: System, bodies: Coordinates, instants: Lanes, pose_type: type[Pose]) -> tuple[Any, Any]:
    """Return the largest residual, and the positions after one correction."""
    pose, time = pose_of(bodies, pose_type, 0), Jet([instants[None]])
    residual = system.residual(pose, time).coefficients[0]
    solution = factored(system, pose, time).solve(-residual)
    displaced = pose.displaced(*system.coordinates(solution, pose.shifts))
    return jnp.max(jnp.abs(residual), axis=0), {name: stacked(jet) for name, jet in displaced.coordinates().items()}


@compiled("pose_type", "group")
def _outputs(system: System, bodies: Coordinates, instants: Lanes, pose_type: type[Pose], group: int) -> Any:
    """Return the outputs of a group from the derivatives at the given positions."""
    pose: Any = pose_of(bodies, pose_type, 0)
    time = Jet.variable(instants[None], len(QUANTITIES))
    factor = factored(system, pose, time.truncate(0))
    for order in range(1, len(QUANTITIES) + 1):
        residual = system.residual(pose.extended(None, None), time.truncate(order)).dense().coefficients[order]
        pose = pose.extended(*system.coordinates(factor.solve(-residual), pose.shifts))
    return stacked(system.outputs[group].evaluate(pose))
