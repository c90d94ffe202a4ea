"""A design problem in numbers: goals and slopes from one solution of a design; a design that locks is an error."""

import dataclasses
from collections.abc import Mapping
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from jounce.base.modules import with_fields
from jounce.design.objectives.objectives import Goals
from jounce.dynamics.motion_values import cut, pose_of
from jounce.errors import AssemblyError, MobilityError, SolveError
from jounce.jet import Jet
from jounce.kinematics import Status, solve
from jounce.mechanism import Mechanism
from jounce.mechanism.system import System

ON_BOUND = 1e-12  # fraction of the distance between bounds: a point nearer to a bound is on it
LOCKS = (AssemblyError, MobilityError, SolveError)


class Locked(Exception):  # noqa: N818 - not an error of the user
    """Raised if a design cannot be assembled, or locks."""

    def __init__(self, point: Float[np.ndarray, " parameter"], error: Exception):
        super().__init__(str(error))
        self.point, self.error = point, error


@dataclasses.dataclass(frozen=True, eq=False)
class Evaluation:
    """The measures of a design, with their slopes by its parameters.

    Attributes
    ----------
    point : array of shape (parameters,)
        Parameters, scaled from 0 to 1 between the bounds.
    rows, smooth : array
        Measures from `Goals.measured`, with all rows in one array.
    row_slopes, smooth_slopes : array of shape (rows, parameters), (measures, parameters)
        Slopes by the point.
    margins : array of shape (time,)
        Squares of the smallest singular values of the scaled Jacobian.
    margin_slopes : array of shape (time, parameters)
    """

    point: Float[np.ndarray, " parameter"]
    rows: Float[np.ndarray, " row"]
    smooth: Float[np.ndarray, " measure"]
    row_slopes: Float[np.ndarray, "row parameter"]
    smooth_slopes: Float[np.ndarray, "measure parameter"]
    margins: Float[np.ndarray, " time"]
    margin_slopes: Float[np.ndarray, "time parameter"]


class Problem:
    """Goals as functions of the point of a design between its bounds.

    Parameters
    ----------
    goals : Goals
    bounds : dict of str to (low, high)
        Bounds of the parameters that vary, SI.

    Attributes
    ----------
    names : tuple of str
    low, high, width : array of shape (parameters,)
    owner : array of int of shape (rows,)
        Extreme of each row of the last evaluation.
    evaluations : int
        Number of designs solved.
    """

    def __init__(self, goals: Goals, bounds: Mapping[str, tuple[float, float]]):
        self.goals, self.names = goals, tuple(bounds)
        self.low, self.high = (np.array([pair[k] for pair in bounds.values()]) for k in (0, 1))
        self.width = self.high - self.low
        self.evaluations = 0
        self.owner = np.zeros(0, int)
        self._cached: dict[bytes, Evaluation] = {}
        self._scale: np.ndarray | None = None
        self._compile()

    def _compile(self) -> None:
        """Create the compiled functions of measures and goals for the grid of the goals."""
        self._cached.clear()
        # new functions, as JAX treats a method as the same function even if its object has changed
        self._measured = jax.jit(lambda *arguments: self._with_slopes(*arguments))
        self._numbers = jax.jit(lambda *arguments: self._goals_with_slopes(*arguments))
        self._each = jax.jit(jax.vmap(self._one_design))

    def set_instants(self, instants: Float[np.ndarray, " time"]) -> None:
        """Replace the grid of instants."""
        self.goals.set_instants(instants)
        self._compile()

    def values(self, point: Float[np.ndarray, " parameter"]) -> dict[str, float]:
        """Return the parameters at a point, SI; parameters on a bound have its exact value."""
        parameters = np.where(point >= 1.0 - ON_BOUND, self.high, self.low + self.width * point)
        parameters = np.where(point <= ON_BOUND, self.low, parameters)
        return dict(zip(self.names, parameters.tolist(), strict=True))

    def point_of(self, values: Mapping[str, float]) -> Float[np.ndarray, " parameter"]:
        """Return the point of parameters, from 0 to 1 between their bounds."""
        numbers = np.array([values[name] for name in self.names])
        return np.clip((numbers - self.low) / self.width, 0.0, 1.0)

    def design(self, point: Float[np.ndarray, " parameter"]) -> Mechanism:
        """Return the mechanism at a point, with the outputs for the goals."""
        return self.goals.mechanism.with_parameters(**self.values(point))

    def evaluate(self, point: Float[np.ndarray, " parameter"]) -> Evaluation:
        """Return the measures of a design and their slopes.

        Raises
        ------
        Locked
            If the design cannot be assembled, or locks.
        """
        key = point.tobytes()
        if key not in self._cached:
            if len(self._cached) > 64:
                self._cached.clear()
            self._cached[key] = self._evaluated(point)
        return self._cached[key]

    def _evaluated(self, point: Float[np.ndarray, " parameter"]) -> Evaluation:
        self.evaluations += 1
        values = jnp.asarray(list(self.values(point).values()))

        def motion_values(values: Any) -> Any:
            parameters = dict(zip(self.names, values, strict=True))
            goals = self.goals
            motion = solve(goals.mechanism.with_parameters(**parameters), goals.instants, goals.order, strict=False)
            pose_type, coordinates = motion.poses
            matrix = _jacobian(
                _bare(motion.solved_model.system), cut(coordinates, 0), jnp.asarray(motion.time), pose_type=pose_type
            )
            result = dict(motion.outputs), matrix
            return result, (*result, motion.status)

        try:
            slopes, (outputs, matrix, status) = jax.jacfwd(motion_values, has_aux=True)(values)
        except LOCKS as error:
            raise Locked(point, error) from None
        if (failures := np.flatnonzero(np.asarray(status))).size:
            outcome = Status(int(status[failures[0]]))
            message = f"at t = {self.goals.instants[failures[0]]:g} s {outcome.advice}"
            raise Locked(point, SolveError(message, status=outcome))
        if not all(np.isfinite(x).all() for x in jax.tree.leaves(outputs)):
            self._check_friction(point)  # friction may lock in the whole motion
        output_slopes, matrix_slopes = jax.tree.map(lambda x: jnp.moveaxis(x, -1, 0) * _along(self.width, x), slopes)
        (rows, smooth), (row_slopes, smooth_slopes) = self._measured(values, outputs, output_slopes)
        if not all(np.isfinite(x).all() for x in (*rows, smooth, *row_slopes, smooth_slopes)):
            raise Locked(point, SolveError(Status.UNDEFINED.advice, status=Status.UNDEFINED))
        self.owner = np.repeat(np.arange(len(rows)), [len(x) for x in rows])
        margins, margin_slopes = _margins(np.asarray(matrix), np.asarray(matrix_slopes), self._row_scale(matrix))
        empty = np.zeros(0), np.zeros((0, len(point)))
        return Evaluation(
            np.array(point),
            np.concatenate([*map(np.asarray, rows), empty[0]]),
            np.asarray(smooth),
            np.concatenate([*(np.asarray(x).T for x in row_slopes), empty[1]]),
            np.asarray(smooth_slopes).T,
            margins,
            margin_slopes,
        )

    def _check_friction(self, point: Float[np.ndarray, " parameter"]) -> None:
        """Raise Locked if friction locks the design, which outputs with slopes do not show."""
        motion = solve(self.design(point), self.goals.instants, self.goals.order, strict=False)
        try:
            dict(motion.outputs.items())
        except SolveError as error:
            raise Locked(point, error) from None

    def _row_scale(self, matrix: Any) -> Float[np.ndarray, " row"]:
        """Return constant factors that scale the largest entry of each row to one in the first design."""
        if self._scale is None:
            sizes = np.abs(np.asarray(matrix)).max(axis=(1, 2), initial=0.0)
            self._scale = 1.0 / np.where(sizes > 0, sizes, 1.0)
        return self._scale

    def extremes(self, evaluation: Evaluation) -> tuple[Float[np.ndarray, " extreme"], Int[np.ndarray, " extreme"]]:
        """Return the extremes of a design, and the row of each."""
        count = len(self.goals.bounded)
        values, chosen = np.zeros(count), np.zeros(count, int)
        for k in range(count):
            (rows,) = np.nonzero(self.owner == k)
            chosen[k] = rows[np.argmax(evaluation.rows[rows])]
            values[k] = evaluation.rows[chosen[k]]
        return values, chosen

    def numbers(self, point: Any, extremes: Any, smooth: Any) -> tuple[np.ndarray, list[np.ndarray]]:
        """Return the objective and conditions, and their slopes by parameters, extremes and smooth measures."""
        values = jnp.asarray(list(self.values(point).values()))
        goals, slopes = self._numbers(values, jnp.asarray(extremes), jnp.asarray(smooth))
        by_parameter, *other_slopes = (np.asarray(x) for x in slopes)
        return np.asarray(goals), [by_parameter * self.width, *other_slopes]

    def stated(self, point: Any, evaluation: Evaluation) -> tuple[float, np.ndarray, list[tuple[float, float]]]:
        """Return the objective as stated by the user, the conditions as numbers, and both sides of each condition."""
        values, smooth = self.values(point), jnp.asarray(evaluation.smooth)
        extremes = jnp.asarray(self.extremes(evaluation)[0])
        numbers = np.asarray(self.goals.numbers(values, extremes, smooth, as_stated=True))
        return float(numbers[0]), numbers[1:], self.goals.sides(values, extremes, smooth)

    def sampled(self, rows: Any, outputs: Mapping[str, Any]) -> Float[np.ndarray, "design goal"]:
        """Return the objective and conditions of many designs from their outputs, design first."""
        return np.asarray(self._each(jnp.asarray(rows), {name: jnp.asarray(x) for name, x in outputs.items()}))

    def _one_design(self, values: Any, outputs: Any) -> Any:
        parameters = dict(zip(self.names, values, strict=True))
        rows, smooth = self.goals.measured(parameters, outputs)
        extremes = jnp.stack([jnp.max(x) for x in rows]) if rows else jnp.zeros(0)
        return self.goals.numbers(parameters, extremes, smooth)

    def _with_slopes(self, values: Any, outputs: Any, output_slopes: Any) -> Any:
        def measures(values: Any, outputs: Any) -> Any:
            return self.goals.measured(dict(zip(self.names, values, strict=True)), outputs)

        def slope_along(direction: Any, change: Any) -> Any:
            return jax.jvp(measures, (values, outputs), (direction, change))[1]

        return measures(values, outputs), jax.vmap(slope_along)(jnp.diag(jnp.asarray(self.width)), output_slopes)

    def _goals_with_slopes(self, values: Any, extremes: Any, smooth: Any) -> Any:
        def numbers(values: Any, extremes: Any, smooth: Any) -> Any:
            return self.goals.numbers(dict(zip(self.names, values, strict=True)), extremes, smooth)

        slopes = jax.jacrev(numbers, argnums=(0, 1, 2))(values, extremes, smooth)
        return numbers(values, extremes, smooth), slopes


def _along(width: Float[np.ndarray, " parameter"], like: Any) -> Any:
    return jnp.asarray(width).reshape(-1, *[1] * (like.ndim - 1))


def _bare(system: System) -> System:
    """Return a system without forces and outputs, which the Jacobian does not need."""
    return with_fields(system, forces=(), outputs=())


@partial(jax.jit, static_argnames=("pose_type",))
def _jacobian(system: System, coordinates: Any, instants: Any, *, pose_type: type) -> Float[Any, "row column time"]:
    """Return the Jacobian at all instants, with columns scaled by the size of the mechanism and unscaled rows."""
    return system.jacobian(pose_of(coordinates, pose_type), Jet((instants[None],)))


def _margins(
    matrix: Float[np.ndarray, "row column time"],
    slopes: Float[np.ndarray, "parameter row column time"],
    scale: Float[np.ndarray, " row"],
) -> tuple[Float[np.ndarray, " time"], Float[np.ndarray, "time parameter"]]:
    """Return the squares of the smallest singular values, smooth up to locking designs, and their slopes."""
    left, values, right = np.linalg.svd(np.moveaxis(matrix * scale[:, None, None], -1, 0))
    smallest = values[:, -1]
    u, v = left[:, :, -1] * scale, right[:, -1]
    return smallest**2, 2 * smallest[:, None] * np.einsum("tr,prct,tc->tp", u, slopes, v)
