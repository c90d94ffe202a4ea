"""What the README and the pages show is true: their Python runs, their mechanism files load."""

import pathlib
import re

import pytest

import jounce as jn

ROOT = pathlib.Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
SLOW = ("closed_loop_robots.md", "integrators.md", "simulation.md")  # they compile for half a minute
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks(page, language):
    text = page.read_text()
    for match in BLOCK.finditer(text):
        if match.group(1) == language:
            yield text[: match.start(2)].count("\n"), match.group(2)


def pages_with(language, needle=""):
    found = [page for page in PAGES if any(needle in code for _, code in blocks(page, language))]
    cases = [pytest.param(page, marks=pytest.mark.slow if page.name in SLOW else ()) for page in found]
    return pytest.mark.parametrize("page", cases, ids=[str(page.relative_to(ROOT)) for page in found])


@pages_with("python")
def test_python_blocks_run(page, tmp_path, monkeypatch):
    (tmp_path / "examples").symlink_to(ROOT / "examples", target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "page"}
    for line, code in blocks(page, "python"):
        exec(compile("\n" * line + code, str(page), "exec"), names)
    assert "jn" in names or "jounce" in names, "a page's code uses jounce"


@pages_with("yaml", "\nspace: ")
def test_mechanism_files_in_the_pages_solve(page, tmp_path):
    for _, text in blocks(page, "yaml"):
        if "\nspace: " not in text:
            continue
        path = tmp_path / "mechanism.yaml"
        path.write_text(text)
        motion = jn.solve(jn.load(path), order=4)
        assert (motion.status == jn.Status.OK).all()


def test_the_readme_and_the_start_page_have_code():
    found = [page.name for page in PAGES if any(blocks(page, "python"))]
    assert {"README.md", "start.md", "own_joint.md"} <= set(found)
