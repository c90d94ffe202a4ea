"""Paths of joints from waypoints, expressions or trajectories: positions over a parameter independent of time."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.modules import field
from jounce.base.shapes import ArrayLike, real_numbers
from jounce.errors import JounceError, TrajectoryError, whole_number
from jounce.jet import Jet
from jounce.planning.paths.path import Path
from jounce.planning.paths.sampled_paths import lines_along, path_of_samples
from jounce.planning.paths.straight_lines import Lines, rounded
from jounce.trajectory import AbstractMotion, Expression, JointTrajectory, PiecewiseMotion, SplineMotion
from jounce.trajectory.checks import finite, finite_row, positive
from jounce.trajectory.knots import knot_jumps
from jounce.trajectory.labels import in_order
from jounce.trajectory.law_checks.seen_jumps import level_sizes, unexplained
from jounce.trajectory.splines import HIGHEST_DEGREE, pieces_at

DEGREE = 5  # of the splines through waypoints
KINK_CELLS = 2000  # cells of the search for kinks
CELLS = (160, 320, 640, 1280)  # cells of the spline of a time law
POINTS_IN_CELL = 4
FINEST = 4 * POINTS_IN_CELL * CELLS[-1]  # sample points of a path
RESOLVED = 0.05  # fraction of the range of a derivative: error of linear interpolation between sample points
SLIGHT = 1e-3  # fraction of the size expected from the length of the path: smaller derivatives are negligible
LOOKS = 16  # sample intervals between two waypoints
ENDS = 0.02  # fraction of a path at each end
REPEATED = 1e-9  # fraction of the length of a path: waypoints nearer to each other are the same

GivenPath = Path | JointTrajectory | Mapping[str, ArrayLike | str | AbstractMotion] | ArrayLike
"""A path: waypoints, positions or expressions of ``s`` by the names of joints, or a trajectory without its times."""


class PathExpression(AbstractMotion):
    """The position of a joint over ``s``, given by an expression.

    Parameters
    ----------
    expression : Expression
        Expression of ``s``.
    """

    expression: Expression = field(static=True)

    def __call__(self, time: Jet) -> Jet:
        """Return the jet of the positions for a jet of s."""
        value = self.expression.evaluate({"s": time})
        return (
            value if isinstance(value, Jet) else Jet.constant(jnp.zeros_like(time.coefficients[0]) + value, time.order)
        )


@dataclasses.dataclass(frozen=True)
class Between:
    """Shape of a path between its points.

    Parameters
    ----------
    deviation : float, optional
        Largest distance from the straight lines between the points, rad or m.
    parameter : array_like of shape (points,), optional
        Increasing values of s at waypoints; by default the chord length, scaled to run from 0 to 1.
    degree : int, optional
        Degree of the splines through waypoints, 1 to 11.

    Raises
    ------
    TrajectoryError
        If a value is not valid.
    """

    deviation: float | None = None
    parameter: ArrayLike | None = None
    degree: int | None = None

    def __post_init__(self) -> None:
        if self.deviation is not None:
            positive("deviation", self.deviation)
        if self.degree is not None:
            whole_number("degree", self.degree, 1, HIGHEST_DEGREE, error=TrajectoryError)

    def check_without_points(self) -> None:
        """Raise TrajectoryError if a setting was given that applies to waypoints only."""
        for name in ("parameter", "degree"):
            if getattr(self, name) is not None:
                message = "is for waypoints only, and the path has none; leave it out"
                raise TrajectoryError(message, name=name, value=getattr(self, name))


def path_of(
    path: GivenPath | None, names: Sequence[str] | None = None, order: int = 1, between: Between = Between()
) -> Path:
    """Return the path given by waypoints, by expressions, or by a trajectory, whose times are ignored.

    Parameters
    ----------
    path : Path, JointTrajectory, dict of str, or array_like of shape (points, joints)
        A trajectory gives its geometry. A mapping gives for each joint an expression of ``s``, which runs from 0 to 1,
        its positions at the waypoints, or a motion over s, which runs over the domain of splines. Splines through
        waypoints have degree 5, or less through five or fewer.
    names : sequence of str, optional
        Names of the joints of an array, in the order of its columns.
    order : int, default 1
        Order to which derivatives are continuous at corners where a trajectory stops, and with few waypoints.
    between : Between, optional
        Shape of the path between its points.

    Raises
    ------
    TrajectoryError
        If the path is not valid, has a kink, or points repeat.
    """
    if isinstance(path, Path) and path.points is not None:
        return _between(path.points, order, between)
    if isinstance(path, JointTrajectory):
        between.check_without_points()
        return checked(path_of_samples(path, order, between.deviation))
    if isinstance(path, Mapping):
        laws_or_points: dict[str, Any] = {str(name): x for name, x in path.items()}
        if any(isinstance(x, str | AbstractMotion) for x in laws_or_points.values()):
            laws = {name: _law(name, x) for name, x in laws_or_points.items()}
            path = Path(laws, *_domain(laws))
    if isinstance(path, Path):
        between.check_without_points()
        return checked(path if between.deviation is None else rounded(lines_along(path), between.deviation))
    if isinstance(path, Mapping):
        lists: list[Any] = list(path.values())
        names = [str(name) for name in path]
        if len({np.shape(x) for x in lists}) != 1:
            raise TrajectoryError("waypoints of all joints must be equally many", name="path")
        path = np.stack(lists, axis=-1)
    points = _numbers(path if names is None else in_order("path", path, names, TrajectoryError))
    if names is None or points.shape[1] != len(names):
        expected = "" if names is None else f" with {len(names)} joints: {', '.join(names)}"
        message = f"waypoints have the shape (points, joints){expected}; or give a mapping from names to positions"
        raise TrajectoryError(message, name="path", value=f"shape {points.shape}")
    return _between(Lines(_lengths(points, between.parameter), points, tuple(names), "waypoints"), order, between)


def _lengths(points: Float[np.ndarray, "point joint"], parameter: ArrayLike | None) -> Float[np.ndarray, " point"]:
    """Return the values of s at waypoints: those given, or the normalized chord length."""
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    total_length = float(chords.sum())
    if not total_length > 0:
        raise TrajectoryError("the path does not move: all its points are the same", name="path")
    if parameter is not None:
        values = finite_row("parameter", parameter)
        if len(values) != len(points) or not (np.diff(values) > 0).all():
            message = f"must be {len(points)} numbers that increase, one for each waypoint"
            raise TrajectoryError(message, name="parameter", value=values.tolist())
        return values
    repeats = np.flatnonzero(chords <= REPEATED * total_length)
    if len(repeats):
        message = f"waypoint {repeats[0] + 2} is the same as the one before; leave it out"
        raise TrajectoryError(message, name=f"path[{repeats[0] + 1}]", value=points[repeats[0] + 1].tolist())
    return np.append(0.0, np.cumsum(chords)) / total_length


def _between(lines: Lines, order: int, shape: Between) -> Path:
    """Return the path of splines through waypoints, or one within a deviation of the straight lines between them.

    Five points get a cubic spline, or a quartic if more than two derivatives must be continuous.
    """
    if shape.deviation is not None:
        shape.check_without_points()
        return dataclasses.replace(rounded(lines, shape.deviation), points=lines)
    smooth = 4 if order > 2 else 3
    degrees = (DEGREE, smooth) if shape.degree is None else (shape.degree,)
    degree = next(d for d in (*degrees, 3, 2, 1) if len(lines.at) > d and d <= degrees[0])
    laws = {name: SplineMotion(lines.at, x, degree) for name, x in zip(lines.names, lines.points.T, strict=True)}
    points = (lines.at[:-1, None] + np.diff(lines.at)[:, None] * np.arange(1, LOOKS) / LOOKS).reshape(-1)
    distances = lines.distances(points, np.stack([pieces_at(law, points) for law in laws.values()], axis=1))
    note = f"splines of degree {degree} through {len(lines.at)} waypoints"
    start, stop = float(lines.at[0]), float(lines.at[-1])
    return Path(dict(laws), start, stop, float(distances.max()), words=note, passed=(lines.at, lines.at), points=lines)


def checked(path: Path, order: int = 1) -> Path:
    """Return a path after checking that it is finite, moves, and has continuous derivatives by s to an order.

    Raises
    ------
    TrajectoryError
        If a check fails; the message gives the place.
    """
    for name, law in path.laws.items():
        for instant, jumped in _jumps(law, order):
            if path.start < instant < path.stop and np.any(jumped):
                raise _kink(path.location(instant), int(np.argmax(jumped != 0)), name)
    s = np.linspace(path.start, path.stop, KINK_CELLS + 1)
    values = path.derivatives(s, order + 1)
    failures = np.argwhere(~np.isfinite(values))
    if len(failures):
        index, level, joint = failures[0]
        message = f"derivative {level} of the path is not finite at {path.location(float(s[index]))}"
        raise TrajectoryError(message, name=path.names[joint])
    if not np.abs(values[:, 1]).max() > 0:
        raise TrajectoryError("the path does not move: all its points are the same", name="path")
    sizes = level_sizes(np.abs(values).max(axis=2, keepdims=True), path.stop - path.start)
    unexplained_jumps = unexplained(s, values, sizes)
    unexplained_jumps[:, :, [isinstance(law, SplineMotion) and law.joined >= order for law in path.laws.values()]] = (
        False
    )
    for level in range(order + 1):
        jumps = np.argwhere(unexplained_jumps[:, level])
        if len(jumps):
            raise _kink(path.location(float(s[jumps[0][0]] + (s[1] - s[0]) / 2)), level, path.names[jumps[0][1]])
    return path


def cells_needed(path: Path, order: int) -> int:
    """Return the number of cells that resolves a path: 160, doubled as often as necessary.

    The derivative of the given order, which is continuous, is compared on the finest grid with its linear interpolation
    from a coarser grid.

    Raises
    ------
    TrajectoryError
        If 1280 cells do not resolve the path; the message gives the place.
    """
    s = np.linspace(path.start, path.stop, FINEST + 1)
    values = path.derivatives(s, order + 1)  # the order that `checked` uses, so that its program serves again
    length = path.stop - path.start
    inner = slice(int(ENDS * FINEST), int((1 - ENDS) * FINEST))
    curves, scale = values[:, order], np.abs(values[:, 1]).max() / length ** (order - 1)
    size = np.ptp(curves[inner], axis=0).max() + SLIGHT * scale
    cell, joint, step = 0, 0, 1
    _check_seen(path, order, s[inner], curves[inner], size)
    for cells in CELLS:
        step = FINEST // (cells * POINTS_IN_CELL)
        ends, fraction = curves[::step, None], np.arange(step)[:, None] / step
        lines = ends[:-1] + (ends[1:] - ends[:-1]) * fraction
        gaps = np.abs(curves[:-1].reshape(lines.shape) - lines).max(axis=1) / size  # bends may lie between grid points
        gaps[: int(ENDS * len(gaps))] = gaps[int((1 - ENDS) * len(gaps)) :] = 0.0  # cells are narrow at the ends
        cell, joint = divmod(int(np.argmax(gaps)), gaps.shape[1])
        if gaps[cell, joint] <= RESOLVED:
            return cells
    raise _too_fine(path, float(s[step // 2 + cell * step]), path.names[joint])


def _check_seen(path: Path, order: int, s: np.ndarray, curves: np.ndarray, size: float) -> None:
    """Raise TrajectoryError if a spline bends so narrowly that the bend lies between points of the finest grid."""
    for name, law, curve in zip(path.names, path.laws.values(), curves.T, strict=True):
        if isinstance(law, SplineMotion) and len(law.coefficients) > order:
            begins = np.asarray(law.breakpoints, float)
            derivatives = math.factorial(order) * np.asarray(law.coefficients, float)[order]
            gaps = np.where((begins > s[0]) & (begins < s[-1]), np.abs(derivatives - np.interp(begins, s, curve)), 0.0)
            if gaps.max() > RESOLVED * max(size, np.ptp(derivatives)):
                raise _too_fine(path, float(begins[gaps.argmax()]), name)


def _too_fine(path: Path, s: float, name: str) -> TrajectoryError:
    message = (
        f"the path oscillates or bends too finely at {path.location(s)} for a time law that keeps limits: "
        f"{CELLS[-1]} cells do not resolve it; allow a larger deviation, smooth it, or retime shorter parts of it"
    )
    return TrajectoryError(message, name=name)


def _jumps(law: AbstractMotion, order: int) -> Any:
    if isinstance(law, SplineMotion):
        instants, sizes = knot_jumps(law, order)
    elif isinstance(law, PiecewiseMotion):
        instants, sizes = law.jumps(order)
    else:
        return ()
    return zip(instants.tolist(), sizes.T, strict=True)


def _kink(location: str, order: int, name: str) -> TrajectoryError:
    phrase = {
        0: "jumps",
        1: "has a kink (its direction jumps, or turns too sharply to be resolved)",
        2: "has a jump of curvature",
    }.get(order, "is not smooth")
    limits = "" if order < 2 else ", where a limited quantity would be infinite"
    message = f"the path {phrase} at {location}{limits}; round it by a deviation, or stop there and retime both parts"
    return TrajectoryError(message, name=name)


def _domain(laws: Mapping[str, AbstractMotion]) -> tuple[float, float]:
    """Return the range of s: the common domain of splines, or from 0 to 1."""
    bounded = [isinstance(law, SplineMotion) and law.beyond == "refuse" for law in laws.values()]
    domains = {(float(law.breakpoints[0]), float(law.stop)) for law in laws.values() if isinstance(law, SplineMotion)}
    if not all(bounded):
        return 0.0, 1.0
    (domain,) = domains if len(domains) == 1 else (None,)
    return domain or (0.0, 1.0)


def _law(name: str, law: Any) -> AbstractMotion:
    if isinstance(law, AbstractMotion):
        return law
    try:
        expression = Expression(law if isinstance(law, str) else repr(finite(None, law)))
        expression.check({"s"})
        return PathExpression(expression)
    except JounceError as error:
        raise TrajectoryError(error.message, name=f"path.{name}", value=law) from None


def _numbers(path: Any) -> np.ndarray:
    points = real_numbers("path", path, TrajectoryError, "waypoints of real numbers, expressions of s, or a trajectory")
    if points.ndim != 2 or len(points) < 2:
        message = "waypoints have the shape (points, joints), two points at least"
        raise TrajectoryError(message, name="path", value=f"shape {points.shape}")
    bad = np.argwhere(~np.isfinite(points))
    if len(bad):
        raise TrajectoryError("must be finite", name=f"path[{bad[0][0]}][{bad[0][1]}]", value=float(points[*bad[0]]))
    return points
