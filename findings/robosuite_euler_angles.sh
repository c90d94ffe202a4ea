#!/usr/bin/env bash
# robosuite 1.5.2: mat2euler is not the inverse of euler2mat.
#
# robosuite.utils.transform_utils has both, each "rotation matrix" and "euler angles" to the other. One would expect the
# angles back. euler2mat turns about axes that move, mat2euler by default gives angles about fixed axes, so that all
# three numbers differ; angles about one axis alone come back, and simple checks pass. axes="rxyz" of mat2euler is the
# inverse. There is no message. Output seen for 0.3 0.5 0.7: "mat2euler 0.556 0.161 0.823, with rxyz 0.300 0.500 0.700;
# SciPy xyz 0.556 0.161 0.823, XYZ 0.300 0.500 0.700". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "robosuite==1.5.2" numpy scipy
"$folder/venv/bin/python" -W ignore - <<'PY'
import importlib.metadata
import logging

import numpy as np

logging.disable(logging.CRITICAL)
from robosuite.utils.transform_utils import euler2mat, mat2euler  # noqa: E402
from scipy.spatial.transform import Rotation  # noqa: E402

angles = np.array([0.3, 0.5, 0.7])
matrix = euler2mat(angles)
turn = Rotation.from_matrix(matrix)
found = [mat2euler(matrix), mat2euler(matrix, axes="rxyz"), turn.as_euler("xyz"), turn.as_euler("XYZ")]
print("robosuite", importlib.metadata.version("robosuite"))
texts = ["{:.3f} {:.3f} {:.3f}".format(*values) for values in found]
print("mat2euler {}, with rxyz {}; SciPy xyz {}, XYZ {}".format(*texts))
assert np.allclose(found[1], angles, atol=1e-6) and np.allclose(found[3], angles, atol=1e-6)
assert np.allclose(found[0], found[2], atol=1e-6), "mat2euler changed"
assert not np.allclose(found[0], angles, atol=0.1), "mat2euler is the inverse of euler2mat now"
PY
