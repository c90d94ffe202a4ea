#!/usr/bin/env bash
# ezc3d 1.7.2: of a C3D file with more than 65,535 frames, only the first 65,535 are read, without a message.
#
# The header of C3D has 16 bits for the last frame; a long recording has its length in parameters (TRIAL:ACTUAL_END_FIELD,
# POINT:LONG_FRAMES), and its data go on. One would expect all frames, or an error. ezc3d writes the data of all frames,
# and reads 65,535 of them back: 18 minutes at 60 Hz, 5.5 at 200 Hz. What lies behind is lost to whoever differentiates or
# smooths the motion, and the last instant is not that of the recording. Output seen for 70,000 frames of two points:
# "written 70000, read 65535, POINT:FRAMES 65535; the file has the data of 70000". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "ezc3d==1.7.2" numpy
cd "$folder"
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata
from pathlib import Path

import ezc3d
import numpy as np

COUNT, POINTS = 70_000, 2
recording = ezc3d.c3d()
recording["parameters"]["POINT"]["RATE"]["value"] = [60.0]
recording["parameters"]["POINT"]["LABELS"]["value"] = ["A", "B"]
markers = np.ones((4, POINTS, COUNT))
markers[0] = np.arange(COUNT)  # each frame has its number
recording["data"]["points"] = markers
recording.write("long.c3d")
read = ezc3d.c3d("long.c3d")
frames = read["data"]["points"].shape[2]
stated = int(read["parameters"]["POINT"]["FRAMES"]["value"][0])
content = Path("long.c3d").read_bytes()
start = 512 * (int.from_bytes(content[16:18], "little") - 1)  # of the data, by the ninth word of the header
words = np.frombuffer(content[start : start + 16 * POINTS * COUNT], "<f4").reshape(COUNT, POINTS, 4)
stored = int(words[-1, 0, 0]) + 1
print("ezc3d", importlib.metadata.version("ezc3d"))
print(f"written {COUNT}, read {frames}, POINT:FRAMES {stated}; the file has the data of {stored}")
assert frames == stated == 65535, "another number of frames is read now"
assert np.array_equal(read["data"]["points"][0, 0], np.arange(frames)), "other frames are read now"
assert stored == COUNT and np.array_equal(words[:, 0, 0], np.arange(COUNT)), "the file lacks data now"
PY
