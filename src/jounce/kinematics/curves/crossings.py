"""Change points: positions where branches of a curve of configurations cross, and the directions of the branches.

Along a branch through a change point the series is smooth, while the bordered Jacobian is singular. The crossing is
therefore located on the series. Its directions follow at second order (Lyapunov-Schmidt reduction): of all directions
that the first order allows, those for which all vanishing combinations of rows vanish at second order, too.
"""

import dataclasses

import numpy as np
from jaxtyping import Float

from jounce.errors import SolveError
from jounce.kinematics.curves.path_tracker import CurvePoint, PathTracker, all_finite
from jounce.kinematics.status import Status
from jounce.linear_algebra.quadratic_forms import common_zeros, polarized

PASSAGE_ORDER = 8  # of the series through a change point: rounding spoils higher coefficients near it
NEAR = 0.02  # of the radius of the series: this close, its terms up to that order are exact to rounding
REAL = 0.02  # largest ratio of imaginary part to distance for a singular point on the curve
NEARLY_SINGULAR = 1e-6  # of the largest singular value
OPEN = 1e-12  # largest residual at a crossing: two branches with a gap g between them leave a residual of g^2
LARGEST_DEPARTURE = 1e-8
VANISHING = 1e-7  # second derivatives below which a form is zero
MAX_CORRECTIONS, LOCATED = 6, 1e-9  # to locate a crossing; tolerance relative to its distance
SAME_DIRECTION = 1e-6
FIRST_STEPS, LARGEST_BEND = (2e-3, 2e-4, 2e-5), 1e-3  # onto a branch
STARTS, STEPS, LONGEST_STEP = 16, 60, 0.3  # on the unit sphere, for each direction of the first order
ROUNDING = 1e-12  # of the largest coefficient of the forms
MOST_MULTIPLE = 4  # directions in which branches touch; more form a surface
LEAST_ANGLE = 1e-3  # between branches, by the slopes of the forms; closer ones count as one


@dataclasses.dataclass(frozen=True)
class ChangePoint:
    """A configuration in which branches cross.

    Attributes
    ----------
    center : CurvePoint
        The change point, with the series of the branch that is followed.
    tangents : array of shape (branches, unknowns)
        Directions of all branches, the followed one first, of length one in the coordinates.
    dimension : int
        Number of independent directions that the first order allows.
    decided : bool
        Whether the second order distinguishes all branches; if not, there may be more or fewer branches.
    """

    center: CurvePoint
    tangents: Float[np.ndarray, "branch unknown"]
    dimension: int
    decided: bool

    def __repr__(self) -> str:
        place = f"arc length {self.arc_length:.6g}, driver value {self.center.value[0]:.6g}"
        return f"<ChangePoint at {place}, {len(self.tangents)} branches>"

    @property
    def arc_length(self) -> float:
        """Arc length of the change point on the curve."""
        return self.center.arc_length

    def reversed(self) -> "ChangePoint":
        """Return the change point on the curve with reversed direction."""
        tangents = self.tangents.copy()
        tangents[0] *= -1
        return dataclasses.replace(self, center=self.center.reversed(), tangents=tangents)


def crossing(tracker: PathTracker, before: CurvePoint, ahead: complex) -> tuple[ChangePoint, CurvePoint] | None:
    """Return the change point just ahead, and the point as far beyond it, or None if there is none.

    Parameters
    ----------
    tracker : PathTracker
    before : CurvePoint
        Point just before the change point.
    ahead : complex
        Signed arc length to the nearest singular point, to first order.
    """
    limit = NEAR * tracker.radius(before, PASSAGE_ORDER - 2)
    if not (0 < ahead.real < limit and abs(ahead.imag) <= REAL * ahead.real):
        return None
    shortened = before.shortened(PASSAGE_ORDER)
    point = _located(tracker, shortened, ahead.real)
    if point is None:
        return None
    step = point.arc_length - before.arc_length
    points = tracker.points(shortened, np.array([2 * step]))
    far_point = tracker.point_at_lane(points, 0, before.arc_length + 2 * step, before.rows)
    coordinates = {name: c[0] for name, c in far_point.coordinates.items()}
    departure = tracker.difference(coordinates, shortened.at(2 * step))
    if not all_finite(points)[0] or np.max(np.abs(departure)) > LARGEST_DEPARTURE:
        return None
    null = tracker.null_space(point.jacobian, NEARLY_SINGULAR)
    tangent = tracker.tangent(point)
    if null.shape[1] < 2 or float(tangent @ tracker.tangent(far_point)) < 0:
        return None
    tangents, decided = _tangents(tracker, point, null, tangent)
    return ChangePoint(point, tangents, null.shape[1], decided), far_point


def departed(tracker: PathTracker, change_point: ChangePoint, branch: int) -> CurvePoint:
    """Return a point on a branch a little way off a change point; arc length is counted from there.

    Raises
    ------
    SolveError
        If the curve does not follow the direction of the branch.
    """
    direction = change_point.tangents[branch]
    point = tracker.directed(change_point.center, direction)
    for step in FIRST_STEPS:
        predicted = dataclasses.replace(point.recentered(step), arc_length=0.0)
        start = tracker.with_series(tracker.with_jacobian(predicted), direction)
        finite = all(np.isfinite(c).all() for c in start.coordinates.values())
        columns = tracker.columns
        if finite and float(tracker.tangent(start)[:columns] @ direction[:columns]) > 1 - LARGEST_BEND:
            return start
    message = "the branch cannot be entered: near the change point it does not go in the direction of its tangent"
    raise SolveError(message, status=Status.SINGULAR)


def _located(tracker: PathTracker, shortened: CurvePoint, step: float) -> CurvePoint | None:
    """Return the point on the series at which the bordered Jacobian is singular, if its residual vanishes."""

    def at(step: float) -> tuple[CurvePoint, float]:
        points = tracker.points(shortened, np.array([step]), corrected=False)
        derivatives = {"jacobian": points.jacobian[..., 0], "slope": points.slope[..., 0]}
        return dataclasses.replace(shortened.recentered(step, PASSAGE_ORDER), **derivatives), float(points.residual[0])

    first = step
    point, residual = at(step)
    for _ in range(MAX_CORRECTIONS):
        distance = tracker.singularity_distance(point)
        if abs(distance) < LOCATED * first:
            break
        step += distance.real
        if not abs(step - first) < 0.5 * first:
            return None
        point, residual = at(step)
    return point if residual <= OPEN else None


def _tangents(
    tracker: PathTracker,
    point: CurvePoint,
    null: Float[np.ndarray, "unknown k"],
    tangent: Float[np.ndarray, " unknown"],
) -> tuple[Float[np.ndarray, "branch unknown"], bool]:
    """Return the directions of all branches that the second order allows, and whether it distinguishes them."""
    rows = tracker.left_null_space(point.jacobian, NEARLY_SINGULAR)
    # second-order forms of the vanishing combinations of rows, on directions of the first order
    forms = polarized(lambda directions: rows.T @ tracker.second_order(point, null @ directions.T), null.shape[1])
    size = np.max(np.abs(forms), initial=0.0)
    components = null.T @ tangent
    if not size > VANISHING:
        return tangent[None], False
    zeros, decided = _common_zeros(forms / size)
    directions = [x for x in zeros if abs(x @ components) < (1 - SAME_DIRECTION) * np.linalg.norm(components)]
    decided &= len(directions) < len(zeros)  # the followed branch is among the zeros
    others = [null @ x for x in directions]
    scaled = [x / np.linalg.norm(x[: tracker.columns]) for x in others]
    return np.stack([tangent, *scaled]), decided


def _common_zeros(forms: Float[np.ndarray, "form k k"]) -> tuple[list[np.ndarray], bool]:
    """Return unit vectors, up to sign, on which all forms vanish, and whether all of these are isolated."""
    count = forms.shape[1]
    single: list[np.ndarray] = []
    multiple: list[np.ndarray] = []
    starts = np.random.default_rng(0).standard_normal((STARTS * count, count))
    for x in common_zeros(forms, starts, ROUNDING, steps=STEPS, longest=LONGEST_STEP):
        sizes = np.linalg.svd(np.concatenate([2 * forms @ x, x[None]]), compute_uv=False)
        is_single = len(sizes) == count and bool(sizes[-1] > LEAST_ANGLE)
        zeros, least_angle = (single, SAME_DIRECTION) if is_single else (multiple, LEAST_ANGLE)
        if all(abs(x @ other) < 1 - least_angle for other in zeros):
            zeros.append(x)
    if len(multiple) > MOST_MULTIPLE:
        return single, False  # a surface of zeros
    return [*single, *multiple], not multiple
