"""The example files of the package, in its installed folder or in that of the checkout."""

from __future__ import annotations

import importlib.resources
import re
import shutil
from os import PathLike
from pathlib import Path

from jounce.errors import JounceError, OutputError, check_name

_MENTIONED = re.compile(r"[\w./-]+\.(?:csv|py|urdf|xml|sdf|yaml|toml|json)\b")
_TITLE = re.compile(r"^(?:title\s*[:=]\s*(.*)|\"\"\"(.*))", re.MULTILINE)
_KINDS = (".yaml", ".py", ".ipynb", ".urdf", ".xml", ".sdf", ".csv")


def examples_folder() -> Path:
    """Return the folder of the examples.

    Raises
    ------
    JounceError
        If there is no such folder, since the package was copied without it.
    """
    installed = Path(str(importlib.resources.files("jounce") / "examples"))
    checkout = Path(__file__).parents[4] / "examples"
    for folder in (installed, checkout):
        if (folder / "four_bar.yaml").is_file():
            return folder
    raise JounceError(f"no examples at {installed}: install the package again")


def example_names() -> dict[str, str]:
    """Return the titles of the examples by name: mechanisms and scripts, then robots, trajectories and others.

    Examples
    --------
    >>> example_names()["four_bar"]
    'Planar four-bar'
    """
    folder = examples_folder()
    files = [path for path in sorted(folder.rglob("*")) if path.suffix in _KINDS and "broken" not in path.parts]
    files.sort(key=lambda path: len(path.relative_to(folder).parts))
    return {_name(path, folder): _example_title(path) for path in files}


def copy_example(name: str, path: str | PathLike[str] | None = None, *, overwrite: bool = False) -> list[Path]:
    """Copy an example and the files that it mentions, and return the written paths, the example first.

    Parameters
    ----------
    name : str
        One of `example_names`, such as ``four_bar`` or ``robots/panda.urdf``.
    path
        The file to write; by default the name of the example in the working folder. Mentioned files keep their places
        relative to it.
    overwrite : bool, default False
        Whether existing files may be replaced.

    Raises
    ------
    JounceError
        If there is no such example.
    OutputError
        If a file exists already, or cannot be written; then none is written.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as here:
    ...     [path.name for path in copy_example("four_bar", pathlib.Path(here) / "mine.yaml")]
    ['mine.yaml']
    """
    folder = examples_folder()
    examples = {_name(file, folder): file for file in folder.rglob("*") if file.suffix in _KINDS}
    stem = name.removesuffix(".yaml").removesuffix(".py").replace("-", "_")
    if name not in examples:
        check_name("example", stem, examples, JounceError)
    source = examples.get(name) or examples[stem]
    target = Path(source.name) if path is None else Path(path)
    pairs = [(source, target)]
    if source.suffix in (".yaml", ".py"):
        for mentioned in dict.fromkeys(_MENTIONED.findall(source.read_text(encoding="utf-8"))):
            companion = (source.parent / mentioned).resolve()
            if companion.is_file() and companion != source and companion.is_relative_to(folder):
                pairs.append((companion, target.parent / mentioned))
    for _, target in pairs:
        if target.exists() and not overwrite:
            raise OutputError("is there already; give another name, or replace it with --overwrite", path=target)
    for file, target in pairs:
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, target)
        except OSError as error:
            message = f"cannot be written: {error.strerror or error}"
            raise OutputError(message, while_writing=True, path=target) from None
    return [target for _, target in pairs]


def _name(path: Path, folder: Path) -> str:
    """Return the name of an example, without its ending if no other file has the same stem."""
    relative = path.relative_to(folder).as_posix()
    return relative.rpartition(".")[0] if path.suffix == ".yaml" or "/" not in relative else relative


def _example_title(path: Path) -> str:
    """Return the title of a file, or the text of its first comment."""
    if path.suffix not in (".yaml", ".py"):
        return {".csv": "trajectory", ".ipynb": "notebook"}.get(path.suffix, "robot")
    text = path.read_text(encoding="utf-8")
    if match := _TITLE.search(text):
        return next(part for part in match.groups() if part is not None).strip("\"' ").rstrip(".")
    first = next((line for line in text.splitlines() if line.startswith("#")), "")
    return first.lstrip("# ").rstrip(".")
