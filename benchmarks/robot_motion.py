"""Frames, Jacobians and energy of the Franka panda over 10,000 samples, beside Pinocchio; splines beside SciPy.

All results are compared before they are timed. Run: ``python benchmarks/robot_motion.py`` (needs Pinocchio).
"""

from pathlib import Path

from timing import race, report, use_one_core

use_one_core()

import numpy as np  # noqa: E402
import pinocchio  # noqa: E402
from scipy.interpolate import make_interp_spline  # noqa: E402

import jounce as jn  # noqa: E402

SAMPLES = 10_000
ARM = Path(__file__).parents[1] / "examples" / "robots" / "panda.urdf"
FINGERS = ("panda_finger_joint1", "panda_finger_joint2")
LINK = "panda_hand"
ALIGNED = pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED


def pinocchio_results(model, q):
    """Return functions that give each quantity for all samples, from loops over Pinocchio's Python functions."""
    data, frame = model.createData(), model.getFrameId(LINK)
    q, v, a = (np.ascontiguousarray(q[:, k]) for k in range(3))

    def motion():
        found = np.empty((len(q), 3, 3))
        for k in range(len(q)):
            pinocchio.forwardKinematics(model, data, q[k], v[k], a[k])
            found[k, 0] = pinocchio.updateFramePlacement(model, data, frame).translation
            found[k, 1] = pinocchio.getFrameVelocity(model, data, frame, ALIGNED).linear
            found[k, 2] = pinocchio.getFrameClassicalAcceleration(model, data, frame, ALIGNED).linear
        return found

    def jacobians():
        found = np.empty((len(q), 2, 6, model.nv))
        for k in range(len(q)):
            pinocchio.computeJointJacobiansTimeVariation(model, data, q[k], v[k])
            found[k, 0] = pinocchio.getFrameJacobian(model, data, frame, ALIGNED)
            found[k, 1] = pinocchio.getFrameJacobianTimeVariation(model, data, frame, ALIGNED)
        return found

    def energy():
        return np.array([pinocchio.computeKineticEnergy(model, data, x, y) for x, y in zip(q, v, strict=True)])

    return motion, jacobians, energy


def main():
    """Compare, time, print."""
    robot = jn.load_robot(ARM).locked({"panda_finger_joint1": 0.0})
    model = pinocchio.buildModelFromUrdf(str(ARM))
    model = pinocchio.buildReducedModel(model, [model.getJointId(x) for x in FINGERS], pinocchio.neutral(model))
    rng = np.random.default_rng(3)
    q = rng.normal(size=(SAMPLES, 5, 7))
    frames, first_two, first_three = q[:, :1], q[:, :2], np.ascontiguousarray(q[:, :3])
    motion, jacobians, energy = pinocchio_results(model, q)
    times, knots = np.sort(rng.uniform(0.0, 10.0, SAMPLES)), np.linspace(0.0, 10.0, 401)
    values = np.sin(knots[:, None] * np.arange(1.0, 8.0) / 3)
    spline = jn.JointTrajectory.from_samples(knots, values, robot.joint_names)
    scipy_spline = make_interp_spline(knots, values, k=5)
    derivatives = [scipy_spline.derivative(k) if k else scipy_spline for k in range(5)]
    pairs = {
        "position, velocity, acceleration of the hand": (
            lambda: jn.forward_kinematics(robot, first_three, LINK).position,
            motion,
        ),
        "Jacobian of the hand and its rate": (lambda: jn.jacobian(robot, first_two, LINK), jacobians),
        "kinetic energy": (lambda: jn.kinetic_energy(robot, first_two).total[:, 0], energy),
        "splines through 401 samples, to the fourth derivative": (
            lambda: spline.derivatives(times, 4),
            lambda: np.stack([each(times) for each in derivatives], axis=1),
        ),
    }
    for name, (ours, theirs) in pairs.items():
        found, right = ours(), theirs()
        print(
            f"{name}: largest difference {np.abs(found - right).max() / np.abs(right).max():.1e} of the largest value"
        )
        peer = "SciPy" if name.startswith("splines") else "Pinocchio from Python"
        report(name, race({"jounce": ours, peer: theirs}, rounds=5), SAMPLES, "jounce")
    more = {
        "position alone": lambda: jn.forward_kinematics(robot, frames, LINK),
        "to the jounce": lambda: jn.forward_kinematics(robot, q, LINK),
        "acceleration energy of order 1 with two rates": lambda: jn.acceleration_energy(robot, q),
        "centre of mass to the fourth derivative": lambda: jn.center_of_mass(robot, q),
    }
    report("jounce alone", race(more, rounds=5), SAMPLES, "position alone")


if __name__ == "__main__":
    main()
