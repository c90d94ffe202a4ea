"""Compiled programs kept between calls of the command."""

from __future__ import annotations

import sys
from typing import Any

from jounce.base.private_folder import PrivateFolder
from jounce.errors import OutputError
from jounce.execution.compilation import ask_before_jax, compiles_anew
from jounce.execution.store import programs as store
from jounce.execution.store.folder import ProgramFolder, chosen_folder


class JaxProgramFolder(ProgramFolder):
    """The programs that JAX keeps by itself: those that `jounce.execution.store.programs` does not."""

    def get(self, key: str) -> bytes | None:
        """Return the program of this key, or None, as it is where programs are to be compiled anew."""
        return None if compiles_anew() else super().get(key)

    def put(self, key: str, value: bytes) -> None:
        """Keep a program, unless it is kept in another form."""
        if not compiles_anew():
            super().put(key, value)


def keep_programs(folder: PrivateFolder) -> bool:
    """Have JAX keep its programs in checked files; a release of JAX that works otherwise keeps them in its own.

    Returns whether they are in checked files.
    """
    import jax

    from jounce.base.jax_internals import use_file_cache

    def file_cache(path: str) -> Any:
        return JaxProgramFolder(folder), path

    if known := use_file_cache(file_cache):
        ask_before_jax()
    jax.config.update("jax_compilation_cache_dir", str(folder.path))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.01)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)
    jax.config.update("jax_persistent_cache_enable_xla_caches", "none")  # those are for GPUs
    return known


def use_compilation_cache(*, quiet: bool = False) -> None:
    """Keep compiled programs between calls of the command, unless JAX has a folder or this one is out of reach.

    A folder in which others may write is not used, and a line on standard error says so, unless that is to be `quiet`.
    """
    import warnings

    import jax

    store.use_store(None)
    if getattr(jax.config, "jax_compilation_cache_dir", None) is not None:
        return
    try:
        directory = chosen_folder()
        if directory is None:
            return
        folder = PrivateFolder(directory)
    except OutputError as error:
        if not quiet:
            sys.stderr.write(f"compiled programs are not stored: {error}\n")
        return
    except (RuntimeError, ValueError):  # there is no home, or a name that no file can have
        return
    store.run_one_command()
    if keep_programs(folder):
        store.use_store(ProgramFolder(folder))
    warnings.filterwarnings("ignore", message="Error (reading|writing) persistent compilation cache")
