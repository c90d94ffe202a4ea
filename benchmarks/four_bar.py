"""Four-bar, position to jounce, beside routes that know this one mechanism.

CasADi's ``rootfinder`` (fast_newton) with four directional derivatives is its general route; an unrolled Newton
iteration with a hand-derived recursion is specialized by hand. SymPy differentiates the closed form of the angle.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

import jounce as jn
from benchmarks.cases import EXAMPLES, Case, Cases, Contestant, ready
from benchmarks.compiled_c import compiled
from benchmarks.references import KINEMATIC, error_of

AD, AB, BC, CD = 13.21, 4.00, 14.23, 20.31  # cm


def rocker(t: Any, m: Any, arctan2: Any) -> Any:
    """Return the angle of the rocker in closed form, with the functions of a module."""
    theta = np.pi / 6 + np.pi / 3 * m.sin(np.pi * t)
    x, y = AB * m.cos(theta) - AD, AB * m.sin(theta)
    distance = m.sqrt(x * x + y * y)
    cosine = (distance * distance + CD * CD - BC * BC) / (2 * CD * distance)
    return np.pi + arctan2(-y, -x) - arctan2(m.sqrt(1 - cosine * cosine), cosine)


def start() -> np.ndarray:
    """Return the angles of coupler and rocker at the first instant."""
    psi = rocker(0.0, np, np.arctan2)
    coupler = math.atan2(CD * math.sin(psi) - AB / 2, AD + CD * math.cos(psi) - AB * math.sqrt(3) / 2)
    return np.array([coupler, psi])


def closure(time: Any, unknown: Any) -> Any:
    """Return the loop equations in the angles of coupler and rocker, for CasADi."""
    import casadi

    theta = math.pi / 6 + math.pi / 3 * casadi.sin(math.pi * time)
    coupler, psi = unknown[0], unknown[1]
    return casadi.vertcat(
        AB * casadi.cos(theta) + BC * casadi.cos(coupler) - AD - CD * casadi.cos(psi),
        AB * casadi.sin(theta) + BC * casadi.sin(coupler) - CD * casadi.sin(psi),
    )


def general_route() -> Any:
    """Return the angle and four derivatives by CasADi's implicit function and directional derivatives."""
    import casadi

    unknown, t = casadi.SX.sym("x", 2), casadi.SX.sym("t")
    residual = casadi.Function("residual", [unknown, t], [closure(t, unknown)])
    finder = casadi.rootfinder("finder", "fast_newton", residual, {"abstol": 1e-14, "abstolStep": 1e-14})
    time = casadi.MX.sym("t")
    results = [finder(start(), time)[1]]
    for _ in range(4):
        results.append(casadi.jtimes(results[-1], time, casadi.MX(1)))
    return casadi.Function("general", [time], results)


def specialized_route() -> Any:
    """Return the same by seven unrolled Newton steps and a total derivative written for two unknowns."""
    import casadi

    unknown, t = casadi.SX.sym("x", 2), casadi.SX.sym("t")
    residual = closure(t, unknown)
    jacobian = casadi.jacobian(residual, unknown)
    determinant = jacobian[0, 0] * jacobian[1, 1] - jacobian[0, 1] * jacobian[1, 0]

    def solve(b: Any) -> Any:
        first = jacobian[1, 1] * b[0] - jacobian[0, 1] * b[1]
        second = jacobian[0, 0] * b[1] - jacobian[1, 0] * b[0]
        return casadi.vertcat(first / determinant, second / determinant)

    rates = [-solve(casadi.jacobian(residual, t))]
    for _ in range(3):
        rates.append(casadi.jacobian(rates[-1], t) + casadi.jtimes(rates[-1], unknown, rates[0]))
    newton = casadi.Function("newton", [unknown, t], [unknown - solve(residual)])
    derivatives = casadi.Function("derivatives", [unknown, t], [rate[1] for rate in rates])
    position = casadi.SX(start())
    for _ in range(7):
        position = newton(position, t)
    return casadi.Function("specialized", [t], [position[1], *derivatives(position, t)], {"cse": True})


def casadi_run(route: Callable[[], Any], time: np.ndarray) -> Callable[[], Any]:
    """Return the function that CasADi is timed by: C code mapped over all instants."""
    import casadi

    (function,), row = compiled([route()], len(time)), casadi.DM(time).T
    return lambda: function(row)


def sympy_run(time: np.ndarray) -> Callable[[], Any]:
    """Return NumPy code of the closed form and its four derivatives, with common subexpressions."""
    import sympy

    t = sympy.Symbol("t")
    levels = [rocker(t, sympy, sympy.atan2)]
    for _ in range(4):
        levels.append(sympy.diff(levels[-1], t))
    function = sympy.lambdify(t, levels, "numpy", cse=True)
    return lambda: function(time)


def cases(quick: bool) -> Cases:
    """Yield the grid of the file, and a long one."""
    mechanism = jn.load(EXAMPLES / "four_bar.yaml")
    for count, general, special in ((201, 1.0, None), (2001 if quick else 10_001, None, 1.8)):
        time = np.linspace(0.0, 2.0, count)
        error = error_of("four_bar", time, "psi")

        def of_columns(found: Any, error: Any = error) -> float:
            return error(np.stack([np.array(x).ravel() for x in found], axis=1))

        def of_motion(motion: Any, error: Any = error) -> float:
            return error(motion.outputs["psi"])

        def by(route: Callable[..., Any], time: np.ndarray = time) -> Callable[[], Any]:
            return lambda: casadi_run(route, time)

        yield Case(
            f"four-bar to jounce, {count:,} instants",
            [
                Contestant("jounce", ready(lambda time=time: jn.solve(mechanism, time)), of_motion),
                Contestant(
                    "CasADi rootfinder and jtimes, C code", by(general_route), of_columns, "casadi", aim=general
                ),
                Contestant(
                    "CasADi, specialized by hand, C code", by(specialized_route), of_columns, "casadi", aim=special
                ),
                Contestant("SymPy, closed form, NumPy", lambda time=time: sympy_run(time), of_columns, "sympy"),
            ],
            count=count,
            unit="instant",
            reference=KINEMATIC,
        )
