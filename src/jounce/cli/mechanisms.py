"""The commands for mechanism files: solved and simulated; and their schema."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from jounce.cli.arguments import named_once
from jounce.cli.file_kinds import expecting
from jounce.cli.writing import allowed, spared, written
from jounce.errors import JounceError, SolveError, check_name
from jounce.reporting.summaries import motion_summary
from jounce.reporting.terminal import Bar, say, say_json, show_peaks

if TYPE_CHECKING:
    from jounce.kinematics import Motion
    from jounce.mechanism import Mechanism


def run(
    file: Path,
    /,
    *,
    order: int = 4,
    out: Path | None = None,
    tolerance: float = 1e-12,
    set_: list[str] | None = None,
    import_: list[Path] | None = None,
    allow: list[Path] | None = None,
    overwrite: bool = False,
    no_refine: bool = False,
    json: bool = False,
) -> int:
    """Solve a mechanism file and print peak values, position to jounce.

    Parameters
    ----------
    file
        Mechanism file: .yaml, .yml, .toml or .json.
    order
        Highest derivative, 0 to 30; 3 is jerk, 4 jounce.
    out
        Write all values to this .csv or .nc (NetCDF) file.
    tolerance
        Of positions, rad or sizes of the mechanism.
    set_
        NAME=VALUE of a parameter, with a unit; repeatable.
    import_
        Python file with your own joints; repeatable.
    allow
        Folder whose files it may name, besides its own; repeatable.
    overwrite
        Let --out replace a file that is read here.
    no_refine
        Take peaks at the instants only, not between them.
    json
        Print the result as JSON.
    """
    from jounce import io
    from jounce.reporting.motion_facts import motion_facts
    from jounce.reporting.peaks import peaks

    if out is not None:
        io.check_writable(out, overwrite=overwrite)
    mechanism = loaded(file, set_, import_, allow)
    spared(out, overwrite)
    motion = solved(mechanism, file, order, tolerance)
    if not json:
        say(motion_summary(motion_facts(motion), file.name))
        show_peaks(peaks(motion, refine=not no_refine))
    return _finished("run", motion, file, out, overwrite, json, not no_refine)


def simulate(
    file: Path,
    /,
    *,
    order: int = 4,
    out: Path | None = None,
    method: str = "taylor",
    tolerance: float = 1e-15,
    step: float | None = None,
    longest_step: float | None = None,
    set_: list[str] | None = None,
    import_: list[Path] | None = None,
    allow: list[Path] | None = None,
    overwrite: bool = False,
    no_refine: bool = False,
    json: bool = False,
) -> int:
    """Move a mechanism by its forces and print peak values, energy, drift.

    Parameters
    ----------
    file
        Mechanism file with masses: .yaml, .yml, .toml or .json.
    order
        Highest derivative, 0 to 30; 3 is jerk, 4 jounce.
    out
        Write all values to this .csv or .nc (NetCDF) file.
    method
        taylor, obreshkov-4, obreshkov-6 or obreshkov-8.
    tolerance
        Of the error of a step, rad or sizes of the mechanism.
    step
        Length of all steps in s, in the place of a control of the error.
    longest_step
        Bound of all steps in s; each is looked at in 32 places or more for what it may miss.
    set_
        NAME=VALUE of a parameter, with a unit; repeatable.
    import_
        Python file with your own joints and forces; repeatable.
    allow
        Folder whose files it may name, besides its own; repeatable.
    overwrite
        Let --out replace a file that is read here.
    no_refine
        Take peaks at the instants only, not between them.
    json
        Print the result as JSON.
    """
    from jounce import io
    from jounce.integrate import simulate as integrate
    from jounce.reporting.motion_facts import motion_facts
    from jounce.reporting.peaks import peaks

    if out is not None:
        io.check_writable(out, overwrite=overwrite)
    chosen = _method(method, step)
    mechanism = loaded(file, set_, import_, allow)
    spared(out, overwrite)
    try:
        with Bar("simulating") as bar:
            motion = integrate(
                mechanism,
                order=order,
                method=chosen,
                tolerance=tolerance,
                longest_step=math.inf if longest_step is None else longest_step,
                strict=False,
                progress=bar,
            )
    except JounceError as error:
        raise of_option(error, file) from None
    if not json:
        say(motion_summary(motion_facts(motion), file.name))
        show_peaks(peaks(motion, refine=not no_refine))
    return _finished("simulate", motion, file, out, overwrite, json, not no_refine)


def _finished(
    command: str, motion: Motion, file: Path, out: Path | None, overwrite: bool, json: bool, refine: bool
) -> int:
    """Write the results of a motion where they are wanted, and return the exit status."""
    from jounce import io

    if out is not None:
        written(lambda: io.write(motion.dataset, out, overwrite=overwrite))
    if json:
        from jounce.reporting.records import motion_record

        say_json(command, motion_record(motion, file, out, refine))
    elif out is not None:
        say(f"\nWritten to {out}")
    return outcome(motion, file)


def _method(name: str, step: float | None) -> Any:
    """Return the integration method of a name."""
    from jounce.integrate import Obreshkov, Taylor

    kinds: dict[str, Any] = {"taylor": lambda: Taylor(step=step)}
    kinds |= {f"obreshkov-{n}": (lambda n=n: Obreshkov(n, step)) for n in (4, 6, 8)}
    check_name("method", name, kinds, JounceError, name="--method")
    try:
        return kinds[name]()
    except JounceError as error:
        error.name = "--step"
        raise


def schema(of: Literal["mechanism", "results"] = "mechanism", /) -> int:
    """Print the JSON Schema of mechanism files, or of results.

    Editors complete and check files by it.

    Parameters
    ----------
    of
        mechanism: files; results: what the commands print with --json.
    """
    import json

    if of == "results":
        from jounce.reporting.record_schema import record_schema as made
    else:
        from jounce.io import json_schema as made

    say(json.dumps(made(), indent=1))
    return 0


def loaded(
    file: Path,
    assignments: Sequence[str] | None,
    imports: Sequence[Path] | None,
    allow: Sequence[Path] | None = None,
) -> Mechanism:
    """Return the mechanism of a file, with parameters changed, after files of one's own joints were run."""
    from jounce.io import load

    if imports:
        from jounce.io.mechanisms.user_classes import import_file

        for path in imports:
            import_file(path)
    with expecting(file, "mechanism"):
        mechanism = load(file, allow=allowed(allow))
    if assignments:
        named_once(assignments, "--set")
        from jounce.io.mechanisms.overrides import override

        mechanism = override(mechanism, assignments)
    return mechanism


def solved(mechanism: Mechanism, file: Path, order: int, tolerance: float = 1e-12) -> Motion:
    """Solve at all instants of the file; those that fail are NaN."""
    from jounce.kinematics import solve

    try:
        with Bar("solving") as bar:
            return solve(mechanism, order=order, tolerance=tolerance, strict=False, progress=bar)
    except JounceError as error:
        raise of_option(error, file) from None


def of_option(error: JounceError, file: Path) -> JounceError:
    """Return an error with the option, or the file, that it is about."""
    if error.name in ("order", "tolerance", "longest_step"):
        error.name = f"--{error.name.replace('_', '-')}"
        return error
    return error.located(path=file)


def outcome(motion: Motion, file: Path) -> int:
    """Return 0, or raise for the first instant that failed."""
    from jounce.kinematics import raise_for_status

    try:
        raise_for_status(motion)
    except SolveError as error:
        raise error.located(path=file) from None
    return 0
