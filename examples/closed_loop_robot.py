"""A five-bar arm from its MJCF file to motor torques, their rates, and the reaction at the tip: its loop closed."""

from pathlib import Path

import numpy as np

import jounce as jn

robot = jn.load_robot(Path(__file__).parent / "robots" / "five_bar.xml")
print(robot)
borne, redundant = jn.robot.closure_wrenches(robot)["tip"]
print(f"the connect bears forces along {borne[:, :3].tolist()}; {redundant[:, :3].tolist()} the hinges bear already")

laws = {"left_motor": "0.3*sin(4*t)", "right_motor": "0.2*sin(6*t) - 0.1"}
arm = robot.mechanism(drivers=laws, outputs={"tip": jn.PointOutput("left_forearm", [0.22, 0, 0])})
motion = jn.solve(arm, np.linspace(0.0, 1.5, 301))
tip = motion.outputs["tip"]
print(f"the tip moves {np.ptp(tip[:, 0, 0]):.3f} m sideways, {np.ptp(tip[:, 0, 2]):.3f} m up and down")
