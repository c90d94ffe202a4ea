#!/usr/bin/env bash
# FastQuat 0.5.2: half turns have no quaternion, and derivatives of exp at zero are NaN.
#
# FastQuat has quaternions for JAX, whose functions can be compiled and differentiated. One would expect
# from_rotation_matrix to give a quaternion of every rotation, as Rotation of SciPy 1.17.1 does, and exp to have its
# derivative at zero, half the angular velocity of a body that starts to turn. Matrices of half turns about x, y, z give
# infinity and NaN; turns of 179.9 degrees are right. The value of exp at zero is right, its derivatives by JAX are NaN;
# at other angles they are right. There is no message. Output seen: "half turn about x: 0 inf nan nan, about z: 0 nan
# nan inf; rate of exp at rest: nan, at 1 s 0.3288". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "fastquat==0.5.2" "jax==0.10.2" "jaxlib==0.10.2" "scipy==1.17.1" numpy
JAX_ENABLE_X64=1 JAX_PLATFORMS=cpu "$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import jax
import jax.numpy as jnp
import numpy as np
from fastquat import Quaternion
from scipy.spatial.transform import Rotation


def of_matrix(rotation_vector):
    q = Quaternion.from_rotation_matrix(jnp.asarray(Rotation.from_rotvec(rotation_vector).as_matrix()))
    return np.array([q.w, q.x, q.y, q.z])


def turned(t):
    """Sine of half the angle of a steady turn by 0.7 rad/s about z."""
    return Quaternion(0.0, 0.0, 0.0, 0.35 * t).exp().z


about_x, about_y, about_z = (of_matrix(np.pi * axis) for axis in np.eye(3))
nearly = of_matrix(np.radians(179.9) * np.array([1.0, 0.0, 0.0]))
at_rest, later = (float(jax.grad(turned)(t)) for t in (0.0, 1.0))
print(", ".join(f"{name} {importlib.metadata.version(name)}" for name in ("fastquat", "jax", "scipy")))
print("half turn about x:", *(f"{v:.3g}" for v in about_x), end=", ")
print("about z:", *(f"{v:.3g}" for v in about_z), end="; ")
print(f"rate of exp at rest: {at_rest:.4g}, at 1 s {later:.4g}")
assert np.allclose(nearly[:2], [np.cos(np.radians(89.95)), 1], atol=1e-4)
assert np.isclose(later, 0.35 * np.cos(0.35)) and float(turned(0.0)) == 0
assert not any(np.isfinite(q).all() for q in (about_x, about_y, about_z)), "half turns have quaternions"
assert np.isnan(at_rest), "exp has its derivative at zero"
PY
