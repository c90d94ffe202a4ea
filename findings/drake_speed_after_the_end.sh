#!/usr/bin/env bash
# Drake 1.51.1: after its end a PiecewisePolynomial stands still, and its derivative goes on.
#
# value(t) holds the last position for any later t. One would expect the derivative of a constant there, 0, or an error.
# derivative() and EvalDerivative give the speed and acceleration of the last instant for ever, and those of the first
# one before the start: a controller that follows both gets a target that rests and moves at 3 m/s. Output seen 1 s
# after the end: "position 1, speed 3, acceleration 8". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "drake==1.51.1" numpy
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

from pydrake.trajectories import PiecewisePolynomial

motion = PiecewisePolynomial.CubicHermite([0.0, 1.0], [[0.0, 1.0]], [[1.0, 3.0]])
rate = motion.derivative()
later = motion.value(2.0).item(), rate.value(2.0).item(), rate.derivative().value(2.0).item()
print("drake", importlib.metadata.version("drake"))
print("position {:g}, speed {:g}, acceleration {:g}".format(*later))
assert motion.value(5.0).item() == motion.value(2.0).item() == 1.0
assert rate.value(5.0).item() == motion.EvalDerivative(5.0, 1).item() == 3.0, "it stands still now"
assert rate.value(-1.0).item() == 1.0 and motion.value(-1.0).item() == 0.0, "it stands still before the start now"
PY
