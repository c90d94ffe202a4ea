"""Limit positions, where the driver turns back along a curve, from its series; and the branches between them."""

import dataclasses
from typing import Literal

import numpy as np
from jaxtyping import Float
from numpy.polynomial.polynomial import polyroots, polyval

from jounce.kinematics.curves.path_tracker import CurvePoint

Kind = Literal["maximum", "minimum", "stationary"]
ON_THE_CURVE = 1e-7  # of a step: largest imaginary part that rounding gives a double root
STANDING = 1e-10  # rate of the driver value, in its unit, below which it stands still
FLAT = 1e-9  # of the largest term: slopes below it count as zero
ROUNDING = float(np.finfo(float).eps)  # of the largest term: smaller coefficients are insignificant within a step
VANISHING = 1e-12  # of the largest term: largest residual at a root; a double root is exact to half the digits


@dataclasses.dataclass(frozen=True)
class LimitPosition:
    """A configuration in which the driver stands still while the mechanism moves: a dead point of this driver.

    Attributes
    ----------
    arc_length : float
        Position on the curve, rad or sizes of the mechanism.
    value : float
        Value of the driver, rad or m.
    kind : str
        ``"maximum"`` or ``"minimum"`` if the driver turns back, ``"stationary"`` if it continues.

    Examples
    --------
    >>> import jounce as jn
    >>> limits = jn.trace(jn.load("examples/rspu_slide.yaml")).limits
    >>> [(limit.kind, round(limit.value, 6)) for limit in limits]
    [('maximum', 0.314952), ('minimum', 0.259312)]
    """

    arc_length: float
    value: float
    kind: Kind


@dataclasses.dataclass(frozen=True)
class CurveBranch:
    """A part of a circuit between limit positions of the driver, in the sense of Chase and Mirth (1993).

    Attributes
    ----------
    start, stop : float
        Arc lengths; the stop of the last branch of a closed curve may exceed its length.
    low, high : float
        Range of the driver's value on the branch, rad or m. A branch without limits makes whole turns.
    """

    start: float
    stop: float
    low: float
    high: float


def limits_between(point: CurvePoint, stop: float, unit: float) -> list[LimitPosition]:
    """Return the limit positions from a point (excluded) to an arc length (included).

    `unit` is the scale of the driver value as an unknown. A driver that stands still throughout has no limit positions.
    """
    step = stop - point.arc_length
    orders = np.arange(len(point.value))
    slopes = (point.value * step**orders * orders)[1:]  # of the value with respect to the fraction of the step
    size = np.max(np.abs(slopes), initial=0.0)
    if size <= STANDING * unit * step or abs(slopes[0]) > np.sum(np.abs(slopes[1:])):
        return []
    limits = []
    for part in roots(slopes):
        if not 0 < part <= 1:
            continue
        limit = point.recentered(part * step)
        limits.append(LimitPosition(limit.arc_length, float(limit.value[0]), _kind(slopes, part, size)))
    return limits


def roots(coefficients: Float[np.ndarray, " order"]) -> list[float]:
    """Return the distinct real roots of a polynomial in [0, 1].

    Insignificant leading coefficients are dropped, since they spoil the eigenvalues that give the roots.
    """
    size = np.max(np.abs(coefficients))
    significant = np.flatnonzero(np.abs(coefficients) > ROUNDING * size)
    coefficients = coefficients[: significant[-1] + 1]
    slopes = (coefficients * np.arange(len(coefficients)))[1:]
    real_roots: list[float] = []
    for root in polyroots(coefficients):
        if abs(root.imag) > ON_THE_CURVE or not -ON_THE_CURVE < root.real < 1 + ON_THE_CURVE:
            continue
        part = float(root.real)
        for _ in range(3):
            slope = float(polyval(part, slopes))
            change = float(polyval(part, coefficients)) / slope if slope else 0.0
            if not abs(change) < ON_THE_CURVE:
                break
            part -= change
        vanishes = abs(polyval(part, coefficients)) <= VANISHING * size
        if vanishes and all(abs(part - other) > 2 * ON_THE_CURVE for other in real_roots):
            real_roots.append(part)
    return sorted(real_roots)


def _kind(slopes: Float[np.ndarray, " order"], part: float, size: float) -> Kind:
    before, after = (float(polyval(part + offset, slopes)) for offset in (-1e-3, 1e-3))
    if min(abs(before), abs(after)) <= FLAT * 1e-6 * size or before * after > 0:
        return "stationary"
    return "maximum" if before > 0 else "minimum"


def values_between(point: CurvePoint, stop: float, value: float, period: float | None) -> list[float]:
    """Return the arc lengths from a point to another at which the driver has a value, up to whole periods."""
    step = stop - point.arc_length
    terms = point.value * step ** np.arange(len(point.value))
    reach = float(np.sum(np.abs(terms[1:])))
    if reach == 0:
        return []
    targets = [value]
    if period is not None:
        lowest, highest = ((terms[0] + side * reach - value) / period for side in (-1, 1))
        targets = [value + period * k for k in range(int(np.floor(lowest)), int(np.ceil(highest)) + 1)]
    steps = [part for target in targets for part in roots(np.array([terms[0] - target, *terms[1:]]))]
    return [point.arc_length + part * step for part in steps]
