#!/usr/bin/env bash
# trimesh 5.2.0: transform_inertia turns the other way with parallel_axis=True than without.
#
# trimesh.inertia.transform_inertia takes a transform and an inertia tensor. One would expect parallel_axis=True to add
# the term of the translation, and the same tensor for a translation of zero. Without it the result is R I R^T, what a
# body has that R turned; with it R^T I R, what the axes turned by R see: also where nothing is translated, and then the
# term of the translation is turned back, too. The documentation speaks of "a new frame" for both. There is no message.
# Output seen, for diag(1, 2, 3) turned by 0.5 rad about z, no translation: "product Ixy without -0.421, with 0.421".
# Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "trimesh==5.2.0" scipy numpy
"$folder/venv/bin/python" - <<'PY'
import numpy as np
import trimesh
from trimesh.inertia import transform_inertia

MASS, TURN, INERTIA = 2.0, 0.5, np.diag([1.0, 2.0, 3.0])
transform = trimesh.transformations.rotation_matrix(TURN, [0, 0, 1])
rotation = transform[:3, :3]
print("trimesh", trimesh.__version__)
without = transform_inertia(transform, INERTIA)
with_it = transform_inertia(transform, INERTIA, parallel_axis=True, mass=MASS)
print(f"product Ixy without {without[0, 1]:.3g}, with {with_it[0, 1]:.3g}")
# of a body that was turned: diag(a, b) has (a - b) sin cos
right = (INERTIA[0, 0] - INERTIA[1, 1]) * np.sin(TURN) * np.cos(TURN)
assert np.isclose(without[0, 1], right) and np.allclose(without, rotation @ INERTIA @ rotation.T)
assert np.isclose(with_it[0, 1], -right), "both turn the same way now"

transform[:3, 3] = shift = np.array([1.0, 2.0, 3.0])
moved = transform_inertia(transform, INERTIA, parallel_axis=True, mass=MASS)
term = MASS * (shift @ shift * np.eye(3) - np.outer(shift, shift))
assert np.allclose(moved, rotation.T @ (INERTIA + term) @ rotation)
print("of the turned and moved body Ixy", (without + term)[0, 1].round(3), "returned", moved[0, 1].round(3))
assert not np.allclose(moved, without + term, atol=1.0), "it is that of the turned and moved body now"
PY
