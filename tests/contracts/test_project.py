"""Promises that the project makes about itself: the two commands, the pins, the size of files, plain text."""

import ast
import importlib.util
import pathlib
import re
import subprocess
import sys
import tomllib

import pytest

ROOT = pathlib.Path(__file__).parents[2]
SOURCES = sorted((ROOT / "src").rglob("*.py"))
PACKAGES = sorted(path.parent for path in (ROOT / "src" / "jounce").rglob("__init__.py"))
MOST_MODULES = 12  # of a package, without its `__init__`


def sh_blocks():
    return re.findall(r"^```(\w*)\n(.*?)^```$", (ROOT / "README.md").read_text(), re.MULTILINE | re.DOTALL)


def test_readme_starts_with_the_two_commands():
    languages = [language for language, _ in sh_blocks()]
    assert languages[:2] == ["sh", "sh"]
    assert languages.count("sh") == 2
    assert "jounce run examples/four_bar.yaml" in sh_blocks()[0][1]


def test_each_of_the_two_is_one_command_for_any_python_of_the_system():
    for _, block in sh_blocks()[:2]:
        assert block.count("\n") == 1
        assert block.startswith("python3 -m venv .venv && ")
    assert " -c constraints.txt . &&" in sh_blocks()[0][1], "no extra, which the command does not need"


def test_ci_runs_the_test_command_of_the_readme_word_for_word():
    last = sh_blocks()[1][1].strip().splitlines()[-1]
    assert "pytest" in last
    assert last in (ROOT / ".ci" / "run").read_text()


def test_ci_script_is_executable():
    assert (ROOT / ".ci" / "run").stat().st_mode & 0o100


def test_constraints_pin_every_direct_dependency_by_version_alone():
    lines = [line for line in (ROOT / "constraints.txt").read_text().splitlines() if not line.startswith("#")]
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+==[A-Za-z0-9.+!]+", line) for line in lines)
    pinned = {normal(line.split("==")[0]) for line in lines}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    required = project["dependencies"] + extras["test"] + extras["docs"] + extras["bench"]
    assert {normal(re.split(r"[\[<>=~!; ]", entry)[0]) for entry in required} <= pinned


def normal(name):
    return re.sub(r"[-_.]+", "-", name).lower()


def test_version_is_one():
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert f"version: {version}" in (ROOT / "CITATION.cff").read_text()
    assert f'__version__ = "{version}"' in (ROOT / "src" / "jounce" / "version.py").read_text()
    assert f"\n## {version} - " in (ROOT / "CHANGELOG.md").read_text()


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(ROOT / "src")))
def test_source_file_is_short_and_plain(path):
    text = path.read_text()
    assert text.isascii()
    assert text.count("\n") <= 400
    assert text.lstrip().startswith('"""'), "a module starts with its docstring"


def modules_of(package):
    """Return the names of the modules and packages in a package."""
    folders = {path.parent.name for path in package.glob("*/__init__.py")}
    return {path.stem for path in package.glob("*.py")} - {"__init__", "__main__"} | folders


def exports_of(package):
    """Return the names that the `__init__` of a package or its stub binds, other than modules of any package."""
    names = set()
    for node in (node for file in package.glob("__init__.py*") for node in ast.walk(ast.parse(file.read_text()))):
        if isinstance(node, ast.ImportFrom):
            source = package.joinpath(*[".."] * (node.level - 1)) if node.level else ROOT / "src"
            origin = source.joinpath(*(node.module or "").split("."))
            modules = modules_of(origin) if origin.is_dir() else set()
            names |= {alias.asname or alias.name for alias in node.names if alias.name not in modules}
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
    return names


@pytest.mark.parametrize("package", PACKAGES, ids=lambda p: str(p.relative_to(ROOT / "src")))
def test_a_package_has_at_most_a_dozen_modules(package):
    modules = [path.stem for path in package.glob("*.py") if path.stem != "__init__"]
    assert len(modules) <= MOST_MODULES, f"put some of {', '.join(sorted(modules))} into a package of their own"


@pytest.mark.parametrize("package", PACKAGES, ids=lambda p: str(p.relative_to(ROOT / "src")))
def test_no_function_or_class_hides_a_module_of_its_name(package):
    assert sorted(exports_of(package) & modules_of(package)) == []


def test_exports_that_hide_a_module_are_seen(tmp_path):
    (tmp_path / "solve.py").touch()
    (tmp_path / "trace.py").touch()
    (tmp_path / "__init__.py").write_text("from .solve import solve\n\n\ndef trace():\n    pass\n")
    assert exports_of(tmp_path) & modules_of(tmp_path) == {"solve", "trace"}
    (tmp_path / "__init__.py").write_text("from . import solve, trace\n")
    assert exports_of(tmp_path) & modules_of(tmp_path) == set()


def test_links_between_pages_lead_somewhere():
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    missing = [
        f"{page.relative_to(ROOT)}: {target}"
        for page in pages
        for target in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text())
        if "://" not in target and not (page.parent / target).exists()
    ]
    assert not missing


def test_lowest_releases_are_those_of_the_bounds():
    words = [sys.executable, ROOT / ".ci" / "bounds.py", "sweep"]
    printed = subprocess.run(words, capture_output=True, text=True, check=True).stdout.splitlines()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert len(printed) == len(project["dependencies"]) + len(project["optional-dependencies"]["sweep"])
    for entry in [*project["dependencies"], *project["optional-dependencies"]["sweep"]]:
        name, _, bound = re.sub(r"\[.*?\]", "", entry).partition(">=")
        assert f"{name}=={bound.partition(',')[0]}" in printed


def test_every_requirement_says_what_it_needs_at_least():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    every = project["dependencies"] + [x for extra in project["optional-dependencies"].values() for x in extra]
    every = [entry for entry in every if not entry.startswith("jounce[")]  # extras of its own
    assert [entry for entry in every if ">=" not in entry] == []


def check_names():
    spec = importlib.util.spec_from_file_location("check_names", ROOT / ".ci" / "check_names.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_names_say_what_they_hold():
    assert list(check_names().reports(ROOT)) == []


def test_a_name_that_says_little_is_reported_with_its_line(tmp_path):
    (tmp_path / ".ci").mkdir()
    (tmp_path / ".ci" / "names.txt").write_text("told->reported\n")
    (tmp_path / "src" / "jounce").mkdir(parents=True)
    (tmp_path / "src" / "jounce" / "module.py").write_text(
        "untold = 1\n\n\ndef f(x):\n    _told: int = x.told\n    return _told\n"
    )
    assert list(check_names().reports(tmp_path)) == ["src/jounce/module.py:5: the name _told says little: reported"]


def test_words_are_a_dictionary_of_codespell():
    lines = [
        *(ROOT / ".ci" / "words.txt").read_text().splitlines(),
        *(ROOT / ".ci" / "names.txt").read_text().splitlines(),
    ]
    assert all(re.fullmatch(r"[a-z]+->\S.*", line) for line in lines)
    assert "rehearsal->compilation in the background," in lines
