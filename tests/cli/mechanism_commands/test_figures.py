"""The commands that draw: which kinds there are, what they write, and how they refuse."""

import pathlib

import pytest
from PIL import Image

ROOT = pathlib.Path(__file__).resolve().parents[3]
FOUR_BAR = str(ROOT / "examples" / "four_bar.yaml")


@pytest.mark.parametrize("kind", ["sketch", "hodograph", "phase"])
def test_each_kind_writes_a_figure(run, tmp_path, kind):
    path = tmp_path / f"{kind}.png"
    assert run("plot", FOUR_BAR, "--kind", kind, "--derivative", "2", "--out", path) == (0, f"Written to {path}\n", "")
    with Image.open(path) as picture:
        assert min(picture.size) > 400


def test_outputs_alone_are_named_on_request(run, tmp_path):
    path = tmp_path / "sketch.png"
    status, _, err = run("plot", FOUR_BAR, "--kind", "sketch", "--names", "outputs", "--out", path)
    assert (status, err) == (0, "")


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


def test_the_view_says_which_packages_it_needs(run, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    status, out, err = run("view", FOUR_BAR)
    assert (status, out) == (2, "")
    assert err.startswith("error: the view needs the package viser")
    assert 'pip install "jounce[viewer]"' in err


@pytest.mark.parametrize(
    "command", ["new", "inspect", "run", "trace", "simulate", "plot", "report", "view", "check", "convert"]
)
def test_help_fits_a_terminal_and_has_examples(run, monkeypatch, command):
    monkeypatch.setenv("COLUMNS", "80")
    status, out, _ = run(command, "--help")
    assert status == 0
    assert f"  jounce {command} " in out.partition("Examples:")[2]
    summary = out.split("\n\n")[1]
    assert "\n" not in summary
    assert len(summary) < 72
