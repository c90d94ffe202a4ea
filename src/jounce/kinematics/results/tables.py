"""Results as xarray data sets with a variable and a unit for each derivative, and as pandas tables."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from jounce.base.display import Displayed
from jounce.errors import MechanismError, check_choice
from jounce.units.shown_units import derivative_unit

if TYPE_CHECKING:
    import pandas
    import xarray

FORMS = ("stacked", "split")


class Tabulated(Displayed):
    """Base of results with a `dataset` that has the dimensions time and derivative."""

    __slots__ = ()
    dataset: Any

    def to_dataset(self, derivatives: str = "stacked") -> xarray.Dataset:
        """Return the results as an `xarray.Dataset` that states the unit of each derivative.

        Parameters
        ----------
        derivatives : {"stacked", "split"}, default "stacked"
            "stacked" keeps the dimension ``derivative``, whose coordinate ``derivative_unit`` is the factor by which
            the unit of a variable is multiplied at each derivative. "split" makes a variable for each derivative, such
            as ``psi``, ``psi_d1`` and ``psi_d2``, with its own unit, which `pint-xarray` can read.

        Returns
        -------
        xarray.Dataset
            SI; units in the attributes ``units``.

        Raises
        ------
        MechanismError
            If `derivatives` is neither.

        Examples
        --------
        >>> import jounce as jn
        >>> motion = jn.solve(jn.load("examples/four_bar.yaml"), [0.0, 0.1], order=2)
        >>> split = motion.to_dataset(derivatives="split")
        >>> list(split), split["psi_d2"].attrs["units"]
        (['psi', 'psi_d1', 'psi_d2', 'C', 'C_d1', 'C_d2'], 'rad/s^2')
        """
        check_choice("form", derivatives, FORMS, MechanismError, name="derivatives")
        dataset = self.dataset
        if derivatives == "split":
            parts = {
                f"{name}_d{order}" if order else name: part for name, order, part in _by_derivative(dataset)
            }  # coordinates go with the parts
            return dataset.drop_dims("derivative").assign(parts)
        units = [derivative_unit("1", int(order)) for order in dataset["derivative"].values]
        return dataset.assign_coords(derivative_unit=("derivative", units))

    def to_dataframe(self) -> pandas.DataFrame:
        """Return the results as a `pandas.DataFrame` whose columns have two levels, name and unit.

        The names are those of the columns of CSV files: ``psi``, ``psi_d1``, ``C_x``, ``C_x_d1``, ... With pint-pandas,
        ``frame.pint.quantify(level=-1)`` reads the units.

        Returns
        -------
        pandas.DataFrame
            SI, a row for each instant.

        Examples
        --------
        >>> import jounce as jn
        >>> frame = jn.solve(jn.load("examples/four_bar.yaml"), [0.0, 0.1], order=1).to_dataframe()
        >>> frame.columns.tolist()[:3], frame.index.name
        ([('psi', 'rad'), ('psi_d1', 'rad/s'), ('C_x', 'm')], 'time')
        """
        import pandas

        columns: dict[tuple[str, str], Float[np.ndarray, " time"]] = {}
        positions: dict[tuple[str, str], tuple[int, ...]] = {}  # sort keys: derivatives follow their component
        variables = list(self.dataset)
        for name, order, part in _by_derivative(self.dataset):
            suffix, unit = f"_d{order}" if order else "", part.attrs["units"]
            axes = [axis for axis in part.dims if axis != "time"]
            values = part.transpose("time", *axes).values.reshape(part.sizes["time"], -1)
            for k, label in enumerate(itertools.product(*(part[axis].values for axis in axes))):
                key = f"{name}_{''.join(map(str, label))}{suffix}" if label else f"{name}{suffix}", unit
                columns[key], positions[key] = values[:, k], (variables.index(name), k, order)
        ordered = {key: columns[key] for key in sorted(columns, key=positions.__getitem__)}
        names = pandas.MultiIndex.from_tuples(list(ordered), names=["quantity", "unit"])
        index = pandas.Index(self.dataset["time"].values, name="time")
        return pandas.DataFrame(np.column_stack([*ordered.values(), np.zeros((len(index), 0))]), index, names)


def _by_derivative(dataset: xarray.Dataset) -> Iterator[tuple[str, int, xarray.DataArray]]:
    """Yield name, order and values of each available derivative, with its unit."""
    for name, variable in dataset.data_vars.items():
        if "derivative" not in variable.dims:
            continue
        for order in dataset["derivative"].values.tolist():
            part = variable.sel(derivative=order, drop=True)
            if order and np.isnan(part).all() and not np.isnan(variable.sel(derivative=0)).all():
                continue  # the quantity uses up orders and has no derivative this high
            unit = derivative_unit(str(variable.attrs.get("units", "1")), order)
            label = f"derivative {order} of {name}" if order else str(name)
            yield str(name), order, part.assign_attrs(units=unit, long_name=label)
