"""The command that writes the equations of a mechanism or a robot as code, as text, or as values along its motion."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from jounce.cli.arguments import check_ending
from jounce.cli.file_kinds import explaining_other_kinds
from jounce.cli.options import MechanismReading, RobotReading, errors_about, written
from jounce.errors import JounceError
from jounce.io.files import DATA_FILES, ROBOT_FILES
from jounce.reporting.terminal import print_text

if TYPE_CHECKING:
    from jounce.mechanism import Mechanism
    from jounce.robot import Robot

AS_IN_FILES = MechanismReading()
TABLES = (".csv", ".nc", ".json")


def equations(
    file: Path,
    /,
    *,
    format: Literal["python", "sympy", "c", "latex", "table"] = "python",  # noqa: A002 - the name of the option
    joint: str | None = None,
    quantity: list[str] | None = None,
    order: int = 4,
    no_drives: bool = False,
    out: Path | None = None,
    reading: MechanismReading = AS_IN_FILES,
    overwrite: bool = False,
) -> int:
    r"""Write equations as code, SymPy, LaTeX, or a table.

    For a mechanism the equations are residual, Jacobian and right sides of
    all orders, for a robot torques and their rates, in SI units. They are
    derived from the functions that jounce computes with. Sommer 2024,
    equations 1-8; Negrean 2025, equations 144-146.

    Parameters
    ----------
    file
        Mechanism file, .yaml, .toml or .json; or robot, .urdf, .xml or .sdf.
    format
        python (NumPy only), sympy, c (C99) or latex; table writes values
        along the motion, with multipliers.
    joint
        Joint or driver whose equations are written [all].
    quantity
        Quantity of the code; repeatable. Mechanisms: constraints [default],
        forces with the mass matrix, outputs with derivatives. Robots: torque
        [default], mass_matrix, regressor, energies.
    order
        Highest derivative.
    no_drives
        Omit armature, damping, friction and springs of a robot.
    out
        File to write [standard output]; of a table .csv, .nc (NetCDF)
        or .json.
    overwrite
        Let --out replace a file that is read here.

    Examples
    --------
      jounce equations examples/four_bar.yaml --format python --out four_bar.py
      jounce equations examples/rsur.yaml --format c --order 6 --out rsur.c
      jounce equations examples/double_pendulum.yaml \
        --quantity constraints --quantity forces --out pendulum.py
      jounce equations examples/robots/panda.urdf --format c --out panda.c
      jounce equations examples/four_bar.yaml --joint BC --format latex
      jounce equations examples/four_bar.yaml --format table --out values.csv
    """
    from jounce.io.files.writing import check_target, replacing
    from jounce.mechanism import Mechanism
    from jounce.written_equations import equations as equations_as_text
    from jounce.written_equations.write import DEFAULT_NAME, ending_of

    with explaining_other_kinds(file, "mechanism", "robot"):
        check_ending(file, (*DATA_FILES, *ROBOT_FILES))
    model = _robot(reading, file) if file.suffix.lower() in ROBOT_FILES else reading.mechanism(file)
    if no_drives and isinstance(model, Mechanism):
        raise JounceError("is for robots", name="--no-drives", value=True)
    if format == "table" and quantity is not None:
        raise JounceError("is for code; a table has all of them", name="--quantity", value=quantity)
    if format == "table":
        if not isinstance(model, Mechanism):
            raise JounceError("is for mechanisms; jounce torques has those of a robot", name="--format", value=format)
        return _table(model, file, joint, order, out, overwrite=overwrite)
    if out is not None:
        check_target(out, (ending_of(format),), "code", overwrite=overwrite)
    name = re.sub("[^A-Za-z0-9]+", "_", (file if out is None else out).stem).strip("_")
    chosen = {"format": format, "order": order, "name": name if name[:1].isalpha() else DEFAULT_NAME}
    with errors_about(file):
        text = equations_as_text(model, joint, **chosen, quantities=quantity or (), drives=not no_drives)
    if out is None:
        print_text(text.rstrip("\n"))
        return 0

    def write() -> None:
        with replacing(out, overwrite=overwrite) as scratch:
            scratch.write_text(text, encoding="ascii")

    return _written(write, out)


def _robot(reading: MechanismReading, file: Path) -> Robot:
    """Return the robot of a file."""
    for name in ("set_", "import_", "times"):
        if getattr(reading, name):
            raise JounceError("is for mechanism files", name=f"--{name.rstrip('_')}", value=getattr(reading, name))
    return RobotReading(allow=reading.allow).robot(file)


def _table(
    mechanism: Mechanism, file: Path, joint: str | None, order: int, out: Path | None, *, overwrite: bool
) -> int:
    """Write the values of the equations along the motion of a file."""
    from jounce.cli.mechanism_commands.mechanisms import outcome, solve_or_simulate
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
    motion = solve_or_simulate(mechanism, file, order)
    with errors_about(file):
        dataset = constraint_equations(motion)
    if joint is not None:
        dataset = dataset.sel(row=[row for row in dataset.row.values if row.rpartition(".")[0] == joint])

    def put() -> None:
        if out.suffix.lower() == ".json":
            with replacing(out, overwrite=overwrite) as scratch:
                scratch.write_text(as_json(dataset), encoding="utf-8")
        else:
            write(dataset if out.suffix.lower() == ".nc" else columns(dataset), out, overwrite=overwrite)

    _written(put, out)
    return outcome(motion, file)


def _written(write: Callable[[], object], out: Path) -> int:
    written(write)
    print_text(f"Equations written to {out}")
    return 0
