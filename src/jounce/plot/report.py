"""A page to explore a motion in: one HTML file that needs no network and nothing but a browser."""

from __future__ import annotations

import html
import json
import math
import re
from importlib.resources import files
from os import PathLike
from typing import Any

import numpy as np

from jounce.io.files.writing import check_target, replacing
from jounce.kinematics import Status
from jounce.mechanism.mechanism import GROUND
from jounce.mechanism.resolve import resolve
from jounce.plot.animation import LONGEST, SHORTEST
from jounce.plot.canvas import AZIMUTH, ELEVATION
from jounce.plot.scene import scene_of
from jounce.plot.sketch import length_text, paths_of, round_length
from jounce.plot.style import BODY_COLOURS
from jounce.reporting.motion_facts import motion_facts
from jounce.reporting.peaks import derivative_name, derivative_unit, peaks, rate_name
from jounce.reporting.summaries import motion_summary

__all__ = ["check_report", "report"]

MOST_INSTANTS = 2001  # of the plots
MOST_FRAMES = 240  # of the sketch, which goes on evenly between them
STEPS = 20000  # of places across the sketch
DIGITS = 9  # of plotted values; peaks are taken of all instants in full
KINDS = {"joints": "joint", "drivers": "driver", "forces": "force", "initial": "at the start"}
SPEEDS = (0.001, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 100.0)


def check_report(path: str | PathLike[str], *, overwrite: bool = False) -> None:
    """Raise OutputError unless a report can be written to a path; meant to be asked before a long computation.

    Raises
    ------
    OutputError
        The ending is not .html, the folder does not exist, or nothing may be written there.
    """
    check_target(path, (".html", ".htm"), "a report", overwrite=overwrite)


def report(
    motion: Any,
    path: str | PathLike[str],
    *,
    view: tuple[float, float] = (AZIMUTH, ELEVATION),
    source: str = "",
    overwrite: bool = False,
) -> None:
    """Write a page to explore a motion in: a moving sketch, plots of all outputs, peak values, and what was solved.

    The page is one file. It asks for nothing over the network, and opens with a double click.

    Parameters
    ----------
    motion : Motion
        Instants that were not solved are told.
    path : str or path
        An .html file.
    view : tuple of float, default (-60, 25)
        Azimuth and elevation from which a spatial mechanism is seen, degrees.
    source : str, optional
        The file that the mechanism came from, for the foot of the page.
    overwrite : bool, default False
        Whether the page may replace a file that this process has read as an input.

    Raises
    ------
    OutputError
        The file cannot be written.

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
        "TITLE": html.escape(motion.mechanism.title or source or "Motion of a mechanism"),
        "STYLE": _part("report.css"),
        "SCRIPT": _part("report.js") + _part("plots.js"),
        "DATA": data.replace("<", "\\u003c"),  # no name can end the script early
    }
    page = re.sub("@([A-Z]+)@", lambda place: parts[place[1]], _part("report.html"))  # once: titles are not looked at
    with replacing(path, overwrite=overwrite) as beside:
        beside.write_text(page, encoding="utf-8")


def _part(name: str) -> str:
    return files("jounce.plot").joinpath("page", name).read_text(encoding="utf-8")


def _data(motion: Any, view: tuple[float, float], source: str) -> dict[str, Any]:
    """Return all that the page shows."""
    from jounce import __version__

    mechanism = motion.mechanism
    rising = np.argsort(motion.time, kind="stable")
    shown = rising[np.unique(np.linspace(0, len(rising) - 1, min(MOST_INSTANTS, len(rising))).round().astype(int))]
    time = motion.time[shown]
    start, stop = float(time[0]), float(time[-1])
    speed = _speed(stop - start)
    outputs = [_output(name, mechanism.outputs[name], values[shown]) for name, values in motion.outputs.items()]
    lines = motion_summary(motion_facts(motion), source or "mechanism").splitlines()
    return {
        "title": mechanism.title or source or "Motion of a mechanism",
        "summary": "\n".join(lines[1:]),
        "made": f"Made by jounce {__version__}{f' from {source}' if source else ''}. All values in SI units.",
        "messages": _messages(motion),
        "times": time.tolist(),
        "solved": (np.asarray(motion.status)[shown] == 0).tolist(),
        "start": start,
        "stop": stop,
        "digits": min(9, max(0, 3 - math.floor(math.log10(stop - start)))) if stop > start else 3,
        "speed": speed,
        "speeds": [[value, f"{value:g} x"] for value in SPEEDS],
        "levels": [derivative_name(k) for k in range(1 + max([motion.order, *(len(o["words"]) - 1 for o in outputs)]))],
        "outputs": outputs,
        "scene": _scene(motion, rising, shown, view, [output["name"] for output in outputs]),
        "peaks": [_peak(peak) for peak in peaks(motion)],
        "parameters": [[name, _number(value)] for name, value in mechanism.parameter_values.items()],
        "bodies": _bodies(mechanism),
        "elements": [
            [name, f"{element.type_name or type(element).__name__} {kind}", ", ".join(element.bodies)]
            for kinds, kind in KINDS.items()
            for name, element in mechanism.elements[kinds].items()
        ],
    }


def _speed(span: float) -> float:
    """Return the speed, of those offered, with which a motion takes some seconds."""
    if span <= 0 or SHORTEST <= span <= LONGEST:
        return 1.0
    wanted = span / (2 * SHORTEST if span < SHORTEST else LONGEST)
    return min(SPEEDS, key=lambda speed: abs(math.log(speed / wanted)))


def _number(value: Any) -> float | None:
    """Return a number that JSON can hold: to some digits, nothing where it is not finite."""
    return float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None


def _output(name: str, output: Any, values: np.ndarray) -> dict[str, Any]:
    """Return the values of an output by derivative and component, with words and units."""
    columns = values[..., None] if values.ndim == 2 else values
    orders, components = range(columns.shape[1]), columns.shape[2]
    words = [rate_name(output, k) for k in orders]
    return {
        "name": name,
        "words": ["angle" if word == "position" and output.unit == "rad" else word for word in words],
        "units": [derivative_unit(output.unit, k) for k in orders],
        "components": list(output.labels[:components]) if components > 1 else [""],
        "values": [[[_number(v) for v in columns[:, k, c]] for c in range(components)] for k in orders],
    }


def _peak(peak: Any) -> dict[str, Any]:
    found = {name: getattr(peak, name) for name in ("output", "derivative", "unit")}
    times = {name: _number(getattr(peak, name)) for name in ("minimum_at", "maximum_at")}
    shown = dict(zip(("minimum", "maximum"), map(_number, peak.shown), strict=True))
    return found | times | shown | {"largest": list(peak.largest)}


def _messages(motion: Any) -> list[str]:
    """Word which instants were not solved, and why, one line for each run of them."""
    status = np.asarray(motion.status)
    failed = np.flatnonzero(status != 0)
    lines = []
    for run in np.split(failed, np.flatnonzero(np.diff(failed) > 1) + 1) if failed.size else ():
        first, last = motion.time[run[0]], motion.time[run[-1]]
        when = f"t = {first:g} s" if len(run) == 1 else f"t = {first:g} s to {last:g} s"
        known = Status(int(status[run[0]]))
        fault = motion.faults.get(int(run[0]), "")
        lines.append(f"Not solved at {when}{f' ({fault})' if fault else ''}: {known.advice}.")
    return lines


def _bodies(mechanism: Any) -> list[dict[str, Any]]:
    parameters, found = mechanism.parameter_values, []
    for k, (name, body) in enumerate(mechanism.bodies.items()):
        position = ", ".join(f"{value:.6g}" for value in np.asarray(resolve(body.position, parameters), float))
        mass = None if body.mass is None else _number(np.asarray(resolve(body.mass, parameters), float))
        colour = BODY_COLOURS[k % len(BODY_COLOURS)]
        found.append({"name": name, "mass": mass, "position": position, "colour": colour})
    return found


def _scene(
    motion: Any, rising: np.ndarray, shown: np.ndarray, view: tuple[float, float], outputs: list[str]
) -> dict[str, Any] | None:
    """Return the shapes of the sketch at evenly spread instants, in whole steps of length."""
    solved = rising[np.asarray(motion.status)[rising] == 0]
    if not solved.size:
        solved = rising[:1]
    chosen = solved[np.unique(np.linspace(0, len(solved) - 1, min(MOST_FRAMES, len(solved))).round().astype(int))]
    scene = scene_of(motion, view=view, instants=chosen)
    found = paths_of(motion, None, 0, view)
    flat = {} if found is None else {name: path[shown] for name, path in found.flat.items()}
    left, right, lower, upper = scene.limits
    for path in flat.values():
        known = path[np.isfinite(path).all(axis=1)]
        if len(known):
            left, lower = min(left, float(known[:, 0].min())), min(lower, float(known[:, 1].min()))
            right, upper = max(right, float(known[:, 0].max())), max(upper, float(known[:, 1].max()))
    margin = 3.0 * scene.unit
    limits = [left - margin, right + margin, lower - 1.5 * margin, upper + margin]
    step = max(limits[1] - limits[0], limits[3] - limits[2]) / STEPS
    bar = round_length(0.25 * (limits[1] - limits[0]))

    def places(points: np.ndarray) -> list[int | None]:
        steps = points / step
        return [round(v) if math.isfinite(v) else None for v in steps.reshape(-1).tolist()]

    def moved(points: np.ndarray) -> list[int | None]:
        still = np.nanmax(np.abs(points - points[:1]), initial=0.0) < 0.5 * step
        return places(points[:1] if still else points)

    return {
        "limits": limits,
        "unit": scene.unit,
        "step": step,
        "bar": bar,
        "bar_text": length_text(bar),
        "times": motion.time[chosen].tolist(),
        "shapes": [
            {
                "kind": shape.kind,
                "points": moved(shape.points),
                "count": shape.points.shape[1],
                "stroke": shape.stroke,
                "fill": shape.fill,
                "width": shape.width,
                "dashes": list(shape.dashes),
                "layer": shape.layer,
                "radius": shape.radius,
                "owner": shape.owner,
            }
            for shape in scene.shapes
        ],
        "labels": [
            {"text": label.text, "colour": label.colour, "points": moved(label.anchor[:, None])}
            for label in scene.labels
            if label.owner != f"bodies.{GROUND}"
        ],
        "paths": [{"output": outputs.index(name), "points": places(path)} for name, path in flat.items()],
    }
