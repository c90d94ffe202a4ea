"""All figures and errors of the paper, written into one directory."""

import os
from collections.abc import Callable, Mapping
from pathlib import Path

from jounce.papers.files import FORMATS, rendered, writable, write
from jounce.papers.sommer_2024.comparison import comparison
from jounce.papers.sommer_2024.measure import RUNS, Results, measure
from jounce.papers.sommer_2024.simulations import QUANTITIES, SIMULATIONS, STEPS, TOLERANCES, Cycle


def reproduce(out_directory: str | os.PathLike[str], progress: Callable[[int, int], None] | None = None) -> list[Path]:
    """Run the seven simulations of Sommer 2024 and write figures 1-13, one of the phase lag of section 7,
    the errors as CSV, and `comparison.md`.

    Parameters
    ----------
    out_directory : path
        Where to write; made if it does not exist. Files of the same names are replaced.
    progress : callable, optional
        Called with the number of runs and figures done and their total.

    Returns
    -------
    list of pathlib.Path
        The files written: `comparison.md`, `errors.csv`, `errors_by_tolerance.csv` and `errors_by_step.csv` first, then
        the figures as PNG and SVG.

    Raises
    ------
    OutputError
        If the directory cannot be made or written to; raised before any computing.

    Examples
    --------
    >>> from jounce.papers.sommer_2024 import reproduce
    >>> paths = reproduce("out")  # doctest: +SKIP
    """
    directory = writable(Path(out_directory))
    from jounce.papers.sommer_2024 import figures  # imports matplotlib

    total = RUNS * len(SIMULATIONS) + len(figures.FIGURES)
    done = 0

    def advanced() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done, total)

    results = {name: measure(simulation, advanced) for name, simulation in SIMULATIONS.items()}
    cycles = {name: result.cycle for name, result in results.items()}
    paths = [
        write(directory / "comparison.md", comparison(results).encode("ascii")),
        write(directory / "errors.csv", errors_csv(cycles).encode("ascii")),
        write(directory / "errors_by_tolerance.csv", tolerances_csv(results).encode("ascii")),
        write(directory / "errors_by_step.csv", steps_csv(results).encode("ascii")),
    ]
    for name, draw in figures.FIGURES.items():
        with figures.style():
            figure = draw(results)
            paths += [write(directory / f"{name}.{kind}", rendered(figure, kind)) for kind in FORMATS]
        advanced()
    return paths


def errors_csv(cycles: Mapping[str, Cycle]) -> str:
    """Return the errors at nominal settings as CSV, one row per simulation and quantity, 17 significant digits."""
    rows = ["simulation,quantity,rmse,normalised_rmse"]
    for name, cycle in cycles.items():
        columns = zip(QUANTITIES, cycle.rmse, cycle.normalised_rmse, strict=True)
        rows += [f"{name},{quantity},{error:.16e},{normalised:.16e}" for quantity, error, normalised in columns]
    return "\n".join(rows) + "\n"


def tolerances_csv(results: Mapping[str, Results]) -> str:
    """Return the normalised errors at each assembly tolerance as CSV: what figures 4, 6, 10 and 12 draw."""
    rows = [",".join(("simulation", "tolerance", *QUANTITIES))]
    for name, result in results.items():
        for tolerance, errors in zip(TOLERANCES, result.by_tolerance, strict=True):
            rows.append(",".join([name, f"{tolerance:g}", *(f"{error:.16e}" for error in errors)]))
    return "\n".join(rows) + "\n"


def steps_csv(results: Mapping[str, Results]) -> str:
    """Return the normalised errors of jerk and jounce at each time step as CSV: what figures 5, 7, 11 and 13 draw."""
    rows = ["simulation,step,method,jerk,jounce"]
    for name, result in results.items():
        for method, table in result.by_step.items():
            for step, errors in zip(STEPS, table, strict=True):
                rows.append(",".join([name, f"{step:g}", method, *(f"{error:.16e}" for error in errors)]))
    return "\n".join(rows) + "\n"
