"""Whole turns at the first assembly, from the starting guess and the laws of the drivers.

If a law starts more than half a turn from the guess, the drivers are turned step by step from the guess to the law, and
all bodies and angles count their turns on the way. Otherwise all angles are those nearest to the guess. The turns thus
depend neither on the path of assembly nor on the first instant of a grid.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jounce.constraints.facts import dimension_of_field
from jounce.jet.turns import WHOLE_TURN, principal, whole_periods
from jounce.linear_algebra.clusters import clusters
from jounce.linear_algebra.host_jacobian import HostJacobian
from jounce.mechanism import Model
from jounce.mechanism.transmissions.axis_angles import AttitudeHistory, measures_angle

STEPS_A_TURN = 64
MOST_TURNS = 4  # followed step by step; each further turn repeats the last one
CORRECTIONS = 8
MOST_FOLLOWED = 100  # turns, if the last one cannot be repeated, as with drivers at different rates
SMALLEST_PERIOD, LARGEST_PERIOD = 1, 60  # whole turns searched for shifts that keep coupled bodies coupled


Coordinates = dict[str, np.ndarray]
"""Coordinates of all bodies by name, the ground first, (..., bodies, 1)."""


class Displaced(NamedTuple):
    """A position after a displacement of the bodies."""

    coordinates: Coordinates
    residual: Float[np.ndarray, " row"]
    jacobian: HostJacobian


Displace = Callable[[Coordinates, np.ndarray], Displaced]


class DriverLag(NamedTuple):
    """The lag of the drivers at the starting guess: law minus guess, by rows of the residual.

    Attributes
    ----------
    size : array of shape (rows,)
        Value of the law minus that of the guess, with whole turns; zero in the rows of joints.
    turning : array of bool, shape (rows,)
        Whether the row is an angle.
    periodic : array of bool, shape (rows,)
        Whether the row is periodic in whole turns.
    """

    size: Float[np.ndarray, " row"]
    turning: Bool[np.ndarray, " row"]
    periodic: Bool[np.ndarray, " row"]

    @property
    def angle(self) -> float:
        """The largest lag of an angle, rad."""
        return float(np.max(np.abs(self.size[self.turning]), initial=0.0))

    def open(self, residual: Float[np.ndarray, " row"], part: float) -> Float[np.ndarray, " row"]:
        """Return the residual of drivers that still lag by a part of the total."""
        opened = residual + part * self.size
        return np.where(self.periodic, principal(opened), opened)


def driver_lag(model: Model, laws: Sequence[np.ndarray], residual: Float[np.ndarray, " row"]) -> DriverLag | None:
    """Return the lag of the drivers, given the residual at the guess; None if a driver has several rows.

    `laws` are the values for drivers of angles about axes, as `law_values` returns them.
    """
    rows = [k for k, name in enumerate(model.rows) if name.startswith(("drivers.", "initial."))]
    groups = [group for group in model.system.groups if group.is_driver]
    if len(rows) != sum(group.instances for group in groups) or not np.isfinite(residual).all():
        return None
    size = np.zeros(len(model.rows))
    is_angle, periodic = np.zeros(len(size), bool), np.zeros(len(size), bool)
    angles = iter(laws)
    first = 0
    for group in groups:
        driver_rows = rows[first : first + group.instances]
        first += group.instances
        size[driver_rows] = -residual[driver_rows]
        is_angle[driver_rows] = dimension_of_field(group.element, "motion") == "angle"
        if measures_angle(group):
            is_angle[driver_rows] = periodic[driver_rows] = True
            size[driver_rows] = (next(angles) - np.asarray(group.element.datum.angle))[:, 0]
    return DriverLag(size, is_angle, periodic)


def turned_to_laws(
    model: Model, lag: DriverLag, start: Coordinates, displace: Displace
) -> tuple[Coordinates, AttitudeHistory | None] | None:
    """Follow the mechanism step by step from the driver values of the guess to those of the laws.

    Parameters
    ----------
    model : Model
        The mechanism.
    lag : DriverLag
        Lag at the guess.
    start : dict of str to array
        Coordinates assembled with the driver values of the guess.
    displace : callable
        Maps coordinates and an increment to coordinates, residual and Jacobian.

    Returns
    -------
    tuple or None
        The coordinates, with the turns of planar bodies, and in space the history of attitudes from which the turns of
        angles about axes are counted; None if the motion cannot be followed.
    """
    turns, skipped = lag.angle / WHOLE_TURN, 0
    if turns > MOST_TURNS:
        skipped = int(turns) - MOST_TURNS + 1
    fractions = np.arange(0, turns * STEPS_A_TURN)[::-1] / (STEPS_A_TURN * turns)
    states, last = [start], None
    increment = np.zeros(model.system.shape[1])
    for count, fraction in enumerate(fractions):
        if skipped and count == len(fractions) - skipped * STEPS_A_TURN:
            last = _repeated(states, skipped)
            if last is not None:
                break
            if turns > MOST_FOLLOWED:
                return None
            skipped = 0  # drivers at different rates: no turn repeats the last one
        corrected = _corrected(states[-1], increment, lambda r, p=fraction: lag.open(r, p), displace)
        if corrected is None:
            return None
        coordinates, increment = corrected
        states.append(coordinates)
    last = states[-1] if last is None else last
    if "quaternion" not in last:
        return last, None
    attitudes = [np.asarray(state["quaternion"]) for state in (model.guess, *states)]
    return last, AttitudeHistory(np.concatenate(attitudes, axis=-1), np.zeros(len(attitudes)), STEPS_A_TURN, skipped)


def _corrected(
    coordinates: Coordinates,
    increment: Float[np.ndarray, " column"],
    opened: Callable[[np.ndarray], np.ndarray],
    displace: Displace,
) -> tuple[Coordinates, Float[np.ndarray, " column"]] | None:
    """Return the coordinates after a Newton-Raphson corrected step, and the step; None if it does not converge."""
    total, trial = increment, displace(coordinates, increment)
    for _ in range(CORRECTIONS):
        step = trial.jacobian.step(opened(trial.residual))
        if step is None or (size := np.max(np.abs(step), initial=0.0)) > 0.5:
            return None
        total, trial = total + step, displace(trial.coordinates, step)
        if size < 1e-9:
            return trial.coordinates, total
    return None


def _repeated(states: list[Coordinates], turns: int) -> Coordinates | None:
    """Return the coordinates after further turns like the last; None if the last turn did not close."""
    before, after = states[-1 - STEPS_A_TURN], states[-1]
    advance = np.zeros_like(after["position"])
    if len(states) > 2 * STEPS_A_TURN:  # an advance per turn, as of a nut on a screw or the turn counter of a cam
        advance = before["position"] - states[-1 - 2 * STEPS_A_TURN]["position"]
    for name, value in after.items():
        difference = value - before[name]
        if name == "position":
            difference = difference - advance
        if name == "quaternion":
            difference = np.minimum(np.abs(difference).max(axis=0), np.abs(value + before[name]).max(axis=0))
        if np.max(np.abs(principal(difference) if name == "angle" else difference), initial=0.0) > 1e-6:
            return None
    after = {**after, "position": after["position"] + turns * advance}
    if "angle" not in after:
        return after
    return {**after, "angle": after["angle"] + turns * whole_periods(after["angle"] - before["angle"])}


def nearest_turns(
    guess: dict[str, Any], coordinates: Coordinates, residual_at: Callable[[np.ndarray], np.ndarray]
) -> Coordinates:
    """Return planar coordinates with angles shifted by the whole turns that bring them nearest to the guess.

    Drivers, gears and rolling discs count turns: bodies that they couple are shifted together or not at all.

    Parameters
    ----------
    guess, coordinates : dict of str to array
        Coordinates of all bodies, the ground first.
    residual_at : callable
        Returns the scaled residual for given angles, shape (rows,).
    """
    missing_turns = ((np.asarray(guess["angle"]) - coordinates["angle"]) / WHOLE_TURN)[1:, 0]
    if not np.round(missing_turns).any():
        return coordinates
    residual = residual_at(coordinates["angle"])

    def shifted(turns: np.ndarray) -> np.ndarray:
        return coordinates["angle"] + WHOLE_TURN * np.concatenate([[0.0], turns])[:, None]

    bodies = np.arange(len(missing_turns))
    changes = np.stack([residual_at(shifted((bodies == k) * 1.0)) - residual for k in bodies])
    counts_turns = np.abs(changes) > 1e-6
    turns = np.round(missing_turns)
    for members in clusters(counts_turns @ counts_turns.T):  # bodies that share a row that counts turns
        if counts_turns[members].any():
            turns[members] = _coupled_turns(changes[members], missing_turns[members])
    if not turns.any() or np.max(np.abs(residual_at(shifted(turns)) - residual)) > 1e-6:
        return coordinates
    return {**coordinates, "angle": shifted(turns)}


def _coupled_turns(
    changes: Float[np.ndarray, "body row"], missing_turns: Float[np.ndarray, " body"]
) -> Float[np.ndarray, " body"]:
    """Return the whole turns nearest to `missing_turns` that change no row; `changes` are by one turn of each."""
    if np.max(np.abs(np.round(missing_turns) @ changes)) < 1e-6:
        return np.round(missing_turns)
    vectors, sizes, _ = np.linalg.svd(changes)
    rank = int(np.sum(sizes > 1e-9 * sizes[0]))
    if len(missing_turns) - rank != 1:
        return np.zeros(len(missing_turns))
    direction = vectors[:, -1]
    direction = direction / np.min(np.abs(direction[np.abs(direction) > 1e-9]))
    for count in range(SMALLEST_PERIOD, LARGEST_PERIOD + 1):
        turns = np.round(count * direction)
        if np.max(np.abs(turns - count * direction)) < 1e-7 * count:
            return np.round(missing_turns @ turns / (turns @ turns)) * turns
    return np.zeros(len(missing_turns))
