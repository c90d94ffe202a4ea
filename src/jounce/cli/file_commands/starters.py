"""The command that writes starter files."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from jounce.cli.file_commands.example_files import example
from jounce.cli.options import Overwrite
from jounce.errors import JounceError
from jounce.reporting.terminal import print_text, say_json, show_columns


def new(
    name: str | None = None,
    file: Path | None = None,
    /,
    *,
    from_: Annotated[str | None, Parameter(name="--from")] = None,
    overwrite: Overwrite = False,
    json: bool = False,
) -> int:
    """Write a commented starter file, or list the starters.

    Parameters
    ----------
    name
        Name of the starter, such as four-bar; with --from the file to write.
    file
        File to write: .yaml, .yml, .toml or .json [default: NAME.yaml].
    from_
        Start from an example, such as press, with the files that it names.
    overwrite
        Replace an existing file.
    json
        Print the result as JSON.

    Examples
    --------
      jounce new
      jounce new four-bar
      jounce new slider-crank engine.yaml
      jounce new --from press my_press.yaml
    """
    from jounce.io.mechanisms.starters import STARTERS, write_starter

    if from_ is not None:
        if file is not None:
            raise JounceError("writes one file: jounce new --from NAME [FILE]", name="--from", value=from_)
        if from_ not in STARTERS:
            return example(from_, None if name is None else Path(name), overwrite=overwrite, json=json)
        name, file = from_, None if name is None else Path(name)
    if name is None:
        if json:
            starters = [{"name": s.name, "about": s.about, "command": s.command} for s in STARTERS.values()]
            say_json("new", {"starters": starters})
            return 0
        show_columns([(starter.name, starter.about) for starter in STARTERS.values()])
        print_text("\nWrite one with: jounce new NAME [FILE]; complete machines: jounce example")
        return 0
    target = Path(f"{name}.yaml") if file is None else file
    starter = write_starter(name, target, overwrite=overwrite)
    second, suffix = ("plot", ".png") if starter.command == "run" else ("simulate", ".csv")
    paths = [shlex.quote(str(path)) for path in (target, target.with_suffix(suffix))]
    next_commands = [f"jounce {starter.command} {paths[0]}", f"jounce {second} {paths[0]} --out {paths[1]}"]
    if json:
        say_json("new", {"name": starter.name, "written": str(target), "next": next_commands})
        return 0
    print_text(f"{starter.about}\nWritten to {target}\n\nTry now:\n  " + "\n  ".join(next_commands))
    return 0
