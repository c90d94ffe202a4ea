#!/usr/bin/env bash
# heyoka 7.13.2: values of a continuous output at single times are all one array: a list of them is the last one, often.
#
# propagate_until(..., c_output=True) returns the solution as a function of time, as dense_output=True of SciPy does.
# One would expect a new array from each call. For one time, the call returns a view of memory that the next call writes
# to: [solution(t) for t in times] has the last state in every row, and the difference of two states is zero. The same
# holds of update_d_output of an integrator. Given an array of times, a call returns new memory. There is no message.
# Output seen for sin t: "at 1, 2, 3 s, one by one: 0.141 0.141 0.141; in one call: 0.841 0.909 0.141". Exits with 1 if
# that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "heyoka==7.13.2" numpy
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import heyoka
import numpy as np

x, v = heyoka.make_vars("x", "v")
swing = heyoka.taylor_adaptive([(x, v), (v, -x)], [0.0, 1.0])
solution = next(r for r in swing.propagate_until(4.0, c_output=True) if callable(r))

times = np.array([1.0, 2.0, 3.0])
one_by_one = np.array([state[0] for state in [solution(t) for t in times]])
at_once = solution(times)[:, 0]
copied = np.array([solution(t)[0] for t in times])  # numbers are taken before the next call

first = swing.update_d_output(3.6)
second = swing.update_d_output(3.9)

print("heyoka", importlib.metadata.version("heyoka"))
print("at 1, 2, 3 s, one by one:", *(f"{y:.3f}" for y in one_by_one), end="; ")
print("in one call:", *(f"{y:.3f}" for y in at_once))
assert np.allclose(at_once, np.sin(times)) and np.allclose(copied, np.sin(times))
assert np.array_equal(one_by_one, np.full(3, one_by_one[-1])), "each call returns an array of its own"
assert np.array_equal(first, second) and np.isclose(second[0], np.sin(3.9)), "update_d_output returns new arrays"
PY
