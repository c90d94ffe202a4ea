"""What others wrote, or changed, into files of results: read for what it says, or refused by its name."""

import io
import warnings

import h5py
import numpy as np
import pytest
import xarray

from jounce.errors import OutputError
from jounce.io import read, write
from tests.fuzz.forks import forked


def table(folder, text):
    path = folder / "motion.csv"
    path.write_text(text, encoding="utf-8")
    return path


def netcdf(folder, edit):
    """Return a good file in which something was changed."""
    time = np.linspace(0.0, 1.0, 5)
    values = ("time", "derivative"), np.stack([time, np.ones(5)], axis=1)
    write(xarray.Dataset({"psi": values}, {"time": time, "derivative": [0, 1]}), folder / "good.nc")
    stream = io.BytesIO((folder / "good.nc").read_bytes())
    with h5py.File(stream, "r+") as file:
        edit(file)
    (folder / "edited.nc").write_bytes(stream.getvalue())
    return folder / "edited.nc"


def test_the_heading_says_the_unit_of_time_too(tmp_path):
    found = read(table(tmp_path, "time [ms],psi\n0,1\n20,2\n"))
    assert found["time"].attrs["units"] == "ms"
    assert found["time"].values.tolist() == [0, 20]
    assert read(table(tmp_path, "time,psi\n0,1\n"))["time"].attrs["units"] == "s"


@pytest.mark.parametrize(
    "header, names",
    [
        ("time,C_x,C_y,D,C", {"C_x", "C_y", "D", "C"}),
        ("time,C,D,C_x,C_y", {"C", "D", "C_x", "C_y"}),
        ("time,C_x [mm],C_y [mm],C_alpha,C_beta,C_gamma", {"C", "C_alpha", "C_beta", "C_gamma"}),
        ("time,C_x,C_y,D_x,D_y,D_z", {"C", "D_x", "D_y", "D_z"}),
        ("time,C_x,C_y,C_z,D_x,D_y", {"C", "D_x", "D_y"}),
    ],
)
def test_no_column_is_lost(tmp_path, header, names):
    """A vector takes no other output's name, and all have as many components as the first."""
    count = len(header.split(","))
    found = read(table(tmp_path, f"{header}\n{','.join(map(str, range(count)))}\n"))
    assert set(found.data_vars) == names
    kept = np.concatenate([variable.values.ravel() for variable in found.data_vars.values()])
    assert sorted(kept.tolist()) == list(range(1, count))


@pytest.mark.parametrize(
    "text, words",
    [
        ("time,derivative\n0,1\n", "motion.csv, line 1, derivative: the column has the name of an axis"),
        ("time,C_x,C_y,component\n0,1,2,3\n", "motion.csv, line 1, component: the column has the name of an axis"),
        ("time,psi,psi\n0,1,2\n", "motion.csv, line 1: names a column twice, got 'psi'"),
        ("time,psi\n0,1\n1,1_5\n", "motion.csv, line 3, psi: must be a number, got '1_5'"),
        ("time,psi\n0,1\n\n", "motion.csv, line 3: must have 2 entries, got 0"),
        ('time,"psi\n0,1\n', "motion.csv, line 2: cannot be read: unexpected end of data"),
        ("time,psi\n", "motion.csv: is not a table of results: it has no instants"),
    ],
)
def test_what_is_wrong_with_a_table_is_said_with_its_line(tmp_path, text, words):
    with pytest.raises(OutputError) as caught:
        read(table(tmp_path, text))
    assert words in str(caught.value)


def test_a_table_that_a_spreadsheet_saved(tmp_path):
    assert read(table(tmp_path, "\ufefftime,psi\r\n0,1\r\n"))["psi"].values.tolist() == [[1.0]]


def test_a_unit_that_is_none_of_mechanics_is_kept(tmp_path):
    found = read(table(tmp_path, "time [s],T [degC]\n0,20\n"))
    write(found, tmp_path / "again.csv")
    assert (tmp_path / "again.csv").read_text() == "time [s],T [degC]\n0,20\n"


def external_array(file):
    del file["psi"]
    file.create_dataset("psi", (5, 2), "f8", external=[("/dev/zero", 0, 80)])


def virtual_array(file):
    layout = h5py.VirtualLayout((5, 2), "f8")
    layout[:] = h5py.VirtualSource("other.nc", "psi", (5, 2))
    del file["psi"]
    file.create_virtual_dataset("psi", layout)


def external_link(file):
    file["other"] = h5py.ExternalLink("other.nc", "/psi")


@pytest.mark.parametrize("edit", [external_array, virtual_array, external_link])
def test_what_names_other_files_is_refused(tmp_path, edit):
    words = r"edited\.nc: .*(psi|other) is in another file, and no others are opened"
    with forked(), pytest.raises(OutputError, match=words):
        read(netcdf(tmp_path, edit))


def test_attributes_of_others_change_no_numbers_and_cause_no_warnings(tmp_path):
    def edit(file):
        file["time"].attrs["units"] = "days since 0001-01-01"
        file["psi"].attrs["missing_value"] = -1.0
        file["psi"].attrs["scale_factor"] = 1e308

    with forked(), warnings.catch_warnings(), np.errstate(all="raise"):
        warnings.simplefilter("error")
        found = read(netcdf(tmp_path, edit))
    assert found["time"].values.tolist() == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert found["psi"].values[:, 1].tolist() == [1e308] * 5
