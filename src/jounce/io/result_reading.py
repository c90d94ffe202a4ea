"""Reading of result files: a dataset, or an error that names the file and the fault."""

from __future__ import annotations

import csv
import io
import warnings
from collections import Counter
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jounce.errors import OutputError
from jounce.io.files.column_units import name_and_unit
from jounce.io.files.reading import bad_line, is_result, known_name, name_of, read_file
from jounce.io.hdf5_check import LONGEST, check_readable
from jounce.io.result_columns import SUFFIXES, dataset_of
from jounce.settings import under_own_settings

if TYPE_CHECKING:
    import xarray


@under_own_settings
def read(path: str | PathLike[str]) -> xarray.Dataset:
    r"""Read a file from `write` into a dataset; values are exact.

    A CSV file may state units in its heading, which become those of the variables; values are not converted. It does
    not state vectors: neighboring columns ``NAME_x, NAME_y`` (and ``NAME_z``) of one unit become the vector NAME, and
    columns of Euler parameters, Euler angles and rotation matrices are joined in the same way.

    Returns
    -------
    xarray.Dataset
        Dataset in memory, with dimensions time, derivative, and those of components.

    Raises
    ------
    OutputError
        If the file cannot be read, or is no result file.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from jounce import io
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "motion.csv")
    ...     count = path.write_text("time,psi [deg],psi_d1 [deg/s]\n0,30,2\n0.1,30.2,2\n")
    ...     motion = io.read(path)
    >>> motion["psi"].values.tolist(), motion["psi"].attrs["units"]
    ([[30.0, 2.0], [30.2, 2.0]], 'deg')
    """
    name = name_of(path, OutputError)
    suffix = Path(name).suffix.lower()
    if suffix not in SUFFIXES:
        raise OutputError(f"the kind of results is given by the extension; valid: {', '.join(SUFFIXES)}", path=name)
    content = read_file(name, None, error=OutputError, is_input=False)
    return _dataset(content, name) if suffix == ".nc" else _table(content, name)


def _dataset(content: bytes, path: str) -> xarray.Dataset:
    """Return the dataset of a NetCDF file, after a check by another process unless this process wrote the file."""
    import xarray

    if not is_result(path):
        check_readable(content, path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # from xarray, about its decoding of attributes that others wrote
            return xarray.load_dataset(io.BytesIO(content), engine="h5netcdf", decode_times=False)
    except Exception as error:  # noqa: BLE001 - various errors of the libraries
        message = ascii(f"{type(error).__name__}: {error}"[:LONGEST])[1:-1]
        raise OutputError(f"is damaged, or is not a file of results: {message}", path=path) from None


def _table(content: bytes, path: str) -> xarray.Dataset:
    """Return the dataset of a CSV file."""
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise OutputError("is not text in UTF-8", path=path, line=bad_line(content)) from None
    lines = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        header, units = _named_columns(next(lines, []))
        if header[:1] != ["time"]:
            raise OutputError("is not a table of results, whose first column is time", path=path)
        if repeated := [column for column, count in Counter(header).items() if count > 1]:
            raise OutputError("names a column twice", path=path, line=1, value=repeated[0])
        rows = [_numbers(row, header, path, lines.line_num) for row in lines]
    except csv.Error as error:
        raise OutputError(f"cannot be read: {error}", path=path, line=lines.line_num) from None
    if not rows:
        raise OutputError("is not a table of results: it has no instants", path=path)
    try:
        return dataset_of(header, np.array(rows), units)
    except OutputError as error:
        raise error.located(path=path, line=1) from None


def _numbers(row: list[str], header: list[str], path: str, line: int) -> list[float]:
    """Return the numbers of a row; 1_5 is no number, although Python reads it as 15."""
    if len(row) != len(header):
        raise OutputError(f"must have {len(header)} entries", path=path, line=line, value=len(row))
    try:
        if "_" not in "".join(row):
            return [float(entry) for entry in row]
    except ValueError:
        pass
    name, entry = next((name, entry) for name, entry in zip(header, row, strict=True) if not _is_number(entry))
    raise OutputError("must be a number", path=path, line=line, name=name, value=entry)


def _is_number(entry: str) -> bool:
    try:
        float(entry)
    except ValueError:
        return False
    return "_" not in entry


def _named_columns(header: list[str]) -> tuple[list[str], dict[str, str]]:
    """Return the names of columns, and the units of those that state one."""
    pairs = [name_and_unit(known_name(entry)) for entry in header]
    return [name for name, _ in pairs], {name: unit for name, unit in pairs if unit is not None}
