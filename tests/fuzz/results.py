"""Files of results: good ones to begin from, what reads them, and what is changed in those that are no text."""

from __future__ import annotations

import contextlib
import functools
import io
import pathlib
import random
import tempfile
from collections.abc import Callable
from typing import Any

import h5py
import numpy as np
import xarray

import jounce as jn
from jounce.errors import OutputError
from jounce.io.result_columns import columns
from tests.fuzz.forks import forked
from tests.fuzz.mutations import HOSTILE, mutated

__all__ = ["changed_netcdf", "changed_table", "netcdf_of", "netcdfs", "read_netcdf", "read_table", "tables"]

AXES = {
    "C": ("component",),
    "e": ("euler_parameter",),
    "angles": ("euler_angle",),
    "R": ("row_axis", "column_axis"),
}
LABELS = {"component": "xyz", "euler_parameter": ("e0", "e1", "e2", "e3"), "euler_angle": ("alpha", "beta", "gamma")}
HEADS = (
    "time,time [s],time [ms],Time,derivative,component,component_x,time_x,psi,psi_d1,psi_d2,psi_d99999999999,_d1,_x,"
    "C_x,C_y,C_z,C_x_d1,C_alpha,C_e0,C_xx,C_d1_x,D_x,D_y,D_z,D_x [mm],C,'=psi,'psi,=psi,psi [deg],psi [,psi ],"
    "psi [[m]],[m],psi [deg] [rad],psi [1],psi [],psi [furlong],psi [nan],euler_angle,row_axis,a/b,psi/d,_FillValue"
).split(",")
NUMBERS = (
    '1_5,0x10,1e400,-1e400,nan,inf,-inf,+1,1.,.5,1e,e1,1 2,1;2,true,None,\u0663,1\u00a0,1e-400,\'1,"1","1,2",--1,=1'
).split(",")


def results(components: int, levels: int, count: int = 4) -> xarray.Dataset:
    """Return results as those of a motion, of numbers made up."""
    chance = np.random.default_rng(components)
    coordinates: dict[str, Any] = {
        "time": ("time", 0.1 * np.arange(count), {"units": "s"}),
        "derivative": np.arange(levels),
    }
    variables: dict[str, Any] = {
        name: (("time", "derivative"), chance.standard_normal((count, levels)), {"units": unit})
        for name, unit in (("psi", "rad"), ("force", "N"), ("a_b", "1"))
    }
    for name, axes in AXES.items() if components == 3 else [("C", AXES["C"])]:
        sizes = {"component": components, "euler_parameter": 4}
        shape = tuple(sizes.get(axis, 3) for axis in axes)
        values = chance.standard_normal((count, levels, *shape))
        variables[name] = (("time", "derivative", *axes), values, {"units": "m" if name == "C" else "1"})
        coordinates |= {axis: list(LABELS.get(axis, "xyz"))[:size] for axis, size in zip(axes, shape, strict=True)}
    return xarray.Dataset(variables, coordinates, {"title": "results"})


def _written(dataset: xarray.Dataset, ending: str, **given: Any) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder, f"results{ending}")
        jn.io.write(dataset, path, **given)
        return path.read_bytes()


@functools.cache
def _shown() -> list[xarray.Dataset]:
    plane, space = results(2, 3), results(3, 2)
    return [plane, space, plane[["psi"]].isel(derivative=[0]), jn.io.in_units(plane, {"angle": "deg", "length": "mm"})]


def tables() -> list[str]:
    """Return tables of results, with units in their headings and without."""
    kept = [_written(dataset, ".csv") for dataset in _shown()]
    return [text.decode() for text in (*kept, _written(results(3, 1), ".csv", header_units=True))]


def netcdfs() -> list[bytes]:
    """Return files of the same in NetCDF, as they are and in the oldest form of HDF5, which has no checksums."""
    return [*(_written(dataset, ".nc") for dataset in _shown()), *map(_in_old_form, _shown()[:2])]


def _in_old_form(dataset: xarray.Dataset) -> bytes:
    stream = io.BytesIO()
    with h5py.File(stream, "w", libver="earliest") as file:
        for name, variable in dataset.variables.items():
            file[str(name)] = variable.values.astype("S9" if variable.dtype.kind == "U" else variable.dtype)
            file[str(name)].attrs.update(variable.attrs)
        for name in dataset.dims:
            file[str(name)].make_scale(str(name))
        for name, variable in dataset.data_vars.items():
            for axis, scale in zip(file[str(name)].dims, variable.dims, strict=True):
                axis.attach_scale(file[str(scale)])
    return stream.getvalue()


def netcdf_of(count: int, names: int = 1, attribute: str = "") -> bytes:
    """Return a file of so many instants, so many quantities, and an attribute."""
    variables = {f"q{k}": ("time", np.arange(float(count))) for k in range(names)}
    return _written(xarray.Dataset(variables, {"time": np.arange(float(count))}, {"comment": attribute}), ".nc")


def read_table(path: pathlib.Path) -> None:
    """Read a table; where it is one, what is written of it again holds the same."""
    found, again = jn.io.read(path), path.with_name("again.csv")
    try:
        jn.io.write(found, again)
        same = jn.io.read(again)
    except OutputError:
        return  # names that cannot be told apart in a table
    finally:
        again.unlink(missing_ok=True)
    kept, read = columns(found), columns(same)  # what is a vector may change: a table does not say it
    assert list(kept) == list(read), f"{list(kept)} became {list(read)}"
    for name in kept:
        np.testing.assert_array_equal(kept[name], read[name])


def read_netcdf(path: pathlib.Path) -> None:
    """Read a file in NetCDF, first by a fork."""
    with forked():
        jn.io.read(path)


def changed_table(chance: random.Random, seeds: list[str]) -> bytes:
    """Change names, units and numbers of a table, or any of its text."""
    if chance.random() < 0.5:
        return mutated(chance, seeds)
    lines = [line.split(",") for line in chance.choice(seeds).split("\n")]
    for _ in range(chance.randrange(1, 4)):
        row = lines[0] if chance.random() < 0.6 else chance.choice(lines)
        column = chance.randrange(len(row))
        kind = chance.randrange(6)
        if kind == 0:
            row[column] = chance.choice(HOSTILE)
        elif kind == 1:
            other = chance.randrange(len(row))
            row[column], row[other] = row[other], row[column]
        elif kind == 2:
            for line in lines:
                del line[column : column + 1]
                line.append("") if not line else None
        else:
            row[column] = chance.choice(HEADS if row is lines[0] else NUMBERS)
    text = "\n".join(map(",".join, lines))
    return chance.choice([text, text, text, "\ufeff" + text, text.replace("\n", "\r\n")]).encode(
        "utf-8", "surrogatepass"
    )


def changed_netcdf(chance: random.Random, seeds: list[bytes]) -> bytes:
    """Change the bytes of a file, or what is in it, so that it is still one of HDF5."""
    content = chance.choice(seeds)
    if chance.random() < 0.5:
        for _ in range(chance.randrange(1, 4)):
            content = _edited(chance, content)
        if chance.random() < 0.7:
            return content
    for _ in range(chance.randrange(1, 3)):
        content = chance.choice(BYTES)(chance, bytearray(content))
    return content


def _flipped(chance: random.Random, content: bytearray) -> bytes:
    for _ in range(chance.randrange(1, 9)):
        content[_place(chance, content)] ^= 1 << chance.randrange(8)
    return bytes(content)


def _word(chance: random.Random, content: bytearray) -> bytes:
    """Exchange a whole number, such as a size or a place, for another."""
    size = chance.choice([1, 2, 4, 8])
    start = _place(chance, content) // size * size
    old = int.from_bytes(content[start : start + size], "little")
    new = chance.choice(
        [0, 1, 2, old + 1, old - 1, 2 * old, old ^ 0xFF, 2 ** (8 * size) - 1, 2 ** (8 * size - 1), start]
    )
    content[start : start + size] = (new % 2 ** (8 * size)).to_bytes(size, "little")
    return bytes(content)


def _cut(chance: random.Random, content: bytearray) -> bytes:
    return bytes(content[: chance.randrange(len(content) + 1)])


def _exchanged(chance: random.Random, content: bytearray) -> bytes:
    """Exchange two pieces."""
    size = chance.choice([8, 32, 128, 512])
    one, other = (_place(chance, content) // 8 * 8 for _ in range(2))
    first, second = content[one : one + size], content[other : other + size]
    content[one : one + size], content[other : other + size] = second, first
    return bytes(content)


def _blank(chance: random.Random, content: bytearray) -> bytes:
    start, size = _place(chance, content), chance.choice([4, 16, 64, 512])
    content[start : start + size] = bytes([chance.choice([0, 255, 65])]) * size
    return bytes(content)


def _moved(chance: random.Random, content: bytearray) -> bytes:
    """Take a piece away, or put one in."""
    start, size = _place(chance, content), chance.choice([1, 8, 64, 4096])
    content[start : start + chance.choice([0, size])] = content[start : start + chance.choice([0, size])] * 2
    return bytes(content)


def _place(chance: random.Random, content: bytearray) -> int:
    """Return a place, mostly among the descriptions at the beginning."""
    return min(int(chance.choice([chance.random(), chance.random() ** 3]) * len(content)), max(0, len(content) - 1))


BYTES = (_flipped, _flipped, _word, _word, _word, _cut, _exchanged, _blank, _moved)
KEYS = (
    "units long_name _FillValue missing_value scale_factor add_offset calendar coordinates dtype DIMENSION_LIST "
    "REFERENCE_LIST CLASS NAME _Netcdf4Dimid _Netcdf4Coordinates _NCProperties standard_name valid_range _Unsigned "
    "bounds grid_mapping Conventions title _nc3_strict DIMENSION_LABELS"
).split()
VALUES: tuple[Any, ...] = (
    *("", "s", "days since 2000-01-01", "seconds since x", "seconds", "nan", "a" * 3000, "\u202e\x1b[31m", "time psi"),
    *(0, -1, 2**63 - 1, 1e400, float("nan"), 1e300, True, 1j, b"\xff\xfe", np.float16(1), np.uint8(255)),
    *(np.arange(5000.0), np.zeros((2, 3), "i4"), np.array([b"a", b"bc"]), h5py.Empty("f8"), h5py.Empty("S1")),
    *(np.zeros(2, [("a", "f8"), ("b", "S3")]), np.void(b"abc"), np.array([], float), np.array("a" * 9, "S9")),
)


def _edited(chance: random.Random, content: bytes) -> bytes:
    """Change attributes, arrays or links of a file; what HDF5 refuses is left as it was."""
    stream = io.BytesIO(content)
    with contextlib.suppress(Exception), h5py.File(stream, "r+") as file:
        chance.choice(EDITS)(chance, file)
    return stream.getvalue()


def _set_attribute(chance: random.Random, file: h5py.File) -> None:
    holder = chance.choice([file, *file.values()])
    key = chance.choice([*KEYS, *holder.attrs])
    value = chance.choice([*VALUES, file.ref, file[chance.choice([*file])].ref])
    if key in holder.attrs:
        del holder.attrs[key]
    holder.attrs[key] = value


def _delete_attribute(chance: random.Random, file: h5py.File) -> None:
    holder = chance.choice([file, *file.values()])
    del holder.attrs[chance.choice([*holder.attrs])]


def _exchange_array(chance: random.Random, file: h5py.File) -> None:
    """Put another array in the place of one; it has the attributes of the old one, or not."""
    name = chance.choice([*file])
    old, kept = file[name], dict(file[name].attrs) if chance.random() < 0.7 else {}
    shape = chance.choice([(), (0,), (3,), old.shape, old.shape[::-1], (*old.shape, 1), (2,) * 9])
    kind = chance.choice(["i1", ">f8", "f2", "c16", "S5", "V7", "u8", "?", "f4", h5py.string_dtype(), h5py.ref_dtype])
    del file[name]
    how = chance.randrange(6)
    if how == 0:
        file[name] = h5py.Empty("f8")
    elif how == 1:
        file.create_dataset(name, (10**12,), "f8", chunks=(1024,))
    elif how == 2:
        file.create_dataset(name, data=np.zeros(9, [("a", "f8"), ("b", "S3")]))
    elif how == 3:
        file.create_dataset(name, shape, kind, chunks=True, compression="gzip", shuffle=True)
    else:
        file.create_dataset(name, shape, kind)
    for key, value in kept.items():
        with contextlib.suppress(Exception):
            file[name].attrs[key] = value


def _link(chance: random.Random, file: h5py.File) -> None:
    """Link to nothing, to another file, in a circle, or to what is in another file."""
    name = chance.choice([*file, "other"])
    if name in file and chance.random() < 0.8:
        del file[name]
    kind = chance.randrange(6)
    if kind == 0:
        file[name] = h5py.SoftLink(chance.choice(["/nowhere", "/", name, f"/{name}/{name}", "psi"]))
    elif kind == 1:
        file[name] = h5py.ExternalLink(chance.choice(["other.nc", "/dev/zero", ".", ""]), "/psi")
    elif kind == 2:
        file[name] = file["/"]
    elif kind == 3:
        file.create_dataset(name, (4,), "f8", external=[(chance.choice(["/dev/zero", "other"]), 0, 32)])
    elif kind == 4:
        layout = h5py.VirtualLayout((4,), "f8")
        layout[:] = h5py.VirtualSource(chance.choice(["other.h5", ".", "/dev/zero"]), "psi", (4,))
        file.create_virtual_dataset(name, layout)
    else:
        file.create_group(f"{name}/{name}")


def _rename(chance: random.Random, file: h5py.File) -> None:
    file.move(chance.choice([*file]), chance.choice([*HEADS, *file, "a" * 300, "\u202e", " ", "\x1b[31m"]))


EDITS: tuple[Callable[[random.Random, h5py.File], None], ...] = (
    *(_set_attribute, _set_attribute, _set_attribute, _delete_attribute, _exchange_array, _exchange_array, _link),
    _rename,
)
