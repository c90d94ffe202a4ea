"""From a URDF to torque rates in ten lines: python examples/torque_rates.py."""

from pathlib import Path

import numpy as np

import jounce as jn

robot = jn.load_robot(Path(__file__).parent / "robots" / "panda.urdf").locked({"panda_finger_joint1": 0.02})
start, end = np.zeros(7), np.array([0.8, -0.6, 0.4, -1.9, 0.3, 1.6, 0.7])
reach = jn.JointTrajectory.point_to_point(robot.joint_names, start, end, "polynomial_4_5_6_7", duration=1.5)
time = np.linspace(reach.start, reach.stop, 1501)
q = reach.derivatives(time, order=4)  # (time, derivative, joint): q to its fourth derivative
tau = jn.inverse_dynamics(robot, q)  # (time, derivative, joint): torque, its rate, and the rate of that

for name, torque, rate in zip(robot.joint_names, abs(tau[:, 0]).max(0), abs(tau[:, 1]).max(0), strict=True):
    print(f"{name}: at most {torque:6.2f} N m and {rate:7.1f} N m/s")
