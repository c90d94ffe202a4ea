#!/usr/bin/env bash
# bdsim 1.4.0: the DERIV block gets worse with a faster filter: at 1000 rad/s the derivative of a sine is off by more
# than its amplitude.
#
# DERIV differentiates through a filter with its pole at alpha, which its documentation calls a tradeoff between noise
# and lag. One would expect a larger alpha to approach the derivative of a signal without noise. Its output is alpha
# times the difference of the signal and the state of the filter: the step control of the simulation sees the state
# alone, and an error within its default tolerance of 1e-3 is multiplied by alpha. There is no message. With
# solver_args={"rtol": 1e-9, "atol": 1e-12} the derivative is that of the filter, and better with a larger alpha. Output
# seen as the error after 2 s, for alpha of 10, 100, 1000 rad/s: "0.1 0.08 1; with tight tolerances 0.1 0.01 0.001".
# Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "bdsim==1.4.0" "scipy==1.17.1" numpy
MPLBACKEND=Agg "$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import bdsim
import numpy as np

TIGHT = {"rtol": 1e-9, "atol": 1e-12}
simulation = bdsim.BDSim(graphics=False, progress=False, verbose=False, banner=False, quiet=True)


def error(alpha, **tolerances):
    """Largest error of the derivative of sin t, after the filter has settled."""
    diagram = simulation.blockdiagram()
    sine = diagram.WAVEFORM(wave="sine", freq=1 / (2 * np.pi), amplitude=1.0)
    derivative, end = diagram.DERIV(alpha=alpha), diagram.NULL(1)
    diagram.connect(sine, derivative)
    diagram.connect(derivative, end)
    diagram.compile()
    result = simulation.run(diagram, 5, dt=0.01, watch=[derivative], solver_args=tolerances)
    return np.abs(result.y[:, 0] - np.cos(result.t))[np.asarray(result.t) > 2].max()


filters = (10.0, 100.0, 1000.0)
by_default = [error(alpha) for alpha in filters]
tight = [error(alpha, **TIGHT) for alpha in filters]
print("bdsim", importlib.metadata.version("bdsim"))
print(*(f"{e:.1g}" for e in by_default), end="; with tight tolerances ")
print(*(f"{e:.1g}" for e in tight))
assert np.allclose(tight, 1 / np.array(filters), rtol=0.02)
assert by_default[1] > 5 * tight[1] and by_default[2] > 0.5, "a faster filter is better"
PY
