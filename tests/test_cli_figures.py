"""The commands that draw: which kinds there are, what they write, and how they refuse."""

import pathlib

import pytest
from PIL import Image

ROOT = pathlib.Path(__file__).resolve().parents[1]
FOUR_BAR = str(ROOT / "examples" / "four_bar.yaml")


@pytest.mark.parametrize("kind", ["sketch", "hodograph", "phase"])
def test_each_kind_writes_a_figure(run, tmp_path, kind):
    path = tmp_path / f"{kind}.png"
    assert run("plot", FOUR_BAR, "--kind", kind, "--derivative", "2", "--out", path) == (0, f"Written to {path}\n", "")
    with Image.open(path) as picture:
        assert min(picture.size) > 400


def test_an_ending_of_a_film_draws_one(run, tmp_path):
    path = tmp_path / "film.gif"
    assert run("plot", FOUR_BAR, "--fps", "4", "--speed", "0.5", "--out", path)[0] == 0
    with Image.open(path) as film:
        assert film.n_frames == 17


def test_report_is_named_after_the_file(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run("report", FOUR_BAR, "--order", "1")[:2] == (0, "Written to four_bar.html\n")
    assert "Planar four-bar" in (tmp_path / "four_bar.html").read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["energy", "power", "reactions"])
def test_forces_are_drawn_of_a_simulation(run, tmp_path, kind):
    path = tmp_path / "figure.png"
    pendulum = ROOT / "examples" / "simple_pendulum.yaml"
    assert run("plot", pendulum, "--kind", kind, "--order", "2", "--out", path) == (0, f"Written to {path}\n", "")
    assert path.stat().st_size > 10_000


@pytest.mark.parametrize(
    "arguments, part",
    [
        (["plot", FOUR_BAR, "--kind", "skech"], "sketch"),
        (["plot", FOUR_BAR, "--kind", "sketch", "--out", "a.gif"], "does not move"),
        (["plot", FOUR_BAR, "--kind", "animation", "--out", "a.png"], ".gif, .mp4"),
        (["plot", FOUR_BAR, "--kind", "reactions", "--output", "BCD"], "did you mean 'BC'"),
        (["plot", FOUR_BAR, "--kind", "energy", "--out", "a.png"], "mass"),
        (["plot", FOUR_BAR, "--kind", "hodograph", "--output", "psi", "--out", "a.png"], "with components"),
        (["plot", FOUR_BAR, "--kind", "phase", "--output", "psi", "--output", "C"], "one output"),
        (["plot", FOUR_BAR, "--out", "a.gif", "--speed", "0.0001"], "at most 3000"),
        (["report", FOUR_BAR, "--out", "a.pdf"], ".html"),
        (["report", FOUR_BAR, "--order", "31", "--out", "a.html"], "--order"),
    ],
)
def test_bad_input_ends_with_a_message(run, tmp_path, monkeypatch, arguments, part):
    monkeypatch.chdir(tmp_path)
    status, printed, message = run(*arguments)
    assert (status, printed) == (2, "")
    assert part in message
    assert not list(tmp_path.iterdir())
