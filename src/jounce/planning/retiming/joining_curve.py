"""The joining curve, by which a running robot reaches a path: a spline over time that keeps all limits from its state.

Each limited quantity depends mainly on the derivative of its own order: joint limits bound it directly, torques and
their rates depend on accelerations and jerks by the mass matrix, and quantities of points by a Jacobian matrix. With
the matrices of the previous curve, each program is convex. A curve is accepted if its exact quantities keep the limits.
"""

import dataclasses
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from jounce.planning.retiming.quantities.path_quantities import C, Curves, D, G, PathQuantities, Quantity
from jounce.planning.retiming.quantities.robot_quantities import ORDER, RobotQuantities
from jounce.planning.solver import cone_solver
from jounce.robot.algorithms.equations_of_motion import mass_matrix
from jounce.robot.algorithms.jacobian import point_slope

INTERVALS = 20
GROWTH = 1.1  # ratio of successive intervals: the state is at limits, the path is not
IN_INTERVAL, FIRST, IN_FIRST = 3, 3, 8  # instants per interval, number of first intervals, instants in each of these
DEGREE = 5  # least degree of the splines; more if more derivatives are given
SPARE = 0.01  # fraction of a limit, as a margin between the instants
SOON = 0.2  # fraction of the duration after which the margin holds in full, as the state may need the whole limit
HELD = 1e-5  # fraction of a limit: a limit exceeded by less is kept
PENALTY = 1e4  # weight of the excess, as a fraction of the limit, relative to the jerk of the curve
PROGRAMS = 6
NEAR = 0.7  # fraction of a limit: rows that the last curve leaves a larger margin are omitted
SETTLED = 0.3  # ratio of successive excesses above which further programs do not help
EVEN = np.array([[1.0], [0.0], [0.0], [0.0]])  # a rate of 1 in time

_Points = Float[np.ndarray, " _"]
_Motion = Float[np.ndarray, "_ joint"]
_Coefficients = Float[np.ndarray, "_ joint"]


@dataclasses.dataclass(frozen=True, eq=False)
class TimeSplines:
    """B-splines over time.

    Parameters
    ----------
    knots : array of shape (count + degree + 1,)
        Knots from 0, repeated at the ends.
    degree : int
        Degree of the splines.
    """

    knots: _Points
    degree: int

    @property
    def count(self) -> int:
        """Number of splines."""
        return len(self.knots) - self.degree - 1

    @property
    def ends(self) -> Float[np.ndarray, " edge"]:
        """Ends of the intervals, s."""
        return self.knots[self.degree : len(self.knots) - self.degree]

    def matrices(self, times: _Points, order: int) -> Float[np.ndarray, "derivative point spline"]:
        """Return the values of the splines and of their derivatives at instants."""
        from scipy.interpolate import BSpline

        splines = BSpline(self.knots, np.eye(self.count), self.degree)
        return np.stack([splines(times, nu=k) for k in range(order + 1)])


@dataclasses.dataclass(frozen=True, eq=False)
class JoiningCurve:
    """The motion of joints over time, and its largest excess over a limit.

    Parameters
    ----------
    splines : TimeSplines
        Basis of the motion.
    coefficients : array of shape (spline, joint)
        Coefficients of the joints.
    over : float
        Largest excess as a fraction of the limit; 0 if all limits are kept.
    worst : Quantity
        Quantity nearest to its limit, or with the largest excess.
    """

    splines: TimeSplines
    coefficients: _Coefficients
    over: float
    worst: Quantity


@dataclasses.dataclass(frozen=True, eq=False)
class _Rows:
    """Linear bounds on changes of a derivative: slopes of a limited quantity at each instant, and remaining margins.

    Parameters
    ----------
    level : int
        Order of the derivative.
    slopes : array of shape (point, joint)
        Fraction of the limit per unit of the derivative of each joint.
    left : array of shape (point,)
        Remaining margin, as a fraction of the limit.
    used : array of shape (point,)
        Whether the quantity has a limit.
    label : Quantity
        Limited quantity.
    """

    level: int
    slopes: Float[np.ndarray, "point joint"]
    left: _Points
    used: Bool[np.ndarray, " point"]
    label: Quantity


def joining_curve(source: RobotQuantities, begins: _Motion, ends: _Motion, duration: float) -> JoiningCurve:
    """Return the curve of least jerk between two states within limits, or the curve with the smallest excess.

    Parameters
    ----------
    source : RobotQuantities
        Limited quantities of the path to join.
    begins, ends : array of shape (derivatives, joints)
        Positions and time derivatives of both states.
    duration : float
        Time between the states, s.
    """
    splines = _graded(duration, max(DEGREE, len(ends)))
    counts = np.where(np.arange(INTERVALS) < FIRST, IN_FIRST, IN_INTERVAL)
    intervals = zip(splines.ends[:-1], splines.ends[1:], counts, strict=True)
    t = np.append(np.concatenate([np.linspace(*interval, endpoint=False) for interval in intervals]), duration)
    matrices = splines.matrices(t, ORDER)
    coefficients, free_slice = _pinned(splines, begins, ends)
    growth, count = np.minimum(t / (SOON * duration), 1.0), len(begins)  # margins grow with the first free derivative
    margins = [1 - SPARE * growth ** max(count - level, 0) for level in range(ORDER + 1)]
    excess, slack, limiting = np.inf, np.inf, source.labels.every[0]
    candidate = limiting
    for program in range(PROGRAMS):
        q = source.whole(np.einsum("dps,sj->pdj", matrices, coefficients))
        quantities = source.at(q, t)
        if program:
            previous, (excess, limiting) = excess, _exceeded(source, quantities)
            excess, limiting = (slack, candidate) if slack > excess else (excess, limiting)
            if excess <= HELD:
                return JoiningCurve(splines, coefficients, 0.0, limiting)
            if program > 2 and excess > SETTLED * previous:
                break
        rows = [*_range_rows(source, q), *_joint_rows(source, quantities, q, margins)]
        rows += _dynamic_rows(source, quantities, q, margins) if program else []
        rows = [dataclasses.replace(row, used=row.used & (row.left < NEAR)) for row in rows] if program else rows
        change, slack, candidate = _least_change(rows, source.columns, matrices, free_slice, coefficients, duration)
        coefficients = coefficients.copy()
        coefficients[free_slice] += change
        if slack > HELD and not program:  # joint limits alone make it impossible
            return JoiningCurve(splines, coefficients, slack, candidate)
    return JoiningCurve(splines, coefficients, excess, limiting)


def _graded(duration: float, degree: int) -> TimeSplines:
    """Return splines on intervals that grow from the start."""
    ends = np.append(0.0, np.cumsum(GROWTH ** np.arange(INTERVALS)))
    ends *= duration / ends[-1]
    ends[-1] = duration
    return TimeSplines(np.concatenate([np.zeros(degree), ends, np.full(degree, duration)]), degree)


def _pinned(splines: TimeSplines, begins: _Motion, ends: _Motion) -> tuple[_Coefficients, slice]:
    """Return coefficients that satisfy the conditions at both ends, and the slice of the free ones."""
    first_count, last_count = len(begins), len(ends)
    end_values = splines.matrices(splines.ends[[0, -1]], max(first_count, last_count) - 1)
    left = np.linalg.solve(end_values[:first_count, 0, :first_count], begins)
    right = np.linalg.solve(end_values[:last_count, 1, splines.count - last_count :], ends)
    inner = splines.count - first_count - last_count
    fractions = (np.arange(1, inner + 1) / (inner + 1))[:, None]
    inner_values = left[-1] * (1 - fractions) + right[0] * fractions
    return np.concatenate([left, inner_values, right]), slice(first_count, splines.count - last_count)


def _exceeded(source: RobotQuantities, quantities: PathQuantities) -> tuple[float, Quantity]:
    """Return the largest excess of a curve, as a fraction of the limit, and its quantity."""
    count = len(quantities.first)
    shape = np.zeros((5, count))
    shape[1] = 1.0
    ratios = Curves(quantities, shape).ratios(EVEN * np.ones(count))
    _, k = np.unravel_index(int(np.argmax(ratios)), ratios.shape)
    return max(float(ratios.max()) - 1, 0.0), source.labels.every[k]


def _both_sides(
    level: int, slopes: np.ndarray, values: np.ndarray, lower: np.ndarray, upper: np.ndarray, left: list, labels: Any
) -> list[_Rows]:
    """Return the rows of quantities from values (point, quantity) and slopes (point, quantity, joint)."""
    rows = []
    for k, label in enumerate(labels):
        for sign, bound in ((1.0, upper[:, k]), (-1.0, -lower[:, k])):
            used = np.isfinite(bound) & (bound > 0)
            size = np.where(used, bound, 1.0)
            rows.append(
                _Rows(level, sign * slopes[:, k] / size[:, None], left[level] - sign * values[:, k] / size, used, label)
            )
    return rows


def _range_rows(source: RobotQuantities, q: np.ndarray) -> list[_Rows]:
    rows, identity = [], np.eye(q.shape[2])
    for name, k in zip(source.path.names, source.columns, strict=True):
        limits = source.limits.joints[name]
        size = limits.upper - limits.lower if limits.upper is not None and limits.lower is not None else 1.0
        for sign, bound in ((1.0, limits.upper), (-1.0, limits.lower)):
            if bound is not None:
                slopes = np.broadcast_to(sign * identity[k] / size, (len(q), len(identity)))
                label = Quantity(name, "position", "")
                rows.append(_Rows(0, slopes, sign * (bound - q[:, 0, k]) / size, np.ones(len(q), bool), label))
    return rows


def _joint_rows(source: RobotQuantities, quantities: PathQuantities, q: np.ndarray, margins: list) -> list[_Rows]:
    identity, labels = np.broadcast_to(np.eye(q.shape[2]), (len(q), q.shape[2], q.shape[2])), source.labels
    chosen, count = source.with_velocity, len(source.with_velocity)
    forward, backward = source.both_ways("velocity", chosen, q)
    rows = _both_sides(1, identity[:, chosen], q[:, 1, chosen], -backward, forward, margins, labels.first[:count])
    chosen, count = source.with_acceleration, len(source.with_acceleration)
    for level, low, high, names in (
        (2, quantities.lower, quantities.upper, labels.second),
        (3, quantities.rate_lower, quantities.rate_upper, labels.rates),
    ):
        rows += _both_sides(
            level, identity[:, chosen], q[:, level, chosen], low[:, :count], high[:, :count], margins, names[:count]
        )
    chosen, bounds = source.with_jounce, quantities.fourth_bounds
    return rows + _both_sides(4, identity[:, chosen], q[:, 4, chosen], -bounds, bounds, margins, labels.fourth)


def _dynamic_rows(source: RobotQuantities, quantities: PathQuantities, q: np.ndarray, margins: list) -> list[_Rows]:
    """Return the rows of torques, of their rates, and of points of links."""
    rows, labels, count = [], source.labels, len(source.with_acceleration)
    if source.with_effort:
        masses = np.asarray(mass_matrix(source.robot, q[:, 0], drives=source.drives))[:, source.with_effort]
        terms = quantities.second[:, count:]
        values, rates = (terms[..., [C + k, D + k, G + k]].sum(axis=-1) for k in (0, 4))
        for level, sizes, low, high, names in (
            (2, values, quantities.lower, quantities.upper, labels.second),
            (3, rates, quantities.rate_lower, quantities.rate_upper, labels.rates),
        ):
            rows += _both_sides(level, masses, sizes, low[:, count:], high[:, count:], margins, names[count:])
    fast = [point for point in source.limits.points if point.speed is not None]
    forced = [point for point in source.limits.points if point.acceleration is not None]
    sets = (
        (1, fast, labels.first[len(labels.first) - len(fast) :], "speed"),
        (2, forced, labels.vectors, "acceleration"),
    )
    for level, points, names, field in sets:
        for point, label in zip(points, names, strict=True):
            vector = source.point(q, point)[:, level]
            size = np.linalg.norm(vector, axis=1)
            directions = vector / np.maximum(size, np.finfo(float).tiny)[:, None]
            slopes = point_slope(source.robot, q[:, :1], point.link, point.point)
            slopes = np.einsum("pk,pkj->pj", directions, slopes) / getattr(point, field)
            rows.append(_Rows(level, slopes, margins[level] - size / getattr(point, field), size > 0, label))
    return rows


def _least_change(
    rows: list[_Rows],
    columns: Any,
    matrices: np.ndarray,
    free: slice,
    coefficients: _Coefficients,
    duration: float,
) -> tuple[_Coefficients, float, Quantity]:
    """Return the change of free coefficients with the smallest excess over bounds, and then the least jerk.

    Returns
    -------
    change : array of shape (free spline, joint)
    over : float
        Excess as a fraction of the limit.
    worst : Quantity
        Quantity with the largest dual variable.
    """
    from scipy import sparse

    clarabel = cone_solver()
    free_matrices = matrices[:, :, free]
    joints = coefficients.shape[1]
    size = free_matrices.shape[2] * joints
    blocks, sides, row_numbers = [], [], []
    for index, row in enumerate(rows):
        slopes = row.slopes[:, columns]
        is_used = row.used & (np.abs(free_matrices[row.level]).max(axis=1) > 0) & (np.abs(slopes).max(axis=1) > 0)
        product = free_matrices[row.level][is_used][:, :, None] * slopes[is_used][:, None, :]
        blocks.append(sparse.csr_matrix(product.reshape(len(product), size)))
        sides.append(row.left[is_used])
        row_numbers.append(np.full(len(product), index))
    jerk = matrices[3][:, free]
    unit = duration**3 / max(float(np.ptp(coefficients, axis=0).max()), np.finfo(float).tiny)
    jerks = np.einsum("ps,sj->pj", matrices[3], coefficients) * unit
    weight = 1 / (len(jerk) + float((jerks**2).sum()))
    square = sparse.kron(sparse.csr_matrix(jerk.T @ jerk * unit**2 * weight), sparse.identity(joints))
    quadratic = sparse.triu(sparse.block_diag([square, sparse.csc_matrix((1, 1))])).tocsc()
    linear = np.append((jerk.T @ jerks * unit * weight).reshape(-1), PENALTY)
    bounds: Any = sparse.vstack(blocks)
    elastic = sparse.hstack([bounds, sparse.csr_matrix(-np.ones((bounds.shape[0], 1)))])
    positive = sparse.csr_matrix(([-1.0], ([0], [size])), shape=(1, size + 1))
    right = np.append(np.concatenate(sides), 0.0)
    settings = clarabel.DefaultSettings()
    settings.verbose, settings.max_threads = False, 1
    cones = [clarabel.NonnegativeConeT(len(right))]
    matrix = sparse.vstack([elastic, positive], format="csc")
    solution = clarabel.DefaultSolver(quadratic, linear, matrix, right, cones, settings).solve()
    x = np.array(solution.x)
    if str(solution.status) not in ("Solved", "AlmostSolved") or not np.isfinite(x).all():
        return np.zeros((free_matrices.shape[2], joints)), np.inf, rows[0].label
    prices = np.array(solution.z)[:-1]
    limiting = rows[int(np.concatenate(row_numbers)[int(np.argmax(prices))])].label
    return x[:-1].reshape(-1, joints), max(float(x[-1]), 0.0), limiting
