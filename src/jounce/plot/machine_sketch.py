"""Sketches of mechanisms with joint symbols, names and the paths of points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from jounce.errors import MechanismError, check_choice, did_you_mean
from jounce.kinematics import Motion
from jounce.mechanism import PointOutput
from jounce.mechanism.mechanism import Mechanism, check_mechanism
from jounce.mechanism.time import nearest_instants
from jounce.plot.drawings.drawing import VIEW, Label, Shape, View, screen_of
from jounce.plot.drawings.name_placement import place_names
from jounce.plot.drawings.scene import Scene, scene_of
from jounce.plot.instants import evenly_chosen, solved_instants
from jounce.plot.labels import bar_length, scale_of, unit_label
from jounce.plot.style import GRAY, blank_figure, printable, shown_name, style
from jounce.reporting.peaks import rate_name

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAMES = ("all", "bodies", "joints", "outputs", "none")
WIDEST, TALLEST, LEAST = 6.4, 5.2, 2.6  # inches
LETTER = 0.07  # least width of a letter of a title, inches; longer titles have smaller letters
WIDEST_TITLE = 8.0  # inches; longer titles are truncated
AXES_FOOT = 0.16  # space below the drawing for the axes of a spatial view, as a fraction of its size
LETTERING = {"bodies": {"fontweight": "bold"}, "outputs": {"fontstyle": "italic"}}
MOST = 400  # largest number of instants of a drawing
PATH_MAP = "cividis"  # uniform in lightness, and suitable for the color-blind


class Paths:
    """Paths of points over a motion, with the magnitude of a derivative.

    Parameters
    ----------
    motion : Motion
        The motion.
    names : sequence of str
        Outputs that are positions of points; at least one.
    order : int
        Derivative whose magnitude gives the color; 0 for none.
    view : tuple of float
        Azimuth and elevation of the viewer of a spatial mechanism, degrees.
    """

    def __init__(self, motion: Motion, names: Sequence[str], order: int, view: View):
        screen = np.eye(2) if motion.mechanism.space == "planar" else screen_of(view)[:2]
        self.order = order
        self.flat = {name: motion.outputs[name][:, 0] @ screen.T for name in names}
        sizes = {name: np.linalg.norm(motion.outputs[name][:, order], axis=-1) for name in names}
        exponent = scale_of(np.concatenate(list(sizes.values())))
        self.sizes = {name: size * 10.0**-exponent for name, size in sizes.items()}
        output, whose = motion.mechanism.outputs[names[0]], f" of {shown_name(names[0])}" if len(names) == 1 else ""
        self.label = f"{rate_name(output, order)}{whose}  ({unit_label(output.unit, order, exponent)})"


def check_names(names: str) -> None:
    """Raise MechanismError unless a choice of names is valid."""
    check_choice("choice", names, NAMES, MechanismError, name="names")


def paths_of(motion: Motion, selection: Sequence[str] | None, order: int, view: View) -> Paths | None:
    """Return the paths of the requested outputs of a motion, by default of all points; None if there are none.

    Raises
    ------
    MechanismError
        If an output is not the position of a point, or the order is above that of the motion.
    """
    points = [name for name, output in motion.mechanism.outputs.items() if isinstance(output, PointOutput)]
    for name in selection or ():
        if name not in points:
            message = f"only the position of a point has a path; {did_you_mean(name, points)}"
            raise MechanismError(message, name="paths", value=name)
    if not 0 <= order <= motion.order:
        message = f"the motion has derivatives up to order {motion.order}; solve it with a higher order"
        raise MechanismError(message, name="order", value=order)
    chosen = points if selection is None else list(selection)
    return Paths(motion, chosen, order, view) if chosen and len(motion.time) > 1 else None


def limits_with(scene: Scene, paths: Paths | None) -> tuple[float, float, float, float]:
    """Return the left, right, lower and upper end of a scene and its paths, m."""
    left, right, lower, upper = scene.limits
    for flat in paths.flat.values() if paths else ():
        finite = flat[np.isfinite(flat).all(axis=1)]
        if len(finite):
            (low_x, low_y), (high_x, high_y) = finite.min(axis=0).tolist(), finite.max(axis=0).tolist()
            left, lower, right, upper = min(left, low_x), min(lower, low_y), max(right, high_x), max(upper, high_y)
    return left, right, lower, upper


class SketchFigure:
    """A figure of a scene, which can be moved from instant to instant.

    Parameters
    ----------
    scene : Scene
        The scene.
    paths : Paths or None
        Paths behind the scene.
    title : str
        Title above the scene.
    view : tuple of float, or None
        View of a spatial mechanism, for its axes.
    axes : matplotlib.axes.Axes, optional
        Axes to draw on; by default those of a new figure.
    """

    def __init__(self, scene: Scene, paths: Paths | None, title: str, view: View | None, axes: Any = None):
        self.scene = scene
        (left, right, lower, upper), margin = limits_with(scene, paths), 3.5 * scene.unit
        self.extent = max(right - left, upper - lower)
        foot = 2 * margin if view is None else max(2 * margin, AXES_FOOT * self.extent)
        left, right, lower, upper = left - margin, right + margin, lower - foot, upper + margin
        if axes is None:
            axes = self._blank(right - left, upper - lower, 0.9 if paths and paths.order else 0.0, title)
        self.axes, self.figure = axes, axes.figure
        axes.set_aspect("equal")
        axes.set_axis_off()
        axes.set_xlim(left, right)
        axes.set_ylim(lower, upper)
        if paths:
            _draw_paths(self.figure, axes, paths)
        self.artists = [self._artist(shape) for shape in scene.shapes]
        self.texts: list[tuple[Any, Label, np.ndarray]] = []
        draw_scale(axes, self.extent, view)

    @staticmethod
    def _blank(width: float, height: float, bar: float, title: str) -> Any:
        """Return the axes of an empty figure for a width and height, m, and a color bar beside it, inches."""
        scale = min((WIDEST - 0.3) / width, (TALLEST - 0.3) / height)
        minimum = max(LEAST, min(LETTER * len(title), WIDEST_TITLE))
        size = max(minimum, width * scale + 0.3 + bar), max(LEAST, height * scale + 0.3 + 0.35 * bool(title))
        return blank_figure(*size, title).add_subplot()

    def _artist(self, shape: Shape) -> Any:
        from matplotlib.lines import Line2D
        from matplotlib.patches import Circle, Polygon

        look = {"linewidth": shape.width, "zorder": shape.layer, "gid": printable(shape.owner)}
        if shape.kind == "line":
            dashes = (0, shape.dashes) if shape.dashes else "-"
            caps = {"solid_capstyle": "round", "solid_joinstyle": "round"}
            return self.axes.add_line(Line2D([], [], color=shape.stroke, linestyle=dashes, **caps, **look))
        look |= {"edgecolor": shape.stroke or "none", "facecolor": shape.fill or "none"}
        patch = Circle((0, 0), shape.radius, **look) if shape.kind == "disc" else Polygon(np.zeros((1, 2)), **look)
        return self.axes.add_patch(patch)

    def show(self, instant: int) -> None:
        """Move all shapes to an instant, by index."""
        for shape, artist in zip(self.scene.shapes, self.artists, strict=True):
            points = shape.points[min(instant, len(shape.points) - 1)]
            if shape.kind == "line":
                artist.set_data(points[:, 0], points[:, 1])
            elif shape.kind == "area":
                artist.set_xy(points)
            else:
                artist.set_center(points[0])

    def write_names(self, names: str, *, fixed: bool = True) -> None:
        """Write names near their anchors, clear of the drawing at all instants; still figures have leader lines."""
        from matplotlib.patheffects import withStroke

        kinds = {"all": ("bodies", "joints", "outputs"), "none": ()}.get(names, (names,))
        axes, renderer = self.axes, self._placed_renderer()
        boxes = np.array([_box(text, renderer) for text in axes.texts]).reshape(-1, 4)
        selected = [label for label in self.scene.labels if label.owner.partition(".")[0] in kinds]
        texts, halves = [], []
        for label in selected:
            text = axes.text(0.0, 0.0, shown_name(label.text), color=label.color, fontsize=8, ha="center", va="center")
            text.set(zorder=9, path_effects=[withStroke(linewidth=1.8, foreground="white")])
            text.set_gid(printable(f"name.{label.owner}"))
            text.set(**LETTERING.get(label.owner.partition(".")[0], {}))
            left, lower, right, upper = _box(text, renderer)
            texts.append(text)
            halves.append(np.array([right - left, upper - lower]) / 2 + 1.0)
        to_pixels = axes.transData
        unit = float(np.diff(to_pixels.transform([[0.0, 0.0], [self.scene.unit, 0.0]]), axis=0)[0, 0])
        frame = _box(axes, renderer)
        placements = place_names(selected, halves, self.scene, to_pixels.transform, frame, boxes)
        for label, text, half, place in zip(selected, texts, halves, placements, strict=True):
            if place is None:
                text.remove()
                continue
            anchor = label.anchor[0]
            position = to_pixels.inverted().transform(to_pixels.transform(anchor) + place.offset(half, unit))
            text.set_position(position)
            self.texts.append((text, label, position - anchor))
            if place.led and fixed:
                look = {"color": label.color, "linewidth": 0.5, "alpha": 0.6, "zorder": 5.5}
                start = anchor + 1.2 * self.scene.unit * np.array(place.direction)  # at the rim of a pin
                axes.plot([start[0], position[0]], [start[1], position[1]], **look)

    def _placed_renderer(self) -> Any:
        """Lay out all panels, and return the renderer, which measures texts."""
        self.figure.draw_without_rendering()
        return self.figure.canvas.get_renderer()

    def move_names(self, instant: int) -> None:
        """Move the names with their anchors to an instant, by index."""
        for text, label, offset in self.texts:
            text.set_position(label.anchor[min(instant, len(label.anchor) - 1)] + offset)


def sketch(
    moving: Any,
    instant: float | None = None,
    *,
    names: str = "all",
    paths: Sequence[str] | None = None,
    order: int = 0,
    view: View = VIEW,
) -> Figure:
    """Draw a mechanism as textbooks do: links, joint symbols, names, and the paths of its points.

    Parameters
    ----------
    moving : Motion or Mechanism
        A mechanism, assembled near its starting guess, or a motion, drawn at one instant.
    instant : float, optional
        Time, s, rounded to the nearest solved instant of the motion; by default the first one.
    names : str, default "all"
        Names to write: ``"all"``, ``"bodies"``, ``"joints"``, ``"outputs"`` (of points) or ``"none"``.
    paths : sequence of str, optional
        Outputs whose paths are drawn, by default all points.
    order : int, default 0
        Derivative whose magnitude colors the paths: 1 velocity, 2 acceleration, 3 jerk, ...
    view : tuple of float, default (-60, 25)
        Azimuth and elevation of the viewer of a spatial mechanism, degrees.

    Returns
    -------
    matplotlib.figure.Figure
        The sketch, with equal scales, a scale bar, and the axes of spatial mechanisms.

    Raises
    ------
    MechanismError
        If a name or an order is not valid, or no instant was solved.
    AssemblyError
        If the mechanism cannot be assembled.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot import sketch
    >>> figure = sketch(jn.load("examples/four_bar.yaml"))
    >>> sorted(text.get_text() for text in figure.axes[0].texts)
    ['25 mm', 'A', 'BC', 'C', 'D', 'crank', 'rocker']
    """
    mechanism = getattr(moving, "mechanism", moving)
    check_mechanism(mechanism)
    check_names(names)
    if isinstance(moving, Mechanism):
        if paths or order:
            raise MechanismError("a mechanism has no paths before it moves; solve it first", name="paths")
        scene, path_lines = scene_of(moving, view=view), None
    else:
        path_lines, solved = paths_of(moving, paths, order, view), solved_instants(moving)
        shown_instants = np.array([moving.time[solved[0]] if instant is None else instant])
        index = solved[nearest_instants(moving.time[solved], shown_instants)[0]]
        chosen = np.union1d(evenly_chosen(solved, MOST), index)  # rails cover the whole motion
        scene = scene_of(moving, view=view, instants=chosen).only(int(np.searchsorted(chosen, index)))
    with style():
        figure = SketchFigure(scene, path_lines, mechanism.title, None if mechanism.space == "planar" else view)
        figure.show(0)
        figure.write_names(names)
    return figure.figure


def _draw_paths(figure: Any, axes: Any, paths: Paths) -> None:
    """Draw the paths of points, colored by the magnitude of a derivative if one is requested."""
    from matplotlib.collections import LineCollection
    from matplotlib.colors import Normalize

    if not paths.order:
        for flat in paths.flat.values():
            axes.plot(flat[:, 0], flat[:, 1], color="#888888", linewidth=0.9, zorder=5)
        return
    largest = max(float(np.nanmax(size)) for size in paths.sizes.values())
    norm = Normalize(0.0, largest or 1.0)
    drawn: Any = None
    for name, flat in paths.flat.items():
        pieces = np.stack([flat[:-1], flat[1:]], axis=1)
        drawn = LineCollection(pieces.tolist(), cmap=PATH_MAP, norm=norm, linewidth=2.2, zorder=5, capstyle="round")
        drawn.set_array(0.5 * (paths.sizes[name][:-1] + paths.sizes[name][1:]))
        axes.add_collection(drawn)
    bar = figure.colorbar(drawn, ax=axes, shrink=0.75, aspect=25, pad=0.02)
    bar.set_label(paths.label)
    bar.outline.set_visible(False)


def _box(artist: Any, renderer: Any) -> Float[np.ndarray, "4"]:
    """Return the left, lower, right and upper edge of an artist, in pixels."""
    return artist.get_window_extent(renderer).extents


def draw_scale(axes: Any, extent: float, view: View | None = None) -> None:
    """Draw the axes of a spatial view, and a scale bar of a round length, which replaces an existing one.

    The length is a tenth to a fifth of `extent`, the larger of width and height of the mechanism, m.
    """
    for artist in axes.findobj(lambda each: each.get_gid() == "scale"):
        artist.remove()
    (left, right), (lower, upper) = axes.get_xlim(), axes.get_ylim()
    length = bar_length(extent)
    start, foot = left + 0.03 * (right - left), lower + 0.03 * (upper - lower)
    look = {"color": GRAY, "gid": "scale"}
    axes.plot([start, start + length], [foot, foot], linewidth=1.6, solid_capstyle="butt", zorder=8, **look)
    axes.text(start, foot + 0.008 * (upper - lower), length_text(length), fontsize=7.5, va="bottom", **look)
    if view is None:
        return
    screen = screen_of(view)
    arm = 0.055 * max(right - left, upper - lower)
    origin = np.array([right - 1.5 * arm, lower + 1.2 * arm])
    for name, direction in zip("xyz", screen[:2].T, strict=True):
        tip = origin + arm * direction
        look = {"arrowstyle": "-|>", "color": GRAY, "linewidth": 0.9, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 6}
        axes.annotate("", tip, origin, arrowprops=look, zorder=8, gid="scale")
        far = origin + 1.3 * arm * direction
        axes.text(*far, name, color=GRAY, fontsize=7.5, ha="center", va="center", gid="scale")


def length_text(length: float) -> str:
    """Return a length as text with a unit.

    Examples
    --------
    >>> length_text(0.05), length_text(2.0)
    ('50 mm', '2 m')
    """
    if length >= 1:
        return f"{length:g} m"
    for factor, unit in ((1e3, "mm"), (1e6, "\u00b5m")):
        if length * factor >= 1:
            return f"{round(length * factor, 6):g} {unit}"
    return f"{length:.3g} m"
