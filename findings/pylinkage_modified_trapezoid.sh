#!/usr/bin/env bash
# pylinkage 1.3.0: the follower of a cam with ModifiedTrapezoidalMotionLaw jumps three times, once by the whole lift.
#
# Motion laws give the lift s from 0 to 1 over u from 0 to 1, and its derivatives by u. One would expect a modified
# trapezoid to rise steadily with a continuous velocity, a peak velocity of 2 and a peak acceleration of 4.89; the
# harmonic, cycloidal and polynomial laws of the package do as they should. This one goes to 0.63, falls to 0.09 and
# below 0, and jumps to 0.93; its velocity is 0 in the middle. There is no message, and a profile made of it has the
# steps. Output seen: "lift at 0.5 0.375 then 0.625, at 0.625 0.634 then 0.094, at 0.875 -0.094 then 0.929; velocity in
# the middle 0; largest jump of the others 0". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "pylinkage==1.3.0" numpy
"$folder/venv/bin/python" -W ignore - <<'PY'
import importlib.metadata

import numpy as np
from pylinkage.cam import CycloidalMotionLaw, HarmonicMotionLaw, ModifiedTrapezoidalMotionLaw
from pylinkage.cam.motion_laws import polynomial_345

EDGES, TINY = np.array([0.125, 0.375, 0.5, 0.625, 0.875]), 1e-9


def sides(law):
    return np.array([[law.displacement(u - TINY), law.displacement(u + TINY)] for u in EDGES])


law = ModifiedTrapezoidalMotionLaw()
lifts, middle = sides(law), law.velocity(0.5)
smooth = HarmonicMotionLaw(), CycloidalMotionLaw(), polynomial_345()
others = max(np.abs(np.diff(sides(other))).max() for other in smooth)
print("pylinkage", importlib.metadata.version("pylinkage"))
text = ", at ".join("{:g} {:.3f} then {:.3f}".format(u, *pair) for u, pair in zip(EDGES[2:], lifts[2:], strict=True))
print(f"lift at {text}; velocity in the middle {middle:.2g}; largest jump of the others {others:.0f}")
assert others < 1e-7 and law.displacement(0.0) == 0.0 and np.isclose(law.displacement(1.0), 1.0)
assert np.allclose(lifts[2:], [[0.375, 0.625], [0.634, 0.094], [-0.094, 0.929]], atol=1e-3), "the lift changed"
assert abs(middle) < 1e-6, "the velocity changed"
PY
