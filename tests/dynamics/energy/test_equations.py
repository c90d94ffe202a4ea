"""The equations of motion in every form against virtual work in fifty digits: Negrean 2025, 123-135 and 144-146."""

import functools
import math
import os
import pathlib
import subprocess
import sys

import numpy as np
import pytest
from mpmath import mp, mpf

import jounce as jn
from jounce.dynamics import (
    catalan,
    gibbs_appell,
    gravity_forces,
    higher_order,
    lagrange,
    mangeron_nielsen,
    newton_euler,
    printed_coefficient,
    virtual_work,
)
from tests.oracles import mp_robot, negrean_dynamics, negrean_energies
from tests.problems.robots import random_robot

RATES = 2  # of the forces, in most tests
HIGHEST = 5  # k of the higher-order equations
EXAMPLES = pathlib.Path(__file__).parents[3] / "examples"
SEEDS = pytest.mark.parametrize("seed", range(3))
MIDDLE_131 = [3.8, 1.4, 0.72]  # largest error of the printed form over the largest force, by seed, two digits
PRINTED_132 = [0.30, 0.24, 0.24]
ROUNDING = 1e-13  # of the largest force; some 500 roundings, through factorials and sums of k derivatives


def numbers_of(robot):
    """Return a robot without mimics as bodies of the oracle, and its coordinates in their order."""
    index, bodies = {robot.base: -1}, []
    for joint in robot.joints.values():
        index[joint.child] = len(bodies)
        body = {"parent": index[joint.parent], "type": joint.type, "position": joint.position, "axis": joint.axis}
        body |= {"rotation": joint.rotation, "name": joint.child, "joint": joint.name}
        inertia = robot.links[joint.child].inertia
        if inertia is not None:
            body |= {"mass": inertia.mass, "center": inertia.center_of_mass, "inertia": inertia.tensor}
        bodies.append(body)
    return mp_robot.from_numbers(bodies)


@functools.cache
def tree():
    """Return a robot of three joints in two branches, with a slide and a link fixed to another."""
    return random_robot(7, 3, prismatic=0.4, fixed=0.4)


@functools.cache
def chain():
    """Return a chain of two revolute joints, which takes the least to be compiled for high rates."""
    return random_robot(5, 2, tree=False, prismatic=0.0, fixed=0.0)


@functools.cache
def arm():
    """Return the robot that the paper measured."""
    return jn.load_robot(EXAMPLES / "robots" / "lr_mate.urdf")


@functools.cache
def following():
    """Return a robot of four moving links, of which one or more follow another joint."""
    return random_robot(12, 4, tree=False, prismatic=0.4, mimic=0.5, fixed=0.0)


@functools.cache
def case(make, order=7, samples=2):
    """Return a robot, derivatives of its coordinates, and its inertia forces and rates in fifty digits."""
    robot = make()
    q = np.random.default_rng(len(robot.joint_names)).uniform(-1, 1, (samples, order + 1, len(robot.joint_names)))
    with mp.workdps(50):
        found = [negrean_dynamics.inertia_forces(*in_digits(robot, sample), order - 2) for sample in q]
    return robot, q, np.array(found)


def in_digits(robot, sample):
    """Return the robot of the oracle, and the coordinates of one sample by joint."""
    made = numbers_of(robot)
    names = [made.bodies[k].joint for k in made.moving]
    assert names == list(robot.joint_names), "the oracle has them in the same order"
    return made, [[mpf(float(x)) for x in sample[:, j]] for j in range(len(names))]


def agree(found, right, tolerance=ROUNDING):
    """Assert agreement of every rate, by its largest value."""
    found, right = np.asarray(found), np.asarray(right)[:, : np.shape(found)[1]]
    scale = np.abs(right).max(axis=(0, 2), keepdims=True)
    assert found.shape == right.shape
    assert (np.abs(found - right) <= tolerance * scale).all(), np.abs((found - right) / scale).max(axis=(0, 2))


def test_the_robots_have_what_they_should():
    kinds = {joint.type for joint in tree().joints.values()}
    assert kinds == {"revolute", "prismatic", "fixed"}
    parents = [joint.parent for joint in tree().joints.values() if joint.moving]
    assert len(set(parents)) < len(parents), "branches"
    assert len(following().joint_names) < len(following().moving_links)


FORMS = {
    "newton_euler": lambda robot, q: newton_euler(robot, q, RATES),
    "virtual_work": lambda robot, q: virtual_work(robot, q, RATES),
    "lagrange": lambda robot, q: lagrange(robot, q, RATES),
    "mangeron_1": lambda robot, q: mangeron_nielsen(robot, q, RATES),
    "mangeron_2": lambda robot, q: mangeron_nielsen(robot, q, RATES, m=2),
    "gibbs_appell_2": lambda robot, q: gibbs_appell(robot, q, RATES),
    "gibbs_appell_5": lambda robot, q: gibbs_appell(robot, q, RATES, m=5),
    "higher_order_1": lambda robot, q: higher_order(robot, q, 1)[:, None],
}


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
def test_equations_124_to_128_agree_with_virtual_work_in_fifty_digits(form):
    robot, q, right = case(tree)
    agree(FORMS[form](robot, q), right)


def test_equation_131_agrees_with_virtual_work_in_fifty_digits():
    robot, q, right = case(tree)
    agree(higher_order(robot, q, 3)[:, None], right[:, 2:3])


@pytest.mark.slow
@pytest.mark.parametrize("make", [tree, arm])
def test_equations_129_to_134_agree_with_virtual_work_in_fifty_digits(make):
    robot, q, right = case(make, samples=1)
    for k in range(1, HIGHEST + 1):  # rounding grows with the weights of the products
        agree(higher_order(robot, q, k)[:, None], right[:, k - 1 : k], 4**k * ROUNDING)


@pytest.mark.slow
@pytest.mark.parametrize("k, m", [(1, 3), (2, 5), (4, 7)])
def test_the_order_of_the_derivatives_does_not_matter(k, m):
    robot, q, right = case(tree)
    agree(higher_order(robot, q, k, m)[:, None], right[:, k - 1 : k], 1e-12)


@pytest.mark.slow
def test_joints_that_follow_others():
    robot = following()
    q = np.random.default_rng(3).uniform(-1, 1, (2, 5, len(robot.joint_names)))
    right = newton_euler(robot, q, 2)
    agree(virtual_work(robot, q, 2), right)
    agree(gibbs_appell(robot, q, 2), right)
    agree(higher_order(robot, q, 3)[:, None], right[:, 2:3])
    leader = {joint.name for joint in robot.joints.values() if joint.moving and joint.mimic is None}
    assert set(robot.joint_names) == leader


@pytest.mark.slow
def test_high_rates():
    robot, q, right = case(tree, order=8, samples=1)
    bound = 1e-12  # 1.1e-13 was measured of all forms; most are a few roundings
    for form in (newton_euler, virtual_work, lagrange, mangeron_nielsen, gibbs_appell):
        agree(form(robot, q, 5), right, bound)


@pytest.mark.slow
@pytest.mark.parametrize(
    "p, n, m, rates", [(0, 0, 0, 1), (0, 2, 1, 0), (1, 0, 2, 1), (1, 3, 4, 0), (2, 1, 3, 1), (4, 1, 5, 0)]
)
def test_slopes_of_energies_of_a_tree_against_differences_in_fifty_digits(p, n, m, rates):
    """The slopes come from energies of point masses, so that nothing of the closed form is in them."""
    robot, q = tree(), np.random.default_rng(2).uniform(-1, 1, (p + n + rates + 2, 3))
    found = jn.energy.energy_slope(robot, q, m=m, order=p, rate=n, rates=rates)
    with mp.workdps(50):
        made, rows = in_digits(robot, q)
        right = negrean_dynamics.slope(made, rows, p, n, m)
        np.testing.assert_allclose(found[0], right, rtol=0, atol=1e-13 * max(1.0, np.abs(right).max()))
        if rates:
            step = mpf("1e-8")
            later = [negrean_dynamics.slope(made, moved(rows, sign * step), p, n, m) for sign in (1, -1)]
            rate = (later[0] - later[1]) / float(2 * step)
            np.testing.assert_allclose(found[1], rate, rtol=0, atol=1e-6 * max(1.0, np.abs(rate).max()))


def moved(rows, step):
    """Return plain derivatives after a time, by their series."""
    return [
        [mp.fsum(row[k + j] * step**j / mp.factorial(j) for j in range(len(row) - k)) for k in range(len(row))]
        for row in rows
    ]


FIRST_CALL = """
import resource, sys
import numpy as np
import jounce as jn
def seconds():  # of this process and of those that compile for it
    spent = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(x.ru_utime + x.ru_stime for x in spent)
robot, q = jn.load_robot(sys.argv[1]), np.random.default_rng(0).uniform(-1, 1, (1, 7, 5))
function, energies = jn.inverse_dynamics, jn.dynamics.higher_order
begin = seconds()
function(robot, q[:, :5]) if sys.argv[2] == "inverse" else energies(robot, q, 3)
print(seconds() - begin)
"""


@pytest.mark.slow
def test_the_first_call_takes_at_most_six_times_that_of_inverse_dynamics_with_the_same_rates():
    def seconds(which):
        command = [sys.executable, "-c", FIRST_CALL, str(EXAMPLES / "robots" / "lr_mate.urdf"), which]
        environment = {**os.environ, "JOUNCE_CACHE_DIR": "", "XLA_FLAGS": ""}
        return float(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)

    assert seconds("higher_order") <= 6 * seconds("inverse")  # 3.2 to 3.6 measured


def test_derivatives_that_drop_out_are_not_asked_for():
    robot, q, right = case(tree)
    agree(gibbs_appell(robot, q[:, :3], m=6), right[:, :1])
    agree(higher_order(robot, q[:, :5], 3)[:, None], right[:, 2:3])
    assert not jn.energy.energy_slope(robot, q[:, :1], m=4, order=1, rate=1).any()


# what the paper prints, in fifty digits


@functools.cache
def digits(seed):
    """Return a chain of two revolute joints, its coordinates and its inertia forces in fifty digits."""
    q = np.random.default_rng(seed).uniform(-1, 1, (10, 2))
    with mp.workdps(50):
        made, rows = in_digits(chain(), q)
        return made, rows, negrean_dynamics.inertia_forces(made, rows, 4)


def off(found, right):
    return np.abs(found - right).max() / np.abs(right).max()


@pytest.mark.slow
def test_equation_130_by_slopes_of_energies():
    robot, q, right = case(chain, order=8, samples=1)
    first = jn.energy.energy_slope(robot, q, m=3, order=2) + jn.energy.energy_slope(robot, q, m=1, order=1) / 2
    agree(first, right[:, 1:2])


@pytest.mark.slow
def test_equation_131_by_slopes_of_energies():
    robot, q, right = case(chain, order=8, samples=1)
    third, second, zeroth = (jn.energy.energy_slope(robot, q, m=m, order=p) for p, m in ((3, 4), (2, 2), (1, 0)))
    agree(third + 2 / 3 * second + zeroth, right[:, 2:3], 1e-12)  # a third is printed


@SEEDS
def test_equation_130_first_rate_by_energies_of_two_orders(seed):
    with mp.workdps(50):
        robot, q, right = digits(seed)
        found = negrean_dynamics.slope(robot, q, 2, 0, 3) + negrean_dynamics.slope(robot, q, 1, 0, 1) / 2
        assert off(found, right[1]) <= 1e-14
        assert off(negrean_dynamics.higher_order(robot, q, 2, 3, [1, 2]), right[1]) <= 1e-14


@SEEDS
def test_equation_131_middle_form_has_two_thirds_where_a_third_is_printed(seed):
    with mp.workdps(50):
        robot, q, right = digits(seed)
        third, second, first = (negrean_dynamics.slope(robot, q, p, 0, m) for p, m in ((3, 4), (2, 2), (1, 0)))
        assert off(third + 2 * second / 3 + first, right[2]) <= 1e-13
        assert off(third + second / 3 + first, right[2]) == pytest.approx(MIDDLE_131[seed], rel=0.06)
        assert off(negrean_dynamics.higher_order(robot, q, 3, 4, [1, 2, 5]), right[2]) <= 1e-14


def test_equation_131_middle_form_about_one_axis():
    w, a, s = 1.5, -1.0, 2.0  # slopes of N 143 in the jounce and of N 142 in the acceleration, by the inertia
    third, second = s - 6 * w**2 * a, 9 * w**2 * a
    assert third + 2 / 3 * second == pytest.approx(s)
    assert third + 1 / 3 * second != pytest.approx(s, rel=0.5)


@SEEDS
def test_equations_132_and_134_need_catalan_numbers(seed):
    with mp.workdps(50):
        robot, q, right = digits(seed)
        assert off(negrean_dynamics.higher_order(robot, q, 4, 5, [1, 2, 5, 14]), right[3]) <= 1e-14
        printed = negrean_dynamics.higher_order(robot, q, 4, 5, [1, 2, 5, 9])
        assert off(printed, right[3]) == pytest.approx(PRINTED_132[seed], rel=0.06)


def test_coefficients():
    assert [catalan(p) for p in range(1, 7)] == [1, 2, 5, 14, 42, 132]
    assert [printed_coefficient(p) for p in range(1, 7)] == [1, 2, 5, 9, 14, 20]
    recursion = [1]  # C_0; C_{n+1} = sum C_i C_{n-i}
    for n in range(8):
        recursion.append(sum(recursion[i] * recursion[n - i] for i in range(n + 1)))
    assert [catalan(p) for p in range(9)] == recursion


@pytest.mark.slow
def test_the_fourth_coefficient_is_that_of_catalan():
    with mp.workdps(50):
        robot, q = chain(), np.random.default_rng(1).uniform(-1, 1, (10, 2))
        made, rows, right = digits(1)
        assert off(higher_order(robot, q, 4), right[3]) <= 1e-12
        printed = negrean_dynamics.higher_order(made, rows, 4, 5, [1, 2, 5, 9])
        assert off(higher_order(robot, q, 4, coefficients=printed_coefficient), printed) <= 1e-12
        assert off(printed, right[3]) > 0.1


def test_other_coefficients_can_be_given():
    robot, q, right = case(tree)
    agree(higher_order(robot, q, 1, coefficients=lambda p: 3 * p)[:, None], 3 * right[:, :1])


def test_leading_term_with_printed_coefficients():
    weights = [1, 2, 5, 14]  # of the highest derivative of q in d E_p^(k + m - 2 p - 1) / d q^(m)
    k, m = 4, 5
    shares = [math.comb(m + k - 2 * p - 1, m - p - 1) + math.comb(m + k - 2 * p - 1, k - p) for p in range(1, k + 1)]
    shares = [s / 2 for s in shares]
    scale = math.factorial(k - 1) * math.factorial(m) / math.factorial(m + k - 1)
    assert scale * sum(c * s for c, s in zip(weights, shares, strict=True)) == pytest.approx(1.0)
    weights[3] = 9
    assert scale * sum(c * s for c, s in zip(weights, shares, strict=True)) == pytest.approx(51 / 56)


# driving forces


def carried(robot, q, link, inertia, rates, gravity=(0.0, 0.0, 0.0)):
    """Return what a body fixed to a link needs, and rates: N 123, Leibniz's rule for J^T times force and moment."""
    motion = jn.forward_kinematics(robot, q, link, inertia.center_of_mass)
    J = jn.jacobian(robot, q, link, inertia.center_of_mass)
    w, R = motion.angular_velocity, motion.rotation
    tensor = [leibniz(lambda i, k: R[i] @ inertia.tensor @ R[k].T, n) for n in range(rates + 2)]
    momentum = [leibniz(lambda i, k: tensor[i] @ w[k], n) for n in range(rates + 2)]
    falling = [np.array(gravity), *[np.zeros(3)] * rates]
    force = [
        np.concatenate([inertia.mass * (motion.position[n + 2] - falling[n]), momentum[n + 1]])
        for n in range(rates + 1)
    ]
    return np.array([leibniz(lambda i, k: J[i].T @ force[k], n) for n in range(rates + 1)])


def leibniz(product, n):
    return sum(math.comb(n, i) * product(i, n - i) for i in range(n + 1))


def test_equation_123_rates_by_the_rates_of_the_jacobian():
    robot, q, right = case(tree)
    bodies = [(name, link.inertia) for name, link in robot.links.items() if link.inertia is not None]
    found = sum(carried(robot, q[0], name, inertia, RATES) for name, inertia in bodies)
    agree(found[None], right[:1], 1e-12)


def test_equation_125_driving_forces_are_of_inertia_weight_and_load():
    robot, q, _ = case(tree)
    parts = newton_euler(robot, q, RATES) + gravity_forces(robot, q, RATES)
    agree(jn.inverse_dynamics(robot, q[:, : RATES + 3], drives=False), parts, 1e-12)
    load = jn.Inertia(1.5, [0.1, 0.2, -0.1], [0.02, 0.03, 0.04])
    loaded = jn.inverse_dynamics(robot.with_payload("link_2", load), q[:, : RATES + 3], drives=False)
    agree(loaded[:1], parts[:1] + carried(robot, q[0], "link_2", load, RATES, robot.gravity), 1e-12)


def test_gravity_forces_are_the_slope_of_the_potential_energy():
    robot, q, _ = case(tree)
    found = gravity_forces(robot, q, 1)
    with mp.workdps(50):
        for sample, forces in zip(q, found, strict=True):
            made, rows = in_digits(robot, sample)
            for j in range(3):
                sides = []
                for sign in (1, -1):
                    moved = [list(row[:3]) for row in rows]
                    moved[j][0] += sign * mpf("1e-20")
                    sides.append(
                        mp_robot.State(made, [mp_robot.motion(row) for row in moved]).potential_energy().derivatives()
                    )
                for n in range(2):
                    slope = float((sides[0][n] - sides[1][n]) / mpf("2e-20"))
                    assert abs(slope - forces[n, j]) <= 1e-13 * np.abs(found).max()


def test_equations_144_to_146_torques_about_one_axis():
    tensor, q = (0.02, 0.06, 0.055), np.random.default_rng(2).normal(size=(3, 7, 1))
    arm = jn.robot.from_screws([jn.robot.JointAxis([0, 1, 0], inertia=jn.Inertia(2.0, [0.3, 0.4, 0.1], tensor))])
    about_axis = 2.0 * (0.3**2 + 0.1**2) + 0.06
    right = np.stack(negrean_energies.one_axis_torques(about_axis, *(q[:, k, 0] for k in (2, 3, 4))), axis=1)
    np.testing.assert_allclose(newton_euler(arm, q, 2)[..., 0], right, rtol=0, atol=1e-12)
    weight = np.asarray(gravity_forces(arm, q, 2))[..., 0]
    whole = jn.inverse_dynamics(arm, q[:, :5])[..., 0]
    np.testing.assert_allclose(whole, right + weight, rtol=0, atol=1e-12)
    assert np.abs(weight).max() > 0.1 * np.abs(whole).max(), "the last members of 144-146 leave out the part of gravity"


# errors


@pytest.mark.parametrize("form", [lagrange, mangeron_nielsen, gibbs_appell, newton_euler, virtual_work])
def test_too_few_derivatives_or_no_number_of_rates(form):
    robot, q, _ = case(tree)
    with pytest.raises(jn.errors.RobotError, match="needs derivatives of q to order"):
        form(robot, q[:, :4], 2)
    with pytest.raises(jn.errors.RobotError, match=r"rates.*must be a whole number, 0 or greater"):
        form(robot, q, -1)


def test_an_order_of_derivatives_that_is_too_small():
    robot, q, _ = case(tree)
    with pytest.raises(jn.errors.RobotError, match=r"m.*must be a whole number, 1 or greater"):
        mangeron_nielsen(robot, q, m=0)
    with pytest.raises(jn.errors.RobotError, match=r"m.*must be a whole number, 2 or greater"):
        gibbs_appell(robot, q, m=1)
    with pytest.raises(jn.errors.RobotError, match=r"m.*must be a whole number, 4 or greater"):
        higher_order(robot, q, 3, 3)
    with pytest.raises(jn.errors.RobotError, match=r"k.*must be a whole number, 1 or greater"):
        higher_order(robot, q, 0)
    with pytest.raises(jn.errors.RobotError, match="needs derivatives of q to order 9"):
        higher_order(robot, q, 8)
