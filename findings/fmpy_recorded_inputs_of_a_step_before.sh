#!/usr/bin/env bash
# FMPy 0.3.32: an input in the results of a co-simulation is that of the step before: 0.065 for 0.25 at 0.5 s.
#
# simulate_fmu takes a signal as input, and records the variables that are named, inputs too, with their times. One
# would expect the recorded input at a time to be the signal at that time, so that a plot shows what the model received
# and when. The input is set at the start of each step, and all variables are recorded at its end: the recorded signal
# is late by one interval of the output, and a model that passes its input through seems to follow it without delay.
# There is no message. Output seen for the input t^2 with an interval of 0.25 s: "at 0.25 0.5 0.75 1 s: recorded 0.000
# 0.065 0.250 0.565, signal 0.065 0.250 0.565 1.000". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "fmpy==0.3.32" "pythonfmu==0.7.0" numpy
cd "$folder"
cat > passing.py <<'PY'
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Passing(Fmi2Slave):
    def __init__(self, **arguments):
        super().__init__(**arguments)
        self.u = self.y = 0.0
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.y = self.u
        return True
PY
"$folder/venv/bin/pythonfmu" build -f passing.py > /dev/null
"$folder/venv/bin/python" -W ignore - <<'PY'
import importlib.metadata

import fmpy
import numpy as np

times = np.linspace(0, 1, 11)
signal = np.array(list(zip(times, times**2)), dtype=[("time", float), ("u", float)])
result = fmpy.simulate_fmu("Passing.fmu", stop_time=1, output_interval=0.25, input=signal, output=["u", "y"])
given = np.interp(result["time"], times, times**2)


def words(values):
    return " ".join(f"{x:.3f}" for x in values)


print("fmpy", importlib.metadata.version("fmpy"))
print(f"at {' '.join(f'{t:g}' for t in result['time'][1:])} s:", end=" ")
print(f"recorded {words(result['u'][1:])}, signal {words(given[1:])}")
assert np.allclose(result["time"], [0, 0.25, 0.5, 0.75, 1])
assert np.allclose(result["y"], result["u"]), "the model does not pass its input through"
assert np.allclose(result["u"][1:], given[:-1]), "the recorded input is that of its time now"
PY
