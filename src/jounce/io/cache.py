"""Compiled programs kept between calls of the command."""

from __future__ import annotations

import os
import sys
from pathlib import Path

__all__ = ["cache_directory", "use_compilation_cache"]


def cache_directory() -> Path | None:
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


def use_compilation_cache() -> None:
    """Keep compiled programs between calls of the command, unless JAX was told where or the folder is out of reach."""
    import warnings

    import jax

    if getattr(jax.config, "jax_compilation_cache_dir", None) is not None:
        return
    try:
        directory = cache_directory()
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
