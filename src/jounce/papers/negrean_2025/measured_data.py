"""Measured samples and masses that replace the stand-ins: their files, and their description on the page."""

import dataclasses
from pathlib import Path

import numpy as np

from jounce.errors import JounceError, MechanismFileError
from jounce.io.files.samples import read_columns
from jounce.io.files.source import read_source
from jounce.papers.negrean_2025.case import CASES, STAND_IN, Case, Link, law, without_gravity
from jounce.papers.output import page

UNITS = {field.name: field.name.partition("_")[0] for field in dataclasses.fields(Link)}  # kinds of units
UNITS |= dict.fromkeys(("center_x", "center_z", "radius"), "length") | {"sensor_angle": "angle"}
GRAVITY_STAYS = """they are taken as accelerations of the arm. An accelerometer on an arm with a level axis reads
  gravity too, -9.81 m/s^2 along the tangent of a level arm at rest: of such readings, --remove-gravity takes it off"""
NEEDED = ("mass", "center_x", "center_z", "inertia_y")


def given_cases(samples: Path | None, masses: Path | None, *, remove_gravity: bool = False) -> dict[str, Case]:
    """Return the motions of a file of samples, on the arm of a file of masses; stand-ins replace a missing file.

    Parameters
    ----------
    samples : path, optional
        CSV file: ``time`` in s, and for each motion a column of its name with angular accelerations, rad/s^2, or with
        tangential accelerations, marked by their unit in the name: ``fast [m/s^2]``.
    masses : path, optional
        YAML, TOML or JSON file: mass, center_x, center_z and inertia_y, with units; inertia_x and inertia_z do not
        affect the torques, and only tangential accelerations need the radius of the accelerometer.
    remove_gravity : bool, default False
        Whether tangential accelerations are readings of an accelerometer, which contain gravity.

    Raises
    ------
    JounceError
        If a file cannot be read, or does not describe a motion or a link.
    """
    link, stated = (STAND_IN, frozenset()) if masses is None else read_link(masses)
    if samples is None:
        if remove_gravity:
            raise JounceError("there are no readings to take gravity off; give samples", name="remove_gravity")
        return {name: dataclasses.replace(case, link=link) for name, case in CASES.items()}
    times, columns, units = read_columns(samples, derivative=2)
    tangential = {name for name in units if any(base == "length" for base, _ in units[name])}
    cases = {}
    for name, values in columns.items():
        if name in tangential and "radius" not in stated:
            message = "tangential accelerations need the radius of the accelerometer; give radius in the file of masses"
            raise MechanismFileError(message, path=samples, name=name)
        if remove_gravity and name not in tangential:
            message = "gravity is in tangential readings; say their unit in the name of the column, as 'name [m/s^2]'"
            raise MechanismFileError(message, path=samples, name=name)
        accelerations = np.array(values) / (link.radius if name in tangential else 1.0)
        try:
            if remove_gravity:
                accelerations = without_gravity(np.array(values), link, np.array(times))
            law(accelerations, np.array(times))
        except JounceError as error:
            raise error.located(path=samples, name=name) from None
        cases[name] = Case(name, name, lambda a=accelerations: a, None, link, np.array(times), measured=True)
    return cases


def read_link(path: Path) -> tuple[Link, frozenset[str]]:
    """Return the link of a file of masses, and the names of the values in it.

    Raises
    ------
    JounceError
        If the file cannot be read, a value is missing, is no number or has a wrong unit, or no body has these moments.
    """
    source = read_source(path, kind="masses")
    data = source.mapping((), UNITS)
    for key in NEEDED:
        if key not in data:
            raise source.error("is missing", (key,))
    values = {key: source.number((key,), raw, UNITS[key]) for key, raw in data.items()}
    for name in ("inertia_x", "inertia_z"):  # without effect on the torques; those of a thin rod are always possible
        values.setdefault(name, values["inertia_y"])
    link = Link(**{"radius": STAND_IN.radius} | values)
    if not link.radius > 0:
        raise source.error(f"must be positive, not {link.radius:g} m", ("radius",))
    try:
        link.robot()
    except JounceError as error:
        raise error.located(path=path) from None
    return link, frozenset(data)


def summary(cases: dict[str, Case], samples: Path | None, masses: Path | None, *, remove_gravity: bool = False) -> str:
    """Return the part of the page about measured data."""
    case = next(iter(cases.values()))
    gravity = "gravity is taken off the readings" if remove_gravity else GRAVITY_STAYS
    through = "The law is made of quintic segments through them, as they are"
    return page(
        __package__,
        "measured_data.md",
        samples=f"`{samples.name}`" if samples else "stand-ins, as without --samples",
        masses=f"`{masses.name}`" if masses else "stand-ins, as without --masses",
        law=f"{through}: from angle and speed zero, jerk zero at both ends."
        if samples
        else "Bias and drift are taken off them.",
        gravity=f"\n  {gravity[0].upper()}{gravity[1:]}." if samples else "",
        instants=len(case.knots),
        first=case.knots[0],
        last=case.knots[-1],
        link=case.link,
    ).rstrip()
