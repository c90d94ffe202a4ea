"""Paths of joints: positions as functions of a parameter that says nothing of time."""

import dataclasses
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.dynamics.motion_values import in_chunks
from jounce.errors import JounceError, SampleWarning, TrajectoryError
from jounce.jet import Jet
from jounce.trajectory import AbstractMotion, Expression, JointTrajectory, PiecewiseMotion, SplineMotion
from jounce.trajectory.knots import knot_jumps
from jounce.trajectory.stacking import law_derivatives

BLOCK = 2048  # places evaluated at once
DEGREE = 5  # of the splines through waypoints
SAMPLES = 1001  # of a law whose parameter is not fit to be that of a path
THINNEST = 1 / 250  # of the length of a path: samples that are nearer to each other than this are left out
STILL = 1e-3  # of the largest speed in the parameter, below which a law stands still there
LOOKS = 2000  # cells in which kinks are looked for
BENT = 0.2  # of the change over a cell: what the slopes do not account for, where it is a jump
FAINT = 1e-5  # of the largest value: a smaller jump is none
REPEATED = 1e-9  # of the length of a path: waypoints that are nearer to each other are one


@dataclasses.dataclass(frozen=True, eq=False)
class Path:
    """The positions of joints along a path, over a parameter s that runs from `start` to `stop`.

    Parameters
    ----------
    laws : dict of str to AbstractMotion
        Position of each joint over s, rad or m.
    start, stop : float
        Ends of s.
    deviation : float, default 0
        How far the path passes by samples that it was made of, rad or m.
    """

    laws: Mapping[str, AbstractMotion]
    start: float
    stop: float
    deviation: float = 0.0

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(self.laws)

    def derivatives(self, s: Float[np.ndarray, " point"], order: int) -> Float[np.ndarray, "point derivative joint"]:
        """Return positions and derivatives by s."""
        laws = list(self.laws.values())

        def block(some: np.ndarray) -> np.ndarray:
            return np.moveaxis(np.asarray(law_derivatives(laws, jnp.asarray(s[some]), order)), -1, 0)

        return in_chunks(block, len(s), (BLOCK,), axis=0)  # always as many at once, so that all is compiled once


class PathExpression(AbstractMotion):
    """The position of a joint over ``s``, by an expression.

    Parameters
    ----------
    expression : Expression
        Of ``s``.
    """

    expression: Expression = eqx.field(static=True)

    def __call__(self, time: Jet) -> Jet:
        """Return the jet of the positions for a jet of s."""
        value = self.expression.evaluate({"s": time})
        return (
            value if isinstance(value, Jet) else Jet.constant(jnp.zeros_like(time.coefficients[0]) + value, time.order)
        )


def path_of(path: Any, names: Sequence[str] | None = None) -> Path:
    """Return the path that was given as waypoints, as expressions, or as a trajectory whose times do not count.

    Parameters
    ----------
    path : Path, JointTrajectory, dict of str, or array_like of shape (points, joints)
        A trajectory gives its geometry. A mapping gives each joint an expression of ``s``, which runs from 0 to 1, or
        its positions at the waypoints. Splines of degree 5 go through waypoints.
    names : sequence of str, optional
        Of the joints of an array, in the order of its columns.

    Raises
    ------
    TrajectoryError
        If it is no path, has a kink, or points repeat.
    """
    if isinstance(path, Path):
        return path
    if isinstance(path, JointTrajectory):
        return _geometry(path)
    if isinstance(path, Mapping):
        given = {str(name): x for name, x in path.items()}
        if any(isinstance(x, str | AbstractMotion) for x in given.values()):
            return checked(Path({name: _law(name, x) for name, x in given.items()}, 0.0, 1.0))
        names, lists = list(given), list(given.values())
        if len({np.shape(x) for x in lists}) != 1:
            raise TrajectoryError("waypoints of all joints must be equally many", name="path")
        path = np.stack([np.asarray(x, float) for x in lists], axis=-1)
    points = _numbers(path)
    if names is None or points.shape[1] != len(names):
        wanted = "" if names is None else f" with {len(names)} joints: {', '.join(names)}"
        message = f"waypoints have the shape (points, joints){wanted}; or give a mapping from names to positions"
        raise TrajectoryError(message, name="path", value=f"shape {points.shape}")
    return through(points, names)


def through(points: Float[np.ndarray, "point joint"], names: Sequence[str], *, thin: bool = False) -> Path:
    """Return the path of splines through points, over the length of the chords between them.

    With `thin`, points that crowd are left out, as where samples in time come to rest.
    """
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    total = float(chords.sum())
    if not total > 0:
        raise TrajectoryError("the path does not move: all its points are the same", name="path")
    if thin:
        kept = _thinned(points, THINNEST * total)
    else:
        same = np.flatnonzero(chords <= REPEATED * total)
        if len(same):
            message = f"waypoint {same[0] + 2} is the same as the one before; leave it out"
            raise TrajectoryError(message, name=f"path[{same[0] + 1}]", value=points[same[0] + 1].tolist())
        kept = np.arange(len(points))
    chosen = points[kept]
    lengths = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(chosen, axis=0), axis=1)))
    lengths /= lengths[-1]
    degree = next(d for d in (DEGREE, 3, 2, 1) if len(chosen) > d)
    laws: dict[str, AbstractMotion] = {
        name: SplineMotion(lengths, column, degree) for name, column in zip(names, chosen.T, strict=True)
    }
    path = Path(laws, 0.0, 1.0)
    return path if not thin else dataclasses.replace(path, deviation=_deviation(path, points))


def _geometry(trajectory: JointTrajectory) -> Path:
    """Return where a trajectory leads, over its time where that is fit, or over the length of the path."""
    path = Path(dict(trajectory.laws), trajectory.start, trajectory.stop)
    s = np.linspace(trajectory.start, trajectory.stop, LOOKS + 1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SampleWarning)
        values = trajectory.derivatives(s, 1)
    speed = np.linalg.norm(values[:, 1], axis=1)
    if not speed.max() > 0:
        raise TrajectoryError("the path does not move: all its points are the same", name="path")
    if speed.min() > STILL * speed.max():
        return checked(path)
    own = trajectory.times if len(trajectory.times) >= SAMPLES else np.linspace(path.start, path.stop, SAMPLES)
    return through(path.derivatives(own, 0)[:, 0], path.names, thin=True)


def _thinned(points: np.ndarray, least: float) -> np.ndarray:
    """Return which points stand at least so far from the one before and from the last one; both ends are kept."""
    kept = [0]
    apart = np.linalg.norm(points[-1] - points, axis=1)
    far = np.cumsum(np.append(0.0, np.linalg.norm(np.diff(points, axis=0), axis=1)))
    for k in range(1, len(points) - 1):
        if far[k] - far[kept[-1]] >= least and (far[-1] - far[k] >= least or apart[k] >= least):
            kept.append(k)
    return np.array([*kept, len(points) - 1])


def _deviation(path: Path, points: np.ndarray) -> float:
    """Return how far points are from a path, by the nearest of many places and the tangent there."""
    s = np.linspace(path.start, path.stop, 20 * SAMPLES)
    values = path.derivatives(s, 1)
    from scipy.spatial import KDTree

    _, near = KDTree(values[:, 0]).query(points)
    off, tangent = points - values[near, 0], values[near, 1]
    along = np.sum(off * tangent, axis=1, keepdims=True) / np.maximum(np.sum(tangent**2, axis=1, keepdims=True), 1e-300)
    return float(np.linalg.norm(off - along * tangent, axis=1).max())


def checked(path: Path, order: int = 1) -> Path:
    """Return a path that is finite, moves, and whose derivatives by s are continuous to an order.

    Raises
    ------
    TrajectoryError
        If it has none of these: the message says where.
    """
    for name, law in path.laws.items():
        for instant, jumped in _jumps(law, order):
            if path.start < instant < path.stop and np.any(jumped):
                raise _kink(instant, int(np.argmax(jumped != 0)), name)
    s = np.linspace(path.start, path.stop, LOOKS + 1)
    values = path.derivatives(s, order + 1)
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        at, level, joint = bad[0]
        message = f"derivative {level} of the path is not finite at s = {s[at]:.6g}"
        raise TrajectoryError(message, name=path.names[joint])
    if not np.abs(values[:, 1]).max() > 0:
        raise TrajectoryError("the path does not move: all its points are the same", name="path")
    sizes = np.abs(values).max(axis=(0, 2))
    for level in range(order + 1):
        # what is small beside a lower derivative over the whole path is no more than its rounding
        size = max(sizes[k] / (path.stop - path.start) ** (level - k) for k in range(min(level, 1), level + 1))
        change = np.diff(values[:, level], axis=0)
        slopes = values[:, level + 1]
        step = s[1] - s[0]
        off = np.abs(change - (slopes[1:] + slopes[:-1]) * step / 2)  # what no slope accounts for jumped
        bends = step * np.abs(np.diff(slopes, axis=0))  # more than that comes of a jump of the slope
        far = (off > BENT * np.abs(change)) & (off > FAINT * size)
        jumps = np.argwhere(far & (off > bends))
        if len(jumps):
            raise _kink(float(s[jumps[0][0]] + (s[1] - s[0]) / 2), level, path.names[jumps[0][1]])
    return path


def _jumps(law: AbstractMotion, order: int) -> Any:
    if isinstance(law, SplineMotion):
        instants, sizes = knot_jumps(law, order)
    elif isinstance(law, PiecewiseMotion):
        instants, sizes = law.jumps(order)
    else:
        return ()
    return zip(instants.tolist(), sizes.T, strict=True)


def _kink(s: float, order: int, name: str) -> TrajectoryError:
    what = {0: "jumps", 1: "has a kink (its direction jumps)", 2: "has a jump of curvature"}.get(order, "is not smooth")
    limits = "" if order < 2 else ", where what is limited would be infinite"
    message = f"the path {what} at s = {s:.6g}{limits}; round it, or stop there and retime both parts"
    return TrajectoryError(message, name=name)


def _law(name: str, law: Any) -> AbstractMotion:
    if isinstance(law, AbstractMotion):
        return law
    try:
        expression = Expression(law if isinstance(law, str) else repr(float(law)))
        expression.check({"s"})
        return PathExpression(expression)
    except JounceError as error:
        raise TrajectoryError(error.message, name=f"path.{name}", value=law) from None


def _numbers(path: Any) -> np.ndarray:
    try:
        points = np.asarray(path, float)
    except (TypeError, ValueError):
        raise TrajectoryError("must be waypoints, expressions of s, or a trajectory", name="path", value=path) from None
    if points.ndim != 2 or len(points) < 2:
        message = "waypoints have the shape (points, joints), two points at least"
        raise TrajectoryError(message, name="path", value=f"shape {points.shape}")
    bad = np.argwhere(~np.isfinite(points))
    if len(bad):
        raise TrajectoryError("must be finite", name=f"path[{bad[0][0]}][{bad[0][1]}]", value=float(points[*bad[0]]))
    return points
