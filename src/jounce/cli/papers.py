"""The command that reproduces the figures and tables of papers."""

from __future__ import annotations

from pathlib import Path

from jounce.errors import JounceError, check_name
from jounce.reporting.terminal import Bar, say

PAPERS = ("sommer-2024", "negrean-2025")


def reproduce(paper: str, /, *, out: Path, samples: Path | None = None, masses: Path | None = None) -> int:
    """Reproduce the figures and tables of a paper.

    Parameters
    ----------
    paper
        sommer-2024 or negrean-2025.
    out
        Folder for figures and tables; made if it does not exist.
    samples
        Your own accelerations (.csv: time, then a column for each motion, rad/s^2) in the place of stand-ins;
        negrean-2025 only.
    masses
        Your own link (.yaml, .toml, .json: mass, center_x, center_z, inertia_y); negrean-2025 only.

    Examples
    --------
      jounce reproduce sommer-2024 --out out
      jounce reproduce negrean-2025 --out out
      jounce reproduce negrean-2025 --out out --samples a.csv --masses link.yaml
    """
    from jounce.reporting.text.summaries import count

    check_name("paper", paper, PAPERS, JounceError)
    given = {name: path for name, path in (("samples", samples), ("masses", masses)) if path is not None}
    if given and paper != "negrean-2025":
        message = f"{paper} needs no data of yours; negrean-2025 takes samples and masses"
        raise JounceError(message, name=f"--{next(iter(given))}", value=str(next(iter(given.values()))))
    if paper == "negrean-2025":
        from jounce.papers import negrean_2025 as home
    else:
        from jounce.papers import sommer_2024 as home
    with Bar("reproducing") as bar:
        paths = home.reproduce(out, progress=bar, **given)
    say(paths[0].read_text(encoding="utf-8"))
    say(f"Written to {out}: {count(len(paths), 'file')}")
    return 0
