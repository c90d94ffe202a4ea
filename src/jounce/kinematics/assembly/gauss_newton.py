"""Assembly of the bodies at one instant from a starting guess, by damped Gauss-Newton on the host."""

from functools import cached_property
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.base.modules import with_fields
from jounce.base.shapes import Numbers
from jounce.execution.compilation import compiled
from jounce.jet import Jet
from jounce.kinematics.assembly.initial_revolutions import Coordinates, Displaced, DriverLag
from jounce.linear_algebra.host_jacobian import HostJacobian
from jounce.linear_algebra.linear import DenseFactor
from jounce.mechanism import Model
from jounce.mechanism.building.starting_guess import pose_at
from jounce.mechanism.system import System
from jounce.rigid.pose import Pose

MAX_STEPS = 100
NEXT_STEP = 1e-3  # of the tolerance: a step predicted to be shorter, as residuals fall, is skipped
LONGEST_STEP = 0.5  # rad, or sizes of the mechanism
REGULAR = 1e-4  # ratio of smallest to largest pivot above which a matrix is inverted rather than decomposed


class _NewtonState(NamedTuple):
    """State of the Newton-Raphson iteration between two steps, for one instant."""

    coordinates: dict[str, Numbers]
    increment: Float[Numbers, " column"]  # of the next step
    first_residual: Float[Numbers, " row"]  # residual at the first position
    residual: Float[Numbers, " row"]
    entries: Float[Numbers, " entry"]
    row_scale: Float[Numbers, " row"]
    size: Float[Numbers, ""]  # of the increment
    closed: Bool[Numbers, ""]
    left: Int[Numbers, ""]  # steps that may follow; none if negative


@compiled("pose_type", narrow=True, brief=True)
def _moved(
    system: System,
    coordinates: dict[str, Numbers],
    increment: Float[Numbers, " column"],
    instant: Float[Numbers, ""],
    steps: Int[Numbers, ""],
    tolerance: Float[Numbers, ""],
    pose_type: type[Pose],
) -> Any:
    """Return the coordinates after an increment, with residual and entries of the Jacobian.

    If the pattern makes a square Jacobian dense, Newton-Raphson steps may follow, as long as they equal those of
    `assemble_from_guess`: short steps from regular positions with falling residuals. The result then also has the
    residual before them, and whether they closed all gaps.
    """
    time = Jet([instant[None, None]])

    def evaluated(coordinates: dict[str, Numbers], increment: Float[Numbers, " column"]) -> Any:
        pose = pose_at(coordinates, pose_type)
        pose = pose.displaced(*system.coordinates(increment[:, None], pose.shifts))
        moved = {name: jet.coefficients[0] for name, jet in pose.coordinates().items()}
        return moved, system.residual(pose, time).coefficients[0][:, 0], system.entries(pose, time)[:, 0]

    def newton_step(state: _NewtonState) -> _NewtonState:
        moved, residual, entries = evaluated(state.coordinates, state.increment)
        before, now = (jnp.sqrt(jnp.sum((state.row_scale * x) ** 2)) for x in (state.residual, residual))
        first, small = state.left == steps, state.size <= tolerance
        falls = first | small | (now < before)
        closed = ~first & falls & (small | (state.size * now <= NEXT_STEP * tolerance * before))
        matrix = system.pattern.dense(entries[:, None])
        row_scale = 1 / jnp.max(jnp.abs(matrix), axis=(1, 2))
        factor = DenseFactor.of(row_scale[:, None, None] * matrix)
        step = factor.solve(-(row_scale * residual)[:, None])[:, 0]
        size = jnp.max(jnp.abs(step))
        goes_on = falls & (size <= LONGEST_STEP) & (factor.pivot_ratio()[0] >= REGULAR)
        left = jnp.where(goes_on, state.left - 1, -1)
        first_residual = jnp.where(first, residual, state.first_residual)
        return _NewtonState(moved, step, first_residual, residual, entries, row_scale, size, closed, left)

    if system.pattern is None:
        return evaluated(coordinates, increment)
    rows, entries = np.zeros(system.shape[0]), np.zeros(system.pattern.entry_count)
    start = _NewtonState(coordinates, increment, rows, rows, entries, rows, np.zeros(()), np.zeros((), bool), steps)
    end = jax.lax.while_loop(
        lambda state: ~state.closed & (state.left >= 0), newton_step, jax.tree.map(jnp.asarray, start)
    )
    return end.coordinates, end.residual, end.entries, end.first_residual, end.closed


class AssemblyAttempt(NamedTuple):
    """The outcome of an assembly: a position and its gaps.

    Attributes
    ----------
    coordinates : dict of str to array
        Coordinates of all bodies, the ground first: assembled, or as close as the iteration came.
    scale : array of shape (rows,)
        Factors by which the rows are multiplied.
    gaps : array of shape (rows,)
        Gap of each row, rad or sizes of the mechanism.
    jacobian : HostJacobian
        Scaled Jacobian at the position.
    closed : bool
        Whether all gaps are closed, to the tolerance of the last correction.
    signs : array of bool, shape (pairs,), optional
        For each pair of directions that joints hold parallel, whether they point the same way, if known.
    """

    coordinates: Coordinates
    scale: Float[np.ndarray, " row"]
    gaps: Float[np.ndarray, " row"]
    jacobian: HostJacobian
    closed: bool
    signs: Bool[np.ndarray, " pair"] | None = None


class Displacements:
    """Compiled displacements of the bodies of a model at an instant, s, called from the host.

    A call with coordinates and an increment returns the displaced position.
    """

    def __init__(self, model: Model, instant: float):
        self._model, self._instant = model, np.array(instant, float)
        rows, columns = model.system.shape
        self._dense, self._still = rows == columns and model.system.fronts is None, np.zeros(columns)

    def __call__(self, coordinates: Coordinates, increment: Float[np.ndarray, " column"]) -> Displaced:
        """Return the position after an increment."""
        return self._moved(coordinates, increment, 0, 0.0)[0]

    def closed(
        self, start: Coordinates, tolerance: float
    ) -> tuple[Float[np.ndarray, " row"], AssemblyAttempt | None, Displaced | None]:
        """Return the residual at given coordinates, and the assembly from there, if it takes full Newton steps only.

        The position at the coordinates comes third, if no step was tried from it; the damped iteration starts there.
        """
        position, residual, closed = self._moved(start, self._still, MAX_STEPS if self._dense else 0, tolerance)
        attempt = _attempt(position, tolerance) if closed else None
        return residual, attempt, None if self._dense else position

    def at(self, coordinates: Coordinates) -> Displaced:
        """Return the position with given coordinates."""
        return self(coordinates, self._still)

    def _moved(
        self, coordinates: Coordinates, increment: Float[np.ndarray, " column"], steps: int, tolerance: float
    ) -> tuple[Displaced, Float[np.ndarray, " row"], bool]:
        settings = self._instant, np.array(steps), np.array(tolerance, float)
        result = _moved(self._system, coordinates, increment, *settings, self._model.pose_type)
        to = {name: np.asarray(x) for name, x in result[0].items()}
        residual, entries, *ending = map(np.asarray, result[1:])
        first_residual, closed = ending or (residual, False)
        system = self._model.system
        jacobian = HostJacobian.of(system.pattern, entries).scaled(np.asarray(system.row_scale)[:, 0])
        return Displaced(to, residual, jacobian), first_residual, bool(closed)

    @cached_property
    def _system(self) -> System:
        """The system with its arrays on the device."""
        pattern = self._model.system.pattern if self._dense else None
        return with_fields(self._model.system, outputs=(), forces=(), fronts=None, pattern=pattern)


def assemble_from_guess(
    model: Model,
    instant: float,
    tolerance: float,
    start: Coordinates | None = None,
    *,
    lag: DriverLag | None = None,
    start_position: Displaced | None = None,
) -> AssemblyAttempt:
    """Assemble the bodies at one instant by damped Gauss-Newton; the result may have open gaps.

    Parameters
    ----------
    model : Model
        The mechanism, with at least one row.
    instant : float
        Time, s.
    tolerance : float
        Largest last correction, rad or sizes of the mechanism.
    start : dict of str to array, optional
        Start coordinates in place of the guess.
    lag : DriverLag, optional
        Lag that the drivers keep.
    start_position : Displaced, optional
        Start position in place of coordinates, with residual and Jacobian.
    """
    displace = Displacements(model, instant)

    def opened(displaced: Displaced) -> Displaced:
        return displaced if lag is None else displaced._replace(residual=lag.open(displaced.residual, 1.0))

    if start_position is None:
        start_coordinates = model.guess if start is None else start
        if lag is None:
            _, attempt, start_position = displace.closed(start_coordinates, tolerance)
            if attempt is not None:
                return attempt
        start_position = displace.at(start_coordinates) if start_position is None else start_position
    position = opened(start_position)
    for _ in range(MAX_STEPS):
        step, scale = position.jacobian.step(position.residual), position.jacobian.row_scale
        if step is None:
            break  # the error names the rows
        size = np.max(np.abs(step), initial=0.0)
        step *= min(1.0, LONGEST_STEP / max(size, 1e-300))
        now = np.linalg.norm(scale * position.residual)
        for _halving in range(12):
            trial = opened(displace(position.coordinates, step))
            left = np.linalg.norm(scale * trial.residual)
            if left < now or size <= tolerance:
                break
            step *= 0.5
        else:
            break
        position = trial
        if size <= tolerance or size * left <= NEXT_STEP * tolerance * now:
            break
    return _attempt(position, tolerance)


def _attempt(position: Displaced, tolerance: float) -> AssemblyAttempt:
    jacobian, scale = position.jacobian, position.jacobian.row_scale
    gaps = np.where(jacobian.finite(), scale * position.residual, np.nan)
    closed = bool(np.all(np.abs(gaps) <= max(1e3 * tolerance, 1e-9)))
    return AssemblyAttempt(position.coordinates, scale, gaps, jacobian.scaled(scale), closed)
