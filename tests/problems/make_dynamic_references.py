"""Make the references of dynamics again: python -m tests.problems.make_dynamic_references [NAME ...]  (a few minutes).

Each file in references/dynamics/ holds quantities and their derivatives at a few instants, as decimal strings of
thirty digits, from Taylor series of order 24 to 40 in fifty digits by tests/oracles; the last of them are not all
right, as the tolerance of most is 1e-28. The code under test has no part in them.
"""

import json
import sys
import time
from pathlib import Path

from mpmath import mp

from tests.oracles import mp_andrews, mp_benchmarks as benchmarks

FOLDER = Path(__file__).parent / "references" / "dynamics"
STORED = 30
LEVELS = 8  # derivatives of coordinates, the multipliers to two less


def text(number):
    """Return a number in thirty digits; what is zero up to the arithmetic becomes a plain zero."""
    return "0.0" if abs(number) < mp.mpf(10) ** -30 else mp.nstr(number, STORED)


def table(problem, nodes, levels=LEVELS):
    """Return derivatives of named nodes of a solved problem as text."""
    found = problem.derivatives(*nodes.values())
    return {name: [text(x) for x in row[:levels]] for name, row in zip(nodes, found, strict=True)}


def collected(problem, instants, nodes, order=30, tolerance="1e-28"):
    """Return the tables at instants of a free motion."""
    out = []
    for instant in instants:
        problem.integrate(instant, order, tolerance)
        problem.solve(LEVELS + 1)
        out.append({"time": str(instant), **{kind: table(problem, group) for kind, group in nodes.items()}})
    return out


def andrews():
    """Angles, multipliers of the test set, and the reactions of all ten pins."""
    problem = mp_andrews.angles()
    names = mp_andrews.NAMES
    start = problem.consistent(mp_andrews.START, [0] * 7, fixed=(1,))
    problem.start(0, *start)
    out = []
    for instant in ("0", "0.01", "0.02", "0.03"):
        problem.integrate(instant, 40, "1e-38")
        problem.solve(LEVELS + 1)
        multipliers = {f"lambda{k}": n for k, n in enumerate(problem.multipliers, 1)}
        found = {
            "time": instant,
            "angles": table(problem, dict(zip(names, problem.q, strict=True))),
            "multipliers": table(problem, multipliers, LEVELS - 2),
        }
        position, velocity = ([n.c[k] for n in problem.q] for k in (0, 1))
        absolute, bodies, pins = mp_andrews.absolute()
        absolute.start(instant, *mp_andrews.poses(bodies, position, velocity)).solve(LEVELS + 1)
        forces = {
            f"{pin}_{axis}": absolute.multipliers[2 * k + m]
            for k, pin in enumerate(pins)
            for m, axis in enumerate("xy")
        }
        rows = table(absolute, forces, LEVELS - 2)
        found["reactions"] = {name: [text(-mp.mpf(x)) for x in row] for name, row in rows.items()}
        out.append(found)
        problem.start(instant, position, velocity)
    return "seven angles of the test set; reactions act on the second body of each pin, global axes", out


def double_four_bar():
    """Angle of the uprights and the tip of the first one."""
    problem, tip = benchmarks.parallel_four_bar()
    problem.start(0, [mp.pi / 2], [-1])
    nodes = {"angles": {"a": problem.q[0]}, "tip": dict(zip("xy", tip, strict=True))}
    return "angle of the uprights; tip of the first one", collected(problem, ("1", "4", "10"), nodes)


def double_pendulum():
    """Absolute angles from the downward vertical, released from the horizontal."""
    problem = benchmarks.double_pendulum()
    problem.start(0, [mp.pi / 2] * 2, [0, 0])
    angles = dict(zip(("a", "b"), problem.q, strict=True))
    return "absolute angles", collected(problem, ("1", "2", "5", "10"), {"angles": angles}, tolerance="1e-36", order=36)


def flyball_governor():
    """Shaft, rods and slider of the stiff governor."""
    problem = benchmarks.flyball_governor()
    problem.start(0, *benchmarks.governor_start())
    names = dict(zip(("shaft", "right", "left", "s"), problem.q, strict=True))
    return "angles of shaft and rods, height of the slider", collected(
        problem, ("0.01", "0.1", "0.5"), {"coordinates": names}, tolerance="1e-22", order=24
    )


def spatial_slider_crank():
    """Crank angle and slide of the spatial slider-crank in free motion."""
    problem, (angle, x, rod) = benchmarks.spatial_slider_crank()
    problem.start(0, *benchmarks.slider_crank_start(problem))
    nodes = {"coordinates": {"angle": angle, "slide": x}, "rod": dict(zip("xyz", rod.position, strict=True))}
    return "crank angle, place of the slider, center of the rod", collected(problem, ("0.2", "1", "5"), nodes)


def slider_crank_spring():
    """The spatial slider-crank with a spring and a damper on its slider."""
    problem, (angle, x, rod) = benchmarks.spatial_slider_crank(200, 5)
    problem.start(0, *benchmarks.slider_crank_start(problem))
    nodes = {"coordinates": {"angle": angle, "slide": x}, "rod": dict(zip("xyz", rod.position, strict=True))}
    return "crank angle, place of the slider, center of the rod", collected(problem, ("0.2", "1"), nodes)


def free_four_bar():
    """A four-bar that swings freely from a crank angle of 1 rad at rest, and the force in its last pin."""
    problem = benchmarks.free_four_bar()
    problem.start(0, *problem.consistent([1, mp.mpf("0.4"), mp.mpf("1.5")], [0] * 3, fixed=(0,)))
    names = dict(zip(("crank", "coupler", "rocker"), problem.q, strict=True))
    forces = dict(zip("xy", problem.multipliers, strict=True))
    nodes = {"angles": names, "multipliers": forces}
    return "angles; multipliers: force on the coupler in its pin with the rocker", collected(
        problem, ("0", "0.5", "1"), nodes
    )


def spatial_double_pendulum():
    """Two bodies on crossed hinges."""
    problem, tip = benchmarks.spatial_double_pendulum()
    problem.start(0, [mp.mpf("1.2"), mp.mpf("0.5")], [0, 2])
    nodes = {
        "angles": dict(zip(("first", "second"), problem.q, strict=True)),
        "tip": dict(zip("xyz", tip, strict=True)),
    }
    return "hinge angles, tip of the second body", collected(problem, ("0.5", "2"), nodes)


def stewart():
    """Forces of the six legs at instants of the prescribed motion."""
    problem, plate = benchmarks.stewart()
    position, out = [0, 0, mp.mpf("0.42"), 1, 0, 0, 0], []
    for instant in ("0", "0.37", "1.1", "1.99"):
        problem.start(instant, position, [0] * 7)
        position, velocity = problem.consistent(position, [0] * 7)
        problem.start(instant, position, velocity).solve(LEVELS + 1)
        names = dict(zip(("x", "y", "z"), plate.position, strict=True))
        forces = {f"leg{k}": n for k, n in enumerate(problem.multipliers[1:], 1)}
        rows = table(problem, forces, LEVELS - 2)
        forces = {name: [text(-mp.mpf(x)) for x in row] for name, row in rows.items()}
        out.append({"time": instant, "center": table(problem, names), "forces": forces})
    return "center of mass of the platform; a leg that pushes has a positive force", out


MAKERS = (
    andrews,
    double_four_bar,
    double_pendulum,
    flyball_governor,
    free_four_bar,
    slider_crank_spring,
    spatial_double_pendulum,
    spatial_slider_crank,
    stewart,
)


def main(names):
    """Write the references named, or all."""
    FOLDER.mkdir(exist_ok=True)
    for maker in MAKERS:
        if names and maker.__name__ not in names:
            continue
        start = time.perf_counter()
        with mp.workdps(50):
            quantities, instants = maker()
        described = {"layout": "plain derivatives, SI units", "quantities": quantities, "instants": instants}
        path = FOLDER / f"{maker.__name__}.json"
        path.write_text(json.dumps(described, indent=0) + "\n", encoding="utf-8")
        print(f"{maker.__name__}: {time.perf_counter() - start:.1f} s")


if __name__ == "__main__":
    main(sys.argv[1:])
