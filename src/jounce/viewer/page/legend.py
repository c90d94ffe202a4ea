"""The legend of the page: meanings of arrows and colors, and current values."""

from __future__ import annotations

import re
from html import escape

import numpy as np

from jounce.plot.labels import rounded_down
from jounce.reporting.peaks import derivative_name
from jounce.units.shown_units import derivative_unit
from jounce.viewer.page.overlay import Overlay
from jounce.viewer.shapes.appearance import Color
from jounce.viewer.shapes.arrows import LOAD_COLORS, LOAD_WORDS, derivative_color, path_colors, scale_words
from jounce.viewer.shapes.recording import Recording

CELL = "padding:1px 6px 1px 0;white-space:nowrap"


def _chip(color: Color) -> str:
    style = f"display:inline-block;width:1.5em;height:0.3em;border-radius:2px;background:rgb{color}"
    return f'<span style="{style};vertical-align:middle;margin-right:0.4em"></span>'


def _table(rows: list[tuple[str, ...]]) -> str:
    """Return a table as HTML, with its last column aligned to the right."""
    lines = []
    for *cells, last in rows:
        cells_html = "".join(f'<td style="{CELL}">{cell}</td>' for cell in cells)
        lines.append(f'<tr>{cells_html}<td style="{CELL};text-align:right">{last}</td></tr>')
    return f'<table style="border-collapse:collapse">{"".join(lines)}</table>' if rows else ""


def legend(overlay: Overlay, frame: int) -> str:
    """Return the legend as HTML: a row for each arrow with its current size, then scales, paths and forces."""
    recording, rows = overlay.recording, []
    for trace in overlay.options.traced:
        motion = recording.motion(trace.point)[frame]
        for order in trace.orders:
            size = f"{_number(float(np.linalg.norm(motion[order])))} {_powers(derivative_unit('m', order))}"
            rows.append((f"{_chip(derivative_color(order))}{derivative_name(order)}", escape(trace.point.name), size))
    parts = [_table(rows)]
    scales = [
        f"{_chip(derivative_color(order))}{_powers(scale_words(scale, order, recording.size))}"
        for order, scale in overlay.scales.items()
    ]
    if scales:
        parts.append(f'<div style="margin-top:4px;opacity:0.75">arrows: {"; ".join(scales)}</div>')
    if any(trace.path for trace in overlay.options.traced):
        parts.append(_color_bar(overlay))
    parts += _loads(overlay, frame)
    body = "".join(parts) or "nothing is marked"
    return f'<div style="font-size:0.8em;line-height:1.45;padding:2px 16px 4px 8px">{body}</div>'


def _loads(overlay: Overlay, frame: int) -> list[str]:
    """Return the rows of the shown forces and torques."""
    rows = []
    for load in overlay.loads:
        lines = []
        if load.force is not None and np.any(load.force):
            lines.append(f"{_number(float(np.linalg.norm(load.force[frame])))} N")
        if load.torque is not None and np.abs(load.torque).max() > 1e-9 * max(overlay.largest_torque, 1e-300):
            lines.append(f"{_number(float(np.linalg.norm(load.torque[frame])))} N m")
        if lines:
            rows.append((f"{_chip(LOAD_COLORS[load.kind])}{escape(load.name)}", ", ".join(lines)))
    if not rows:
        return []
    kinds = ", ".join(label for kind, label in LOAD_WORDS.items() if kind in overlay.options.kinds)
    length = rounded_down(0.4 * overlay.recording.size)
    scale = f"arrows: {length:g} m is {_number(length / overlay.force_scale)} N" if overlay.force_scale else ""
    return [
        f'<div style="margin-top:6px"><b>{kinds}</b></div>',
        _table(rows),
        f'<div style="opacity:0.75">{scale}</div>',
    ]


def _color_bar(overlay: Overlay) -> str:
    """Return the scale of the colors of paths."""
    colors = ", ".join(f"rgb{tuple(color)}" for color in path_colors(np.linspace(0.0, 1.0, 9)).tolist())
    low, high = overlay.extremes
    order = overlay.options.path_order
    return (
        f'<div style="margin-top:6px">path: {derivative_name(order)}</div>'
        f'<div style="height:8px;border-radius:2px;background:linear-gradient(to right, {colors})"></div>'
        f'<div style="display:flex;justify-content:space-between"><span>{_number(low)}</span>'
        f"<span>{_number(high)} {_powers(derivative_unit('m', order))}</span></div>"
    )


def _number(value: float) -> str:
    """Return a number with three digits, of constant width while it changes slowly."""
    if value == 0 or 0.01 <= abs(value) < 1e4:
        digits = 2 if value == 0 else max(0, 2 - int(np.floor(np.log10(abs(value)))))
        return f"{value:.{digits}f}"
    return f"{value:.2e}"


def _powers(text: str) -> str:
    """Return a unit as HTML with superscript exponents."""
    return re.sub(r"\^(-?\d+)", r"<sup>\1</sup>", escape(text))


def error_box(text: str) -> str:
    """Return an error as a red box."""
    style = "border-left:4px solid #c0392b;background:rgba(192,57,43,0.12);padding:6px 10px;border-radius:3px"
    return (
        f'<div style="{style};font-size:0.85em;line-height:1.4;margin:4px 8px"><b>No motion for these values</b><br>'
        f"{escape(text)}<br><i>The last motion is still shown.</i></div>"
    )


def status_line(recording: Recording, elapsed: float, busy: bool) -> str:
    """Return the status of the page as a gray line of HTML."""
    phrase = f"{len(recording.time)} instants, order {recording.order}"
    if busy:
        phrase += ", solving ..."
    elif elapsed:
        phrase += f", solved in {1e3 * elapsed:.0f} ms"
    notice = ""
    if recording.notice:
        style = "border-left:4px solid #b7791f;background:rgba(183,121,31,0.12);padding:4px 8px;margin-top:4px"
        notice = f'<div style="{style}">{escape(recording.notice)}</div>'
    return f'<div style="font-size:0.75em;opacity:0.8;padding:2px 8px">{escape(phrase)}{notice}</div>'
