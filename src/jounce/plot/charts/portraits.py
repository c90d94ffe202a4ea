"""Hodographs, which show the components of a derivative, and phase portraits, one derivative against another."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float
from numpy.polynomial.polynomial import polyder, polyval

from jounce.errors import MechanismError, check_name, did_you_mean
from jounce.kinematics import Motion
from jounce.plot.instants import evenly_chosen
from jounce.plot.labels import axis_range, quantity_word, scale_of, symbol, unit_label
from jounce.plot.style import COLORS, GRAY, PALE_GRAY, blank_figure, set_ticks, style
from jounce.reporting.peaks import rate_name
from jounce.trajectory.sampled.hermite import hermite_pieces

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ARROWS = 12  # vectors drawn from the origin of a hodograph
PROJECTIONS = ((0, 1), (0, 2), (1, 2))
SIDE = 3.4  # inches
SMOOTH = 600  # least number of steps of a curve
LEAVING = 0.25  # fraction of the range of the values by which a polynomial may leave it
Line = Float[np.ndarray, " time"]
Table = Float[np.ndarray, "time component"]


def hodograph(motion: Motion, output: str, order: int = 1) -> Figure:
    r"""Draw the hodograph of the velocity, acceleration, ... of a point: the curve of the tip of the vector.

    Parameters
    ----------
    motion : Motion
        The motion; unsolved instants are omitted.
    output : str
        Name of an output with components.
    order : int, default 1
        Derivative of the output: 1 velocity, 2 acceleration, 3 jerk, ...

    Returns
    -------
    matplotlib.figure.Figure
        One panel in the plane, or three projections in space, with the start and vectors at equal steps of time.

    Raises
    ------
    MechanismError
        If the output does not exist or has no components, or the order is above that of the motion.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot import hodograph
    >>> figure = hodograph(jn.solve(jn.load("examples/four_bar.yaml"), order=2), "C", order=2)
    >>> figure.axes[0].get_xlabel()
    '$\\ddot{C}_{x}$  (m/s$^2$)'
    """
    (values,), dense = _values(motion, output, (order,))
    outputs = motion.mechanism.outputs
    if motion.outputs[output].ndim != 3 or outputs[output].axes:
        vectors = [name for name, series in motion.outputs.items() if series.ndim == 3 and not outputs[name].axes]
        message = f"a hodograph needs an output with components; {did_you_mean(output, vectors)}"
        raise MechanismError(message, name="output", value=output)
    pairs = PROJECTIONS if values.shape[1] == 3 else PROJECTIONS[:1]
    its_output, exponent = outputs[output], scale_of(values)
    scaled = values * 10.0**-exponent
    unit = unit_label(motion.mechanism.shown_units.of(its_output.unit, output)[0], order, exponent)
    with style():
        figure = blank_figure(SIDE * len(pairs) + 0.4 * (len(pairs) == 1), SIDE + 0.3, _title(motion, output, (order,)))
        for axes, (i, j) in zip(np.atleast_1d(figure.subplots(1, len(pairs))), pairs, strict=True):
            solved = np.flatnonzero(np.isfinite(scaled).all(axis=1))
            for x, y in scaled[evenly_chosen(solved, ARROWS + 1)][:, [i, j]]:
                axes.plot([0, x], [0, y], color=PALE_GRAY, linewidth=0.7, zorder=1.5)
            axes.plot(*(dense[0][:, [i, j]] * 10.0**-exponent).T, color=COLORS[0])
            axes.plot([0], [0], marker="+", color=GRAY, markersize=7, linestyle="")
            _mark_start(axes, scaled[:, i], scaled[:, j])
            for label, k in ((axes.set_xlabel, i), (axes.set_ylabel, j)):
                label(f"{symbol(output, order, its_output.labels[k])}  ({unit})")
            axes.set_aspect("equal", adjustable="datalim")
            _few_ticks(axes)
    return figure


def phase_portrait(motion: Motion, output: str, orders: tuple[int, int] = (0, 1)) -> Figure:
    r"""Draw one derivative of an output against another, by default velocity against position.

    Parameters
    ----------
    motion : Motion
        The motion; unsolved instants are omitted.
    output : str
        Name of an output; each component has a panel.
    orders : tuple of int, default (0, 1)
        Derivatives along the horizontal and the vertical axis.

    Returns
    -------
    matplotlib.figure.Figure
        The portrait, with the start marked and an arrow in the direction of time.

    Raises
    ------
    MechanismError
        If the output does not exist, or an order is not among those of the motion.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot import phase_portrait
    >>> figure = phase_portrait(jn.solve(jn.load("examples/four_bar.yaml"), order=1), "psi")
    >>> figure.axes[0].get_xlabel(), len(figure.axes)
    ('$\\psi$  (rad)', 1)
    """
    pair = tuple(orders)
    (first, second), curves = _values(motion, output, pair)
    its_output, count = motion.mechanism.outputs[output], first.shape[1]
    unit, _ = motion.mechanism.shown_units.of(its_output.unit, output)
    with style():
        figure = blank_figure(SIDE * count + 0.5 * (count == 1), SIDE, _title(motion, output, pair))
        for k, axes in enumerate(figure.subplots(1, count, squeeze=False)[0]):
            component, scaled, dense = its_output.labels[k] if count > 1 else "", [], []
            axis_setters = ((axes.set_xlabel, axes.set_xlim), (axes.set_ylabel, axes.set_ylim))
            for (label, limits), order, values, curve in zip(axis_setters, pair, (first, second), curves, strict=True):
                exponent = scale_of(values)
                scaled.append(values[:, k] * 10.0**-exponent)
                dense.append(curve[:, k] * 10.0**-exponent)
                mark = symbol(output, order, component) or rate_name(its_output, order)
                label(f"{mark}  ({unit_label(unit, order, exponent)})")
                size = float(np.max(np.abs(values), initial=0.0, where=np.isfinite(values))) * 10.0**-exponent
                limits(axis_range(dense[-1], 0.06, size))  # so that rounding of a constant is not magnified
            axes.plot(*dense, color=COLORS[k % len(COLORS)])
            axes.axhline(0.0, color=PALE_GRAY, linewidth=0.7, zorder=1)
            _mark_start(axes, *scaled)
            _few_ticks(axes)
    return figure


def _values(motion: Motion, output: str, orders: tuple[int, ...]) -> tuple[list[Table], list[Table]]:
    """Return derivatives of an output in its shown unit, at the instants of a motion and as smooth curves.

    Between instants, the curves are Hermite polynomials with all derivatives at both ends.
    """
    check_name("output", output, motion.outputs, MechanismError, name="output")
    _, factor = motion.mechanism.shown_units.of(motion.mechanism.outputs[output].unit, output)
    values = motion.outputs[output] * factor
    for order in orders:
        if not 0 <= order < values.shape[1]:
            message = f"there are derivatives up to order {values.shape[1] - 1}; solve with a higher order"
            raise MechanismError(message, name="order", value=order)
    lowest = min(*orders, values.shape[1] - 2) if values.shape[1] > 1 else 0
    columns = values.reshape(*values.shape[:2], -1)
    curves = [
        np.stack([_curve(motion.time, jets, order - lowest) for jets in np.moveaxis(columns[:, lowest:], 2, 0)], axis=1)
        for order in orders
    ]
    return [values[:, order].reshape(len(values), -1) for order in orders], curves


def _curve(time: Line, jets: Float[np.ndarray, "time levels"], order: int) -> Line:
    """Return a derivative at and between instants, linear where the polynomials leave the range of the values."""
    finite, values = jets[np.isfinite(jets).all(axis=1), order], jets[:, order]
    steps = -(-SMOOTH // max(len(time) - 1, 1))
    if steps == 1 or len(finite) < 2:
        return values
    if time[-1] < time[0]:
        return _curve(time[::-1], jets[::-1], order)[::-1]
    powers = polyder(hermite_pieces(time, jets)[:, :-1], order)
    fractions = np.arange(steps) / steps
    smooth = polyval(fractions * np.diff(time)[:, None], powers[:, :, None], tensor=False)
    straight = values[:-1, None] + fractions * np.diff(values)[:, None]
    slack = LEAVING * np.ptp(finite)
    stays_near = ((smooth >= finite.min() - slack) & (smooth <= finite.max() + slack)).all(axis=1, keepdims=True)
    return np.append(np.where(stays_near, smooth, straight), values[-1])


def _title(motion: Motion, output: str, orders: tuple[int, ...]) -> str:
    names = [quantity_word(motion.mechanism.outputs[output], order) for order in orders]
    noun = f"hodograph of the {names[0]}" if len(names) == 1 else f"{names[1]} against {names[0]}"
    return f"{noun[0].upper()}{noun[1:]} of {output}"


def _mark_start(axes: Any, x: Float[np.ndarray, " time"], y: Float[np.ndarray, " time"]) -> None:
    """Mark the first instant, and the direction of time by an arrow on the curve."""
    for start in np.flatnonzero(np.isfinite(x) & np.isfinite(y))[:1]:
        axes.plot(x[start], y[start], marker="o", color=GRAY, fillstyle="none", markersize=5, linestyle="", zorder=4)
    spread = np.array([np.nanmax(v) - np.nanmin(v) if np.isfinite(v).any() else 0.0 for v in (x, y)])
    spread[spread == 0] = 1.0
    steps = np.hypot(np.diff(x) / spread[0], np.diff(y) / spread[1])
    if not np.isfinite(steps).any() or np.nansum(steps) == 0:
        return
    distance = np.cumsum(np.nan_to_num(steps))
    end = min(int(np.searchsorted(distance, 0.12 * distance[-1])) + 1, len(x) - 1)
    begin = max(end - 1, 0)
    if np.isfinite([x[begin], y[begin], x[end], y[end]]).all():
        arrow_style = {"arrowstyle": "-|>", "color": GRAY, "mutation_scale": 11, "linewidth": 0}
        axes.annotate("", (x[end], y[end]), (x[begin], y[begin]), arrowprops=arrow_style, zorder=5)


def _few_ticks(axes: Any) -> None:
    for axis in (axes.xaxis, axes.yaxis):
        set_ticks(axis, 5)
    axes.ticklabel_format(useOffset=False)
    axes.margins(0.06)
