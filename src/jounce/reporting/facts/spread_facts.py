"""Facts of a tolerance analysis: the largest spread of each column, and the parameters that cause it."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from jounce.reporting.peaks import derivative_unit
from jounce.reporting.text.tables import Table, number

if TYPE_CHECKING:
    import xarray

Column = tuple[str, str, int]
"""An output, a component or an empty string, and a derivative."""


def columns_of(spread: xarray.Dataset, selection: Sequence[Column] | None) -> list[Column]:
    """Return the requested columns, one for each component; by default all columns of the outputs."""
    outputs = [str(name) for name in spread.data_vars if f"{name}_peak" in spread.data_vars]
    levels = [int(order) for order in spread["derivative"].values]
    if selection is None:
        return [(name, label, order) for name in outputs for label in _labels(spread[name]) for order in levels]
    columns = [
        (name, label, order)
        for name, component, order in selection
        for label in _labels(spread[name])
        if component in ("", label)
    ]
    return list(dict.fromkeys(columns))


def _labels(values: xarray.DataArray) -> list[str]:
    """Return the labels of the components of an output; an empty one for a scalar."""
    axes = [dim for dim in values.dims if dim not in ("time", "derivative", "parameter")]
    return ["".join(map(str, x)) for x in itertools.product(*(values[axis].values for axis in axes))]


def spread_facts(spread: xarray.Dataset, columns: Sequence[Column]) -> dict[str, Any]:
    """Return the facts of a spread."""
    names = [str(name) for name in spread["parameter"].values]
    deviations = dict(zip(names, spread["deviation"].values.tolist(), strict=True))
    solved = spread["solved"].values.tolist() if "solved" in spread else None
    rows = [_facts(spread, column, names) for column in columns]
    return {"deviations": deviations, "solved": None if solved is None else min(solved), "spread": rows}


def _facts(spread: Any, column: Column, names: Sequence[str]) -> dict[str, Any]:
    """Return the facts of a column at the instant of its largest spread."""
    name, component, order = column

    def of(kind: str) -> np.ndarray | None:
        return chosen(spread, f"{name}_{kind}", column) if f"{name}_{kind}" in spread else None

    widest = of("std")
    widest = of("linear_std") if widest is None else widest
    index = 0 if widest is None or np.isnan(widest).all() else int(np.nanargmax(widest))
    facts: dict[str, Any] = {
        "output": f"{name}_{component}" if component else name,
        "derivative": order,
        "unit": derivative_unit(spread[name].attrs["units"], order),
        "at": float(spread["time"].values[index]),
        "nominal": float(chosen(spread, name, column)[index]),
    }
    for kind in ("linear_std", "std", "low", "high"):
        values = of(kind)
        facts[kind] = None if values is None else float(values[index])
    for kind in ("peak", "peak_mean", "peak_std", "peak_low", "peak_high"):
        values = of(kind)
        facts[kind] = None if values is None else float(values)
    share = of("share")
    facts["share"] = None if share is None else dict(zip(names, share[:, index].tolist(), strict=True))
    for kind in ("first_order", "total_order"):
        values = of(f"peak_{kind}")
        facts[f"peak_{kind}"] = None if values is None else dict(zip(names, values.tolist(), strict=True))
    return facts


def chosen(spread: xarray.Dataset, variable: str, column: Column) -> np.ndarray:
    """Return the values of a variable for a column: over time, for each parameter, or a single one."""
    _, component, order = column
    data = spread[variable].sel(derivative=order)
    axes = [dim for dim in data.dims if dim not in ("time", "parameter")]
    labels = _labels(data)
    dims = [dim for dim in ("parameter", "time") if dim in data.dims]
    values = data.transpose(*axes, *dims).values
    return np.asarray(values.reshape(-1, *values.shape[len(axes) :])[labels.index(component)])


def spread_summary(facts: dict[str, Any], name: str, samples: int) -> str:
    """Return the summary of a tolerance analysis: the variations, and the number of solved designs."""
    parts = [f"{key} {number(value)}" for key, value in facts["deviations"].items()]
    lines = [f"{name}: standard deviations (SI) {', '.join(parts)}"]
    if samples:
        solved = facts["solved"]
        note = (
            "all were solved"
            if solved == samples
            else f"at some instants only {solved} were solved, the rest is left out"
        )
        lines.append(f"  {samples} designs, of which {note}")
    return "\n".join(lines)


def spread_table(facts: dict[str, Any]) -> Table:
    """Return a table of the largest spread of each column, with the shares of the parameters."""
    rows = []
    for x in facts["spread"]:
        numbers = [number(x[key]) for key in ("at", "nominal", "linear_std", "std", "low", "high")]
        rows.append([x["output"], str(x["derivative"]), x["unit"], *numbers, _causes(x["share"])])
    numbers = ("widest at t/s", "nominal", "std, linear", "std", "2.5 %", "97.5 %")
    headings = ("output", "derivative", "unit", *numbers, "caused by")
    return Table("", headings, rows, (1, 3, 4, 5, 6, 7, 8), True)


def index_table(facts: dict[str, Any]) -> Table:
    """Return a table of the Sobol indices of the peaks."""
    rows = []
    for x in facts["spread"]:
        first, total = x["peak_first_order"], x["peak_total_order"]
        cells = [f"{name} {number(round(first[name], 4))} / {number(round(total[name], 4))}" for name in first]
        rows.append([x["output"], str(x["derivative"]), number(x["peak"]), number(x["peak_std"]), ", ".join(cells)])
    return Table(
        "Peaks", ("output", "derivative", "nominal", "std", "index of first order / total"), rows, (1, 2, 3), True
    )


def _causes(share: dict[str, float] | None) -> str:
    """Return the shares of the variance in words, the largest first, without those below half a percent."""
    if share is None:
        return "-"
    ordered = sorted(share.items(), key=lambda item: -item[1])
    return ", ".join(f"{name} {100 * part:.0f} %" for name, part in ordered if part >= 0.005) or "-"
