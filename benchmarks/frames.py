"""Frames, Jacobians and energy of the Franka panda beside Pinocchio called from Python; splines beside SciPy."""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline

import jounce as jn
from benchmarks.arm import arm, pinocchio_arm
from benchmarks.cases import Case, Cases, Contestant, ready

LINK = "panda_hand"


def pinocchio_motion(q: np.ndarray) -> Callable[[], Any]:
    """Return a loop that gives position, velocity and acceleration of the hand, (samples, 3, 3)."""
    import pinocchio

    model = pinocchio_arm()
    data, frame, found = model.createData(), model.getFrameId(LINK), np.empty((len(q), 3, 3))
    aligned, states = pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED, np.ascontiguousarray(np.moveaxis(q[:, :3], 1, 0))

    def run() -> Any:
        for k, (x, v, a) in enumerate(zip(*states, strict=True)):
            pinocchio.forwardKinematics(model, data, x, v, a)
            found[k, 0] = pinocchio.updateFramePlacement(model, data, frame).translation
            found[k, 1] = pinocchio.getFrameVelocity(model, data, frame, aligned).linear
            found[k, 2] = pinocchio.getFrameClassicalAcceleration(model, data, frame, aligned).linear
        return found

    return run


def pinocchio_jacobians(q: np.ndarray) -> Callable[[], Any]:
    """Return a loop that gives the Jacobian of the hand and its rate, (samples, 2, 6, 7)."""
    import pinocchio

    model = pinocchio_arm()
    data, frame, found = model.createData(), model.getFrameId(LINK), np.empty((len(q), 2, 6, model.nv))
    aligned, states = pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED, np.ascontiguousarray(np.moveaxis(q[:, :2], 1, 0))

    def run() -> Any:
        for k, (x, v) in enumerate(zip(*states, strict=True)):
            pinocchio.computeJointJacobiansTimeVariation(model, data, x, v)
            found[k, 0] = pinocchio.getFrameJacobian(model, data, frame, aligned)
            found[k, 1] = pinocchio.getFrameJacobianTimeVariation(model, data, frame, aligned)
        return found

    return run


def pinocchio_energy(q: np.ndarray) -> Callable[[], Any]:
    """Return a loop that gives the kinetic energy, (samples,)."""
    import pinocchio

    model = pinocchio_arm()
    data, states = model.createData(), np.ascontiguousarray(np.moveaxis(q[:, :2], 1, 0))
    return lambda: np.array([pinocchio.computeKineticEnergy(model, data, x, v) for x, v in zip(*states, strict=True)])


def scipy_spline(knots: np.ndarray, values: np.ndarray, times: np.ndarray) -> Callable[[], Any]:
    """Return SciPy's spline and its derivatives, (times, 5, joints)."""
    spline = make_interp_spline(knots, values, k=5)
    derivatives = [spline.derivative(k) if k else spline for k in range(5)]
    return lambda: np.stack([each(times) for each in derivatives], axis=1)


def cases(quick: bool) -> Cases:
    """Yield each quantity; the error of both is how far they are from each other."""
    robot, samples, rng = arm(), 1000 if quick else 10_000, np.random.default_rng(3)
    q = rng.normal(size=(samples, 5, 7))
    two, three = np.ascontiguousarray(q[:, :2]), np.ascontiguousarray(q[:, :3])
    times, knots = np.sort(rng.uniform(0.0, 10.0, samples)), np.linspace(0.0, 10.0, 401)
    values = np.sin(knots[:, None] * np.arange(1.0, 8.0) / 3)
    spline = jn.JointTrajectory.from_samples(knots, values, robot.joint_names)
    pairs: dict[str, tuple[Callable[[], Any], Callable[[], Callable[[], Any]], str]] = {
        "position, velocity and acceleration of the hand": (
            lambda: jn.forward_kinematics(robot, three, LINK).position,
            lambda: pinocchio_motion(q),
            "pinocchio",
        ),
        "Jacobian of the hand and its rate": (
            lambda: jn.jacobian(robot, two, LINK),
            lambda: pinocchio_jacobians(q),
            "pinocchio",
        ),
        "kinetic energy": (
            lambda: jn.energy.kinetic_energy(robot, two).total[:, 0],
            lambda: pinocchio_energy(q),
            "pinocchio",
        ),
        "seven splines to the fourth derivative": (
            lambda: spline.derivatives(times, 4),
            lambda: scipy_spline(knots, values, times),
            "scipy",
        ),
    }
    for name, (ours, build, package) in pairs.items():
        known = ours()

        def apart(found: Any, known: Any = known) -> float:
            return float(np.abs(found - known).max() / np.abs(known).max())

        peer = Contestant("Pinocchio from Python" if package == "pinocchio" else "SciPy", build, apart, package)
        yield Case(
            f"{name}, {samples:,} samples",
            [Contestant("jounce", ready(ours)), peer],
            count=samples,
            unit="sample",
            reference="the library's own results, by the largest: both are equally far",
        )
