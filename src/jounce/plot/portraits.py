"""Hodographs and phase portraits: a derivative by its components, and one derivative against another."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from jounce.errors import MechanismError, check_name, did_you_mean
from jounce.plot.labels import scale_of, symbol, unit_label
from jounce.plot.style import COLOURS, GREY, PALE_GREY, blank_figure, style
from jounce.reporting.peaks import rate_name

__all__ = ["hodograph", "phase_portrait"]

ARROWS = 12  # vectors drawn from the origin of a hodograph
PROJECTIONS = ((0, 1), (0, 2), (1, 2))
SIDE = 3.4  # inches


def hodograph(motion: Any, output: str, order: int = 1) -> Any:
    r"""Draw the curve that the tip of a vector runs through: the hodograph of a point's velocity, acceleration, ...

    Parameters
    ----------
    motion : Motion
        Instants that were not solved are left out.
    output : str
        Name of an output with components.
    order : int, default 1
        Derivative of the output: 1 velocity, 2 acceleration, 3 jerk, ...

    Returns
    -------
    matplotlib.figure.Figure
        One panel in the plane; three projections in space. The start is marked, and vectors at equal steps of time.

    Raises
    ------
    MechanismError
        No output has this name, it has no components, or the order is above that of the motion.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot import hodograph
    >>> figure = hodograph(jn.solve(jn.load("examples/four_bar.yaml"), order=2), "C", order=2)
    >>> figure.axes[0].get_xlabel()
    '$\\ddot{C}_{x}$  (m/s$^2$)'
    """
    values = _values(motion, output, (order,))[0]
    outputs = motion.mechanism.outputs
    if values.ndim != 2 or outputs[output].axes:
        vectors = [name for name, found in motion.outputs.items() if found.ndim == 3 and not outputs[name].axes]
        message = f"a hodograph needs an output with components; {did_you_mean(output, vectors)}"
        raise MechanismError(message, name="output", value=output)
    pairs = PROJECTIONS if values.shape[1] == 3 else PROJECTIONS[:1]
    its_output = motion.mechanism.outputs[output]
    exponent = scale_of(values)
    scaled = values * 10.0**-exponent
    unit = unit_label(its_output.unit, order, exponent)
    with style():
        figure = blank_figure(SIDE * len(pairs) + 0.4 * (len(pairs) == 1), SIDE + 0.3, _title(motion, output, (order,)))
        for axes, (i, j) in zip(np.atleast_1d(figure.subplots(1, len(pairs))), pairs, strict=True):
            for x, y in scaled[_spread(scaled, ARROWS)][:, [i, j]]:
                axes.plot([0, x], [0, y], color=PALE_GREY, linewidth=0.7, zorder=1.5)
            axes.plot(scaled[:, i], scaled[:, j], color=COLOURS[0])
            axes.plot([0], [0], marker="+", color=GREY, markersize=7, linestyle="")
            _mark_start(axes, scaled[:, i], scaled[:, j])
            for label, k in ((axes.set_xlabel, i), (axes.set_ylabel, j)):
                label(f"{symbol(output, order, its_output.labels[k])}  ({unit})")
            axes.set_aspect("equal", adjustable="datalim")
            _few_ticks(axes)
    return figure


def phase_portrait(motion: Any, output: str, orders: tuple[int, int] = (0, 1)) -> Any:
    r"""Draw one derivative of an output against another, by default velocity against position.

    Parameters
    ----------
    motion : Motion
        Instants that were not solved are left out.
    output : str
        Name of an output; one with components gets a panel for each.
    orders : tuple of int, default (0, 1)
        Derivatives along the axes to the right and upward.

    Returns
    -------
    matplotlib.figure.Figure
        The start is marked, and an arrow shows the sense of time.

    Raises
    ------
    MechanismError
        No output has this name, or an order is not among those of the motion.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot import phase_portrait
    >>> figure = phase_portrait(jn.solve(jn.load("examples/four_bar.yaml"), order=1), "psi")
    >>> figure.axes[0].get_xlabel(), len(figure.axes)
    ('$\\psi$  (rad)', 1)
    """
    pair = tuple(orders)
    first, second = (values.reshape(len(values), -1) for values in _values(motion, output, pair))
    its_output, count = motion.mechanism.outputs[output], first.shape[1]
    exponents = scale_of(first), scale_of(second)
    with style():
        figure = blank_figure(SIDE * count + 0.5 * (count == 1), SIDE, _title(motion, output, pair))
        for k, axes in enumerate(np.atleast_1d(figure.subplots(1, count))):
            x, y = first[:, k] * 10.0 ** -exponents[0], second[:, k] * 10.0 ** -exponents[1]
            axes.plot(x, y, color=COLOURS[k % len(COLOURS)])
            axes.axhline(0.0, color=PALE_GREY, linewidth=0.7, zorder=1)
            _mark_start(axes, x, y)
            component = its_output.labels[k] if count > 1 else ""
            for label, order, exponent in zip((axes.set_xlabel, axes.set_ylabel), pair, exponents, strict=True):
                mark = symbol(output, order, component) or rate_name(its_output, order)
                label(f"{mark}  ({unit_label(its_output.unit, order, exponent)})")
            _few_ticks(axes)
            _set_limits(axes, (x, first, exponents[0]), (y, second, exponents[1]))
    return figure


def _set_limits(axes: Any, *shown: tuple[np.ndarray, np.ndarray, int]) -> None:
    """Keep an axis on which nothing changes but rounding from being magnified to it."""
    for limits, (values, all_components, exponent) in zip((axes.set_xlim, axes.set_ylim), shown, strict=True):
        known, whole = values[np.isfinite(values)], all_components[np.isfinite(all_components)]
        size = float(np.max(np.abs(whole), initial=0.0)) * 10.0**-exponent
        if (known.size and np.ptp(known) <= 1e-9 * size) or not size:
            middle = float(known.mean()) if known.size else 0.0
            limits(middle - (0.5 * size or 1.0), middle + (0.5 * size or 1.0))


def _values(motion: Any, output: str, orders: tuple[int, ...]) -> list[np.ndarray]:
    """Return derivatives of an output, or raise for a name or an order that there is not."""
    check_name("output", output, motion.outputs, MechanismError, name="output")
    values = motion.outputs[output]
    for order in orders:
        if not 0 <= order < values.shape[1]:
            message = f"there are derivatives up to order {values.shape[1] - 1}; solve with a higher order"
            raise MechanismError(message, name="order", value=order)
    return [values[:, order] for order in orders]


def _title(motion: Any, output: str, orders: tuple[int, ...]) -> str:
    words = [rate_name(motion.mechanism.outputs[output], order) for order in orders]
    words = [
        "angle" if word == "position" and motion.mechanism.outputs[output].unit == "rad" else word for word in words
    ]
    what = f"hodograph of the {words[0]}" if len(words) == 1 else f"{words[1]} against {words[0]}"
    return f"{what[0].upper()}{what[1:]} of {output}"


def _spread(values: np.ndarray, count: int) -> np.ndarray:
    """Return indices of some solved instants, evenly spread."""
    solved = np.flatnonzero(np.isfinite(values).all(axis=1))
    return solved[np.unique(np.linspace(0, len(solved) - 1, count + 1).round().astype(int))] if len(solved) else solved


def _mark_start(axes: Any, x: np.ndarray, y: np.ndarray) -> None:
    """Mark the first instant, and the sense of time by an arrow on the curve."""
    for start in _solved(x, y):
        axes.plot(x[start], y[start], marker="o", color=GREY, fillstyle="none", markersize=5, linestyle="", zorder=4)
        break
    spread = np.array([np.nanmax(v) - np.nanmin(v) if np.isfinite(v).any() else 0.0 for v in (x, y)])
    spread[spread == 0] = 1.0
    steps = np.hypot(np.diff(x) / spread[0], np.diff(y) / spread[1])
    if not np.isfinite(steps).any() or np.nansum(steps) == 0:
        return
    way = np.cumsum(np.nan_to_num(steps))
    at = min(int(np.searchsorted(way, 0.12 * way[-1])) + 1, len(x) - 1)
    begin = max(at - 1, 0)
    if np.isfinite([x[begin], y[begin], x[at], y[at]]).all():
        look = {"arrowstyle": "-|>", "color": GREY, "mutation_scale": 11, "linewidth": 0}
        axes.annotate("", (x[at], y[at]), (x[begin], y[begin]), arrowprops=look, zorder=5)


def _solved(x: np.ndarray, y: np.ndarray) -> Iterator[int]:
    yield from np.flatnonzero(np.isfinite(x) & np.isfinite(y)).tolist()


def _few_ticks(axes: Any) -> None:
    from matplotlib.ticker import MaxNLocator

    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 2.5, 5, 10]))
    axes.ticklabel_format(useOffset=False)
    axes.margins(0.06)
