#!/usr/bin/env bash
# mechanism 1.1.10: for an offset roller follower, get_base_circle returns a cam that exceeds the pressure angle asked
# for.
#
# Cam.get_base_circle sizes the base circle so that the largest pressure angle is max_pressure_angle. One would expect
# tan(angle) = (ds/dtheta - e) / (s + sqrt(Rp^2 - e^2)) with the offset e and Rp the base and roller radii, as in
# textbooks. It takes sqrt(Rp^2 + e^2): the follower stands farther out than it does, and the pressure angle is larger
# than it says. Without an offset it is right. There is no message. Checked by the normal of the path of the roller,
# found by differences. Output seen for at most 25 degrees, 40 mm of lift and an offset of 30 mm: "base circle 98.2 mm,
# pressure angle 26.6 deg; without offset 69.9 mm, 25.0 deg". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "mechanism==1.1.10" numpy
MPLBACKEND=Agg "$folder/venv/bin/python" -W ignore - <<'PY'
import importlib.metadata

import numpy as np
from mechanism import Cam

ROLLER = 0.01
parts = [("Dwell", 40), ("Rise", 0.04, 100), ("Dwell", 30), ("Fall", 0.01, 60), ("Dwell", 10), ("Fall", 0.03, 120)]
cam = Cam(motion=parts, degrees=True, omega=3.0, h=1e-3)


def sized(offset):
    """Radius of the base circle, and the largest pressure angle (deg) of that cam."""
    radius = cam.get_base_circle(
        kind="cycloidal", follower="roller", roller_radius=ROLLER, eccentricity=offset, max_pressure_angle=25
    )["Rb"]
    along = np.sqrt((radius + ROLLER) ** 2 - offset**2) + cam.cycloidal.S
    # the center of the roller in axes of the cam, which turns by theta; the follower moves along its own y
    path = (offset + 1j * along) * np.exp(-1j * cam.thetas)
    travel = 1j * np.exp(-1j * cam.thetas)
    tangent = np.gradient(path, cam.thetas)
    angle = np.pi / 2 - np.abs(np.angle(tangent / travel))  # of the normal and the direction of travel
    return radius, np.degrees(np.abs(angle)).max()


found, central = sized(0.03), sized(0.0)
print("mechanism", importlib.metadata.version("mechanism"))
print("base circle {:.1f} mm, pressure angle {:.1f} deg; ".format(1e3 * found[0], found[1]), end="")
print("without offset {:.1f} mm, {:.1f} deg".format(1e3 * central[0], central[1]))
assert abs(central[1] - 25) < 0.05
assert min(found[1], sized(-0.03)[1]) > 25.5, "the pressure angle is kept now"
PY
