#!/usr/bin/env bash
# brax 0.14.2 (generalized pipeline): a slide on a link that turns keeps the direction that it has at angle zero, and
# springs rest at zero whatever springref says.
#
# An arm that extends: a hinge about y, on it a slide along x, as in polar coordinates. One would expect the mass matrix
# to be diagonal, and the weight on the slide to be m g sin(angle), as in MuJoCo 4.0.0. Positions and velocities of the
# links are right, but the mass matrix and the forces take the slide along the x of the world: inertia couples the two,
# and the arm hangs straight down without pulling at its slide. At angle zero, and for slides that carry the hinge, all
# is right. There is no message, and none that springref of MJCF is left out. Output seen at 0.7 rad for 2 kg: "coupling
# -0.644 kg m, MuJoCo 0; weight on the slide 0.00 N, MuJoCo 12.64 N; at angle zero coupling 0; spring of 2 N m/rad that
# rests at 0.5 rad: 0 N m, MuJoCo 1 N m". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "brax==0.14.2" "jax==0.10.2" "mujoco==4.0.0" "mujoco-mjx==3.17.0" numpy
JAX_ENABLE_X64=1 JAX_PLATFORMS=cpu "$folder/venv/bin/python" -W ignore - <<'PY'
import importlib.metadata

import mujoco
import numpy as np
from brax.generalized import dynamics, pipeline
from brax.io import mjcf

BODY = (
    '<body><joint type="{}" axis="{}"/><inertial pos="0 0 0" mass="2" diaginertia="0.1 0.2 0.25"/>'
    '<geom type="sphere" size="0.01" contype="0" conaffinity="0"/>'
)
arm = BODY.format("hinge", "0 1 0") + BODY.format("slide", "1 0 0") + "</body></body>"
text = f"<mujoco><worldbody>{arm}</worldbody></mujoco>"
system, model = mjcf.loads(text), mujoco.MjModel.from_xml_string(text)


def seen(angle, speeds):
    """Mass matrix and applied forces at rest of brax and of MuJoCo, and twice the kinetic energies of brax."""
    q = np.array([angle, 0.5])
    state = pipeline.init(system, q, np.array(speeds))
    force = np.array(dynamics.forward(system, pipeline.init(system, q, np.zeros(2)), np.zeros(2)))
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    matrix = np.zeros((2, 2))
    mujoco.mj_fullM(model, data, matrix)
    of_links = 2 * float((np.array(state.xd.vel) ** 2).sum()) + 2 * 0.2 * speeds[0] ** 2
    theirs = np.array(state.mass_mx)
    return theirs, force, matrix, -data.qfrc_bias, of_links, speeds @ theirs @ np.array(speeds)


at_zero, turned = seen(0.0, [0.5, 0.1]), seen(0.7, [0.5, 0.1])
print({name: importlib.metadata.version(name) for name in ("brax", "jax", "mujoco")})
print(f"coupling {turned[0][0, 1]:.3f} kg m, MuJoCo {turned[2][0, 1]:.0f}; ", end="")
print(f"weight on the slide {turned[1][1]:.2f} N, MuJoCo {turned[3][1]:.2f} N; ", end="")
print(f"at angle zero coupling {at_zero[0][0, 1]:.0f}; ", end="")
hinge = BODY.format("hinge", '0 1 0" stiffness="2" springref="0.5') + "</body>"
text = f'<mujoco><compiler angle="radian"/><worldbody>{hinge}</worldbody></mujoco>'
sprung, model = mjcf.loads(text), mujoco.MjModel.from_xml_string(text)
torque = float(dynamics.forward(sprung, pipeline.init(sprung, np.zeros(1), np.zeros(1)), np.zeros(1))[0])
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
print(f"spring of 2 N m/rad that rests at 0.5 rad: {torque:.0f} N m, MuJoCo {data.qfrc_passive[0]:g} N m")
assert np.allclose(at_zero[0], at_zero[2], atol=1e-6) and np.allclose(at_zero[1], at_zero[3], atol=1e-6)
assert np.isclose(turned[3][1], 2 * 9.81 * np.sin(0.7)) and np.allclose(turned[2][0, 1], 0.0, atol=1e-9)
assert np.isclose(at_zero[4], at_zero[5], rtol=1e-5) and not np.isclose(turned[4], turned[5], rtol=0.05)
assert np.isclose(turned[0][0, 1], -np.sin(0.7), rtol=1e-3), "the mass matrix changed"
assert abs(turned[1][1]) < 1e-6, "the weight on the slide counts now"
assert np.isclose(data.qfrc_passive[0], 1.0) and abs(torque) < 1e-6, "springref counts now"
PY
