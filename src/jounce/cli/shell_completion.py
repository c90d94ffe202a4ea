"""Completion of commands and options, printed or installed for a shell."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from jounce.errors import JounceError, OutputError
from jounce.reporting.terminal import print_text


def complete(app: Any, shell: str, install: bool, out: Path | None) -> int:
    """Print, write or install the completion script of the command line for a shell."""
    from jounce.io.files.reading import reason_of
    from jounce.io.files.writing import check_target, replacing

    if install and out is not None:
        raise JounceError("takes a place of its own; give --install or --out", name="--out", value=str(out))
    if out is not None:
        check_target(out)
        with replacing(out) as scratch:
            scratch.write_text(app.generate_completion(shell=shell), encoding="utf-8")
        print_text(f"Written to {out}")
        return 0
    if not install:
        print_text(app.generate_completion(shell=shell))
        return 0
    try:
        path = app.install_completion(shell=shell)
    except OSError as error:
        message = f"cannot be written: {reason_of(error)}"
        raise OutputError(message, while_writing=True, path=error.filename) from None
    print_text(f"Written to {path}\nIt works in every {shell} that you start from now on.")
    return 0
