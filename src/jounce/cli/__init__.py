"""The command ``jounce``: one thin function per command; the subpackages below do the work.

A command imports its libraries when it runs, so that no command waits for those of another. Results go to standard
output, messages to standard error. The exit status is 0 for success, 2 for bad input, and 1 if a solve failed at some
instants (the others are still printed and written), a limit is broken, an inspected mechanism cannot start to move, or
a result could not be written.
"""

from __future__ import annotations

import functools
import gc
import os
import re
import sys
import warnings
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from inspect import cleandoc
from pathlib import Path
from typing import Any, Literal

from jounce.base.interrupts import end_on_signals, is_command
from jounce.cli.arguments import converted
from jounce.cli.design_commands.designs import optimize
from jounce.cli.design_commands.sweeping import sweep
from jounce.cli.design_commands.tolerances import tolerance
from jounce.cli.file_commands.conversion import convert
from jounce.cli.file_commands.example_files import example
from jounce.cli.file_commands.exports import export
from jounce.cli.file_commands.starters import new
from jounce.cli.file_kinds import is_data_file
from jounce.cli.inspection import inspect
from jounce.cli.installation import doctor
from jounce.cli.mechanism_commands.cams import cam
from jounce.cli.mechanism_commands.curves import trace
from jounce.cli.mechanism_commands.energies import energies
from jounce.cli.mechanism_commands.figures import plot, report
from jounce.cli.mechanism_commands.mechanisms import run, schema, simulate
from jounce.cli.mechanism_commands.small_motions import modes
from jounce.cli.mechanism_commands.written_equations import equations
from jounce.cli.options import WritingError
from jounce.cli.papers import reproduce
from jounce.cli.robot_commands.feedforward import feedforward
from jounce.cli.robot_commands.retiming import retime
from jounce.cli.robot_commands.robots import check, torques
from jounce.cli.robot_commands.servo import servo
from jounce.cli.robot_commands.smoothing import smooth
from jounce.cli.shell_completion import complete
from jounce.cli.standard_streams import failsafe_streams
from jounce.cli.viewing import view
from jounce.errors import JounceError, SolveError
from jounce.reporting.progress import Display
from jounce.reporting.terminal import cautions, detail, print_error, unexpected


def completion(shell: Literal["bash", "zsh", "fish"], /, *, install: bool = False, out: Path | None = None) -> int:
    """Print or install completion of commands and options for a shell.

    Parameters
    ----------
    shell
        bash, zsh or fish.
    install
        Write the script to where the shell looks for it, and load it.
    out
        Write the script to this file; start-up files stay unchanged.

    Examples
    --------
      jounce completion bash --install
      jounce completion fish
    """
    return complete(application(), shell, install, out)


COMMANDS = (
    new, example, inspect, run, trace, simulate, optimize, sweep, tolerance, modes, plot, report, view, servo, cam,
    check, torques, smooth, retime, feedforward, export, convert, reproduce, equations, energies, schema, completion,
    doctor,
)  # fmt: skip
LIGHT = (new, example, completion)  # they compute nothing
GARBAGE = 50_000  # threshold of the collector: imports and traces leave no garbage, and the default costs 0.2 s a run
FIRST = """\
  jounce new four-bar                          # a commented starter file
  jounce inspect four-bar.yaml                 # what is in it, can it move?
  jounce run four-bar.yaml                     # peaks, position to jounce
  jounce plot four-bar.yaml --out four-bar.png
  jounce view four-bar.yaml                    # moving, in the browser
  jounce convert robot.urdf robot.yaml         # a robot as a mechanism

jounce COMMAND --help explains a command, with examples; --verbose adds details to errors."""
STATUS = """\
Exit status:
  0  success
  1  a failed instant, a violated limit, no possible start, nothing written
  2  bad input
  130  interrupted by Ctrl-C; 143 ended by SIGTERM"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Parameters
    ----------
    arguments : sequence of str, optional
        Arguments, by default those of the process.

    Returns
    -------
    int
        0 for success, 2 for bad input, 1 if solving or writing failed or a limit is broken, 130 if interrupted. Run as
        a command, the process ends on signals by itself, see `jounce.base.interrupts`.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    if arguments is None:
        end_on_signals()
        gc.freeze()  # exempts the libraries from collection: 0.15 s of a short run
        gc.set_threshold(GARBAGE)
    for name in ("COLUMNS", "LINES"):
        if not re.fullmatch("[1-9][0-9]{0,3}", os.environ.get(name, "1")):  # the meaning of 0 varies
            del os.environ[name]
    as_json = "--json" in given
    verbose, given = "--verbose" in given, [word for word in given if word != "--verbose"]
    with failsafe_streams() as output, cautions(json=as_json):
        status = _status(given, as_json, verbose)
        output.flush()
        if output.failure is None:
            if arguments is None and status:
                _end_at_once(status)
            return status
        from jounce.io.files.reading import reason_of

        print_error(f"standard output cannot be written: {reason_of(output.failure)}", json=as_json)
    return status or 1


def _settings() -> AbstractContextManager[Any]:
    """Return the settings for a command in the process of another program; a process of its own already has them."""
    if is_command():
        return nullcontext()
    from jounce.settings import own_settings

    return own_settings()


def _end_at_once(status: int) -> None:
    """End the process without waiting for programs that threads still compile but nobody needs."""
    if "jounce.execution.background" not in sys.modules:
        return
    from jounce.execution.background import is_compiling

    if is_compiling():
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


def _status(given: list[str], as_json: bool, verbose: bool) -> int:
    """Run a command, print its error, with all details if verbose, and return the exit status."""
    try:
        with _settings():
            return _dispatch(given)
    except KeyboardInterrupt:
        return 130
    except SolveError as error:
        print_error(error, json=as_json)
        if details := getattr(error, "details", ""):
            detail(details if verbose else "--verbose adds details", json=as_json)
        return 2 if error.motion is None else 1
    except JounceError as error:
        print_error(error, json=as_json)
        return 1 if getattr(error, "while_writing", False) else 2
    except WritingError as error:
        print_error(error, json=as_json)
        return 1
    except Exception as error:  # the last resort: a message, not a traceback
        if os.environ.get("JOUNCE_DEBUG"):
            raise
        print_error(f"{unexpected(error)}; set JOUNCE_DEBUG=1 for the traceback", json=as_json)
        return 1


def _dispatch(arguments: list[str]) -> int:
    import cyclopts

    try:
        return application()(arguments, exit_on_error=False, print_error=False) or 0
    except cyclopts.CycloptsError as error:
        command = " ".join(("jounce", *(error.command_chain or ())))
        raise JounceError(f"{_words_of(error)} (see {command} --help)") from None


def _words_of(error: Any) -> str:
    """Return the message for words of the command line that do not fit the command, with the options in question."""
    import cyclopts

    message = " ".join(str(error).split())
    if isinstance(error, cyclopts.UnusedCliTokensError):
        return f"more words than the command takes: {' '.join(error.unused_tokens or ())}"
    given = error.token.keyword if isinstance(error, cyclopts.UnknownOptionError) else None
    if given and not given.startswith("--"):
        names = [name for each in error.argument_collection for name in each.names]
        candidates = [name for name in names if name.startswith(f"-{given[:2]}")]
        message += f" Did you mean {' or '.join(candidates)}?" if candidates else ""
    return message


def application() -> Any:
    """Return the command line as a `cyclopts.App`."""
    import cyclopts

    from jounce.version import __version__

    app = cyclopts.App(
        name="jounce",
        help="Exact time derivatives of mechanisms and robots, to jounce and beyond.",
        help_format="plaintext",
        help_formatter="default" if sys.stdout.isatty() else "plain",
        help_epilogue=f"Examples:\n{FIRST}\n\n{STATUS}",
        version=__version__,
        default_parameter=cyclopts.Parameter(negative=(), converter=converted),
        result_action="return_value",
        suppress_keyboard_interrupt=False,
    )
    for index, command in enumerate(COMMANDS):
        _, _, examples = cleandoc(command.__doc__ or "").partition("Examples\n--------\n")
        app.command(
            command if command in LIGHT else _computing(command), help_epilogue=f"Examples:\n{examples}", sort_key=index
        )
    return app


def _computing(command: Callable[..., int]) -> Callable[..., int]:
    """Return a command that stores the programs that it compiles, and imports JAX only when it runs.

    If its first file does not exist, the command fails before the import, in a fraction of a second.
    """

    @functools.wraps(command)
    def computing(*arguments: Any, **keywords: Any) -> int:
        reading = keywords.get("reading")
        if arguments and is_data_file(arguments[0]) and not getattr(reading, "import_", None):
            from jounce.io.mechanisms.schema.key_check import check_keys

            check_keys(arguments[0])
        from jounce.cli.compiled_programs import use_compilation_cache

        use_compilation_cache()
        if not sys.stderr.isatty():
            return command(*arguments, **keywords)
        with Display(command.__name__):
            return command(*arguments, **keywords)

    return computing
