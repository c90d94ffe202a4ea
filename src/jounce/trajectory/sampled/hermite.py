"""Motion laws through instants with known derivatives."""

import math

import numpy as np
from jaxtyping import Bool, Float

from jounce.base.shapes import ArrayLike, seconds
from jounce.errors import TrajectoryError, check_choice
from jounce.trajectory.checks import finite_numbers, finite_row
from jounce.trajectory.knots import Jumps, knot_jumps
from jounce.trajectory.labels import check_rows
from jounce.trajectory.motion import SplineMotion

BEYOND = ("refuse", "hold", "continue")
MET = 6  # most values and derivatives that a piece meets at its end: more lose digits


class HermiteMotion(SplineMotion):
    """A motion law through instants with given values and derivatives.

    Between instants it is a polynomial with all derivatives of the instant before, and the first five of the instant
    after. At the last instant, derivatives above the given ones are those of the polynomial that ends there, unless the
    law continues beyond. An instant that is given twice has the derivatives of the first row from the left and those of
    the second from the right; `jumps` returns the differences.

    Parameters
    ----------
    times : array_like of shape (instants,)
        Increasing instants, s; an inner instant may be given twice.
    derivatives : array_like of shape (instants, order + 1)
        The law and its time derivatives, lowest first: m or rad per s to the power of the order.
    beyond : {"refuse", "hold", "continue"}, default "refuse"
        The law before the first and after the last instant, as for `SplineMotion`.
    incomplete : bool, default False
        Whether unknown derivatives may be NaN, together with those above them. Each piece uses the derivatives that
        both of its ends have, as joint_trajectory_controller of ros2_control does: it is linear between positions only,
        a cubic with velocities, and a quintic with accelerations.

    Raises
    ------
    TrajectoryError
        If the numbers are not finite, the instants do not increase, or their number is not that of the rows.

    Examples
    --------
    >>> import jounce as jn
    >>> law = jn.laws.HermiteMotion([0.0, 1.0], [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])  # rest to rest: 3-4-5
    >>> [round(float(x), 12) for x in law(jn.Jet.variable(0.5, order=2)).derivatives()]
    [0.5, 1.875, -0.0]
    """

    def __init__(self, times: ArrayLike, derivatives: ArrayLike, beyond: str = "refuse", *, incomplete: bool = False):
        check_choice("beyond", beyond, BEYOND, TrajectoryError)
        check_rows("derivatives", times, derivatives, TrajectoryError)
        instants = finite_row("times", times, seconds)
        shape = np.shape(derivatives)
        columns = shape[1] if len(shape) == 2 and shape[1] else 1
        values = np.array(derivatives, float) if incomplete else np.zeros(shape)
        is_given = ~np.isnan(values)
        if is_given.ndim == 2 and ((is_given[:, 1:] & ~is_given[:, :-1]).any() or not is_given[:, :1].all()):
            message = "a derivative is known only where those below it are"
            raise TrajectoryError(message, name="derivatives", value=values[~is_given.all(axis=1)][0].tolist())
        filled = np.where(is_given, values, 0.0) if incomplete else derivatives
        table = finite_numbers("derivatives", filled, (len(instants), columns))
        steps = np.diff(instants)
        is_double = steps == 0
        if (steps < 0).any() or (is_double[1:] & is_double[:-1]).any() or is_double[:1].any() or is_double[-1:].any():
            raise TrajectoryError("must increase", name="times", value=instants.tolist()[:5])
        begins = np.append(~is_double, True)  # at a repeated instant, the second row begins a piece
        pieces = hermite_pieces(instants, table) if is_given.all() else _mixed_pieces(instants, table, is_given)
        if beyond != "continue" and len(instants) > 1:
            given = int(is_given[-1].sum())
            pieces[given:, -1] = _at_end(pieces[:, -2], instants[-1] - instants[-2])[given:]
        self._set(instants[begins], pieces[:, begins], instants[-1], beyond)

    def jumps(self, order: int = 4) -> Jumps:
        """Return the instants, and the jumps of derivatives up to an order, as for `SegmentedMotion`."""
        return knot_jumps(self, order)


def hermite_pieces(
    times: Float[np.ndarray, " instants"], derivatives: Float[np.ndarray, "instants levels"]
) -> Float[np.ndarray, "powers instants"]:
    """Return the powers of the piece that begins at each instant; the last one is its Taylor polynomial."""
    levels, matched = derivatives.shape[1], min(derivatives.shape[1], MET)
    factorials = np.array([math.factorial(k) for k in range(levels)], float)
    taylor = (derivatives / factorials).T
    steps = np.diff(times)
    steps = np.where(steps > 0, steps, 1.0)
    scaled = taylor[:, :-1] * steps ** np.arange(levels)[:, None]  # in units of the step
    ends = taylor[:matched, 1:] * steps ** np.arange(matched)[:, None]
    gaps = ends - _binomials(matched, np.arange(levels)) @ scaled
    upper = np.linalg.solve(_binomials(matched, levels + np.arange(matched)), gaps)
    powers = np.concatenate([scaled, upper]) / steps ** np.arange(levels + matched)[:, None]
    powers[:levels] = taylor[:, :-1]
    return np.column_stack([powers, np.concatenate([taylor[:, -1], np.zeros(matched)])])


def _mixed_pieces(
    times: Float[np.ndarray, " instants"],
    derivatives: Float[np.ndarray, "instants levels"],
    is_given: Bool[np.ndarray, "instants levels"],
) -> Float[np.ndarray, "powers instants"]:
    """Return the powers of pieces between instants with different numbers of derivatives."""
    levels = np.minimum(is_given[:-1].sum(axis=1), is_given[1:].sum(axis=1))
    top = int(levels.max())
    result = np.zeros((top + min(top, MET), len(times)))
    for count in np.unique(levels).tolist():
        (first,) = np.nonzero(levels == count)
        pairs = np.stack([first, first + 1], axis=1).reshape(-1)
        powers = hermite_pieces(times[pairs], derivatives[pairs, :count])[:, ::2]
        result[: len(powers), first] = powers
    final = derivatives[-1, : is_given[-1].sum()][:top]
    result[: len(final), -1] = final / np.array([math.factorial(k) for k in range(len(final))], float)
    return result


def _at_end(powers: Float[np.ndarray, " powers"], length: float) -> Float[np.ndarray, " powers"]:
    """Return the powers of a piece about its end."""
    orders = np.arange(len(powers))
    return _binomials(len(powers), orders) @ (powers * length**orders) / length**orders


def _binomials(orders: int, powers: np.ndarray) -> Float[np.ndarray, "orders powers"]:
    """Return the Taylor coefficients of powers of a variable at one."""
    return np.array([[math.comb(int(p), j) for p in powers] for j in range(orders)], float)
