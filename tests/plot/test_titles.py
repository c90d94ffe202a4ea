"""Titles and names in any script, of any length, with any character: every figure is drawn, without a warning."""

import warnings
from xml.etree import ElementTree

import matplotlib.image
import numpy as np
import pytest

import jounce as jn
from jounce.plot import (
    animate,
    draw,
    draw_energy,
    draw_power,
    draw_reactions,
    hodograph,
    phase_portrait,
    save,
    sketch,
)
from jounce.plot.style import shown_name

TITLES = {
    "Chinese": "\u673a\u6784 \u56db\u8fde\u6746",
    "Arabic": "\u0622\u0644\u064a\u0629",
    "a picture": "robot \U0001f916",
    "mathematics": r"$x^{ $ \$ \frac{ ^_",
    "markup": "<b>&amp;</b> ]]> --> <!--",
    "controls": "two\nlines\t\x1b[31m\x00 \u202e \u2028",
    "a page": "word " * 3000,
}


@pytest.fixture(scope="module")
def motions():
    """A disc on a pin for each title, which is also the name of everything."""
    found = {}
    for kind, title in TITLES.items():
        name = title[:100]
        mechanism = jn.Mechanism(
            space="planar",
            title=title,
            bodies={name: jn.Body([0, 0], mass=1.0, inertia=0.1)},
            joints={f"O{name}": jn.planar.Revolute(("ground", name), [0, 0], [0, 0])},
            drivers={name: jn.drivers.CoordinateDriver(("ground", name), "angle", motion="t")},
            outputs={name: jn.outputs.PointOutput(name, [1, 0])},
        )
        found[kind] = jn.solve(mechanism, np.linspace(0.0, 1.0, 5), order=3)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("kind", TITLES)
def test_every_figure_takes_every_title(kind, motions, tmp_path):
    motion, name = motions[kind], TITLES[kind][:100]
    figures = [draw(motion), sketch(motion, names="all")]
    if kind in ("mathematics", "a page"):
        figures += [draw_reactions(motion), draw_energy(motion), draw_power(motion)]
        figures += [hodograph(motion, name, 1), phase_portrait(motion, name)]
    for number, figure in enumerate(figures):
        path = tmp_path / f"{number}.svg"
        save(figure, path)
        assert ElementTree.parse(path).getroot().tag.endswith("svg")


@pytest.mark.parametrize("kind", ["Chinese", "a page"])
def test_films_too(kind, motions, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        animate(motions[kind], tmp_path / "film.gif", fps=2)
    assert matplotlib.image.imread(tmp_path / "film.gif").std() > 0


def test_a_name_is_shown_letter_by_letter_in_one_line():
    assert shown_name("a\nb\x00c") == "a b c"
    assert shown_name("$x$") == r"\$x\$"
