"""All figures and errors of the paper, made again into one directory."""

import os
from collections.abc import Callable, Mapping
from pathlib import Path

from jounce.papers.files import FORMATS, rendered, writable, write
from jounce.papers.sommer_2024.simulations import (
    QUANTITIES,
    RUNS,
    SIMULATIONS,
    STEP,
    STEPS,
    TOLERANCE,
    TOLERANCES,
    Cycle,
    Results,
    measure,
)

PRINTED = {  # root-mean-square errors in the text of the paper, sections 4 and 6
    ("four_bar", "jerk"): 1.07e-13,
    ("four_bar", "jounce"): 9.7e-13,
    ("rsur", "jerk"): 2.17e-14,
    ("rsur", "jounce"): 3.81e-13,
}
UNITS = ("rad/s", "rad/s^2", "rad/s^3", "rad/s^4")


def reproduce(out_directory: str | os.PathLike[str], progress: Callable[[int, int], None] | None = None) -> list[Path]:
    """Run the seven simulations of Sommer 2024 and write figures 2-7 and 10-13, their errors and `comparison.md`.

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
        write(directory / "comparison.md", comparison(cycles).encode("ascii")),
        write(directory / "errors.csv", errors_csv(cycles).encode("ascii")),
        write(directory / "errors_by_tolerance.csv", tolerances_csv(results).encode("ascii")),
        write(directory / "errors_by_step.csv", steps_csv(results).encode("ascii")),
    ]
    for number, draw in figures.FIGURES.items():
        with figures.style():
            figure = draw(results)
            paths += [write(directory / f"figure_{number:02d}.{kind}", rendered(figure, kind)) for kind in FORMATS]
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


def comparison(cycles: Mapping[str, Cycle]) -> str:
    """Return the errors at nominal settings beside the printed ones, as a page in Markdown."""
    lines = [
        "# Sommer 2024: errors of the output angle against explicit geometric solutions",
        "",
        f"One cycle of 2 s, time step {STEP:g} s, assembly tolerance {TOLERANCE:g}. Printed: the root-mean-square",
        "errors (RMSE) that the text of the paper states, computed there in MATLAB. Normalised: RMSE divided by the",
        "largest absolute value of the quantity over the cycle.",
        "",
        "| simulation | quantity | unit | largest value | RMSE | printed RMSE | normalised RMSE |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, cycle in cycles.items():
        columns = zip(QUANTITIES, UNITS, cycle.peak, cycle.rmse, cycle.normalised_rmse, strict=True)
        for quantity, unit, peak, error, normalised in columns:
            printed = PRINTED.get((name, quantity))
            beside = "" if printed is None else f"{printed:.3g}"
            lines.append(f"| {name} | {quantity} | {unit} | {peak:.4g} | {error:.2e} | {beside} | {normalised:.1e} |")
    return "\n".join(lines) + "\n"
