"""The command that copies examples of the package."""

from __future__ import annotations

import shlex
from pathlib import Path

from jounce.cli.options import Overwrite
from jounce.reporting.terminal import print_text, say_json, show_columns

NO_MODELS = ("cams/", "drives/", "limits/", "trajectories/")  # examples that `jounce inspect` does not read


def example(
    name: str | None = None, file: Path | None = None, /, *, overwrite: Overwrite = False, json: bool = False
) -> int:
    """Copy an example with the files that it names, or list the examples.

    Parameters
    ----------
    name
        Name of the example, such as four_bar or robots/panda.urdf.
    file
        File to write [default: its own name, in this folder].
    overwrite
        Replace existing files.
    json
        Print the result as JSON.

    Examples
    --------
      jounce example
      jounce example stewart_platform
      jounce example robots/panda.urdf arm.urdf
    """
    from jounce.io.files.examples import copy_example, example_names

    if name is None:
        examples = example_names()
        if json:
            say_json("example", {"examples": [{"name": name, "about": about} for name, about in examples.items()]})
            return 0
        show_columns(list(examples.items()))
        print_text("\nCopy one with: jounce example NAME [FILE]")
        return 0
    paths = [str(path) for path in copy_example(name, file, overwrite=overwrite)]
    if json:
        say_json("example", {"name": name, "written": paths})
        return 0
    for path in paths:
        print_text(f"Written to {path}")
    if not name.startswith(NO_MODELS) and paths[0].endswith((".yaml", ".urdf", ".xml", ".sdf")):
        print_text(f"\nTry now:\n  jounce inspect {shlex.quote(paths[0])}")
    return 0
