"""Result files: CSV for spreadsheets, NetCDF 4 with units and names for other programs."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np

from jounce.errors import OutputError
from jounce.io.files.column_units import heading, is_si, names_a_unit
from jounce.io.files.netcdf_parts import NetcdfParts
from jounce.io.files.reading import written_name
from jounce.io.files.writing import check_target, replacing
from jounce.io.result_columns import SUFFIXES, column_units, columns
from jounce.settings import under_own_settings

if TYPE_CHECKING:
    import xarray


class _SourceError(Exception):
    """An error of the source of the parts, not of the writer."""

    def __init__(self, reason: Exception):
        super().__init__()
        self.reason = reason


def check_writable(path: str | PathLike[str], *, overwrite: bool = False) -> None:
    """Raise OutputError unless results can be written to a path; to be called before a long computation.

    Parameters
    ----------
    path
        File ending in .csv or .nc, in an existing folder. An existing file is left unchanged.
    overwrite
        Whether the file may be one that this process has read as an input.

    Raises
    ------
    OutputError
        If the ending is not valid, the folder does not exist, the file is an input, or it cannot be written.
    """
    check_target(path, SUFFIXES, "an output", overwrite=overwrite)


@under_own_settings
def write(
    dataset: xarray.Dataset,
    path: str | PathLike[str],
    *,
    overwrite: bool = False,
    header_units: bool | None = None,
) -> None:
    """Write the dataset of a motion to a .csv or .nc file, atomically.

    A CSV file has the columns ``time``, then for each output ``NAME, NAME_d1, NAME_d2, ...``, and for a vector
    ``NAME_x, NAME_x_d1, ..., NAME_y, ...``: ``_e0`` to ``_e3`` for Euler parameters, ``_alpha``, ``_beta``, ``_gamma``
    for Euler angles, ``_xx``, ``_xy``, ... in rows for a rotation matrix. Numbers have 17 significant digits, so that
    they are read back exactly, and a missing value is ``nan``. A name that spreadsheets would read as a formula, such
    as ``=A1``, gets a leading apostrophe, which `read` removes. A NetCDF 4 file holds the dataset unchanged, by the CF
    conventions.

    Parameters
    ----------
    dataset : xarray.Dataset
        Dataset with dimensions time, derivative, and those of components, as ``Motion.dataset``; a curve of
        configurations, ``Curve.dataset``, has the columns ``arc_length`` and ``driver_value`` instead of ``time``.
    path
        File to write; an existing one is replaced.
    overwrite
        Whether it may be a file that this process has read as an input, such as the samples of a motion law.
    header_units
        Whether the heading of a CSV file states the units, as ``psi_d1 [deg/s]``; by default, if a unit is not SI, or a
        name looks as if it stated a unit, so that the samples are read with the right units.

    Raises
    ------
    OutputError
        If the file cannot be written, or is an input.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import jounce as jn
    >>> from jounce import io
    >>> motion = jn.solve(jn.load("examples/four_bar.yaml"), [0.0, 0.1], order=1)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     io.write(motion.dataset, pathlib.Path(folder, "motion.csv"))
    ...     print(pathlib.Path(folder, "motion.csv").read_text().splitlines()[0])
    time,psi,psi_d1,C_x,C_x_d1,C_y,C_y_d1
    """
    check_writable(path, overwrite=overwrite)
    with replacing(path, overwrite=overwrite) as scratch:
        if Path(fspath(path)).suffix.lower() == ".csv":
            _write_csv(dataset, scratch, header_units)
        else:
            _write_netcdf(dataset, scratch)


@under_own_settings
def write_parts(
    parts: Iterable[xarray.Dataset],
    path: str | PathLike[str],
    count: int,
    *,
    overwrite: bool = False,
    header_units: bool | None = None,
) -> None:
    """Write a dataset given in parts along time to a .csv or .nc file, atomically.

    The file equals that of `write` for the whole dataset.

    Parameters
    ----------
    parts : iterable of xarray.Dataset
        At least one part, each as for `write`, all alike except for their instants; a part is requested when the
        previous one is written.
    path
        File to write; an existing one is replaced.
    count : int
        Number of instants of all parts.
    overwrite
        Whether it may be a file that this process has read as an input.
    header_units
        See `write`.

    Raises
    ------
    OutputError
        If the file cannot be written, or is an input. Errors of the parts themselves are raised unchanged.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import jounce as jn
    >>> from jounce import io
    >>> from jounce.kinematics import solve_in_chunks
    >>> fine = jn.TimeGrid(start=0, stop=2, count=100_001)
    >>> motion = solve_in_chunks(jn.load("examples/four_bar.yaml"), fine, order=0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     io.write_parts((part.dataset for part in motion), pathlib.Path(folder, "motion.nc"), len(motion))
    ...     print(io.read(pathlib.Path(folder, "motion.nc"))["psi"].shape)
    (100001, 1)
    """
    check_writable(path, overwrite=overwrite)
    in_rows = Path(fspath(path)).suffix.lower() == ".csv"
    try:
        with replacing(path, overwrite=overwrite) as scratch:
            if in_rows:
                _put_rows(_counted(parts, count), scratch, header_units)
            else:
                _put_netcdf(_counted(parts, count), scratch, count)
    except _SourceError as error:
        raise error.reason from None


def _counted(parts: Iterable[xarray.Dataset], count: int) -> Iterator[tuple[int, xarray.Dataset]]:
    """Yield the parts with the index of their first instant; raise OutputError unless `count` instants come."""
    first, source = 0, iter(parts)
    while True:
        try:
            part = next(source, None)
        except Exception as error:
            raise _SourceError(error) from error
        if first + (0 if part is None else part.sizes["time"]) > count or (part is None and first < count):
            raise OutputError(f"the parts do not have the {count} instants that were announced")
        if part is None:
            return
        yield first, part
        first += part.sizes["time"]


def _put_rows(parts: Iterator[tuple[int, xarray.Dataset]], path: Path, header_units: bool | None) -> None:
    with path.open("w", newline="", encoding="utf-8") as stream:
        for first, part in parts:
            _write_rows(part, stream, header_units, headed=first == 0)


def _put_netcdf(parts: Iterator[tuple[int, xarray.Dataset]], path: Path, count: int) -> None:
    with path.open("r+b", buffering=0) as stream:
        file: NetcdfParts | None = None
        for first, part in parts:
            file = file or NetcdfParts(stream, _netcdf(part), count)
            file.put(part, first)


def _write_csv(dataset: xarray.Dataset, path: Path, header_units: bool | None) -> None:
    with path.open("w", newline="", encoding="utf-8") as stream:
        _write_rows(dataset, stream, header_units)


def _write_netcdf(dataset: xarray.Dataset, path: Path) -> None:
    path.write_bytes(_netcdf(dataset))


def _write_rows(dataset: xarray.Dataset, stream: TextIO, header_units: bool | None, *, headed: bool = True) -> None:
    """Write a dataset as rows of a CSV file, below a heading with the names of the columns."""
    table = columns(dataset)
    rows = np.stack(list(table.values()), axis=1)
    line = ",".join(["%.17g"] * rows.shape[1]) + "\n"
    if headed:
        units = column_units(dataset, table)
        chosen_units = header_units
        if chosen_units is None:
            chosen_units = not all(map(is_si, units)) or any(map(names_a_unit, table))
        names = [
            heading(name, unit) if chosen_units and unit else name for name, unit in zip(table, units, strict=True)
        ]
        csv.writer(stream, lineterminator="\n").writerow(map(written_name, names))
    for start in range(0, len(rows), 1000):
        stream.writelines(line % tuple(row) for row in rows[start : start + 1000].tolist())


def _netcdf(dataset: xarray.Dataset) -> Any:
    """Return the content of a NetCDF file of a dataset."""
    result = dataset.assign_attrs({"Conventions": "CF-1.11", "history": f"written by jounce {_version()}"})
    for name in (*result.data_vars, *result.coords):
        if "/" in str(name):
            raise OutputError(f"the name '{name}' cannot stand in a NetCDF file, it has a /")
        result[name].encoding = {}
    if "time" in result.coords:
        time_attributes = {"units": "s", "long_name": "time", "standard_name": "time", "axis": "T"}
        result = result.assign_coords(time=result["time"].assign_attrs(time_attributes | result["time"].attrs))
    for holder in (result, *(result[name] for name in result.variables)):
        holder.attrs = {key: _attribute(value) for key, value in holder.attrs.items() if value is not None}
    # in memory: on a full disk, HDF5 does not close its file, prints to standard error, and may end the process
    return result.to_netcdf(engine="h5netcdf", format="NETCDF4")


def _attribute(value: Any) -> Any:
    """Return an attribute in a form that NetCDF can hold."""
    is_plain = isinstance(value, (str, int, float, np.ndarray, np.number)) and not isinstance(value, bool)
    return value if is_plain else str(value)


def _version() -> str:
    from importlib import metadata

    try:
        return metadata.version("jounce")
    except metadata.PackageNotFoundError:
        return "(not installed)"
