"""Arrows, paths and loads of a recording, computed for all instants in advance, so that playing only displays them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float, UInt8

from jounce.viewer.shapes.arrows import Arrows, TracedPoint, arrows_along, colored_paths, length_scale, load_scale
from jounce.viewer.shapes.recording import Load, Recording


@dataclasses.dataclass(frozen=True)
class DisplayOptions:
    """Display options of a recording.

    Parameters
    ----------
    traced : tuple of TracedPoint
        Points with arrows and paths.
    lengths : dict of int to float
        Factor of the automatic length of arrows, by derivative.
    path_order : int, default 1
        Derivative whose magnitude colors the paths.
    kinds : frozenset of str
        Kinds of shown loads: reaction, driver, applied.
    force_length : float, default 1
        Factor of the automatic length of arrows of forces.
    """

    traced: tuple[TracedPoint, ...] = ()
    lengths: Mapping[int, float] = dataclasses.field(default_factory=dict)
    path_order: int = 1
    kinds: frozenset[str] = frozenset()
    force_length: float = 1.0

    def fitted(self, recording: Recording) -> DisplayOptions:
        """Return the options for another recording: points matched by name, and derivatives limited to its order."""
        points = {point.name: point for point in recording.appearance.points}
        traced = tuple(
            dataclasses.replace(
                trace,
                point=points.get(trace.point.name, trace.point),
                orders=tuple(order for order in trace.orders if order <= recording.order),
            )
            for trace in self.traced
            if trace.point.body in recording.bodies
        )
        return dataclasses.replace(self, traced=traced, path_order=min(self.path_order, recording.order))


@dataclasses.dataclass(frozen=True, eq=False)
class Overlay:
    """Arrows, paths and loads of a recording at all instants.

    Parameters
    ----------
    recording : Recording
    options : DisplayOptions
    arrows : dict of int to numpy.ndarray of shape (time, arrows, 2, 3)
        Arrows by derivative, m.
    scales : dict of int to float
        Length of an arrow per unit of the derivative, m.
    lines, colors : numpy.ndarray
        Lines and colors of paths.
    extremes : tuple of float
        Magnitudes at the ends of the color scale.
    loads : sequence of Load
    forces : dict of str to numpy.ndarray of shape (time, arrows, 2, 3)
        Arrows of forces by kind, m.
    force_scale : float
        Length of an arrow per N, m.
    largest_torque : float
        Largest torque, N m.
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
        """Return the overlay of a recording.

        Raises
        ------
        JounceError
            If loads are requested and the order of the motion is too low for them.
        """
        options = options.fitted(recording)
        arrows, scales = {}, {}
        for order in sorted({order for trace in options.traced for order in trace.orders}):
            motions = [recording.motion(trace.point) for trace in options.traced if order in trace.orders]
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
