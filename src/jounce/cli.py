"""The command ``jounce``: one thin function per command; the work is done by the rooms below.

Everything that a command needs is imported when it runs, so that none waits for the libraries of another. Results go to
standard output, messages to standard error; the exit status is 0 for success, 2 for bad input, and 1 where a solve
failed at some instants (the others are still printed and written) or a result could not be written.
"""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jounce.errors import JounceError, OutputError, SolveError
from jounce.io.terminal import Bar, complain, say, show_peaks, unexpected

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
    """
    from jounce import io
    from jounce.io.peaks import peaks

    if out is not None:
        io.check_writable(out)
    motion = _solved(_loaded(file, set_, import_), file, order, tolerance)
    say(_summary(motion, file))
    show_peaks(peaks(motion))
    if out is not None:
        _written(lambda: io.write(motion.dataset, out))
        say(f"\nWritten to {out}")
    return _outcome(motion, file)


def plot(
    file: Path,
    /,
    *,
    order: int = 4,
    out: Path | None = None,
    output: list[str] | None = None,
    set_: list[str] | None = None,
    import_: list[Path] | None = None,
) -> int:
    """Solve a mechanism file and draw its outputs, position to jounce.

    Parameters
    ----------
    file
        Mechanism file: .yaml, .yml, .toml or .json.
    order
        Highest derivative, 0 to 30; 3 is jerk, 4 jounce.
    out
        Figure, .png, .svg or .pdf [default: FILE's name.png].
    output
        Name of an output to draw; repeatable; all unless given.
    set_
        NAME=VALUE of a parameter, with a unit; repeatable.
    import_
        Python file with your own joints; repeatable.
    """
    from jounce.plot import check_figure, draw, save

    out = Path(f"{file.stem}.png") if out is None else out
    check_figure(out)
    mechanism = _loaded(file, set_, import_)
    _check_outputs(mechanism, output or (), file)
    motion = _solved(mechanism, file, order)
    _written(lambda: save(draw(motion, output), out))
    say(f"Written to {out}")
    return _outcome(motion, file)


def reproduce(paper: str, /, *, out: Path) -> int:
    """Make the figures and tables of a paper again.

    Parameters
    ----------
    paper
        sommer-2024.
    out
        Folder for figures and tables; made if it does not exist.
    """
    if paper == "negrean-2025":
        raise JounceError("negrean-2025 is not available in this version, which does kinematics only; sommer-2024 is")
    if paper != "sommer-2024":
        from jounce.errors import did_you_mean

        raise JounceError(f"no paper has this name; {did_you_mean(paper, ['sommer-2024'])}", value=paper)
    from jounce.papers.sommer_2024 import reproduce as make

    with Bar("reproducing") as bar:
        paths = make(out, progress=bar)
    say(paths[0].read_text(encoding="utf-8"))
    say(f"Written to {out}: {_count(len(paths), 'file')}")
    return 0


def schema() -> int:
    """Print the JSON Schema of mechanism files, for editors that complete and check."""
    import json

    from jounce.io import json_schema

    say(json.dumps(json_schema(), indent=1))
    return 0


EXAMPLES = {
    run: """\
  jounce run examples/four_bar.yaml
  jounce run examples/rsur.yaml --order 8 --out motion.nc
  jounce run examples/four_bar.yaml --set "BC=15 cm" --set tau=3""",
    plot: """\
  jounce plot examples/four_bar.yaml --out four_bar.png
  jounce plot examples/rsur.yaml --order 6 --output psi --output C""",
    reproduce: "  jounce reproduce sommer-2024 --out out",
    schema: "  jounce schema > mechanism.schema.json",
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Parameters
    ----------
    arguments : sequence of str, optional
        Those of the process unless given.

    Returns
    -------
    int
        0 success, 2 bad input, 1 a solve or a writing that failed, 130 interrupted.
    """
    if arguments is None:
        gc.freeze()  # the collector need not look at the libraries again: 0.15 s of a short run
    for stream in (sys.stdout, sys.stderr):
        with suppress(AttributeError, ValueError):
            stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    try:
        _use_compilation_cache()
        return _dispatch(list(sys.argv[1:] if arguments is None else arguments))
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:  # who reads us has read enough
        with suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except SolveError as error:
        complain(error)
        return 2 if error.motion is None else 1
    except JounceError as error:
        complain(error)
        return 2
    except _WritingError as error:
        complain(error)
        return 1
    except Exception as error:  # the last resort: a message, not a traceback
        if os.environ.get("JOUNCE_DEBUG"):
            raise
        complain(f"{unexpected(error)}; set JOUNCE_DEBUG=1 for the traceback")
        return 1


def _dispatch(arguments: list[str]) -> int:
    import cyclopts

    from jounce import __version__

    app = cyclopts.App(
        name="jounce",
        help="Exact time derivatives of any order of mechanisms: velocity, acceleration, jerk, jounce and beyond.",
        help_format="plaintext",
        help_formatter="default" if sys.stdout.isatty() else "plain",
        help_epilogue="Examples:\n" + "\n".join(EXAMPLES.values()),
        version=__version__,
        default_parameter=cyclopts.Parameter(negative=()),
        result_action="return_value",
        suppress_keyboard_interrupt=False,
    )
    for place, (command, examples) in enumerate(EXAMPLES.items()):
        app.command(command, help_epilogue=f"Examples:\n{examples}", sort_key=place)
    try:
        return app(arguments, exit_on_error=False, print_error=False) or 0
    except cyclopts.CycloptsError as error:
        raise JounceError(f"{' '.join(str(error).split())} (see jounce --help)") from None


def _loaded(file: Path, assignments: Sequence[str] | None, imports: Sequence[Path] | None) -> Mechanism:
    from jounce.io import load

    if imports:
        from jounce.io.own import import_file

        for path in imports:
            import_file(path)
    mechanism = load(file)
    if assignments:
        from jounce.io.overrides import override

        mechanism = override(mechanism, file, assignments)
    return mechanism


def _check_outputs(mechanism: Mechanism, wanted: Sequence[str], file: Path) -> None:
    from jounce.errors import MechanismError, did_you_mean

    if not mechanism.outputs:
        raise MechanismError("there is nothing to draw; name some outputs", path=file, name="outputs")
    for name in wanted:
        if name not in mechanism.outputs:
            message = f"no output has this name; {did_you_mean(name, mechanism.outputs)}"
            raise MechanismError(message, path=file, name="outputs", value=name)


def _solved(mechanism: Mechanism, file: Path, order: int, tolerance: float = 1e-12) -> Motion:
    """Solve at all instants of the file; those that fail are NaN."""
    from jounce.kinematics import solve

    try:
        with Bar("solving") as bar:
            return solve(mechanism, order=order, tolerance=tolerance, strict=False, progress=bar)
    except JounceError as error:
        if error.name in ("order", "tolerance"):
            error.name = f"--{error.name}"
            raise
        raise error.located(path=file) from None


def _outcome(motion: Motion, file: Path) -> int:
    """Return 0, or raise for the first instant that failed."""
    from jounce.kinematics import raise_for_status

    try:
        raise_for_status(motion)
    except SolveError as error:
        raise error.located(path=file) from None
    return 0


class _WritingError(Exception):
    """A result that was computed could not be written."""


def _written(write: Any) -> None:
    try:
        write()
    except OutputError as error:
        raise _WritingError(error) from None


def _summary(motion: Motion, file: Path) -> str:
    """Word what was solved: bodies, degrees of freedom, instants."""
    import numpy as np

    from jounce.mechanism import build

    mechanism, time_ = motion.mechanism, motion.time
    rows = build(mechanism).rows
    drives = sum(name.startswith("drivers.") for name in rows)
    bodies = _count(len(mechanism.bodies), "moving body", "moving bodies")
    joints = f"{_count(len(mechanism.joints), 'joint')} ({_count(len(rows) - drives, 'equation')})"
    freedom = _count(drives, "degree of freedom", "degrees of freedom")
    driven = f", driven by {', '.join(mechanism.drivers)}" if mechanism.drivers else ""
    solved = int(np.sum(motion.status == 0))
    instants = _count(len(time_), "instant") if solved == len(time_) else f"{solved} of {len(time_)} instants"
    span = f"t = {time_[0]:g} s" if len(time_) == 1 else f"from t = {time_[0]:g} s to {time_[-1]:g} s"
    return "\n".join([
        mechanism.title or file.name,
        f"{mechanism.space}: {bodies} ({len(rows)} coordinates), {joints}",
        f"{freedom}{driven}",
        f"{instants} {span}, derivatives to order {motion.order}",
    ])  # fmt: skip


def _count(number: int, noun: str, plural: str = "") -> str:
    return f"{number} {noun if number == 1 else plural or f'{noun}s'}"


def _cache_directory() -> Path | None:
    """Return where compiled programs are kept: JOUNCE_CACHE_DIR, or the user's cache folder; None where nowhere."""
    given = os.environ.get("JOUNCE_CACHE_DIR")
    if given is not None:
        return Path(given) if given.strip() else None
    home = Path.home()
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", home / "AppData" / "Local")) / "jounce" / "cache"
    if sys.platform == "darwin":
        return home / "Library" / "Caches" / "jounce"
    base = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return (base if base.is_absolute() else home / ".cache") / "jounce"


def _use_compilation_cache() -> None:
    """Keep compiled programs between calls of the command, unless JAX was told where or the folder is out of reach."""
    import warnings

    import jax

    if getattr(jax.config, "jax_compilation_cache_dir", None) is not None:
        return
    try:
        directory = _cache_directory()
        if directory is None:
            return
        directory.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError, ValueError):  # RuntimeError: there is no home
        return
    if not os.access(directory, os.W_OK | os.X_OK):
        return
    jax.config.update("jax_compilation_cache_dir", str(directory))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.05)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)
    jax.config.update("jax_persistent_cache_enable_xla_caches", "none")  # those are for GPUs
    warnings.filterwarnings("ignore", message="Error (reading|writing) persistent compilation cache")
