#!/usr/bin/env bash
# unyt 3.2.0: np.unwrap of angles in degrees takes their numbers for radians: 355, 2 degrees become 348.72, 347.58
# degrees.
#
# Encoders and compasses record angles up to 360 degrees, and np.unwrap removes the jumps. Of an array with units one
# would expect full turns of 360 degrees, as in Pint 0.25.3 and Astropy 8.0.2, or a refusal. unyt hands the numbers on,
# whose turns are then 6.28, and attaches "degree" to the result: the angle comes back with steps that never were, none
# larger than half of 6.28, and the speed of a shaft with another size and sign. In radians it is right. There is no
# message. Output seen for 350 355 2 8 degrees, each a second after the other: "Pint and Astropy: 350 355 362 368
# degrees; unyt: 350.00 348.72 347.58 347.29 degrees; in radians 350 355 362 368". Exits with 1 if that is no longer so.
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

READ, RIGHT = [350.0, 355.0, 2.0, 8.0], [350.0, 355.0, 362.0, 368.0]
of_pint = np.unwrap(pint.UnitRegistry().Quantity(READ, "degree")).to("degree").magnitude
of_astropy = np.unwrap(READ * astropy.units.deg).to_value("deg")
of_unyt = np.unwrap(unyt.unyt_array(READ, "degree"))
in_radians = np.unwrap(unyt.unyt_array(READ, "degree").to("rad")).to_value("degree")


def words(values, digits):
    return " ".join(f"{x:.{digits}f}" for x in values)


print("unyt", importlib.metadata.version("unyt"))
print(f"Pint and Astropy: {words(of_pint, 0)} degrees; unyt: {words(of_unyt.value, 2)} degrees;", end=" ")
print(f"in radians {words(in_radians, 0)}")
assert np.allclose(of_pint, RIGHT) and np.allclose(of_astropy, RIGHT), "Pint or Astropy unwraps otherwise"
assert np.allclose(in_radians, RIGHT), "radians are unwrapped otherwise"
assert of_unyt.units == unyt.degree, "the unit is another"
assert np.allclose(of_unyt.value, np.unwrap(READ)), "degrees are unwrapped as degrees now"
PY
