"""Double pendulum from horizontal rest, 10 s: work against precision, beside SciPy, diffrax, heyoka and Exudyn.

The peers integrate two angles with the equations of motion written by hand (Exudyn: its kinematic tree). jounce reads a
mechanism file, in absolute coordinates with four constraints. Errors are those of both angles at 10 s against a
reference of thirty digits; the motion is chaotic and makes about 1e7 times more of an error on the way.
Run: ``python benchmarks/double_pendulum.py [--figure docs/images/work_precision.png]``; a peer that is not installed is
left out and said so.
"""

import argparse
import importlib.util
import json
import math
import statistics
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

from timing import use_one_core

use_one_core()

import numpy as np  # noqa: E402

import jounce as jn  # noqa: E402

ROOT = Path(__file__).parents[1]
GRAVITY, STOP = 9.81, 10.0
START = (math.pi / 2, math.pi / 2, 0.0, 0.0)
TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14)
TARGET = 1e-10  # error asked for in the table of ratios, and tolerance of the peers
OURS, BASE = "jounce Taylor, absolute coordinates", "SciPy DOP853"

Point = tuple[float, float, float]  # tolerance, seconds, error
Run = Callable[[], np.ndarray]


def reference() -> np.ndarray:
    """Return both angles at 10 s, from the downward vertical."""
    path = ROOT / "tests" / "problems" / "references" / "dynamics" / "double_pendulum.json"
    last = json.loads(path.read_text(encoding="utf-8"))["instants"][-1]
    assert float(last["time"]) == STOP
    return np.array([float(last["angles"][name][0]) for name in "ab"])


def accelerations(a, b, u, v, sin, cos):
    """Return the angular accelerations of two point masses of 1 kg on massless rods of 1 m."""
    d = a - b
    s, c = sin(d), cos(d)
    denominator = 2.0 - c * c
    first = (-s * (u * u * c + v * v) - 2 * GRAVITY * sin(a) + GRAVITY * sin(b) * c) / denominator
    second = (2 * s * u * u + s * c * v * v - 2 * GRAVITY * sin(b) + 2 * GRAVITY * sin(a) * c) / denominator
    return first, second


def jounce_runs() -> Iterator[tuple[float, Run]]:
    """Yield the library's runs: one expansion a step, and the state at the end."""
    mechanism = jn.load(ROOT / "examples" / "double_pendulum.yaml")
    instants = np.array([0.0, STOP])

    def run(tolerance: float) -> np.ndarray:
        motion = jn.simulate(mechanism, instants, 1, tolerance=tolerance)
        return np.array([motion.outputs[name][-1, 0] for name in "ab"]) + math.pi / 2

    for tolerance in (*TOLERANCES, 1e-15):
        yield tolerance, lambda tolerance=tolerance: run(tolerance)


def scipy_runs() -> Iterator[tuple[float, Run]]:
    """Yield DOP853 on a function of plain floats, its fastest use from Python."""
    from scipy.integrate import solve_ivp

    def slope(_, state):
        a, b, u, v = state.tolist()
        return (u, v, *accelerations(a, b, u, v, math.sin, math.cos))

    for tolerance in (*TOLERANCES[:-1], 2.3e-14):
        yield (
            tolerance,
            lambda tolerance=tolerance: solve_ivp(
                slope, (0.0, STOP), START, method="DOP853", rtol=tolerance, atol=tolerance
            ).y[:2, -1],
        )


def diffrax_runs() -> Iterator[tuple[float, Run]]:
    """Yield Dopri8, compiled once for all tolerances."""
    import diffrax
    import jax
    import jax.numpy as jnp

    def slope(_, state, __):
        first, second = accelerations(*state, jnp.sin, jnp.cos)
        return jnp.stack([state[2], state[3], first, second])

    @jax.jit
    def solve(tolerance):
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(slope),
            diffrax.Dopri8(),
            0.0,
            STOP,
            1e-3,
            jnp.array(START),
            saveat=diffrax.SaveAt(t1=True),
            stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance),
            max_steps=1_000_000,
        )
        return solution.ys[0, :2]

    for tolerance in TOLERANCES:
        yield tolerance, lambda tolerance=tolerance: np.asarray(solve(tolerance))


def heyoka_runs() -> Iterator[tuple[float, Run]]:
    """Yield heyoka's Taylor integrator; its first step is limited, as most coefficients vanish at the start."""
    import heyoka

    a, b, u, v = heyoka.make_vars("a", "b", "u", "v")
    slopes = zip((a, b, u, v), (u, v, *accelerations(a, b, u, v, heyoka.sin, heyoka.cos)), strict=True)
    equations = list(slopes)
    for tolerance in (*TOLERANCES[:-1], 2.3e-16):
        integrator = heyoka.taylor_adaptive(equations, list(START), tol=tolerance)

        def run(integrator=integrator) -> np.ndarray:
            integrator.time = 0.0
            integrator.state[:] = START
            integrator.step(max_delta_t=0.03)
            integrator.propagate_until(STOP)
            return integrator.state[:2].copy()

        yield tolerance, run


def exudyn_runs() -> Iterator[tuple[float, Run]]:
    """Yield Exudyn's kinematic tree with its adaptive explicit solver; the model is built again for each run."""
    import exudyn
    from exudyn.utilities import ObjectKinematicTree

    def build():
        container = exudyn.SystemContainer()
        system = container.AddSystem()
        node = system.AddNode(
            {
                "nodeType": "GenericODE2",
                "referenceCoordinates": [0.0, 0.0],
                "initialCoordinates": [0.0, 0.0],
                "initialCoordinates_t": [0.0, 0.0],
                "numberOfODE2Coordinates": 2,
            }
        )
        system.AddObject(
            ObjectKinematicTree(
                nodeNumber=node,
                jointTypes=[exudyn.JointType.RevoluteZ] * 2,
                linkParents=[-1, 0],
                jointTransformations=exudyn.Matrix3DList([np.eye(3)] * 2),
                jointOffsets=exudyn.Vector3DList([[0, 0, 0], [1, 0, 0]]),
                linkInertiasCOM=exudyn.Matrix3DList([np.zeros((3, 3))] * 2),
                linkCOMs=exudyn.Vector3DList([[1, 0, 0], [1, 0, 0]]),
                linkMasses=[1.0, 1.0],
                gravity=[0.0, -GRAVITY, 0.0],
            )
        )
        system.Assemble()
        return system

    def settings(tolerance):
        chosen = exudyn.SimulationSettings()
        chosen.solution.file.write = False
        integration = chosen.timeIntegration
        integration.endTime, integration.numberOfSteps, integration.verboseMode = STOP, 100, 0
        integration.relativeTolerance = integration.absoluteTolerance = tolerance
        integration.explicit.computeEndOfStepAccelerations = False
        return chosen

    def run(tolerance) -> np.ndarray:
        system = build()
        system.SolveDynamic(settings(tolerance), solverType=exudyn.DynamicSolverType.DOPRI5)
        first, second = system.systemData.GetODE2Coordinates()
        return np.array([first, first + second]) + math.pi / 2

    for tolerance in TOLERANCES[1:-1]:
        yield tolerance, lambda tolerance=tolerance: run(tolerance)


COMPETITORS = {
    OURS: ("jounce", jounce_runs),
    BASE: ("scipy", scipy_runs),
    "diffrax Dopri8": ("diffrax", diffrax_runs),
    "heyoka Taylor": ("heyoka", heyoka_runs),
    "Exudyn tree, DOPRI5": ("exudyn", exudyn_runs),
}


def measured(rounds: int) -> dict[str, list[Point]]:
    """Return tolerance, median seconds and error of every run; all competitors take turns in each round."""
    truth, entries = reference(), []
    for name, (package, runs) in COMPETITORS.items():
        if importlib.util.find_spec(package) is None:
            print(f"{name}: left out, {package} is not installed")
            continue
        entries += [(name, tolerance, run) for tolerance, run in runs()]
    errors = [float(np.max(np.abs(run() - truth))) for _, _, run in entries]
    seconds: list[list[float]] = [[] for _ in entries]
    for _ in range(rounds):
        for k, (_, _, run) in enumerate(entries):
            start = time.perf_counter()
            run()
            seconds[k].append(time.perf_counter() - start)
    found: dict[str, list[Point]] = {}
    for (name, tolerance, _), error, times in zip(entries, errors, seconds, strict=True):
        found.setdefault(name, []).append((tolerance, statistics.median(times), error))
    return found


def cheapest(points: list[Point], error: float) -> float:
    """Return the seconds that an error takes, between the runs of a method; NaN if it does not get there."""
    best = math.nan
    for (_, first, coarse), (_, second, fine) in pairwise(points):
        if fine <= error < coarse:
            share = math.log(coarse / error) / math.log(coarse / fine)
            best = np.nanmin([best, first * (second / first) ** share])
    return float(best)


def report(found: dict[str, list[Point]]) -> None:
    """Print the table, and the ratios at equal errors and at equal tolerance."""
    print(f"double pendulum from horizontal rest, {STOP:g} s, one core")
    for name, points in found.items():
        for tolerance, seconds, error in points:
            print(f"  {name:<38} tolerance {tolerance:7.1e} {seconds * 1e3:10.3f} ms   error {error:8.1e}")
    for error in (1e-4, 1e-6, 1e-8):
        needed = {name: cheapest(points, error) for name, points in found.items()}
        ratios = ", ".join(f"{name} {value / needed[BASE]:.3f}" for name, value in needed.items() if value > 0)
        print(f"time for an error of {error:g}, by that of {BASE}: {ratios}")
    at_target = {name: [s for t, s, _ in points if t == TARGET] for name, points in found.items()}
    if at_target.get(BASE) and at_target.get(OURS):
        print(f"at a tolerance of {TARGET:g}, jounce / {BASE}: {at_target[OURS][0] / at_target[BASE][0]:.3f}")


def draw(found: dict[str, list[Point]], path: Path) -> None:
    """Write the figure: error at the end against time spent."""
    from jounce.plot.style import LINE_COLOURS, RESOLUTION, blank_figure, style

    with style():
        figure = blank_figure(7.5, 3.8)
        axes = figure.subplots()
        axes.set_title("Double pendulum from horizontal rest")
        for (name, points), marker, colour in zip(found.items(), "os^Dv", LINE_COLOURS, strict=False):
            times, errors = [s * 1e3 for _, s, _ in points], [e for _, _, e in points]
            axes.loglog(times, errors, color=colour, marker=marker, label=name)
        axes.set_xlabel("time for 10 s of motion, one core  (ms)")
        axes.set_ylabel("error of the angles at 10 s  (rad)")
        axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0))
        figure.savefig(path, dpi=RESOLUTION)
    print(f"wrote {path}")


def main() -> None:
    """Measure, print, and draw where asked."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--figure", type=Path, help="file of the figure, .png or .svg")
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    found = measured(options.rounds)
    report(found)
    if options.figure is not None:
        draw(found, options.figure)


if __name__ == "__main__":
    main()
