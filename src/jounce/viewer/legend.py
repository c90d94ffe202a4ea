"""The legend of the page: what the arrows and colours mean, and how large everything is now."""

from __future__ import annotations

from html import escape

import numpy as np

from jounce.reporting.peaks import derivative_name, derivative_unit
from jounce.viewer.arrows import KINDS, derivative_colour, rounded, scale_words
from jounce.viewer.prepared import Prepared
from jounce.viewer.take import Take

__all__ = ["error_box", "legend", "status_line"]

CELL = "padding:1px 6px 1px 0;white-space:nowrap"
WORDS = {"reaction": "reactions of joints", "driver": "forces of drivers", "applied": "applied forces"}


def _chip(colour: tuple[int, int, int]) -> str:
    red, green, blue = colour
    style = f"display:inline-block;width:1.5em;height:0.3em;border-radius:2px;background:rgb({red},{green},{blue})"
    return f'<span style="{style};vertical-align:middle;margin-right:0.4em"></span>'


def legend(shown: Prepared, frame: int) -> str:
    """Return the legend as HTML: a row for each arrow with its size now, then the scales, the paths and the forces."""
    take, rows = shown.take, []
    for mark in shown.wanted.marked:
        motion = take.motion(mark.spot)[frame]
        for order in mark.orders:
            size = float(np.linalg.norm(motion[order]))
            unit = derivative_unit("m", order)
            rows.append(
                f'<tr><td style="{CELL}">{_chip(derivative_colour(order))}{derivative_name(order)}</td>'
                f'<td style="{CELL}">{escape(mark.spot.name)}</td>'
                f'<td style="{CELL};text-align:right">{_number(size)} {_powers(unit)}</td></tr>'
            )
    parts = [f'<table style="border-collapse:collapse">{"".join(rows)}</table>'] if rows else []
    scales = [
        f"{_chip(derivative_colour(order))}{_powers(scale_words(scale, order, take.size))}"
        for order, scale in shown.scales.items()
    ]
    if scales:
        parts.append(f'<div style="margin-top:4px;opacity:0.75">arrows: {"; ".join(scales)}</div>')
    if any(mark.path for mark in shown.wanted.marked):
        parts.append(_bar(shown))
    parts += _forces(shown, frame)
    body = "".join(parts) or "nothing is marked"
    return f'<div style="font-size:0.8em;line-height:1.45;padding:2px 8px 4px 8px">{body}</div>'


def _forces(shown: Prepared, frame: int) -> list[str]:
    """Return the rows of forces and torques that are shown."""
    rows = []
    for exertion in shown.exertions:
        words = []
        if exertion.force is not None and np.any(exertion.force):
            words.append(f"{_number(float(np.linalg.norm(exertion.force[frame])))} N")
        if exertion.torque is not None and np.abs(exertion.torque).max() > 1e-9 * max(shown.largest_torque, 1e-300):
            words.append(f"{_number(float(np.linalg.norm(exertion.torque[frame])))} N m")
        if words:
            rows.append(
                f'<tr><td style="{CELL}">{_chip(KINDS[exertion.kind])}{escape(exertion.name)}</td>'
                f'<td style="{CELL};text-align:right">{", ".join(words)}</td></tr>'
            )
    if not rows:
        return []
    kinds = ", ".join(WORDS[kind] for kind in WORDS if kind in shown.wanted.kinds)
    length = rounded(0.4 * shown.take.size)
    scale = f"arrows: {length:g} m is {_number(length / shown.force_scale)} N" if shown.force_scale else ""
    return [
        f'<div style="margin-top:6px"><b>{kinds}</b></div>',
        f'<table style="border-collapse:collapse">{"".join(rows)}</table>',
        f'<div style="opacity:0.75">{scale}</div>',
    ]


def _bar(shown: Prepared) -> str:
    """Return the scale of the colours of paths."""
    import matplotlib as mpl

    stops = [mpl.colormaps["viridis"](0.93 * k / 8)[:3] for k in range(9)]
    colours = ", ".join(f"rgb({', '.join(str(int(255 * c)) for c in stop)})" for stop in stops)
    low, high = shown.extremes
    unit = _powers(derivative_unit("m", shown.wanted.path_order))
    return (
        f'<div style="margin-top:6px">path: {derivative_name(shown.wanted.path_order)}</div>'
        f'<div style="height:8px;border-radius:2px;background:linear-gradient(to right, {colours})"></div>'
        f'<div style="display:flex;justify-content:space-between"><span>{_number(low)}</span>'
        f"<span>{_number(high)} {unit}</span></div>"
    )


def _number(value: float) -> str:
    """Return a number with three digits, at one width while it changes slowly."""
    if value == 0 or 0.01 <= abs(value) < 1e4:
        digits = 2 if value == 0 else max(0, 2 - int(np.floor(np.log10(abs(value)))))
        return f"{value:.{digits}f}"
    return f"{value:.2e}"


def _powers(text: str) -> str:
    """Return a unit with raised exponents."""
    import re

    return re.sub(r"\^(-?\d+)", r"<sup>\1</sup>", escape(text))


def error_box(text: str) -> str:
    """Return an error as a red box."""
    style = "border-left:4px solid #c0392b;background:rgba(192,57,43,0.12);padding:6px 10px;border-radius:3px"
    return (
        f'<div style="{style};font-size:0.85em;line-height:1.4;margin:4px 8px"><b>No motion for these values</b><br>'
        f"{escape(text)}<br><i>The last motion is still shown.</i></div>"
    )


def status_line(take: Take, elapsed: float, busy: bool) -> str:
    """Return what is shown, in grey."""
    words = f"{len(take.time)} instants, order {take.order}"
    if busy:
        words += ", solving ..."
    elif elapsed:
        words += f", solved in {1e3 * elapsed:.0f} ms"
    notice = ""
    if take.notice:
        style = "border-left:4px solid #b7791f;background:rgba(183,121,31,0.12);padding:4px 8px;margin-top:4px"
        notice = f'<div style="{style}">{escape(take.notice)}</div>'
    return f'<div style="font-size:0.75em;opacity:0.8;padding:2px 8px">{escape(words)}{notice}</div>'
