"""The style of all figures: type, lines and colors suitable for the color-blind (Okabe and Ito)."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.resources import as_file, files
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY = "#0072B2", "#D55E00", "#009E73", "#E69F00", "#CC79A7", "#56B4E9"
COLORS = (BLUE, VERMILION, GREEN)  # of components
LINE_COLORS = (BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILION, "#000000")
"""Colors of many lines in one panel, without the yellow of Okabe and Ito, which is too pale."""
BODY_COLORS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY)
GRAY = "#444444"
TITLE_SIZE, SMALLEST_TITLE = 11.0, 4.0  # points
LONGEST_NAME = 100  # characters, as in files
LETTER = 0.0088  # width of a bold letter per point of its size, inches
PALE_GRAY = "#999999"  # of lines through zero
RESOLUTION = 200  # dots per inch


@contextmanager
def style(**changes: Any) -> Iterator[None]:
    """Apply the settings for drawing and writing figures; letters missing in the font become boxes.

    Parameters
    ----------
    **changes
        Further settings of matplotlib, with underscores instead of dots.

    Examples
    --------
    >>> import matplotlib as mpl
    >>> from jounce.plot.style import style
    >>> with style(font_size=7):
    ...     mpl.rcParams["font.size"], mpl.rcParams["legend.frameon"]
    (7.0, False)
    """
    import matplotlib as mpl
    from matplotlib.rcsetup import cycler

    with as_file(files("jounce.plot") / "jounce.mplstyle") as path:
        settings = mpl.rc_params_from_file(path, use_default_template=False)
    settings["axes.prop_cycle"] = cycler(color=LINE_COLORS)
    changed: dict[Any, Any] = {name.replace("_", "."): value for name, value in changes.items()}
    with mpl.rc_context(dict(settings) | changed), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing", category=UserWarning)
        yield


def blank_figure(width: float, height: float, title: str = "", **pads: float) -> Figure:
    """Return an empty figure, in inches, with automatic layout, without a window or global state.

    A title too long for the width is written smaller, or truncated if it would be illegible.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    chosen: dict[str, Any] = {"w_pad": 0.06, "h_pad": 0.045, "hspace": 0.0, "wspace": 0.02} | pads
    figure = Figure(figsize=(width, height), dpi=RESOLUTION, layout=ConstrainedLayoutEngine(**chosen))
    FigureCanvasAgg(figure)
    if title:
        longest = int((width - 0.2) / (LETTER * SMALLEST_TITLE))
        title = title if len(title) <= longest else title[: longest - 3] + "..."
        size = min(TITLE_SIZE, (width - 0.2) / (LETTER * len(title)))
        figure.suptitle(printable(title).replace("$", r"\$"), fontsize=size)
    return figure


def set_ticks(axis: Any, most: int, least: int = 2) -> None:
    """Set few ticks, at round numbers, on an axis."""
    from matplotlib.ticker import MaxNLocator

    axis.set_major_locator(MaxNLocator(nbins=most, steps=[1, 2, 2.5, 5, 10], min_n_ticks=least))


def printable(text: str) -> str:
    """Return text in one line, without control characters or characters that are invalid in SVG files."""
    return "".join(c if c.isprintable() else " " for c in text)


def shown_name(name: str) -> str:
    """Return a name escaped for matplotlib, so that dollar signs show, and truncated if very long."""
    label = name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME - 3]}..."
    return printable(label).replace("$", r"\$")
