#!/usr/bin/env bash
# pylinkage 1.3.0: the acceleration of a slider on a guide that turns lacks half of its Coriolis term.
#
# step_with_derivatives gives positions, velocities and accelerations of a linkage. The guide of an RRPDyad goes through
# two joints, which may move: an inverted slider-crank, a quick-return mechanism. One would expect the acceleration to
# be the second derivative of the positions, as the velocity is the first, and as the accelerations of RRRDyad and
# FixedDyad are. With a fixed guide it is; where the guide turns, the velocity of the slider along it counts once in
# place of twice. There is no message. Output seen for a crank at 1 rad/s whose pin leads the guide: "velocity 0.715
# -0.103, by differences 0.715 -0.103; acceleration 0.362 0.158, by differences 0.188 0.184; with a fixed guide off by
# 0". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "pylinkage==1.3.0" numpy
"$folder/venv/bin/python" -W ignore - <<'PY'
import importlib.metadata

import numpy as np
from pylinkage.actuators import Crank
from pylinkage.components import Ground
from pylinkage.dyads import RRPDyad
from pylinkage.simulation import Linkage

STEP = 1e-4  # s, and rad at 1 rad/s


def seen(turning):
    """Velocity and acceleration of the slider, each beside differences of its positions."""
    fulcrum, center, pivot = Ground(0, 0), Ground(0, 1), Ground(-0.3, 0.2)
    crank = Crank(anchor=center, radius=0.5, angular_velocity=STEP, initial_angle=0.7)
    grounds = [fulcrum, center, pivot]
    if turning:
        slider = RRPDyad(revolute_anchor=pivot, line_anchor1=fulcrum, line_anchor2=crank.output, distance=2.5)
    else:
        grounds.append(Ground(2, 0.5))
        slider = RRPDyad(revolute_anchor=crank.output, line_anchor1=fulcrum, line_anchor2=grounds[-1], distance=2.5)
    linkage = Linkage([*grounds, crank, slider])
    linkage.set_input_velocity(crank, omega=1.0)
    rows = list(linkage.step_with_derivatives(iterations=3))
    before, now, after = (np.array(row[0][-1], float) for row in rows)
    velocity, acceleration = np.array(rows[1][1][-1]), np.array(rows[1][2][-1])
    return velocity, (after - before) / (2 * STEP), acceleration, (after - 2 * now + before) / STEP**2


found, fixed = seen(turning=True), seen(turning=False)
print("pylinkage", importlib.metadata.version("pylinkage"))
texts = ["{:.3f} {:.3f}".format(*values) for values in found]
print("velocity {}, by differences {}; acceleration {}, by differences {}; ".format(*texts), end="")
print("with a fixed guide off by {:.0g}".format(np.abs(np.round(fixed[2] - fixed[3], 5)).max()))
assert np.allclose(found[0], found[1], atol=1e-6) and np.allclose(fixed[0], fixed[1], atol=1e-6)
assert np.allclose(fixed[2], fixed[3], atol=1e-5)
assert np.allclose(found[2] - found[3], [0.1742, -0.0252], atol=1e-3), "the acceleration changed"
PY
