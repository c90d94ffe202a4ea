"""One compiled function from points of a curve of configurations to others, each with the series of the curve.

The unknowns are the coordinates of all bodies and the free value of one driver; the parameter is the arc length s. As
in time, each coefficient of the residual is affine in the highest unknown, order after order (Sommer 2024, equations
1-8). The arc-length condition ``x'.x' = 1`` is one more row of the same kind.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.base.shapes import Numbers
from jounce.execution.compilation import compiled
from jounce.jet import Jet
from jounce.jet.coefficients import padded_series
from jounce.jet.programs.series import Recursion
from jounce.linear_algebra.linear import DenseFactor
from jounce.mechanism.building.starting_guess import pose_at
from jounce.mechanism.system import System
from jounce.rigid import PlanarPose
from jounce.rigid.pose import Pose
from jounce.rigid.spatial import quaternion_change

MAX_CORRECTIONS = 10
ROUNDING = 4e-15  # after such a small correction, the Jacobian needs no update
QUADRATIC = 1e-8  # after a correction of this size, the next one is rounding

Lanes = Float[Numbers, " lane"]


class CurvePoints(NamedTuple):
    """Points on a curve of configurations; every array has the lanes last.

    Attributes
    ----------
    coordinates : dict of str to array, shape (order + 1, ..., bodies, lanes)
        Taylor coefficients in arc length of the coordinates of all bodies, the ground first.
    value : array of shape (order + 1, lanes)
        Taylor coefficients of the free value of the driver.
    jacobian : array of shape (rows, columns, lanes)
        Scaled Jacobian of all constraints; the last column is that of the value, if a driver is free.
    slope : array of shape (rows, columns, lanes)
        Derivative of the Jacobian along the series that led to the point.
    first, last : array of shape (lanes,)
        Sizes of the first and the last correction, rad or sizes of the mechanism.
    residual : array of shape (lanes,)
        Largest residual of all rows.
    admissible : array of bool, shape (lanes,)
        Whether all drivers have permitted values.
    """

    coordinates: dict[str, Any]
    value: Any
    jacobian: Any
    slope: Any
    first: Lanes
    last: Lanes
    residual: Lanes
    admissible: Bool[Numbers, " lane"]


class _Curve:
    """The equations of a curve: those of a system with a driver value in place of time."""

    def __init__(self, system: System, rows: Any, value_scale: Any, driven: bool):
        self.system, self.rows, self.value_scale, self.driven = system, rows, value_scale, driven
        self.count = system.shape[1]

    def residual(self, pose: Any, value: Any) -> Any:
        return self.system.residual(pose, Jet([value[None]])).coefficients[0]

    def jacobian(self, pose: Any, value: Any) -> Any:
        """Return the scaled Jacobian, (rows, columns, lanes), with the column of the value last."""
        entries = self.system.jacobian(pose, Jet([value[None]]))
        if not self.driven:
            return entries
        extended = pose.extended(None, None)
        rate = self.system.residual(extended, Jet([value[None], jnp.ones_like(value)[None]])).dense().coefficients[1]
        return jnp.concatenate([entries, (rate * self.value_scale)[:, None]], axis=1)

    def bordered(self, jacobian: Any, tangent: Any) -> Any:
        """Return the factors of the Jacobian bordered by the row of arc length."""
        border = jnp.zeros((1, *jacobian.shape[1:])).at[0, : self.count].set(tangent)
        return DenseFactor.of(jnp.concatenate([jacobian[self.rows], border]))

    def moved(self, pose: Any, value: Any, step: Any) -> Any:
        shift, turn = self.system.coordinates(step[: self.count], pose.shifts)
        value = value + self.value_scale * step[-1] if self.driven else value
        return pose.displaced(shift, turn), value


@compiled("pose_type", "driven")
def curve_points(
    system: System,
    coordinates: dict[str, Numbers],
    value: Float[Numbers, "order lane"],
    tangent: Float[Numbers, "column lane"],
    step: Lanes,
    corrected: Bool[Numbers, ""],
    rows: Int[Numbers, " independent"],
    value_scale: Float[Numbers, ""],
    *,
    pose_type: type[Pose],
    driven: bool,
) -> CurvePoints:
    """Return points of a curve, each from the series at a previous point.

    Parameters
    ----------
    system : System
        The mechanism, with the driver value in place of time.
    coordinates, value
        Series at the previous points, shape (order + 1, ..., lanes).
    tangent : array of shape (columns, lanes)
        Scaled directions of the curve at the previous points, coordinates only; corrections are perpendicular to them.
    step : array of shape (lanes,)
        Arc length from the previous points.
    corrected : bool
        Whether to correct predictions; at a change point they must not be corrected.
    rows : array of int
        Independent rows, one fewer than unknowns.
    value_scale : float
        Scale of the value as an unknown.
    pose_type, driven
        PlanarPose or SpatialPose; whether a driver is free.
    """
    curve = _Curve(system, rows, value_scale, driven)
    series = {name: Jet(tuple(c)) for name, c in coordinates.items()}
    pose = pose_type.predicted_from(series, step)
    end_value = Jet(tuple(value)).evaluate(step)
    pose, end_value, (first, last) = _corrected(curve, pose, end_value, tangent, corrected)
    jacobian = curve.jacobian(pose, end_value)
    factor = curve.bordered(jacobian, tangent)
    value_rate = Jet(tuple(value)).differentiate().evaluate(step)
    solved, value = _differentiated(curve, pose, end_value, factor, len(value) - 1)
    rates = {name: jet.differentiate().evaluate(step) for name, jet in series.items()}
    slope = _slope(curve, pose, end_value, rates, value_rate)
    residual = jnp.max(jnp.abs(curve.residual(pose.truncate(0), end_value)), axis=0, initial=0.0)
    admissible = jnp.all(system.admissible(Jet([end_value[None]])), axis=0)
    return CurvePoints(solved, value, jacobian, slope, first, last, residual, admissible)


def _corrected(curve: _Curve, pose: Any, value: Any, tangent: Any, corrected: Any) -> Any:
    """Return pose and value corrected onto the curve, perpendicular to the tangent, and the sizes of corrections."""
    none = jnp.zeros((1, value.shape[0]))

    def unfinished(state: Any) -> Any:
        _, _, (_, last), before, count = state
        converged = (last <= ROUNDING) | (before <= QUADRATIC)
        return corrected & jnp.any(~converged & (jnp.isfinite(last) | (count == 0))) & (count < MAX_CORRECTIONS)

    def iterate(state: Any) -> Any:
        pose, value, (first, last), _, count = state
        rhs = jnp.concatenate([-curve.residual(pose, value)[curve.rows], none])
        step = curve.bordered(curve.jacobian(pose, value), tangent).solve(rhs, refined=False)
        size = jnp.max(jnp.abs(step), axis=0)
        pose, value = curve.moved(pose, value, step)
        return pose, value, (jnp.where(count == 0, size, first), size), last, count + 1

    infinite = np.full(value.shape[0], np.inf)
    pose, value, sizes, *_ = jax.lax.while_loop(unfinished, iterate, (pose, value, (infinite, infinite), infinite, 0))
    return pose, value, sizes


def _differentiated(curve: _Curve, pose: Any, value: Any, factor: DenseFactor, order: int) -> Any:
    """Return the series of the coordinates in arc length, by name, and of the value."""
    count, lanes, shifts = curve.count, value.shape[0], pose.shifts
    null = factor.solve(jnp.zeros((curve.rows.shape[0] + 1, lanes)).at[-1].set(1.0))
    null = null / jnp.sqrt(jnp.sum(null[:count] ** 2, axis=0, keepdims=True))
    tangent, planar = null[:count], isinstance(pose, PlanarPose)
    point = pose.position.coefficients[0]
    attitude = (pose.angle if planar else pose.quaternion).coefficients[0]

    def program(point: Any, attitude: Any, value: Any) -> Any:
        return curve.system.residual(pose.at_unit(point, attitude), Jet([value[None]])).coefficients[0]

    def parts(solution: Any) -> Any:
        shift, turn = curve.system.coordinates(solution[:count], shifts)
        return shift, turn, curve.value_scale * solution[-1] if curve.driven else jnp.zeros(lanes)

    def spun(turn: Any) -> Any:
        return turn[0] if planar else quaternion_change(attitude, turn)

    shift, turn, rate = parts(null)
    recursion = Recursion(program, (point, attitude, value), order)
    _, newest = recursion.advanced(recursion.history, 1, (shift, spun(turn), rate))
    history = recursion.noted(recursion.history, 1, newest)
    series = tuple(padded_series([x, y], order + 1) for x, y in ((point, shift), (attitude, spun(turn)), (value, rate)))
    turns, rates = padded_series([turn], order), padded_series([tangent], order)

    def level(k: Any, carry: Any) -> Any:
        history, series, turns, rates = carry
        trial = None if planar else _known_spin(series[1], turns, k)
        residual, newest = recursion.advanced(history, k, (None, trial, None))
        rhs = jnp.concatenate([-residual[curve.rows], jnp.zeros((1, lanes))])
        solution = factor.solve(rhs)
        # x'[j] = (j + 1) x[j + 1], and the coefficient of order k - 1 of x'.x' vanishes
        products = jnp.sum(_convolved(rates, rates, k - 1, lambda a, b: jnp.sum(a * b, axis=1)), axis=0)
        deficit = -products / (2 * k) - jnp.sum(tangent * solution[:count], axis=0)
        solution = solution + null * deficit[None]
        shift, turn, rate = parts(solution)
        change = spun(turn)
        history = recursion.noted(history, k, recursion.corrected(newest, (shift, change, rate)))
        newest_terms = shift, change if trial is None else trial + change, rate
        update = jax.lax.dynamic_update_index_in_dim
        series = tuple(update(x, y, k, 0) for x, y in zip(series, newest_terms, strict=True))
        return history, series, update(turns, k * turn, k - 1, 0), update(rates, k * solution[:count], k - 1, 0)

    _, series, _, _ = jax.lax.fori_loop(2, order + 1, level, (history, series, turns, rates))
    name = "angle" if planar else "quaternion"
    return {"position": series[0], name: series[1]}, series[2]


def _known_spin(quaternion: Any, turns: Any, k: Any) -> Any:
    """Return the coefficient of order k of Euler parameters without the contribution of the newest rotation."""
    return jnp.sum(_convolved(quaternion, turns, k - 1, jax.vmap(quaternion_change)), axis=0) / k


def _convolved(left: Any, right: Any, order: Any, product: Any) -> Any:
    """Return the terms of the Cauchy product at an order; unknown coefficients count as zero."""
    counterparts = order - np.arange(len(right))
    left = left[: len(right)]
    valid = (counterparts >= 0).reshape(-1, *[1] * (right.ndim - 1))
    return product(left, jnp.where(valid, jnp.take(right, jnp.clip(counterparts, 0, len(right) - 1), axis=0), 0.0))


def _slope(curve: _Curve, pose: Any, value: Any, rates: dict[str, Any], value_rate: Any) -> Any:
    """Return the derivative of the Jacobian along the series, which is smooth even where branches cross."""
    coordinates = {name: jet.coefficients[0] for name, jet in pose.coordinates().items()}

    def at(step: Any) -> Any:
        displaced = {name: x + step * rates[name] for name, x in coordinates.items()}
        return curve.jacobian(pose_at(displaced, type(pose)), value + step * value_rate)

    return jax.jvp(at, (np.zeros(()),), (np.ones(()),))[1]


@compiled("pose_type")
def second_order(
    system: System,
    coordinates: dict[str, Numbers],
    value: Float[Numbers, ""],
    directions: Float[Numbers, "column lane"],
    value_scale: Float[Numbers, ""],
    *,
    pose_type: type[Pose],
) -> Float[Numbers, "row lane"]:
    """Return half the second derivatives of the residual along directions of all unknowns, the value last.

    The coordinates have the shape (..., bodies, 1).
    """
    lanes = directions.shape[1]
    repeated = {name: jnp.broadcast_to(x, (*x.shape[:-1], lanes)) for name, x in coordinates.items()}
    pose = pose_at(repeated, pose_type)
    pose = pose.extended(*system.coordinates(directions[: system.shape[1]], pose.shifts)).extended(None, None)
    rate = value_scale * directions[-1:]
    time = Jet([jnp.full((1, lanes), value), rate, jnp.zeros((1, lanes))])
    return system.residual(pose, time).dense().coefficients[2]
