#!/usr/bin/env bash
# 60 rpm are 6.28 Hz in Pint 0.25.3, Astropy 8.0.2 and quantities 0.16.4; in quantities they are 6.28 rps, too.
#
# A shaft of 60 revolutions per minute turns once per second. One would expect 1 Hz from a conversion, or a refusal, as
# unyt 3.2.0 refuses it, since an angle is no number of cycles. The radian is 1 in these libraries, and the hertz 1/s,
# so that 60 rpm are 6.28 rad/s and thus 6.28 Hz: a balancing filter, or a motor with pole pairs, gets 2 pi times the
# frequency. Astropy does so for cycles per second, where the equivalence dimensionless_angles() is asked for. The rps
# of quantities, by name revolutions per second, is the hertz: 60 rpm are 6.28 of them, and 1 rps is 1 rad/s. There is
# no message. Output seen: "60 rpm in Hz: Pint 6.283, Astropy 6.283, quantities 6.283, in rps 6.283; unyt refuses".
# Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "pint==0.25.3" "astropy==8.0.2" "quantities==0.16.4" "unyt==3.2.0"
"$folder/venv/bin/python" -W ignore - <<'PY'
import importlib.metadata
import math

import astropy.units
import pint
import quantities
import unyt

registry = pint.UnitRegistry()
cycles = 60 * astropy.units.cycle / astropy.units.minute
found = {
    "Pint": registry.Quantity(60, "rpm").to("Hz").magnitude,
    "Astropy": cycles.to(astropy.units.Hz, astropy.units.dimensionless_angles()).value,
    "quantities": float((60 * quantities.rpm).rescale(quantities.Hz)),
    "in rps": float((60 * quantities.rpm).rescale(quantities.rps)),
}
try:
    unyt.unyt_quantity(60, "rpm").to("Hz")
    refused = False
except unyt.exceptions.UnitConversionError:
    refused = True
print(", ".join(f"{name} {importlib.metadata.version(name)}" for name in ("pint", "astropy", "quantities", "unyt")))
texts = [f"{name} {value:.3f}" for name, value in found.items()]
print(f"60 rpm in Hz: {', '.join(texts)}; unyt {'refuses' if refused else 'converts'}")
for name, value in found.items():
    assert math.isclose(value, 2 * math.pi), f"{name} converts revolutions otherwise now"
assert math.isclose(float((1 * quantities.rps).rescale("rad/s")), 1.0), "1 rps of quantities is a revolution now"
assert math.isclose(registry.Quantity(60, "rpm").to("rps").magnitude, 1.0) and refused
PY
