#!/usr/bin/env bash
# pymunk 7.3.1: kinetic_energy of a body is twice its kinetic energy.
#
# pymunk is a simulator of rigid bodies in the plane. By the documentation kinetic_energy is the kinetic energy of a
# body; one would expect m v^2/2 + I w^2/2. It is m v^2 + I w^2: of 2 kg that fall 1 m at 10 m/s^2 it is 40 J, while
# the weight did work of 20 J. An energy balance of a mechanism fails, or a loss is seen where there is none. There is
# no message. Output seen: "40 J after a fall of 1 m, the work of the weight is 20 J; 3 J of a wheel of 3 kg m^2 at 1
# rad/s". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "pymunk==7.3.1"
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import pymunk

space = pymunk.Space()
space.gravity = (0, -10)
body = pymunk.Body(2, 3)
space.add(body)
while body.position.y > -1:
    space.step(1e-5)
work = -2 * 10 * body.position.y
wheel = pymunk.Body(2, 3)
wheel.angular_velocity = 1
print("pymunk", importlib.metadata.version("pymunk"))
print(
    f"{body.kinetic_energy:.4g} J after a fall of {-body.position.y:.4g} m, the work of the weight is {work:.4g} J; "
    f"{wheel.kinetic_energy:.4g} J of a wheel of 3 kg m^2 at 1 rad/s"
)
assert abs(abs(body.velocity) ** 2 - 20) < 1e-2, "the fall is not right"
assert abs(body.kinetic_energy - 40) < 1e-2 and abs(wheel.kinetic_energy - 3) < 1e-9, "it is the kinetic energy now"
PY
