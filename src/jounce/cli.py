"""The command ``jounce``: one thin function per command; the work is done by the rooms below.

Everything that a command needs is imported when it runs, so that none waits for the libraries of another. Results go to
standard output, messages to standard error; the exit status is 0 for success, 2 for bad input, and 1 where a solve
failed at some instants (the others are still printed and written), a limit is broken, or a result could not be written.
"""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jounce.errors import JounceError, OutputError, RobotError, SampleWarning, SolveError
from jounce.io.summaries import count, limits_summary, summary, verdict
from jounce.io.terminal import Bar, caution, complain, say, show_limits, show_peaks, unexpected

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
    say(summary(motion, file))
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


def check(
    robot: Path,
    trajectory: Path,
    /,
    *,
    limits: Path | None = None,
    out: Path | None = None,
    payload: list[str] | None = None,
    degree: int = 5,
) -> int:
    """Compare a trajectory with the limits of a robot, from position to torque rate.

    The exit status is 0 where all limits are kept, 1 where one is broken.

    Parameters
    ----------
    robot
        Robot file: URDF (.urdf) or MJCF (.xml).
    trajectory
        Samples (.csv), or laws or a motion (.yaml, .yml, .toml or .json).
    limits
        File of limits, which go before those of the robot file.
    out
        Draw the joints' shares of their limits: .png, .svg or .pdf.
    payload
        LINK=MASS held in the origin of a link, with a unit; repeatable.
    degree
        Of the splines through samples, odd from 3 to 11.
    """
    import warnings

    from jounce.dynamics.limits import check_limits
    from jounce.io.limits import load_limits
    from jounce.io.robots import load_robot
    from jounce.io.trajectories import load_trajectory

    if out is not None:
        from jounce.plot import check_figure

        check_figure(out)
    model = load_robot(robot)
    laid = load_limits(limits, model) if limits is not None else None
    if payload:
        from jounce.io.payloads import with_payloads

        model = with_payloads(model, payload)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", SampleWarning)
        motion = load_trajectory(trajectory, degree)
        try:
            report = check_limits(model, motion, laid)
        except RobotError as error:
            raise error.located(path=robot) from None
        except JounceError as error:
            raise error.located(path=trajectory) from None
    if report.worst is None:
        raise JounceError("there are no limits to compare with; give a file of limits with --limits", path=robot)
    say(limits_summary(report, motion, robot, trajectory))
    show_limits(report)
    for warning in caught:
        caution(warning.message)
    say(f"\n{verdict(report)}")
    if out is not None:
        from jounce.plot import draw_limits, save

        _written(lambda: save(draw_limits(report, f"{report.robot}: {trajectory.name}"), out))
        say(f"\nWritten to {out}")
    return 0 if report.kept else 1


def reproduce(paper: str, /, *, out: Path) -> int:
    """Make the figures and tables of a paper again.

    Parameters
    ----------
    paper
        sommer-2024 or negrean-2025.
    out
        Folder for figures and tables; made if it does not exist.
    """
    import importlib

    if paper not in PAPERS:
        from jounce.errors import did_you_mean

        raise JounceError(f"no paper has this name; {did_you_mean(paper, PAPERS)}", value=paper)
    make = importlib.import_module(PAPERS[paper]).reproduce
    with Bar("reproducing") as bar:
        paths = make(out, progress=bar)
    say(paths[0].read_text(encoding="utf-8"))
    say(f"Written to {out}: {count(len(paths), 'file')}")
    return 0


def schema() -> int:
    """Print the JSON Schema of mechanism files, for editors that complete and check."""
    import json

    from jounce.io import json_schema

    say(json.dumps(json_schema(), indent=1))
    return 0


PAPERS = {"sommer-2024": "jounce.papers.sommer_2024", "negrean-2025": "jounce.papers.negrean_2025"}

EXAMPLES = {
    run: """\
  jounce run examples/four_bar.yaml
  jounce run examples/rsur.yaml --order 8 --out motion.nc
  jounce run examples/four_bar.yaml --set "BC=15 cm" --set tau=3""",
    plot: """\
  jounce plot examples/four_bar.yaml --out four_bar.png
  jounce plot examples/rsur.yaml --order 6 --output psi --output C""",
    check: """\
  jounce check examples/robots/panda.urdf examples/trajectories/panda_good.csv
  jounce check examples/robots/panda.urdf examples/trajectories/panda_pick.yaml \\
    --limits examples/limits/franka_panda.yaml --out pick.png
  jounce check examples/robots/panda.urdf examples/trajectories/panda_wave.yaml \\
    --payload "panda_hand=3 kg\"""",
    reproduce: """\
  jounce reproduce sommer-2024 --out out
  jounce reproduce negrean-2025 --out out""",
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
        0 success, 2 bad input, 1 a solve or a writing that failed or a limit that is broken, 130 interrupted.
    """
    if arguments is None:
        gc.freeze()  # the collector need not look at the libraries again: 0.15 s of a short run
    for stream in (sys.stdout, sys.stderr):
        with suppress(AttributeError, ValueError):
            stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    try:
        from jounce.io.cache import use_compilation_cache

        use_compilation_cache()
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
