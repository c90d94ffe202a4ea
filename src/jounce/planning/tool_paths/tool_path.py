"""Paths of a tool: laws of its position, and of its orientation or of the direction of its axis."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.display import Displayed
from jounce.base.shapes import Array, ArrayLike, seconds
from jounce.dynamics.limits.local_maxima import local_maxima
from jounce.errors import JounceError, TrajectoryError
from jounce.jet import Jet, dot, sqrt
from jounce.jet.algebra import stacked
from jounce.jet.derivatives import plain_derivatives
from jounce.planning.tool_paths.tool_tasks import Goal, rotation_matrices
from jounce.rigid.attitude_samples import AttitudeSamples
from jounce.rigid.rotations import check_sequence, rotation_matrix
from jounce.trajectory import SplineMotion
from jounce.trajectory.checks import check_samples
from jounce.trajectory.joint_trajectory import MAX_ORDER, JointTrajectory
from jounce.trajectory.law_checks.smoothness import knots

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

XYZ = ("x", "y", "z")
ANGLES = ("angle_1", "angle_2", "angle_3")
INSTANTS, POINTS, ROUNDS = 1025, 9, 9  # samples of a law of progress, samples about an extremum, and refinements
ROUNDING = 1e-9  # fraction of the range of a law of progress


class ToolPath(Displayed):
    """The prescribed pose of a tool from a start to a stop, with derivatives of any order.

    Parameters
    ----------
    position : sequence of three laws, optional
        Position of the point of the tool in the frame of the base, m: motions, expressions of ``t``, or numbers; free
        unless given.
    orientation : optional
        Orientation of the link in the frame of the base: a constant unit quaternion, scalar first, rotation matrix or
        SciPy rotation; ``(SEQUENCE, [law, law, law])`` for Euler angles such as ``("ZYX", ["t", 0, 0])``, rad; or
        `jounce.rigid.AttitudeSamples`.
    direction : sequence of three laws, optional
        Vector of any length but zero along which an axis of the link points, instead of an orientation.
    start, stop : float
        First and last instant, s.
    progress : AbstractMotion, Expression or str, optional
        Function of ``t`` that replaces ``t`` in all other laws: another time law along the same path. `start` and
        `stop` are instants, not values of this law.

    Raises
    ------
    TrajectoryError
        If no position, orientation or direction is given, or a law is not valid.

    Examples
    --------
    >>> import jounce as jn
    >>> circle = ["0.4 + 0.1*cos(t)", "0.1*sin(t)", 0.3]
    >>> path = jn.planning.ToolPath(circle, orientation=[0, 1, 0, 0], start=0.0, stop=6.0)
    >>> abs(path.position([0.0], order=2)[0]).round(12).tolist()
    [[0.5, 0.0, 0.3], [0.0, 0.1, 0.0], [0.1, 0.0, 0.0]]
    """

    def __init__(
        self,
        position: Sequence[Any] | None = None,
        orientation: "ArrayLike | AttitudeSamples | Rotation | None" = None,
        *,
        direction: Sequence[Any] | None = None,
        start: float,
        stop: float,
        progress: Any = None,
    ):
        if position is None and orientation is None and direction is None:
            raise TrajectoryError("give a position, an orientation or a direction to follow", name="position")
        if orientation is not None and direction is not None:
            raise TrajectoryError("give an orientation or a direction, not both", name="direction")
        self.start, self.stop = start, stop
        self._progress = None if progress is None else _laws("progress", {"progress": progress}, start, stop)
        if self._progress is not None:
            start, stop = _reach(self._progress)
            if stop <= start:
                raise TrajectoryError("must change from the start to the stop", name="progress", value=start)
        self._position = None if position is None else _three("position", position, XYZ, start, stop)
        self._direction = None if direction is None else _three("direction", direction, XYZ, start, stop)
        self._attitude = None if orientation is None else _attitude(orientation, start, stop)

    @classmethod
    def through(
        cls,
        times: ArrayLike,
        positions: ArrayLike,
        orientations: "ArrayLike | Rotation | None" = None,
        degree: int = 7,
        **settings: Any,
    ) -> "ToolPath":
        """Return the path of splines through poses at instants.

        Parameters
        ----------
        times : array_like of shape (samples,)
            Instants, increasing, s.
        positions : array_like of shape (samples, 3)
            Positions in the frame of the base, m.
        orientations : optional
            One orientation for each instant, (samples, 4) or (samples, 3, 3), or a SciPy rotation; a single one is
            constant.
        degree : int, default 7
            Odd degree of the splines; derivatives to degree - 1 are continuous.
        **settings
            ``direction`` and ``progress``, as for the class.

        Raises
        ------
        TrajectoryError
            If there are too few samples, or their shapes do not match.

        Examples
        --------
        >>> import numpy as np
        >>> import jounce as jn
        >>> t = np.linspace(0.0, 1.0, 41)
        >>> path = jn.planning.ToolPath.through(t, np.stack([t, t**2, 0 * t], axis=1), [1, 0, 0, 0])
        >>> (path.position([0.5], order=2)[0].round(6) + 0.0).tolist()
        [[0.5, 0.25, 0.0], [1.0, 1.0, 0.0], [0.0, 2.0, 0.0]]
        """
        times, points = check_samples(times, positions)
        if points.ndim != 2 or points.shape[1] != 3:
            raise TrajectoryError(f"must have the shape (samples, 3), not {points.shape}", name="positions")
        laws = [SplineMotion(times, column, degree) for column in points.T]
        rotations = None if orientations is None else rotation_matrices("orientations", orientations)
        if rotations is not None and rotations.ndim > 2:
            rotations = AttitudeSamples.from_rotation_matrices(times, rotations, degree)
        bounds = {"start": float(times[0]), "stop": float(times[-1]), **settings}
        return cls(laws, rotations, **bounds)

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of the goals: "position", "rotation", "direction"."""
        goals = {"position": self._position, "rotation": self._attitude, "direction": self._direction}
        return tuple(kind for kind, goal in goals.items() if goal is not None)

    @property
    def highest(self) -> int:
        """Highest derivative that is continuous, according to the degrees of splines."""
        laws = [law for x in (self._position, self._direction) if x is not None for law in x.laws.values()]
        degrees = [law.degree for law in laws if type(law) is SplineMotion]
        if isinstance(self._attitude, AttitudeSamples):
            degrees.append(self._attitude.degree)
        return min([MAX_ORDER, *(degree - 1 for degree in degrees)])

    @property
    def knots(self) -> Array[np.ndarray, " knots"]:
        """Inner instants at which a derivative of a law is known to jump, without those of `abs` in expressions."""
        if self._progress is not None:  # the argument of the other laws is not time
            return knots(self._progress.laws["progress"], self.start, self.stop)
        angles = self._attitude[1] if isinstance(self._attitude, tuple) else None
        trajectories = [x for x in (self._position, self._direction, angles) if x is not None]
        instants = [knots(law, self.start, self.stop) for x in trajectories for law in x.laws.values()]
        distinct = np.unique(np.concatenate([np.zeros(0), *instants]))
        return distinct[(distinct > self.start) & (distinct < self.stop)]

    def judge(self, order: int) -> None:
        """Warn, as `JointTrajectory` does, if the samples of a law do not support its derivatives to an order."""
        for x in (self._position, self._direction, self._progress):
            if x is not None:
                x.derivatives([x.start], order)

    def __repr__(self) -> str:
        return f"<ToolPath of {', '.join(self.kinds)}; {self.start:g} to {self.stop:g} s>"

    def position(self, times: ArrayLike, order: int = 0) -> Array[np.ndarray, "time derivative 3"]:
        """Return the position at instants with its derivatives, m by s.

        Raises
        ------
        TrajectoryError
            If the path has no position, or an instant is outside.
        """
        if self._position is None:
            raise TrajectoryError("this path has an orientation only", name="position")
        if self._progress is None:
            return self._position.derivatives(times, order)
        return np.moveaxis(
            np.asarray(plain_derivatives(self.series(seconds("times", times, TrajectoryError), order)["position"])),
            -1,
            0,
        )

    def series(self, times: Array[np.ndarray, " time"], order: int) -> Goal:
        """Return the Taylor coefficients of the goals at instants, components first, instants last.

        Raises
        ------
        TrajectoryError
            If an instant is outside, a law is not smooth at an instant, or the order is too high.
        """
        if order > self.highest:
            message = f"the splines of this path have continuous derivatives to {self.highest}; give a higher degree"
            raise TrajectoryError(message, name="order", value=order)
        time = Jet.variable(jnp.asarray(times), order)
        if self._progress is not None:
            rates = self._progress.derivatives(times, order)[:, :, 0]
            time = Jet.from_derivatives(np.moveaxis(rates, -1, 0))
            trajectory = self._position or self._direction
            if trajectory is not None:  # rounding may exceed the range of the laws
                first = np.asarray(time.coefficients[0])
                clipped = np.clip(first, trajectory.start, trajectory.stop)
                is_beyond = np.abs(first - clipped) > ROUNDING * (trajectory.stop - trajectory.start)
                if is_beyond.any():
                    message = f"has a spike at {times[is_beyond][0]:.9g} s, too narrow to have been seen"
                    raise TrajectoryError(message, name="progress", value=float(first[is_beyond][0]))
                time = Jet((jnp.asarray(clipped), *time.coefficients[1:]))
        goal: Goal = {}
        if self._position is not None:
            goal["position"] = self._position(time)
        if self._attitude is not None:
            goal["rotation"] = self._rotation(time)
        if self._direction is not None:
            vector = self._direction(time)
            goal["direction"] = vector / sqrt(dot(vector, vector))
        series = {kind: np.asarray(stacked(jet)) for kind, jet in goal.items()}
        for kind, array in series.items():
            if not np.isfinite(array).all():
                lane = int(np.argwhere(~np.isfinite(array))[0, -1])
                message = f"the law of the {kind} is not defined or not smooth at {times[lane]:.9g} s"
                raise TrajectoryError(message, name=kind)
        return series

    def _rotation(self, time: Jet) -> Jet:
        attitude = self._attitude
        if isinstance(attitude, AttitudeSamples):
            return attitude.attitude(time)
        if isinstance(attitude, tuple):
            return rotation_matrix(attitude[0], attitude[1](time))
        constant = jnp.broadcast_to(jnp.asarray(attitude)[..., None], (3, 3, *time.shape))
        return Jet.constant(constant, time.order)


def _three(name: str, laws: Any, keys: tuple[str, ...], start: float, stop: float) -> JointTrajectory:
    if isinstance(laws, str | Mapping) or not hasattr(laws, "__len__") or len(laws) != 3:
        raise TrajectoryError("must be three laws, one for each component", name=name, value=laws)
    return _laws(name, dict(zip(keys, laws, strict=True)), start, stop)


def _laws(name: str, laws: Mapping[str, Any], start: float, stop: float) -> JointTrajectory:
    try:
        return JointTrajectory(laws, start, stop)
    except JounceError as error:
        key = (error.name or "").removeprefix("laws").removeprefix(".")
        location = f"{name}.{key}" if error.name and error.name.startswith("laws") and key != name else name
        raise error.located(name=location if error.name and error.name.startswith("laws") else error.name) from None


def _reach(progress: JointTrajectory) -> tuple[float, float]:
    """Return the least and the largest value of a law of progress, refined between sampled instants."""

    def negated_and_values(times: Float[np.ndarray, " time"]) -> Float[np.ndarray, "time 2"]:
        values = progress.derivatives(times, 0)[:, 0, 0]
        return np.stack([-values, values], axis=-1)

    grid = np.linspace(progress.start, progress.stop, INSTANTS)
    measures = negated_and_values(grid)
    peaks, extremes = local_maxima(measures), measures.max(axis=0)
    low, high = grid[np.maximum(peaks - 1, 0)], grid[np.minimum(peaks + 1, INSTANTS - 1)]
    for _ in range(ROUNDS):
        near = np.linspace(low, high, POINTS)
        refined = negated_and_values(near.ravel()).reshape(*near.shape, 2)[:, :, [0, 1], [0, 1]]
        extremes, top = np.maximum(extremes, refined.max(axis=(0, 1))), np.argmax(refined, axis=0)
        low, high = (np.take_along_axis(near, np.clip(top + step, 0, POINTS - 1)[None], axis=0)[0] for step in (-1, 1))
    return float(-extremes[0]), float(extremes[1])


def _attitude(orientation: Any, start: float, stop: float) -> Any:
    """Return an orientation: constant, samples, or a sequence with laws of its angles."""
    if isinstance(orientation, AttitudeSamples):
        return orientation
    if isinstance(orientation, tuple) and len(orientation) == 2 and isinstance(orientation[0], str):
        check_sequence(orientation[0], TrajectoryError, "orientation")
        return orientation[0], _three("orientation", orientation[1], ANGLES, start, stop)
    rotations = rotation_matrices("orientation", orientation)
    if rotations.shape != (3, 3):
        message = "a constant orientation is one quaternion or matrix; ToolPath.through takes one for each instant"
        raise TrajectoryError(message, name="orientation", value=f"shape {rotations.shape}")
    return rotations
