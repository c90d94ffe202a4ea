"""Estimated errors of the derivatives of a spline through samples of a motion."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.errors import RecordingWarning, warn_caller

INTERPOLATION_SAFETY, NOISE_SAFETY = 2.0, 3.0
TOLERANCE = 0.1  # largest error of a supported derivative, relative to its peak
GAP = 20  # times the median step, beyond which a spline says little about the motion between two samples
BRIDGED = "the motion there is what a spline makes of those beside"
BLOCKS, BLOCK = 8, 2500  # parts of very many samples, and samples in each


def derivative_errors(
    times: Float[np.ndarray, " samples"], values: Float[np.ndarray, " samples"], degree: int
) -> Float[np.ndarray, " derivative"]:
    """Return estimated errors of the derivatives of a spline through samples, relative to their peaks.

    The estimate is the sum of two errors. The error of interpolation is the largest difference between the spline and
    another through every second sample, divided by ``2^(degree + 1 - k) - 1``, the ratio by which derivative k of the
    finer one is better. The error of noise (including rounding and quantization) is the standard deviation of the
    noise, which follows from the divided differences of the samples that no smooth function explains, times its
    amplification by the spline at the worst instant. As a safety margin, the first is doubled and the second tripled.
    Measured on sines and Gaussians, the sum is 1 to 10 times the largest true error for the degrees 3 and 5, and up to
    30 times for 7; more for higher degrees, for which the coarse spline is worst at the ends.

    Parameters
    ----------
    times : ndarray of shape (samples,)
        Increasing instants, s.
    values : ndarray of shape (samples,)
        Samples.
    degree : int
        Odd degree of the spline, with not-a-knot ends.

    Returns
    -------
    ndarray of shape (degree + 1,)
        Relative errors; 1 is as large as the derivative itself, or unknown. The peak counts as no less than that of a
        sine of the same range with one period in the duration; constant samples have no error.
    """
    if float(np.ptp(values)) <= 32 * np.finfo(float).eps * np.abs(values).max():
        return np.zeros(degree + 1)
    blocks = _blocks(len(times))
    by_block = [_absolute(times[block], values[block], degree) for block in blocks]
    errors, peaks = np.max([f[0] for f in by_block], axis=0), np.max([f[1] for f in by_block], axis=0)
    return relative_errors(errors, peaks, float(np.ptp(values)), float(times[-1] - times[0]))


def relative_errors(
    errors: Float[np.ndarray, " derivative"], peaks: Float[np.ndarray, " derivative"], scatter: float, period: float
) -> Float[np.ndarray, " derivative"]:
    """Return errors relative to peaks that are no less than those of one period of a sine with a range; 1 at most."""
    min_peaks = scatter / 2 * (2 * math.pi / period) ** np.arange(len(errors))
    return np.minimum(1.0, errors / np.maximum(peaks, min_peaks))


def _blocks(count: int) -> list[slice]:
    """Return a slice of all samples, or slices of some parts of very many samples."""
    if count <= BLOCKS * BLOCK:
        return [slice(0, count)]
    return [slice(first, first + BLOCK) for first in np.linspace(0, count - BLOCK, BLOCKS).astype(int)]


def _absolute(times: np.ndarray, values: np.ndarray, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the errors of the derivatives of a spline, and their peaks."""
    half = np.unique(np.append(np.arange(0, len(times), 2), len(times) - 1))
    errors, peaks = np.full(degree + 1, math.inf), np.zeros(degree + 1)
    sigma = noise(times, values)
    if len(half) <= degree:  # too few samples for a comparison
        errors[0] = sigma
        return errors, peaks
    from scipy.interpolate import make_interp_spline  # local, since the import of SciPy takes half a second

    fine = make_interp_spline(times, values, k=degree)
    coarse = make_interp_spline(times[half], values[half], k=degree)
    instants, strength = _between(times), amplification(times, degree, degree)
    for k in range(degree + 1):
        curve = fine(instants, nu=k)
        interpolation = float(np.abs(curve - coarse(instants, nu=k)).max()) / (2.0 ** (degree + 1 - k) - 1)
        errors[k] = INTERPOLATION_SAFETY * interpolation + NOISE_SAFETY * sigma * strength[k]
        peaks[k] = np.abs(curve).max()
    return errors, peaks


def longest_gap(times: Float[np.ndarray, " samples"], lines: Sequence[int] = ()) -> str:
    """Return where the longest gap between samples is, with the line of the one after it; empty without gaps."""
    steps = np.diff(times)
    gaps = np.flatnonzero(steps > GAP * np.median(steps)) if len(steps) else []
    if not len(gaps):
        return ""
    k = int(gaps[np.argmax(steps[gaps])])
    line = f" (line {lines[k + 1]})" if lines else ""
    remark = f", the longest of {len(gaps)} gaps" if len(gaps) > 1 else ""
    return f"no samples between t = {times[k]:.6g} and {times[k + 1]:.6g} s{line}{remark}"


def warn_of_gap(times: Float[np.ndarray, " samples"]) -> None:
    """Warn of a gap between the samples of a trajectory."""
    if phrase := longest_gap(times):
        warn_caller(RecordingWarning(f"{phrase}: {BRIDGED}"))


def unsupported_derivative(errors: Float[np.ndarray, " derivative"], order: int) -> tuple[int, float] | None:
    """Return the lowest derivative up to an order whose error exceeds the tolerance, with the error; None if none does.

    Parameters
    ----------
    errors : ndarray of shape (degree + 1,)
        Errors from `derivative_errors`; above the degree they are unknown, unless the samples are constant.
    order : int
        Highest requested derivative.
    """
    all_errors = np.append(errors, 1.0 if errors.any() else 0.0)[: order + 1]
    if (all_errors <= TOLERANCE).all():
        return None
    index = int(np.argmax(all_errors > TOLERANCE))
    return index, float(all_errors[index])


def unsupported_words(name: str, order: int, error: float, law: Any, by: str = "") -> str:
    """Return why the samples of a `SplineMotion`, which may be smoothed, do not support a derivative, with a remedy."""
    size = "cannot be known from them" if error >= 1 else f"is about {100 * error:.0f} %"
    with_rates, is_smoothed = law.joined < law.degree - 1, law.samples.value is None
    if is_smoothed:
        size = size if error >= 1 else f"{size}, and nothing is known above the jerk"
        cause = "sample more exactly, request a lower order, or give an expression or a profile of the motion"
    elif order >= law.degree:
        remedy = "leave out the rates beside them" if with_rates else "choose a higher degree"
        cause = f"splines of degree {law.degree} have continuous derivatives to order {law.joined}; {remedy}"
    else:
        remedy = f"smooth them{by}, or leave out the rates beside them" if with_rates else f"or smooth the samples{by}"
        cause = f"sample more often or more exactly, {remedy}"
    samples = "smoothed samples" if is_smoothed else "samples"
    return f"{samples} of '{name}' do not support its derivative of order {order}: its error {size}; {cause}"


def noise(times: Float[np.ndarray, " samples"], values: Float[np.ndarray, " samples"]) -> float:
    """Return the estimated standard deviation of the noise in samples, at least that of their rounding.

    The divided differences of order p of a smooth function vanish quickly as p grows, while those of independent noise,
    scaled to weights of unit norm, keep its standard deviation. The estimate is the least over the orders.
    """
    floor = float(np.abs(values).max()) * np.finfo(float).eps / 4
    estimate, weights = math.inf, np.ones((len(times), 1))
    since = (times - times[0]) * ((len(times) - 1) / (times[-1] - times[0])) if len(times) > 1 else times
    for order in range(1, min(12, len(times) - 1)):
        weights = np.pad(weights[1:], ((0, 0), (1, 0))) - np.pad(weights[:-1], ((0, 0), (0, 1)))
        weights /= (since[order:] - since[:-order])[:, None]
        samples = np.lib.stride_tricks.sliding_window_view(values, order + 1)
        differences = (weights * samples).sum(axis=1) / np.sqrt((weights**2).sum(axis=1))
        estimate = min(estimate, float(np.sqrt((differences**2).mean())))
    return max(floor, estimate) if math.isfinite(estimate) else floor


def amplification(times: Float[np.ndarray, " samples"], degree: int, order: int) -> Float[np.ndarray, " derivative"]:
    """Return the largest amplification of independent noise in samples by the derivatives of a spline.

    The influence of a sample decays within a few others, so windows suffice: one at each end, where noise is amplified
    most, and one where the samples are densest.

    Returns
    -------
    ndarray of shape (order + 1,)
        Standard deviation of derivative k for noise of 1, per s to the power of k.
    """
    from scipy.interpolate import make_interp_spline  # local, since the import of SciPy takes half a second

    width = min(len(times), 6 * (degree + 1))
    dense = int(np.argmin(np.diff(times))) - width // 2
    strongest = np.zeros(order + 1)
    for first in {0, len(times) - width, min(max(dense, 0), len(times) - width)}:
        window = times[first : first + width]
        origin, step = window[0], (window[-1] - window[0]) / (width - 1)
        influence = make_interp_spline((window - origin) / step, np.eye(width), k=degree)
        grid = _between((window - origin) / step)
        # an end of the window within the samples is no end of the spline
        low = 0 if first == 0 else width // 3
        high = width if first + width == len(times) else width - width // 3
        grid = grid[(grid >= (window[low] - origin) / step) & (grid <= (window[high - 1] - origin) / step)]
        for k in range(order + 1):
            spread = np.sqrt((influence(grid, nu=k) ** 2).sum(axis=1)).max() / step**k
            strongest[k] = max(strongest[k], float(spread))
    return strongest


def _between(times: np.ndarray) -> np.ndarray:
    """Return four instants on each interval, and the last one."""
    shares = np.array([0.0, 0.25, 0.5, 0.75])
    inner = times[:-1, None] + np.diff(times)[:, None] * shares
    return np.append(inner.reshape(-1), times[-1])
