"""The reference has every public name once, under its public name, with an example that runs."""

import importlib
import inspect
import pathlib
import re
import types

import pytest

import jounce as jn

ROOT = pathlib.Path(__file__).parents[2]
PAGES = sorted((ROOT / "docs" / "reference").glob("*.md"))
PACKAGES = ("design", "dynamics", "forces", "integrate", "jet", "kinematics", "papers", "planning", "plot", "rigid")
PACKAGES += ("robot", "sweeps", "trajectory", "viewer")
MODULES = ("cams", "energy", "joints", "laws", "outputs")  # names of several packages, under subjects
CATALOGUES = ("planar", "spatial", "drivers")
ALIASES = {"Scalar", "Vector", "Law", "Laws"}  # annotations of fields, told of in the text
HELPERS = {"check_animation", "check_figure", "check_report", "raise_for_status", "needs_chunks"}
HELPERS |= {
    "force_catalogue",
    "coordinate_of",
    "length_of",
    "slide",
    "next_sine_cosine",
    "CoupledJoints",
    "LinkClosure",
}


def documented():
    """Names of the directives, as module.name, with their pages."""
    found = []
    for page in PAGES:
        module = None
        for line in page.read_text().splitlines():
            if match := re.match(r"\.\. currentmodule:: (\S+)", line):
                module = match[1]
            elif match := re.match(r"\.\. auto\w+:: (\S+)", line):
                found.append((f"{module}.{match[1]}", page.name))
    return found


def public():
    """Every public name, as short as it can be written."""
    top = {n for n in jn.__all__ if not n.startswith("_") and not isinstance(getattr(jn, n), types.ModuleType)}
    names = {f"jounce.{name}" for name in top - ALIASES}
    for module in MODULES:
        there = {n for n, value in vars(getattr(jn, module)).items() if not isinstance(value, types.ModuleType)}
        there = {name for name in there - top - ALIASES - HELPERS if not name.startswith("_")}
        names |= {f"jounce.{module}.{name}" for name in there}
        top |= there
    classes = {
        name
        for name, value in vars(jn.errors).items()
        if getattr(value, "__module__", "") == "jounce.errors" and isinstance(value, type)
    }
    names |= {f"jounce.errors.{name}" for name in classes - top if not name.startswith("_")}
    for package in (*PACKAGES, *CATALOGUES):
        module = importlib.import_module(f"jounce.{package}") if package in PACKAGES else getattr(jn, package)
        for name, value in vars(module).items():
            mine = package in PACKAGES or getattr(value, "__module__", None) == module.__name__
            if mine and not name.startswith(("_", "jax")) and not isinstance(value, types.ModuleType):
                names |= set() if name in top | HELPERS | ALIASES else {f"jounce.{package}.{name}"}
    return names


def find(name):
    parts = name.split(".")
    for cut in range(len(parts) - 1, 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:cut]))
        except ModuleNotFoundError:
            continue
        for part in parts[cut:]:
            found = getattr(found, part)
        return found
    raise ModuleNotFoundError(name)


def test_every_public_name_is_in_the_reference_once():
    names = [name for name, _ in documented()]
    assert sorted(set(names)) == sorted(names)
    assert not public() - set(names)


def test_every_documented_name_exists_and_says_what_it_is():
    for name, _ in documented():
        found = find(name)
        assert isinstance(found, dict | tuple) or inspect.getdoc(found), name


@pytest.mark.parametrize("name, page", documented())
def test_every_name_has_an_example(name, page):
    found = find(name)
    text = (ROOT / "docs" / "reference" / page).read_text()
    code = "\n".join(re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL))
    inside = inspect.isclass(found) and any(">>>" in (inspect.getdoc(m) or "") for m in vars(found).values())
    assert inside or ">>>" in (inspect.getdoc(found) or "") or re.search(rf"\b{name.split('.')[-1]}\b", code)


def test_the_reference_lists_its_pages():
    text = (ROOT / "docs" / "api.md").read_text()
    assert sorted(re.findall(r"^reference/(\w+)$", text, re.MULTILINE)) == sorted(page.stem for page in PAGES)
