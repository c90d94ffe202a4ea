"""Trajectories: a motion law for each named joint of a robot, evaluated together to any order."""

import warnings
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.base.display import Displayed
from jounce.base.shapes import Array, ArrayLike, seconds
from jounce.errors import JounceError, MechanismError, SampleWarning, TrajectoryError, check_name
from jounce.jet import Jet
from jounce.trajectory.beyond import check_within
from jounce.trajectory.checks import (
    check_samples,
    finite,
    finite_numbers,
    finite_row,
    names_of_joints,
    positive,
    whole_number,
)
from jounce.trajectory.labels import JointValues, in_order
from jounce.trajectory.laws.profiles import motion_profile
from jounce.trajectory.laws.stacking import evaluate_laws, law_derivatives
from jounce.trajectory.laws.trapezoid import LIMITS
from jounce.trajectory.laws.user_laws import given_law
from jounce.trajectory.motion import SplineMotion
from jounce.trajectory.sample_errors import TOLERANCE, unsupported_derivative, unsupported_words, warn_of_gap
from jounce.trajectory.sampled.deferred import Laws, SampledLaw, law_through
from jounce.trajectory.splines import check_odd
from jounce.units.instants import interval_text

MAX_ORDER = 30


class JointTrajectory(Displayed):
    """Laws of named joints from a start to a stop, evaluated together with their derivatives of any order.

    Parameters
    ----------
    laws : dict of str to AbstractMotion, str, callable or number
        The law of each joint, m or rad: a motion, an expression of ``t``, a function of time, or a constant.
    start, stop : float
        First and last instant, s.
    times : array_like of shape (samples,), optional
        Sampling instants of the trajectory; 201 evenly spaced ones by default.
    measures : dict of str to {"angle", "length"}, optional
        Kinds of the coordinates, if known, as from the units of a file; a robot with other joints is refused.

    Raises
    ------
    TrajectoryError
        If there is no joint, a law is invalid or ends within the trajectory, `stop` does not come after `start`, or the
        times do not increase or leave the trajectory.

    Examples
    --------
    >>> import jounce as jn
    >>> trajectory = jn.JointTrajectory({"shoulder": "0.3*sin(2*t)", "elbow": "0.5*t**2"}, start=0.0, stop=2.0)
    >>> trajectory.derivatives([0.0, 1.0], order=2).shape
    (2, 3, 2)
    >>> trajectory.derivatives([1.0], order=3, names=["elbow"])[0, :, 0].tolist()
    [0.5, 1.0, 1.0, 0.0]
    """

    def __init__(
        self,
        laws: Mapping[str, object],
        start: float,
        stop: float,
        times: ArrayLike | None = None,
        measures: Mapping[str, str] | None = None,
    ):
        if not isinstance(laws, Mapping) or not laws:
            raise TrajectoryError("a trajectory needs a law for at least one joint", name="laws", value=laws)
        user_laws = laws.given() if isinstance(laws, Laws) else laws
        self.laws = Laws({name: given_law(name, x) for name, x in user_laws.items()})
        self.start, self.stop = finite_numbers("start and stop", (start, stop), (2,), read=seconds).tolist()
        if self.stop <= self.start:
            raise TrajectoryError(f"must come after the start, {self.start:g} s", name="stop", value=self.stop)
        for name, law in self.laws.given().items():
            try:
                if isinstance(law, SampledLaw):
                    check_within(self.start, self.stop, float(law.times[0]), float(law.times[-1]), "samples")
                else:
                    law.check_instants(self.start, self.stop)
            except JounceError as error:
                raise TrajectoryError(error.message, name=f"laws.{name}", value=error.value) from None
        instants = np.linspace(self.start, self.stop, 201)
        if times is not None:
            instants = check_samples(times, seconds("times", times, TrajectoryError))[0]
        self.times = self._inside(instants)
        self.measures = MappingProxyType(dict(measures or {}))

    def part(self, names: Sequence[str]) -> "JointTrajectory":
        """Return the trajectory of some of the joints.

        Parameters
        ----------
        names : sequence of str
            Names of the joints.

        Examples
        --------
        >>> import jounce as jn
        >>> jn.JointTrajectory({"a": "t", "b": "t**2"}, 0.0, 1.0).part(["b"]).names
        ('b',)
        """
        user_laws = self.laws.given()
        laws = {name: user_laws[name] for name in names}
        measures = {name: measure for name, measure in self.measures.items() if name in laws}
        return JointTrajectory(laws, self.start, self.stop, self.times, measures)

    @classmethod
    def from_samples(
        cls, times: ArrayLike, positions: ArrayLike, names: Sequence[str], degree: int = 5
    ) -> "JointTrajectory":
        """Return the trajectory of splines through samples of positions.

        Parameters
        ----------
        times : array_like of shape (samples,)
            Strictly increasing instants, s.
        positions : array_like of shape (samples, joints)
            Positions, m or rad.
        names : sequence of str
            Names of the joints, in the order of the columns.
        degree : int, default 5
            Degree of the splines, odd from 3 to 11; derivatives to ``degree - 1`` are continuous.

        Returns
        -------
        JointTrajectory
            Trajectory whose `times` are those of the samples.

        Raises
        ------
        TrajectoryError
            If the samples are too few for the degree, not finite, not increasing in time, or of the wrong shape.

        Warns
        -----
        RecordingWarning
            If a step between samples is more than twenty usual ones, which `estimate_error` cannot account for.

        Examples
        --------
        >>> import numpy as np
        >>> import jounce as jn
        >>> t = np.linspace(0.0, 2.0, 201)
        >>> trajectory = jn.JointTrajectory.from_samples(t, np.stack([np.sin(t), t**3], axis=1), ["a", "b"])
        >>> trajectory.derivatives([1.0], order=3)[0, :, 1].round(6).tolist()
        [1.0, 3.0, 6.0, 6.0]
        """
        names = names_of_joints(names)
        check_odd(degree)
        times, positions = check_samples(times, in_order("positions", positions, names, TrajectoryError))
        if positions.ndim != 2 or positions.shape[1] != len(names):
            message = f"positions of {len(names)} joints have the shape (samples, {len(names)})"
            raise TrajectoryError(message, name="positions", value=f"shape {positions.shape}")
        try:
            laws = {name: law_through(times, column, degree) for name, column in zip(names, positions.T, strict=True)}
        except MechanismError as error:
            raise TrajectoryError(error.message, name=error.name, value=error.value) from None
        warn_of_gap(times)
        return cls(laws, times[0], times[-1], times)

    @classmethod
    def point_to_point(
        cls,
        names: Sequence[str],
        start: ArrayLike,
        end: ArrayLike,
        profile: str = "minimum_jerk",
        duration: float | None = None,
        start_time: float = 0.0,
        limits: ArrayLike | None = None,
    ) -> "JointTrajectory":
        """Return the trajectory from one position to another in which all joints start and stop together.

        Parameters
        ----------
        names : sequence of str
            Names of the joints.
        start, end : array_like of shape (joints,)
            Initial and final positions, m or rad.
        profile : str, default "minimum_jerk"
            cycloidal, polynomial_3_4_5 (or minimum_jerk), polynomial_4_5_6_7 (or minimum_snap), trapezoidal.
        duration : float, optional
            Duration of the motion, s; by default the shortest within the limits.
        start_time : float, default 0
            Initial instant, s.
        limits : array_like of shape (3,) or (3, joints), optional
            Largest velocity, acceleration and jerk.

        Returns
        -------
        JointTrajectory
            Trajectory from the beginning to the end of the motion.

        Raises
        ------
        TrajectoryError
            As for the class, and if neither a duration nor limits are given, or the limits do not allow the duration.

        Examples
        --------
        >>> import jounce as jn
        >>> trajectory = jn.JointTrajectory.point_to_point(["a", "b"], [0.0, 1.0], [1.0, 0.5], duration=2.0)
        >>> trajectory.derivatives([1.0], order=1)[0].tolist()
        [[0.5, 0.75], [0.9375, -0.46875]]
        """
        names = names_of_joints(names)
        begins, ends = (
            finite_numbers(key, in_order(key, x, names, TrajectoryError), (len(names),))
            for key, x in (("start", start), ("end", end))
        )
        bounds = [None] * len(names) if limits is None else _limits(limits, names)
        start_time = finite("start_time", start_time, seconds)
        duration = None if duration is None else positive("duration", duration, seconds)

        def law(k: int, time: float | None) -> Any:
            try:
                return motion_profile(profile, begins[k], ends[k], time, start_time, bounds[k])
            except TrajectoryError as error:
                raise error.located(name=names[k]) from None

        if duration is None:
            moving_joints = np.flatnonzero(begins != ends).tolist()
            if limits is None:
                raise TrajectoryError("either limits or a duration are needed", name="duration", value=duration)
            if not moving_joints:
                raise TrajectoryError("the start is the end; give a duration", name="duration", value=duration)
            duration = max(float(law(k, None).duration) for k in moving_joints)
        return cls({name: law(k, duration) for k, name in enumerate(names)}, start_time, start_time + duration)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(self.laws)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.laws.given(), self.start, self.stop, self.times, dict(self.measures))

    def __repr__(self) -> str:
        return f"JointTrajectory({', '.join(self.names)}; {interval_text(self.start, self.stop)})"

    def __call__(self, time: Jet, names: Iterable[str] | None = None) -> Jet:
        """Return the jet of the positions, joints first; it can be traced, and instants are not checked.

        Parameters
        ----------
        time : Jet
            The time, s, with batch axes of any shape.
        names : iterable of str, optional
            The joints, in this order; all joints by default.

        Returns
        -------
        Jet of shape (joints, ...)
            Positions, m or rad.
        """
        return evaluate_laws([self.laws[name] for name in self._chosen(names)], time)

    def derivatives(
        self, times: ArrayLike, order: int, names: Iterable[str] | None = None
    ) -> Array[np.ndarray, "time derivative joint"]:
        """Return the positions and their derivatives at instants.

        Parameters
        ----------
        times : array_like of shape (time,)
            Instants within the trajectory, s, in any order.
        order : int
            Highest derivative.
        names : iterable of str, optional
            The joints, in this order; all joints by default.

        Returns
        -------
        ndarray of shape (time, order + 1, joints)
            Plain derivatives, m or rad per s to the power of their order. Functions of robots assign them by joint.

        Raises
        ------
        TrajectoryError
            If there is no such joint, an instant is outside the trajectory, or a law is undefined or not smooth at it.

        Warns
        -----
        SampleWarning
            If the trajectory comes from samples and the estimated error of a derivative exceeds a tenth of its peak.
        """
        chosen = self._chosen(names)
        order = whole_number("order", order, 0, MAX_ORDER)
        instants = self._inside(finite_row("times", times, seconds))
        self._warn(order, chosen)
        derivatives = law_derivatives([self.laws[name] for name in chosen], instants, order)
        result = JointValues.of(chosen, np.moveaxis(derivatives, -1, 0))
        if len(failures := np.argwhere(~np.isfinite(result))):
            sample, derivative, joint = failures[0]
            phrase = f"at {instants[sample]:.9g} s: derivative {derivative} is no number"
            raise TrajectoryError(f"the law is not defined or not smooth {phrase}", name=f"laws.{chosen[joint]}")
        return result

    def estimate_error(self, order: int, names: Iterable[str] | None = None) -> Array[np.ndarray, "derivative joint"]:
        """Return estimated relative errors of the derivatives of joints that come from samples.

        The error of interpolation is estimated from splines through every second sample. Three standard deviations of
        the noise of the samples (including rounding and quantization), as amplified by the splines, are added. The
        estimate is conservative: 1 to 10 times the true error for the degrees 3 and 5, up to 30 times for 7, measured
        on sines and Gaussians. For smoothed samples, errors above the jerk are unknown.

        Parameters
        ----------
        order : int
            Highest derivative.
        names : iterable of str, optional
            The joints, in this order; all joints by default.

        Returns
        -------
        ndarray of shape (order + 1, joints)
            Errors relative to the peaks. 1 is as large as the derivative itself, or unknown; 0 for a law not from
            samples.

        Examples
        --------
        >>> import numpy as np
        >>> import jounce as jn
        >>> t = np.linspace(0.0, 2.0, 41)
        >>> trajectory = jn.JointTrajectory.from_samples(t, np.sin(5 * t)[:, None], ["a"])
        >>> bool(trajectory.estimate_error(2)[2, 0] < 0.01 < trajectory.estimate_error(5)[5, 0])
        True
        """
        chosen = self._chosen(names)
        errors = np.zeros((order + 1, len(chosen)))
        for column, name in enumerate(chosen):
            law = self.laws[name]
            if isinstance(law, SplineMotion):
                law_errors = law.errors[: order + 1]
                errors[:, column] = 1.0 if law_errors.any() else 0.0  # nothing is known above the degree
                errors[: len(law_errors), column] = law_errors
        return errors

    def supported_order(self, tolerance: float = TOLERANCE, names: Iterable[str] | None = None) -> int:
        """Return the highest order up to which every estimated error is within a tolerance.

        Parameters
        ----------
        tolerance : float, default 0.1
            Largest error relative to the peak of the derivative.
        names : iterable of str, optional
            The joints; all joints by default.

        Returns
        -------
        int
            -1 if not even the positions are within the tolerance; 30, the highest order, for laws not from samples.
        """
        supported = (self.estimate_error(MAX_ORDER, names) <= tolerance).all(axis=1)
        return MAX_ORDER if supported.all() else int(np.argmin(supported)) - 1

    def _warn(self, order: int, names: Sequence[str]) -> None:
        phrases = []
        for name in names:
            law = self.laws[name]
            if isinstance(law, SplineMotion) and (doubt := unsupported_derivative(law.errors, order)):
                phrases.append((doubt[0], -doubt[1], name))
        if phrases:
            derivative, error, name = min(phrases)
            message = unsupported_words(name, derivative, -error, self.laws[name], " by jn.smooth or jounce smooth")
            warnings.warn(SampleWarning(message), stacklevel=3)

    def _chosen(self, names: Iterable[str] | None) -> tuple[str, ...]:
        chosen = self.names if names is None else names_of_joints(names)
        for name in chosen:
            check_name("joint of the trajectory", name, self.laws, TrajectoryError, name="names")
        return chosen

    def _inside(self, times: Float[np.ndarray, " time"]) -> Float[np.ndarray, " time"]:
        """Return the instants, clipped to the trajectory; raise TrajectoryError for those outside it."""
        slack = 1e-9 * (self.stop - self.start)
        is_outside = (times < self.start - slack) | (times > self.stop + slack)
        if is_outside.any():
            first = int(np.flatnonzero(is_outside)[0])
            message = f"the trajectory goes from {self.start:.9g} to {self.stop:.9g} s; choose instants within it"
            raise TrajectoryError(message, name=f"times[{first}]", value=float(times[first]))
        return np.clip(times, self.start, self.stop)


def _limits(limits: ArrayLike, names: Sequence[str]) -> list[Any]:
    """Return the three limits of each joint."""
    count = len(names)
    shape = (len(LIMITS), count) if np.ndim(limits) == 2 else (len(LIMITS),)
    values = finite_numbers("limits", in_order("limits", limits, names, TrajectoryError), shape)
    return np.broadcast_to(values.reshape(len(LIMITS), -1), (len(LIMITS), count)).T.tolist()
