"""The command that writes starter files."""

from __future__ import annotations

import shlex
from pathlib import Path

from jounce.cli.options import Overwrite
from jounce.reporting.terminal import say, say_json, show_columns


def new(
    name: str | None = None, file: Path | None = None, /, *, overwrite: Overwrite = False, json: bool = False
) -> int:
    """Write a commented starter file, or list the starters.

    Parameters
    ----------
    name
        Name of the starter, such as four-bar.
    file
        File to write: .yaml, .yml, .toml or .json [default: NAME.yaml].
    overwrite
        Replace an existing file.
    json
        Print the result as JSON.

    Examples
    --------
      jounce new
      jounce new four-bar
      jounce new slider-crank engine.yaml
    """
    from jounce.io.mechanisms.starters import STARTERS, write_starter

    if name is None:
        if json:
            listed = [{"name": s.name, "about": s.about, "command": s.command} for s in STARTERS.values()]
            say_json("new", {"starters": listed})
            return 0
        show_columns([(starter.name, starter.about) for starter in STARTERS.values()])
        say("\nWrite one with: jounce new NAME [FILE]; complete machines: jounce example")
        return 0
    target = Path(f"{name}.yaml") if file is None else file
    starter = write_starter(name, target, overwrite=overwrite)
    second, suffix = ("plot", ".png") if starter.command == "run" else ("simulate", ".csv")
    paths = [shlex.quote(str(path)) for path in (target, target.with_suffix(suffix))]
    following = [f"jounce {starter.command} {paths[0]}", f"jounce {second} {paths[0]} --out {paths[1]}"]
    if json:
        say_json("new", {"name": starter.name, "written": str(target), "next": following})
        return 0
    say(f"{starter.about}\nWritten to {target}\n\nTry now:\n  " + "\n  ".join(following))
    return 0
