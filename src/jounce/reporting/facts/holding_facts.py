"""Facts and a table of the driver forces that hold a mechanism at rest, over all positions of a motion."""

from __future__ import annotations

import csv
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from typing_extensions import TypedDict

from jounce.io.files.writing import replacing
from jounce.reporting.text.tables import Table, table
from jounce.units.instants import time_text
from jounce.units.shown_units import ShownUnits

if TYPE_CHECKING:
    import xarray

STAYS = {True: "everywhere", False: "nowhere", None: "in places"}


class HoldingFacts(TypedDict):
    """The least and the greatest force or torque of a driver that hold the mechanism at rest in the positions of a
    motion, None if infinite or unknown; the instants of these positions, s; whether friction locks in one direction;
    and whether the mechanism stays at rest without the driver, None if it does in some positions only.
    """

    driver: str
    unit: str
    least: float | None
    least_at: float | None
    greatest: float | None
    greatest_at: float | None
    locks: bool
    self_locking: bool | None
    remark: str


def holding_facts(dataset: xarray.Dataset) -> list[dict[str, Any]]:
    """Return the range of forces with which each driver holds a mechanism at rest, over a motion: HoldingFacts.

    Parameters
    ----------
    dataset : xarray.Dataset
        Result of `jounce.dynamics.holding_forces`.

    Examples
    --------
    >>> import jounce as jn
    >>> jack = jn.load("examples/screw_jack.yaml")
    >>> (crank,) = holding_facts(jn.dynamics.holding_forces(jn.solve(jack, [0.0], order=0)))
    >>> crank["driver"], crank["unit"], round(crank["least"], 2), round(crank["greatest"], 2), crank["self_locking"]
    ('crank', 'N*m', -148.37, 97.69, True)
    """
    return [_of_driver(str(name), dataset[name], dataset["time"].values) for name in dataset.data_vars]


def write_holding(dataset: xarray.Dataset, path: str | PathLike[str], *, overwrite: bool = False) -> None:
    """Write the forces that hold a mechanism at rest to a .csv file, one row for each position, atomically.

    A driver has three columns, ``DRIVER_least``, ``DRIVER_frictionless`` and ``DRIVER_greatest``, N m or N. Values are
    ``inf`` if friction locks in that direction, and ``nan`` if unknown.
    """
    names = [f"{name}_{bound}" for name in dataset.data_vars for bound in dataset["bound"].values.tolist()]
    values = np.concatenate([dataset[name].values for name in dataset.data_vars], axis=1)
    with replacing(Path(path), overwrite=overwrite) as scratch, scratch.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["time", *names])
        for instant, row in zip(dataset["time"].values.tolist(), values.tolist(), strict=True):
            writer.writerow([f"{x:.17g}" for x in (instant, *row)])


def _of_driver(name: str, array: Any, time: np.ndarray) -> dict[str, Any]:
    least, greatest = array.sel(bound="least").values, array.sel(bound="greatest").values
    defined = ~np.isnan(least) & ~np.isnan(greatest)
    holds = (least <= 0) & (greatest >= 0)
    facts: dict[str, Any] = {"driver": name, "unit": array.attrs["units"]}
    for key, values, extreme in (("least", least, np.nanargmin), ("greatest", greatest, np.nanargmax)):
        lane = int(extreme(values)) if defined.any() else None
        facts[key] = None if lane is None or not np.isfinite(values[lane]) else float(values[lane])
        facts[f"{key}_at"] = None if lane is None else float(time[lane])
    facts["locks"] = bool(np.isinf(least[defined]).any() or np.isinf(greatest[defined]).any())
    all_hold, any_holds = bool(defined.any() and holds[defined].all()), bool(holds[defined].any())
    facts["self_locking"] = all_hold if all_hold == any_holds else None
    return facts | {"remark": array.attrs.get("comment", "")}


def holding_table(facts: list[dict[str, Any]], units: ShownUnits) -> Table:
    """Return the table of forces that hold a mechanism at rest, one row for each driver, in the shown units."""
    rows = []
    for fact in facts:
        unit, factor = units.of(fact["unit"], fact["driver"])
        bounds = [
            [_number(fact, key, factor), "" if fact[f"{key}_at"] is None else time_text(fact[f"{key}_at"], 5)]
            for key in ("least", "greatest")
        ]
        rows.append([fact["driver"], unit, *bounds[0], *bounds[1], STAYS[fact["self_locking"]], fact["remark"]])
    headings = ("driver", "unit", "least", "at t/s", "greatest", "at t/s", "stays by itself", "remark")
    return table("Held at rest by", headings, rows, (2, 3, 4, 5))


def _number(facts: dict[str, Any], key: str, factor: float) -> str:
    if facts[key] is not None:
        return f"{facts[key] * factor:.6g}"
    return "infinite" if facts["locks"] and facts[f"{key}_at"] is not None else "-"
