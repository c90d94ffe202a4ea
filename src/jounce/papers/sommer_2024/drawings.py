"""Figures 1, 8 and 9 of Sommer 2024: the mechanisms, drawn from their files, with the letters of the paper.

The text at hand does not contain the drawings of the paper. Lengths are as printed; the pictures name directions of
axes and motions that the files choose. Import this module only for drawing figures.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jounce.papers.figures import panels
from jounce.papers.sommer_2024.cases import VALIDATION_CASES
from jounce.plot.drawings.drawing import View
from jounce.plot.drawings.scene import Scene, drawing_of
from jounce.plot.machine_sketch import SketchFigure, draw_scale
from jounce.plot.style import GRAY, PALE_GRAY

ARC = 7.0  # radius of the arc of an angle, in halves of a pin
VIEW = (-130.0, 25.0)  # degrees, view of spatial mechanisms
X, Y, Z = np.eye(3)
LENGTHS_ONLY = "lengths as printed; the paper does not print the drive of the slider-crank"
CHOSEN = "lengths as printed; directions of the axes, reference of the angle{} and drive chosen (stand-in)"


@dataclasses.dataclass(frozen=True)
class Drawn:
    """The letters, lengths and angles in a drawing of the paper.

    Parameters
    ----------
    simulation : str
        Name of the simulation with the mechanism.
    points : dict of str to tuple
        Body, and place in its frame (numbers or names of parameters, m), by the letter.
    lengths : sequence of str
        Pairs of letters; the drawing gives the length of a pair that names a parameter, other pairs are driven.
    angles : dict of str to tuple
        Letter of the vertex, reference direction, direction a quarter turn ahead, and letter at the end of the angle,
        by the symbol.
    fixed : sequence of str
        Pairs of letters on the ground, drawn as dashed lines.
    """

    simulation: str
    points: Mapping[str, tuple[str, Sequence[Any]]]
    lengths: Sequence[str]
    angles: Mapping[str, tuple[str, np.ndarray, np.ndarray, str]]
    fixed: Sequence[str]


FOUR_BAR = Drawn(
    "four_bar",
    {"A": ("ground", (0, 0)), "B": ("crank", ("AB", 0)), "C": ("rocker", ("CD", 0)), "D": ("ground", ("AD", 0))},
    ("AD", "AB", "BC", "CD"),
    {"\u03b8": ("A", X[:2], Y[:2], "B"), "\u03c8": ("D", X[:2], Y[:2], "C")},
    ("AD",),
)
SLIDER_CRANK = Drawn(
    "inverted_slider_crank_slide",
    {"E": ("ground", (0, 0)), "F": ("ground", ("EF", 0)), "G": ("rocker", ("FG", 0))},
    ("EF", "FG", "EG"),
    {"\u03c8": ("F", X[:2], Y[:2], "G")},
    ("EF",),
)
CRANK = {"A": ("ground", ("OA", 0, 0)), "B": ("crank", (0, "AB", 0)), "D": ("ground", (0, "OD", 0))}
RSUR = Drawn(
    "rsur",
    {"O": ("ground", (0, 0, 0)), "C": ("follower", (0, 0, "CD"))} | CRANK,
    ("OA", "OD", "AB", "BC", "CD"),
    {"\u03b8": ("A", Y, Z, "B"), "\u03c8": ("D", Z, X, "C")},
    ("OA", "OD"),
)
RSPU = Drawn(
    "rspu_distance",
    {"O": ("ground", (0, 0, 0))} | CRANK,
    ("OA", "OD", "AB", "BD"),
    {"\u03b8": ("A", Y, Z, "B")},
    ("OA", "OD"),
)


def draw(drawn: Mapping[str, Drawn], _: Any, *, title: str, note: str, size: tuple[float, float]) -> Figure:
    """Draw one figure of the paper, a panel with a title for each mechanism, without results."""
    figure, axes = panels(1, len(drawn), size, title, note)
    drawings = []
    for panel, (name, shown) in zip(axes[0], drawn.items(), strict=True):
        panel.set_title(name)
        drawings.append(_panel(panel, shown, VIEW))
    for drawing in drawings:  # after all panels have their places
        drawing.write_names("all")
    return figure


def _panel(axes: Any, drawn: Drawn, view: View) -> SketchFigure:
    """Return a mechanism, assembled at the start of its cycle, in a panel, still without names."""
    mechanism = VALIDATION_CASES[drawn.simulation].load()
    values, drawing = mechanism.parameter_values, drawing_of(mechanism, view=view)
    drawing.labels.clear()
    positions = {
        letter: drawing.at(body, np.array([float(values.get(c, c)) for c in local]))[0]
        for letter, (body, local) in drawn.points.items()
    }

    def line(points: Any, **look: Any) -> None:
        drawing.curve(drawing.flat(np.asarray(points))[None], stroke=PALE_GRAY, layer=2, owner="", **look)

    def name(text: str, point: np.ndarray, color: str, owner: str) -> None:
        drawing.owner = owner
        drawing.name(text, drawing.flat(point[None]), color)

    for pair in drawn.fixed:
        line([positions[letter] for letter in pair], width=0.9, dashes=(5.0, 4.0))
    for letter, point in positions.items():
        name(letter, point, "black", f"bodies.{letter}")
    for symbol, (vertex, start, quarter, arm) in drawn.angles.items():
        arms = positions[arm] - positions[vertex]
        angle, radius = np.arctan2(arms @ quarter, arms @ start), ARC * drawing.unit
        turns = np.linspace(0.0, angle, 31)[:, None]
        arc = positions[vertex] + radius * (np.cos(turns) * start + np.sin(turns) * quarter)
        line(arc, width=0.9)
        line([positions[vertex], positions[vertex] + 1.5 * radius * start], width=0.7)
        name(symbol, arc[len(arc) // 2], "black", f"joints.{symbol}")
    for pair in drawn.lengths:
        text = f"{pair} = {100 * values[pair]:.2f} cm" if pair in values else f"d = {pair}, driven"
        name(text, (positions[pair[0]] + positions[pair[1]]) / 2, GRAY, f"joints.{pair}")
    seen_from = None if drawing.planar else view
    figure = SketchFigure(Scene.of(drawing), None, "", seen_from, axes)
    left, right = axes.get_xlim()
    axes.set_xlim(left - 0.15 * (right - left), right)  # room for lengths on the left
    draw_scale(axes, figure.extent, seen_from)
    figure.show(0)
    return figure


FIGURES = {
    "figure_01": partial(
        draw,
        {"Four-bar": FOUR_BAR, "Inverted slider-crank": SLIDER_CRANK},
        title="Planar mechanisms (figure 1 of Sommer 2024)",
        note=LENGTHS_ONLY,
        size=(8.0, 4.0),
    ),
    "figure_08": partial(
        draw, {"": RSUR}, title="RSUR mechanism (figure 8 of Sommer 2024)", note=CHOSEN.format("s"), size=(5.6, 3.6)
    ),
    "figure_09": partial(
        draw, {"": RSPU}, title="RSPU mechanism (figure 9 of Sommer 2024)", note=CHOSEN.format(""), size=(5.6, 3.2)
    ),
}
