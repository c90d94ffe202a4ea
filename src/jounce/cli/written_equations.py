"""The command that writes the equations of a mechanism as code."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal

from jounce.cli.options import MechanismReading, errors_about, written
from jounce.reporting.terminal import say

AS_IN_FILES = MechanismReading()


def equations(
    file: Path,
    /,
    *,
    format: Literal["python", "c"] = "python",  # noqa: A002 - the name of the option
    joint: str | None = None,
    order: int = 4,
    out: Path | None = None,
    reading: MechanismReading = AS_IN_FILES,
    overwrite: bool = False,
) -> int:
    r"""Write the equations of a mechanism as code of Python or C.

    Residual, Jacobian and right sides of all orders, from the same residuals
    that are solved, in SI units. Sommer 2024, equations 1-8.

    Parameters
    ----------
    file
        Mechanism file: .yaml, .toml or .json.
    format
        python, a module that needs NumPy alone, or c, a file of C99.
    joint
        The joint or driver whose equations alone are written.
    order
        Highest derivative, 4 unless given.
    out
        Write it to this file; else it is printed.
    overwrite
        Let --out replace a file that is read here.

    Examples
    --------
      jounce equations examples/four_bar.yaml --format python --out four_bar.py
      jounce equations examples/rsur.yaml --format c --order 6 --out rsur.c
      jounce equations examples/four_bar.yaml --joint BC --format python
    """
    from jounce.io.files.writing import check_target, replacing
    from jounce.written_equations import equations as equations_as_text
    from jounce.written_equations.write import DEFAULT_NAME, LANGUAGES

    mechanism = reading.mechanism(file)
    if out is not None:
        check_target(out, (LANGUAGES[format].ending,), "code", overwrite=overwrite)
    name = re.sub("[^A-Za-z0-9]+", "_", (file if out is None else out).stem).strip("_")
    with errors_about(file):
        text = equations_as_text(
            mechanism, joint, format=format, order=order, name=name if name[:1].isalpha() else DEFAULT_NAME
        )
    if out is None:
        say(text.rstrip("\n"))
        return 0

    def write() -> None:
        with replacing(out, overwrite=overwrite) as scratch:
            scratch.write_text(text, encoding="ascii")

    written(write)
    say(f"Equations written to {out}")
    return 0
