"""Mass matrices and bias forces with rates, against Pinocchio; bad input; drives, payloads, loops."""

import functools

import jax
import numpy as np
import pinocchio
import pytest

import jounce as jn
from jounce.robot.algorithms.equations_of_motion import centrifugal
from tests.problems.published_robots import Pair, difference, files, floating_root, random_states
from tests.problems.robots import FILES, random_robot, robot_named

BOUND = 1e-12  # of the largest element
PUBLISHED = (
    "double_pendulum_description/urdf/double_pendulum_continuous.urdf",
    "tiago_description/robots/tiago_no_hand.urdf",
)
NAMES = ("panda", "floating_solo12", *PUBLISHED)


@functools.cache
def pair_named(name):
    if name == "panda":  # a finger follows the other
        return Pair(FILES / "panda.urdf")
    if name == "floating_solo12":
        return Pair(FILES / "solo12.urdf", floating_root())
    return Pair(files()[name])


class Theirs:
    """What Pinocchio says of states, in our coordinates."""

    def __init__(self, pair, states):
        self.pair, self.states = pair, states

    def __call__(self, function):
        found = []
        for q, *rates in self.states:
            model, spread = self.pair.model, self.pair.spread
            place = self.pair._configuration(spread @ q + self.pair.offset)
            value = np.array(function(model, model.createData(), place, *(spread @ rate for rate in rates)))
            found.append(spread.T @ value if value.ndim == 1 else spread.T @ value @ spread)
        return np.array(found)


def mass(model, data, q, *_):
    upper = np.triu(pinocchio.crba(model, data, q))
    return upper + np.triu(upper, 1).T


def mass_rate(model, data, q, v, *_):
    pinocchio.computeCoriolisMatrix(model, data, q, v)
    return data.C + data.C.T


def bias_rate(model, data, q, v, a, _):
    pinocchio.computeRNEADerivatives(model, data, q, v, np.zeros_like(a))
    return data.dtau_dq @ v + data.dtau_dv @ a


def single(model, data, q, v, *_):
    """Return the sum of what each velocity alone needs."""
    gravity = np.array(pinocchio.computeGeneralizedGravity(model, data, q))
    one_by_one = [pinocchio.nonLinearEffects(model, data, q, row) - gravity for row in np.diag(v)]
    return np.sum(one_by_one, axis=0)


SLOW = ("floating_solo12", "tiago_description/robots/tiago_no_hand.urdf")


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) if n in SLOW else n for n in NAMES])
def test_mass_matrix_and_bias(name):
    pair = pair_named(name)
    q = random_states(pair.robot)
    theirs = Theirs(pair, q)
    assert difference(jn.mass_matrix(pair.robot, q[:, 0], drives=False), theirs(mass)) <= BOUND
    nonlinear = theirs(lambda model, data, q, v, *_: pinocchio.nonLinearEffects(model, data, q, v))
    assert difference(jn.bias_forces(pair.robot, q[:, :2], drives=False), nonlinear) <= BOUND
    gravity = theirs(lambda model, data, q, *_: pinocchio.computeGeneralizedGravity(model, data, q))
    assert difference(jn.bias_forces(pair.robot, q[:, :2], parts="gravity", drives=False), gravity) <= BOUND


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in NAMES if "floating" not in name])
def test_first_rates(name):  # Pinocchio has no derivatives for a root made of several joints
    pair = pair_named(name)
    q = random_states(pair.robot)
    theirs = Theirs(pair, q)
    assert difference(jn.mass_matrix(pair.robot, q[:, :2], rates=True, drives=False)[:, 1], theirs(mass_rate)) <= BOUND
    assert difference(jn.bias_forces(pair.robot, q[:, :3], rates=True, drives=False)[:, 1], theirs(bias_rate)) <= BOUND


@pytest.mark.slow
def test_parts():
    pair = Pair(FILES / "ur5.urdf")
    q = random_states(pair.robot)
    theirs = Theirs(pair, q)
    squares = jn.bias_forces(pair.robot, q, parts=["centrifugal"], drives=False)
    assert difference(squares, theirs(single)) <= BOUND
    both = jn.bias_forces(pair.robot, q, parts=("coriolis", "centrifugal"), drives=False)
    assert difference(jn.bias_forces(pair.robot, q, parts="coriolis", drives=False), both - squares) <= BOUND
    held = jn.bias_forces(pair.robot, q, parts="gravity", drives=False)
    assert difference(both + held, jn.bias_forces(pair.robot, q, drives=False)) <= BOUND
    np.testing.assert_array_equal(jn.bias_forces(pair.robot, q, parts="gravity"), held)  # no friction in a part alone
    assert not jn.bias_forces(pair.robot, q, parts=(), drives=False).any()


@pytest.mark.slow
def test_parts_with_rates_of_joints_that_follow():
    robot = random_robot(12, 4, tree=False, prismatic=0.4, mimic=0.5, fixed=0.0)
    assert len(robot.joint_names) < len(robot.moving_links)
    q = np.random.default_rng(5).uniform(-1, 1, (1, 3, len(robot.joint_names)))
    parts = [jn.bias_forces(robot, q, rates=True, parts=part) for part in ("coriolis", "centrifugal", "gravity")]
    whole = jn.bias_forces(robot, q, rates=True, drives=False)
    assert whole.shape == (1, 2, len(robot.joint_names))
    assert difference(sum(parts), whole) <= BOUND
    one_by_one = np.zeros_like(q)
    one_by_one[:, 0], one_by_one[:, 1:, 0] = q[:, 0], q[:, 1:, 0]  # one coordinate only: no products of two
    weightless = robot.with_gravity([0, 0, 0])
    assert (
        difference(
            jn.bias_forces(weightless, one_by_one, drives=False),
            jn.bias_forces(weightless, one_by_one, parts="centrifugal"),
        )
        <= BOUND
    )


@pytest.mark.slow
def test_what_the_robot_holds_and_what_its_drives_take():
    robot = robot_named("mimic").with_payload("link_7", jn.Inertia(2.0, [0.1, 0.0, 0.2], [0.1, 0.1, 0.1]))
    q = np.random.default_rng(6).uniform(-1, 1, (2, 3, len(robot.joint_names)))
    matrix, bias = (jn.mass_matrix(robot, q[:, 0], drives=True), jn.bias_forces(robot, q, drives=True))
    torque = np.einsum("sij,sj->si", matrix, q[:, 2]) + bias
    assert difference(torque, jn.inverse_dynamics(robot, q, drives=True)[:, 0]) <= BOUND


@pytest.mark.slow
def test_shapes_of_batches():
    robot = robot_named("scara")
    n = len(robot.joint_names)
    q = np.random.default_rng(7).uniform(-1, 1, (2, 3, 4, n))
    assert jn.mass_matrix(robot, q[0, 0, 0]).shape == (n, n)
    assert jn.mass_matrix(robot, q).shape == (2, 3, 4, n, n)
    assert jn.mass_matrix(robot, q, rates=True).shape == (2, 3, 4, n, n)
    assert jn.bias_forces(robot, q).shape == (2, 3, n)
    assert jn.bias_forces(robot, q, rates=True).shape == (2, 3, 3, n)


@pytest.mark.parametrize(
    "call, words",
    [
        (lambda robot: jn.mass_matrix(robot, np.zeros(3)), ("q", "(..., n)", "(3,)", "n = 4")),
        (lambda robot: jn.mass_matrix(robot, 1.0), ("q", "(..., n)")),
        (lambda robot: jn.mass_matrix(robot, np.zeros(4), rates=True), ("q", "(..., order + 1, n)")),
        (lambda robot: jn.bias_forces(robot, np.zeros((1, 4))), ("q", "q'")),
        (lambda robot: jn.bias_forces(robot, np.zeros((2, 4)), parts="coriollis"), ("parts", "coriolis")),
    ],
)
def test_bad_input(call, words):
    with pytest.raises(jn.errors.RobotError) as raised:
        call(robot_named("scara"))
    assert all(word in str(raised.value) for word in words)


def test_loops_are_refused():
    robot = jn.load_robot(FILES / "planar_arm.xml")
    ends = [robot.base, robot.link_names[-1]]
    closed = robot.with_closures([jn.robot.Closure("pin", ends)])
    for function in (jn.mass_matrix, jn.bias_forces):
        with pytest.raises(jn.errors.RobotError, match="loops"):
            function(closed, np.zeros((2, len(robot.joint_names))))


@pytest.mark.slow
def test_memory_of_centrifugal_forces_grows_with_the_square_of_the_number_of_joints():
    """With its cube, 150 joints took 4 GB for one sample: a batch of them ended the process."""

    def memory(joints):
        tree = random_robot(3, joints).tree
        q = jax.ShapeDtypeStruct((2, joints, 8), float)
        compiled = jax.jit(lambda q: centrifugal(tree, q)).lower(q).compile()
        return compiled.memory_analysis().temp_size_in_bytes

    assert memory(24) <= 5 * memory(12)


@pytest.mark.parametrize("name, value", [("rates", 2), ("drives", "no")])
def test_flags_are_true_or_false(name, value):
    robot = robot_named("panda")
    still = np.zeros((2, len(robot.joint_names)))
    for function, q in ((jn.mass_matrix, still[0]), (jn.bias_forces, still)):
        with pytest.raises((jn.errors.RobotError, TypeError), match=name):  # TypeError by the checker of the tests
            function(robot, q, **{name: value})
