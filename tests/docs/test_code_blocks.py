"""What the README and the pages show is true: their Python runs, their mechanism files load."""

import pathlib
import re
import shlex

import pytest

import jounce as jn
from jounce.cli import main

ROOT = pathlib.Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
SLOW = ("closed_loop_robots", "coming_from", "integrators", "own_joint", "reactions", "robots", "simulation", "spatial")
SLOW += ("cams", "gradients", "robot_forward_dynamics", "torque_rates")  # to compile
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks(page, language):
    text = page.read_text()
    for match in BLOCK.finditer(text):
        if match.group(1) == language:
            yield text[: match.start(2)].count("\n"), match.group(2)


def pages_with(language, needle=""):
    found = [page for page in PAGES if any(needle in code for _, code in blocks(page, language))]
    cases = [pytest.param(page, marks=pytest.mark.slow if page.stem in SLOW else ()) for page in found]
    return pytest.mark.parametrize("page", cases, ids=[str(page.relative_to(ROOT)) for page in found])


@pytest.mark.slow
@pages_with("python")
@pytest.mark.usefixtures("single_precision")  # which a page switches off itself where it has to
def test_python_blocks_run(page, tmp_path, monkeypatch):
    (tmp_path / "examples").symlink_to(ROOT / "examples", target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    names, shown = {"__name__": "page"}, list(blocks(page, "python"))
    for line, code in shown:
        exec(compile("\n" * line + code, str(page), "exec"), names)
    assert any("jounce" in code for _, code in shown), "a page's code uses jounce"


@pytest.mark.slow
@pages_with("yaml", "\nspace: ")
def test_mechanism_files_in_the_pages_solve(page, tmp_path):
    for _, text in blocks(page, "yaml"):
        if "\nspace: " not in text:
            continue
        path = tmp_path / "mechanism.yaml"
        path.write_text(text)
        motion = jn.solve(jn.load(path), order=1)
        assert (motion.status == jn.Status.OK).all()


def test_what_pages_take_from_the_package_is_in_its_stub():
    """Editors and type checkers know nothing else: they would underline the code of a page."""
    used = {name for page in PAGES for _, code in blocks(page, "python") for name in re.findall(r"\bjn\.(\w+)", code)}
    assert {"solve", "io", "dynamics"} <= used <= {*dir(jn)}


def test_the_readme_and_the_start_page_have_code():
    found = [page.name for page in PAGES if any(blocks(page, "python"))]
    assert {"README.md", "start.md", "own_joint.md"} <= set(found)


def test_the_listing_of_the_start_page_is_what_the_command_prints(capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    (listing,) = (text for _, text in blocks(ROOT / "docs" / "start.md", "text") if text.startswith("Planar four-bar"))
    assert main(["run", "examples/four_bar.yaml"]) == 0
    # of two peaks that are equal but for rounding either may be told
    shown, printed = ([line.split()[:-3] + line.split()[-2:-1] for line in x.splitlines()] for x in
                   (listing, capsys.readouterr().out))  # fmt: skip
    assert shown == printed


ELSEWHERE = ("python3", ".venv/bin/python", "bash", "jounce reproduce")  # set-up, scripts and papers have own checks


@pytest.mark.slow
@pages_with("sh", "jounce ")
def test_commands_in_the_pages_run(page, run, tmp_path, monkeypatch):
    (tmp_path / "examples").symlink_to(ROOT / "examples", target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setattr("webbrowser.open", lambda _: True)
    monkeypatch.setattr("jounce.viewer.View.wait", lambda view: view.close())
    for _, text in blocks(page, "sh"):
        for line in text.splitlines():
            command = line.removeprefix(".venv/bin/")
            if any(line.startswith(word) or command.startswith(word) for word in ELSEWHERE):
                continue
            program, *arguments = shlex.split(command, comments=True)
            assert program == "jounce", line
            if arguments[0] == "sweep":
                arguments += ["--workers", "0"]  # in this process; tests/sweeps has others
            status, _, err = run(*arguments)
            assert status == 0, f"{line}: {err}"
