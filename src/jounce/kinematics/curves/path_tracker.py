"""Numerical continuation of curves of configurations: points with Taylor series in arc length, on the host."""

import dataclasses
import math
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy.polynomial.polynomial import polyval

from jounce.base.padding import padded
from jounce.base.shapes import Numbers
from jounce.execution.chunks import in_chunks
from jounce.jet.turns import principal
from jounce.kinematics.curves.series import CurvePoints, curve_points, second_order
from jounce.mechanism import Model
from jounce.mechanism.transmissions.axis_angles import conjugate, quaternion_product
from jounce.rigid import PlanarPose
from jounce.rigid.spatial import quaternion_change

ORDER = 20
LANES = 8  # points solved side by side: each number compiles once
TAIL = 1e-15  # last term of the series over a step, rad or sizes of the mechanism: rounding
RANK_TOLERANCE = 1e-8  # of the largest singular value
BINOMIALS = np.array([[math.comb(n, k) for n in range(ORDER + 1)] for k in range(ORDER + 1)], float)


@dataclasses.dataclass(frozen=True)
class CurvePoint:
    """A point on a curve, with the Taylor series of the curve in arc length.

    Attributes
    ----------
    arc_length : float
        Arc length from the start of the curve.
    coordinates : dict of str to array, shape (order + 1, ..., bodies)
        Taylor coefficients of the coordinates of all bodies, the ground first.
    value : array of shape (order + 1,)
        Taylor coefficients of the free value.
    jacobian, slope : array of shape (rows, unknowns)
        Scaled Jacobian of all constraints, and its derivative along the curve.
    rows : array of int
        Rows that are independent at the point, one fewer than unknowns.
    """

    arc_length: float
    coordinates: dict[str, np.ndarray]
    value: np.ndarray
    jacobian: np.ndarray
    slope: np.ndarray
    rows: Int[np.ndarray, " independent"]

    def at(self, step: float) -> dict[str, np.ndarray]:
        """Return the coordinates at a step from the point, by its series."""
        return {name: np.asarray(polyval(step, c)) for name, c in self.coordinates.items()}

    def recentered(self, step: float, order: int = ORDER) -> "CurvePoint":
        """Return the point at a step along the series, with terms up to an order."""
        power = np.arange(order + 1)
        exponent = power[None] - power[:, None]
        shift = BINOMIALS[: order + 1, : order + 1] * step ** np.maximum(exponent, 0)

        def shifted(c: np.ndarray) -> np.ndarray:
            return np.concatenate([np.tensordot(shift, c[: order + 1], 1), np.zeros_like(c[order + 1 :])])

        return self._with_series(shifted, arc_length=self.arc_length + step)

    def reversed(self) -> "CurvePoint":
        """Return the point with its series in the reversed direction."""

        def alternated(c: np.ndarray) -> np.ndarray:
            return c * ((-1.0) ** np.arange(len(c))).reshape(-1, *[1] * (c.ndim - 1))

        return self._with_series(alternated, arc_length=-self.arc_length, slope=-self.slope)

    def shortened(self, order: int) -> "CurvePoint":
        """Return the point with the coefficients above an order, which rounding spoils first, set to zero."""

        def truncated(c: np.ndarray) -> np.ndarray:
            return np.concatenate([c[: order + 1], np.zeros_like(c[order + 1 :])])

        return self._with_series(truncated)

    def _with_series(self, change: Callable[[np.ndarray], np.ndarray], **others: Any) -> "CurvePoint":
        """Return the point with its series transformed, and other attributes replaced."""
        coordinates = {name: change(c) for name, c in self.coordinates.items()}
        return dataclasses.replace(self, coordinates=coordinates, value=change(self.value), **others)


@dataclasses.dataclass(frozen=True)
class PathTracker:
    """The continuation of a model in which the value of a free driver takes the place of time."""

    model: Model
    driven: bool
    value_scale: float = 1.0
    timed: bool = False  # whether the value is the instant: equal poses at different instants are different points

    @property
    def columns(self) -> int:
        """Number of coordinates."""
        return self.model.system.shape[1]

    @property
    def unknowns(self) -> int:
        """Number of coordinates plus the free value."""
        return self.columns + self.driven

    @property
    def is_planar(self) -> bool:
        """Whether the mechanism is planar, with angles as attitudes."""
        return "angle" in self.model.guess

    @cached_property
    def _lengths(self) -> np.ndarray:
        return np.asarray(self.model.system.column_scale)[: self.model.pose_type.shifts, None]

    # points

    def point_without_series(self, coordinates: dict[str, Any], value: float) -> CurvePoint:
        """Return a point without a series, from coordinates of shape (..., bodies, 1)."""
        series = {}
        for name, x in coordinates.items():
            series[name] = np.zeros((ORDER + 1, *np.shape(x)[:-1]))
            series[name][0] = np.asarray(x)[..., 0]
        values = np.zeros(ORDER + 1)
        values[0] = value
        blank = np.zeros((self.model.system.shape[0], self.unknowns))
        rows = np.arange(self.unknowns - 1) % max(1, len(blank))
        return self.with_jacobian(CurvePoint(0.0, series, values, blank, blank, rows))

    def with_jacobian(self, point: CurvePoint) -> CurvePoint:
        """Return a point with the Jacobian of its configuration and its independent rows."""
        points = self.points(point, np.zeros(1), np.ones(self.columns), corrected=False)
        jacobian = points.jacobian[..., 0]
        rows = self.independent(jacobian)
        return dataclasses.replace(point, jacobian=jacobian, rows=point.rows if rows is None else rows)

    def directed(self, point: CurvePoint, direction: Float[np.ndarray, " unknown"]) -> CurvePoint:
        """Return a point whose series is a straight line in a direction."""
        pose_type = self.model.pose_type
        shift, turn = self.parts(direction)
        rates = {"position": shift, "angle": turn[0]} if pose_type is PlanarPose else {"position": shift}
        if "quaternion" in point.coordinates:
            rates["quaternion"] = np.asarray(quaternion_change(point.coordinates["quaternion"][0], turn))
        series = {name: np.zeros_like(c) for name, c in point.coordinates.items()}
        for name, c in point.coordinates.items():
            series[name][0], series[name][1] = c[0], rates[name]
        value = np.zeros_like(point.value)
        value[0] = point.value[0]
        value[1] = direction[-1] * self.value_scale if self.driven else 0.0
        return dataclasses.replace(point, coordinates=series, value=value)

    def parts(self, direction: Float[np.ndarray, " unknown"]) -> tuple[np.ndarray, np.ndarray]:
        """Return shifts, (components, bodies) in m, and rotations of all bodies in a direction, the ground first."""
        system, shifts = self.model.system, self.model.pose_type.shifts
        shift, turn = system.coordinates(direction[: self.columns, None], shifts)
        return np.asarray(shift)[..., 0], np.asarray(turn)[..., 0]

    def with_series(self, point: CurvePoint, direction: Float[np.ndarray, " unknown"] | None = None) -> CurvePoint:
        """Return a point with its series in a direction, by default that of growing value."""
        rows = point.rows
        jacobian = self.with_jacobian(point).jacobian
        tangent = self.null_space(jacobian[rows], 0.0)[:, -1] if direction is None else direction
        if direction is None and self.driven:
            tangent = tangent if tangent[-1] >= 0 else -tangent
        tangent = tangent[: self.columns]
        for _ in range(2):  # the second pass uses the series of the first
            points = self.points(point, np.zeros(1), tangent)
            point = self.point_at_lane(points, 0, point.arc_length, rows)
        return point

    def scaled_at(self, point: CurvePoint) -> "PathTracker":
        """Return the tracker with the value in a unit that makes its largest derivative one."""
        if not self.driven:
            return self
        largest = float(np.max(np.abs(point.jacobian[:, -1]), initial=0.0))
        return dataclasses.replace(self, value_scale=self.value_scale / largest if largest > 0 else 1.0)

    def point_at_lane(
        self, points: CurvePoints, lane: int, arc_length: float, rows: Int[np.ndarray, " row"]
    ) -> CurvePoint:
        """Return the point in one lane of a batch."""
        coordinates = {name: np.array(c[..., lane]) for name, c in points.coordinates.items()}
        jacobian = np.array(points.jacobian[..., lane])
        if len(jacobian) > len(rows):
            chosen = self.independent(jacobian)
            rows = rows if chosen is None else chosen
        slope = np.array(points.slope[..., lane])
        return CurvePoint(arc_length, coordinates, np.array(points.value[:, lane]), jacobian, slope, rows)

    def points(
        self,
        centers: "CurvePoint | list[CurvePoint]",
        steps: np.ndarray,
        tangent: Any = None,
        *,
        corrected: bool = True,
    ) -> CurvePoints:
        """Return points of the curve at steps from one center, or one step each from several with the same rows."""
        center_list = [centers] if isinstance(centers, CurvePoint) else centers
        rows, count = center_list[0].rows, len(steps)

        def lanes(parts: list[np.ndarray]) -> np.ndarray:
            return padded(np.stack(parts, axis=-1), LANES)

        coordinates = {name: lanes([p.coordinates[name] for p in center_list]) for name in center_list[0].coordinates}
        directions = [self.tangent(p)[: self.columns] for p in center_list] if tangent is None else [tangent]
        direction_lanes = lanes(directions), padded(steps, LANES)
        arrays = coordinates, lanes([p.value for p in center_list]), *direction_lanes, np.asarray(corrected)
        scaled: Any = rows.astype(np.int32), np.asarray(self.value_scale)
        solved = curve_points(self.model.system, *arrays, *scaled, pose_type=self.model.pose_type, driven=self.driven)
        cut = {name: np.asarray(x)[..., :count] for name, x in solved.coordinates.items()}
        others = [np.asarray(x)[..., :count] for x in solved[1:]]
        return CurvePoints(cut, *others)

    # evaluations of series

    def column(self, positions: Numbers, turns: Numbers) -> np.ndarray:
        """Return shifts and rotations of bodies, (components, bodies, ...), as scaled columns without the ground."""
        lengths = self._lengths.reshape(-1, *[1] * (np.ndim(positions) - 1))
        parts = np.concatenate([positions / lengths, turns])[:, 1:]
        return np.moveaxis(parts, 1, 0).reshape(self.columns, *parts.shape[2:])

    def rates(self, coordinates: dict[str, np.ndarray], value: np.ndarray) -> np.ndarray:
        """Return the direction of a curve in all unknowns, (unknowns, ...), from its series."""
        if self.is_planar:
            turns = coordinates["angle"][1][None]
        else:
            turns = spin(coordinates["quaternion"][0], coordinates["quaternion"][1])
        column = self.column(coordinates["position"][1], turns)
        return np.concatenate([column, value[1][None] / self.value_scale]) if self.driven else column

    def tangent(self, point: CurvePoint) -> Float[np.ndarray, " unknown"]:
        """Return the tangent of the curve at a point, of length one in the coordinates."""
        return self.rates(point.coordinates, point.value)

    def _curvature(self, point: CurvePoint) -> Float[np.ndarray, " unknown"]:
        """Return the derivative of the tangent along the curve."""
        second = {name: np.stack([c[0], 2 * c[2]]) for name, c in point.coordinates.items()}
        return self.rates(second, np.stack([point.value[0], 2 * point.value[2]]))

    def difference(self, target: dict[str, np.ndarray], origin: dict[str, np.ndarray]) -> Float[np.ndarray, " column"]:
        """Return scaled shifts and rotations from one configuration to another; whole turns do not count."""
        if self.is_planar:
            turns = principal(target["angle"] - origin["angle"])[None]
        else:
            turns = spin(origin["quaternion"], target["quaternion"])
            turns = turns * np.where(np.sum(origin["quaternion"] * target["quaternion"], axis=0) < 0, -1.0, 1.0)
        return self.column(target["position"] - origin["position"], turns)

    def terms(self, point: CurvePoint) -> Float[np.ndarray, " order"]:
        """Return the size of each coefficient from order one on, rad or sizes of the mechanism."""
        scaled = point.coordinates["position"][1:] / self._lengths
        attitude = point.coordinates["angle" if self.is_planar else "quaternion"][1:]
        sizes = [np.abs(x).reshape(len(x), -1).max(axis=1) for x in (scaled, attitude)]
        largest = np.maximum(*sizes)
        return np.where(np.isfinite(largest), largest, np.inf)

    def radius(self, point: CurvePoint, highest: int = ORDER) -> float:
        """Return an estimate of the radius of convergence, at most one, from coefficients up to an order."""
        terms = np.maximum(self.terms(point)[1:highest], 1.0)
        return float(np.min(terms ** (-1.0 / np.arange(2, highest + 1))))

    def bordered(self, jacobian: np.ndarray, rates: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Return the independent rows and the row of arc length below, (..., unknowns, unknowns); lanes first."""
        border = rates.copy()
        border[..., self.columns :] = 0.0
        return np.concatenate([jacobian[..., rows, :], border[..., None, :]], axis=-2)

    def signs(self, points: CurvePoints, rows: np.ndarray) -> Float[np.ndarray, " lane"]:
        """Return the signs of the determinants of the bordered Jacobians of points."""
        rates = np.moveaxis(self.rates(points.coordinates, points.value), -1, 0)
        matrices = self.bordered(np.moveaxis(points.jacobian, -1, 0), rates, rows)
        return np.linalg.slogdet(np.where(np.isfinite(matrices), matrices, 0.0))[0]

    def singularity_distance(self, point: CurvePoint) -> complex:
        """Return the arc length to the nearest point with a singular bordered Jacobian; it may be complex.

        As for motions in time (see `det_rate`), it is minus the inverse of the largest eigenvalue of ``B^-1 B'``.
        """
        matrix = self.bordered(point.jacobian, self.tangent(point), point.rows)
        slope = self.bordered(point.slope, self._curvature(point), point.rows)
        try:
            values = np.linalg.eigvals(np.linalg.solve(matrix, slope))
        except np.linalg.LinAlgError:
            return 0j
        largest = values[np.argmax(np.abs(values))]
        return complex(-1 / largest) if abs(largest) > 0 else complex(np.inf)

    # rank

    def independent(self, jacobian: Float[np.ndarray, "row unknown"]) -> Int[np.ndarray, " independent"] | None:
        """Return independent rows, one fewer than unknowns, by pivoted QR; None if there are fewer rows."""
        rank = self.unknowns - 1
        if len(jacobian) == rank:
            return np.arange(rank)
        if len(jacobian) < rank:
            return None
        from scipy.linalg import qr  # imported late, as importing SciPy takes half a second

        order = np.asarray(qr(jacobian.T, mode="r", pivoting=True)[-1])
        return np.sort(order[:rank])

    def null_space(
        self, jacobian: Float[np.ndarray, "row unknown"], tolerance: float = RANK_TOLERANCE
    ) -> Float[np.ndarray, "unknown k"]:
        """Return an orthonormal basis of the null space of the rows."""
        _, sizes, right = np.linalg.svd(jacobian)
        return right[_rank(sizes, tolerance) :].T

    def left_null_space(
        self, jacobian: Float[np.ndarray, "row unknown"], tolerance: float = RANK_TOLERANCE
    ) -> Float[np.ndarray, "row k"]:
        """Return an orthonormal basis of the vanishing combinations of rows."""
        left, sizes, _ = np.linalg.svd(jacobian)
        return left[:, _rank(sizes, tolerance) :]

    def second_order(self, point: CurvePoint, directions: Float[np.ndarray, "unknown k"]) -> Float[np.ndarray, "row k"]:
        """Return half the second derivatives of the residual along directions."""
        coordinates = {name: c[0][..., None] for name, c in point.coordinates.items()}
        scale, value = np.asarray(self.value_scale if self.driven else 0.0), np.asarray(point.value[0])
        padded_directions = np.pad(directions, ((0, self.columns + 1 - self.unknowns), (0, 0)))

        def of_lanes(lanes: Int[np.ndarray, " lane"]) -> Any:
            arguments = self.model.system, coordinates, value, padded_directions[:, lanes], scale
            return second_order(*arguments, pose_type=self.model.pose_type)

        return in_chunks(of_lanes, padded_directions.shape[1], (LANES,), threads=1)


def _rank(sizes: Float[np.ndarray, " k"], tolerance: float) -> int:
    return int(np.sum(sizes > tolerance * sizes.max(initial=0.0)))


def spin(quaternion: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return twice the vector part of the product of conjugate Euler parameters with other ones."""
    return 2.0 * quaternion_product(conjugate(quaternion), other)[1:]


def all_finite(points: CurvePoints) -> Bool[np.ndarray, " lane"]:
    """Return which points, and the series of the curve there, are finite."""
    parts = (*points.coordinates.values(), points.value)
    return np.all([np.isfinite(x).reshape(-1, x.shape[-1]).all(axis=0) for x in parts], axis=0)


def with_angular_velocity(coordinates: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return series of coordinates with the body-fixed angular velocity from their Euler parameters."""
    if "quaternion" not in coordinates:
        return coordinates
    p = coordinates["quaternion"]
    rates = p[1:] * np.arange(1, len(p)).reshape(-1, *[1] * (p.ndim - 1))
    terms = [sum((spin(p[j], rates[k - j]) for j in range(k + 1)), np.zeros_like(p[0, 1:])) for k in range(len(rates))]
    return {**coordinates, "angular_velocity": np.array(terms).reshape(len(rates), *p[0, 1:].shape)}
