"""The command that reproduces the figures and tables of papers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from jounce.base.activity import Count
from jounce.errors import JounceError, check_name
from jounce.reporting.terminal import print_text

PAPERS = ("sommer-2024", "negrean-2025")


def reproduce(
    paper: str,
    /,
    *,
    out: Path,
    samples: Path | None = None,
    masses: Path | None = None,
    remove_gravity: bool = False,
    stop: str | None = None,
) -> int:
    """Reproduce the figures and tables of a paper.

    Parameters
    ----------
    paper
        sommer-2024 or negrean-2025.
    out
        Folder for figures and tables; created if it does not exist.
    samples
        Your own accelerations (.csv) for negrean-2025: the time, then
        a column for each motion, angular (rad/s^2) or with its unit: fast [m/s^2].
    masses
        Your own link (.yaml, .toml, .json) for negrean-2025: mass,
        center_x, center_z, inertia_y, and radius for tangential samples.
    remove_gravity
        Subtract gravity from tangential samples (arm with a level axis).
    stop
        Measure of the assembly error of sommer-2024: correction (of
        Newton-Raphson, the default) or residual (lengths in cm, as in the paper).

    Examples
    --------
      jounce reproduce sommer-2024 --out out
      jounce reproduce sommer-2024 --out out --stop residual
      jounce reproduce negrean-2025 --out out
      jounce reproduce negrean-2025 --out out --samples a.csv --masses link.yaml
    """
    from jounce.reporting.text.summaries import count

    check_name("paper", paper, PAPERS, JounceError)
    given: dict[str, Any] = {"samples": samples, "masses": masses, "remove_gravity": remove_gravity or None}
    given = {name: value for name, value in given.items() if value is not None}
    if given and paper != "negrean-2025":
        message = f"{paper} needs no data of yours; negrean-2025 takes samples and masses"
        name, value = next(iter(given.items()))
        raise JounceError(message, name=f"--{name.replace('_', '-')}", value=str(value))
    if stop is not None and paper != "sommer-2024":
        raise JounceError(f"{paper} has no assembly tolerance; sommer-2024 has", name="--stop", value=stop)
    if stop is not None:
        given["stop"] = stop
    if paper == "negrean-2025":
        from jounce.papers import negrean_2025 as home
    else:
        from jounce.papers import sommer_2024 as home
    with Count("reproducing") as bar:
        paths = home.reproduce(out, progress=bar, **given)
    print_text(paths[0].read_text(encoding="utf-8"))
    print_text(f"Written to {out}: {count(len(paths), 'file')}")
    return 0
