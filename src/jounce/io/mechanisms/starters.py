"""Starter files: small mechanisms with comments, to be changed by the user."""

from __future__ import annotations

import importlib.resources
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from jounce.errors import JounceError, OutputError, check_name


@dataclass(frozen=True)
class Starter:
    """A starter file of the package.

    Parameters
    ----------
    name : str
        Name of the starter.
    about : str
        Description in one sentence.
    command : str
        Command that moves it: run or simulate.
    """

    name: str
    about: str
    command: str = "run"

    @property
    def text(self) -> str:
        """The text of the file."""
        return (importlib.resources.files("jounce") / "templates" / f"{self.name}.yaml").read_text(encoding="utf-8")


STARTERS: dict[str, Starter] = {
    starter.name: starter
    for starter in (
        Starter("four-bar", "A planar four-bar linkage: angle of the rocker and a point of the coupler."),
        Starter("slider-crank", "An engine with masses: torque of the crank and loads of the bearings."),
        Starter("cam", "An eccentric cam with a roller follower, a spring and the contact force."),
        Starter("gear-train", "An epicyclic gear train: sun, planet, carrier and a ring that is held."),
        Starter("spatial-linkage", "A spatial four-bar (RSSR): two hinges and a rod with balls at its ends."),
        Starter("robot-arm", "An arm with three motors and a payload: torques and their rates."),
        Starter("free-pendulum", "A damped pendulum that swings freely under its weight.", "simulate"),
        Starter("spring-mass", "A mass on a spring with a shaken base: vibration.", "simulate"),
    )
}
"""The starter files by name."""


def write_starter(name: str, path: str | PathLike[str], *, overwrite: bool = False) -> Starter:
    """Write a starter file.

    Parameters
    ----------
    name : str
        One of `STARTERS`.
    path
        File ending in .yaml or .yml, with comments, or in .toml or .json, without.
    overwrite : bool, default False
        Whether an existing file may be replaced.

    Raises
    ------
    JounceError
        If there is no such starter.
    OutputError
        If the file exists already, or cannot be written.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = write_starter("four-bar", pathlib.Path(folder) / "mine.yaml")
    ...     (pathlib.Path(folder) / "mine.yaml").read_text().splitlines()[3]
    'title: Four-bar linkage'
    """
    from jounce.io.files import DATA_FILES
    from jounce.io.files.dumping import dumped
    from jounce.io.files.examples import example_names
    from jounce.io.files.parsers import read_yaml
    from jounce.io.files.writing import check_target, replacing

    if name not in STARTERS and name in example_names():
        message = f"no starter has this name; `jounce new --from {name}` copies the example"
        raise JounceError(message, value=name)
    check_name("starter", name, STARTERS, JounceError)
    starter, suffix = STARTERS[name], Path(path).suffix.lower()
    check_target(path, DATA_FILES, "mechanism file", overwrite=overwrite)
    refuse_existing(path, overwrite=overwrite)
    text = starter.text
    if suffix in (".toml", ".json"):
        text = dumped(read_yaml(name, text).data, suffix, str(path))
    with replacing(path, overwrite=overwrite) as scratch:
        scratch.write_text(text, encoding="utf-8")
    return starter


def refuse_existing(path: str | PathLike[str], *, overwrite: bool) -> None:
    """Raise OutputError if a file exists that must not be replaced."""
    if not overwrite and Path(path).exists():
        raise OutputError("is there already; give another name, or replace it with --overwrite", path=str(path))
