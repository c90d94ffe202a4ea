"""All figures and errors of the paper, written into one directory."""

import os
from collections.abc import Mapping
from pathlib import Path

from jounce.errors import JounceError, check_choice
from jounce.papers.output import Progress, counter, csv_table, writable, write_figures, write_texts
from jounce.papers.sommer_2024.cases import QUANTITIES, STEPS, TOLERANCES, VALIDATION_CASES, Cycle
from jounce.papers.sommer_2024.comparison import comparison
from jounce.papers.sommer_2024.measurement import RUNS, STOPS, Results, measure


def reproduce(
    out_directory: str | os.PathLike[str], progress: Progress | None = None, *, stop: str = "correction"
) -> list[Path]:
    """Run the seven simulations of Sommer 2024 and write figures 1-13, a figure of the phase lag of section 7,
    the errors as CSV, and `comparison.md`.

    Parameters
    ----------
    out_directory : path
        Directory of the files, made if it does not exist. Existing files of the same names are replaced.
    progress : callable, optional
        Function called with the number of finished runs and figures, and their total.
    stop : {"correction", "residual"}, default "correction"
        Quantity that the tolerances of figures 4, 6, 10 and 12 bound: the next Newton-Raphson correction, or the
        largest residual with lengths in cm, with which errors stop falling at the tolerances of the paper.

    Returns
    -------
    list of pathlib.Path
        Paths of the files: `comparison.md`, `errors.csv`, `errors_by_tolerance.csv` and `errors_by_step.csv` first,
        then the figures as PNG and SVG.

    Raises
    ------
    OutputError
        If the directory cannot be made or written to; raised before any computation.
    JounceError
        If `stop` is another word.

    Examples
    --------
    >>> from jounce.papers.sommer_2024 import reproduce
    >>> paths = reproduce("out")  # doctest: +SKIP
    """
    check_choice("rule", stop, STOPS, JounceError, name="stop")
    directory = writable(Path(out_directory))
    from jounce.papers.sommer_2024 import figures  # imports matplotlib

    advanced = counter(RUNS * len(VALIDATION_CASES) + len(figures.FIGURES), progress)
    results = {name: measure(case, advanced, stop=stop) for name, case in VALIDATION_CASES.items()}
    texts = {
        "comparison.md": comparison(results),
        "errors.csv": errors_csv({name: result.cycle for name, result in results.items()}),
        "errors_by_tolerance.csv": tolerances_csv(results),
        "errors_by_step.csv": steps_csv(results),
    }
    paths = write_texts(directory, texts)
    for written in write_figures(directory, figures.FIGURES, results):
        paths += written
        advanced()
    return paths


def errors_csv(cycles: Mapping[str, Cycle]) -> str:
    """Return the errors at nominal settings as CSV, one row per simulation and quantity, 17 significant digits."""
    rows = (
        (name, *errors)
        for name, cycle in cycles.items()
        for errors in zip(QUANTITIES, cycle.rmse, cycle.normalized_rmse, strict=True)
    )
    return csv_table(("simulation", "quantity", "rmse", "normalized_rmse"), rows)


def tolerances_csv(results: Mapping[str, Results]) -> str:
    """Return the normalized errors at each assembly tolerance as CSV, the data of figures 4, 6, 10 and 12."""
    rows = (
        (name, f"{tolerance:g}", *errors)
        for name, result in results.items()
        for tolerance, errors in zip(TOLERANCES, result.by_tolerance, strict=True)
    )
    return csv_table(("simulation", "tolerance", *QUANTITIES), rows)


def steps_csv(results: Mapping[str, Results]) -> str:
    """Return the normalized errors of jerk and jounce at each time step as CSV, the data of figures 5, 7, 11 and 13."""
    rows = (
        (name, f"{step:g}", method, *errors)
        for name, result in results.items()
        for method, table in result.by_step.items()
        for step, errors in zip(STEPS, table, strict=True)
    )
    return csv_table(("simulation", "step", "method", "jerk", "jounce"), rows)
