#!/usr/bin/env bash
# scikit-sundae 1.2.0: solve() also returns the events of all earlier calls of the same solver.
#
# CVODE and IDA objects solve for other initial values by another call of solve(), and the result has t_events and
# y_events, by the documentation those of the solution. One would expect the same result of the same call. The list of
# events goes on from call to call: a sweep over initial values counts each impact once more with every call, and events
# that lie outside of the time span appear. There is no message; a new solver object starts with none. Output seen for a
# swing that passes zero once: "CVODE 1, 2, 3 events in three equal calls, IDA 1, 2, 3; then over 2 to 3 s: 1.571 1.571
# 1.571". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "scikit-sundae==1.2.0" numpy
"$folder/venv/bin/python" - <<'PY'
import numpy as np
import sksundae
from sksundae.cvode import CVODE
from sksundae.ida import IDA


def rates(time, state, derivative):
    derivative[:] = state[1], -state[0]


def residual(time, state, derivative, difference):
    difference[:] = derivative[0] - state[1], derivative[1] + state[0]


def zero(time, state, value):
    value[0] = state[0]


def zero_of_residual(time, state, derivative, value):
    value[0] = state[0]


zero.terminal = zero_of_residual.terminal = [False]
explicit = CVODE(rates, rtol=1e-10, atol=1e-12, eventsfn=zero, num_events=1)
implicit = IDA(residual, rtol=1e-10, atol=1e-12, eventsfn=zero_of_residual, num_events=1)
times, start, slope = np.linspace(0, 4, 5), np.array([1.0, 0.0]), np.array([0.0, -1.0])
print("scikit-sundae", sksundae.__version__)
counts = [len(explicit.solve(times, start).t_events) for _ in range(3)]
of_ida = [len(implicit.solve(times, start, slope).t_events) for _ in range(3)]
later = explicit.solve(np.array([2.0, 3.0]), np.array([np.cos(2), -np.sin(2)])).t_events
print(f"events in three equal calls: CVODE {counts}, IDA {of_ida}; then over 2 to 3 s: {np.round(later, 3)}")
assert counts == of_ida == [1, 2, 3], "each call has its own events now"
assert np.allclose(later, np.pi / 2)
fresh = CVODE(rates, rtol=1e-10, atol=1e-12, eventsfn=zero, num_events=1)
assert len(fresh.solve(times, start).t_events) == 1
PY
