"""The figures and comparisons of section 4, written into one directory."""

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from jounce.errors import JounceError, flag
from jounce.papers.negrean_2025.case import CASES
from jounce.papers.negrean_2025.comparison import comparison
from jounce.papers.negrean_2025.measured_data import given_cases, summary
from jounce.papers.negrean_2025.motion_history import History, history
from jounce.papers.output import Progress, counter, csv_table, writable, write_figures, write_texts


def reproduce(
    out_directory: str | os.PathLike[str],
    progress: Progress | None = None,
    *,
    samples: str | os.PathLike[str] | None = None,
    masses: str | os.PathLike[str] | None = None,
    remove_gravity: bool = False,
) -> list[Path]:
    """Compute the motions of section 4 of Negrean 2025 and write figures, `comparison.md`, energies and torques.

    Parameters
    ----------
    out_directory : path
        Directory of the files, made if it does not exist. Existing files of the same names are replaced.
    progress : callable, optional
        Function called with the number of finished motions and figures, and their total.
    samples : path, optional
        Measurements that replace the stand-ins: a CSV file with ``time``, s, and for each motion a column of angular
        accelerations, rad/s^2, or of tangential accelerations with their unit, ``fast [m/s^2]``; these need a radius
        among the masses.
    masses : path, optional
        The link: a YAML, TOML or JSON file with mass, center_x, center_z and inertia_y, with units, and optionally the
        other fields of `Link`.
    remove_gravity : bool, default False
        Whether to remove gravity from tangential samples. Readings of an accelerometer contain it; the axis of the arm
        is level, and so is the arm at angle zero.

    Returns
    -------
    list of pathlib.Path
        Paths of the files: `comparison.md`, `energies.csv` and `torques.csv` first, then the figures as PNG and SVG.

    Raises
    ------
    OutputError
        If the directory cannot be made or written to; raised before any computation.
    JounceError
        If samples or masses cannot be read.

    Examples
    --------
    >>> from jounce.papers.negrean_2025 import reproduce
    >>> paths = reproduce("out")  # doctest: +SKIP
    """
    files = [None if path is None else Path(path) for path in (samples, masses)]
    remove_gravity = flag("remove_gravity", remove_gravity, error=JounceError)
    has_own_data = files != [None, None] or remove_gravity
    cases = given_cases(*files, remove_gravity=remove_gravity) if has_own_data else CASES
    data = summary(cases, *files, remove_gravity=remove_gravity) if has_own_data else None
    directory = writable(Path(out_directory))
    from jounce.papers.negrean_2025 import figures  # imports matplotlib

    advanced = counter(len(cases) + len(figures.FIGURES), progress)
    histories: dict[str, History] = {}
    for name, case in cases.items():
        histories[name] = history(case)
        advanced()
    texts = {
        "comparison.md": comparison(histories, data),
        "energies.csv": energies_csv(histories),
        "torques.csv": torques_csv(histories),
    }
    paths = write_texts(directory, texts)
    for written in write_figures(directory, figures.FIGURES, histories):
        paths += written
        advanced()
    return paths


def energies_csv(histories: Mapping[str, History]) -> str:
    """Return the angle with its derivatives to jounce and the energies E_1 to E_3 as CSV, 17 significant digits."""
    columns = ("q", "q_d1", "q_d2", "q_d3", "q_d4", "E_1", "E_2", "E_3")
    return _csv(columns, {name: np.hstack([h.motion[:, :5], h.energies]) for name, h in histories.items()}, histories)


def torques_csv(histories: Mapping[str, History]) -> str:
    """Return the driving torque and its two rates, and the share of gravity, as CSV, 17 significant digits."""
    columns = ("torque", "torque_d1", "torque_d2", "gravity", "gravity_d1", "gravity_d2")
    return _csv(columns, {name: np.hstack([h.torques, h.gravity]) for name, h in histories.items()}, histories)


def _csv(columns: tuple[str, ...], tables: Mapping[str, np.ndarray], histories: Mapping[str, History]) -> str:
    rows = (
        (name, instant, *values)
        for name, table in tables.items()
        for instant, values in zip(histories[name].time, table, strict=True)
    )
    return csv_table(("motion", "time", *columns), rows)
