"""Where a symbol stands, and the pieces that are drawn in its place alone: stands, pins, balls."""

from __future__ import annotations

import numpy as np

from jounce.mechanism.mechanism import GROUND
from jounce.plot.canvas import SYMBOLS, Canvas
from jounce.plot.geometry import Symbol
from jounce.plot.glyphs import PAPER, support

__all__ = ["axis_of", "ball", "global_place", "middle_of", "pin", "place_of", "slot_of", "stand"]


def slot_of(symbol: Symbol) -> int:
    """Return which body the symbol is fixed to: one that moves, the last of them."""
    moving = [k for k, body in enumerate(symbol.bodies[:2]) if body != GROUND]
    return moving[-1] if moving else 0


def global_place(canvas: Canvas, symbol: Symbol, slot: int | None = None) -> np.ndarray:
    """Return the point of a symbol on one of its bodies in the global frame, (time, components)."""
    slot = slot_of(symbol) if slot is None else slot
    return canvas.at(symbol.bodies[slot], symbol.points[slot])


def place_of(canvas: Canvas, symbol: Symbol, slot: int | None = None) -> np.ndarray:
    """Return the point of a symbol on one of its bodies as it is seen, (time, 2)."""
    return canvas.flat(global_place(canvas, symbol, slot))


def middle_of(canvas: Canvas, symbol: Symbol) -> np.ndarray:
    """Return the place halfway between the two points of a symbol, (time, 2)."""
    return 0.5 * (place_of(canvas, symbol, 0) + place_of(canvas, symbol, 1))


def stand(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    """Draw the support of a joint whose one body is the ground."""
    if GROUND in symbol.bodies[:2]:
        support(canvas, place_of(canvas, symbol, symbol.bodies.index(GROUND)), owner)


def pin(canvas: Canvas, place: np.ndarray, owner: str) -> None:
    """Draw a pin."""
    canvas.disc(place, 0.8 * canvas.unit, fill=PAPER, width=1.3, layer=SYMBOLS, owner=owner)


def axis_of(symbol: Symbol, slot: int) -> np.ndarray:
    """Return the axis or direction of a symbol on one of its bodies, in its frame."""
    axis = symbol.axes[slot] if symbol.axes[slot] is not None else symbol.axes[1 - slot]
    return np.eye(len(symbol.points[slot]))[0] if axis is None else axis


def ball(canvas: Canvas, place: np.ndarray, owner: str) -> None:
    """Draw the ball of a spherical joint."""
    u = canvas.unit
    canvas.disc(place, 0.85 * u, fill="#BBBBBB", width=1.2, layer=SYMBOLS, owner=owner)
    canvas.disc(place + np.array([-0.25, 0.25]) * u, 0.22 * u, stroke="", fill=PAPER, layer=SYMBOLS, owner=owner)
