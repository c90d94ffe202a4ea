#!/usr/bin/env bash
# biorbd 1.12.4: the acceleration of the center of mass is not the rate of its velocity where a fixed segment has mass.
#
# CoM, CoMdot and CoMddot of a model are its center of mass, velocity and acceleration. One would expect each to be the
# derivative of the one before. A segment without degrees of freedom at the root, such as the frame of an ergometer,
# counts in CoM and CoMdot, and in the mass of the model; CoMddot divides by the mass of the moving segments alone. A
# cart of 1 kg on a rail of 3 kg has its center of mass at x / 4: CoMdot is a quarter of the speed, and CoMddot all of
# the acceleration, so that forces from it are 4 times too large. There is no message. Output seen for 1 m, 1 m/s and 1
# m/s^2: "mass 4 kg, CoM 0.25, CoMdot 0.25, CoMddot 1". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "biorbd==1.12.4" numpy scipy
cd "$folder"
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import biorbd
import numpy as np

SEGMENT = """segment {name}
{more}
rt 0 0 0 xyz 0 0 0
mass {mass}
com 0 0 0
inertia
 1 0 0
 0 1 0
 0 0 1
endsegment
"""


def read(mass_of_rail):
    rail = SEGMENT.format(name="Rail", more="", mass=mass_of_rail)
    cart = SEGMENT.format(name="Cart", more="parent Rail\ntranslations x", mass=1)
    with open("cart.bioMod", "w") as file:
        file.write(f"version 4\n{rail}{cart}")
    model, one = biorbd.Model("cart.bioMod"), np.ones(1)
    vectors = model.CoM(one), model.CoMdot(one, one), model.CoMddot(one, one, one)
    return model.mass(), *(float(vector.to_array()[0]) for vector in vectors)


mass, *values = read(3)
print("biorbd", importlib.metadata.version("biorbd"))
print("mass {:g} kg, CoM {:g}, CoMdot {:g}, CoMddot {:g}".format(mass, *values))
assert np.allclose(read(1e-9)[1:], 1.0, atol=1e-6), "a rail without mass counts"
assert mass == 4 and np.allclose(values[:2], 0.25), "the rail does not count in the position and velocity any more"
assert abs(values[2] - 1.0) < 1e-12, "the acceleration is the rate of the velocity now"
PY
