#!/usr/bin/env bash
# npTDMS 1.13.0: a recording that is appended to a TDMS file moves the instants of the one before it.
#
# A TDMS file grows by segments: a logger that is stopped and started again appends to the same channel, with the start
# of the new waveform. One would expect that the time track has both recordings with the pause between them, or an
# error. The properties of the last segment hold for the whole channel: the first sample of the first recording is at the
# start of the second one, and the samples follow one another without a pause; so they do in as_dataframe with its time
# index. There is no message. Output seen for two recordings of 5 samples, 10 ms apart, the second a minute later:
# "recorded from 0 and from 60 s; time track 60 60.01 60.02 60.03 60.04 60.05 ... 60.09 s". Exits with 1 if that is no
# longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "npTDMS==1.13.0" numpy pandas
cd "$folder"
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import numpy as np
from nptdms import ChannelObject, TdmsFile, TdmsWriter

START = np.datetime64("2024-01-01T00:00:00", "us")
STARTS, STEP, COUNT = (0.0, 60.0), 0.01, 5
for k, start in enumerate(STARTS):  # the logger is started twice
    waveform = {"wf_start_time": START + np.timedelta64(int(start), "s"), "wf_start_offset": 0.0, "wf_increment": STEP}
    with TdmsWriter("log.tdms", "a" if k else "w") as writer:
        writer.write_segment([ChannelObject("arm", "joint", np.arange(COUNT) + COUNT * k, waveform)])
channel = TdmsFile.read("log.tdms")["arm"]["joint"]
track = (channel.time_track(absolute_time=True) - START) / np.timedelta64(1, "s")
frame = TdmsFile.read("log.tdms").as_dataframe(time_index=True, absolute_time=True)
print("npTDMS", importlib.metadata.version("npTDMS"))
print(f"recorded from 0 and from 60 s; time track {' '.join(f'{t:g}' for t in track[:6])} ... {track[-1]:g} s")
assert channel[:].tolist() == list(range(2 * COUNT)), "other samples are read now"
assert np.allclose(track, STARTS[1] + STEP * np.arange(2 * COUNT)), "the recordings have instants of their own now"
assert np.allclose((frame.index.to_numpy() - START) / np.timedelta64(1, "s"), track), "the table has other instants now"
PY
