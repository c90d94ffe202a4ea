"""What is about a robot or a motion says so where it is given something else, before it looks into it."""

import json
import subprocess
import sys

import pytest

CALLS = """
import functools
import json
import numpy as np
import jounce as jn

q, law = np.zeros((3, 2)), jn.JointTrajectory({"pin": "t"}, start=0.0, stop=1.0)
path = jn.planning.ToolPath(["t", 0.0, 0.0], start=0.0, stop=1.0)
calls = {
    "mass_matrix": (q[0],), "bias_forces": (q,), "inverse_dynamics": (q,), "forward_dynamics": (q[:2], q[:1]),
    "forward_kinematics": (q, "hand"), "jacobian": (q, "hand"),
    "robot.center_of_mass": (q,), "robot.joint_wrenches": (q,),
    "energy.kinetic_energy": (q,), "energy.energy_terms": (q,), "inverse_kinematics": ("hand", [0, 0, 0]),
    "planning.follow_tool_path": ("hand", path), "check_limits": (law,),
    "driver_force": ("theta",), "joint_reaction": ("A",),
    "dynamics.applied_force": ("spring",), "energy.power_balance": (),
    "energy.potential_energy": (),
}
errors = {}
for name, arguments in calls.items():
    for other in (jn.load("examples/four_bar.yaml"), "arm.urdf", None):
        try:
            functools.reduce(getattr, name.split("."), jn)(other, *arguments)
        except jn.JounceError as error:
            errors.setdefault(name, set()).add(str(error).partition(", got ")[0])
try:
    jn.bias_forces(jn.load_robot("examples/robots/ur5.urdf"), np.zeros((2, 6)), parts=None)
except jn.errors.RobotError as error:
    errors["parts"] = {str(error)}
print(json.dumps({name: sorted(words) for name, words in errors.items()}))
"""
OF_MOTIONS = {
    "driver_force",
    "joint_reaction",
    "dynamics.applied_force",
    "energy.power_balance",
    "energy.potential_energy",
}
OF_ROBOTS = "robot", "jn.Robot", "jn.load_robot"


@pytest.mark.slow
def test_robots_and_motions_are_asked_for():
    """In a process of its own: the tests check annotations, which nothing does in use."""
    done = subprocess.run([sys.executable, "-c", CALLS], capture_output=True, text=True, check=False)
    assert not done.returncode, done.stderr
    record = json.loads(done.stdout)
    (words,) = record.pop("parts")
    assert words.startswith("parts: ")
    assert words.endswith("valid: centrifugal, coriolis, gravity")
    assert len(record) == 18
    for name, words in record.items():
        argument, kind, source = ("motion", "jn.Motion", "jn.solve") if name in OF_MOTIONS else OF_ROBOTS
        (words_for_all,) = words
        assert words_for_all.startswith(f"{argument}: "), name
        assert kind in words_for_all, name
        assert source in words_for_all, name
