"""Angular velocity of any order from samples of the attitude: a spline of unit quaternions, evaluated on jets."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.shapes import ArrayLike, Numbers, Real, by_component, is_traced, real_numbers, seconds
from jounce.errors import JounceError, TrajectoryError
from jounce.jet import Jet, cross, dot, sqrt, stack, transpose
from jounce.jet.pieces import last_begun
from jounce.rigid.euler_parameters import from_rotation_matrices
from jounce.rigid.orientation import angular_velocity, check_rotation
from jounce.rigid.rotations import rotation_matrix

HIGHEST_DEGREE = 11
UNIT = 1e-6  # largest deviation of the length of a sampled quaternion from one: printed digits, single precision


class AttitudeSamples:
    """Attitude of a body interpolated through samples in time.

    A spline interpolates the unit quaternions of the samples, with their signs chosen so that neighbors are close. At
    any instant it is scaled to unit length as a jet, so that attitude and angular velocity are exact derivatives of the
    interpolated motion. The deviation from the true motion depends on the spacing of the samples: the error of the n-th
    derivative of the attitude falls as spacing^(degree + 1 - n).

    Parameters
    ----------
    times : array_like of shape (samples,)
        Strictly increasing instants, s.
    quaternions : array_like of shape (samples, 4)
        Unit quaternions (e0, e1, e2, e3), scalar first, from the body to the global frame; of either sign.
    degree : int, default 5
        Degree of the spline, from 2 to 11; derivatives of the attitude up to ``degree - 1`` are continuous. At least
        ``degree + 1`` samples are needed.

    Raises
    ------
    TrajectoryError
        If the samples are too few for the degree, not finite, not increasing in time, of unequal number, not of unit
        length, or so far apart that neighbors differ by half a turn, of unknown sense.

    Examples
    --------
    >>> import numpy as np
    >>> import jounce as jn
    >>> t = np.linspace(0.0, 1.0, 41)
    >>> angles = np.stack([0.5 * t**2, 0 * t, 0 * t], axis=1)
    >>> samples = jn.rigid.AttitudeSamples.from_euler_angles(t, angles, "ZYX")
    >>> found = samples.angular_velocity(jn.Jet.variable(0.5, order=3))
    >>> (abs(found.derivatives()[:, 2]) + 0).round(4).tolist()
    [0.5, 1.0, 0.0]
    """

    def __init__(self, times: ArrayLike, quaternions: ArrayLike, degree: int = 5):
        times, quaternions = _numbers(times, by_component("quaternions", quaternions, TrajectoryError), "quaternions")
        _check_times(times, quaternions, "quaternions", (4,), degree)
        length = np.linalg.norm(quaternions, axis=1)
        is_off = np.abs(length - 1) > UNIT
        if is_off.any():
            first = int(np.flatnonzero(is_off)[0])
            message = (
                f"a rotation needs a quaternion of unit length; that of sample {first} is of length {length[first]:.9g}"
            )
            raise TrajectoryError(message, name="quaternions", value=quaternions[first].tolist())
        quaternions = _continuous(times, quaternions / length[:, None])
        from scipy.interpolate import PPoly, make_interp_spline  # imported late, as importing SciPy takes half a second

        splines = [PPoly.from_spline(make_interp_spline(times, component, k=degree)) for component in quaternions.T]
        is_inner = np.diff(splines[0].x) > 0
        self.start, self.stop = float(times[0]), float(times[-1])
        self.degree = degree
        self._breakpoints = splines[0].x[:-1][is_inner]
        # (power, component, piece), lowest power first
        self._coefficients = np.stack([spline.c[::-1, is_inner] for spline in splines], axis=1)

    @classmethod
    def from_rotation_matrices(cls, times: ArrayLike, matrices: ArrayLike, degree: int = 5) -> "AttitudeSamples":
        """Return the interpolation of rotation matrices from the body to the global frame, (samples, 3, 3).

        Raises
        ------
        TrajectoryError
            As in the class, and if a matrix is not a rotation.
        """
        times, matrices = _numbers(times, by_component("matrices", matrices, TrajectoryError), "matrices")
        _check_times(times, matrices, "matrices", (3, 3), degree)
        try:
            check_rotation(np.moveaxis(matrices, 0, -1), "matrices")
        except JounceError as error:
            raise TrajectoryError(error.message, name=error.name, value=error.value) from None
        return cls(times, from_rotation_matrices(matrices), degree)

    @classmethod
    def from_euler_angles(
        cls, times: ArrayLike, angles: ArrayLike, sequence: str, degree: int = 5
    ) -> "AttitudeSamples":
        """Return the interpolation of Euler angles, (samples, 3) in rad, of one of `SEQUENCES`.

        Raises
        ------
        TrajectoryError
            As in the class.
        JounceError
            If the sequence is not known.
        """
        times, angles = _numbers(times, angles, "angles")
        _check_times(times, angles, "angles", (3,), degree)
        return cls(
            times, from_rotation_matrices(np.moveaxis(np.asarray(rotation_matrix(sequence, angles.T)), -1, 0)), degree
        )

    def quaternion(self, time: Float[Jet, "*batch"]) -> Float[Jet, "4 *batch"]:
        """Return the unit quaternion (e0, e1, e2, e3) at the instants of a time jet.

        Parameters
        ----------
        time : Jet of shape (...)
            Instants, s, between the first and the last sample, of an order below the degree.

        Returns
        -------
        Jet of shape (4, ...)
            Unit quaternion from the body to the global frame, of the order of `time`.

        Raises
        ------
        TrajectoryError
            If an instant is outside the samples, or the requested order is not below the degree.
        """
        instants = time.coefficients[0]
        if time.order >= self.degree:
            message = (
                f"a spline of degree {self.degree} has continuous derivatives up to order {self.degree - 1} only; "
                f"give degree={time.order + 1} or more (an angular velocity takes one order more of the attitude)"
            )
            raise TrajectoryError(message, name="order", value=time.order)
        self._check_range(instants)
        index = last_begun(self._breakpoints, instants)
        local = time - jnp.asarray(self._breakpoints)[index]
        powers = jnp.asarray(self._coefficients)[..., index]  # (power, component, ...)
        value = Jet.constant(powers[-1], time.order)
        for c in powers[-2::-1]:
            value = value * local + c
        return value / sqrt(dot(value, value))

    def attitude(self, time: Float[Jet, "*batch"]) -> Float[Jet, "3 3 *batch"]:
        """Return the rotation matrix at the instants of a time jet.

        Parameters
        ----------
        time : Jet of shape (...)
            Instants, s, between the first and the last sample, of an order below the degree.

        Returns
        -------
        Jet of shape (3, 3, ...)
            Rotation matrix from the body to the global frame, of the order of `time`.

        Raises
        ------
        TrajectoryError
            If an instant is outside the samples, or the requested order is not below the degree.
        """
        quaternion = self.quaternion(time)
        scalar, vector = quaternion[0], quaternion[1:]
        batch = (1,) * (len(quaternion.shape) - 1)

        def rotated(axis: Numbers) -> Jet:
            return 2.0 * cross(vector, cross(vector, axis) + scalar * axis) + axis

        return transpose(stack([rotated(jnp.reshape(axis, (3, *batch))) for axis in jnp.eye(3)]))

    def angular_velocity(self, time: Float[Jet, "*batch"], frame: str = "global") -> Float[Jet, "3 *batch"]:
        """Return the angular velocity and its derivatives at the instants of a time jet.

        Parameters
        ----------
        time : Jet of shape (...)
            Instants, s, between the first and the last sample: of order 1 for the angular velocity, 2 for the angular
            acceleration, too, and so on, below the degree.
        frame : {"global", "body"}, default "global"
            Frame of the components.

        Returns
        -------
        Jet of shape (3, ...)
            Angular velocity, rad/s, one order shorter than `time`.

        Raises
        ------
        TrajectoryError
            If an instant is outside the samples, or the requested order is not below the degree.
        """
        return angular_velocity(self.attitude(time), frame)

    def _check_range(self, instants: Real) -> None:
        if is_traced(instants):
            return
        is_outside = ~((np.asarray(instants) >= self.start) & (np.asarray(instants) <= self.stop))
        if is_outside.any():
            message = f"the samples reach from {self.start:g} to {self.stop:g} s; there is no attitude outside of them"
            raise TrajectoryError(message, name="time", value=float(np.asarray(instants)[is_outside].flat[0]))


def _numbers(times: ArrayLike, values: ArrayLike, name: str) -> tuple[np.ndarray, np.ndarray]:
    return seconds("times", times, TrajectoryError), real_numbers(name, values, TrajectoryError)


def _check_times(times: np.ndarray, samples: np.ndarray, name: str, shape: tuple[int, ...], degree: int) -> None:
    if times.ndim != 1 or samples.shape != (*times.shape, *shape):
        expected = ", ".join(map(str, ("samples", *shape)))
        message = f"samples need one entry for each time: times of shape (samples,) and {name} of shape ({expected})"
        raise TrajectoryError(message, name=name, value=f"shapes {times.shape} and {samples.shape}")
    for argument, values in (("times", times), (name, samples)):
        finite = np.isfinite(values).reshape(len(values), -1).all(axis=1)
        if not finite.all():
            first = int(np.flatnonzero(~finite)[0])
            message = f"samples must be finite numbers; sample {first} is not"
            raise TrajectoryError(message, name=argument, value=values[first].tolist())
    if (np.diff(times) <= 0).any():
        first = int(np.flatnonzero(np.diff(times) <= 0)[0])
        message = f"times of samples must increase; sample {first + 1} does not come after sample {first}"
        raise TrajectoryError(message, name="times", value=float(times[first + 1]))
    if isinstance(degree, bool) or not isinstance(degree, int) or not 2 <= degree <= HIGHEST_DEGREE:
        message = f"the degree of the spline must be a whole number from 2 to {HIGHEST_DEGREE}"
        raise TrajectoryError(message, name="degree", value=degree)
    if len(times) <= degree:
        raise TrajectoryError(
            f"a spline of degree {degree} needs at least {degree + 1} samples", name="times", value=len(times)
        )


def _continuous(
    times: Float[np.ndarray, " sample"], quaternions: Float[np.ndarray, "sample 4"]
) -> Float[np.ndarray, "sample 4"]:
    """Return quaternions with the signs that bring neighbors closest; both signs are the same rotation."""
    cosines = np.sum(quaternions[1:] * quaternions[:-1], axis=1)
    is_ambiguous = np.abs(cosines) < UNIT
    if is_ambiguous.any():
        first = int(np.flatnonzero(is_ambiguous)[0])
        message = (
            f"between samples {first} and {first + 1} the body makes half a turn, to one side or to the other; "
            "give samples closer in time"
        )
        raise TrajectoryError(message, name="times", value=times[first : first + 2].tolist())
    signs = np.concatenate([[1.0], np.cumprod(np.sign(cosines))])
    return quaternions * signs[:, None]
