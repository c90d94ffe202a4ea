"""What holds for robots, whatever their joints are fitted with: power, momentum, frames, values, forces of MuJoCo.

Energies and momenta are those of the masses of the links as they move, of springs and of rotors, and what is lost is
that of dampers and friction, all by their definitions.
"""

import dataclasses
import math

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import jounce as jn
from tests.oracles.moving_masses import applied, change_of_momentum, crossed, dot, energy, lost
from tests.problems.fitted_robots import NAMES, TEXTS, fitted, redrawn, text_of

ORDER = 5  # of q
QUICK = "mimic"
EDGE = 8  # samples on each side that a difference takes


def states(robot, count=2):
    """Return states, (count, ORDER + 1, n), in which no joint is at rest."""
    random = np.random.default_rng(7)
    q = random.uniform(-0.8, 0.8, (count, ORDER + 1, len(robot.joint_names)))
    q[:, 1] = np.where(q[:, 1] < 0, q[:, 1] - 0.2, q[:, 1] + 0.2)
    return q


def near(found, expected, tolerance=1e-11):
    found, expected = np.asarray(found), np.asarray(expected)
    assert found.shape == expected.shape
    assert np.abs(expected).max() > 1e-3, "nothing is compared"
    assert np.abs(found - expected).max() <= tolerance * max(1.0, np.abs(expected).max())


@pytest.fixture(scope="module", params=[QUICK, *(pytest.param(x, marks=pytest.mark.slow) for x in NAMES if x != QUICK)])
def robot(request):
    return fitted(request.param)


@pytest.mark.slow
def test_torques_give_what_energy_gains_and_dampers_take_with_rates(robot):
    q = states(robot)
    torque = np.asarray(jn.inverse_dynamics(robot, q))
    kinetic, potential = energy(robot, q)
    near(jn.energy.kinetic_energy(robot, q).total[:, :ORDER], kinetic)
    levels = ORDER - 1
    gained = kinetic[:, 1:] + potential[:, 1:ORDER]
    near(dot(torque, q[:, 1:])[:, :levels], gained + lost(robot, q)[:, :levels])


@pytest.mark.slow
def test_momentum_changes_by_weight_and_what_holds_a_free_base_with_rates(robot):
    """The base is at rest, but held: what holds it is all that acts from outside."""
    q = states(robot)
    lead = (len(q),)
    still = jn.robot.BaseMotion(
        np.zeros((*lead, 3)), np.broadcast_to([1.0, 0, 0, 0], (*lead, 4)), np.zeros((*lead, ORDER, 6))
    )
    given = np.asarray(jn.inverse_dynamics(robot, q, base=still))
    near(given[..., 6:], jn.inverse_dynamics(robot, q), 1e-13)
    near(given[..., :6], change_of_momentum(robot, q))


def test_momentum_changes_by_weight_and_what_the_base_gives_with_rates(robot):
    q, levels = states(robot), ORDER - 1
    carried = np.asarray(jn.robot.joint_wrenches(robot, q, frame="base"))
    whole = np.zeros((len(q), levels, 6))
    for k, link in enumerate(robot.moving_links):
        if robot.frames[next(j for j in robot.joints.values() if j.child == link).parent].body < 0:
            origin = np.asarray(jn.forward_kinematics(robot, q, link).position)[:, :levels]
            wrench = carried[:, :, k]
            whole[..., :3] += wrench[..., :3]
            whole[..., 3:] += wrench[..., 3:] + crossed(origin, wrench[..., :3])
    near(whole, change_of_momentum(robot, q))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_frames_are_drawn_at_will(robot, seed):
    q = states(robot)
    other, moves = redrawn(robot, np.random.default_rng(seed))
    near(jn.inverse_dynamics(other, q), jn.inverse_dynamics(robot, q), 1e-12)
    near(jn.mass_matrix(other, q, rates=True), jn.mass_matrix(robot, q, rates=True), 1e-12)
    near(jn.forward_dynamics(other, q[:, :2], q[:, 2:4]), jn.forward_dynamics(robot, q[:, :2], q[:, 2:4]), 1e-11)
    link = robot.link_names[-1]
    shift, turn = moves[robot.base]
    (at, _), was = moves[link], jn.forward_kinematics(robot, q, link, [0.1, 0.2, 0.3])
    at = moves[link][1].T @ (np.array([0.1, 0.2, 0.3]) - at)
    expected = np.asarray(was.position) @ turn
    expected[:, 0] -= shift @ turn
    near(jn.forward_kinematics(other, q, link, at).position, expected, 1e-12)


@pytest.mark.slow
def test_torques_move_the_robot_as_they_were_computed_for(robot):
    q = states(robot)
    torque = jn.inverse_dynamics(robot, q)
    near(jn.forward_dynamics(robot, q[:, :2], torque), q, 1e-11)
    matrix, bias = jn.mass_matrix(robot, q, rates=True), jn.bias_forces(robot, q, rates=True)
    near(applied(np.asarray(matrix), q[:, 2:]) + np.asarray(bias)[:, : ORDER - 1], torque)


@pytest.mark.slow
def test_a_simulated_motion_needs_the_torques_that_it_had(robot):
    n = len(robot.joint_names)
    push = {name: f"{0.5 + 0.1 * k}*cos({k + 1}*t)" for k, name in enumerate(robot.joint_names)}
    state = states(robot, 1)[0, :2]
    state[1] = np.where(state[1] < 0, state[1] - 1, state[1] + 1)  # so fast that none comes to rest
    times = np.array([0.0, 0.03, 0.06])
    run = jn.simulate(robot, times, order=4, state=state, torque=push)
    assert (run.status == 0).all()
    a = 0.5 + 0.1 * np.arange(n)
    w = np.arange(n) + 1.0
    phase = times[:, None] * w
    expected = np.stack([a * np.cos(phase), -a * w * np.sin(phase), -a * w**2 * np.cos(phase)], axis=1)
    near(jn.inverse_dynamics(robot, run.q), expected, 1e-9)
    near(run.torque, expected, 1e-9)


def parameters(robot):
    """Yield what drives the robot: its place and name, and the robot with that number times a factor."""
    for joint in robot.moving_joints:
        for field in ("armature", "damping", "friction", "stiffness"):
            value = getattr(joint, field)
            if np.any(value):

                def changed(factor, joint=joint, field=field, value=value):
                    given = tuple(factor * np.atleast_1d(value)) if field == "friction" else factor * value
                    given = given[0] if np.ndim(given) and len(given) == 1 else given
                    joints = {**robot.joints, joint.name: dataclasses.replace(joint, **{field: given})}
                    return robot.changed(joints=list(joints.values()))

                yield f"{joint.name}.{field}", changed
    for coupling in robot.couplings.values():
        for field in ("armature", "damping", "friction", "stiffness"):
            value = getattr(coupling, field, 0.0)
            if value:

                def changed(factor, coupling=coupling, field=field, value=value):
                    made = {**robot.couplings, coupling.name: dataclasses.replace(coupling, **{field: factor * value})}
                    return robot.changed(couplings=list(made.values()))

                yield f"{coupling.name}.{field}", changed


@pytest.mark.slow
def test_every_number_of_a_drive_counts_in_proportion(robot):
    q = states(robot)
    whole, bare = (np.asarray(jn.inverse_dynamics(robot, q, drives=drives)) for drives in (True, False))
    total = np.zeros_like(whole)
    for name, changed in parameters(robot):
        without, twice = (np.asarray(jn.inverse_dynamics(changed(factor), q)) for factor in (0.0, 2.0))
        part = whole - without
        assert np.abs(part).max() > 1e-4, name
        np.testing.assert_allclose(twice - without, 2 * part, rtol=0, atol=1e-12 * np.abs(whole).max(), err_msg=name)
        total += part
    near(bare + total, whole, 1e-12)


# -- MuJoCo -----------------------------------------------------------------------------------------------------------


def turned(turns, rates, accelerations):
    """Return angular velocity and acceleration of turns z, y, x in the moved axes, and how the rates make them."""
    (_, y, x), (_, dy, dx) = turns, rates
    sy, cy, sx, cx = np.sin(y), np.cos(y), np.sin(x), np.cos(x)
    slope = np.array([[-sy, 0, 1], [cy * sx, cx, 0], [cy * cx, -sx, 0]])
    change = np.array(
        [[-cy * dy, 0, 0], [-sy * sx * dy + cy * cx * dx, -sx * dx, 0], [-sy * cx * dy - cy * sx * dx, -cx * dx, 0]]
    )
    return slope @ rates, slope @ accelerations + change @ rates, slope


def of_mujoco(model, robot, q):
    """Return the generalized forces of MuJoCo for q, q', q'', at the coordinates of the robot.

    Its friction is that of a contact, which gives way, and its followers are held by springs: both are left out there,
    and friction is that of Coulomb.
    """
    data, columns = mujoco.MjData(model), list(robot.joint_names)
    values = {name: q[:, columns.index(name)] for name in columns}
    reduced = np.zeros((model.nv, len(columns)))
    position = data.qpos.copy()
    rates = np.zeros((2, model.nv))
    for k in range(model.njnt):
        joint, name = model.joint(k), model.joint(k).name
        at, dof = int(joint.qposadr[0]), int(joint.dofadr[0])
        kind = int(joint.type[0])
        if kind < 2:  # free, ball
            names = [x for x in columns if x.startswith(name)]
            turns = names[-3:]
            if kind == 0:
                position[at : at + 3] = [values[x][0] for x in names[:3]]
                rates[:, dof : dof + 3] = [[values[x][level] for x in names[:3]] for level in (1, 2)]
                for i, x in enumerate(names[:3]):
                    reduced[dof + i, columns.index(x)] = 1.0
                at, dof = at + 3, dof + 3
            angles, speeds, changes = (np.array([values[x][level] for x in turns]) for level in range(3))
            position[at : at + 4] = np.roll(Rotation.from_euler("ZYX", angles).as_quat(), 1)
            rates[0, dof : dof + 3], rates[1, dof : dof + 3], slope = turned(angles, speeds, changes)
            for i, x in enumerate(turns):
                reduced[dof : dof + 3, columns.index(x)] = slope[:, i]
            continue
        mimic = robot.joints[name].mimic
        leader, factor, offset = (name, 1.0, 0.0) if mimic is None else (mimic.joint, mimic.multiplier, mimic.offset)
        position[at] = factor * values[leader][0] + offset
        rates[:, dof] = factor * values[leader][1:]
        reduced[dof, columns.index(leader)] = factor
    data.qpos[:], data.qvel[:], data.qacc[:] = position, *rates
    mujoco.mj_inverse(model, data)
    force = data.qfrc_inverse + model.dof_frictionloss * np.sign(rates[0])
    for k in range(model.ntendon):
        weights = np.zeros(model.nv)
        for part in range(int(model.tendon_adr[k]), int(model.tendon_adr[k] + model.tendon_num[k])):
            weights[model.jnt_dofadr[model.wrap_objid[part]]] += model.wrap_prm[part]
        force = force + weights * model.tendon_frictionloss[k] * np.sign(weights @ rates[0])
    return reduced.T @ force


@pytest.mark.parametrize("name", [QUICK, *(pytest.param(x, marks=pytest.mark.slow) for x in TEXTS if x != QUICK)])
def test_torques_and_rates_are_those_of_mujoco(name):
    robot, model = fitted(name), mujoco.MjModel.from_xml_string(text_of(name))
    off = mujoco.mjtDisableBit
    model.opt.disableflags |= int(off.mjDSBL_EQUALITY) | int(off.mjDSBL_FRICTIONLOSS)
    start, step = states(robot, 1)[0], 0.02
    powers = np.array([1 / math.factorial(k) for k in range(ORDER + 1)])
    nodes = np.arange(-EDGE, EDGE + 1) * step / 2

    def at(t):
        return np.stack([sum(start[k + j] * t**j * powers[j] for j in range(ORDER + 1 - k)) for k in range(3)])

    known = np.array([of_mujoco(model, robot, at(t)) for t in nodes])
    series = np.polynomial.polynomial.polyfit(nodes / nodes[-1], known, 12)[:4]
    expected = series * np.array([math.factorial(k) / nodes[-1] ** k for k in range(4)])[:, None]
    found = np.asarray(jn.inverse_dynamics(robot, start))
    for level, tolerance in enumerate((1e-12, 1e-10, 1e-8, 1e-6)):
        near(found[level], expected[level], tolerance)
