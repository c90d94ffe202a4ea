#!/usr/bin/env bash
# usd-core 26.11: products of Gf.Rotation and of Gf.Matrix4d turn in the opposite order of products of Gf.Quaternion.
#
# a, b are two rotations, and a.GetQuaternion() is the quaternion of a. One would expect the product of the quaternions
# to be the quaternion of the product, a * b. A rotation a * b turns by a first and then by b, as matrices that are
# multiplied by row vectors do; a quaternion a * b turns by b first, as in every textbook. Poses that are composed by
# quaternions in one place and by rotations in another differ, without a message. Output seen for the axis y, and 90
# degrees about x and about z: "rotations 0 0 1, matrices 0 0 1, quaternions -1 0 0". Exits with 1 if that is no longer
# so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "usd-core==26.11"
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

from pxr import Gf

Y = Gf.Vec3d(0, 1, 0)
a, b = Gf.Rotation(Gf.Vec3d(1, 0, 0), 90), Gf.Rotation(Gf.Vec3d(0, 0, 1), 90)
matrices = Gf.Matrix4d().SetRotate(a) * Gf.Matrix4d().SetRotate(b)
product = a.GetQuaternion() * b.GetQuaternion()
found = {
    "rotations": (a * b).TransformDir(Y),
    "matrices": matrices.TransformDir(Y),
    "quaternions": Gf.Rotation(product).TransformDir(Y),
}
print("usd-core", importlib.metadata.version("usd-core"))
rounded = {name: [round(x) + 0 for x in value] for name, value in found.items()}
print(", ".join("{} {:g} {:g} {:g}".format(name, *value) for name, value in rounded.items()))
for single in (a, b):
    assert Gf.Rotation(single.GetQuaternion()).TransformDir(Y) == single.TransformDir(Y)
assert rounded["rotations"] == rounded["matrices"] == [0, 0, 1], "rotations turn in another order now"
assert rounded["quaternions"] == [-1, 0, 0], "quaternions turn in another order now"
PY
