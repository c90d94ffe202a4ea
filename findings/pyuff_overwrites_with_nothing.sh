#!/usr/bin/env bash
# pyuff 2.5.8: a binary dataset that is written with mode "overwrite" is not in the file.
#
# UFF (universal files) keep measured time series and frequency responses of machines; dataset 58 may be text or binary.
# One would expect write_sets(dataset, "overwrite") to make a file with this dataset, as it does of text. Of a binary
# one the file has seven characters, the end mark; of a list of binary datasets all but the first one are there.
# Whatever the file had before is gone, too. There is no message, and reading such a file is no error: it has no
# datasets. With mode "add" and a new file the binary dataset is complete. Output seen for 1000 samples: "text: 1
# dataset; binary: 0 datasets, 7 bytes; two binary ones: 0; binary, added: 1 dataset". Exits with 1 if that is no longer
# so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "pyuff==2.5.8" numpy
cd "$folder"
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata
import pathlib

import numpy as np
import pyuff

TIMES = np.arange(1000) * 0.01
PLACES = ("abscissa", "ordinate", "orddenom", "z_axis")
UNITS = {f"{place}_{unit}_unit_exp": 0 for place in PLACES for unit in ("len", "force", "temp")}
LABELS = {f"{place}_axis_units_lab": "NONE" for place in PLACES}
KINDS = {"abscissa_spec_data_type": 17, "ordinate_spec_data_type": 8, "orddenom_spec_data_type": 0}


def dataset(binary):
    """A time response of double precision at even times."""
    return pyuff.prepare_58(
        binary=binary, func_type=1, ord_data_type=4, x=TIMES, data=np.sin(TIMES), num_pts=TIMES.size,
        abscissa_spacing=1, abscissa_min=0.0, abscissa_inc=0.01, z_axis_value=0.0, z_axis_spec_data_type=0,
        rsp_ent_name="arm", rsp_node=1, rsp_dir=1, ref_ent_name="arm", ref_node=1, ref_dir=1, ver_num=0, load_case_id=0,
        id1="a", id2="b", id3="c", id4="d", id5="e", **UNITS, **LABELS, **KINDS,
    )  # fmt: skip


def written(name, datasets, mode):
    """Number of datasets with data that are read from a new file."""
    pyuff.UFF(name).write_sets(datasets, mode)
    file = pyuff.UFF(name)
    read = file.read_sets() if file.get_n_sets() else []
    read = [r for r in (read if isinstance(read, list) else [read]) if "data" in r]
    assert all(np.allclose(r["data"], np.sin(TIMES)) for r in read)
    return len(read)


text = written("text.uff", dataset(0), "overwrite")
binary = written("binary.uff", dataset(1), "overwrite")
size = pathlib.Path("binary.uff").stat().st_size
two = written("two.uff", [dataset(1), dataset(1)], "overwrite")
added = written("added.uff", dataset(1), "add")
print("pyuff", importlib.metadata.version("pyuff"))
print(f"text: {text} dataset; binary: {binary} datasets, {size} bytes; two binary ones: {two};", end=" ")
print(f"binary, added: {added} dataset")
assert text == added == 1
assert binary == 0 and two == 0, "a binary dataset is written"
PY
