"""A gradient by a hundred parameters beside the solution that it is of; families beside a grid and a loop."""

from typing import Any

import jax
import numpy as np

import jounce as jn
from benchmarks.cases import EXAMPLES, Case, Cases, Contestant, ready

LINKS = 25  # four-bars in a chain, with four parameters each


def chain(count: int) -> jn.Mechanism:
    """Return four-bars, each driven by the rocker of the one before, with four lengths of its own."""
    parameters, bodies, joints = {}, {}, {}
    for k in range(count):
        parameters |= {f"a{k}": 0.10, f"b{k}": 0.40, f"c{k}": 0.35, f"d{k}": 0.45}
        x = f"{k}*0.6"
        bodies[f"crank{k}"] = jn.Body([x, 0.0], angle=1.0)
        bodies[f"rocker{k}"] = jn.Body([f"{x} + d{k}", 0.0], angle=1.9)
        joints[f"A{k}"] = jn.planar.Revolute(("ground", f"crank{k}"), [x, 0.0], [0.0, 0.0])
        joints[f"D{k}"] = jn.planar.Revolute(("ground", f"rocker{k}"), [f"{x} + d{k}", 0.0], [0.0, 0.0])
        joints[f"B{k}"] = jn.planar.DoubleRevolute((f"crank{k}", f"rocker{k}"), [f"a{k}", 0.0], [f"c{k}", 0.0], f"b{k}")
        if k:
            pair = (f"rocker{k - 1}", f"crank{k}")
            joints[f"G{k}"] = jn.planar.Coordinate(pair, "angle", ratio=1.0)
    driver = jn.drivers.CoordinateDriver(("ground", "crank0"), "angle", motion="1 + 0.2*sin(2*pi*t)")
    return jn.Mechanism(
        space="planar",
        bodies=bodies,
        joints=joints,
        drivers={"theta": driver},
        outputs={f"psi{k}": jn.outputs.AngleOutput(f"rocker{k}") for k in range(count)},
        parameters=parameters,
    )


def family_beside_a_grid(quick: bool) -> Case:
    """Return an instant of many four-bars beside one of a long grid of one of them."""
    designs, instants = (64, 1025) if quick else (2000, 100_001)
    four_bar = jn.load(EXAMPLES / "four_bar.yaml")
    lengths, time = np.linspace(0.13, 0.15, designs), np.linspace(0.0, 2.0, 201)
    known = jn.solve(four_bar.with_parameters(BC=float(lengths[0])), time).outputs["psi"]

    def family() -> Any:
        return jn.solve_batch(four_bar, {"BC": lengths}, time, threads=1)["psi"].values

    def error(found: Any) -> float:
        return float((np.abs(found[0] - known) / np.abs(known).max(axis=0)).max())

    def grid() -> Any:
        return jn.solve(four_bar, np.linspace(0.0, 2.0, instants), threads=1)

    return Case(
        f"{designs:,} four-bars to jounce, {len(time)} instants each",
        [
            Contestant("a family", ready(family), error),
            Contestant(f"one of them at {instants:,} instants", ready(grid), count=instants, aim=1.3),
        ],
        count=designs * len(time),
        unit="instant",
        reference="one of them solved alone, over the largest value of each derivative",
        rounds=7,
    )


def cases(quick: bool) -> Cases:
    """Yield the gradient of a chain, and families of four-bars and six-bars."""
    links, instants = (3, 51) if quick else (LINKS, 201)
    mechanism, time = chain(links), np.linspace(0.0, 1.0, instants)
    values = dict(mechanism.parameters)

    def all_jounces(values: Any) -> Any:
        motion = jn.solve(mechanism.with_parameters(**values), time, order=4)
        return sum(found[-1, 4] for found in motion.outputs.values())

    slope = jax.grad(all_jounces)
    yield Case(
        f"chain of {links} four-bars to jounce, {instants} instants, {len(values)} parameters",
        [
            Contestant("gradient, reverse", ready(lambda: np.array(list(slope(values).values())))),
            Contestant("solution alone", ready(lambda: all_jounces(values)), aim=6.0),
        ],
        rounds=5,
    )
    yield family_beside_a_grid(quick)
    designs, count = (8, 51) if quick else (200, 361)
    six_bar = jn.load(EXAMPLES / "six_bar_stephenson.yaml")
    radii, time = np.linspace(0.038, 0.042, designs), np.linspace(0.0, 2.0, count)
    known = np.stack([jn.solve(six_bar.with_parameters(r=r), time).outputs["output_angle"] for r in radii[:3].tolist()])

    def error(found: Any) -> float:
        size = np.abs(known).max(axis=(0, 1))
        return float((np.abs(found[:3] - known) / size).max())

    def loop() -> Any:
        return np.stack([jn.solve(six_bar.with_parameters(r=r), time).outputs["output_angle"] for r in radii.tolist()])

    yield Case(
        f"{designs} six-bars to jounce, {count} instants",
        [
            Contestant(
                "one program", ready(lambda: jn.solve_batch(six_bar, {"r": radii}, time)["output_angle"].values), error
            ),
            Contestant("a loop of solutions", ready(loop), error),
        ],
        count=designs,
        unit="design",
        reference="three of them solved alone, over the largest value of each derivative",
        rounds=3,
    )
