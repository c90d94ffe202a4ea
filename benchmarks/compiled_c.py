"""Functions that CasADi writes as C code, compiled for this machine and mapped over samples."""

import subprocess
import tempfile
from pathlib import Path
from typing import Any

from benchmarks.cases import CannotRunError


def compiled(functions: list[Any], samples: int) -> list[Any]:
    """Return CasADi's functions as it calls them from compiled C code, under its map."""
    import casadi

    with tempfile.TemporaryDirectory() as folder:
        source, library = Path(folder) / "functions.c", Path(folder) / "functions.so"
        generator = casadi.CodeGenerator(source.name)
        for function in functions:
            generator.add(function)
        generator.generate(f"{folder}/")
        words = ["gcc", "-fPIC", "-shared", "-O3", "-march=native", str(source), "-o", str(library), "-lm"]
        try:
            subprocess.run(words, check=True, capture_output=True)
        except FileNotFoundError:
            raise CannotRunError("there is no C compiler gcc") from None
        return [casadi.external(function.name(), str(library)).map(samples) for function in functions]
