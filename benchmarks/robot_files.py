"""The 68 published URDF files of example-robot-data that Pinocchio reads: warnings, and torques beside Pinocchio's.

Run: ``python benchmarks/robot_files.py``. Every file is read without options, and compiled for by itself: minutes.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import jounce as jn
from tests.problems.published_robots import Pair, difference, files, random_states


def main() -> None:
    """Print a table of all files."""
    print(f"{'file':<62} {'joints':>6} {'warnings':>8} {'named':>5} {'torque':>8} {'rate':>8}")
    worst = 0.0
    for name, path in files().items():
        pair = Pair(path)
        q = random_states(pair.robot)
        differences = [0.0, 0.0]
        if pair.robot.joint_names:
            found, expected = jn.inverse_dynamics(pair.robot, q, drives=False), pair.torques(q)
            differences = [difference(found[:, k], expected[:, k]) for k in range(2)]
        counts = f"{len(pair.robot.joint_names):6} {len(pair.warnings):8} {len(pair.named):5}"
        print(f"{name:<62} {counts} {differences[0]:8.1e} {differences[1]:8.1e}", flush=True)
        worst = max(worst, *differences)
    print(f"{len(files())} files, largest difference {worst:.1e} of the largest torque or rate of the robot")


if __name__ == "__main__":
    main()
