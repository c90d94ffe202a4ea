"""The gallery shows every mechanism and robot of the examples, with its picture, and its commands name files."""

import importlib.util
import pathlib
import re
import struct

import pytest

ROOT = pathlib.Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "gallery.md").read_text()
PICTURES = ROOT / "docs" / "images" / "gallery"
MECHANISMS = sorted((ROOT / "examples").glob("*.yaml")) + sorted((ROOT / "examples" / "own_joint").glob("*.yaml"))
ROBOTS = sorted(path for path in (ROOT / "examples" / "robots").iterdir() if path.suffix in (".urdf", ".xml"))
FILES = [str(path.relative_to(ROOT)) for path in MECHANISMS + ROBOTS]


def drawn():
    """Return what docs/make_gallery.py draws."""
    spec = importlib.util.spec_from_file_location("make_gallery", ROOT / "docs" / "make_gallery.py")
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    return script.PICTURES


@pytest.mark.parametrize("file", FILES)
def test_the_gallery_shows_every_example(file):
    assert re.search(rf"{re.escape(file)}\b", PAGE)


def test_the_gallery_has_two_dozen_entries_each_with_a_picture_a_paragraph_and_a_command():
    entries = PAGE.split(":::::{container} entry")[1:]
    assert len(entries) >= 24
    for entry in entries:
        title = re.search(r"\*\*(.+)\*\*", entry).group(1)
        picture, paragraph, command = entry.partition("![")[2].split("\n\n")[:3]
        assert re.match(re.escape(title) + r"\]\(images/gallery/\w+\.png\)", picture)
        assert len(paragraph) > 90, title
        assert re.search(r"^(jounce|python) ", command, re.MULTILINE), title


def test_every_file_of_a_command_exists():
    named = set(re.findall(r"examples/[\w/]+\.\w+", PAGE))
    assert len(named) > 40
    assert not [name for name in sorted(named) if not (ROOT / name).exists()]


def test_every_picture_of_the_script_exists_and_is_small():
    names = {path.stem for path in PICTURES.glob("*.png")}
    assert names == set(drawn())
    for path in sorted(PICTURES.glob("*.png")):
        data = path.read_bytes()
        assert len(data) <= 40_000, path.name
        width, height = struct.unpack(">II", data[16:24])
        assert width > 250, path.name
        assert height > 200, path.name


def test_every_picture_shows_an_example_and_is_on_the_page():
    assert set(drawn()) <= {path.stem for path in MECHANISMS + ROBOTS}
    assert set(re.findall(r"images/gallery/(\w+)\.png", PAGE)) == set(drawn())


def test_ci_runs_every_robot_of_the_gallery():
    script = (ROOT / ".ci" / "run").read_text() + (ROOT / "examples" / "closed_loop_robot.py").read_text()
    assert not [path.name for path in ROBOTS if path.name not in script]
