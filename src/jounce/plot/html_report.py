"""An interactive report of a motion: one HTML file that needs a browser only, and no network."""

from __future__ import annotations

import html
import json
import math
import re
from collections.abc import Sequence
from importlib.resources import files
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from jounce.base.shapes import Real
from jounce.io.files.writing import check_target, replacing
from jounce.kinematics import Motion, Status
from jounce.mechanism import Mechanism
from jounce.mechanism.mechanism import GROUND
from jounce.mechanism.outputs.base import AbstractQuantity
from jounce.mechanism.resolve import resolve
from jounce.plot.animation import LONGEST, SHORTEST
from jounce.plot.drawings.drawing import VIEW, Label, View
from jounce.plot.drawings.name_placement import place_names
from jounce.plot.drawings.scene import Scene, scene_of
from jounce.plot.instants import evenly_chosen, unsolved_runs
from jounce.plot.labels import bar_length, quantity_word
from jounce.plot.machine_sketch import length_text, limits_with, paths_of
from jounce.plot.style import BODY_COLORS
from jounce.reporting.facts.mechanism.mechanism_facts import parameter_facts
from jounce.reporting.facts.motion_facts import motion_facts
from jounce.reporting.peaks import Peak, derivative_name, peaks, shown_peaks
from jounce.reporting.text.summaries import motion_summary
from jounce.units.shown_units import ShownUnits, derivative_unit
from jounce.written_equations.report_section import equations_section

MOST_INSTANTS = 2001  # of the plots
MOST_FRAMES = 240  # of the sketch, which is interpolated between them
STEPS = 20000  # resolution of positions across the sketch
WIDTHS = (360.0, 620.0)  # pixels of the sketch, each with its own placement of names
TALLEST, LEAST = 560.0, 220.0  # pixels of the sketch
LETTER, LINE = 7.2, 16.0  # pixels that a letter and a line of a name take
DIGITS = 9  # of plotted values; peaks use all instants in full precision
KINDS = {"joints": "joint", "drivers": "driver", "forces": "force", "initial": "at the start"}
SPEEDS = (0.001, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 100.0)


def check_report(path: str | PathLike[str], *, overwrite: bool = False) -> None:
    """Raise OutputError unless a report can be written to a path; to be called before a long computation.

    Raises
    ------
    OutputError
        If the suffix is not .html, the folder does not exist, or it is not writable.
    """
    check_target(path, (".html", ".htm"), "a report", overwrite=overwrite)


def report(
    motion: Motion,
    path: str | PathLike[str],
    *,
    view: View = VIEW,
    source: str | PathLike[str] = "",
    equations: bool = False,
    at: Real | None = None,
    overwrite: bool = False,
) -> None:
    """Write an interactive report of a motion: a moving sketch, plots of all outputs, peak values, and the model.

    The page is a single file, which uses no network and opens with a double click.

    Parameters
    ----------
    motion : Motion
        The motion; the report lists unsolved instants.
    path : str or path
        An .html file.
    view : tuple of float, default (-60, 25)
        Azimuth and elevation of the viewer of a spatial mechanism, degrees.
    source : str or path, optional
        The file of the mechanism. The foot of the page has its name; if it exists, the table of parameters shows their
        values as written in it.
    equations : bool, default False
        Whether to include the constraint equations: joints with their equation numbers in Sommer 2024, the pattern of
        the Jacobian, and right-hand sides.
    at : float, optional
        Instant of these equations, s, rounded to the nearest one of the motion; by default its first one.
    overwrite : bool, default False
        Whether the page may replace a file that this process has read as an input.

    Raises
    ------
    OutputError
        If the file cannot be written.
    MechanismError
        If the equations are requested at an unsolved instant.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import jounce as jn
    >>> from jounce.plot import report
    >>> motion = jn.solve(jn.load("examples/four_bar.yaml"), [0.0, 0.1, 0.2], order=2)
    >>> page = pathlib.Path(tempfile.mkdtemp()) / "four_bar.html"
    >>> report(motion, page)
    >>> "Planar four-bar" in page.read_text(encoding="utf-8")
    True
    """
    check_report(path, overwrite=overwrite)
    data = json.dumps(_data(motion, view, source), allow_nan=False, separators=(",", ":"))
    parts = {
        "TITLE": html.escape(motion.mechanism.title or Path(source).name or "Motion of a mechanism"),
        "STYLE": _part("report.css"),
        "EQUATIONS": equations_section(motion, at) if equations else "",
        "SCRIPT": _part("report.js") + _part("plots.js"),
        "DATA": data.replace("<", "\\u003c"),  # so that no name ends the script
    }
    page = re.sub("@([A-Z]+)@", lambda match: parts[match[1]], _part("report.html"))  # one pass skips titles
    with replacing(path, overwrite=overwrite) as temporary:
        temporary.write_text(page, encoding="utf-8")


def _part(name: str) -> str:
    return files("jounce.plot").joinpath("page", name).read_text(encoding="utf-8")


def _data(motion: Motion, view: View, file: str | PathLike[str]) -> dict[str, Any]:
    """Return the data of the page."""
    from jounce.version import __version__

    mechanism, source = motion.mechanism, Path(file).name
    parameters = parameter_facts(mechanism, file if source and Path(file).is_file() else None)
    rising = np.argsort(motion.time, kind="stable")
    selected = evenly_chosen(rising, MOST_INSTANTS)
    time = motion.time[selected]
    start, stop = float(time[0]), float(time[-1])
    units = mechanism.shown_units
    outputs = [
        _output(name, mechanism.outputs[name], values[selected], units) for name, values in motion.outputs.items()
    ]
    of_values = "Outputs in the units shown, the rest" if mechanism.units else "All values"
    lines = motion_summary(motion_facts(motion), source or "mechanism").splitlines()
    return {
        "title": mechanism.title or source or "Motion of a mechanism",
        "summary": "\n".join(lines[1:]),
        "made": f"Made by jounce {__version__}{f' from {source}' if source else ''}. {of_values} in SI units.",
        "messages": _messages(motion),
        "times": time.tolist(),
        "solved": (np.asarray(motion.status)[selected] == 0).tolist(),
        "start": start,
        "stop": stop,
        "digits": min(9, max(0, 3 - math.floor(math.log10(stop - start)))) if stop > start else 3,
        "speed": _speed(stop - start),
        "speeds": [[value, f"{value:g} x"] for value in SPEEDS],
        "levels": [derivative_name(k) for k in range(1 + max([motion.order, *(len(o["words"]) - 1 for o in outputs)]))],
        "outputs": outputs,
        "scene": _scene(motion, rising, selected, view, [output["name"] for output in outputs]),
        "peaks": [_peak(peak) for peak in shown_peaks(peaks(motion), units)],
        "parameters": [
            [row["name"], _number(row["value"]), row["unit"] or "", row["written"] or ""] for row in parameters
        ],
        "bodies": _bodies(mechanism),
        "elements": [
            [name, f"{element.type_name or type(element).__name__} {kind}", ", ".join(element.bodies)]
            for kinds, kind in KINDS.items()
            for name, element in mechanism.elements[kinds].items()
        ],
    }


def _speed(duration: float) -> float:
    """Return the offered speed with which a motion takes some seconds."""
    if duration <= 0 or SHORTEST <= duration <= LONGEST:
        return 1.0
    target = duration / (2 * SHORTEST if duration < SHORTEST else LONGEST)
    return min(SPEEDS, key=lambda speed: abs(math.log(speed / target)))


def _number(value: float | np.ndarray) -> float | None:
    """Return a rounded number for JSON, or None if it is not finite."""
    return float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None


def _output(
    name: str,
    output: AbstractQuantity,
    values: Float[np.ndarray, "time derivative *component"],
    units: ShownUnits,
) -> dict[str, Any]:
    """Return the values of an output by derivative and component, with names and units."""
    unit, factor = units.of(output.unit, name)
    columns = (values[..., None] if values.ndim == 2 else values) * factor
    orders, components = range(columns.shape[1]), columns.shape[2]
    return {
        "name": name,
        "words": [quantity_word(output, k) for k in orders],
        "units": [derivative_unit(unit, k) for k in orders],
        "components": list(output.labels[:components]) if components > 1 else [""],
        "values": [[[_number(v) for v in columns[:, k, c]] for c in range(components)] for k in orders],
    }


def _peak(peak: Peak) -> dict[str, Any]:
    facts = {name: getattr(peak, name) for name in ("output", "derivative", "unit")}
    times = {name: _number(getattr(peak, name)) for name in ("minimum_at", "maximum_at")}
    values = dict(zip(("minimum", "maximum"), map(_number, peak.shown), strict=True))
    return facts | times | values | {"largest": list(peak.largest)}


def _messages(motion: Motion) -> list[str]:
    """Return messages on unsolved instants with their reasons, one for each run of instants."""
    lines = []
    for run in unsolved_runs(motion):
        first, last = motion.time[run[0]], motion.time[run[-1]]
        when = f"t = {first:g} s" if len(run) == 1 else f"t = {first:g} s to {last:g} s"
        status = Status(int(motion.status[run[0]]))
        fault = motion.faults.get(int(run[0]), "")
        lines.append(f"Not solved at {when}{f' ({fault})' if fault else ''}: {status.advice}.")
    return lines


def _bodies(mechanism: Mechanism) -> list[dict[str, Any]]:
    parameters, rows = mechanism.parameter_values, []
    for k, (name, body) in enumerate(mechanism.rigid_bodies.items()):
        position = ", ".join(f"{value:.6g}" for value in np.asarray(resolve(body.position, parameters), float))
        mass = None if body.mass is None else _number(np.asarray(resolve(body.mass, parameters), float))
        color = BODY_COLORS[k % len(BODY_COLORS)]
        rows.append({"name": name, "mass": mass, "position": position, "color": color})
    return rows


def _scene(
    motion: Motion,
    rising: Int[np.ndarray, " time"],
    selected: Int[np.ndarray, " shown"],
    view: View,
    outputs: list[str],
) -> dict[str, Any]:
    """Return the shapes of the sketch at evenly spaced instants, in whole steps of length."""
    solved = rising[np.asarray(motion.status)[rising] == 0]
    chosen = evenly_chosen(solved if solved.size else rising[:1], MOST_FRAMES)
    scene, paths = scene_of(motion, view=view, instants=chosen), paths_of(motion, None, 0, view)
    (left, right, lower, upper), margin = limits_with(scene, paths), 3.0 * scene.unit
    limits = [left - margin, right + margin, lower - 1.5 * margin, upper + margin]
    step = max(limits[1] - limits[0], limits[3] - limits[2]) / STEPS
    bar = bar_length(max(right - left, upper - lower))
    labels = [label for label in scene.labels if label.owner != f"bodies.{GROUND}"]
    placements = [_name_positions(labels, scene, limits, width) for width in WIDTHS]

    def pixels(points: np.ndarray) -> list[int | None]:
        return [round(v) if math.isfinite(v) else None for v in (points / step).reshape(-1).tolist()]

    def moved(points: np.ndarray) -> list[int | None]:
        fixed = np.nanmax(np.abs(points - points[:1]), initial=0.0) < 0.5 * step
        return pixels(points[:1] if fixed else points)

    return {
        "limits": limits,
        "unit": scene.unit,
        "step": step,
        "bar": bar,
        "bar_text": length_text(bar),
        "times": motion.time[chosen].tolist(),
        "shapes": [
            vars(shape) | {"points": moved(shape.points), "count": shape.points.shape[1]} for shape in scene.shapes
        ],
        "widths": WIDTHS,
        "labels": [
            {
                "text": label.text,
                "kind": label.owner.partition(".")[0],
                "color": label.color,
                "points": moved(label.anchor[:, None]),
                "places": [chosen[number] for chosen in placements],
            }
            for number, label in enumerate(labels)
        ],
        "paths": [
            {"output": outputs.index(name), "points": pixels(flat[selected])}
            for name, flat in (paths.flat.items() if paths else ())
        ],
    }


def _name_positions(
    labels: Sequence[Label], scene: Scene, limits: Sequence[float], width: float
) -> list[list[Any] | None]:
    """Return the directions and distances of names in a sketch of a given width, placed as in `sketch`."""
    left, right, lower, upper = limits
    height = min(max(width * (upper - lower) / (right - left), LEAST), TALLEST)
    scale = min(width / (right - left), height / (upper - lower))
    middle = np.array([left + right, lower + upper]) / 2

    def to_pixels(points: np.ndarray) -> np.ndarray:
        return np.array([width, height]) / 2 + scale * (points - middle)

    halves = [np.array([LETTER * len(label.text) / 2 + 2.0, LINE / 2]) for label in labels]
    corner = np.array([[0.0, 0.0, 0.25 * width, 24.0]])  # box of the scale bar
    frame = np.array([0.0, 0.0, width, height])
    names = place_names(labels, halves, scene, to_pixels, frame, corner)
    return [
        place and [*(round(number, 4) for number in (*place.direction, place.distance)), place.led] for place in names
    ]
