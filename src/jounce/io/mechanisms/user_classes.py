"""Import of a user's own joints and drivers from Python files; nothing that a mechanism file names is run."""

from __future__ import annotations

import importlib.util
import os
import sys
import zlib
from os import PathLike
from pathlib import Path

from jounce.errors import JounceError, MechanismFileError
from jounce.io.files.reading import name_of, read_file


def import_file(path: str | PathLike[str]) -> None:
    """Run a Python file, so that the joints and drivers that it defines are added to the catalogue.

    Parameters
    ----------
    path
        File ending in .py. Its ``__name__`` is not ``__main__``, so that code for scripts is not run.

    Raises
    ------
    MechanismFileError
        If there is no such file, or running it fails: the message names the line.
    """
    name = name_of(path)
    if not name.endswith(".py"):
        raise MechanismFileError("own joints come from a Python file, ending in .py", path=name)
    read_file(name)
    checksum = zlib.crc32(os.fsencode(Path(name).resolve()))  # distinguishes files of one name in different folders
    module_name = f"jounce_own_{Path(name).stem}_{checksum:08x}"
    spec = importlib.util.spec_from_file_location(module_name, name)
    if spec is None or spec.loader is None:
        raise MechanismFileError("cannot be read as Python", path=name)
    module = importlib.util.module_from_spec(spec)
    sys.modules[module_name] = module
    try:
        spec.loader.exec_module(module)
    except JounceError as error:
        raise error.located(path=name, line=_line(error, name)) from None
    except (Exception, SystemExit) as error:
        message = f"running it fails with {type(error).__name__}: {error}".rstrip(": ")
        line = error.lineno if isinstance(error, SyntaxError) else _line(error, name)
        raise MechanismFileError(" ".join(message.split()), path=name, line=line) from error


def _line(error: BaseException, path: str) -> int | None:
    """Return the line of the innermost frame of a traceback within a file; None if there is none."""
    line, step = None, error.__traceback__
    while step is not None:
        if step.tb_frame.f_code.co_filename == path:
            line = step.tb_lineno
        step = step.tb_next
    return line
