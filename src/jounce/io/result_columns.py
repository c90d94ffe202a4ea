"""Results as columns of a table, with a name for each component and derivative, and tables as results."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from jounce.errors import OutputError
from jounce.mechanism import EulerAnglesOutput, EulerParametersOutput, RotationMatrixOutput
from jounce.units.shown_units import derivative_unit, time_axes

if TYPE_CHECKING:
    import xarray

SUFFIXES = (".csv", ".nc")  # endings of result files
ALONG = ("time", "angle", "point")  # dimension along the rows of a table: of a motion, of a cam, or of a curve
CURVE_AXES = ("arc_length", "driver_value")  # first columns of a curve of configurations
AXES = {  # dimensions of outputs with several components, and the labels of the components
    ("component",): ("x", "y", "z"),
    ("euler_parameter",): EulerParametersOutput.labels,
    ("euler_angle",): EulerAnglesOutput.labels,
    ("row_axis", "column_axis"): RotationMatrixOutput.labels,
}


def columns(dataset: xarray.Dataset) -> dict[str, Float[np.ndarray, " time"]]:
    """Return the columns of the table of a dataset, by name, each of shape (time,).

    Raises
    ------
    OutputError
        If two columns have the same name, or an output has the name of a derivative of another, so that `read` could
        not distinguish them.
    """
    from xarray import Variable

    dimension = next(name for name in ALONG if name in dataset.dims)
    first = (name for name in CURVE_AXES if name in dataset.coords) if dimension == "point" else (dimension,)
    columns_found = {name: np.asarray(dataset[name], float) for name in first}
    for name, variable in dataset.data_vars.items():
        if variable.dims == (dimension,) and dimension == "angle":
            columns_found[str(name)] = np.asarray(variable, float)
        axes = tuple(dim for dim in variable.dims if dim not in (dimension, "derivative"))
        if not {dimension, "derivative"} <= set(variable.dims) or (axes and axes not in AXES):
            continue
        parts: list[tuple[str, Any]] = [(str(name), variable)]
        if axes:
            labels = [
                "".join(map(str, columns_found))
                for columns_found in itertools.product(*(variable[a].values for a in axes))
            ]
            flat = variable.transpose(*axes, "derivative", dimension)
            matrix = flat.values.reshape(-1, *flat.shape[-2:])
            dims = ("derivative", dimension)
            parts = [(f"{name}_{label}", Variable(dims, part)) for label, part in zip(labels, matrix, strict=True)]
        for stem, part in parts:
            values = part.transpose("derivative", dimension).values
            for order, row in zip(dataset["derivative"].values, values, strict=True):
                column = f"{stem}_d{order}" if order else stem
                if column in columns_found:
                    raise OutputError(f"two outputs make a column of the same name, '{column}'")
                columns_found[column] = np.asarray(row, float)
    if dimension == "time" and _derivative_count(list(columns_found)[1:]) > dataset.sizes.get("derivative", 1):
        conflicting = next(name for name in columns_found if re.search("_d[0-9]+$", name))
        raise OutputError(
            f"the output '{conflicting}' reads as a derivative in a table; give it another name, or write .nc"
        )
    return columns_found


def column_units(dataset: xarray.Dataset, names: Iterable[str]) -> list[str | None]:
    """Return the units of columns of a table; None where a unit is unknown."""
    units = []
    for name in names:
        stem, order = re.fullmatch(r"(.*?)(?:_d([0-9]+))?", name, re.DOTALL).groups()  # type: ignore[union-attr]
        holder = next((n for n in (name, stem, stem.rpartition("_")[0]) if n in dataset.variables), None)
        unit = dataset[holder].attrs.get("units") if holder is not None else None
        unit = "s" if unit is None and name == "time" else unit
        if unit and order and CURVE_AXES[0] in dataset.coords:
            unit = None  # derivatives of a curve are with respect to arc length
        units.append(derivative_unit(unit, int(order or 0)) if unit else None)
    return units


def dataset_of(header: list[str], table: Float[np.ndarray, "time columns"], units: dict[str, str]) -> xarray.Dataset:
    """Return the dataset of a table; columns with different units do not form one vector.

    Raises
    ------
    OutputError
        If a column has the name of an axis.
    """
    import xarray

    levels = _derivative_count(header[1:])
    stems = {header[k]: list(table.T[k : k + levels]) for k in range(1, len(header), levels)}
    variables: dict[str, Any] = {}
    coordinates = time_axes(table[:, 0], levels)
    if "time" in units:
        coordinates["time"][2]["units"] = units["time"]
    for (name, _), group in itertools.groupby(stems, lambda column: (_name_of(column), units.get(column))):
        members = list(group)
        axes, labels = _axes_of(name, members, len(coordinates.get("component", ())))
        unit = {"units": units[members[0]]} if members[0] in units else {}
        if not axes or name in stems or name in variables:  # columns that do not form one output
            variables |= {x: (("time", "derivative"), np.stack(stems[x], axis=1), dict(unit)) for x in members}
            continue
        values = np.stack([np.stack(stems[member], axis=1) for member in members], axis=2)
        sizes = (len(members),) if len(axes) == 1 else (3, 3)
        variables[name] = (("time", "derivative", *axes), values.reshape(*values.shape[:2], *sizes), unit)
        coordinates |= {axis: list(labels if len(axes) == 1 else AXES[("component",)]) for axis in axes}
    if conflicting := [name for name in variables if name in coordinates]:
        raise OutputError("the column has the name of an axis; give it another", name=conflicting[0])
    return xarray.Dataset(variables, coords=coordinates)


def _axes_of(name: str, members: list[str], components: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the axes of neighboring columns that form one output, and the labels along them; empty if they form none.

    All vectors have as many components as the first one; other groups are separate outputs.
    """
    for axes, labels in AXES.items():
        for count in (2, 3) if axes == ("component",) else (len(labels),):
            fits = axes != ("component",) or components in (0, count)
            if fits and members == [f"{name}_{label}" for label in labels[:count]]:
                return axes, labels[:count]
    return (), ()


def _derivative_count(columns: list[str]) -> int:
    """Return the number of columns of each quantity: its value and its derivatives, consecutive and equally many.

    The name of a quantity may itself look like that of a derivative.
    """
    for count in range(len(columns), 1, -1):
        starts = range(0, len(columns), count) if len(columns) % count == 0 else ()
        if starts and all(columns[k + j] == f"{columns[k]}_d{j}" for k in starts for j in range(1, count)):
            return count
    return 1


def _name_of(column: str) -> str:
    """Return the name of the output of which a column may be a component."""
    stem, _, label = column.rpartition("_")
    return stem if stem and any(label in labels for labels in AXES.values()) else column
