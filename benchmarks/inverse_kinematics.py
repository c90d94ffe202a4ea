"""Joint coordinates of a UR5 for poses of its tool, beside a loop of closed-loop inverse kinematics by Pinocchio.

Both begin 0.4 rad away from coordinates that reach the pose, and go on until 1e-10 m and rad are left.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

import jounce as jn
from benchmarks.cases import EXAMPLES, Case, Cases, Contestant, ready

REFERENCE = "the poses wanted, reached by forward kinematics, m"
LINK, FILE = "tool0", EXAMPLES / "robots" / "ur5.urdf"
TOLERANCE, STEPS, DAMPING = 1e-10, 100, 1e-8


def pinocchio_loop(start: np.ndarray, places: np.ndarray, turned: np.ndarray) -> Callable[[], Any]:
    """Return a loop over poses, each by Newton steps with a damped pseudo-inverse of the Jacobian in the frame."""
    import pinocchio as pin

    model = pin.buildModelFromUrdf(str(FILE))
    data, frame, found = model.createData(), model.getFrameId(LINK), start.copy()
    eye = DAMPING**2 * np.eye(6)
    goals = [pin.SE3(rotation, place) for rotation, place in zip(turned, places, strict=True)]

    def run() -> Any:
        for k, goal in enumerate(goals):
            q = start[k].copy()
            for _ in range(STEPS):
                pin.framesForwardKinematics(model, data, q)
                away = data.oMf[frame].actInv(goal)
                missed = pin.log6(away).vector
                if np.linalg.norm(missed) < TOLERANCE:
                    break
                columns = -pin.Jlog6(away.inverse()) @ pin.computeFrameJacobian(model, data, q, frame)
                q -= columns.T @ np.linalg.solve(columns @ columns.T + eye, missed)
            found[k] = q
        return found

    return run


def cases(quick: bool) -> Cases:
    """Yield poses solved one by one or together, and a path followed."""
    robot, samples = jn.load_robot(FILE), 200 if quick else 2000
    generator = np.random.default_rng(0)
    q = np.array([0.0, -1.2, 1.4, 0.0, 1.4, 0.0]) + generator.uniform(-1.2, 1.2, (samples, 6))
    pose = jn.forward_kinematics(robot, q[:, None], LINK)
    places, turned = (np.asarray(x)[:, 0] for x in (pose.position, pose.rotation))
    start = q + 0.4 * generator.choice([-1.0, 1.0], q.shape) / np.sqrt(6)

    def error(found: Any) -> float:
        """Return the largest distance of those that are reached: all but a hundredth must be."""
        there = np.asarray(jn.forward_kinematics(robot, np.asarray(found)[:, None], LINK).position)[:, 0]
        away = np.sort(np.linalg.norm(there - places, axis=1))
        return float(away[int(0.99 * samples) - 1])

    def ours() -> Any:
        return jn.inverse_kinematics(robot, LINK, places, turned, start=start, starts=1, limits=False).closest

    loop = Contestant(
        "Pinocchio, a loop in Python", lambda: pinocchio_loop(start, places, turned), error, "pinocchio", aim=1.0
    )
    name = f"coordinates of the UR5 for {samples:,} poses"
    together = Contestant("jounce", ready(ours), error)
    yield Case(name, [together, loop], count=samples, unit="pose", reference=REFERENCE, rounds=5)
    path = jn.planning.ToolPath(
        ["0.45 + 0.1*cos(2*t)", "0.1 + 0.1*sin(2*t)", 0.3], ("ZYX", ["0.3*sin(t)", 2.9, 0.2]), start=0.0, stop=6.0
    )
    time = np.linspace(0.0, 6.0, samples)
    requested = path.position(time, 4)

    def off(found: Any) -> float:
        there = jn.forward_kinematics(robot, found.q, LINK).position
        return float((np.abs(there - requested).max(axis=(0, 2)) / np.abs(requested).max(axis=(0, 2))).max())

    along = Contestant("jounce", ready(lambda: jn.planning.follow_tool_path(robot, LINK, path, time, order=4)), off)
    name = f"a path of the UR5 followed, with four derivatives at {samples:,} instants"
    yield Case(name, [along], count=samples, unit="instant", reference="the path and its derivatives", rounds=5)
