"""Facts, words and tables of an equilibrium and of the modes about it, and a file of mode shapes."""

from __future__ import annotations

import csv
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from typing_extensions import TypedDict

from jounce.dynamics import Equilibrium, Linearization, Modes
from jounce.dynamics.statics.independent_coordinates import COLUMNS
from jounce.io.files.writing import replacing
from jounce.reporting.text.summaries import count
from jounce.reporting.text.tables import Table, number, table, vector
from jounce.units.instants import time_text


class EquilibriumFacts(TypedDict):
    """The equilibrium of a mechanism."""

    time: float
    stability: str
    reason: str
    degrees_of_freedom: int
    without: list[str]
    cautions: list[str]
    outputs: dict[str, list[float]]


class ModeFacts(TypedDict):
    """One mode; frequencies in Hz, the eigenvalue in 1/s."""

    mode: int
    kind: str
    frequency: float
    damped_frequency: float
    damping_ratio: float
    eigenvalue: list[float]
    moves_most: str
    share: float


class ModesFacts(TypedDict):
    """An equilibrium, unless the mechanism is in motion, and the modes about it."""

    title: str
    file: str
    equilibrium: EquilibriumFacts | None
    coordinates: list[str]
    modes: list[ModeFacts]


def modes_facts(model: Linearization, file: str | PathLike[str], without: list[str]) -> ModesFacts:
    """Return the facts of a mechanism in equilibrium or in motion, and of its modes."""
    rest = model.equilibrium
    modes: Any = [{**row, "eigenvalue": [row["eigenvalue"].real, row["eigenvalue"].imag]} for row in model.modes.rows]
    return {
        "title": model.mechanism.title,
        "file": str(file),
        "equilibrium": None if rest is None else equilibrium_facts(rest, without),
        "coordinates": list(model.coordinates),
        "modes": modes,
    }


def equilibrium_facts(rest: Equilibrium, without: list[str]) -> EquilibriumFacts:
    """Return the facts of an equilibrium, with the components of outputs one after the other."""
    return {
        "time": rest.time,
        "stability": rest.stability,
        "reason": rest.reason,
        "degrees_of_freedom": rest.degrees_of_freedom,
        "without": without,
        "cautions": list(rest.cautions),
        "outputs": {name: np.ravel(values).tolist() for name, values in rest.outputs.items()},
    }


def equilibrium_words(facts: EquilibriumFacts) -> str:
    """Describe the equilibrium of a mechanism, and whether it is stable."""
    freedom = count(facts["degrees_of_freedom"], "degree of freedom", "degrees of freedom")
    freed = f" without {', '.join(facts['without'])}" if facts["without"] else ""
    lines = [
        f"equilibrium at t = {time_text(facts['time'])} s{freed}: {facts['stability']} ({facts['reason']})",
        freedom,
    ]
    return "\n".join([*lines, *(f"caution: {caution}" for caution in facts["cautions"])])


def equilibrium_tables(rest: Equilibrium) -> list[Table]:
    """Return the tables of the poses of bodies and the values of outputs."""
    attitude = "angle/rad" if rest.mechanism.space == "planar" else "quaternion"
    key = "angle" if rest.mechanism.space == "planar" else "orientation"
    bodies = [
        [name, vector(pose["position"].tolist()), vector(np.ravel(pose[key]).tolist())]
        for name, pose in rest.poses.items()
    ]
    outputs = [
        [name, vector(np.ravel(values).tolist()), rest.mechanism.outputs[name].unit]
        for name, values in rest.outputs.items()
    ]
    tables = [
        table("Bodies, at rest", ("body", "position/m", attitude), bodies),
        table("Outputs", ("output", "value", "unit"), outputs),
    ]
    return [each for each in tables if each.rows]


def modes_table(modes: Modes) -> Table:
    """Return the table of frequencies, damping and largest motions, one row for each mode."""
    rows = []
    for row in modes.rows:
        swings, rate = row["kind"] == "oscillation" or row["damped_frequency"] > 0, abs(row["eigenvalue"].real)
        kind = "" if row["kind"] == "oscillation" else row["kind"].replace("rigid", "free")
        rows.append(
            [
                str(row["mode"]),
                number(row["frequency"]) if swings or row["kind"] == "rigid" else "-",
                number(row["damping_ratio"]) if swings else "-",
                "" if rate <= 1e-12 * abs(row["eigenvalue"]) or not rate else number(1 / rate),
                f"{row['moves_most']}, {100 * row['share']:.0f} %",
                kind,
            ]
        )
    headings = ("mode", "frequency/Hz", "damping ratio", "time constant/s", "moves most", "")
    return table("Modes", headings, rows, (0, 1, 2, 3))


def write_modes(modes: Modes, space: str, path: str | PathLike[str], *, overwrite: bool = False) -> None:
    """Write eigenvalues and mode shapes to a .csv file, one row for each mode, atomically.

    A coordinate of a body has two columns, ``BODY.x_re`` and ``BODY.x_im``; the largest coordinate of each mode has the
    magnitude 1 and no imaginary part. Displacements of the origin are in m, rotations in rad.
    """
    names = [f"{body}.{column}" for body in modes.bodies for column in COLUMNS[space]]
    head = ["mode", "frequency_hz", "damping_ratio", "eigenvalue_re", "eigenvalue_im"]
    with replacing(Path(path), overwrite=overwrite) as scratch, scratch.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*head, *(f"{name}_{part}" for name in names for part in ("re", "im"))])
        for row, shape in zip(modes.rows, modes.body_shapes.reshape(len(modes), -1), strict=True):
            shape = shape / shape[np.argmax(np.abs(shape))]
            value = row["eigenvalue"]
            numbers = [row["frequency"], row["damping_ratio"], value.real, value.imag]
            numbers += [x for entry in shape.tolist() for x in (entry.real, entry.imag)]
            writer.writerow([row["mode"], *(f"{x:.17g}" for x in numbers)])
