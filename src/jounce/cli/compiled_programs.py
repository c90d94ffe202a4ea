"""Storage of compiled programs between calls of the command."""

from __future__ import annotations

import sys

from jounce.base.private_folder import PrivateFolder
from jounce.errors import OutputError
from jounce.execution.store import programs as store
from jounce.execution.store.folder import ProgramFolder, chosen_folder


def keep_programs(folder: PrivateFolder) -> bool:
    """Configure JAX to store its programs in checked files, and return whether its release supports that."""
    import jax

    from jounce.base.jax_internals import use_file_cache

    jax.config.update("jax_compilation_cache_dir", str(folder.path))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.01)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)
    jax.config.update("jax_persistent_cache_enable_xla_caches", "none")  # for GPUs only
    return use_file_cache(lambda path: (ProgramFolder(folder), path))


def use_compilation_cache(*, quiet: bool = False) -> None:
    """Store compiled programs between calls of the command, unless JAX has a folder or ours is not accessible.

    A folder in which other users may write is not used; a line on standard error reports it, unless `quiet`.
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
    except (RuntimeError, ValueError):  # without a home folder, or with an invalid name
        return
    store.run_one_command()
    store.use_store(ProgramFolder(folder))
    keep_programs(folder)
    warnings.filterwarnings("ignore", message="Error (reading|writing) persistent compilation cache")
