"""Sketches of mechanisms with joint symbols, names and the paths of points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from jounce.errors import MechanismError, did_you_mean
from jounce.mechanism import PointOutput
from jounce.mechanism.mechanism import Mechanism, check_mechanism
from jounce.plot.canvas import AZIMUTH, ELEVATION, WHEELS, screen_of
from jounce.plot.labels import scale_of, unit_label
from jounce.plot.naming import place_names
from jounce.plot.scene import Scene, outline, scene_of
from jounce.plot.style import GREY, blank_figure, printable, shown_name, style
from jounce.reporting.peaks import rate_name

__all__ = ["Drawing", "Paths", "draw_scale", "length_text", "paths_of", "round_length", "sketch"]

NAMES = ("all", "bodies", "joints", "none")
WIDEST, TALLEST, LEAST = 6.4, 5.2, 2.6  # inches
LETTER = 0.07  # inches of a title at least, which is then written smaller
WIDEST_TITLE = 8.0  # inches; what is longer is cut
MOST = 400  # instants that a drawing is made for; more would not be seen
PATH_MAP = "cividis"  # rises evenly in lightness, for the colour-blind too


class Paths:
    """Paths of points over a motion, with the size of a derivative.

    Parameters
    ----------
    motion : Motion
        What moves.
    names : sequence of str
        Outputs that are positions of points.
    order : int
        Derivative by whose size they are coloured; 0 for none.
    view : tuple of float
        From where a spatial mechanism is seen.
    """

    def __init__(self, motion: Any, names: Sequence[str], order: int, view: tuple[float, float]):
        screen = np.eye(2) if motion.mechanism.space == "planar" else screen_of(view)[:2]
        self.names, self.order = list(names), order
        self.flat = {name: motion.outputs[name][:, 0] @ screen.T for name in names}
        self.sizes = {name: np.linalg.norm(motion.outputs[name][:, order], axis=-1) for name in names}
        self.label = ""
        if names and order:
            output = motion.mechanism.outputs[names[0]]
            self.exponent = scale_of(np.concatenate(list(self.sizes.values())))
            whose = f" of {shown_name(names[0])}" if len(names) == 1 else ""
            self.label = f"{rate_name(output, order)}{whose}  ({unit_label(output.unit, order, self.exponent)})"


def paths_of(motion: Any, wanted: Sequence[str] | None, order: int, view: tuple[float, float]) -> Paths | None:
    """Return the paths of outputs of a motion: those wanted, or of all points; None for a mechanism at rest.

    Raises
    ------
    MechanismError
        An output is no position of a point, or the order is above that of the motion.
    """
    if isinstance(motion, Mechanism):
        if wanted or order:
            raise MechanismError("a mechanism has no paths before it moves; solve it first", name="paths")
        return None
    points = [name for name, output in motion.mechanism.outputs.items() if isinstance(output, PointOutput)]
    for name in wanted or ():
        if name not in points:
            message = f"only the position of a point has a path; {did_you_mean(name, points)}"
            raise MechanismError(message, name="paths", value=name)
    if not 0 <= order <= motion.order:
        message = f"the motion has derivatives up to order {motion.order}; solve it with a higher order"
        raise MechanismError(message, name="order", value=order)
    chosen = points if wanted is None else list(wanted)
    return Paths(motion, chosen, order, view) if chosen and len(motion.time) > 1 else None


class Drawing:
    """A scene as a figure that can be moved from instant to instant.

    Parameters
    ----------
    scene : Scene
        What is drawn.
    paths : Paths or None
        Behind it.
    title : str
        Above it.
    view : tuple of float, or None
        Of a spatial mechanism, for its axes.
    axes : matplotlib.axes.Axes, optional
        Where to draw; a figure of its own unless given.
    """

    def __init__(
        self, scene: Scene, paths: Paths | None, title: str, view: tuple[float, float] | None, axes: Any = None
    ):
        self.scene = scene
        left, right, lower, upper = self._limits(scene, paths)
        if axes is None:
            bar = 0.9 if paths is not None and paths.order and paths.names else 0.0
            axes = self._blank(right - left, upper - lower, bar, title)
        self.axes, self.figure = axes, axes.figure
        axes.set_aspect("equal")
        axes.set_axis_off()
        axes.set_xlim(left, right)
        axes.set_ylim(lower, upper)
        if paths is not None:
            _draw_paths(self.figure, axes, paths)
        self.artists = [self._artist(shape) for shape in scene.shapes]
        self.texts: list[tuple[Any, Any]] = []
        self.clock: Any = None
        draw_scale(axes, view)

    @staticmethod
    def _blank(wide: float, tall: float, bar: float, title: str) -> Any:
        """Return the axes of an empty figure for what is wide and tall, m, with a bar of colours, inches, beside it."""
        scale = min((WIDEST - 0.3) / wide, (TALLEST - 0.3) / tall)
        least = max(LEAST, min(LETTER * len(title), WIDEST_TITLE))
        size = max(least, wide * scale + 0.3 + bar), max(LEAST, tall * scale + 0.3 + 0.35 * bool(title))
        return blank_figure(*size, title).add_subplot()

    @staticmethod
    def _limits(scene: Scene, paths: Paths | None) -> tuple[float, float, float, float]:
        left, right, lower, upper = scene.limits
        for flat in paths.flat.values() if paths is not None else ():
            known = flat[np.isfinite(flat).all(axis=1)]
            if len(known):
                left, lower = min(left, known[:, 0].min()), min(lower, known[:, 1].min())
                right, upper = max(right, known[:, 0].max()), max(upper, known[:, 1].max())
        margin = 3.5 * scene.unit
        return left - margin, right + margin, lower - 2 * margin, upper + margin

    def _artist(self, shape: Any) -> Any:
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

    def write_names(self, instant: int, names: str, *, still: bool = True) -> None:
        """Write names near what they belong to, so that none covers another; lines lead to them in a still."""
        kinds = {"all": ("bodies", "joints"), "none": ()}.get(names, (names,))
        wanted = [label for label in self.scene.labels if label.owner.partition(".")[0] in kinds]
        obstacles = [outline(shape, instant) for shape in self.scene.shapes if shape.layer > WHEELS]
        self.texts = place_names(self.figure, self.axes, wanted, instant, obstacles, self.scene.unit, still)
        self._named = [
            (label.anchor, np.array(text.get_position()) - label.anchor[instant]) for label, text in self.texts
        ]

    def move_names(self, instant: int) -> None:
        """Let the names go along with what they belong to, to an instant, by index."""
        for (_, text), (anchor, offset) in zip(self.texts, self._named, strict=True):
            text.set_position(anchor[min(instant, len(anchor) - 1)] + offset)


def sketch(
    moving: Any,
    instant: float | None = None,
    *,
    names: str = "all",
    paths: Sequence[str] | None = None,
    order: int = 0,
    view: tuple[float, float] = (AZIMUTH, ELEVATION),
) -> Any:
    """Draw a mechanism as textbooks do: links, joint symbols, names, and the paths of its points.

    Parameters
    ----------
    moving : Motion or Mechanism
        A mechanism is put together near its starting guess; a motion is drawn at one instant.
    instant : float, optional
        Time, s; the nearest instant of the motion that was solved is taken, the first unless given.
    names : str, default "all"
        Which names are written: ``"all"``, ``"bodies"``, ``"joints"`` or ``"none"``.
    paths : sequence of str, optional
        Outputs whose paths are drawn; those of all points unless given.
    order : int, default 0
        Paths are coloured by the size of this derivative: 1 velocity, 2 acceleration, 3 jerk, ...
    view : tuple of float, default (-60, 25)
        Azimuth and elevation from which a spatial mechanism is seen, degrees.

    Returns
    -------
    matplotlib.figure.Figure
        With equal scales, a bar that tells them, and for spatial mechanisms the axes.

    Raises
    ------
    MechanismError
        A name or an order is not valid, or no instant was solved.
    AssemblyError
        The mechanism cannot be put together.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot import sketch
    >>> figure = sketch(jn.load("examples/four_bar.yaml"))
    >>> sorted(text.get_text() for text in figure.axes[0].texts)
    ['20 mm', 'A', 'BC', 'D', 'crank', 'rocker']
    """
    mechanism = getattr(moving, "mechanism", moving)
    check_mechanism(mechanism)
    if names not in NAMES:
        raise MechanismError(f"unknown choice; {did_you_mean(names, NAMES)}", name="names", value=names)
    found = paths_of(moving, paths, order, view)
    if mechanism is moving:
        scene, at = scene_of(mechanism, view=view), 0
    else:
        solved = np.flatnonzero(np.asarray(moving.status) == 0)
        if not solved.size:
            raise MechanismError("no instant was solved, so that there is nothing to draw", name="motion")
        at = int(
            solved[np.argmin(np.abs(moving.time[solved] - (moving.time[solved[0]] if instant is None else instant)))]
        )
        chosen = np.unique([*np.linspace(0, len(solved) - 1, min(MOST, len(solved))).round().astype(int)])
        chosen = np.unique([*solved[chosen], at])
        whole = scene_of(moving, view=view, instants=chosen)
        scene, at = whole.only(int(np.searchsorted(chosen, at))), 0
    with style():
        drawing = Drawing(scene, found, mechanism.title, None if mechanism.space == "planar" else view)
        drawing.show(at)
        drawing.write_names(at, names)
    return drawing.figure


def _draw_paths(figure: Any, axes: Any, paths: Paths) -> None:
    """Draw the paths of points, coloured by the size of a derivative where one is asked for."""
    from matplotlib.collections import LineCollection
    from matplotlib.colors import Normalize

    if not paths.order:
        for flat in paths.flat.values():
            axes.plot(flat[:, 0], flat[:, 1], color="#888888", linewidth=0.9, zorder=5)
        return
    scale = 10.0**-paths.exponent
    largest = max(float(np.nanmax(size)) for size in paths.sizes.values()) * scale
    norm = Normalize(0.0, largest or 1.0)
    drawn: Any = None
    for name, flat in paths.flat.items():
        pieces = np.stack([flat[:-1], flat[1:]], axis=1)
        size = 0.5 * (paths.sizes[name][:-1] + paths.sizes[name][1:]) * scale
        drawn = LineCollection(pieces.tolist(), cmap=PATH_MAP, norm=norm, linewidth=2.2, zorder=5, capstyle="round")
        drawn.set_array(size)
        axes.add_collection(drawn)
    bar = figure.colorbar(drawn, ax=axes, shrink=0.75, aspect=25, pad=0.02)
    bar.set_label(paths.label)
    bar.outline.set_visible(False)


def draw_scale(axes: Any, view: tuple[float, float] | None = None) -> None:
    """Draw a bar of a round length in the place of the one that is there, and the axes of a view in space."""
    for artist in axes.findobj(lambda found: found.get_gid() == "scale"):
        artist.remove()
    (left, right), (lower, upper) = axes.get_xlim(), axes.get_ylim()
    length = round_length(0.22 * (right - left))
    start, foot = left + 0.03 * (right - left), lower + 0.03 * (upper - lower)
    look = {"color": GREY, "gid": "scale"}
    axes.plot([start, start + length], [foot, foot], linewidth=1.6, solid_capstyle="butt", zorder=8, **look)
    axes.text(start, foot + 0.008 * (upper - lower), length_text(length), fontsize=7.5, va="bottom", **look)
    if view is None:
        return
    screen = screen_of(view)
    arm = 0.055 * max(right - left, upper - lower)
    origin = np.array([right - 1.5 * arm, lower + 1.2 * arm])
    for name, direction in zip("xyz", screen[:2].T, strict=True):
        tip = origin + arm * direction
        look = {"arrowstyle": "-|>", "color": GREY, "linewidth": 0.9, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 6}
        axes.annotate("", tip, origin, arrowprops=look, zorder=8, gid="scale")
        far = origin + 1.3 * arm * direction
        axes.text(*far, name, color=GREY, fontsize=7.5, ha="center", va="center", gid="scale")


def round_length(length: float) -> float:
    """Return the largest of 1, 2, 5, 10, 20, ... that is not above a length.

    Examples
    --------
    >>> round_length(0.07), round_length(3.0)
    (0.05, 2.0)
    """
    power = 10.0 ** np.floor(np.log10(length))
    return float(f"{power * max(k for k in (1.0, 2.0, 5.0) if k * power <= length * (1 + 1e-9)):.3g}")


def length_text(length: float) -> str:
    """Word a length.

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
