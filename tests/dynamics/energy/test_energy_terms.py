"""The acceleration energy by its terms, against integrals over point masses: Negrean 2025, 73-75, 83-106, 110-115."""

import functools

import numpy as np
import pytest

import jounce as jn
from tests.dynamics.energy.test_energies import TIMES, close, four_bar, with_masses
from tests.oracles import negrean_energies
from tests.problems.robots import random_robot

SAMPLES = 2
ABOUT = pytest.mark.parametrize("about", ["origin", "center_of_mass"])


@functools.cache
def cloud():
    """Return points in the frame of a body, m, and their masses, kg."""
    rng = np.random.default_rng(21)
    return rng.normal(size=(6, 3)) * 0.3, rng.uniform(0.2, 0.8, 6)


def free_body(points=None, masses=None):
    """Return a body of point masses that moves freely in space."""
    points, masses = cloud() if points is None else (points, masses)
    whole = jn.Inertia.total(jn.Inertia(m, x) for m, x in zip(masses, points, strict=True))
    return jn.Robot("cloud", [jn.Link("body", whole)], []).with_floating_base("XYZ")


@functools.cache
def state(seed=4, order=4):
    return np.random.default_rng(seed).uniform(-1, 1, (SAMPLES, order + 1, 6))


class Fields:
    """What moves the points of the body at one sample: the origin, and arms by the derivatives of the attitude."""

    def __init__(self, sample, p, about):
        motion = jn.forward_kinematics(free_body(), state(), "body")
        points, self.masses = cloud()
        center = self.masses @ points / self.masses.sum()
        reference = center if about == "center_of_mass" else np.zeros(3)
        rotation = motion.rotation[sample]
        self.arms = points - reference
        self.reference = motion.position[sample, p + 1] + rotation[p + 1] @ reference
        spin = motion.angular_velocity[sample, p]
        self.leading = np.cross(spin, self.arms @ rotation[0].T)
        self.remaining = self.arms @ rotation[p + 1].T - self.leading

    def integral(self, a, b):
        """Return the sum over the points of their mass times the product of two fields."""
        return self.masses @ (a * b * np.ones_like(self.arms)).sum(axis=1)

    def terms(self):
        """Return translation, both couplings, and the three terms of rotation: N 84-88 and 97."""
        r, a, b = self.reference, self.leading, self.remaining
        pairs = ((r, r, 0.5), (r, a, 1.0), (r, b, 1.0), (a, a, 0.5), (a, b, 1.0), (b, b, 0.5))
        return np.array([factor * self.integral(x, y) for x, y, factor in pairs])


def found_terms(terms, sample, body=-1):
    """Return the terms of one body at one sample, without rates."""
    parts = (terms.translation, terms.coupling, terms.coupling_remaining, terms.leading, terms.mixed, terms.remaining)
    return np.array([part[sample, 0, body] for part in parts])


@pytest.mark.slow
@ABOUT
@pytest.mark.parametrize("p", range(3))
def test_equations_083_to_106_each_term_is_its_integral(p, about):
    terms = jn.energy.energy_terms(free_body(), state(), order=p, about=about)
    whole = jn.energy.acceleration_energy(free_body(), state(), order=p)
    for sample in range(SAMPLES):
        right = Fields(sample, p, about).terms()
        size = np.abs(right).max()
        np.testing.assert_allclose(found_terms(terms, sample), right, rtol=0, atol=1e-13 * size)
    close(terms.total, whole.total, rel=1e-12)
    if about == "center_of_mass":
        assert not terms.coupling.any()
        assert not terms.coupling_remaining.any()
        close(terms.translation, whole.translation, rel=1e-12)
        close(terms.rotation, whole.rotation, rel=1e-12)
    if p == 0:
        assert not terms.mixed.any()
        assert not terms.remaining.any()


@pytest.mark.slow
@ABOUT
def test_equations_084_to_106_closed_forms_of_first_order(about):
    robot = free_body()
    terms, motion = jn.energy.energy_terms(robot, state(), about=about), jn.forward_kinematics(robot, state(), "body")
    inertia = robot.links["body"].inertia
    for sample in range(SAMPLES):
        R, w, e = motion.rotation[sample, 0], *motion.angular_velocity[sample, :2]
        c, m = R @ inertia.center_of_mass, inertia.mass
        tensor = R @ inertia.tensor @ R.T
        a = motion.position[sample, 2]
        if about == "origin":
            tensor = tensor + m * (c @ c * np.eye(3) - np.outer(c, c))
            right = [m * a @ np.cross(e, c), m * a @ np.cross(w, np.cross(w, c))]  # 85, 86
        else:
            a, right = a + np.cross(e, c) + np.cross(w, np.cross(w, c)), [0.0, 0.0]
        right = [m * a @ a / 2, *right, e @ tensor @ e / 2]  # 84, 87
        right += [e @ np.cross(w, tensor @ w), w @ w * (w @ tensor @ w) / 2]  # 96, 104
        size = np.abs(right).max()
        np.testing.assert_allclose(found_terms(terms, sample), right, rtol=0, atol=1e-13 * size)
        whole = negrean_energies.first_order_at_center(m, inertia.tensor, np.zeros(3), R.T @ w, R.T @ e)  # 106
        if about == "center_of_mass":
            close(terms.rotation[sample, 0, -1], whole)


@pytest.mark.slow
def test_equations_089_to_102_of_one_particle():
    rho, mass = np.array([0.3, -0.2, 0.5]), 0.7
    robot = free_body(rho[None], np.array([mass]))
    terms, motion = (
        jn.energy.energy_terms(robot, state(), about="origin"),
        jn.forward_kinematics(robot, state(), "body"),
    )
    for sample in range(SAMPLES):
        R, w, e = motion.rotation[sample, 0], *motion.angular_velocity[sample, :2]
        arm = R @ rho
        spun = arm @ w * w - w @ w * arm  # 89
        mixed = [
            np.cross(e, arm) @ spun,  # 90
            np.cross(e, arm) @ w * (w @ arm),  # 91 has dropped the rest
            e @ np.cross(arm, w) * (w @ arm),  # 92
            e @ np.cross(w, (arm @ arm * np.eye(3) - np.outer(arm, arm)) @ w),  # 93-95
        ]
        remaining = [spun @ spun, w @ w * (np.cross(arm, w) @ np.cross(arm, w))]  # 98-102
        for value in mixed:
            assert terms.mixed[sample, 0, -1] == pytest.approx(mass * value, rel=1e-12, abs=1e-14)
        for value in remaining:
            assert terms.remaining[sample, 0, -1] == pytest.approx(mass / 2 * value, rel=1e-12, abs=1e-14)


@pytest.mark.slow
def test_equations_073_and_075_kinetic_energy_is_of_translation_and_of_rotation():
    slides = random_robot(9, 3, tree=False, prismatic=1.0, fixed=0.0)
    q = np.random.default_rng(1).uniform(-1, 1, (2, 3, 3))
    still = jn.energy.energy_terms(slides, q, order=0)
    assert not still.rotation.any()  # the factor of 74 for translation alone is 0
    robot = random_robot(9, 3, tree=False, prismatic=0.3, fixed=0.0)
    terms = jn.energy.energy_terms(robot, q, order=0)
    motions = [
        jn.forward_kinematics(robot, q, link, robot.links[link].inertia.center_of_mass) for link in robot.moving_links
    ]
    for k, (link, motion) in enumerate(zip(robot.moving_links, motions, strict=True)):
        inertia = robot.links[link].inertia
        v, w = motion.position[:, 1], motion.angular_velocity[:, 0]
        tensor = motion.rotation[:, 0] @ inertia.tensor @ motion.rotation[:, 0].swapaxes(1, 2)
        close(terms.translation[:, 0, k], inertia.mass / 2 * (v * v).sum(axis=1), rel=1e-12)
        turning = np.einsum("si,sij,sj->s", w, tensor, w) / 2
        np.testing.assert_allclose(terms.rotation[:, 0, k], turning, rtol=0, atol=1e-13)
    close(terms.total, (terms.translation + terms.rotation).sum(axis=-1))  # 75
    close(terms.total, jn.energy.kinetic_energy(robot, q, drives=False).total)


@pytest.mark.slow
def test_equations_110_to_115_of_a_robot_and_rates():
    robot = random_robot(7, 3, prismatic=0.4, fixed=0.4)
    q = np.random.default_rng(3).uniform(-1, 1, (1, 5, 3))
    terms = jn.energy.energy_terms(robot, q)
    assert terms.bodies == robot.moving_links
    step = 1e-3
    later = np.stack([sum(q[:, k + j] * step**j / [1, 1, 2, 6, 24][j] for j in range(5 - k)) for k in range(5)], axis=1)
    after = jn.energy.energy_terms(robot, later)
    for name in ("translation", "leading", "mixed", "remaining"):
        value, moved = getattr(terms, name), getattr(after, name)
        series = value[:, 0] + step * value[:, 1] + step**2 / 2 * value[:, 2]
        assert np.abs(moved[:, 0] - series).max() <= 1e3 * step**3 * max(1.0, np.abs(value).max())
    bodies = {name: robot.frames[name].body for name in robot.links}
    for k, link in enumerate(robot.moving_links):
        parts = [(n, robot.links[n].inertia) for n, body in bodies.items() if body == k and robot.links[n].inertia]
        turn, at = robot.frames[link].rotation.T, robot.frames[link].position
        poses = [(turn @ (robot.frames[n].position - at), turn @ robot.frames[n].rotation) for n, _ in parts]
        moved = zip(parts, poses, strict=True)
        whole = jn.Inertia.total(inertia.moved(*pose) for (_, inertia), pose in moved)
        motion = jn.forward_kinematics(robot, q, link, whole.center_of_mass)
        R, a = motion.rotation[0, 0], motion.position[0, 2]
        w, e = motion.angular_velocity[0, :2]
        tensor = R @ whole.tensor @ R.T
        right = [whole.mass / 2 * a @ a, 0.0, 0.0, e @ tensor @ e / 2]  # 112, 113
        right += [e @ np.cross(w, tensor @ w), w @ w * (w @ tensor @ w) / 2]  # 114, 111
        np.testing.assert_allclose(found_terms(terms, 0, k), right, rtol=0, atol=1e-12 * np.abs(right).max())


def test_a_plane_mechanism():
    masses, motion = four_bar()
    terms = jn.energy.energy_terms(motion)
    for k, (name, body) in enumerate(masses.items()):
        angle = np.asarray(motion.angle(name))
        close(terms.leading[:, 0, k], body["inertia"] / 2 * angle[:, 2] ** 2)
        close(terms.remaining[:, 0, k], body["inertia"] / 2 * angle[:, 1] ** 4)
        np.testing.assert_allclose(terms.mixed[:, 0, k], 0.0, atol=1e-13 * np.abs(terms.leading).max())
    close(terms.total, jn.energy.acceleration_energy(motion).total, rel=1e-12)


@pytest.mark.slow
def test_a_mechanism_in_space():
    masses = {"coupler": {"mass": 0.8, "inertia": [0.02, 0.03, 0.04], "center_of_mass": [0.02, 0.05, 0.01]}}
    motion = jn.solve(with_masses("rsur", masses), TIMES[:2], order=2)
    coupler = list(motion.mechanism.bodies).index("coupler")
    spin = np.asarray(motion.angular_velocity("coupler", "body"))
    for about in ("origin", "center_of_mass"):
        terms = jn.energy.energy_terms(motion, about=about)
        close(terms.total, jn.energy.acceleration_energy(motion).total, rel=1e-12)
    w, e = spin[:, 0], spin[:, 1]
    I = np.diag([0.02, 0.03, 0.04])  # noqa: E741 - the usual letter
    close(terms.leading[:, 0, coupler], np.einsum("si,ij,sj->s", e, I, e) / 2, rel=1e-12)
    close(terms.mixed[:, 0, coupler], (e * np.cross(w, w @ I)).sum(axis=1), rel=1e-11)


def test_a_point_that_is_none():
    with pytest.raises(jn.errors.RobotError, match="center_of_mass"):
        jn.energy.energy_terms(free_body(), state(), about="center")
