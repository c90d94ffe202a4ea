"""Sphinx configuration: python -m sphinx -W docs docs/_build."""

import importlib.metadata
import pathlib
import sys

HERE = pathlib.Path(__file__).parent
sys.path.insert(0, str(HERE / "_ext"))

project = "jounce"
author = "The jounce developers"
copyright = "The jounce developers, Apache-2.0"
version = release = importlib.metadata.version("jounce")

extensions = ["mathml", "myst_parser", "numpydoc", "sphinx.ext.autodoc", "sphinx.ext.viewcode"]
exclude_patterns = ["_build", "_ext", "benchmarks"]
source_suffix = {".md": "markdown"}

html_theme = "furo"
html_title = f"jounce {release}"
html_math_renderer = "mathml"
html_static_path = ["_static"]
html_css_files = ["jounce.css", "gallery.css"]
html_extra_path = ["schema"] if (HERE / "schema").exists() else []  # the JSON Schema, beside the pages

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

autosummary_generate = False  # numpydoc loads it; reference pages are automodule directives
autodoc_default_options = {"members": True, "member-order": "bysource"}
autodoc_typehints = "none"
numpydoc_show_class_members = False
