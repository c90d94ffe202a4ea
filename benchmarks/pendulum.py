"""Double pendulum from horizontal rest, 10 s: time against error, beside SciPy, diffrax, heyoka and Exudyn.

The peers integrate two angles with the equations of motion written by hand (Exudyn: its kinematic tree). jounce reads a
mechanism file, in absolute coordinates with four constraints. The motion is chaotic and makes about 1e7 times more of
an error on the way, so that tolerances say little: the last cases compare at equal error.
"""

import json
import math
from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jounce as jn
from benchmarks.cases import EXAMPLES, ROOT, CannotRunError, Case, Cases, Contestant

GRAVITY, STOP = 9.81, 10.0
START = (math.pi / 2, math.pi / 2, 0.0, 0.0)  # angles from the downward vertical, and their rates
TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14)
TARGETS = {1e-4: None, 1e-6: None, 1e-8: 2.0}  # errors, rad, and the most that the library should take of Dopri8's time
REFERENCE = "thirty digits of both angles at 10 s (tests/problems/references/dynamics)"

Run = Callable[[], np.ndarray]


def error(found: np.ndarray) -> float:
    """Return the larger error of both angles at 10 s, rad."""
    path = ROOT / "tests" / "problems" / "references" / "dynamics" / "double_pendulum.json"
    last = json.loads(path.read_text(encoding="utf-8"))["instants"][-1]
    return float(np.max(np.abs(found - [float(last["angles"][name][0]) for name in "ab"])))


def accelerations(a: Any, b: Any, u: Any, v: Any, sin: Any, cos: Any) -> Any:
    """Return the angular accelerations of two point masses of 1 kg on massless rods of 1 m."""
    d = a - b
    s, c = sin(d), cos(d)
    denominator = 2.0 - c * c
    first = (-s * (u * u * c + v * v) - 2 * GRAVITY * sin(a) + GRAVITY * sin(b) * c) / denominator
    second = (2 * s * u * u + s * c * v * v - 2 * GRAVITY * sin(b) + 2 * GRAVITY * sin(a) * c) / denominator
    return first, second


def by_jounce(tolerance: float) -> Run:
    """Return the library's run: one expansion a step, and the state at the end."""
    mechanism, instants = jn.load(EXAMPLES / "double_pendulum.yaml"), np.array([0.0, STOP])

    def run() -> np.ndarray:
        motion = jn.simulate(mechanism, instants, 1, tolerance=tolerance)
        return np.array([motion.outputs[name][-1, 0] for name in "ab"]) + math.pi / 2

    return run


def by_robot(tolerance: float) -> Run:
    """Return the library's run of the same as a robot, whose coordinates are those of its joints."""
    mass = jn.Inertia(1.0, center_of_mass=[1.0, 0.0, 0.0])
    links = [jn.Link("base"), jn.Link("upper", mass), jn.Link("lower", mass)]
    a = jn.Joint("a", "base", "upper", "continuous", axis=[0, 0, 1])
    b = jn.Joint("b", "upper", "lower", "continuous", axis=[0, 0, 1], position=[1.0, 0.0, 0.0])
    robot = jn.Robot("double pendulum", links, [a, b], gravity=[0.0, -GRAVITY, 0.0])
    instants = np.array([0.0, STOP])

    def run() -> np.ndarray:
        motion = jn.simulate(robot, instants, 1, tolerance=tolerance)
        return np.cumsum(motion.q[-1, 0]) + math.pi / 2

    return run


def by_scipy(tolerance: float, start: tuple[float, ...] = START) -> Run:
    """Return DOP853 on a function of plain floats, its fastest use from Python."""
    from scipy.integrate import solve_ivp

    def slope(_: float, state: Any) -> Any:
        a, b, u, v = state.tolist()
        return (u, v, *accelerations(a, b, u, v, math.sin, math.cos))

    options = {"method": "DOP853", "rtol": max(tolerance, 2.3e-14), "atol": tolerance}
    return lambda: solve_ivp(slope, (0.0, STOP), start, **options).y[:2, -1]


def dopri8(start: Any, tolerance: Any) -> Any:
    """Return both angles at the end from diffrax's Dopri8, for JAX to compile."""
    import diffrax

    def slope(_: Any, state: Any, __: Any) -> Any:
        return jnp.stack([state[2], state[3], *accelerations(*state, jnp.sin, jnp.cos)])

    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(slope),
        diffrax.Dopri8(),
        0.0,
        STOP,
        1e-3,
        start,
        saveat=diffrax.SaveAt(t1=True),
        stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance),
        max_steps=1_000_000,
    )
    return solution.ys[0, :2]


compiled_dopri8 = jax.jit(dopri8)


def by_diffrax(tolerance: float) -> Run:
    """Return Dopri8, compiled once for all tolerances."""
    return lambda: np.asarray(compiled_dopri8(jnp.array(START), tolerance))


def by_heyoka(tolerance: float) -> Run:
    """Return heyoka's Taylor integrator; its first step is limited, as most coefficients vanish at the start."""
    import heyoka

    a, b, u, v = heyoka.make_vars("a", "b", "u", "v")
    slopes = zip((a, b, u, v), (u, v, *accelerations(a, b, u, v, heyoka.sin, heyoka.cos)), strict=True)
    integrator = heyoka.taylor_adaptive(list(slopes), list(START), tol=tolerance)

    def run() -> np.ndarray:
        integrator.time = 0.0
        integrator.state[:] = START
        integrator.step(max_delta_t=0.03)
        integrator.propagate_until(STOP)
        return integrator.state[:2].copy()

    return run


def by_exudyn(tolerance: float) -> Run:
    """Return Exudyn's kinematic tree with its adaptive explicit solver; the model is built again for each run."""
    import exudyn
    from exudyn.utilities import ObjectKinematicTree

    still = {name: [0.0, 0.0] for name in ("referenceCoordinates", "initialCoordinates", "initialCoordinates_t")}

    def build() -> Any:
        system = exudyn.SystemContainer().AddSystem()
        node = system.AddNode({"nodeType": "GenericODE2", "numberOfODE2Coordinates": 2} | still)
        tree = ObjectKinematicTree(
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
        system.AddObject(tree)
        system.Assemble()
        return system

    chosen = exudyn.SimulationSettings()
    chosen.solution.file.write = False
    integration = chosen.timeIntegration
    integration.endTime, integration.numberOfSteps, integration.verboseMode = STOP, 100, 0
    integration.relativeTolerance = integration.absoluteTolerance = tolerance
    integration.explicit.computeEndOfStepAccelerations = False

    def run() -> np.ndarray:
        system = build()
        system.SolveDynamic(chosen, solverType=exudyn.DynamicSolverType.DOPRI5)
        first, second = system.systemData.GetODE2Coordinates()
        return np.array([first, first + second]) + math.pi / 2

    return run


METHODS: dict[str, tuple[Callable[[float], Run], str, float]] = {
    "jounce Taylor, absolute coordinates": (by_jounce, "", 1e-15),
    "diffrax Dopri8": (by_diffrax, "diffrax", 1e-14),
    "SciPy DOP853": (by_scipy, "scipy", 1e-14),
    "heyoka Taylor": (by_heyoka, "heyoka", 1e-14),
    "Exudyn tree, DOPRI5": (by_exudyn, "exudyn", 1e-12),
}
"""How each is run, the package it needs, and the smallest tolerance that it is asked for."""


def reaching(target: float, make: Callable[[float], Run], smallest: float) -> Run:
    """Return the run at the loosest tolerance, a power of ten, that brings the error to the target."""
    for k in range(4, 16):
        tolerance = 10.0**-k
        if tolerance > 0.9 * smallest and error((run := make(tolerance))()) <= target:
            return run
    raise CannotRunError(f"no tolerance down to {smallest:g} brings the error to {target:g} rad")


def at_tolerance(tolerance: float, make: Callable[[float], Run], smallest: float) -> Run:
    """Return the run at a tolerance."""
    if tolerance < 0.9 * smallest:
        raise CannotRunError(f"it is not asked for less than {smallest:g}")
    return make(tolerance)


def cases(quick: bool) -> Cases:
    """Yield all methods at each tolerance, and at equal errors."""

    def case(name: str, build: Callable[..., Run], aim: float | None = None, **more: Any) -> Case:
        contestants = [
            Contestant(title, partial(build, make, smallest), error, needs, aim=aim if needs == "diffrax" else None)
            for title, (make, needs, smallest) in METHODS.items()
        ]
        return Case(f"double pendulum, 10 s, {name}", contestants, reference=REFERENCE, **more)

    titled = {
        "jounce Taylor, as a robot in the angles of its joints": by_robot,
        "jounce Taylor, absolute coordinates": by_jounce,
    }
    for (title, make), aim in zip(titled.items(), (4.0, 8.0), strict=True):
        peer = Contestant(
            "heyoka Taylor", partial(at_tolerance, 1e-8, *METHODS["heyoka Taylor"][::2]), error, "heyoka", aim=aim
        )
        yield Case(
            f"double pendulum, 10 s, tolerance 1e-08, {title.partition(', ')[2]}",
            [Contestant(title, partial(make, 1e-8), error), peer],
            reference=REFERENCE,
            rounds=5,
        )
    for tolerance in TOLERANCES[1:3] if quick else TOLERANCES:
        at = {"tolerance": tolerance}
        yield case(f"tolerance {tolerance:g}", partial(at_tolerance, tolerance), rounds=5, at=at)
    for target, aim in list(TARGETS.items())[2:] if quick else TARGETS.items():
        yield case(f"error at most {target:g} rad", partial(reaching, target), aim=aim)
