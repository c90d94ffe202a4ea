#!/usr/bin/env bash
# SymPy 1.14.0: a spring that is led around a sphere or cylinder by a WrappingPathway pushes, a damper drives.
#
# Actuators apply a force along a pathway, positive where it pushes the ends apart, so that the power of the loads is
# the force times extension_velocity; a spring has a negative force where it is long. One would expect the same of all
# pathways. It is so for LinearPathway. The loads of a WrappingPathway are those of the opposite force, although its
# documentation says the same: springs, dampers and muscles led around a bone add energy. Around a cylinder the loads
# have the same direction for negative angles, too, where the length |q| shrinks by positive rates. There is no message.
# Output seen, the power of 1 N at 1 and -1 rad: "linear: 0.878 -0.878 W, right 0.878 -0.878; sphere: -1 1 W, right 1
# -1; cylinder: -1 -1 W, right 1 -1; a damper of 1 N s/m around the sphere: 1 W". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "sympy==1.14.0"
"$folder/venv/bin/python" - <<'PY'
import sympy
from sympy.physics.mechanics import (
    LinearDamper,
    LinearPathway,
    Point,
    ReferenceFrame,
    WrappingCylinder,
    WrappingPathway,
    WrappingSphere,
    dynamicsymbols,
)

q, r = dynamicsymbols("q"), sympy.symbols("r", positive=True)
fixed = ReferenceFrame("N")
turning = fixed.orientnew("A", "Axis", [q, fixed.z])
center, start, end = Point("O"), Point("S"), Point("E")
for point, vector in ((start, r * fixed.x), (end, r * turning.x)):
    point.set_pos(center, vector)
center.set_vel(fixed, 0)
start.set_vel(fixed, 0)
end.set_vel(fixed, r * q.diff() * turning.y)


def number(expression, angle):
    return float(expression.doit().subs({q.diff(): 1, r: 1}).subs(q, angle).evalf())


def power(loads):
    return sum(load.force.dot(load.point.vel(fixed)) for load in loads)


pathways = {
    "linear": LinearPathway(start, end),
    "sphere": WrappingPathway(start, end, WrappingSphere(r, center)),
    "cylinder": WrappingPathway(start, end, WrappingCylinder(r, center, fixed.z)),
}
print("sympy", sympy.__version__)
seen, right = {}, {}
for name, pathway in pathways.items():
    seen[name] = [number(power(pathway.to_loads(sympy.Integer(1))), angle) for angle in (1.0, -1.0)]
    right[name] = [number(pathway.extension_velocity, angle) for angle in (1.0, -1.0)]
    pairs = [f"{first:.3g} {second:.3g}" for first, second in (seen[name], right[name])]
    print(f"{name}: {pairs[0]} W, right {pairs[1]};", end=" ")
damper = number(power(LinearDamper(1, pathways["sphere"]).to_loads()), 1.0)
print(f"a damper of 1 N s/m around the sphere: {damper:.3g} W")


def close(values, expected):
    return all(abs(value - other) < 1e-12 for value, other in zip(values, expected, strict=True))


assert close(seen["linear"], right["linear"]), "a linear pathway has other loads"
assert close(right["sphere"], [1.0, -1.0]) and close(right["cylinder"], [1.0, -1.0])
assert close(seen["sphere"], [-1.0, 1.0]), "the force around a sphere pushes now"
assert close(seen["cylinder"], [-1.0, -1.0]), "the force around a cylinder changed"
assert abs(damper - 1.0) < 1e-12, "the damper takes energy now"
PY
