"""The command that prints or installs completion for a shell."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from jounce.errors import JounceError, OutputError
from jounce.reporting.terminal import say

SHELLS = ("bash", "zsh", "fish")


def completion(shell: Literal["bash", "zsh", "fish"], /, *, install: bool = False, out: Path | None = None) -> int:
    """Print or install completion of commands and options for a shell.

    Parameters
    ----------
    shell
        bash, zsh or fish.
    install
        Write it where the shell looks for it, and have it read.
    out
        Write the script to this file, and leave start-up files alone.
    """
    from jounce.cli import application
    from jounce.io.files.writing import check_target, reason_of, replacing

    if install and out is not None:
        raise JounceError("takes a place of its own; give --install or --out", name="--out", value=str(out))
    app = application()
    if out is not None:
        check_target(out)
        with replacing(out) as scratch:
            scratch.write_text(app.generate_completion(shell=shell), encoding="utf-8")
        say(f"Written to {out}")
        return 0
    if not install:
        say(app.generate_completion(shell=shell))
        return 0
    try:
        path = app.install_completion(shell=shell)
    except OSError as error:
        raise OutputError(f"cannot be written: {reason_of(error)}", path=error.filename) from None
    say(f"Written to {path}\nIt works in every {shell} that you start from now on.")
    return 0
