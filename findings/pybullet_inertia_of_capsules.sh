#!/usr/bin/env bash
# PyBullet 3.2.7: the inertia of a capsule is that of the box around it, 38 to 45 percent too large.
#
# createMultiBody takes a mass and a shape, and loadURDF by default takes moments of inertia from the collision shape.
# Those of boxes, spheres and cylinders are exact. One would expect the same of a capsule, the shape of limbs, whose
# moments have a closed form, as Drake 1.51.1 and MuJoCo 4.0.0 give it; PyBullet has those of a box. A convex mesh gets
# those of a box, too, so that a cylinder has other moments as a mesh. There is no message; URDF_USE_INERTIA_FROM_FILE
# takes the moments of the file. Output seen for 1 kg, a radius of 1 m and 2 m between the centers: "capsule: PyBullet
# 1.667 0.667, MuJoCo 1.210 0.460, Drake 1.210 0.460, box 1.667 0.667, URDF 1.667 0.667, cylinder 0.583 0.500, as a mesh
# 0.671 0.671". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "pybullet==3.2.7" "mujoco==4.0.0" "drake==1.51.1" numpy
"$folder/venv/bin/python" - "$folder" <<'PY'
import importlib.metadata
import pathlib
import sys

import mujoco
import numpy as np
import pybullet
from pydrake.multibody.tree import UnitInertia

pybullet.connect(pybullet.DIRECT)


def moments(body):
    return np.array(pybullet.getDynamicsInfo(body, -1)[2])


def of_shape(kind, **size):
    return moments(pybullet.createMultiBody(1.0, pybullet.createCollisionShape(kind, **size)))


capsule = of_shape(pybullet.GEOM_CAPSULE, radius=1.0, height=2.0)
cylinder = of_shape(pybullet.GEOM_CYLINDER, radius=1.0, height=2.0)
box = of_shape(pybullet.GEOM_BOX, halfExtents=[1.0, 1.0, 2.0])
sphere = of_shape(pybullet.GEOM_SPHERE, radius=1.0)
angles = np.linspace(0, 2 * np.pi, 200, endpoint=False)
mesh = of_shape(pybullet.GEOM_MESH, vertices=[[np.cos(a), np.sin(a), z] for a in angles for z in (-1, 1)])
path = pathlib.Path(sys.argv[1]) / "capsule.urdf"
path.write_text(
    '<robot name="r"><link name="a"><inertial><mass value="1"/><inertia ixx="1.21" iyy="1.21" izz="0.46" ixy="0" '
    'ixz="0" iyz="0"/></inertial><collision><geometry><capsule radius="1" length="2"/></geometry></collision></link></robot>'
)
of_file = moments(pybullet.loadURDF(str(path)))
told = moments(pybullet.loadURDF(str(path), flags=pybullet.URDF_USE_INERTIA_FROM_FILE))
model = mujoco.MjModel.from_xml_string(
    '<mujoco><worldbody><body><freejoint/><geom type="capsule" size="1 1" mass="1"/></body></worldbody></mujoco>'
)
of_drake = UnitInertia.SolidCapsule(1.0, 2.0, [0.0, 0.0, 1.0]).get_moments()
exact = np.array([1.21, 1.21, 0.46])  # a cylinder of 0.6 kg and two halves of a sphere of 0.4 kg
of_mujoco = model.body_inertia[1]
rows = [("capsule: PyBullet", capsule), ("MuJoCo", of_mujoco), ("Drake", of_drake), ("box", box), ("URDF", of_file)]
rows += [("cylinder", cylinder), ("as a mesh", mesh)]
print("pybullet", importlib.metadata.version("pybullet"))
print(", ".join(f"{name} {values[0]:.3f} {values[2]:.3f}" for name, values in rows))
assert np.allclose(cylinder, [7 / 12, 7 / 12, 0.5]) and np.allclose(sphere, 0.4) and np.allclose(told, exact)
assert np.allclose(of_mujoco, exact) and np.allclose(of_drake, exact)
assert np.allclose(capsule, box, rtol=1e-6) and np.allclose(of_file, box, rtol=1e-6), "capsules are exact now"
assert np.allclose(mesh, 8 / 12, atol=0.01), "meshes are not boxes now"
PY
