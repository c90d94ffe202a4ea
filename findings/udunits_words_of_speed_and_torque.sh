#!/usr/bin/env bash
# cf-units 3.3.1 (UDUNITS-2): "mph" is a unit of light, "nmi" a billionth of a mile, "oz" a volume.
#
# UDUNITS reads the attribute "units" of NetCDF and CF files. Of a text that it accepts one would expect the common
# meaning, the one of Pint 0.25.3, or else a refusal, as for "Nm" and "fps". It has symbols for other units with which
# SI prefixes may stand: "ph" is the phot, so that "mph" is the milliphot and "kph" the kilophot; "mi" is the mile, and
# "nmi" the nanomile; "oz" is the fluid ounce, so that the torque "oz in" of a small motor has the dimension of an area
# moment, m^4. Conversions between files that both say so go unnoticed; a distance in "nmi" comes out 1e12 times too
# small. Output seen: "1 nmi: Pint 1852 m, UDUNITS 1.60934e-06 m; mph: 10 m-2.cd.rad2; oz in: 7.51168e-07 m4". Exits
# with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "cf-units==3.3.1" "pint==0.25.3"
"$folder/venv/bin/python" - <<'PY'
import cf_units
import pint

registry = pint.UnitRegistry()
mile = registry("1 nmi").to("m").magnitude, cf_units.Unit("nmi").convert(1.0, "m")
mph, ounce_inch = cf_units.Unit("mph"), cf_units.Unit("oz in")
print("cf-units", cf_units.__version__, "pint", pint.__version__)
print("1 nmi: Pint {:.6g} m, UDUNITS {:.6g} m;".format(*mile), f"mph: {mph.definition};", end=" ")
print(f"oz in: {ounce_inch.convert(1.0, 'm4'):.6g} m4")
assert mile[0] == 1852 and abs(mile[1] - 1609.344e-9) < 1e-15, "nmi is another unit now"
assert abs(registry("1 mph").to("m/s").magnitude - 0.44704) < 1e-12 and not mph.is_convertible("m/s")
assert mph.is_convertible("lux") and abs(mph.convert(1.0, "lux") - 10.0) < 1e-9, "mph is another unit now"
assert not ounce_inch.is_convertible("N m") and ounce_inch.is_convertible("m4"), "oz is another unit now"
assert not cf_units.Unit("lb").is_convertible("N") and cf_units.Unit("lbf").is_convertible("N")
PY
