#!/usr/bin/env bash
# asammdf 8.8.28: at the same raster, resample and to_dataframe give other values of a channel that is stored in integers.
#
# Control units store positions and speeds in integers with a linear conversion, such as 0.1 rad/s a digit. One would
# expect that a file that is resampled to a raster, and a table at this raster, have the same values between the samples.
# resample repeats the sample before, since the raw values are integers; to_dataframe interpolates linearly, since the
# physical values are not. A channel stored in floating point is interpolated by both. Rates of the first are spikes
# with zeros between them. Output seen, of samples 0 1 2 3 at 0 0.1 0.25 0.4 s every 0.1 s: "resample 0 1 1 2 3,
# to_dataframe 0 1 1.667 2.333 3; in floating point both 0 1 1.667 2.333 3". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "asammdf==8.8.28" numpy
cd "$folder"
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import numpy as np
from asammdf import MDF, Signal

TIMES, SPEED, RASTER = np.array([0.0, 0.1, 0.25, 0.4]), np.array([0.0, 1.0, 2.0, 3.0]), 0.1
digits = Signal((10 * SPEED).astype(np.uint8), TIMES, name="digits", conversion={"a": 0.1, "b": 0.0})
log = MDF()
log.append([digits, Signal(SPEED, TIMES, name="speed")])
log.save("log.mf4", overwrite=True)
log = MDF("log.mf4")
assert np.allclose(log.get("digits").samples, SPEED), "the conversion is another one now"
resampled, table = log.resample(RASTER), log.to_dataframe(raster=RASTER)
values = [[resampled.get(name).samples, table[name].to_numpy()] for name in ("digits", "speed")]


def words(samples):
    return " ".join(f"{x:.4g}" for x in samples)


print("asammdf", importlib.metadata.version("asammdf"))
print(f"resample {words(values[0][0])}, to_dataframe {words(values[0][1])};", end=" ")
print(f"in floating point both {words(values[1][0])}")
linear = np.interp(RASTER * np.arange(5), TIMES, SPEED)
assert np.allclose(resampled.get("digits").timestamps, RASTER * np.arange(5))
assert np.allclose(values[1], linear), "floating point is not interpolated now"
assert np.allclose(values[0][1], linear), "the table repeats samples now"
assert np.allclose(values[0][0], [0.0, 1.0, 1.0, 2.0, 3.0]), "resample interpolates now"
PY
