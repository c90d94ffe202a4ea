#!/usr/bin/env bash
# unyt 3.2.0: the angle of a slope of 10 percent is 84.3 degrees instead of 5.7: arctan, log and exp ignore percent.
#
# Slopes, efficiencies and ratios of amplitudes are given in percent, and a percent is a hundredth. One would expect
# np.arctan of a slope, or np.log of a ratio of amplitudes, to be those of the number, as in Pint 0.25.3 and Astropy
# 8.0.2, or a refusal. unyt refuses lengths there, and converts degrees for np.sin; of a percentage it takes the number
# in front of the unit, although a product with a force converts it. There is no message. Output seen: "slope of 10
# percent: 5.71 degrees in Pint and Astropy, 84.29 in unyt; log(50 percent): -0.693, 3.912; 10 percent of 50 N in unyt:
# 5 N". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "unyt==3.2.0" "pint==0.25.3" "astropy==8.0.2" "numpy==2.4.6"
"$folder/venv/bin/python" -W error - <<'PY'
import importlib.metadata

import astropy.units
import numpy as np
import pint
import unyt


def seen(quantity):
    """Angle of a slope of 10 percent, degrees, and the logarithm of a half in percent."""
    angle = np.arctan(quantity(10.0, "percent"))
    return np.degrees(float(getattr(angle, "value", angle))), float(np.log(quantity(50.0, "percent")))


def of_pint(value, unit):
    return pint.get_application_registry().Quantity(value, unit)


in_pint, in_astropy, in_unyt = (seen(q) for q in (of_pint, astropy.units.Quantity, unyt.unyt_quantity))
force = (unyt.unyt_quantity(10.0, "percent") * unyt.unyt_quantity(50.0, "N")).to_value("N")
print("unyt", importlib.metadata.version("unyt"))
print(f"slope of 10 percent: {in_pint[0]:.2f} degrees in Pint and Astropy, {in_unyt[0]:.2f} in unyt;", end=" ")
print(f"log(50 percent): {in_pint[1]:.3f}, {in_unyt[1]:.3f}; 10 percent of 50 N in unyt: {force:g} N")
right = np.degrees(np.arctan(0.1)), np.log(0.5)
assert np.allclose(in_pint, right) and np.allclose(in_astropy, right), "Pint or Astropy computes otherwise"
assert np.isclose(force, 5.0), "a product does not convert percent"
assert np.allclose(in_unyt, [np.degrees(np.arctan(10.0)), np.log(50.0)]), "percent count now"
PY
