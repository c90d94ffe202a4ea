"""Measured samples and masses in the place of the stand-ins: files, and what the page says of them."""

import dataclasses
from pathlib import Path

import numpy as np

from jounce.errors import JounceError, MechanismFileError
from jounce.io.files.samples import read_columns
from jounce.io.files.source import read_source
from jounce.papers.negrean_2025.case import CASES, STAND_IN, Case, Link, law
from jounce.papers.output import page

UNITS = {field.name: field.name.partition("_")[0] for field in dataclasses.fields(Link)}  # kinds of units
UNITS |= dict.fromkeys(("center_x", "center_z", "radius"), "length")
NEEDED = ("mass", "center_x", "center_z", "inertia_y")


def given_cases(samples: Path | None, masses: Path | None) -> dict[str, Case]:
    """Return the motions of a file of samples on an arm of a file of masses, stand-ins for what is not given.

    Parameters
    ----------
    samples : path, optional
        CSV: ``time`` in s, and for each motion a column of its name with angular accelerations, rad/s^2.
    masses : path, optional
        YAML, TOML or JSON: mass, center_x, center_z and inertia_y, with units; inertia_x, inertia_z and the radius of
        the accelerometer have no part in the torques.

    Raises
    ------
    JounceError
        If a file cannot be read, or what it says makes no motion or no link.
    """
    link = STAND_IN if masses is None else read_link(masses)
    if samples is None:
        return {name: dataclasses.replace(case, link=link) for name, case in CASES.items()}
    times, columns, units = read_columns(samples, derivative=2)
    for name in units:
        if any(base == "length" for base, _ in units[name]):
            raise MechanismFileError("the unit must be that of an angular acceleration", path=samples, name=name)
    cases = {}
    for name, values in columns.items():
        accelerations = np.array(values)
        try:
            law(accelerations, np.array(times))
        except JounceError as error:
            raise error.located(path=samples, name=name) from None
        cases[name] = Case(name, name, lambda a=accelerations: a, None, link, np.array(times), measured=True)
    return cases


def read_link(path: Path) -> Link:
    """Return the link of a file of masses.

    Raises
    ------
    JounceError
        If the file cannot be read, a value is missing, is none or has another unit, or no body has these moments.
    """
    source = read_source(path, kind="masses")
    data = source.mapping((), UNITS)
    for key in NEEDED:
        if key not in data:
            raise source.error("is missing", (key,))
    values = {key: source.number((key,), raw, UNITS[key]) for key, raw in data.items()}
    for name in ("inertia_x", "inertia_z"):  # they have no part in it, and any body may have those of a thin rod
        values.setdefault(name, values["inertia_y"])
    link = Link(**{"radius": STAND_IN.radius} | values)
    try:
        link.robot()
    except JounceError as error:
        raise error.located(path=path) from None
    return link


def summary(cases: dict[str, Case], samples: Path | None, masses: Path | None) -> str:
    """Return what the page says of data that are not the stand-ins of all of it."""
    case = next(iter(cases.values()))
    through = "The law is made of quintic segments through them, as they are"
    return page(
        __package__,
        "measured_data.md",
        samples=f"`{samples.name}`" if samples else "stand-ins, as without --samples",
        masses=f"`{masses.name}`" if masses else "stand-ins, as without --masses",
        law=f"{through}: from angle and speed zero, jerk zero at both ends."
        if samples
        else "Bias and drift are taken off them.",
        instants=len(case.knots),
        first=case.knots[0],
        last=case.knots[-1],
        link=case.link,
    ).rstrip()
