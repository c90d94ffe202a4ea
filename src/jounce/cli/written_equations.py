"""The command that writes the equations of a mechanism: as code, as text, as values along its motion."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from jounce.cli.options import MechanismReading, errors_about, written
from jounce.errors import JounceError
from jounce.reporting.terminal import say

if TYPE_CHECKING:
    from jounce.mechanism import Mechanism

AS_IN_FILES = MechanismReading()
TABLES = (".csv", ".nc", ".json")


def equations(
    file: Path,
    /,
    *,
    format: Literal["python", "c", "latex", "table"] = "python",  # noqa: A002 - the name of the option
    joint: str | None = None,
    order: int = 4,
    out: Path | None = None,
    reading: MechanismReading = AS_IN_FILES,
    overwrite: bool = False,
) -> int:
    r"""Write the equations of a mechanism as code, LaTeX, or a table.

    Residual, Jacobian and right sides of all orders, from the same residuals
    that are solved, in SI units. Sommer 2024, equations 1-8.

    Parameters
    ----------
    file
        Mechanism file: .yaml, .toml or .json.
    format
        python, which needs NumPy alone, c, C99, or latex; or table,
        their values along the motion, multipliers too.
    joint
        The joint or driver whose equations alone are written.
    order
        Highest derivative, 4 unless given.
    out
        Write it to this file; else it is printed. A table is .csv, .nc
        (NetCDF) or .json.
    overwrite
        Let --out replace a file that is read here.

    Examples
    --------
      jounce equations examples/four_bar.yaml --format python --out four_bar.py
      jounce equations examples/rsur.yaml --format c --order 6 --out rsur.c
      jounce equations examples/four_bar.yaml --joint BC --format latex
      jounce equations examples/four_bar.yaml --format table --out values.csv
    """
    from jounce.io.files.writing import check_target, replacing
    from jounce.written_equations import equations as equations_as_text
    from jounce.written_equations.write import DEFAULT_NAME, ending_of

    mechanism = reading.mechanism(file)
    if format == "table":
        return _table(mechanism, file, joint, order, out, overwrite=overwrite)
    if out is not None:
        check_target(out, (ending_of(format),), "code", overwrite=overwrite)
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

    return _written(write, out)


def _table(
    mechanism: Mechanism, file: Path, joint: str | None, order: int, out: Path | None, *, overwrite: bool
) -> int:
    """Write the values of the equations along the motion of a file."""
    from jounce.cli.mechanisms import moved, outcome
    from jounce.dynamics import constraint_equations
    from jounce.errors import MechanismError, check_name
    from jounce.io import write
    from jounce.io.files.writing import check_target, replacing
    from jounce.written_equations.tables import as_json, columns

    if out is None:
        raise JounceError("a table goes to a file; add --out values.csv, .nc or .json", name="--format", value="table")
    check_target(out, TABLES, "table", overwrite=overwrite)
    if joint is not None:
        with errors_about(file):
            check_name("joint or driver", joint, (*mechanism.joints, *mechanism.drivers), MechanismError, name="joint")
    motion = moved(mechanism, file, order)
    with errors_about(file):
        found = constraint_equations(motion)
    if joint is not None:
        found = found.sel(row=[row for row in found.row.values if row.rpartition(".")[0] == joint])

    def put() -> None:
        if out.suffix.lower() == ".json":
            with replacing(out, overwrite=overwrite) as scratch:
                scratch.write_text(as_json(found), encoding="utf-8")
        else:
            write(found if out.suffix.lower() == ".nc" else columns(found), out, overwrite=overwrite)

    _written(put, out)
    return outcome(motion, file)


def _written(write: Callable[[], object], out: Path) -> int:
    written(write)
    say(f"Equations written to {out}")
    return 0
