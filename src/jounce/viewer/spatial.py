"""Spatial bodies as round bars, with hinges, balls, crosses, slides and screws."""

from __future__ import annotations

from typing import Any

import numpy as np

from jounce.mechanism.mechanism import GROUND
from jounce.viewer.planar import travel
from jounce.viewer.solids import DARK, GREY, Solid, bar, box, cylinder, merged, revolved, sphere, tube, turned_to

__all__ = ["spatial_solids"]

BAR = 0.013  # radius, in sizes of the mechanism
THREADS = 15  # turns of a screw that are drawn
SLIDING = ("prismatic", "cylindrical", "screw")


def spatial_solids(motion: Any, seen: Any, colours: Any) -> tuple[dict[str, tuple[Solid, ...]], float]:
    """Return the solids of spatial bodies; nothing has to be in front of them."""
    size = seen.size
    found: dict[str, list[Solid]] = {body: [] for body in (GROUND, *motion.mechanism.bodies)}

    def add(body: str, mesh: Any, colour: Any) -> None:
        vertices, faces = mesh
        found[body].append(Solid(vertices, faces, colour))

    for body, link in seen.links.items():
        if body == GROUND:
            for point, names in zip(link.points, link.names, strict=True):
                if names:
                    add(body, sphere(1.3 * BAR * size, point), DARK)
        elif link.edges:
            bars = [bar(link.points[i], link.points[j], BAR * size) for i, j in link.edges]
            add(body, merged(bars), colours[body])
        else:
            add(body, sphere(1.8 * BAR * size, link.points[0]), colours[body])
    for symbol in seen.symbols:
        _add_symbol(add, motion, symbol, size)
    return {body: tuple(solids) for body, solids in found.items()}, 0.0


def _add_symbol(add: Any, motion: Any, symbol: Any, size: float) -> None:
    first, *others = symbol.bodies
    second = others[0] if others else first
    points, axes, kind = symbol.points, symbol.axes, symbol.kind
    if kind == "revolute":
        add(first, cylinder(1.75 * BAR * size, 0.085 * size, axes[0], points[0]), DARK)
        add(second, cylinder(0.9 * BAR * size, 0.11 * size, axes[1], points[1]), GREY)
    elif kind in ("spherical", "double_spherical"):
        add(second, sphere(1.9 * BAR * size, points[1]), DARK)
        if kind == "double_spherical":
            add(first, sphere(1.9 * BAR * size, points[0]), DARK)
    elif kind == "universal":
        add(first, cylinder(0.75 * BAR * size, 0.1 * size, axes[0], points[0]), DARK)
        add(second, cylinder(0.75 * BAR * size, 0.1 * size, axes[1], points[1]), DARK)
        add(second, sphere(1.3 * BAR * size, points[1]), GREY)
    elif kind in SLIDING:
        _add_slide(add, motion, symbol, size)
    elif kind == "dot2":
        add(second, sphere(1.3 * BAR * size, points[1]), DARK)


def _add_slide(add: Any, motion: Any, symbol: Any, size: float) -> None:
    """Draw a rail on the first body, as long as the second travels, and what slides on it."""
    first, second = symbol.bodies[:2]
    axis = np.asarray(symbol.axes[0], float) / np.linalg.norm(symbol.axes[0])
    low, high = travel(motion, symbol)
    low, high = low - 0.08 * size, high + 0.08 * size
    middle = np.asarray(symbol.points[0]) + axis * 0.5 * (low + high)
    thin = 0.7 * BAR * size
    if symbol.kind == "prismatic":
        add(first, box([1.6 * thin, 1.6 * thin, high - low], middle, turned_to(axis)), GREY)
        add(second, box([0.05 * size, 0.05 * size, 0.09 * size], symbol.points[1], turned_to(symbol.axes[1])), DARK)
        return
    add(first, cylinder(thin, high - low, axis, middle), GREY)
    if symbol.kind == "screw":
        turns = THREADS
        height = np.linspace(low, high, turns * 16)
        angle = (height - low) / (high - low) * 2 * np.pi * turns
        helix = thin * np.stack([np.cos(angle), np.sin(angle), height / thin], axis=1)
        add(first, tube(helix @ turned_to(axis).T + symbol.points[0], 0.35 * thin), GREY)
    ring = 1.7 * BAR * size, 0.85 * BAR * size, 0.04 * size
    profile = [(ring[1], -ring[2]), (ring[0], -ring[2]), (ring[0], ring[2]), (ring[1], ring[2]), (ring[1], -ring[2])]
    add(second, revolved(profile, symbol.axes[1], symbol.points[1]), DARK)
