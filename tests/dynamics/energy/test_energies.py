"""Energies of bodies, robots and mechanisms: Negrean 2025, equations 65-122 and 141-143, against point masses."""

import dataclasses
import functools
import itertools
import math

import jax.numpy as jnp
import numpy as np
import pytest
from mpmath import mp

import jounce as jn
from jounce.dynamics import acceleration_energy, body_energy, kinetic_energy
from jounce.jet import Jet
from jounce.rigid.frames import Frames
from tests.oracles import mp_robot, negrean_dynamics, negrean_energies
from tests.oracles.negrean_dynamics import BodyMotion
from tests.problems.mechanisms import example

SEEDS = pytest.mark.parametrize("seed", range(3))
body_of = functools.cache(BodyMotion)
ERRORS = {  # |printed / right - 1| for the seeds 0, 1, 2, to two digits
    "107": [0.10, 0.059, 0.041],
    "117": [0.87, 0.75, 0.19],
    "119": [0.92, 1.0, 0.46],
    "121": [0.98, 1.0, 0.69],
    "122": [0.76, 0.77, 0.62],
}


def close(found, right, rel=1e-13):
    np.testing.assert_allclose(found, right, rtol=0, atol=rel * np.max(np.abs(right)))


def library(body, p, n=0):
    """Return translation and rotation of a body and n rates, by the library; plain derivatives."""
    order = p + 1 + n
    axes = tuple(Jet.from_derivatives(jnp.asarray(body.R[: order + 1, :, i])) for i in range(3))
    frames = Frames(Jet.from_derivatives(jnp.asarray(body.r[: order + 1])), axes, None)
    parts = body_energy(frames, body.mass, jnp.asarray(body.center), jnp.asarray(body.second_moments), p)
    return tuple(np.asarray(part.derivatives()) for part in parts)


# one rigid body


@SEEDS
def test_equations_065_to_072_kinetic_energy_by_koenig(seed):
    body = body_of(seed)
    arm, about_center = body.R[0] @ body.center, body.inertia
    about_origin = about_center + body.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    v, w = body.r[1], body.w[0]
    parts = (body.mass / 2 * v @ v, body.mass * v @ np.cross(w, arm), w @ about_origin @ w / 2)  # 67, 68 twice, 69
    center = v + np.cross(w, arm)
    translation, rotation = library(body, 0)
    close(sum(parts), body.cloud_energy(0))  # 65, 66, 70
    close(negrean_energies.kinetic(body.mass, about_center, center, w), body.cloud_energy(0))  # 71, 72
    close(translation[0], body.mass / 2 * center @ center)
    close(rotation[0], w @ about_center @ w / 2)


@SEEDS
def test_equations_083_to_106_terms_of_the_energy_of_first_order(seed):
    body = body_of(seed)
    arms, arm = body.points @ body.R[0].T, body.R[0] @ body.center
    a0, w, e = body.r[2], *body.w[:2]
    tangential, radial = np.cross(e, arms), np.cross(w, np.cross(w, arms))  # 83
    close(a0 + tangential + radial, body.point(2, body.points))

    def integral(a, b):
        return body.masses @ (a * b * np.ones_like(arms)).sum(axis=1) / 2

    about_origin = body.inertia + body.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    close(integral(a0, a0), body.mass * a0 @ a0 / 2)  # 84
    close(integral(a0, tangential), body.mass * a0 @ np.cross(e, arm) / 2)  # 85
    close(integral(a0, radial), body.mass * a0 @ np.cross(w, np.cross(w, arm)) / 2)  # 86
    close(integral(tangential, tangential), e @ about_origin @ e / 2)  # 87
    close(integral(tangential, radial), e @ np.cross(w, about_origin @ w) / 2)  # 88-96
    close(integral(radial, radial), w @ w * (w @ about_origin @ w) / 2)  # 97-104
    right = body.cloud_energy(1)
    close(negrean_energies.first_order(body.mass, about_origin, arm, a0, w, e), right)  # 105
    center = a0 + np.cross(e, arm) + np.cross(w, np.cross(w, arm))
    close(negrean_energies.first_order_at_center(body.mass, body.inertia, center, w, e), right)  # 106
    translation, rotation = library(body, 1)
    close(translation[0] + rotation[0], right)
    close(rotation[0], negrean_energies.rotation_first_order(body.inertia, w, e))


@SEEDS
def test_equations_089_to_102_identities_of_one_particle(seed):
    w, e, rho = np.random.default_rng(seed).normal(size=(3, 3))
    W, P = negrean_dynamics.skew(w), negrean_dynamics.skew(rho)
    spun = np.cross(w, np.cross(w, rho))
    close(e @ P, np.cross(e, rho))  # 89
    close(spun, w @ rho * w - w @ w * rho)
    close(np.cross(e, rho) @ spun, e @ P @ w * (w @ rho) - w @ w * (e @ P @ rho))  # 90
    assert abs(w @ w * (e @ P @ rho)) <= 1e-14  # 91
    close(e @ P @ w * (w @ rho), e @ W.T @ np.outer(rho, rho) @ w)  # 92
    close(np.outer(rho, rho), rho @ rho * np.eye(3) - P @ P.T)  # 93
    assert abs(e @ W.T @ (rho @ rho * np.eye(3)) @ w) <= 1e-14  # 94
    close(-e @ W.T @ P @ P.T @ w, e @ W @ P @ P.T @ w)  # 95
    close(np.cross(w, P.T @ w), spun)  # 98, 99
    assert abs((P.T @ w) @ w) <= 1e-14  # 101
    close(spun @ spun, w @ (w @ P @ P.T @ w * np.eye(3)) @ w)  # 100, 102


@SEEDS
def test_equations_089_to_102_summed_over_the_particles_give_the_energy_of_rotation(seed):
    body = body_of(seed)
    w, e = body.w[:2]
    W, total = negrean_dynamics.skew(w), 0.0
    for m, rho in zip(body.masses, (body.points - body.center) @ body.R[0].T, strict=True):
        P = negrean_dynamics.skew(rho)
        tangential = np.cross(e, rho) @ np.cross(e, rho)
        mixed = e @ W @ P @ P.T @ w  # 89-95
        radial = w @ (w @ P @ P.T @ w * np.eye(3)) @ w  # 98-102
        total += m / 2 * (tangential + 2 * mixed + radial)
    close(library(body, 1)[1][0], total)


@SEEDS
@pytest.mark.parametrize("p", range(5))
def test_equations_107_and_109_any_order_and_its_rates(seed, p):
    body = body_of(seed)
    translation, rotation = library(body, p, 2)
    for n in range(3):
        right = body.cloud_energy(p, n)
        close(body.trace_energy(p, n), right)
        close(rotation[n], body.rotation(p, n))
        close(translation[n] + rotation[n], right)
    center = [body.point(p + 1 + k, body.center) for k in range(3)]
    close(translation[0], body.mass / 2 * center[0] @ center[0])
    close(translation[1], body.mass * center[0] @ center[1])


def test_equation_107_as_printed_lacks_the_term_between_origin_and_rotation():
    for p, n in itertools.product(range(1, 4), range(3)):
        for seed in range(3):
            body = body_of(seed)
            missing = sum(
                math.comb(n, k) * body.mass * body.r[p + 1 + k] @ body.R[p + 1 + n - k] @ body.center
                for k in range(n + 1)
            )
            close(body.printed_107(p, n) + missing, body.trace_energy(p, n), rel=1e-12)
            assert abs(missing) > 1e-3 * abs(body.trace_energy(p, n))
    errors = [abs(body_of(s).printed_107(1) / body_of(s).trace_energy(1) - 1) for s in range(3)]
    np.testing.assert_allclose(errors, ERRORS["107"], rtol=0.06)


def test_equation_107_second_form_is_no_rate():
    for seed in range(3):
        body = body_of(seed)
        close(body.printed_107_middle(2, 0), body.rotation(2))
        assert abs(body.printed_107_middle(2, 1) / body.rotation(2, 1) - 1) > 0.5


@SEEDS
def test_planar_and_spatial_poses_give_the_energy_of_their_frames(seed):
    rng = np.random.default_rng(seed)
    r, angle = rng.normal(size=(5, 2)), rng.normal(size=5)
    turned = [np.exp(1j * angle[0])]
    for k in range(4):  # (exp(i angle))' = i angle' exp(i angle)
        turned.append(sum(math.comb(k, j) * 1j * angle[j + 1] * turned[k - j] for j in range(k + 1)))
    center, inertia, mass = np.array([0.3, -0.2]), 0.7, 1.3
    pose = jn.rigid.PlanarPose.from_jets(*(Jet.from_derivatives(jnp.asarray(x)) for x in (r, angle)))
    translation, rotation = body_energy(pose, mass, jnp.asarray(center), jnp.eye(2) * inertia / 2, 2)
    moved = np.array([x + 1j * y for x, y in r]) + (center[0] + 1j * center[1]) * np.array(turned)
    close(translation.derivatives(), np.array([mass / 2, mass]) * (moved[3] * moved[3:].conj()).real)
    close(rotation.derivatives(), np.array([inertia / 2, inertia]) * (turned[3] * np.conj(turned[3:])).real)


# what the paper prints


@pytest.mark.parametrize("p, number", [(2, "117"), (3, "119"), (4, "121")])
def test_equations_117_119_and_121_as_printed_lack_terms(p, number):
    found = []
    for seed in range(3):
        body = body_of(seed)
        right = body.rotation(p)
        found.append(negrean_dynamics.printed_rotation(p, body.inertia, body.moments, body.w) / right - 1)
        inertia = body.R[0].T @ body.inertia @ body.R[0]
        rates = negrean_dynamics.body_axes(body)  # the other reading: derivatives of components in the body
        other = negrean_dynamics.printed_rotation(p, inertia, body.second_moments, rates)
        assert abs(other / right - 1) > 0.02
        close(library(body, p)[1][0], right)
    np.testing.assert_allclose(np.abs(found), ERRORS[number], rtol=0.06)


@SEEDS
def test_equation_117_with_its_cross_terms(seed):
    body = body_of(seed)
    close(negrean_dynamics.second_order_rotation(body.moments, body.w), body.rotation(2))


@SEEDS
def test_the_matrix_of_equation_117_in_global_and_in_body_axes(seed):
    turned = body_of(seed).R  # and its plain derivatives

    def spin(k, left):
        """Derivative k of R' R^T, the global angular velocity, or of R^T R', that in body axes."""
        pairs = ((turned[j + 1], turned[k - j].T) for j in range(k + 1))
        parts = [math.comb(k, j) * (a @ b if left else b @ a) for j, (a, b) in enumerate(pairs)]
        return sum(parts)

    for left in (True, False):
        w, v, u, t = (spin(k, left) for k in range(4))
        twice, once = (v @ w, w @ v) if left else (w @ v, v @ w)
        third = u + 2 * twice + once + w @ w @ w
        rate = t + 2 * (u @ w + v @ v if left else v @ v + w @ u) + (v @ v + w @ u if left else u @ w + v @ v)
        rate = rate + v @ w @ w + w @ v @ w + w @ w @ v
        fourth = rate + (third @ w if left else w @ third)
        for order, matrix in ((3, third), (4, fourth)):
            close(matrix @ turned[0] if left else turned[0] @ matrix, turned[order], 1e-12)


def test_equation_122_as_printed_contradicts_that_of_first_order():
    found = []
    for seed in range(3):
        body = body_of(seed)
        printed = negrean_dynamics.printed_rotation_any_order(2, body.inertia, body.w)
        found.append(abs(printed / body.rotation(2) - 1))
        close(library(body, 2)[1][0], body.rotation(2))
    np.testing.assert_allclose(found, ERRORS["122"], rtol=0.06)
    spin = np.array([[0.0, 0.0, 2.0], [0.0, 0.0, 0.0]])  # a steady turn about one axis: E_1 is I w^4 / 2, half of it
    assert negrean_dynamics.printed_rotation_any_order(1, np.eye(3), spin) == 16.0
    assert negrean_energies.rotation_first_order(np.eye(3), *spin) == 8.0


def test_equations_073_to_075_and_110_factor_of_translation():
    factors = [negrean_dynamics.translation_factor(delta) for delta in (-1, 0, 1)]
    assert factors == [1.0, 1.0, 0.0]  # general motion, translation, rotation about a fixed axis


# one axis: N 141-143


def arm(tensor=(0.02, 0.06, 0.055)):
    return jn.robot.from_screws([jn.robot.JointAxis([0, 1, 0], inertia=jn.Inertia(2.0, [0.3, 0.4, 0.1], tensor))])


@SEEDS
def test_equations_141_to_143_one_axis(seed):
    motion = np.random.default_rng(seed).normal(size=(4, 6, 1))
    about_axis = 2.0 * (0.3**2 + 0.1**2) + 0.06
    right = negrean_energies.one_axis(about_axis, *(motion[:, k, 0] for k in range(1, 5)))
    for p, expected in enumerate(right, 1):
        close(acceleration_energy(arm(), motion, order=p).total[:, 0], expected)


def test_equation_143_with_its_repeated_terms_counted_twice():
    w, a, j, s = 1.5, -1.0, 0.5, 2.0
    third = negrean_energies.one_axis(1.0, w, a, j, s)[2]
    twice = third + (30 * w**4 * a**2 - 12 * w**2 * a * s) / 2
    found = float(acceleration_energy(arm((0.4, 0.4, 0.4)), [[0.0], [w], [a], [j], [s]], order=3).total[0])
    assert found == pytest.approx(0.6 * third, rel=1e-13)
    assert abs(twice / third - 1) > 0.1


# robots


def numbers_of(robot):
    """Return a robot of screws or joints as bodies of the oracle."""
    index = {robot.base: -1}
    bodies = []
    for joint in robot.joints.values():
        index[joint.child] = len(bodies)
        body = {"parent": index[joint.parent], "type": joint.type, "position": joint.position, "axis": joint.axis}
        body |= {"rotation": joint.rotation, "name": joint.child, "joint": joint.name}
        inertia = robot.links[joint.child].inertia
        if inertia is not None:
            body |= {"mass": inertia.mass, "center": inertia.center_of_mass, "inertia": inertia.tensor}
        bodies.append(body)
    return mp_robot.from_numbers(bodies)


def tree():
    """Return a robot of three joints on two branches, one of them a slide."""
    rng = np.random.default_rng(4)
    masses = [jn.Inertia(*b) for b in ((1.1, [0.2, 0.1, 0.0]), (0.7, [0.0, 0.3, 0.1]), (0.5, [0.1, 0.0, 0.2]))]
    masses = [jn.Inertia(i.mass, i.center_of_mass, np.diag([0.3, 0.2, 0.4])) for i in masses]
    links = [jn.Link("base"), *(jn.Link(f"link_{k}", inertia) for k, inertia in enumerate(masses))]
    kinds = [("base", "revolute"), ("link_0", "prismatic"), ("link_0", "revolute")]
    joints = [
        jn.Joint(f"joint_{k}", parent, f"link_{k}", kind, position=rng.normal(size=3), axis=rng.normal(size=3))
        for k, (parent, kind) in enumerate(kinds)
    ]
    return jn.Robot("tree", links, joints)


@pytest.mark.parametrize("p", range(4))
def test_robot_against_point_masses_in_fifty_digits(p):
    robot, q = tree(), np.random.default_rng(p).normal(size=(6, 3))
    found = acceleration_energy(robot, q, order=p)
    assert (found.order, found.bodies) == (p, ("link_0", "link_1", "link_2"))
    with mp.workdps(50):
        state = mp_robot.State(numbers_of(robot), [mp_robot.motion(column) for column in q.T])
        for k in range(3):
            for part, right in zip((found.translation, found.rotation), state.energies(k, p), strict=True):
                expected = np.array([float(d) for d in right.derivatives()])[: 5 - p]
                np.testing.assert_allclose(part[:, k], expected, rtol=1e-12, atol=1e-13)
    close(found.total, (found.translation + found.rotation).sum(axis=-1))


def test_power_is_the_rate_of_kinetic_energy():
    robot, q = tree(), np.random.default_rng(7).normal(size=(5, 6, 3))
    forces = jn.dynamics.newton_euler(robot, q, rates=3)
    energy = kinetic_energy(robot, q).total
    for n in range(4):
        power = sum(math.comb(n, k) * (forces[:, k] * q[:, n - k + 1]).sum(axis=1) for k in range(n + 1))
        close(energy[:, n + 1], power)


def test_equations_078_and_079_theorem_of_kinetic_energy():
    robot, q = tree(), np.random.default_rng(8).normal(size=(5, 3, 3))
    work = (jn.dynamics.virtual_work(robot, q)[:, 0] * q[:, 1]).sum(axis=1)
    close(kinetic_energy(robot, q).total[:, 1], work)


def slopes(robot, q, link, m):
    """Return d r^(n) / d q_j^(m) of the center of mass of a link for all n, (n, 3, joints).

    The n-th derivative is linear in the m-th derivative of a coordinate where n < 2 m, and m is taken so large.
    """
    place = robot.links[link].inertia.center_of_mass
    columns = []
    for j in range(q.shape[-1]):
        change = np.zeros_like(q)
        change[m, j] = 1.0
        sides = [jn.forward_kinematics(robot, q + sign * change, link, place).position for sign in (1, -1)]
        columns.append((sides[0] - sides[1]) / 2)
    return np.stack(columns, axis=-1)


def test_equations_076_and_077_velocity_in_the_energy_of_translation():
    robot, q, m = tree(), np.random.default_rng(9).normal(size=(6, 3)), 3
    energy = kinetic_energy(robot, q)
    for k, link in enumerate(robot.moving_links):
        mass, found = robot.links[link].inertia.mass, slopes(robot, q, link, m)
        velocity, printed = found[m] @ q[1], found[m + 1] @ q[1] / (m + 1)
        close(mass / 2 * velocity @ velocity, energy.translation[0, k], rel=1e-12)
        if k:  # the printed vector is the rate of the slope times the speed, and has no square
            assert abs(mass / 2 * printed @ printed / energy.translation[0, k] - 1) > 0.1


def test_equations_112_to_115_parts_of_the_energy_of_first_order():
    robot, q, m = tree(), np.random.default_rng(10).normal(size=(6, 3)), 3
    energy = acceleration_energy(robot, q, order=1)
    for k, link in enumerate(robot.moving_links):
        inertia, found = robot.links[link].inertia, slopes(robot, q, link, m)
        first, second = found[m] @ q[2], found[m + 1] @ q[1] / (m + 1)
        squares, product = first @ first + second @ second, first @ second
        close(inertia.mass / 2 * (squares + 2 * product), energy.translation[0, k], rel=1e-12)
        if k:  # as printed the product stands once
            assert abs(inertia.mass / 2 * (squares + product) / energy.translation[0, k] - 1) > 4e-3
        motion = jn.forward_kinematics(robot, q, link)
        R, w, e = motion.rotation[0], motion.angular_velocity[0], motion.angular_velocity[1]
        tensor = R @ inertia.tensor @ R.T
        close(energy.rotation[0, k], negrean_energies.rotation_first_order(tensor, w, e), rel=1e-12)  # 110-115


# mechanisms


def with_masses(name, bodies):
    """Return the mechanism of an example with masses in some of its bodies."""
    mechanism = jn.load(example(name))
    made = {key: dataclasses.replace(body, **bodies.get(key, {})) for key, body in mechanism.bodies.items()}
    return dataclasses.replace(mechanism, bodies=made)


TIMES = np.linspace(0.1, 1.7, 4)


@functools.cache
def four_bar():
    masses = {
        "crank": {"mass": 0.4, "inertia": 0.02, "center_of_mass": [0.02, 0.01]},
        "rocker": {"mass": 1.5, "inertia": 0.09, "center_of_mass": [0.1, -0.02]},
    }
    return masses, jn.solve(with_masses("four_bar", masses), TIMES, order=4)


@pytest.mark.parametrize("p", range(3))
def test_planar_mechanism(p):
    masses, motion = four_bar()
    found = acceleration_energy(motion, order=p)
    assert found.bodies == ("crank", "rocker")
    for k, (name, body) in enumerate(masses.items()):
        center = np.asarray(motion.point(name, body["center_of_mass"]))  # time, derivative, component
        tip = np.asarray(motion.point(name, [1.0, 0.0])) - np.asarray(motion.point(name, [0.0, 0.0]))
        for part, points, scale in (
            (found.translation, center, body["mass"]),
            (found.rotation, tip, body["inertia"]),
        ):
            for n in range(4 - p):
                pairs = (points[:, p + 1 + i] * points[:, p + 1 + n - i] * math.comb(n, i) for i in range(n + 1))
                expected = scale / 2 * sum(pair.sum(axis=1) for pair in pairs)
                close(part[:, n, k], expected, rel=1e-12)


def test_power_of_a_planar_mechanism():
    masses, motion = four_bar()
    energy = kinetic_energy(motion).total
    power = 0.0
    for name, body in masses.items():
        center, angle = np.asarray(motion.point(name, body["center_of_mass"])), np.asarray(motion.angle(name))
        power = power + body["mass"] * (center[:, 1] * center[:, 2]).sum(axis=1)
        power = power + body["inertia"] * angle[:, 1] * angle[:, 2]
    close(energy[:, 1], power)


@pytest.mark.slow
def test_spatial_mechanism_against_point_masses():
    rng = np.random.default_rng(11)
    points, weights = rng.normal(size=(6, 3)) * 0.2, rng.uniform(0.1, 0.4, 6)
    inertia = jn.Inertia.total(jn.Inertia(w, x) for w, x in zip(weights, points, strict=True))
    masses = {"coupler": {"mass": inertia.mass, "inertia": inertia.tensor, "center_of_mass": inertia.center_of_mass}}
    masses = {"coupler": {key: np.asarray(value).tolist() for key, value in masses["coupler"].items()}}
    motion = jn.solve(with_masses("rsur", masses), TIMES[:2], order=3)
    places = [np.asarray(motion.point("coupler", point)) for point in points.tolist()]
    for p in range(2):
        found = acceleration_energy(motion, order=p)
        coupler = found.bodies.index("coupler")
        expected = sum(w / 2 * (x[:, p + 1] ** 2).sum(axis=1) for w, x in zip(weights, places, strict=True))
        rate = sum(w * (x[:, p + 1] * x[:, p + 2]).sum(axis=1) for w, x in zip(weights, places, strict=True))
        close(found.total[:, 0], expected, rel=1e-12)
        close(found.total[:, 1], rate, rel=1e-12)
        others = [k for k in range(3) if k != coupler]
        assert not np.any(found.translation[..., others])
        center = np.asarray(motion.point("coupler", masses["coupler"]["center_of_mass"]))
        close(found.translation[:, 0, coupler], inertia.mass / 2 * (center[:, p + 1] ** 2).sum(axis=1), rel=1e-12)


# errors


@pytest.mark.parametrize("order", [-1, True])
def test_an_order_that_is_none(order):
    with pytest.raises(jn.errors.RobotError, match="order: must be a whole number from 0"):
        acceleration_energy(arm(), [[0.0], [1.0], [2.0]], order=order)


def test_too_few_derivatives():
    with pytest.raises(jn.errors.RobotError, match="needs derivatives of q to order 3"):
        acceleration_energy(arm(), [[0.0], [1.0], [2.0]], order=2)
    with pytest.raises(jn.errors.RobotError, match="shape"):
        acceleration_energy(arm(), [0.0, 1.0, 2.0])
    with pytest.raises(jn.errors.MechanismError, match="needs a motion solved to order 6"):
        acceleration_energy(four_bar()[1], order=5)
    with pytest.raises(ValueError, match="needs order 3"):
        library(Short, 2)


class Short:
    """A body whose motion is known to second order only."""

    r = np.ones((3, 3))
    R = np.ones((3, 3, 3))
    mass, center, second_moments = 1.0, np.zeros(3), np.eye(3)


def test_a_mechanism_without_masses_or_with_half_of_them():
    motion = jn.solve(jn.load(example("four_bar")), TIMES[:1], order=2)
    with pytest.raises(jn.errors.MechanismError, match="no body has a mass"):
        acceleration_energy(motion)
    half = jn.solve(with_masses("four_bar", {"crank": {"inertia": 0.1}}), TIMES[:1], order=2)
    with pytest.raises(jn.errors.MechanismError, match="a body with an inertia needs a mass, too"):
        kinetic_energy(half)


def test_energies_of_a_motion_are_labeled():
    _, motion = four_bar()
    energy, potential = kinetic_energy(motion), jn.energy.potential_energy(motion)
    assert energy.total.dims == potential.dims == ("time", "derivative")
    assert energy.translation.dims == ("time", "derivative", "body")
    assert energy.rotation.body.values.tolist() == list(motion.mechanism.bodies)
    np.testing.assert_array_equal(energy.total.time, motion.time)
    assert jn.dynamics.stored_energy(motion).dims == ("time",)


def test_total_energy_is_nan_where_the_motion_was_not_solved():
    motion = jn.solve(with_masses("four_bar", {"crank": {"mass": 1.0}}), TIMES, order=2)
    motion.status[1] = jn.Status.SINGULAR
    total = kinetic_energy(motion).total
    assert np.isnan(total[1]).all()
    assert np.isfinite(total[[0]]).all()


def test_a_motion_has_coordinates_of_its_own():
    with pytest.raises(jn.errors.MechanismError, match="has its coordinates already"):
        kinetic_energy(four_bar()[1], [[0.0], [1.0]])
