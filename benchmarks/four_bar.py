"""Four-bar, position to jounce over 10,000 instants, beside CasADi's general and hand-specialised routes.

CasADi compiles C code for this one mechanism: ``rootfinder`` (fast_newton) with four directional derivatives is its
general route; an unrolled Newton iteration with a hand-derived recursion is the specialised one. jounce reads a file.
Run: ``python benchmarks/four_bar.py`` (needs CasADi and a C compiler).
"""

import math
import subprocess
import tempfile
from pathlib import Path

from timing import race, report, use_one_core

use_one_core()

import casadi  # noqa: E402
import numpy as np  # noqa: E402

import jounce as jn  # noqa: E402

INSTANTS = 10_000
AD, AB, BC, CD = 13.21, 4.00, 14.23, 20.31  # cm
GENERAL = "CasADi rootfinder fast_newton + jtimes, C code"


def closure(time, unknown):
    """Return the loop equations in the angles of coupler and rocker."""
    theta = math.pi / 6 + math.pi / 3 * casadi.sin(math.pi * time)
    coupler, rocker = unknown[0], unknown[1]
    return casadi.vertcat(
        AB * casadi.cos(theta) + BC * casadi.cos(coupler) - AD - CD * casadi.cos(rocker),
        AB * casadi.sin(theta) + BC * casadi.sin(coupler) - CD * casadi.sin(rocker),
    )


def compiled(function, folder: Path):
    """Return a CasADi function compiled by gcc, mapped over all instants."""
    generator = casadi.CodeGenerator(f"{function.name()}.c")
    generator.add(function)
    generator.generate(f"{folder}/")
    library = folder / f"{function.name()}.so"
    source = folder / f"{function.name()}.c"
    subprocess.check_call(["gcc", "-fPIC", "-shared", "-O3", "-march=native", str(source), "-o", str(library), "-lm"])
    return casadi.external(function.name(), str(library)).map(INSTANTS)


def general_route(start, folder: Path):
    """Return the output angle and four derivatives by CasADi's implicit function and directional derivatives."""
    unknown, t = casadi.SX.sym("x", 2), casadi.SX.sym("t")
    residual = casadi.Function("residual", [unknown, t], [closure(t, unknown)])
    options = {"abstol": 1e-14, "abstolStep": 1e-14}
    finder = casadi.rootfinder("finder", "fast_newton", residual, options)
    time = casadi.MX.sym("t")
    results = [finder(start, time)[1]]
    for _ in range(4):
        results.append(casadi.jtimes(results[-1], time, casadi.MX(1)))
    return compiled(casadi.Function("general", [time], results), folder)


def specialised_route(start, folder: Path):
    """Return the same by seven unrolled Newton steps and a total derivative written for two unknowns."""
    unknown, t = casadi.SX.sym("x", 2), casadi.SX.sym("t")
    residual = closure(t, unknown)
    jacobian = casadi.jacobian(residual, unknown)
    determinant = jacobian[0, 0] * jacobian[1, 1] - jacobian[0, 1] * jacobian[1, 0]

    def solve(b):
        first = jacobian[1, 1] * b[0] - jacobian[0, 1] * b[1]
        second = jacobian[0, 0] * b[1] - jacobian[1, 0] * b[0]
        return casadi.vertcat(first / determinant, second / determinant)

    rates = [-solve(casadi.jacobian(residual, t))]
    for _ in range(3):
        rates.append(casadi.jacobian(rates[-1], t) + casadi.jtimes(rates[-1], unknown, rates[0]))
    newton = casadi.Function("newton", [unknown, t], [unknown - solve(residual)])
    derivatives = casadi.Function("derivatives", [unknown, t], [rate[1] for rate in rates])
    position = casadi.SX(start)
    for _ in range(7):
        position = newton(position, t)
    results = [position[1], *derivatives(position, t)]
    return compiled(casadi.Function("specialised", [t], results, {"cse": True}), folder)


def main() -> None:
    """Print the ratios; the aim is 1 at most, beside the general route."""
    mechanism = jn.load(Path(__file__).parents[1] / "examples" / "four_bar.yaml")
    time = np.arange(INSTANTS) * 2.0 / INSTANTS
    motion = jn.solve(mechanism, time)
    psi = motion.outputs["psi"][0, 0]
    tip = np.array([AD + CD * math.cos(psi), CD * math.sin(psi)])
    pin = np.array([AB * math.cos(math.pi / 6), AB * math.sin(math.pi / 6)])
    start = np.array([math.atan2(*(tip - pin)[::-1]), psi])
    row = casadi.DM(time).T
    with tempfile.TemporaryDirectory() as folder:
        general, specialised = (route(start, Path(folder)) for route in (general_route, specialised_route))
        reference = np.array([np.array(column).ravel() for column in general(row)]).T
        difference = np.max(np.abs(motion.outputs["psi"] - reference) / np.max(np.abs(reference), axis=0), axis=0)
        print("largest difference from CasADi, normalised, position to jounce:", *(f"{d:.1e}" for d in difference))
        competitors = {
            GENERAL: lambda: general(row),
            "CasADi, specialised by hand to this mechanism, C code": lambda: specialised(row),
            "jounce.solve of the mechanism file": lambda: jn.solve(mechanism, time),
        }
        report(f"four-bar, {INSTANTS} instants, one core", race(competitors), INSTANTS, GENERAL)


if __name__ == "__main__":
    main()
