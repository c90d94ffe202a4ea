"""Polynomial motion functions of any degree: splines through knots of positions, accelerations or others."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.base.shapes import ArrayLike
from jounce.errors import TrajectoryError, check_choice
from jounce.trajectory.checks import check_samples, whole_number
from jounce.trajectory.motion import SplineMotion
from jounce.trajectory.splines import integrated, local_powers

MAX_CONTINUITY = 10
ENDS = ("not-a-knot", "natural", "clamped")
BEYOND = ("refuse", "hold", "continue")
LARGEST_GROWTH = 1e3  # largest growth of a law between its knots; more comes from an ill-conditioned system
AT_KNOTS = 1e-6  # fraction of the largest value, by which a law may miss its own knots
SAMPLES = 4  # in each segment, to measure the growth

_Conditions = Mapping[int, float]


class PolynomialMotion(SplineMotion):
    """A motion law of polynomials of degree ``m + 1`` on the segments between knots, continuous to order m.

    The knots carry values of the law or of one of its derivatives: positions, measured accelerations, or values of the
    m-th derivative, which is linear on each segment. SciPy's B-splines in a scaled time solve for the law.

    A law of s segments has ``s + 1 + m`` free numbers, of which the knots determine ``s + 1``. The other m follow from
    conditions at the first and the last knot. Conditions on derivatives below that of the knots are the constants of
    integration; as many are needed as integrations. Conditions on derivatives above it are either named by `ends`, or
    given: as many as are left, shared between start and end evenly, or but for one if their number is odd. With more
    conditions at one end, an error at that end, also of rounding, grows by a factor at every knot; such shares are
    refused unless there is only one segment. With an odd number, the error does not decay along the knots: prefer
    `derivative` and m both even or both odd.

    Parameters
    ----------
    times : array_like of shape (knots,)
        Strictly increasing instants, s.
    values : array_like of shape (knots,)
        Values at the knots: m or rad, per s to the power of `derivative`.
    continuity : int, default 4
        Order m of the highest continuous derivative, from 1 to 10; 2 is the cubic spline.
    derivative : int, default 0
        Order of the derivative that the knots carry, from 0 (positions) to m.
    start, end : dict of int to float, optional
        Conditions at the first and the last knot: values of derivatives by order, 0 for the position. By default, the
        derivatives below `derivative` are zero at the start.
    ends : {"not-a-knot", "natural", "clamped"}, default "not-a-knot"
        Conditions on the derivatives above `derivative`, if `start` and `end` give none. Of c conditions, the start
        takes ``ceil(c / 2)`` and the end ``floor(c / 2)``: with not-a-knot, the polynomials at the ends continue over
        as many knots; with natural, the highest continuous derivatives vanish; with clamped, the lowest (rest).
    beyond : {"refuse", "hold", "continue"}, default "refuse"
        The law outside of the knots: an error, the value of the nearest knot, at rest, or the polynomials of the end
        segments.

    Raises
    ------
    TrajectoryError
        If the knots are too few, not finite or do not increase, the conditions do not close the system or are shared
        unevenly between start and end, or the law does not stay near the given values.

    Notes
    -----
    The formulas are Negrean 2025, equations 61-64. Equation 64 states all derivatives at the first knot and two at the
    last, one more condition than there are unknowns, and its spline would grow by a factor at every knot.

    Examples
    --------
    >>> import jounce as jn
    >>> law = jn.laws.PolynomialMotion([0.0, 1.0, 2.0], [0.0, 1.0, 0.0], continuity=2, ends="natural")
    >>> [float(x) for x in law(jn.Jet.variable(1.0, order=2)).derivatives()]
    [1.0, 0.0, -3.0]

    From rest, with both ends at rest to the second derivative:

    >>> rest = {1: 0.0, 2: 0.0}
    >>> law = jn.laws.PolynomialMotion([0.0, 1.0], [0.0, 1.0], continuity=4, start=rest, end=rest)
    >>> round(float(law(jn.Jet.variable(0.5, order=1)).coefficients[1]), 12)
    1.875
    """

    def __init__(
        self,
        times: ArrayLike,
        values: ArrayLike,
        continuity: int = 4,
        derivative: int = 0,
        start: _Conditions | None = None,
        end: _Conditions | None = None,
        ends: str = "not-a-knot",
        beyond: str = "refuse",
    ):
        times, values = check_samples(times, values)
        continuity = whole_number("continuity", continuity, 1, MAX_CONTINUITY)
        derivative = whole_number("derivative", derivative, 0, continuity)
        check_choice("beyond", beyond, BEYOND, TrajectoryError)
        check_choice("ends", ends, ENDS, TrajectoryError)
        conditions = _checked(start, continuity, "start"), _checked(end, continuity, "end")
        constants = _constants(conditions, derivative)
        step = (times[-1] - times[0]) / (len(times) - 1)
        knots = (times - times[0]) / step
        pieces = _spline(knots, values, continuity + 1 - derivative, _above(conditions, derivative, step), ends)
        pieces = pieces * step**derivative
        for _ in range(derivative):
            pieces = integrated(pieces, np.diff(knots))
        if derivative:
            pieces = pieces + _closing(pieces, knots, constants, times[-1] - times[0])
        with np.errstate(over="ignore", invalid="ignore"):
            pieces = pieces / step ** np.arange(continuity + 2)[:, None]
        if not np.isfinite(pieces).all():
            message = "are too large, or too close in time, for their derivatives to be numbers"
            raise TrajectoryError(message, name="values", value=float(np.max(np.abs(values))))
        self._set(times[:-1], pieces, times[-1], beyond)

    @classmethod
    def from_accelerations(
        cls,
        times: ArrayLike,
        accelerations: ArrayLike,
        continuity: int = 4,
        start: _Conditions | None = None,
        end: _Conditions | None = None,
        ends: str = "not-a-knot",
        beyond: str = "refuse",
    ) -> "PolynomialMotion":
        """Return the law whose acceleration goes through samples, integrated twice (Negrean 2025, section 4).

        Parameters
        ----------
        times : array_like of shape (knots,)
            Strictly increasing instants, s.
        accelerations : array_like of shape (knots,)
            Samples of the acceleration, m/s^2 or rad/s^2.
        continuity : int, default 4
            Order m of the highest continuous derivative of the position, at least 2; 4 gives quintic segments.
        start, end : dict of int to float, optional
            Two conditions on the position (0) and the velocity (1), at least one of them on the position; by default
            ``start={0: 0.0, 1: 0.0}``. Also, either none or ``m - 2`` on the derivatives from the third on.
        ends : {"not-a-knot", "natural", "clamped"}, default "not-a-knot"
            Conditions on the derivatives from the third on, if none are given.
        beyond : {"refuse", "hold", "continue"}, default "refuse"
            The law outside of the knots, as for the class.

        Returns
        -------
        PolynomialMotion
            The law of the position.

        Raises
        ------
        TrajectoryError
            As for the class.

        Examples
        --------
        >>> import numpy as np
        >>> import jounce as jn
        >>> t = np.linspace(0.0, 1.0, 11)
        >>> law = jn.laws.PolynomialMotion.from_accelerations(t, 6 * t, start={0: 2.0}, end={0: 3.0})
        >>> [round(float(x), 9) for x in law(jn.Jet.variable(0.5, order=3)).derivatives()]
        [2.125, 0.75, 3.0, 6.0]
        """
        if continuity < 2:
            message = "accelerations at the knots are continuous; the order of continuity is at least 2"
            raise TrajectoryError(message, name="continuity", value=continuity)
        return cls(times, accelerations, continuity, 2, start, end, ends, beyond)

    @property
    def continuity(self) -> int:
        """Order m of the highest continuous derivative."""
        return self.degree - 1

    @property
    def knots(self) -> Float[np.ndarray, " knots"]:
        """Instants of the knots, shape (knots,), s."""
        return np.append(self.breakpoints, self.stop)

    @property
    def knot_values(self) -> Float[np.ndarray, " knots"]:
        """Values of the m-th derivative at the knots, shape (knots,): ``q^(m)_i`` of Negrean 2025, equation 61."""
        m = self.continuity
        first, slope = math.factorial(m) * self.coefficients[m], math.factorial(m + 1) * self.coefficients[m + 1]
        final = first[-1] + slope[-1] * (self.stop - self.breakpoints[-1])
        return np.append(first, final)

    def integration_constants(self, origin: float = 0.0) -> Float[np.ndarray, "continuity segments"]:
        """Return the integration constants ``a_k`` of the segments (Negrean 2025, equations 61-63).

        On segment i of length ``T_i``, with ``tau`` the time since `origin`, the derivative of order ``m - p`` is
        ``(-1)^p (tau_i - tau)^(p+1) / (T_i (p+1)!) q^(m)_{i-1} + (tau - tau_{i-1})^(p+1) / (T_i (p+1)!) q^(m)_i
        + sum_{k=1}^p a_k tau^(p-k) / (p-k)!``.

        Parameters
        ----------
        origin : float, default 0
            The instant from which ``tau`` counts, s. Far from the segments the terms cancel, and digits are lost.

        Returns
        -------
        ndarray of shape (m, segments)
            ``a_1, ..., a_m``, m or rad per s to the power of ``m - k``.

        Examples
        --------
        >>> import jounce as jn
        >>> law = jn.laws.PolynomialMotion([0.0, 1.0], [2.0, 2.0], continuity=2, derivative=2, start={0: 5.0, 1: 0.0})
        >>> law.integration_constants().round(12).tolist()  # q = (1 - t)^3 / 3 + t^3 / 3 + a_1 t + a_2
        [[1.0], [4.666666666667]]
        """
        m, knots, knot_values = self.continuity, self.knots, self.knot_values
        length, starts = np.diff(knots), knots[:-1] - origin
        remainders = []
        for k in range(m):  # part of each power of the local time that is not in the term of the left knot value
            contribution = (
                (-1) ** (m + k) * math.comb(m + 1, k) / math.factorial(m + 1) * length ** (m - k) * knot_values[:-1]
            )
            remainders.append(self.coefficients[k] - contribution)
        constants = []
        for power in range(m - 1, -1, -1):  # with local time tau - beginning, powers of tau by the binomial sum
            shifted = [remainders[k] * math.comb(k, power) * (-starts) ** (k - power) for k in range(power, m)]
            constants.append(math.factorial(power) * sum(shifted[1:], shifted[0]))
        return np.stack(constants)


def _checked(conditions: Any, continuity: int, name: str) -> dict[int, float]:
    """Return the conditions at one end, after a check of their orders and values."""
    if conditions is None:
        return {}
    if not isinstance(conditions, Mapping):
        raise TrajectoryError("must map orders of derivatives to values, as {1: 0.0}", name=name, value=conditions)
    for order, value in conditions.items():
        whole_number(name, order, 0, continuity)
        if not np.isscalar(value) or isinstance(value, str | bytes) or not np.isfinite(value):
            raise TrajectoryError(
                "the value of a condition must be a finite number", name=f"{name}[{order}]", value=value
            )
    return {int(order): float(value) for order, value in conditions.items()}


_Ends = tuple[dict[int, float], dict[int, float]]
_Pieces = Float[np.ndarray, "powers segments"]


def _constants(conditions: _Ends, derivative: int) -> _Ends:
    """Return the conditions on the derivatives below that of the knots; by default all zero at the start."""
    for name, end in zip(("start", "end"), conditions, strict=True):
        if derivative in end:
            message = f"the knots carry the derivative of order {derivative}, it takes no condition"
            raise TrajectoryError(message, name=name, value=end)
    first, last = ({k: v for k, v in end.items() if k < derivative} for end in conditions)
    count = len(first) + len(last)
    if count == 0:
        return dict.fromkeys(range(derivative), 0.0), {}
    if count != derivative:
        message = f"{derivative} conditions on the derivatives below order {derivative} close the system"
        raise TrajectoryError(f"{message}; give as many in start and end together", value=count)
    return first, last


def _above(conditions: _Ends, derivative: int, step: float) -> _Ends:
    """Return the conditions on the derivatives above that of the knots, by order above it and in scaled time."""
    first, last = (
        {k - derivative: v * step ** (k - derivative) for k, v in end.items() if k > derivative} for end in conditions
    )
    return first, last


def _spline(
    knots: Float[np.ndarray, " knots"], values: Float[np.ndarray, " knots"], degree: int, conditions: _Ends, ends: str
) -> _Pieces:
    """Return the local Taylor coefficients, shape (degree + 1, segments), of a spline through values at knots."""
    from scipy.interpolate import make_interp_spline  # local, since the import of SciPy takes half a second

    required, count = degree - 1, len(conditions[0]) + len(conditions[1])
    if count not in (0, required):
        message = f"{required} conditions on the derivatives above that of the knots close the system, or none"
        raise TrajectoryError(f"{message}; give as many in start and end together", value=count)
    first, last = (required + 1) // 2, required // 2
    _check_shares(conditions, len(knots) - 1, (first, last))
    if not count and ends == "not-a-knot":
        if len(knots) <= degree:
            message = f"not-a-knot ends of a law of this degree need at least {degree + 1} knots"
            raise TrajectoryError(f"{message}; give more, or conditions at the start and the end", value=len(knots))
        inner_knots = knots[1 + first : len(knots) - 1 - last]
        bounds = [np.full(degree + 1, knot) for knot in (knots[0], knots[-1])]
        try:
            spline = make_interp_spline(knots, values, k=degree, t=np.concatenate([bounds[0], inner_knots, bounds[1]]))
        except (np.linalg.LinAlgError, ValueError):
            message = "no spline goes through the samples: their spacing is too uneven; sample evenly"
            raise TrajectoryError(message, value=float(np.diff(knots).min())) from None
    else:
        if not count:
            top = degree if ends == "natural" else 0
            start, end = (dict.fromkeys((abs(top - k) for k in range(1, n + 1)), 0.0) for n in (first, last))
            conditions = start, end
        bc_types = [sorted(end.items()) or None for end in conditions] if required else [None, None]
        try:
            spline = make_interp_spline(knots, values, k=degree, bc_type=tuple(bc_types))
        except (np.linalg.LinAlgError, ValueError):
            orders = [sorted(end) for end in conditions]
            message = "the conditions at the start and the end do not determine the law; choose others"
            raise TrajectoryError(message, value=orders) from None
    pieces = local_powers(spline, knots[:-1], degree)
    _check_growth(pieces, knots, values, conditions)
    return pieces


def _check_shares(conditions: _Ends, segments: int, shares: tuple[int, int]) -> None:
    """Raise TrajectoryError if one end has more conditions than the other, by more than one."""
    start, end = (len(end_conditions) for end_conditions in conditions)
    if segments == 1 or abs(start - end) <= 1:
        return
    larger, smaller = shares
    phrase = f"{larger} at each end" if larger == smaller else f"{larger} at one end and {smaller} at the other"
    message = (
        f"of the conditions on the derivatives above that of the knots, {start} are at the start and {end} at the end: "
        "an error at one end, of rounding as well, then grows by a factor at every knot, and the law with it"
    )
    raise TrajectoryError(f"{message}; give {phrase}, or none", name="start" if start > end else "end")


def _check_growth(
    pieces: _Pieces, knots: Float[np.ndarray, " knots"], values: Float[np.ndarray, " knots"], conditions: _Ends
) -> None:
    """Raise TrajectoryError unless a spline passes through its own knots and stays near them."""
    sizes = [abs(value) for end in conditions for value in end.values()]
    size = max(float(np.max(np.abs(values))), *sizes, 0.0)
    local = np.diff(knots) * (np.arange(1, SAMPLES + 1) / SAMPLES)[:, None]
    curve = sum(c * local**k for k, c in enumerate(pieces))
    missed = float(np.max(np.abs(np.asarray(curve)[-1] - values[1:])))
    if not missed <= AT_KNOTS * size:
        message = f"the law misses the values at its own knots, by {missed:.3g}: errors grow from knot to knot"
    elif not np.max(np.abs(curve)) <= LARGEST_GROWTH * size:
        message = f"the law grows to {np.max(np.abs(curve)):.3g} between its knots, of which the largest is {size:.3g}"
    else:
        return
    shortest = float(np.min(np.diff(knots)) * (len(knots) - 1) / (knots[-1] - knots[0]))
    advice = "sample evenly, lower the order of continuity, or choose an even number of conditions, half at each end"
    raise TrajectoryError(f"{message} (the shortest segment is {shortest:.2g} of the mean one); {advice}")


def _closing(pieces: _Pieces, knots: Float[np.ndarray, " knots"], constants: _Ends, duration: float) -> _Pieces:
    """Return the polynomial of the integration constants, as local Taylor coefficients of the shape of the pieces."""
    count, length, step = len(constants[0]) + len(constants[1]), knots[-1], knots[-1] - knots[-2]
    rows, values = [], []
    for index, conditions in enumerate(constants):
        for order, value in conditions.items():
            current = pieces[order, 0] * math.factorial(order)
            if index:
                current = sum(
                    c * math.perm(k, order) * step ** (k - order) for k, c in enumerate(pieces[:, -1]) if k >= order
                )
            rows.append([float(math.perm(j, order) * (index or j == order)) for j in range(count)])
            values.append(value * duration**order - current * length**order)
    if np.linalg.matrix_rank(np.array(rows)) < count:
        message = "these conditions do not fix the constants of integration; one at least must be on the position"
        raise TrajectoryError(message, value=[sorted(end) for end in constants])
    powers = np.linalg.solve(np.array(rows), np.array(values))
    offsets = knots[:-1] / length
    closing = np.zeros_like(pieces)
    for k in range(count):
        closing[k] = sum(powers[j] * math.comb(j, k) * offsets ** (j - k) for j in range(k, count)) / length**k
    return closing
