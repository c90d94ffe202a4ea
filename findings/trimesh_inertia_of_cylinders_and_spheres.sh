#!/usr/bin/env bash
# trimesh 5.2.0: moment_inertia of a primitive cylinder or sphere ignores its density; its mass does not.
#
# A density makes mass and moments of a solid of those of a shape. One would expect moment_inertia times the density for
# all primitives. Boxes and capsules have it. Cylinders and spheres return the moments for a density of 1, so that steel
# of 98 kg has those of 12.6 g; mass_properties, moment_inertia_frame and the same shape as a mesh have the density. All
# of these are in the table of inertias that one writes for a robot file. There is no message. Output seen, for
# 1000 kg/m^3: "Cylinder: 12.5 kg, 0.000199 for 0.199 kg m^2; Sphere: 4.15 kg, 1.68e-05 for 0.0168; Box: 0.065 for
# 0.065; Capsule: 0.445 for 0.446". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "trimesh==5.2.0" scipy numpy
"$folder/venv/bin/python" - <<'PY'
import numpy as np
import trimesh
from trimesh import primitives

DENSITY, R, H = 1000.0, 0.1, 0.4
cylinder, ball = np.pi * R**2 * H, 4 / 3 * np.pi * R**3
# moments about x of a volume of density 1, centered at the origin, axis along z
of_cylinder = cylinder * (R**2 / 4 + H**2 / 12)
of_ends = ball * (2 / 5 * R**2 + (H / 2) ** 2 + 3 / 4 * (H / 2) * R)

print("trimesh", trimesh.__version__)
for shape, volume, moment, counts in (
    (primitives.Cylinder(radius=R, height=H), cylinder, of_cylinder, False),
    (primitives.Sphere(radius=R), ball, ball * 2 / 5 * R**2, False),
    (primitives.Box(extents=[0.1, 0.2, 0.3]), 0.006, 0.006 * (0.2**2 + 0.3**2) / 12, True),
    (primitives.Capsule(radius=R, height=H), cylinder + ball, of_cylinder + of_ends, True),
):
    shape.density = DENSITY
    name, found = type(shape).__name__, shape.moment_inertia[0, 0]
    print(f"{name}: {shape.mass:.3g} kg, {found:.3g} for {DENSITY * moment:.3g} kg m^2")
    assert np.isclose(shape.mass, DENSITY * volume, rtol=0.02), "the mass is another"
    assert np.isclose(shape.mass_properties.inertia[0, 0], DENSITY * moment, rtol=0.02)
    assert np.isclose(found, (DENSITY if counts else 1.0) * moment, rtol=0.02), f"it is otherwise for a {name} now"
PY
