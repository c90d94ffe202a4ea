#!/usr/bin/env bash
# Klampt 0.10.1.post1: derivatives of the mass matrix and the Coriolis matrix are wrong for robots with prismatic
# joints.
#
# getMassMatrixDeriv(i), getMassMatrixTimeDeriv and getCoriolisForceMatrix belong to getMassMatrix and
# getCoriolisForces. One would expect the derivative of the one, and a matrix that times the velocity is the other. The
# derivative of the orientation of a slide is taken as that of a hinge (getOrientationHessian has it, too), so that
# slides couple with the moments of inertia: of an arm with two hinges and a slide, whose mass matrix is diagonal
# everywhere, dM13/dq2 is -0.0439 for 0. dM/dt - 2C is a part of passivity-based controllers. getMassMatrix and
# getCoriolisForces are right; with hinges alone, all are. There is no message. Output seen: "dM13/dq2 -0.0439 for 0;
# first hinge: C v 0.4354 N m, Coriolis force 0.4284 N m, closed form 0.4284 N m". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "klampt==0.10.1.post1" numpy
cd "$folder"
"$folder/venv/bin/python" - > "$folder/output" <<'PY'
import importlib.metadata
import pathlib

import klampt
import numpy as np

MASS, MOMENT, Q, RATES = 2.0, 0.05, np.array([0.3, 0.5, 0.6]), np.array([0.7, -0.4, 0.2])
JOINT = """<joint name="j{0}" type="{1}"><parent link="l{2}"/><child link="l{0}"/><origin xyz="0 0 0"/><axis xyz="{3}"/>
<limit lower="-3" upper="3" effort="1" velocity="1"/></joint><link name="l{0}"><inertial><mass value="{4}"/>
<inertia ixx="{5}" iyy="{5}" izz="{5}" ixy="0" ixz="0" iyz="0"/></inertial></link>"""


def arm(*joints):
    """Klampt's robot of joints, of which the last carries the mass, and the indices of its joints."""
    links = ""
    for k, (kind, axis) in enumerate(joints, 1):
        last = k == len(joints)
        links += JOINT.format(k, kind, k - 1, axis, MASS if last else 0, MOMENT if last else 0)
    pathlib.Path("arm.urdf").write_text(f'<robot name="arm"><link name="l0"/>{links}</robot>')
    world = klampt.WorldModel()
    assert world.readFile("arm.urdf")
    robot = world.robot(0)
    count = robot.numLinks()
    mine = [i for i in range(count) if robot.link(i).getName() in ("l1", "l2", "l3")]
    position, velocity = np.zeros((2, count))
    position[mine], velocity[mine] = Q, RATES
    robot.setConfig(position)
    robot.setVelocity(velocity)
    return world, robot, mine, velocity


hinges = ("revolute", "0 0 1"), ("revolute", "0 1 0")
sine, cosine, reach = np.sin(Q[1]), np.cos(Q[1]), Q[2]
print("SEEN klampt", importlib.metadata.version("klampt"))
world, robot, mine, velocity = arm(*hinges, ("prismatic", "1 0 0"))
block = np.ix_(mine, mine)
mass = np.array(robot.getMassMatrix())[block]
right = np.diag([MOMENT + MASS * (reach * cosine) ** 2, MOMENT + MASS * reach**2, MASS])
assert np.allclose(mass, right), "the mass matrix is another"
found = np.array(robot.getMassMatrixDeriv(mine[1]))[block]
# the slide's axis turns about y as a hinge's would, and the moment of inertia carries that to the hinge about z
assert np.isclose(found[0, 2], -MOMENT * cosine), "dM13/dq2 is another now"
assert np.isclose(found[0, 0], -2 * MASS * reach**2 * sine * cosine), "dM11/dq2 is another"
by_matrix = (np.array(robot.getCoriolisForceMatrix()) @ velocity)[mine]
by_force = np.array(robot.getCoriolisForces())[mine]
hinge = 2 * MASS * reach * cosine * RATES[0] * (RATES[2] * cosine - RATES[1] * reach * sine)
print(f"SEEN dM13/dq2 {found[0, 2]:.3g} for 0;", end=" ")
print(f"first hinge: C v {by_matrix[0]:.4g} N m, Coriolis force {by_force[0]:.4g} N m, closed form {hinge:.4g} N m")
assert np.isclose(by_force[0], hinge), "the Coriolis force is another"
assert abs(by_matrix - by_force).max() > 5e-3, "the matrix belongs to the force now"

world, robot, mine, velocity = arm(*hinges, ("revolute", "1 0 0"))
assert np.allclose(np.array(robot.getCoriolisForceMatrix()) @ velocity, robot.getCoriolisForces()), "wrong for hinges"
PY
grep "^SEEN" "$folder/output" | sed "s/^SEEN //"
