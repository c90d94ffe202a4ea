"""Equations along a motion as tables: one column for each entry and order."""

import itertools
import json
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import xarray


def columns(equations: "xarray.Dataset") -> "xarray.Dataset":
    """Return the equations of `constraint_equations` with one variable for each column of a table.

    A name consists of the quantity, the order of the derivative if there are several, and the labels:
    ``residual.A.1``, ``jacobian.A.1.crank.x``, ``right_side_2.A.1``, ``multipliers_0.A.1``. Values that are NaN at all
    instants have no column.
    """
    import xarray

    columns: dict[str, Any] = {}
    for name, variable in equations.data_vars.items():
        axes = [axis for axis in variable.dims if axis != "time"]
        for labels in itertools.product(*(variable[axis].values.tolist() for axis in axes)):
            label_of = dict(zip(axes, labels, strict=True))
            order = f"_{label_of['derivative']}" if "derivative" in label_of else ""
            labels_left = [str(label) for axis, label in label_of.items() if axis != "derivative"]
            values = np.asarray(variable.sel(label_of), float)
            if len(values) and np.isnan(values).all() and not np.isnan(np.asarray(equations.residual)).all():
                continue
            columns[".".join([f"{name}{order}", *labels_left])] = (("time", "derivative"), values[:, None])
    return xarray.Dataset(columns, {"time": equations["time"], "derivative": [0]}, equations.attrs)


def as_json(equations: "xarray.Dataset") -> str:
    """Return the equations of `constraint_equations` as JSON: dimensions, their labels, and arrays, NaN as null."""
    labels = {str(name): axis.values.tolist() for name, axis in equations.coords.items()}
    arrays = {
        str(name): {"dimensions": list(map(str, variable.dims)), "values": _plain(variable.values)}
        for name, variable in equations.data_vars.items()
    }
    return json.dumps({"title": equations.attrs.get("title", ""), **labels, **arrays}, allow_nan=False, indent=1) + "\n"


def _plain(values: np.ndarray) -> Any:
    objects = values.astype(object)
    objects[np.isnan(values)] = None
    return objects.tolist()
