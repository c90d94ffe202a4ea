"""Peaks: smallest and largest values of the outputs of a motion and of their derivatives, with times and units."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from jounce.errors import SampleWarning
from jounce.integrate import Simulation
from jounce.kinematics import ChunkedMotion, Motion, solve
from jounce.mechanism import AbstractQuantity
from jounce.mechanism.laws.law_breaks import breaks_of_laws
from jounce.mechanism.outputs.base import lost_orders
from jounce.mechanism.user_code import holds_users_code
from jounce.reporting.maxima import ROUNDING, Curves, Peaks, RunningMaxima, Times, alike
from jounce.trajectory.law_checks.breaks import both_sides
from jounce.units.shown_units import ShownUnits, derivative_unit

if TYPE_CHECKING:
    import xarray

NAMES = ("position", "velocity", "acceleration", "jerk", "jounce")
LEAST = 200  # least number of sampled instants
PEAKS, POINTS, ROUNDS = 2, 7, 3  # refined maxima of each curve, instants around each, and number of refinements
CHUNK, COMPARED = 1000, 50  # instants solved together, and compared
SMALLEST, ALIKE = 1e-15, 1e-12  # fractions of the size of an output
_Around = Float[np.ndarray, "points peaks curves"]


@dataclasses.dataclass(frozen=True)
class Peak:
    """Extreme values of one derivative of one output, at the solved instants and between them.

    Parameters
    ----------
    output : str
        Name of the output, with its component if it has any: ``C_x``.
    derivative : str
        ``position``, ``velocity``, ..., or ``torque``, ``yank``, ..., see `rate_name`.
    unit : str
    minimum, maximum, minimum_at, maximum_at : float
        Extreme values, in the unit, and their instants, s; NaN if no instant was solved.
    size : float
        Largest magnitude of this derivative among all components of the output.
    """

    output: str
    derivative: str
    unit: str
    minimum: float
    minimum_at: float
    maximum: float
    maximum_at: float
    size: float

    @property
    def shown(self) -> tuple[float, float]:
        """The minimum and the maximum, replaced by 0 if they are rounding relative to other components."""
        low, high = (0.0 if abs(x) < SMALLEST * self.size else x for x in (self.minimum, self.maximum))
        return low, high

    @property
    def varies(self) -> bool:
        """Whether the minimum and the maximum differ by more than rounding."""
        return self.maximum - self.minimum > ALIKE * self.size

    @property
    def largest(self) -> tuple[bool, bool]:
        """Whether the minimum and the maximum have the largest magnitude; both if they differ only by rounding."""
        low, high, margin = abs(self.minimum), abs(self.maximum), ALIKE * self.size
        return self.varies and low >= high - margin, self.varies and high >= low - margin


def derivative_name(order: int) -> str:
    """Return the name of a time derivative of a position or an angle.

    Examples
    --------
    >>> [derivative_name(k) for k in (0, 3, 4, 5, 22)]
    ['position', 'jerk', 'jounce', '5th', '22nd']
    """
    if order < len(NAMES):
        return NAMES[order]
    digit = order % 10 if order // 10 % 10 != 1 else 0
    return str(order) + {1: "st", 2: "nd", 3: "rd"}.get(digit, "th")


def rate_name(output: AbstractQuantity, order: int) -> str:
    """Return the name of a time derivative of an output: velocity, jerk, ..., or for a force yank, second rate, ...

    Examples
    --------
    >>> import jounce as jn
    >>> [rate_name(jn.outputs.AngleOutput("crank"), k) for k in (0, 1, 4)]
    ['position', 'velocity', 'jounce']
    >>> [rate_name(jn.outputs.DriverTorqueOutput("theta"), k) for k in (0, 1, 2, 6)]
    ['torque', 'yank', 'second rate', '6th rate']
    """
    names = output.rate_names
    if not names:
        return derivative_name(order + output.lost_orders)
    return names[order] if order < len(names) else f"{derivative_name(order)} rate"


def scalar_outputs(motion: Motion) -> dict[str, tuple[str, Float[np.ndarray, "time derivative"]]]:
    """Return the components of the outputs of a motion.

    Returns
    -------
    dict
        By name, as in the columns of a CSV file: the name of the output and the values, shape (time, order + 1).
    """
    outputs = {}
    for name, values in motion.outputs.items():
        if values.ndim == 2:
            outputs[name] = name, values
        else:
            labels = motion.mechanism.outputs[name].labels
            outputs |= {f"{name}_{labels[c]}": (name, values[..., c]) for c in range(values.shape[2])}
    return outputs


def peaks(motion: Motion | ChunkedMotion, *, refine: bool = True) -> list[Peak]:
    """Return the peak values of each output, component by component, and of each derivative.

    Parameters
    ----------
    motion : Motion or ChunkedMotion
        The motion. Peaks of chunks are those found by `parts_with_peaks`; otherwise the chunks are solved again.
    refine : bool, default True
        Find peaks between the instants as well: the motion is solved at more instants if it has few, and then again
        around the highest values. Otherwise only its instants and both sides of the breaks of its laws count. If code
        of the user has changed since the motion was solved, only its instants count.

    Returns
    -------
    list of Peak
        Outputs in the order of the mechanism, derivatives in rising order.

    Examples
    --------
    >>> import jounce as jn
    >>> motion = jn.solve(jn.load("examples/four_bar.yaml"), order=1)
    >>> [(p.output, p.derivative, p.unit, round(p.maximum, 4), round(p.maximum_at, 3)) for p in peaks(motion)][:2]
    [('psi', 'position', 'rad', 2.6436, 1.5), ('psi', 'velocity', 'rad/s', 1.5179, 1.069)]
    """
    name = _name(refine)
    if name not in motion.derived:
        for _ in parts_with_peaks(motion, refine=refine):
            pass
    return motion.derived[name]


def parts_with_peaks(motion: Motion | ChunkedMotion, *, refine: bool = True) -> Iterator[Motion]:
    """Yield the chunks of a motion for other uses, and store their `peaks` after the last one."""
    search = _PeakSearch()
    for part in motion if isinstance(motion, ChunkedMotion) else (motion,):
        search.add(part)
        yield part
    motion.derived[_name(refine)] = search.peaks_of(motion, refine=refine)


def _name(refine: bool) -> str:
    return "peaks" if refine else "peaks at the instants"


def table_peaks(dataset: xarray.Dataset, one_sided: xarray.Dataset | None = None) -> list[Peak]:
    """Return the peak values of torques and their rates, or of coordinates, at the instants of a dataset.

    Parameters
    ----------
    dataset : xarray.Dataset
        Variables with the dimensions time and derivative, and the attribute ``units``: N, N*m, m or rad.
    one_sided : xarray.Dataset, optional
        The same variables on both sides of breaks of laws.
    """
    peaks_found, coords = [], ("time", "derivative")
    times = np.concatenate([x["time"].values for x in (dataset, one_sided) if x is not None])
    for name, variable in dataset.data_vars.items():
        unit = variable.attrs["units"]
        variables = (variable, *(() if one_sided is None else (one_sided[name],)))
        for order, given in enumerate(np.concatenate([x.transpose(*coords).values for x in variables]).T):
            values, instants = (x[np.isfinite(given)] for x in (given, times))
            size = float(np.abs(values).max(initial=0.0))
            low = high = (np.nan, np.nan)
            if values.size:  # of equal extremes the earliest counts
                low, high = (
                    (float(x), float(instants[np.abs(values - x) <= ROUNDING * size].min()))
                    for x in (values.min(), values.max())
                )
            quantity = derivative_name(order) if unit in ("m", "rad") else effort_name(unit, order)
            peaks_found.append(Peak(str(name), quantity, derivative_unit(unit, order), *low, *high, size))
    return peaks_found


def shown_peaks(given: Sequence[Peak], units: ShownUnits) -> list[Peak]:
    """Return peaks in the shown units.

    Examples
    --------
    >>> import jounce as jn
    >>> units = jn.units.shown_units.ShownUnits({"length": "mm"})
    >>> shown_peaks([Peak("C_x", "velocity", "m/s", -0.5, 0.0, 2.0, 1.0, 2.0)], units)[0].minimum
    -500.0
    """
    selected = []
    for peak in given:
        stem = peak.output.rpartition("_")[0]
        name = stem if peak.output not in units.outputs and stem in units.outputs else peak.output
        unit, factor = units.of(peak.unit, name)
        sizes = {key: getattr(peak, key) * factor for key in ("minimum", "maximum", "size")}
        selected.append(dataclasses.replace(peak, unit=unit, **sizes))
    return selected


def effort_name(unit: str, order: int) -> str:
    """Return the name of a torque or a force, or of one of its rates.

    Examples
    --------
    >>> [effort_name("N*m", k) for k in (0, 1, 2, 3, 5)]
    ['torque', 'torque rate', 'second rate', 'third rate', '5th rate']
    """
    kind = "force" if unit == "N" else "torque"
    first = (kind, f"{kind} rate", "second rate", "third rate", "fourth rate")
    return first[order] if order < len(first) else f"{derivative_name(order)} rate"


class _PeakSearch:
    """A search for the peaks of a motion, which may arrive in chunks that are not stored."""

    def __init__(self) -> None:
        self._columns: dict[str, tuple[str, int]] = {}  # output and number of derivatives of each column
        self._maxima = RunningMaxima(PEAKS)

    def add(self, part: Motion) -> None:
        """Add the instants of a motion, or of its next chunk."""
        self._columns = {column: (name, x.shape[1]) for column, (name, x) in scalar_outputs(part).items()}
        if self._columns:
            self._maxima.add(part.time, _curves(part), _scales(part))

    def peaks_of(self, motion: Motion | ChunkedMotion, *, refine: bool) -> list[Peak]:
        """Return the peaks of a motion, as `peaks` does, after all its instants were added."""
        rows = [(column, name, order) for column, (name, orders) in self._columns.items() for order in range(orders)]
        if not rows:
            return []
        times, values = _extremes(motion, self._maxima, refine)
        extremes = [(-values[k], times[k], values[len(rows) + k], times[len(rows) + k]) for k in range(len(rows))]
        sizes: dict[tuple[str, int], float] = {}
        for (_, name, order), (low, _, high, _) in zip(rows, extremes, strict=True):
            sizes[name, order] = float(np.nanmax([sizes.get((name, order), 0.0), abs(low), abs(high)]))
        result = []
        for (column, name, order), numbers in zip(rows, extremes, strict=True):
            output = motion.mechanism.outputs[name]
            unit, numbers_of_peak = derivative_unit(output.unit, order), [float(x) for x in numbers]
            result.append(Peak(column, rate_name(output, order), unit, *numbers_of_peak, size=sizes[name, order]))
        return result


def _extremes(
    motion: Motion | ChunkedMotion, maxima: RunningMaxima, refine: bool
) -> tuple[Float[np.ndarray, " curves"], Float[np.ndarray, " curves"]]:
    """Return the instant and size of the maximum of each curve, (2 curves,): negated curves first, then curves.

    Around the highest instants, the best of a few points becomes the center of a shorter interval, repeatedly; the last
    evaluation is at the vertex of the parabola through three points. Of equal ones the earliest counts.
    """
    times, sizes = maxima.times.copy(), maxima.sizes.copy()
    rounding = ROUNDING * maxima.scales
    has_changed = _has_changed(motion)
    breaks, sides, one_sided = _one_sided(motion)
    if len(sides) and not has_changed:
        _keep_best(times, sizes, 0.0, np.repeat(breaks[:, None], len(sizes), axis=1), one_sided)
    if refine and len(motion.time) > 1 and not has_changed:
        low, high = _around_maxima(motion, maxima)
        fractions = np.linspace(0.0, 1.0, POINTS)[:, None, None]
        best, neighbors = (low.copy(), np.full(low.shape, -np.inf)), []
        for _ in range(ROUNDS):
            instants = low + fractions * (high - low)
            values = _own(motion, instants)
            _keep_best(*best, 0.0, instants, values)
            top = np.clip(np.argmax(values, axis=0), 1, POINTS - 2)
            neighbors = [np.take_along_axis(values, np.asarray(top + side)[None], axis=0)[0] for side in (-1, 0, 1)]
            low, high = (np.take_along_axis(instants, np.asarray(top + side)[None], axis=0)[0] for side in (-1, 1))
        vertex = _vertex(low, high, *neighbors)[None]
        _keep_best(*best, 0.0, vertex, _own(motion, vertex))
        equal = best[1] >= best[1].max(axis=0) - rounding
        first = np.argmin(np.where(equal, best[0], np.inf), axis=0)[None]
        _keep_best(times, sizes, rounding, *(np.take_along_axis(x, first, axis=0) for x in best))
    solved = np.isfinite(sizes)
    return np.where(solved, times, np.nan), np.where(solved, sizes, np.nan)


def _has_changed(motion: Motion | ChunkedMotion) -> bool:
    """Return whether code of the user gives other results than when the motion was solved."""
    elements = (element for part in motion.mechanism.elements.values() for element in part.values())
    if type(motion) is not Motion or not len(motion.time) or not holds_users_code(elements):
        return False
    sample = np.unique(np.linspace(0, len(motion.time) - 1, COMPARED).astype(int))
    current, stored = _at(motion, motion.time[sample]), _curves(motion)[sample]
    return not alike(current, stored)


def _one_sided(motion: Motion | ChunkedMotion) -> tuple[Times, Times, Curves]:
    """Return the breaks of the laws of a motion, the instants on both sides of each, and the curves at these."""
    if not len(motion.time):
        return np.zeros(0), np.zeros(0), np.zeros((0, 0))
    first, last = sorted((float(motion.time[0]), float(motion.time[-1])))  # a simulation may go backward
    extra_order = lost_orders(motion.mechanism.outputs.values())
    forces = isinstance(motion, Simulation) or None  # forces determine the motion of all bodies
    breaks = breaks_of_laws(motion.mechanism, first, last, motion.order + extra_order, forces=forces)
    if isinstance(motion, Simulation):
        breaks = np.unique(np.concatenate([breaks, [time for time, _ in motion.kinks]]))
    sides, indices = both_sides(breaks, first, last)
    return breaks[indices], sides, _at(motion, sides) if len(sides) else np.zeros((0, 0))


def _around_maxima(motion: Motion | ChunkedMotion, maxima: RunningMaxima) -> tuple[Peaks, Peaks]:
    """Return the instants before and after the highest local maxima, after adding instants if there are few."""
    steps = -(-LEAST // (len(motion.time) - 1))
    if steps == 1 or isinstance(motion, ChunkedMotion):
        return maxima.around_maxima()
    denser = RunningMaxima(PEAKS)
    denser.add(*_denser(motion, steps), maxima.scales)
    return denser.around_maxima()


def _denser(motion: Motion, steps: int) -> tuple[Float[np.ndarray, " denser"], Float[np.ndarray, "denser curves"]]:
    """Return instants and curves with a number of steps between instants, so that only needle-like peaks are missed."""
    time = motion.time
    inserted = (time[:-1, None] + np.diff(time)[:, None] * np.arange(1, steps) / steps).ravel()
    all_times = np.concatenate([time, inserted])
    order = np.argsort(all_times)
    return all_times[order], np.concatenate([_curves(motion), _at(motion, inserted)])[order]


def _own(motion: Motion | ChunkedMotion, times: _Around) -> _Around:
    """Return the values of each curve at its own instants, (points, peaks, curves)."""
    instants, inverse = np.unique(times, return_inverse=True)
    values = _at(motion, instants)
    return values[inverse.reshape(times.shape), np.arange(times.shape[-1])]


def _at(motion: Motion | ChunkedMotion, instants: Times) -> Curves:
    """Return the curves of a motion at other instants, -inf where it cannot be solved."""
    parts = []
    for first in range(0, len(instants), CHUNK):
        chunk = instants[first : first + CHUNK]
        if isinstance(motion, Simulation):
            parts.append(_curves(motion.at(chunk)))
            continue
        chunk_times = np.unique(np.append(chunk, motion.time[0]))  # with the same start, to stay on the same branch
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SampleWarning)  # the first solution of the motion has warned
            solved = solve(motion.mechanism, chunk_times, motion.order, strict=False)
        parts.append(_curves(solved)[np.searchsorted(chunk_times, chunk)])
    return np.concatenate(parts)


def _curves(motion: Motion) -> Curves:
    """Return all derivatives of all outputs, negated and as they are, (time, 2 curves); -inf where unknown."""
    columns = np.concatenate([values for _, values in scalar_outputs(motion).values()], axis=1)
    return np.nan_to_num(np.concatenate([-columns, columns], axis=1), nan=-np.inf, posinf=-np.inf, neginf=-np.inf)


def _scales(motion: Motion) -> Float[np.ndarray, " curves"]:
    """Return the largest magnitude among all components of the output of each curve, (2 curves,)."""
    scales = []
    for name, values in scalar_outputs(motion).values():
        whole = np.nan_to_num(motion.outputs[name]).reshape(*values.shape, -1)
        scales.append(np.abs(whole).max(axis=(0, 2)))
    return np.tile(np.concatenate(scales), 2)


def _keep_best(
    times: Float[np.ndarray, "*curves"],
    sizes: Float[np.ndarray, "*curves"],
    rounding: Float[np.ndarray, " curves"] | float,
    instants: Float[np.ndarray, "points *curves"],
    values: Float[np.ndarray, "points *curves"],
) -> None:
    """Replace maxima by values that are larger by more than rounding, so that requested instants are preferred."""
    time, size = (np.take_along_axis(x, np.argmax(values, axis=0)[None], axis=0)[0] for x in (instants, values))
    with np.errstate(invalid="ignore"):
        is_better = size > sizes + rounding
    times[is_better], sizes[is_better] = time[is_better], size[is_better]


def _vertex(low: Peaks, high: Peaks, *points: Peaks) -> Peaks:
    """Return the vertex of the parabola through three evenly spaced values, between the outer two."""
    left, middle, right = points
    with np.errstate(invalid="ignore", divide="ignore"):
        shift = 0.5 * (left - right) / (left - 2 * middle + right)
    shift = np.where(np.isfinite(shift), np.clip(shift, -1.0, 1.0), 0.0)
    return (low + high) / 2 + shift * (high - low) / 2
