"""Everything that is drawn of a take at any instant, computed beforehand, so that playing is showing only."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jounce.viewer.arrows import (
    KINDS,
    Marked,
    arrows_of,
    coloured_path,
    force_arrows,
    force_scale,
    in_front,
    length_scale,
)
from jounce.viewer.take import Exertion, Take

__all__ = ["Prepared", "Wanted"]

NONE = np.zeros((0, 2, 3))


@dataclasses.dataclass(frozen=True)
class Wanted:
    """What is to be shown of a take.

    Parameters
    ----------
    marked : tuple of Marked
        Points with arrows and paths.
    stretch : dict of int to float
        By what arrows of a derivative are longer than the automatic length.
    path_order : int, default 1
        Derivative whose size colours the paths.
    kinds : frozenset of str
        Of forces that are shown: reaction, driver, applied.
    force_stretch : float, default 1
        By what arrows of forces are longer than the automatic length.
    """

    marked: tuple[Marked, ...] = ()
    stretch: Mapping[int, float] = dataclasses.field(default_factory=dict)
    path_order: int = 1
    kinds: frozenset[str] = frozenset()
    force_stretch: float = 1.0

    def fitted(self, take: Take) -> Wanted:
        """Return what is wanted of another take: points by their names, and derivatives that it has."""
        known = {spot.name: spot for spot in take.looks.spots}
        marked = tuple(
            Marked(
                known.get(mark.spot.name, mark.spot),
                tuple(order for order in mark.orders if order <= take.order),
                mark.path,
            )
            for mark in self.marked
            if mark.spot.body in take.bodies
        )
        return dataclasses.replace(self, marked=marked, path_order=min(self.path_order, take.order))


@dataclasses.dataclass(frozen=True, eq=False)
class Prepared:
    """Arrows, paths and forces of a take at all instants.

    Parameters
    ----------
    take : Take
    wanted : Wanted
    arrows : dict of int to array of shape (time, arrows, 2, 3)
        By derivative, m.
    scales : dict of int to float
        Length of an arrow by unit of the derivative, m.
    lines, colours : array
        Of paths.
    extremes : tuple of float
        Sizes that the ends of the colours stand for.
    exertions : list of Exertion
    forces : dict of str to array of shape (time, arrows, 2, 3)
        By kind, m.
    force_scale : float
        Length of an arrow by N, m.
    largest_torque : float
        N m.
    """

    take: Take
    wanted: Wanted
    arrows: Mapping[int, np.ndarray]
    scales: Mapping[int, float]
    lines: np.ndarray
    colours: np.ndarray
    extremes: tuple[float, float]
    exertions: Sequence[Exertion]
    forces: Mapping[str, np.ndarray]
    force_scale: float
    largest_torque: float

    @classmethod
    def of(cls, take: Take, wanted: Wanted) -> Prepared:
        """Compute what is wanted.

        Raises
        ------
        JounceError
            If forces are wanted and the order of the motion is too low for them.
        """
        wanted = wanted.fitted(take)
        marked = wanted.marked
        used = sorted({order for mark in marked for order in mark.orders})
        scales = {order: length_scale(take, marked, order) * wanted.stretch.get(order, 1.0) for order in used}
        arrows = {order: arrows_of(take, marked, order, scales[order]) for order in used}
        exertions = [e for e in take.exertions if e.kind in wanted.kinds] if wanted.kinds else []
        scale, largest = force_scale(take, exertions)
        scale *= wanted.force_stretch
        forces = {
            kind: force_arrows(take, [e for e in exertions if e.kind == kind], scale) for kind in sorted(wanted.kinds)
        }
        paths = coloured_path(take, marked, wanted.path_order)
        return cls(take, wanted, arrows, scales, *paths, exertions, forces, scale if exertions else 0.0, largest)

    def begin(self, scene: Any) -> None:
        """Show what does not change with time."""
        scene.remake_arrows()
        scene.paths(self.lines, self.colours)

    def show(self, scene: Any, frame: int) -> None:
        """Show an instant."""
        scene.show(self.take, frame)
        for order in range(1, max([self.take.order, *self.arrows]) + 1):
            arrows = self.arrows.get(order)
            scene.derivative_arrows(order, NONE if arrows is None else arrows[frame])
        for kind, colour in KINDS.items():
            arrows = self.forces.get(kind)
            scene.arrows(kind, NONE if arrows is None else arrows[frame], colour)
        scene.torques(self.exertions, frame, self.largest_torque, in_front(self.take))
