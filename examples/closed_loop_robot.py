"""From an MJCF file with a loop to motor torques, their rates and the force at the tip of a five-bar arm.

Run it: python examples/closed_loop_robot.py.
"""

from pathlib import Path

import numpy as np

import jounce as jn

robot = jn.load_robot(Path(__file__).parent / "robots" / "five_bar.xml")
print(robot)
borne, redundant = jn.robot.closure_wrenches(robot)["tip"]
print(f"the connect bears forces along {borne[:, :3].tolist()}; the hinges bear {redundant[:, :3].tolist()} already")

laws = {"left_motor": "0.3*sin(4*t)", "right_motor": "0.2*sin(6*t) - 0.1"}
arm = robot.mechanism(drivers=laws, time=np.linspace(0.0, 1.5, 301))
motion = jn.solve(arm, order=4)

tip = motion.point("left_forearm", [0.22, 0, 0]).values  # (time, derivative, component)
print(f"the tip moves {np.ptp(tip[:, 0, 0]):.3f} m sideways and {np.ptp(tip[:, 0, 2]):.3f} m up and down")
for name in ("left_motor", "right_motor"):
    torque = abs(jn.driver_force(motion, f"{name}_drive").values).max(axis=0)  # torque, its rate, the rate of that
    print(f"{name}: at most {torque[0]:.3f} N m and {torque[1]:.2f} N m/s")
force = np.linalg.norm(jn.joint_reaction(motion, "tip").force.values[:, 0], axis=-1)
print(f"the forearms press on each other at the tip with {force.min():.2f} to {force.max():.2f} N")
balance = jn.energy.power_balance(motion)
worst = abs(balance["residual"][:, 0]).max() / balance["scale"][:, 0].max()
print(f"what the motors put in is what the arm gains, to {float(worst):.0e} of the largest power")
