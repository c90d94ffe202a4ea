#!/usr/bin/env bash
# SymPy 1.14.0: LagrangesMethod.rhs returns multipliers of the opposite sign of solve_multipliers.
#
# The equations of motion that form_lagranges_equations returns contain multipliers by name. rhs solves these equations
# for accelerations and multipliers, solve_multipliers for the multipliers at a point. One would expect the last entry
# of rhs to be the multiplier of the equations. Its sign is the opposite, without a message, and the equations are not
# solved by it: a rod pulls where it pushes. Accelerations are right. Output seen for a mass m that hangs still on a rod
# of length l: "solve_multipliers g*m/(2*l), rhs -g*m/(2*l)". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "sympy==1.14.0"
"$folder/venv/bin/python" - <<'PY'
import sympy
from sympy.physics.mechanics import LagrangesMethod, dynamicsymbols

x, y = dynamicsymbols("x y")
t = dynamicsymbols._t
m, g, length = sympy.symbols("m g l", positive=True)
lagrangian = m * (x.diff(t) ** 2 + y.diff(t) ** 2) / 2 - m * g * y
method = LagrangesMethod(lagrangian, [x, y], hol_coneqs=[x**2 + y**2 - length**2])
equations = method.form_lagranges_equations()
still = {x.diff(t): 0, y.diff(t): 0, x: 0, y: -length}
(named, of_solve), = method.solve_multipliers(op_point=still).items()
of_rhs = sympy.simplify(method.rhs()[-1].subs(still))
left = equations.subs({x.diff(t, 2): 0, y.diff(t, 2): 0}).subs(still)
print("sympy", sympy.__version__)
print(f"solve_multipliers {of_solve}, rhs {of_rhs}")
assert sympy.simplify(left.subs(named, of_solve)) == sympy.zeros(2, 1), "solve_multipliers does not solve the equations"
assert sympy.simplify(left.subs(named, of_rhs)) != sympy.zeros(2, 1), "rhs solves the equations now"
assert sympy.simplify(of_solve + of_rhs) == 0, "the signs changed"
PY
