"""Arrows, paths and loads over a recording, computed at all instants beforehand, so that playing is showing only."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float, UInt8

from jounce.viewer.shapes.arrows import Arrows, TracedPoint, arrows_along, colored_paths, length_scale, load_scale
from jounce.viewer.shapes.recording import Load, Recording


@dataclasses.dataclass(frozen=True)
class DisplayOptions:
    """What is shown over a recording.

    Parameters
    ----------
    traced : tuple of TracedPoint
        Points with arrows and paths.
    lengths : dict of int to float
        By what arrows of a derivative are longer than the automatic length.
    path_order : int, default 1
        Derivative whose size colors the paths.
    kinds : frozenset of str
        Of loads that are shown: reaction, driver, applied.
    force_length : float, default 1
        By what arrows of forces are longer than the automatic length.
    """

    traced: tuple[TracedPoint, ...] = ()
    lengths: Mapping[int, float] = dataclasses.field(default_factory=dict)
    path_order: int = 1
    kinds: frozenset[str] = frozenset()
    force_length: float = 1.0

    def fitted(self, recording: Recording) -> DisplayOptions:
        """Return the same for another recording: points by their names, and derivatives that it has."""
        known = {point.name: point for point in recording.appearance.points}
        traced = tuple(
            dataclasses.replace(
                each,
                point=known.get(each.point.name, each.point),
                orders=tuple(order for order in each.orders if order <= recording.order),
            )
            for each in self.traced
            if each.point.body in recording.bodies
        )
        return dataclasses.replace(self, traced=traced, path_order=min(self.path_order, recording.order))


@dataclasses.dataclass(frozen=True, eq=False)
class Overlay:
    """Arrows, paths and loads over a recording at all instants.

    Parameters
    ----------
    recording : Recording
    options : DisplayOptions
    arrows : dict of int to numpy.ndarray of shape (time, arrows, 2, 3)
        By derivative, m.
    scales : dict of int to float
        Length of an arrow by unit of the derivative, m.
    lines, colors : numpy.ndarray
        Of paths.
    extremes : tuple of float
        Sizes that the ends of the colors stand for.
    loads : sequence of Load
    forces : dict of str to numpy.ndarray of shape (time, arrows, 2, 3)
        By kind, m.
    force_scale : float
        Length of an arrow by N, m.
    largest_torque : float
        N m.
    """

    recording: Recording
    options: DisplayOptions
    arrows: Mapping[int, Arrows]
    scales: Mapping[int, float]
    lines: Float[np.ndarray, "lines 2 3"]
    colors: UInt8[np.ndarray, "lines 2 3"]
    extremes: tuple[float, float]
    loads: Sequence[Load]
    forces: Mapping[str, Arrows]
    force_scale: float
    largest_torque: float

    @classmethod
    def of(cls, recording: Recording, options: DisplayOptions) -> Overlay:
        """Compute what is to be shown.

        Raises
        ------
        JounceError
            If loads are requested and the order of the motion is too low for them.
        """
        options = options.fitted(recording)
        arrows, scales = {}, {}
        for order in sorted({order for each in options.traced for order in each.orders}):
            motions = [recording.motion(each.point) for each in options.traced if order in each.orders]
            automatic = length_scale(recording, [motion[:, order] for motion in motions]) or 1.0
            scales[order] = automatic * options.lengths.get(order, 1.0)
            pairs = [(motion[:, 0], motion[:, order]) for motion in motions]
            arrows[order] = arrows_along(recording, pairs, scales[order])
        loads = [load for load in recording.loads if load.kind in options.kinds] if options.kinds else []
        force_scale, largest = load_scale(recording, loads)
        force_scale *= options.force_length
        forces = {}
        for kind in options.kinds:
            pairs = [(load.point, load.force) for load in loads if load.kind == kind and load.force is not None]
            forces[kind] = arrows_along(recording, pairs, force_scale)
        paths = colored_paths(recording, options.traced, options.path_order)
        return cls(recording, options, arrows, scales, *paths, loads, forces, force_scale, largest)
