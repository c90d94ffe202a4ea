#!/usr/bin/env bash
# heyoka 7.13.2 and SciPy 1.17.1: backward in time, the direction of an event means opposite crossings.
#
# In both, an event of a simulation can be limited to rising values of its function. One would expect the same of both
# when time decreases. SciPy's solve_ivp takes the order in which the solver meets the values; heyoka takes the sign of
# the derivative by time. Forward they report the same crossings, backward the ones that the other leaves out. Output
# seen for sin t and the level 0.5: "forward: heyoka 0.5236, SciPy 0.5236; backward: heyoka -5.76, SciPy -3.665". Exits
# with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "heyoka==7.13.2" "scipy==1.17.1" numpy
"$folder/venv/bin/python" - <<'PY'
import heyoka
import numpy as np
import scipy
from scipy.integrate import solve_ivp


def of_heyoka(end):
    times = []
    x, v = heyoka.make_vars("x", "v")
    up = heyoka.event_direction.positive
    rising = heyoka.nt_event(x - 0.5, lambda ta, time, sign: times.append(time), direction=up)
    heyoka.taylor_adaptive([(x, v), (v, -x)], [0.0, 1.0], nt_events=[rising]).propagate_until(end)
    return times


def level(t, state):
    return state[0] - 0.5


level.direction = 1


def of_scipy(end):
    solved = solve_ivp(lambda t, y: [y[1], -y[0]], [0.0, end], [0.0, 1.0], events=level, rtol=1e-10, atol=1e-10)
    return list(solved.t_events[0])


found = [of_heyoka(6.0), of_scipy(6.0), of_heyoka(-6.0), of_scipy(-6.0)]
print("heyoka", heyoka.__version__, "scipy", scipy.__version__)
print("forward: heyoka {:.4g}, SciPy {:.4g}; backward: heyoka {:.4g}, SciPy {:.4g}".format(*(f[0] for f in found)))
expected = np.pi * np.array([1 / 6, 1 / 6, 1 / 6 - 2, -7 / 6])
assert all(len(f) == 1 for f in found)
assert np.allclose([f[0] for f in found], expected, atol=1e-6), "the directions mean something else now"
PY
