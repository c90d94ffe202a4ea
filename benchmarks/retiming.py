"""How fast are retimed motions, and how fast are they found? Paths of the Panda, beside TOPP-RA, COPP and Ruckig.

Each path goes through five random waypoints within its joints' ranges. Four tasks:

- velocity and acceleration: durations against those of TOPP-RA on a grid of 2001 points;
- all limits of the manufacturer, with jerk, torque and torque rate: durations against TOPP-RA followed by smoothing
  (its rate along the path through two moving averages, the best of several lengths, then slowed until nothing is
  exceeded), and whether `check_limits` finds every limit kept;
- velocity, acceleration and jerk: durations against those of COPP (its TOPP3-SOCP on 1001 points, begun by its
  TOPP2-RA and linearized twice), and what both exceed between their points;
- straight lines in joint space with limits of velocity, acceleration and jerk: durations against Ruckig in the one
  coordinate along the line. (Its joints synchronized in phase leave the line where that is faster.)

Run: ``python benchmarks/retiming.py [--count 50] [--seed 0]`` for the table of all paths; ``python -m benchmarks --only
retiming`` times some of them. Needs the extras ``planning`` and ``bench``.
"""

import argparse
import dataclasses
import logging
import sys
import time
import warnings
from importlib.util import find_spec
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.timing import use_one_core

if __name__ == "__main__":  # before JAX is imported; not of a process that takes the cases only
    use_one_core()

import numpy as np

import jounce as jn
from benchmarks.cases import EXAMPLES, Case, Cases, Contestant, ready
from jounce.errors import JounceError
from jounce.io import load_limits
from jounce.planning.paths.paths import Path as JointPath, path_of
from jounce.planning.retiming.quantities.robot_quantities import RobotQuantities

WINDOWS = (0.02, 0.05, 0.1)  # s, of the moving averages
SHARE = 0.5  # of the joints' ranges, about their middles
LINES = 20
SMOOTHED = 10  # paths on which TOPP-RA is smoothed, which takes long


def cases(quick: bool) -> Cases:
    """Yield the first two tasks, on a few paths."""
    robot, limits, names = panda()
    rng = np.random.default_rng(0)
    paths = random_paths(robot, limits, names, 2 if quick else 10, rng)
    bare = without_jerk(limits)

    def longer(found: np.ndarray) -> float:
        return float(np.max(found / theirs() - 1)) if find_spec("toppra") else np.nan

    def retimed(limits: dict[str, jn.Limits]) -> list[jn.JointTrajectory]:
        return [jn.retime(robot, path, limits) for path in paths]

    def ours() -> np.ndarray:
        return np.array([found.stop for found in retimed(bare)])

    def theirs() -> np.ndarray:
        return np.array([toppra_rate(path, bare, names)[0][-1] for path in paths])

    rivals = [Contestant("jounce", ready(ours), longer), Contestant("TOPP-RA", ready(theirs), longer, "toppra")]
    work = {"count": len(paths), "unit": "path", "rounds": 3}
    name = "paths of the Panda retimed, velocity and acceleration"
    yield Case(name, rivals, reference="the duration by TOPP-RA on 2001 points, relative", **work)

    def exceeded(found: list[jn.JointTrajectory]) -> float:
        return max(jn.check_limits(robot, each, limits).worst.ratio - 1 for each in found)

    name = "paths of the Panda retimed, with jerk, torque and torque rate"
    with_all = [Contestant("jounce", ready(lambda: retimed(limits)), exceeded)]
    yield Case(name, with_all, reference="what the limits are exceeded by, relative", **work)


def panda() -> tuple[jn.Robot, dict[str, jn.Limits], list[str]]:
    """Return the arm, its limits, and its joints without those of the fingers; warnings are not shown from here on."""
    logging.disable(logging.WARNING)
    warnings.simplefilter("ignore")
    robot = jn.load_robot(EXAMPLES / "robots" / "panda.urdf")
    limits = load_limits(EXAMPLES / "limits" / "franka_panda.yaml", robot)
    return robot, limits, [name for name in robot.joint_names if "finger" not in name]


def without_jerk(limits: dict[str, jn.Limits]) -> dict[str, jn.Limits]:
    """Return the limits of velocity and acceleration alone."""
    return {name: jn.Limits(velocity=x.velocity, acceleration=x.acceleration) for name, x in limits.items()}


def main() -> int:
    """Print the table; return 1 if a limit is broken, or a duration or a time is beyond what was promised."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=50, help="paths")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    robot, limits, names = panda()
    rng = np.random.default_rng(options.seed)
    paths = random_paths(robot, limits, names, options.count, rng)
    bad = without_rates(robot, limits, names, paths)
    bad |= with_rates(robot, limits, names, paths)
    if find_spec("copp_py"):
        with_jerk(robot, limits, names, paths)
    straight_lines(robot, limits, names, rng)
    return int(bad)


def random_paths(robot, limits, names, count, rng) -> list[JointPath]:
    """Return paths that stay within the joints' ranges."""
    low, high = (np.array([getattr(limits[name], end) for name in names]) for end in ("lower", "upper"))
    middle, half, found = (low + high) / 2, (high - low) / 2, []
    while len(found) < count:
        path = path_of(middle + SHARE * half * rng.uniform(-1, 1, (5, len(names))), names)
        try:
            RobotQuantities(robot, path, limits).check_range()
        except JounceError:
            continue
        found.append(path)
    return found


def toppra_rate(path: JointPath, limits, names) -> tuple[np.ndarray, np.ndarray]:
    """Return instants and s of the law of TOPP-RA, with limits of velocity and acceleration."""
    import toppra
    from toppra import algorithm, constraint

    class Geometry(toppra.interpolator.AbstractGeometricPath):
        dof = len(names)
        path_interval = np.array([path.start, path.stop])

        def __call__(self, s, order=0):
            found = path.derivatives(np.atleast_1d(np.asarray(s, float)), order)[:, order]
            return found if np.ndim(s) else found[0]

    def both(field):
        bound = np.array([getattr(limits[name], field) for name in names])
        return np.stack([-bound, bound], axis=1)

    bounds = [
        constraint.JointVelocityConstraint(both("velocity")),
        constraint.JointAccelerationConstraint(both("acceleration")),
    ]
    grid = np.linspace(path.start, path.stop, 2001)
    _, rates, _ = algorithm.TOPPRA(bounds, Geometry(), gridpoints=grid).compute_parameterization(0, 0)
    times = np.append(0.0, np.cumsum(2 * np.diff(grid) / (rates[1:] + rates[:-1])))
    return times, grid


def without_rates(robot, limits, names, paths) -> bool:
    bare = without_jerk(limits)
    excess, ours, theirs = [], [], []
    jn.retime(robot, paths[0], bare)
    for path in paths:
        begin = time.process_time()
        found = jn.retime(robot, path, bare)
        middle = time.process_time()
        times, _ = toppra_rate(path, bare, names)
        ours.append(middle - begin)
        theirs.append(time.process_time() - middle)
        excess.append(found.stop / times[-1] - 1)
    print(f"velocity and acceleration, {len(paths)} paths")
    print(f"  duration beside TOPP-RA: median {np.median(excess):+.3%}, worst {max(excess):+.3%}")
    print(f"  processor time: {np.median(ours):.2f} s, at most {max(ours):.2f} s; TOPP-RA {np.median(theirs):.2f} s")
    return max(excess) > 0.005


def only_jerk(limits: dict[str, jn.Limits]) -> dict[str, jn.Limits]:
    """Return the limits of velocity, acceleration and jerk."""
    return {name: dataclasses.replace(x, effort=None, effort_rate=None) for name, x in limits.items()}


def copp_rate(path: JointPath, limits, names, count: int = 1001) -> tuple[np.ndarray, np.ndarray]:
    """Return instants and s of the law of COPP, with limits of velocity, acceleration and jerk."""
    import copp_py as copp

    s = np.linspace(path.start, path.stop, count)
    q, dq, ddq, dddq = np.moveaxis(path.derivatives(s, 3), 1, 0)
    robot = copp.Robot(len(names), capacity=count)
    robot.append_s(s)
    robot.set_q(*(np.ascontiguousarray(x) for x in (q, dq, ddq)), 0, dddq=np.ascontiguousarray(dddq))
    for field in ("velocity", "acceleration", "jerk"):
        bound = np.array([getattr(limits[name], field) for name in names])
        getattr(robot, f"add_{field}_limits")(bound, -bound, start_idx_s=0)
    squared = copp.solver.topp2_ra.solve(copp.solver.topp2_ra.Problem(robot.constraints, (0, count - 1)))
    profile = copp.solver.topp3_socp.solve(copp.solver.topp3_socp.Problem(robot.constraints, squared))
    again = copp.solver.topp3_socp.Problem(robot.constraints, profile.a, b_linearization=profile.b)
    profile = copp.solver.topp3_socp.solve(again)
    _, times = copp.interpolation.s_to_t_topp3(s, profile, 0.0)
    return np.asarray(times), s


def with_jerk(robot, limits, names, paths) -> None:
    bounds, ours, theirs, longer, exceeded, failed = only_jerk(limits), [], [], [], [], 0
    jn.retime(robot, paths[0], bounds)
    for path in paths:
        begin = time.process_time()
        found = jn.retime(robot, path, bounds)
        middle = time.process_time()
        try:
            times, s = copp_rate(path, bounds, names)
        except Exception as reason:  # noqa: BLE001 - whatever its solver says
            failed += 1
            print(f"  COPP: {type(reason).__name__}: {reason}")
            continue
        theirs.append(time.process_time() - middle)
        ours.append(middle - begin)
        longer.append(found.stop / times[-1] - 1)
        rate = jn.laws.SplineMotion(times, s, 5, beyond="hold")
        laws = {name: jn.laws.FollowingMotion(own, rate) for name, own in path.laws.items()}
        inside = (0.05 * times[-1], 0.95 * times[-1])  # at rest its law is known less well
        read = jn.JointTrajectory(laws, *inside)
        exceeded.append(jn.check_limits(robot, read, bounds, hand_over=True).worst.ratio - 1)
    print(f"velocity, acceleration and jerk, {len(paths)} paths, {failed} of them not solved by COPP")
    print(f"  duration beside COPP: median {np.median(longer):+.3%}, {min(longer):+.3%} to {max(longer):+.3%}")
    print(
        f"  a spline through COPP's instants exceeds limits by {np.median(exceeded):.1%}, at most {max(exceeded):.1%}"
    )
    print(f"  processor time: {np.median(ours):.2f} s, at most {max(ours):.2f} s; COPP {np.median(theirs):.2f} s")


def with_rates(robot, limits, names, paths) -> bool:
    ratio, bare, spent, worst = [], [], [], []
    jn.retime(robot, paths[0], limits)
    for k, path in enumerate(paths):
        begin = time.process_time()
        found = jn.retime(robot, path, limits)
        spent.append(time.process_time() - begin)
        report = jn.check_limits(robot, found, limits)
        worst.append(report.worst.ratio - 1)
        times, s = toppra_rate(path, limits, names)
        bare.append(found.stop / times[-1] - 1)
        if k < SMOOTHED:
            ratio.append(smoothed(robot, limits, path, times, s) / found.stop - 1)
    print(f"velocity, acceleration, jerk, torque and torque rate, {len(paths)} paths")
    print(
        f"  limits exceeded by at most {max(worst):.1e}; kept on {sum(x <= 1e-6 for x in worst)} of {len(worst)} paths"
    )
    print(f"  longer than TOPP-RA, which breaks these: median {np.median(bare):.2%}, at most {max(bare):.2%}")
    times_longer = f"median {np.median(ratio):.2%}, {min(ratio):.2%} to {max(ratio):.2%}"
    print(f"  TOPP-RA smoothed, on {len(ratio)} of them, is longer by: {times_longer}")
    print(f"  processor time: {np.median(spent):.2f} s, at most {max(spent):.2f} s")
    return max(worst) > 1e-6 or max(spent) > 2.0


def smoothed(robot, limits, path, times, s) -> float:
    """Return the duration of the law of TOPP-RA that two moving averages smooth, the best of some lengths."""
    best = np.inf
    for window in WINDOWS:
        step, count = 0.002, max(round(window / 0.002), 1)
        even = np.arange(0.0, times[-1] + 2 * window + step, step)
        law = np.interp(even - window, times, s)
        kernel = np.convolve(np.ones(count) / count, np.ones(count) / count)
        padded = np.concatenate([np.full(count, path.start), law, np.full(count, path.stop)])
        law = np.convolve(padded, kernel, mode="same")[count:-count]
        law = path.start + (path.stop - path.start) * (1e-3 + 0.998 * law)  # splines swing beyond its ends
        factor = 1.0
        for _ in range(12):
            rate = jn.laws.SplineMotion(even * factor, law, 5, beyond="hold")
            laws = {name: jn.laws.FollowingMotion(own, rate) for name, own in path.laws.items()}
            smooth = jn.JointTrajectory(laws, 0.0, float(even[-1] * factor))
            over = jn.check_limits(robot, smooth, limits).worst.ratio
            if over <= 1:
                best = min(best, smooth.stop)
                break
            factor *= min(max(over ** (1 / 3), 1.002), 1.5)
            if even[-1] * factor >= best:
                break
    return best


def straight_lines(robot, limits, names, rng) -> None:
    from ruckig import InputParameter, Ruckig, Trajectory

    bare = {
        name: dataclasses.replace(x, effort=None, effort_rate=None, jerk=x.jerk and x.jerk / 50)
        for name, x in limits.items()
    }
    low, high = (np.array([getattr(limits[name], end) for name in names]) for end in ("lower", "upper"))
    excess, spent = [], []
    for _ in range(LINES):
        ends = low + (high - low) * rng.uniform(0.1, 0.9, (2, len(names)))
        begin = time.process_time()
        found = jn.retime(robot, ends, bare, names=names)
        spent.append(time.process_time() - begin)
        way = np.abs(ends[1] - ends[0])
        request, moved = InputParameter(1), Trajectory(1)
        request.current_position, request.target_position = [0.0], [1.0]
        for field in ("velocity", "acceleration", "jerk"):
            bounds = np.array([getattr(bare[name], field) for name in names])
            setattr(request, f"max_{field}", [float(np.min(bounds / way))])
        Ruckig(1).calculate(request, moved)
        excess.append(found.stop / moved.duration - 1)
    print(f"straight lines with velocity, acceleration and a fiftieth of the jerk, {LINES} lines")
    print(f"  duration beside Ruckig: median {np.median(excess):+.3%}, {min(excess):+.3%} to {max(excess):+.3%}")
    print(f"  processor time: {np.median(spent[1:]):.2f} s, at most {max(spent[1:]):.2f} s")


if __name__ == "__main__":
    sys.exit(main())
