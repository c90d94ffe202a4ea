#!/usr/bin/env bash
# Newton 1.8.0: of the joints of one body in MJCF, all have the place of the first, and slides come before hinges.
#
# MJCF lists the joints of a body in the order in which they move it, each with an axis and a pos of its own; a slide
# after a hinge moves along an axis that the hinge has turned. One would expect add_mjcf to place bodies where MuJoCo
# 4.0.0 does, or to refuse what its joints cannot do. It makes one joint of them, at the pos of the first, whose slides
# are its first coordinates, along fixed axes: a second hinge at another place turns about the wrong axis, and a polar
# arm (a hinge and a slide) extends in one direction at any angle, with its coordinates in the other order. <option
# gravity> is left out as well. There is no message. Output seen: "second hinge: Newton 0 0 0, MuJoCo 0 0.1168 0.02368;
# polar arm: Newton 0 0 0.4, MuJoCo 0.1918 0 0.351; gravity: Newton -9.81, MuJoCo -5". Exits with 1 if that is no longer
# so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "newton==1.8.0" "warp-lang==1.19.0" "mujoco==4.0.0" numpy
WARP_CACHE_PATH="$folder/cache" "$folder/venv/bin/python" - <<'PY'
import importlib.metadata
import warnings

import mujoco
import newton
import numpy as np
import warp

warp.config.quiet = True
MJCF = """<mujoco><option gravity="0 0 -5"/><worldbody><body name="link">{joints}
<inertial pos="0 0 .1" mass="1" diaginertia=".1 .1 .1"/></body></worldbody></mujoco>"""
HINGES = '<joint name="a" axis="0 1 0"/><joint name="b" axis="1 0 0" pos="0 0 .3"/>'
POLAR = '<joint name="turn" axis="0 1 0"/><joint name="extend" type="slide" axis="0 0 1"/>'


def of_newton(joints, coordinates):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        builder = newton.ModelBuilder()
        builder.add_mjcf(MJCF.format(joints=joints))
    model = builder.finalize(device="cpu")
    state = model.state()
    state.joint_q.assign(np.array(coordinates, dtype=np.float32))
    newton.eval_fk(model, state.joint_q, state.joint_qd, state)
    return state.body_q.numpy()[0, :3], model.gravity.numpy().ravel()[2]


def of_mujoco(joints, coordinates):
    model = mujoco.MjModel.from_xml_string(MJCF.format(joints=joints))
    data = mujoco.MjData(model)
    data.qpos[:] = coordinates
    mujoco.mj_forward(model, data)
    return data.body("link").xpos.copy(), model.opt.gravity[2]


def text(position):
    return " ".join(f"{v + 0.0:.4g}" for v in np.round(position, 6))


hinges = [f(HINGES, [0.0, 0.4])[0] for f in (of_newton, of_mujoco)]
(polar, ours), (extended, theirs) = of_newton(POLAR, [0.4, 0.5]), of_mujoco(POLAR, [0.5, 0.4])
print(", ".join(f"{name} {importlib.metadata.version(name)}" for name in ("newton", "mujoco")))
print(f"second hinge: Newton {text(hinges[0])}, MuJoCo {text(hinges[1])};", end=" ")
print(f"polar arm: Newton {text(polar)}, MuJoCo {text(extended)}; gravity: Newton {ours:.3g}, MuJoCo {theirs:.3g}")
assert np.allclose(hinges[1], [0, 0.3 * np.sin(0.4), 0.3 * (1 - np.cos(0.4))])
assert np.allclose(extended, [0.4 * np.sin(0.5), 0, 0.4 * np.cos(0.5)])
assert np.allclose(hinges[0], 0, atol=1e-6), "hinges have places of their own"
assert np.allclose(polar, [0, 0, 0.4], atol=1e-6), "it extends along the arm"
assert np.isclose(ours, -9.81)
PY
