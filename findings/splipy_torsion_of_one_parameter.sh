#!/usr/bin/env bash
# Splipy 1.10.1: the torsion of a curve at one parameter is 0; in a list of parameters it is right.
#
# Curve.torsion(t) takes a number or a list, like curvature and derivative. One would expect the same torsion of both.
# For a number, the scalar product is formed with the second derivative instead of the third one, so that it is zero for
# every curve but for rounding: a curve in space passes for a plane one wherever it is asked point by point. There is no
# message. Curvature, tangent, normal and binormal are right for both. Output seen for a helix of radius 2 m that rises
# by 0.5 m a radian: "torsion 0.1176, curvature 0.4706; in a list 0.1176, 0.4706; at one parameter 0.0000, 0.4706".
# Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "splipy==1.10.1" numpy
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import numpy as np
from splipy import curve_factory

RADIUS, RISE = 2.0, 0.5
angles = np.linspace(0, 6, 401)
points = np.column_stack((RADIUS * np.cos(angles), RADIUS * np.sin(angles), RISE * angles))
helix = curve_factory.cubic_curve(points, t=angles, boundary=curve_factory.Boundary.NATURAL)

torsion, curvature = (v / (RADIUS**2 + RISE**2) for v in (RISE, RADIUS))
in_list = helix.torsion([3.0])[0], helix.curvature([3.0])[0]
alone = helix.torsion(3.0), helix.curvature(3.0)
print("splipy", importlib.metadata.version("splipy"))
print(f"torsion {torsion:.4f}, curvature {curvature:.4f}; in a list {in_list[0]:.4f}, {in_list[1]:.4f};", end=" ")
print(f"at one parameter {abs(alone[0]):.4f}, {alone[1]:.4f}")
assert np.allclose(in_list, (torsion, curvature), rtol=1e-3) and np.isclose(alone[1], curvature, rtol=1e-3)
assert abs(alone[0]) < 1e-12, "it has its torsion"
PY
