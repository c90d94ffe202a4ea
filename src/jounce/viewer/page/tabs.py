"""The tab of arrows, with the points that have arrows and paths, and the tab of forces."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from jounce.reporting.peaks import derivative_name
from jounce.viewer.page.page import Observer, Page
from jounce.viewer.shapes.appearance import BodyPoint
from jounce.viewer.shapes.arrows import LOAD_WORDS, TracedPoint
from jounce.viewer.shapes.recording import Recording

OWN = "a point of my own"
SHOWN = 4  # derivatives with a check box; higher ones have plots only
SCALE_HINT = "Factor by which arrows are longer than the automatic length"


class ArrowsTab(Observer):
    """Controls of arrows and paths.

    Parameters
    ----------
    page : Page
        The page, in whose current GUI container the controls are created.
    """

    def __init__(self, page: Page):
        self.page, self.gui = page, page.server.gui
        self._folders: list[Any] = []
        recording = page.recording
        with self.gui.add_folder("Add a point"):
            names = self._offered(recording)
            self.point = self.gui.add_dropdown("point", names, initial_value=names[0])
            self.body = self.gui.add_dropdown("body", recording.bodies, initial_value=recording.bodies[-1])
            step = 10.0 ** round(-3 + math.floor(math.log10(recording.size)))
            add_vector, components = (self.gui.add_vector2, 2) if recording.planar else (self.gui.add_vector3, 3)
            self.own_point = add_vector("place (m)", (0.0,) * components, step=step, hint="In the frame of the body")
            self.gui.add_button("Add", icon="plus").on_click(lambda _: self._add())
        self.point.on_update(lambda _: self._show_own())
        self._show_own()
        self.list = self.gui.add_folder("Arrows and paths")
        with self.gui.add_folder("Lengths and colors", expand_by_default=False):
            self._add_lengths(recording.order)
        self._rebuild(page.options.traced)

    def _offered(self, recording: Recording) -> tuple[str, ...]:
        return (*(point.name for point in recording.appearance.points), OWN)

    def _show_own(self) -> None:
        self.body.visible = self.own_point.visible = self.point.value == OWN

    def _add_lengths(self, max_order: int) -> None:
        names = tuple(derivative_name(k) for k in range(1, max(max_order, 1) + 1))
        self.path = self.gui.add_dropdown("path color", names, initial_value=names[0])
        self.path.on_update(lambda _: self._set(path_order=1 + names.index(self.path.value)))
        for order, name in enumerate(names[: min(max_order, SHOWN)], 1):
            slider = self.gui.add_slider(f"{name} scale", 0.1, 5.0, 0.1, 1.0, hint=SCALE_HINT)
            slider.on_update(lambda event, order=order: self._set_length(order, float(event.target.value)))

    def _set_length(self, order: int, factor: float) -> None:
        self._set(lengths={**self.page.options.lengths, order: factor})

    def _set(self, **changes: Any) -> None:
        self.page.set_options(replace(self.page.options, **changes))

    def _add(self) -> None:
        if self.point.value == OWN:
            own_point = tuple(float(x) for x in self.own_point.value)
            coordinates = ", ".join(f"{x:g}" for x in own_point)
            self.trace(BodyPoint(self.body.value, own_point, f"{self.body.value} ({coordinates})"))
        else:
            points = self.page.recording.appearance.points
            self.trace(next(point for point in points if point.name == self.point.value))

    def trace(self, point: BodyPoint, orders: tuple[int, ...] = (1, 2), path: bool = True) -> None:
        """Show the arrows and the path of another point."""
        orders = tuple(order for order in orders if order <= self.page.recording.order)
        self._exchange((*self._others(point), TracedPoint(point, orders, path)))

    def _others(self, point: BodyPoint) -> tuple[TracedPoint, ...]:
        return tuple(trace for trace in self.page.options.traced if trace.point.name != point.name)

    def _exchange(self, traced: tuple[TracedPoint, ...]) -> None:
        self._set(traced=traced)
        self._rebuild(traced)

    def _rebuild(self, traced: tuple[TracedPoint, ...]) -> None:
        """Rebuild the list of traced points, each with its check boxes."""
        for folder in self._folders:
            folder.remove()
        with self.list:
            self._folders = [self._add_boxes(trace) for trace in traced]

    def _add_boxes(self, traced: TracedPoint) -> Any:
        point, folder = traced.point, self.gui.add_folder(traced.point.name)
        with folder:
            for order in range(1, min(self.page.recording.order, SHOWN) + 1):
                box = self.gui.add_checkbox(derivative_name(order), order in traced.orders)
                box.on_update(lambda event, order=order: self._switch(point, order, bool(event.target.value)))
            box = self.gui.add_checkbox("path", traced.path)
            box.on_update(lambda event: self._replace(point, path=bool(event.target.value)))
            removal = self.gui.add_button("Remove", icon="trash")
            removal.on_click(lambda _: self._exchange(self._others(point)))
        return folder

    def _switch(self, point: BodyPoint, order: int, on: bool) -> None:
        for trace in self.page.options.traced:
            if trace.point.name == point.name:
                orders = {*trace.orders, order} if on else {*trace.orders} - {order}
                self._replace(point, orders=tuple(sorted(orders)))

    def _replace(self, point: BodyPoint, **parts: Any) -> None:
        traced = self.page.options.traced
        self._set(
            traced=tuple(replace(trace, **parts) if trace.point.name == point.name else trace for trace in traced)
        )

    def on_recording(self, recording: Recording) -> None:
        """Update the list of points for a new motion."""
        names = self._offered(recording)
        if tuple(self.point.options) != names:
            self.point.options = names


class ForcesTab:
    """Controls of the arrows of forces.

    Parameters
    ----------
    page : Page
    loaded : bool
        Whether a body has a mass, or forces are applied.
    """

    def __init__(self, page: Page, loaded: bool):
        self.page, gui = page, page.server.gui
        if not loaded:
            gui.add_markdown(
                "Nothing here has a mass, and no force is applied. Give bodies `mass` and `inertia` to see what joints "
                "and drivers carry."
            )
            return
        self.boxes = {kind: gui.add_checkbox(label, False) for kind, label in LOAD_WORDS.items()}
        self.length = gui.add_slider("arrow scale", 0.1, 5.0, 0.1, 1.0, hint=SCALE_HINT)
        for control in (*self.boxes.values(), self.length):
            control.on_update(lambda _: self._set())
        gui.add_markdown(
            "Straight arrows are forces, on the second body of a joint; round ones torques, about their axes. The "
            "legend has the numbers."
        )

    def _set(self) -> None:
        kinds = frozenset(kind for kind, box in self.boxes.items() if box.value)
        self.page.set_options(replace(self.page.options, kinds=kinds, force_length=float(self.length.value)))
