#!/usr/bin/env bash
# heyoka 7.13.2: a ball falls through a spring that is written with relu; a mass at rest never meets a force by select.
#
# relu and select make expressions that depend on a condition, for stops, contacts and pulses. One would expect the step
# control to notice that the right-hand side changes within a step, as that of SciPy 1.17.1 does, or a refusal. A step
# is chosen by the Taylor series at its start, which knows nothing of what begins later: a free fall is a polynomial, so
# that one step reaches the end, 3.9 m below the spring; a mass at rest stays there for all forces of later times. The
# outcome is that the time limit was reached, without a message. With a terminal event at the change, which ends a step
# there and lets the simulation go on, the ball bounces. Output seen after 1 s of a fall from 1 m onto 10 kN/m: "heyoka
# -3.905 m in 1 step, with an event 0.9792 m, SciPy 0.9792 m; mass at rest: 0 m, SciPy 1.416 m". Exits with 1 if that is
# no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "heyoka==7.13.2" "scipy==1.17.1" numpy
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import heyoka
import numpy as np
from scipy.integrate import solve_ivp

STIFFNESS, GRAVITY = 1e4, 9.81  # of a ball of 1 kg
x, v = heyoka.make_vars("x", "v")
TIGHT = {"rtol": 1e-10, "atol": 1e-10}


def simulate(acceleration, start, end, **options):
    """Steps of heyoka, and the position that they end at."""
    integrator = heyoka.taylor_adaptive([(x, v), (v, acceleration)], start, **options)
    outcome, *_, steps, _, _ = integrator.propagate_until(end)
    assert outcome == heyoka.taylor_outcome.time_limit
    return steps, integrator.state[0]


fall = -GRAVITY + STIFFNESS * heyoka.relu(-x)
start = [1.0, 0.0]
steps, fallen = simulate(fall, start, 1.0)
touch = heyoka.t_event(x, callback=lambda integrator, sign: True)  # true: the simulation goes on
_, bounced = simulate(fall, start, 1.0, t_events=[touch])
of_scipy = solve_ivp(lambda t, y: [y[1], -GRAVITY + STIFFNESS * max(-y[0], 0.0)], (0, 1), start, **TIGHT).y[0, -1]

push = heyoka.select(heyoka.gt(heyoka.time, 1.0), heyoka.expression(1.0), heyoka.expression(0.0))
_, unmoved = simulate(push - x, [0.0, 0.0], 3.0)
pushed = solve_ivp(lambda t, y: [y[1], (t > 1) - y[0]], (0, 3), [0.0, 0.0], max_step=0.1, **TIGHT).y[0, -1]

print(*(f"{name} {importlib.metadata.version(name)}" for name in ("heyoka", "scipy")), sep=", ")
print(f"heyoka {fallen:.4g} m in {steps} step{'s' * (steps > 1)}, with an event {bounced:.4g} m,", end=" ")
print(f"SciPy {of_scipy:.4g} m; mass at rest: {unmoved:.4g} m, SciPy {pushed:.4g} m")
assert np.isclose(bounced, of_scipy, rtol=1e-6)
assert np.isclose(pushed, 1 - np.cos(2.0), rtol=1e-3)
assert fallen < -3 < 0 < of_scipy, "it bounces"
assert unmoved == 0, "it is pushed"
PY
