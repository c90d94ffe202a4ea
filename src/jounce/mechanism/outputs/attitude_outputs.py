"""Attitudes as outputs: Euler parameters, rotation matrix and Euler angles, of a body or relative between two."""

from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.base.modules import field
from jounce.errors import MechanismError
from jounce.jet import Jet, concatenate, stack
from jounce.jet.turns import counted_on
from jounce.mechanism.outputs.base import AbstractOutput
from jounce.rigid import SpatialPose
from jounce.rigid.orientation import euler_angles
from jounce.rigid.rotations import SEQUENCES, check_sequence

LETTERS = ("x", "y", "z")
RATES = ("value", "rate", "second rate", "third rate", "fourth rate")
ENTRIES = tuple(row + column for row in LETTERS for column in LETTERS)


class EulerParametersOutput(AbstractOutput):
    """Euler parameters e0, e1, e2, e3 of a spatial body, from its frame to the global one, the scalar first.

    The sign of the quadruple is that of the starting guess, continued along the motion.
    """

    unit = "1"
    space = "spatial"
    labels = ("e0", "e1", "e2", "e3")
    axes = (("euler_parameter", labels),)
    rate_names = RATES

    def evaluate(self, *bodies: SpatialPose) -> Jet:
        *base, body = bodies
        if not base:
            return body.quaternion
        (base,) = base  # of conj(p_i) o p_j
        e0, e = base.relative_quaternion(body.quaternion)
        return concatenate([e0[None], e])


class RelativeEulerParametersOutput(EulerParametersOutput):
    """Euler parameters of ``A_i^T A_j``: from the frame of spatial body j to that of body i, the scalar first."""

    body_count = 2


class RotationMatrixOutput(AbstractOutput):
    """Rotation matrix A of a spatial body, from components in its frame to global ones, in rows."""

    unit = "1"
    space = "spatial"
    labels = ENTRIES
    axes = (("row_axis", LETTERS), ("column_axis", LETTERS))
    rate_names = RATES

    def evaluate(self, *bodies: SpatialPose) -> Jet:
        return stack([entry for row in _matrix(bodies) for entry in row])


class RelativeRotationMatrixOutput(RotationMatrixOutput):
    """Rotation matrix ``A_i^T A_j``, from components in the frame of spatial body j to those in the frame of body i."""

    body_count = 2


class EulerAnglesOutput(AbstractOutput):
    """Euler angles of a spatial body: three successive turns from the global frame to that of the body.

    A sequence in capitals ("ZXZ") turns about axes that move with the body (intrinsic), one in small letters ("zxz")
    about fixed axes (extrinsic). The angles are in the order of the letters, as in `jounce.rigid.rotation_matrix` and
    in SciPy. The second angle is in [0, pi] if the first and last letters are the same, else in [-pi/2, pi/2]. The
    others are continuous over turns along a motion, and within half a turn of zero at its start. Where the first and
    last axes are parallel, these angles are undefined, and have no derivatives.
    """

    sequence: str = field(static=True)

    unit = "rad"
    space = "spatial"
    choices = {"sequence": SEQUENCES}
    labels = ("alpha", "beta", "gamma")
    axes = (("euler_angle", labels),)
    wraps = (True, False, True)

    def __check_init__(self):
        check_sequence(self.sequence, MechanismError)

    def evaluate(self, *bodies: SpatialPose) -> Jet:
        return euler_angles(self.sequence, stack([stack(row) for row in _matrix(bodies)]))


class RelativeEulerAnglesOutput(EulerAnglesOutput):
    """Euler angles of ``A_i^T A_j``: three successive turns from the frame of spatial body i to that of body j."""

    body_count = 2


def _matrix(bodies: Any) -> list[list[Jet]]:
    """Return the entries of ``A_i^T A_j``, or of A_j for a single body."""
    *base, body = bodies
    if base:
        return [[side.dot(axis) for axis in body.axes] for side in base[0].axes]
    return [[axis[k] for axis in body.axes] for k in range(3)]


def continued(
    output: EulerAnglesOutput,
    angles: Float[np.ndarray, "3 time"],
    instants: Float[np.ndarray, " time"],
    samples: tuple[Float[np.ndarray, " place"], Float[np.ndarray, "3 place"]],
) -> Float[np.ndarray, "3 time"]:
    """Return angles made continuous along a motion, rad, (3, time).

    Parameters
    ----------
    output : EulerAnglesOutput
        Output of the angles.
    angles : array of shape (3, time)
        Angles up to whole turns; instants with angles that are not finite are ignored.
    instants : array of shape (time,)
        Instants of the angles, s.
    samples : tuple
        Instants in the order of the motion, (places,), and the angles there, up to whole turns, (3, places), close
        enough to each other that no turn is missed.
    """
    sample_times, sample_angles = samples
    all_angles = np.concatenate([sample_angles, angles], axis=1)
    times = np.concatenate([sample_times, instants])
    order = np.argsort(-times if sample_times.size > 1 and sample_times[-1] < sample_times[0] else times, kind="stable")
    order = order[np.isfinite(all_angles[:, order]).all(axis=0)]
    for k, wraps in enumerate(output.wraps):
        if wraps:
            all_angles[k, order] = counted_on(all_angles[k, order])
    return all_angles[:, sample_times.size :]


def euler_angles_of(sequence: str, attitudes: Float[np.ndarray, "4 place"]) -> Float[np.ndarray, "3 place"]:
    """Return the Euler angles of Euler parameters, rad."""
    if not attitudes.size:
        return np.zeros((3, 0))
    import warnings

    from scipy.spatial.transform import Rotation  # local, since the import of SciPy takes half a second

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # angles where two axes are parallel: the caller ignores them
        return Rotation.from_quat(attitudes.T, scalar_first=True).as_euler(sequence).T
