"""Plots of quantities over time with a cursor at the current instant."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.plot.labels import axis_range, scale_of
from jounce.plot.style import COLORS
from jounce.units.shown_units import derivative_unit, raised
from jounce.viewer.page.legend import legend
from jounce.viewer.page.page import Observer, Page
from jounce.viewer.shapes.recording import Recording

Times = Float[np.ndarray, " time"]
CURSOR = "#555555"
TICKS = {"size": 4}
SETTLING = 1.5  # s


def cursor_data(
    time: Times, values: Float[np.ndarray, "time component"], frame: int
) -> tuple[Float[np.ndarray, " longer"], ...]:
    """Return the data of a plot: time, components, and a vertical line at an instant, which occurs twice.

    Parameters
    ----------
    time : array of shape (time,)
    values : array of shape (time, components)
    frame : int

    Examples
    --------
    >>> import numpy as np
    >>> t, y, line = cursor_data(np.array([0.0, 1.0]), np.array([[3.0], [5.0]]), 1)
    >>> t.round(6).tolist(), y.tolist(), line.tolist()
    ([0.0, 1.0, 1.0], [3.0, 5.0, 5.0], [nan, 3.0, 5.0])
    """
    after = time[frame] + 1e-9 * (time[-1] - time[0])  # distinct, as the page otherwise finds no ticks
    times = np.insert(time, min(frame + 1, len(time)), after)
    lines = [np.insert(column, frame, column[frame]) for column in values.T]
    low, high = axis_range(values)
    cursor = np.full(len(times), np.nan)
    cursor[frame : frame + 2] = low, high
    return times, *lines, cursor


def cleaned(
    time: Times, values: Float[np.ndarray, "time derivative component"], order: int
) -> Float[np.ndarray, "time component"]:
    """Return a derivative, (time, components), or zeros if it is only rounding of lower ones.

    Parameters
    ----------
    time : array of shape (time,)
    values : array of shape (time, orders, components)
    order : int

    Examples
    --------
    >>> import numpy as np
    >>> steady = np.array([[[1.0], [2.0], [3e-14]], [[3.0], [2.0], [-1e-14]]])
    >>> cleaned(np.array([0.0, 1.0]), steady, 2).tolist()
    [[0.0], [0.0]]
    """
    duration = float(time[-1] - time[0]) or 1.0
    sizes = [np.abs(values[:, k]).max(initial=0.0) / duration ** (order - k) for k in range(order + 1)]
    return values[:, order] if sizes[-1] > 1e-9 * max(sizes) else np.zeros_like(values[:, order])


def default_charts(recording: Recording) -> list[tuple[str, int]]:
    """Return the output and the derivative of the initial plots of a page."""
    names = list(recording.outputs)
    if not names:
        return []
    first = names[0]
    max_order = recording.outputs[first].values.shape[1] - 1
    return [(first, 0), *([(first, min(2, max_order))] if max_order else [])]


class Chart:
    """One plot on the page.

    Parameters
    ----------
    gui : viser.GuiApi
        GUI in the context of the container of the plot.
    recording : Recording
    name : str
        Name of the quantity.
    order : int
        Derivative.
    """

    def __init__(self, gui: Any, recording: Recording, name: str, order: int):
        self.name, self.order = name, order
        title, scales = self._read(recording)
        count, unmarked = self.values.shape[1], {"show": False}
        labels = [f"{name} {c}" for c in recording.outputs[name].labels[:count]] if count > 1 else [name]
        looks = {"width": 1.6, "points": unmarked}
        lines = [{"label": label, "stroke": COLORS[k % 3], **looks} for k, label in enumerate(labels)]
        cursor = {"label": "now", "stroke": CURSOR, "width": 1.2, "dash": (4, 3), "points": unmarked}
        time_axis = {"label": "time (s)", "labelFont": "11px sans-serif", "labelSize": 15, "size": 28, "ticks": TICKS}
        self.handle = gui.add_uplot(
            cursor_data(self.time, self.values, 0),
            ({"label": "time"}, *lines, cursor),
            title=title,
            scales=scales,
            axes=(time_axis, {"size": 58, "ticks": TICKS}),
            legend={"show": count > 1, "live": False},
            height=180,
            padding=(6, 14, 4 if count > 1 else 0, 0),
        )

    def _read(self, recording: Recording) -> tuple[str, dict[str, Any]]:
        """Read the plotted data of a motion, without rounding errors, and return the title and the scales."""
        quantity = recording.outputs[self.name]
        values = cleaned(recording.time, quantity.values, self.order)
        exponent = scale_of(values)
        self.time, self.values = recording.time, values * 10.0**-exponent
        unit = derivative_unit(quantity.unit, self.order)
        unit = raised(f"10^{exponent} {unit}" if exponent else unit)
        scale = {"time": False, "range": (float(self.time[0]), float(self.time[-1]))}
        upward = {"auto": False, "range": axis_range(self.values, 0.06)}
        return f"{self.name}: {quantity.words[self.order]} ({unit})", {"x": scale, "y": upward}

    def renew(self, recording: Recording) -> None:
        """Fit the axes to another motion."""
        self.handle.title, self.handle.scales = self._read(recording)

    def show(self, frame: int) -> None:
        """Move the cursor to an instant."""
        self.handle.data = cursor_data(self.time, self.values, frame)

    def fits(self, recording: Recording) -> bool:
        """Return whether a recording has the quantity and the derivative."""
        return self.name in recording.outputs and self.order < recording.outputs[self.name].values.shape[1]

    def remove(self) -> None:
        """Remove the plot."""
        self.handle.remove()


class Plots(Observer):
    """The panel on the left: the legend, and plots of any output to any order.

    Parameters
    ----------
    page : Page
        The page.
    """

    def __init__(self, page: Page):
        self.page, self.gui = page, page.server.gui
        self.panel = self.gui.add_panel()
        self.panel.dock_left()
        self.panel.set_width(370)
        self.charts: list[Chart] = []
        self._folders: list[Any] = []
        recording = page.recording
        self.tab = self.panel.add_tab("Legend and plots", "chart-line")
        with self.tab:
            self.legend = self.gui.add_html("")
            self.space = self.gui.add_folder("Plots")
            with self.gui.add_folder("Add a plot", expand_by_default=False):
                names = tuple(recording.outputs) or ("none",)
                self.output = self.gui.add_dropdown("output", names, initial_value=names[0])
                self.derivative = self.gui.add_dropdown("derivative", self._words(recording, names[0]))
                self.output.on_update(lambda _: self._offer())
                self.gui.add_button("Add", icon="plus").on_click(lambda _: self._add_chosen())
                self.gui.add_button("Remove the last", icon="trash").on_click(lambda _: self.remove())
                self.order = self.gui.add_number(
                    "highest derivative",
                    recording.order,
                    min=0,
                    max=30,
                    step=1,
                    hint="Solves again, to any order up to 30",
                )
                self.order.on_update(lambda event: self._solve_to(event))
        for name, order in default_charts(recording):
            self.add(name, order)
        self._fixed_until = 0.0
        page.server.on_client_connect(lambda _: self._settle())

    def _settle(self) -> None:
        """Wait for a new browser to lay out the plots, as earlier data would leave them without ticks."""
        self._fixed_until = time.monotonic() + SETTLING
        time.sleep(SETTLING)
        with self.page.lock:
            for chart in self.charts:
                chart.renew(self.page.recording)
                chart.show(self.page.frame)

    def _words(self, recording: Recording, name: str) -> tuple[str, ...]:
        if name not in recording.outputs:
            return ("0:",)
        quantity = recording.outputs[name]
        return tuple(f"{k}: {quantity.words[k]}" for k in range(quantity.values.shape[1]))

    def _offer(self) -> None:
        self.derivative.options = self._words(self.page.recording, self.output.value)

    def _add_chosen(self) -> None:
        self.add(self.output.value, int(self.derivative.value.partition(":")[0]))
        self._settle()

    def _solve_to(self, event: Any) -> None:
        if event.client is not None:
            self.page.session.request(order=int(self.order.value))

    def add(self, name: str, order: int) -> None:
        """Add a plot of a derivative of an output."""
        page = self.page
        with page.lock, self.space:
            if name in page.recording.outputs:
                self.charts.append(Chart(self.gui, page.recording, name, order))
                self.charts[-1].show(page.frame)

    def remove(self) -> None:
        """Remove the last plot."""
        with self.page.lock:
            if self.charts:
                self.charts.pop().remove()

    def on_recording(self, recording: Recording) -> None:
        """Plot a new motion, and remove plots of derivatives that it does not have."""
        for chart in [chart for chart in self.charts if not chart.fits(recording)]:
            self.charts.remove(chart)
            chart.remove()
        for chart in self.charts:
            chart.renew(recording)
        names = tuple(recording.outputs) or ("none",)
        if tuple(self.output.options) != names:
            self.output.options = names
        if tuple(self.derivative.options) != self._words(recording, self.output.value):
            self._offer()

    def on_frame(self, frame: int) -> None:
        """Move the cursors, and update the legend."""
        if time.monotonic() >= self._fixed_until:
            for chart in self.charts:
                chart.show(frame)
        self.legend.content = legend(self.page.overlay, frame)
