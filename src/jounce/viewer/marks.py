"""The tab of points: which have arrows and paths, how long the arrows are; and the tab of forces."""

from __future__ import annotations

import dataclasses
from typing import Any

from jounce.errors import JounceError
from jounce.reporting.peaks import derivative_name
from jounce.viewer.arrows import Marked
from jounce.viewer.page import Page
from jounce.viewer.take import Spot, Take

__all__ = ["Forces", "Marks"]

OWN = "a point of my own"
SHOWN = 4  # derivatives with a check box; higher ones are plotted


class Marks:
    """Controls of arrows and paths.

    Parameters
    ----------
    page : Page
        In whose GUI they are made, in the container of now.
    """

    def __init__(self, page: Page):
        self.page, self.gui = page, page.server.gui
        self._folders: list[Any] = []
        take = page.take
        self.add_folder = self.gui.add_folder("Add a point")
        with self.add_folder:
            names = (*(spot.name for spot in take.looks.spots), OWN)
            self.point = self.gui.add_dropdown("point", names, initial_value=names[0])
            self.body = self.gui.add_dropdown("body", take.bodies, initial_value=take.bodies[-1])
            step = 10.0 ** round(-3 + _decade(take.size))
            make = self.gui.add_vector2 if take.planar else self.gui.add_vector3
            zero = (0.0,) * (2 if take.planar else 3)
            self.place = make("place (m)", zero, step=step, hint="In the frame of the body")
            self.gui.add_button("Add", icon="plus").on_click(lambda _: self._add())
        self.point.on_update(lambda _: self._show_own())
        self._show_own()
        self.list = self.gui.add_folder("Arrows and paths")
        with self.gui.add_folder("Lengths and colours", expand_by_default=False):
            self._add_lengths(take)
        self.rebuild()

    def _show_own(self) -> None:
        own = self.point.value == OWN
        self.body.visible = self.place.visible = own

    def _add_lengths(self, take: Take) -> None:
        names = [derivative_name(k) for k in range(1, max(take.order, 1) + 1)]
        self.path = self.gui.add_dropdown("path colour", tuple(names), initial_value=names[0])
        self.path.on_update(lambda _: self._want(path_order=1 + names.index(self.path.value)))
        for order in range(1, min(take.order, SHOWN) + 1):
            slider = self.gui.add_slider(
                f"{derivative_name(order)} x", 0.1, 5.0, 0.1, 1.0, hint="Longer or shorter than the automatic length"
            )
            slider.on_update(lambda _, order=order, slider=slider: self._stretch(order, float(slider.value)))

    def _stretch(self, order: int, factor: float) -> None:
        self._want(stretch={**self.page.wanted.stretch, order: factor})

    def _want(self, **changes: Any) -> None:
        self.page.want(dataclasses.replace(self.page.wanted, **changes))

    def _add(self) -> None:
        take = self.page.take
        if self.point.value == OWN:
            place = tuple(float(x) for x in self.place.value)
            words = ", ".join(f"{x:g}" for x in place)
            spot = Spot(self.body.value, place, f"{self.body.value} ({words})")
        else:
            spot = next(s for s in take.looks.spots if s.name == self.point.value)
        self.mark(spot)

    def mark(self, spot: Spot, orders: tuple[int, ...] = (1, 2), path: bool = True) -> None:
        """Show arrows and the path of one more point."""
        marked = [mark for mark in self.page.wanted.marked if mark.spot.name != spot.name]
        orders = tuple(order for order in orders if order <= self.page.take.order)
        self._exchange((*marked, Marked(spot, orders, path)))

    def _exchange(self, marked: tuple[Marked, ...]) -> None:
        self._want(marked=marked)
        self.rebuild(marked)

    def rebuild(self, marked: tuple[Marked, ...] | None = None) -> None:
        """List the points that are marked, each with its check boxes."""
        marked = self.page.wanted.marked if marked is None else marked
        for folder in self._folders:
            folder.remove()
        self._folders = []
        with self.list:
            for mark in marked:
                folder = self.gui.add_folder(mark.spot.name)
                self._folders.append(folder)
                with folder:
                    self._add_boxes(mark)

    def _add_boxes(self, mark: Marked) -> None:
        for order in range(1, min(self.page.take.order, SHOWN) + 1):
            box = self.gui.add_checkbox(derivative_name(order), order in mark.orders)
            box.on_update(lambda _, order=order, box=box: self._switch(mark.spot, order, bool(box.value)))
        box = self.gui.add_checkbox("path", mark.path)
        box.on_update(lambda _, box=box: self._replace(mark.spot, path=bool(box.value)))
        self.gui.add_button("Remove", icon="trash").on_click(lambda _: self._remove(mark.spot))

    def _switch(self, spot: Spot, order: int, on: bool) -> None:
        for mark in self.page.wanted.marked:
            if mark.spot.name == spot.name:
                orders = {*mark.orders, order} if on else {*mark.orders} - {order}
                self._replace(spot, orders=tuple(sorted(orders)))

    def _replace(self, spot: Spot, **parts: Any) -> None:
        marked = self.page.wanted.marked
        changed = (dataclasses.replace(m, **parts) if m.spot.name == spot.name else m for m in marked)
        self._want(marked=tuple(changed))

    def _remove(self, spot: Spot) -> None:
        self._exchange(tuple(mark for mark in self.page.wanted.marked if mark.spot.name != spot.name))

    def on_take(self, take: Take) -> None:
        """Offer the points of a new motion."""
        names = (*(spot.name for spot in take.looks.spots), OWN)
        if tuple(self.point.options) != names:
            self.point.options = names

    def on_failure(self, error: JounceError) -> None:
        """Nothing to be done."""

    def on_busy(self, busy: bool) -> None:
        """Nothing to be done."""

    def on_time(self, instant: float) -> None:
        """Nothing to be done."""

    def on_frame(self, take: Take, frame: int) -> None:
        """Nothing to be done."""


class Forces:
    """Controls of the arrows of forces.

    Parameters
    ----------
    page : Page
    loaded : bool
        Whether anything has a mass, or forces are applied.
    """

    WORDS = {"reaction": "reactions of joints", "driver": "forces of drivers", "applied": "applied forces"}

    def __init__(self, page: Page, loaded: bool):
        self.page, gui = page, page.server.gui
        if not loaded:
            gui.add_markdown(
                "Nothing here has a mass, and no force is applied. Give bodies `mass` and `inertia` to see what joints "
                "and drivers carry."
            )
            return
        self.boxes = {kind: gui.add_checkbox(words, False) for kind, words in self.WORDS.items()}
        for box in self.boxes.values():
            box.on_update(lambda _: self._want())
        self.length = gui.add_slider("length x", 0.1, 5.0, 0.1, 1.0)
        self.length.on_update(lambda _: self._want())
        gui.add_markdown(
            "Straight arrows are forces, on the second body of a joint; round ones torques, about their axes. The "
            "legend has the numbers."
        )

    def _want(self) -> None:
        kinds = frozenset(kind for kind, box in self.boxes.items() if box.value)
        factor = float(self.length.value)
        self.page.want(dataclasses.replace(self.page.wanted, kinds=kinds, force_stretch=factor))


def _decade(size: float) -> int:
    import math

    return math.floor(math.log10(size)) if size > 0 else 0
