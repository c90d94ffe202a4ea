"""What jerk is worth: the two-point formula with it, and the same steps without it, on two planar mechanisms.

Sommer 2024, section 7, reports about ten times the accuracy from integrating jerk together with acceleration. Compared
here at the same steps, all projected onto the constraints in the same way: the trapezoidal rule (accelerations of both
ends), the classical Runge-Kutta method (four accelerations, order 4 as well), and Obreshkov of order 4, which is the
trapezoidal rule with jerk of both ends. Errors are the largest of all angles over the run.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jounce as jn
from benchmarks.cases import Case, Cases, Contestant, ready
from jounce import drivers, planar
from jounce.dynamics.forward.accelerations import State
from jounce.integrate import AbstractMethod
from jounce.integrate.mechanisms.diffrax_term import state_rates

GRID = np.linspace(0.0, 1.0, 17)  # s
STEPS = tuple(1 / 16 / n for n in (1, 2, 4, 8, 16, 32))  # s; all end on the grid


class RungeKutta(AbstractMethod):
    """The classical method of order 4, with steps of given length."""

    step: float
    joined: jn.Obreshkov = dataclasses.field(default_factory=lambda: jn.Obreshkov(2))  # for values inside a step

    def expansion_order(self, tolerance):
        return 1

    def longest_step(self, sizes, tolerance):
        return jnp.full(sizes.shape[1], self.step, float)

    def arrive(self, equations, expansion, time, step):
        def rates(lapse, state):
            one = jax.vmap(state_rates, in_axes=(0, -1, None), out_axes=-1)
            return one(time + lapse, state, equations)

        def moved(lapse, rate):
            return jax.tree.map(lambda a, b: a + lapse[None, None] * b, start, rate)

        start = State(*(part[0] for part in expansion.state))
        a = rates(0.0 * step, start)
        b = rates(0.5 * step, moved(0.5 * step, a))
        c = rates(0.5 * step, moved(0.5 * step, b))
        d = rates(step, moved(step, c))
        mean = jax.tree.map(lambda a, b, c, d: (a + 2.0 * b + 2.0 * c + d) / 6.0, a, b, c, d)
        return moved(step, mean)

    def polynomial(self, start, end, step):
        return self.joined.polynomial(start, end, step)

    def error(self, start, end, step, length):
        return jnp.zeros_like(step)


METHODS: dict[str, Callable[[float], AbstractMethod]] = {
    "with jerk: Obreshkov, order 4": lambda step: jn.Obreshkov(4, step=step),
    "acceleration: trapezoidal rule, order 2": lambda step: jn.Obreshkov(2, step=step),
    "acceleration: Runge-Kutta, order 4": RungeKutta,
}


def rod(place, angle, mass, length):
    """A uniform rod from its origin on."""
    return jn.Body(place, angle, mass=mass, inertia=mass * length**2 / 12, center_of_mass=[length / 2, 0])


def four_bar():
    """A four-bar of uniform rods that swings under gravity."""
    a, b, c = 0.3, 0.7, 0.5
    return jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        bodies={
            "crank": rod([0, 0], 1.0, 1.0, a),
            "coupler": rod([a * np.cos(1), a * np.sin(1)], 0.27, 2.0, b),
            "rocker": rod([0.6, 0], 1.08, 1.5, c),
        },
        joints={
            "A": planar.Revolute(("ground", "crank"), [0, 0], [0, 0]),
            "B": planar.Revolute(("crank", "coupler"), [a, 0], [0, 0]),
            "C": planar.Revolute(("rocker", "coupler"), [c, 0], [b, 0]),
            "D": planar.Revolute(("ground", "rocker"), [0.6, 0], [0, 0]),
        },
        initial={"start": drivers.CoordinateDriver(("ground", "crank"), "angle", "1 + 2*t")},
        outputs={name: jn.outputs.AngleOutput(name) for name in ("crank", "coupler", "rocker")},
    )


def slider_crank():
    """A slider-crank that turns over under gravity."""
    return jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        bodies={
            "crank": rod([0, 0], 1.0, 2.0, 0.3),
            "rod": rod([0.3 * np.cos(1), 0.3 * np.sin(1)], -0.255, 1.5, 1.0),
            "slider": jn.Body([1.13, 0], mass=1.0, inertia=0.01),
        },
        joints={
            "O": planar.Revolute(("ground", "crank"), [0, 0], [0, 0]),
            "A": planar.Revolute(("crank", "rod"), [0.3, 0], [0, 0]),
            "B": planar.Revolute(("rod", "slider"), [1, 0], [0, 0]),
            "guide": planar.Prismatic(("ground", "slider"), [0, 0], [0, 0], [1, 0], [1, 0]),
        },
        initial={"start": drivers.CoordinateDriver(("ground", "crank"), "angle", "1 + 5*t")},
        outputs={"crank": jn.outputs.AngleOutput("crank"), "rod": jn.outputs.AngleOutput("rod")},
    )


def cases(quick: bool) -> Cases:
    """Yield both mechanisms at each step, the method with jerk first."""
    for title, mechanism in (("four-bar", four_bar()), ("slider-crank", slider_crank())):

        def angles(method: AbstractMethod, mechanism: jn.Mechanism = mechanism) -> np.ndarray:
            motion = jn.simulate(mechanism, GRID, 1, method=method)
            return np.stack([motion.outputs[name][:, 0] for name in mechanism.outputs])

        exact = angles(jn.Taylor())

        def error(found: Any, exact: np.ndarray = exact) -> float:
            return float(np.abs(found - exact).max())

        for step in STEPS[:1] if quick else STEPS:

            def by(method: Callable[[float], AbstractMethod], step: float = step, angles: Any = angles) -> Any:
                return ready(lambda: angles(method(step)))

            yield Case(
                f"{title} of rods, steps of {step * 1e3:.3g} ms",
                [Contestant(name, by(method), error) for name, method in METHODS.items()],
                reference="Taylor series of this library at rounding, the largest of all angles, rad",
                rounds=3,
                at={"step": step},
            )
