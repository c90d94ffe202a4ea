"""Slopes of acceleration energies, ``dE_p^(n) / dq^(m)``, in closed form: the terms of Negrean 2025, 126-134.

The n-th rate of an energy is ``1/2 sum_l C(n, l) integral r^(p+1+l) . r^(p+1+n-l) dm``. The partial derivative of a
derivative of a point is ``dr^(s) / dq^(m) = C(s, m) (dr/dq)^(s-m)`` (Negrean 2025, 50-54). So

    dE_p^(n) / dq^(m) = sum_l C(n, l) C(p+1+l, m) integral r^(p+1+n-l) . (dr/dq)^(p+1+l-m) dm,

products of derivatives of the points and of the columns of the Jacobian, whose orders add up to the same number in all
terms. A sum of slopes and their rates is therefore one row of weights of such products: exact fractions that are added
up before anything is evaluated. All of the paper's forms of the equations of motion are such a sum.
"""

import math
from fractions import Fraction
from typing import Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.dynamics.energy.energies import axes_of
from jounce.jet import Jet, cross, dot
from jounce.jet.algebra import stacked, total
from jounce.rigid import PlanarPose
from jounce.rigid.frames import Frames
from jounce.rigid.pose import Pose

Weights = tuple[dict[int, Fraction], ...]
"""For each rate of a form, by the order of the column of the Jacobian, the weights of products of plain derivatives."""


class Slope(NamedTuple):
    """A rate in time of ``dE_p^(n) / dq^(m)``, times a factor: a term of a form of the equations of motion."""

    p: int
    n: int
    m: int
    rate: int = 0
    factor: Fraction = Fraction(1)

    @property
    def orders(self) -> int:
        """The sum of the orders of point and column."""
        return 2 * self.p + 2 + self.n - self.m + self.rate


class Form(NamedTuple):
    """A sum of slopes that have the same sum of orders, with its rates."""

    slopes: tuple[Slope, ...]
    levels: int  # the value and its rates

    @property
    def orders(self) -> int:
        """The sum of the orders of point and column in each product of the value."""
        return max(0, self.slopes[0].orders)

    @property
    def weights(self) -> Weights:
        """Weights of ``integral r^(orders + level - b) . (dr/dq)^(b) dm`` by b, for the value and each rate."""
        weights: dict[int, Fraction] = {}
        for slope in self.slopes:
            terms = _terms(slope)
            for _ in range(slope.rate):
                terms = _rate(terms)
            for b, weight in terms.items():
                weights[b] = weights.get(b, Fraction(0)) + slope.factor * weight
        levels = [{b: weight for b, weight in weights.items() if weight}]
        for _ in range(self.levels - 1):
            levels.append(_rate(levels[-1]))
        return tuple(levels)

    @property
    def order(self) -> int:
        """Highest derivative of the points, and so of the coordinates, that enters."""
        pairs = [(b, level) for level, row in enumerate(self.weights) for b in row]
        return max((max(b, self.orders + level - b) for b, level in pairs), default=0)

    @property
    def column_order(self) -> int:
        """Highest derivative of the columns of the Jacobian that enters."""
        return max((b for row in self.weights for b in row), default=0)


def _terms(slope: Slope) -> dict[int, Fraction]:
    p, n, m = slope.p, slope.n, slope.m
    rows = ((p + 1 + row, math.comb(n, row)) for row in range(n + 1))
    return {s - m: Fraction(count * math.comb(s, m)) for s, count in rows if s >= m}


def _rate(terms: dict[int, Fraction]) -> dict[int, Fraction]:
    """Return the weights of the time derivative, by the product rule."""
    rates: dict[int, Fraction] = {}
    for b, weight in terms.items():
        for order in (b, b + 1):
            rates[order] = rates.get(order, Fraction(0)) + weight
    return rates


class Columns(NamedTuple):
    """Columns of the body Jacobian: jets of velocities and angular velocities for a unit rate of a coordinate.

    Both have shape (components, coordinates, bodies, batch). Velocities are those of the centers of mass, in base
    axes; in the plane the angular velocity has one component.
    """

    linear: Jet
    angular: Jet


def column_of(pose: Any, change: Any, center: Any, order: int) -> tuple[Any, Any]:
    """Return the columns of the body Jacobian for a change of the pose, (levels, components, bodies, batch)."""
    linear = change.point(center).truncate(order)
    if isinstance(pose, PlanarPose):
        return stacked(linear), stacked(change.angle.truncate(order)[None])
    turns = (cross(axis.truncate(order), axis_change) for axis, axis_change in zip(pose.axes, change.axes, strict=True))
    return stacked(linear), stacked(total(turns) * 0.5)


def slope_values(
    form: Form, pose: Pose | Frames, columns: Columns, mass: Any, center: Any, moments: Any
) -> Float[Numbers, "level coordinate batch"]:
    """Return a sum of slopes of the energies of rigid bodies, and its rates.

    Parameters
    ----------
    form : Form
        The sum.
    pose : SpatialPose, PlanarPose or Frames
        Poses of the bodies, as jets to `form.order`.
    columns : Columns
        Jets to `form.column_order`.
    mass, center, moments
        As for `body_energy`.

    Returns
    -------
    array of shape (levels, coordinates, batch)
        Taylor coefficients.
    """
    points = pose.point(center).dense().coefficients
    axes = zip(*(axis.dense().coefficients for axis in axes_of(pose)), strict=True)
    products = _Products([jnp.stack(rows, axis=1) for rows in axes], moments)
    linear, angular = (column.dense().coefficients for column in columns)
    values = []
    for level, row in enumerate(form.weights):
        sums = [jnp.zeros((linear[0].shape[1], linear[0].shape[-1]))]
        orders = form.orders + level
        weights = {b: _of_coefficients(weight, orders - b, b, level) for b, weight in row.items()}
        for b, weight in weights.items():
            sums.append(_along(linear[b], points[orders - b] * (mass[None] * weight)))
        for s in range(max(weights, default=-1) + 1):
            pairs = [(b - s, orders - b, weight) for b, weight in weights.items() if b >= s]
            moment = [products.of(i, k) * weight for i, k, weight in pairs if i != k]  # a cross a is zero
            if moment:
                sums.append(_along(angular[s], total(moment)))
        values.append(total(sums))
    return jnp.stack(values)


def _of_coefficients(weight: Fraction, a: int, b: int, level: int) -> float:
    """Return the weight of Taylor coefficients a and b from that of plain derivatives, for the derivative `level`."""
    return float(weight * math.factorial(a) * math.factorial(b) / math.factorial(level))


def _along(columns: Float[Numbers, "component coordinate body batch"], vectors: Any) -> Any:
    """Return the dot products of columns and body vectors, summed over the bodies."""
    return jnp.sum(dot(columns, vectors[:, None]), axis=1)


class _Products:
    """Products ``sum S_ik a_i x a_k`` of coefficients of body axes, each computed once."""

    def __init__(self, axes: list[Float[Numbers, "component axis body batch"]], moments: Any):
        self.axes = axes
        self.moments = moments
        self.known: dict[tuple[int, int], Any] = {}

    def of(self, first: int, second: int) -> Any:
        """Return the antisymmetric product of two coefficients, (components, bodies, batch)."""
        if first > second:
            return -self.of(second, first)
        if (first, second) not in self.known:
            weighted = total(
                self.moments[:, k][None] * self.axes[second][:, k : k + 1] for k in range(len(self.moments))
            )
            product = cross(self.axes[first], weighted)
            product = product if len(weighted) == 3 else product[None]  # in the plane, one component
            self.known[first, second] = jnp.sum(product, axis=1)
        return self.known[first, second]
