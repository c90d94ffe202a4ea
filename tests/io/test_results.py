"""Files of results: whole or absent, and the same to the bit when read back."""

import math

import h5py
import hypothesis
import hypothesis.extra.numpy
import hypothesis.strategies as st
import numpy as np
import pytest
import xarray

from jounce.errors import OutputError
from jounce.io import check_writable, read, write


def dataset(scalar, vector=None):
    """Return a dataset like that of a motion, from arrays (time, derivative) and (time, derivative, component)."""
    variables = {"psi": (("time", "derivative"), scalar, {"units": "rad", "long_name": "psi"})}
    coordinates = {"time": 0.01 * np.arange(len(scalar)), "derivative": np.arange(scalar.shape[1])}
    if vector is not None:
        variables["C"] = (("time", "derivative", "component"), vector, {"units": "m", "long_name": "C"})
        coordinates["component"] = list("xyz"[: vector.shape[2]])
    found = xarray.Dataset(variables, coords=coordinates, attrs={"title": "a test", "source": "jounce"})
    found["time"].attrs = {"units": "s", "long_name": "time"}
    return found


def example(components=2):
    rng = np.random.default_rng(1)
    return dataset(rng.standard_normal((4, 3)), rng.standard_normal((4, 3, components)))


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def same_bits(one, other):
    assert one.dims == other.dims
    np.testing.assert_array_equal(one.values.view(np.int64), other.values.view(np.int64))


any_float = st.floats(width=64, allow_subnormal=True).filter(lambda x: not math.isnan(x)) | st.just(math.nan)
shapes = st.tuples(st.integers(1, 4), st.integers(1, 3))


@hypothesis.given(st.data())
@hypothesis.settings(suppress_health_check=[hypothesis.HealthCheck.function_scoped_fixture])
def test_values_come_back_to_the_bit(tmp_path, data):
    shape = data.draw(shapes)
    components = data.draw(st.integers(2, 3))
    arrays = hypothesis.extra.numpy.arrays
    scalar = data.draw(arrays(np.float64, shape, elements=any_float))
    vector = data.draw(arrays(np.float64, (*shape, components), elements=any_float))
    for suffix in ("csv", "nc"):
        path = tmp_path / f"motion.{suffix}"
        written = dataset(scalar, vector)
        write(written, path)
        found = read(path)
        for name in ("psi", "C", "time"):
            same_bits(found[name], written[name])
        assert list(found["component"].values) == list("xyz"[:components])
        assert list(found["derivative"].values) == list(range(shape[1]))


def test_columns_of_a_table(tmp_path):
    path = tmp_path / "motion.csv"
    write(dataset(np.array([[0.1, math.nan]]), np.array([[[1.0, 2.0, -0.0], [4.0, 1e-7, 1 / 3]]])), path)
    assert path.read_bytes().decode() == (
        "time,psi,psi_d1,C_x,C_x_d1,C_y,C_y_d1,C_z,C_z_d1\n"
        "0,0.10000000000000001,nan,1,4,2,9.9999999999999995e-08,-0,0.33333333333333331\n"
    )


def test_a_column_of_another_unit_is_no_component(tmp_path):
    path = tmp_path / "motion.csv"
    path.write_text("time [s],C_x [mm],C_y [mm],C_z [deg]\n0,1,2,3\n")
    found = read(path)
    assert {name: (x.attrs["units"], x.values.ravel().tolist()) for name, x in found.data_vars.items()} == {
        "C": ("mm", [1.0, 2.0]),
        "C_z": ("deg", [3.0]),
    }


def test_orders_of_two_digits_keep_their_names(tmp_path):
    path = tmp_path / "motion.csv"
    written = dataset(np.arange(24.0).reshape(2, 12))
    write(written, path)
    assert path.read_text().splitlines()[0].endswith("psi_d9,psi_d10,psi_d11")
    same_bits(read(path)["psi"], written["psi"])


def test_names_that_need_quotes(tmp_path):
    written = example().rename({"psi": 'a "b", c'})
    write(written, tmp_path / "motion.csv")
    same_bits(read(tmp_path / "motion.csv")['a "b", c'], written['a "b", c'])


@pytest.mark.parametrize("name", ["a_d1", "a_d1_d2", "a [deg]", "C_d1 [m]"])
def test_names_that_end_as_a_derivative_or_a_unit_does(tmp_path, name):
    written = example().rename({"psi": name})
    write(written, tmp_path / "motion.csv")
    found = read(tmp_path / "motion.csv")
    assert set(found.data_vars) == {name, "C"}
    same_bits(found[name], written[name])
    same_bits(found["C"], written["C"])


def test_an_output_that_reads_as_the_derivative_of_another_is_refused(tmp_path):
    written = example(0)[["psi"]].rename({"psi": "a"})
    written["a_d1"] = 2 * written["a"]
    with pytest.raises(OutputError, match="'a_d1'"):
        write(written, tmp_path / "motion.csv")
    write(written, tmp_path / "motion.nc")
    same_bits(read(tmp_path / "motion.nc")["a_d1"], written["a_d1"])


def test_variables_that_are_not_outputs_stay_out_of_the_table(tmp_path):
    written = example().assign(status=("time", np.zeros(4, int)))
    write(written, tmp_path / "motion.csv")
    assert "status" not in (tmp_path / "motion.csv").read_text()
    write(written, tmp_path / "motion.nc")
    assert "status" in read(tmp_path / "motion.nc")


def test_netcdf_carries_units_and_conventions(tmp_path):
    path = tmp_path / "motion.nc"
    write(example(3), path)
    found = xarray.load_dataset(path, engine="h5netcdf")
    assert found.attrs["Conventions"].startswith("CF-1.")
    assert found.attrs["history"].startswith("written by jounce ")
    assert found.attrs["title"] == "a test"
    assert found["C"].attrs == {"units": "m", "long_name": "C"}
    assert found["time"].attrs == {"units": "s", "long_name": "time", "standard_name": "time", "axis": "T"}
    assert found["time"].dtype == np.float64


def test_netcdf_opens_as_plain_hdf5(tmp_path):
    path = tmp_path / "motion.nc"
    written = example(3)
    write(written, path)
    with h5py.File(path) as file:
        assert set(file) == {"psi", "C", "time", "derivative", "component"}
        np.testing.assert_array_equal(file["C"], written["C"])
        units = file["C"].attrs["units"]
        assert (units if isinstance(units, str) else units.decode()) == "m"
        assert [scale[0].name for scale in file["C"].dims] == ["/time", "/derivative", "/component"]


def test_attributes_of_any_kind_are_kept_as_text(tmp_path):
    written = example()
    written.attrs |= {"flag": True, "none": None, "table": {"a": 1}, "count": 3}
    before = written.copy(deep=True)
    write(written, tmp_path / "motion.nc")
    assert written.identical(before)
    found = read(tmp_path / "motion.nc").attrs
    assert (found["flag"], found["table"], found["count"]) == ("True", "{'a': 1}", 3)
    assert "none" not in found


@pytest.mark.parametrize("suffix", ["csv", "nc"])
def test_nothing_is_left_half_written(tmp_path, monkeypatch, suffix):
    path = tmp_path / f"motion.{suffix}"
    path.write_text("precious")

    def full(*_arguments, **_keywords):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("jounce.io.results._write_csv", full)
    monkeypatch.setattr("jounce.io.results._write_netcdf", full)
    with pytest.raises(OutputError, match=rf"motion.{suffix}: .*No space left on device"):
        write(example(), path)
    assert path.read_text() == "precious"
    assert names(tmp_path) == [path.name]


def test_an_interruption_leaves_nothing(tmp_path, monkeypatch):
    def interrupt(*_arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr("jounce.io.results._write_csv", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write(example(), tmp_path / "motion.csv")
    assert names(tmp_path) == []


def test_a_link_stays_a_link(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "link.csv").symlink_to(tmp_path / "real" / "motion.csv")
    write(example(), tmp_path / "link.csv")
    assert (tmp_path / "link.csv").is_symlink()
    assert names(tmp_path / "real") == ["motion.csv"]


def test_a_new_file_has_the_usual_rights(tmp_path):
    write(example(), tmp_path / "motion.csv")
    (tmp_path / "plain").touch()
    assert (tmp_path / "motion.csv").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_check_writable_leaves_no_trace(tmp_path):
    check_writable(tmp_path / "motion.csv")
    assert names(tmp_path) == []
    (tmp_path / "motion.csv").write_text("precious")
    check_writable(tmp_path / "motion.csv")
    assert (tmp_path / "motion.csv").read_text() == "precious"


@pytest.mark.parametrize(
    "name, words",
    [
        ("motion.txt", "the kind of an output is given by its extension; valid: .csv, .nc"),
        ("motion", "the kind of an output is given by its extension; valid: .csv, .nc"),
        ("no/motion.csv", "does not exist"),
        ("folder.csv", "is a directory, the name of a file is needed"),
        ("file.csv/motion.csv", "does not exist"),
        ("null.csv", "the file there may not be replaced"),
        ("a" * 300 + ".csv", "cannot be written: File name too long"),
        ("a\0.csv", "embedded null"),
    ],
)
def test_what_cannot_be_written_is_said_before_computing(tmp_path, name, words):
    (tmp_path / "folder.csv").mkdir()
    (tmp_path / "file.csv").write_text("")
    (tmp_path / "null.csv").symlink_to("/dev/null")
    path = f"{tmp_path}/{name}"
    for call in (lambda: check_writable(path), lambda: write(example(), path)):
        with pytest.raises(OutputError) as caught:
            call()
        assert words in str(caught.value)
        assert str(caught.value).startswith(path.replace("\x00", r"\x00"))


def test_a_file_that_is_read_only_is_not_replaced(tmp_path, monkeypatch):
    (tmp_path / "motion.csv").write_text("precious")
    monkeypatch.setattr("os.access", lambda path, _mode: str(path) != str(tmp_path / "motion.csv"))
    for call in (lambda path: check_writable(path), lambda path: write(example(), path)):
        with pytest.raises(OutputError, match="the file there is read-only; give another name"):
            call(tmp_path / "motion.csv")
    assert (tmp_path / "motion.csv").read_text() == "precious"


def test_a_folder_without_the_right_to_write(tmp_path, monkeypatch):
    def refuse(*_arguments, **_keywords):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("tempfile.TemporaryFile", refuse)
    with pytest.raises(OutputError, match="cannot be written: Permission denied"):
        check_writable(tmp_path / "motion.csv")


def test_columns_of_the_same_name_are_refused(tmp_path):
    with pytest.raises(OutputError, match=r"motion\.csv: .*column of the same name, 'C_x'"):
        write(example().rename(psi="C_x"), tmp_path / "motion.csv")


def test_names_that_netcdf_cannot_hold(tmp_path):
    with pytest.raises(OutputError, match=r"motion\.nc: .*'a/b' .*NetCDF"):
        write(example().rename(psi="a/b"), tmp_path / "motion.nc")
    assert names(tmp_path) == []


@pytest.mark.parametrize(
    "name, content, words",
    [
        ("a.csv", None, "file not found"),
        ("a.nc", None, "file not found"),
        ("a.txt", b"", "the kind of results is given by the extension; valid: .csv, .nc"),
        ("a.csv", b"", "is not a table of results"),
        ("a.csv", b"time,a\n", "is not a table of results"),
        ("a.csv", b"a,b\n1,2\n", "is not a table of results"),
        ("a.csv", b"time,a\n1,2\n3\n", "line 3: must have 2 entries, got 1"),
        ("a.csv", b"time,a\n1,x\n", "line 2, a: must be a number, got 'x'"),
        ("a.csv", b"\xff\xfe\x00", "line 1: is not text in UTF-8"),
        ("a.nc", b"\xff\xfe\x00" * 99, "is damaged, or is not a file of results"),
    ],
)
def test_what_is_no_file_of_results(tmp_path, name, content, words):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(OutputError) as caught:
        read(tmp_path / name)
    assert words in str(caught.value)
