"""The manifest of a sweep, in words and digests, which decides whether a command continues it."""

import dataclasses
import importlib.metadata
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax
import numpy as np

from jounce.design.tolerances.design_space import Grid, Sobol
from jounce.design.tolerances.variations import Values
from jounce.errors import OutputError, shortened
from jounce.execution.backends import uses_machine_code
from jounce.execution.device import on_processor
from jounce.sweeps.fingerprints import fingerprint

FORMAT = 3  # in 1, digests did not cover the sweep and the place of a chunk; in 2, coordinates were compressed
LARGEST_CHUNK = 2**20  # largest chunk that may be requested
COMPARED = ("vary", "options", "versions", "arithmetic")  # groups of a manifest, value by value
LIBRARIES = ("jax", "jaxlib", "numpy")  # the last bits may depend on their versions
MOST_SHOWN = 200  # characters of a value of a manifest


def manifest_of(
    title: str,
    model: Any,
    files: Mapping[str, str],
    space: Grid | Sobol,
    instants: np.ndarray,
    options: Mapping[str, Any],
) -> dict[str, Any]:
    """Return the manifest of a sweep.

    Parameters
    ----------
    title : str
    model : object
        Mechanism, or robot and trajectory, with all their parts.
    files : dict of str to str
        Digests of the files that were read, by their real paths, the file of the model first.
    space : Grid or Sobol
        Designs.
    instants : array of shape (time,)
        Instants, s.
    options : dict
        Other settings.
    """
    attributes = {
        "format": FORMAT,
        "title": title,
        "files": _named(files),
        "model": fingerprint(model),
        "vary": {name: _exact_description(variation) for name, variation in space.variations.items()},
        "sample": None if isinstance(space, Grid) else f"sobol:{space.count}",
        "designs": space.count,
        "time": f"{len(instants)} instants from {float(instants[0])!r} to {float(instants[-1])!r} s, "
        f"digest {fingerprint(instants)[:16]}",
        "options": dict(options),
        "versions": versions(),
        "arithmetic": arithmetic(),
        "checksum": None,
    }
    attributes = json.loads(json.dumps(attributes))  # as after reading
    return attributes | {"identity": _identity(attributes)}


def _identity(manifest: Mapping[str, Any]) -> str:
    """Return a digest of the content of a manifest at the start of a sweep."""
    blanks = {"checksum": None, "identity": None}
    return fingerprint({name: value for name, value in manifest.items() if name not in blanks} | blanks)


def intact(manifest: Mapping[str, Any], path: str) -> dict[str, Any]:
    """Return a manifest read from a file, after checking that it is unchanged.

    Raises
    ------
    OutputError
        If another release wrote the manifest, or it was changed since.
    """
    release = manifest.get("format")
    if isinstance(release, int) and release != FORMAT:
        raise OutputError("was begun by another release of jounce; give another name", path=path)
    groups = [manifest.get(name) for name in ("files", *COMPARED)]
    if all(isinstance(group, dict) for group in groups) and manifest.get("identity") == _identity(manifest):
        chunk = manifest["options"].get("chunk")
        if type(chunk) is int and 1 <= chunk <= LARGEST_CHUNK:
            return dict(manifest)
    message = (
        "its manifest was changed since it was written, so that nothing tells what was computed; give another name"
    )
    raise OutputError(message, path=path)


def versions() -> dict[str, str]:
    """Return the releases of this package and of the numerical packages in this process.

    Examples
    --------
    >>> sorted(versions())
    ['jax', 'jaxlib', 'jounce', 'numpy']
    """
    from jounce.version import __version__

    return {"jounce": __version__} | {name: importlib.metadata.version(name) for name in LIBRARIES}


def arithmetic() -> dict[str, str]:
    """Return what computes in this process, and thus how results round; it must be the same for all chunks of a sweep.

    Examples
    --------
    >>> sorted(arithmetic())
    ['device', 'machine code']
    """
    chosen: Any = jax.config.values["jax_default_device"]
    device = jax.devices()[0] if chosen is None else chosen
    kind = getattr(device, "device_kind", str(device))
    code = f"llvmlite {importlib.metadata.version('llvmlite')}" if uses_machine_code() else "not used"
    return {"machine code": code, "device": "cpu" if on_processor() else kind}


def check_same_arithmetic(stored: Mapping[str, Any], folder: str) -> None:
    """Raise OutputError, with the differences, unless this process computes like the one that began a sweep."""
    current = versions()
    if differences := _others(stored.get("versions", current), current) + _others(stored["arithmetic"], arithmetic()):
        message = f"a worker rounds otherwise than what began the sweep: {'; '.join(differences)}"
        raise OutputError(f"{message}; install the same packages for both", path=folder)


def _named(files: Mapping[str, str]) -> dict[str, str]:
    """Return digests by file names relative to the folder of the first file."""
    if not files:
        return {}
    folder = Path(next(iter(files))).parent
    return {Path(os.path.relpath(path, folder)).as_posix(): digest for path, digest in files.items()}


def check_same(stored: Mapping[str, Any], expected: Mapping[str, Any], folder: str) -> None:
    """Raise OutputError, with the differences, unless an existing sweep has the requested settings."""
    differences = list(_differences(stored, expected))
    if differences:
        message = (
            f"another sweep is there: {'; '.join(differences[:4])}; give another name, or the command that it was "
            "begun with: nothing was changed"
        )
        raise OutputError(message, path=folder)


def _differences(stored: Mapping[str, Any], expected: Mapping[str, Any]) -> list[str]:
    """Return the differences of two manifests in words."""
    differences = []
    for name in stored["files"] | expected["files"]:
        old, new = stored["files"].get(name), expected["files"].get(name)
        if old != new:
            differences.append(
                f"the file {name} {'was not read' if old is None else 'differs' if new else 'is not read'}"
            )
    other_settings = [{name: x.get(name) for name in ("sample", "time")} for x in (stored, expected)]
    for old, new in [*((stored[group], expected[group]) for group in COMPARED), other_settings]:
        differences += _others(old, new)
    if list(stored["vary"]) != list(expected["vary"]) and not differences:
        differences.append(f"the order of what varies is {', '.join(stored['vary'])} there")
    if stored["identity"] != expected["identity"] and not differences:
        differences.append("the model has other values")
    return differences


def _others(stored: Mapping[str, Any], expected: Mapping[str, Any]) -> list[str]:
    """Return the differences in a group of two manifests, value by value, in words."""
    names = [name for name in {**stored, **expected} if stored.get(name) != expected.get(name)]
    return [f"{n} is {_shown(stored.get(n))} there, and {_shown(expected.get(n))} here" for n in names]


def _shown(value: Any) -> str:
    return "not given" if value is None else shortened(str(value), MOST_SHOWN)


def _exact_description(variation: Any) -> str:
    """Return a description of a variation that determines every bit of it."""
    if isinstance(variation, Values):
        return f"{variation.count} values, digest {fingerprint(variation.values)[:16]}"
    numbers = [repr(value) for value in dataclasses.astuple(variation) if value is not None]
    kind = type(variation).__name__.lower()
    return ":".join(numbers if kind == "interval" else [kind, *numbers])
