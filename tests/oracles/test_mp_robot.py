"""The oracle of robots itself: balance of energy, equivalent clouds, a pendulum in closed form, and Pinocchio."""

from pathlib import Path

import numpy as np
import pinocchio
import pytest
from mpmath import mp, mpf

from tests.oracles import mp_urdf, negrean_energies
from tests.oracles.mp_robot import State, cloud, cross, cut, dot, from_numbers, minus, motion, rates, times

ROBOTS = Path(__file__).parents[2] / "examples" / "robots"


@pytest.fixture(autouse=True)
def digits():
    with mp.workdps(50):
        yield


def floats(values):
    return np.array([float(x) for x in values])


def random_robot(seed, parents, types):
    """Return a tree with random figures; bodies of type fixed carry mass too."""
    rng = np.random.default_rng(seed)
    bodies = []
    for parent, kind in zip(parents, types, strict=True):
        square = rng.normal(size=(3, 3))
        second = square @ square.T  # any positive second moments are those of a real body
        rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        body = {"parent": parent, "type": kind, "position": rng.normal(size=3), "axis": rng.normal(size=3)}
        body |= {
            "rotation": rotation * np.linalg.det(rotation),
            "mass": rng.uniform(0.5, 2),
            "center": rng.normal(size=3),
        }
        bodies.append(body | {"inertia": np.trace(second) * np.eye(3) - second})
    return from_numbers(bodies)


def random_state(seed, order):
    robot = random_robot(seed, [-1, 0, 1, 1, 0], ["revolute", "prismatic", "revolute", "fixed", "revolute"])
    rng = np.random.default_rng(seed + 100)
    return State(robot, [motion(rng.normal(size=order + 1)) for _ in robot.moving])


def close(a, b, tolerance="1e-40"):
    return abs(a - b) <= mpf(tolerance) * (1 + abs(b))


def test_power_of_forces_is_the_rate_of_energy_with_all_its_rates():
    state = random_state(1, 7)
    forces = state.forces()
    power = 0 * forces[0]
    for force, coordinate in zip(forces, state.motions, strict=True):
        (speed,) = cut(rates([coordinate]), len(force))
        power = power + force * speed
    stored = [state.potential_energy()]
    for k in range(len(state.robot.bodies)):
        stored += state.energies(k, 0)
    for level, got in enumerate(power.c):
        assert close(got, mp.fsum(energy.differentiate().c[level] for energy in stored))


def test_cloud_has_mass_center_and_inertia_of_the_body():
    body = random_state(2, 2).robot.bodies[2]
    points = cloud(body)
    assert close(mp.fsum(m for m, _ in points), body.mass)
    assert all(m > 0 for m, _ in points)
    for i in range(3):
        assert close(mp.fsum(m * r[i] for m, r in points), body.mass * body.center[i])
        for j in range(3):
            arms = [(m, minus(r, body.center)) for m, r in points]
            entry = mp.fsum(m * ((dot(d, d) if i == j else 0) - d[i] * d[j]) for m, d in arms)
            assert close(entry, body.inertia[i][j])


def test_energy_of_rotation_and_of_mass_at_its_center_are_the_cloud_of_first_order():
    state = random_state(3, 4)
    for k, body in enumerate(state.robot.bodies):
        spin = state.angular_velocity(k)
        w, a = (floats(x.c[0] for x in vector) for vector in (spin, rates(spin)))
        back = np.array([floats(x.c[0] for x in row) for row in state.attitude[k]]).T
        inertia = np.array([floats(row) for row in body.inertia])
        velocity, acceleration = (floats(x.c[0] for x in rates(state.center[k], n)) for n in (1, 2))
        kinetic = negrean_energies.kinetic(float(body.mass), inertia, back @ velocity, back @ w)
        first = negrean_energies.first_order_at_center(
            float(body.mass), inertia, back @ acceleration, back @ w, back @ a
        )
        for got, p in ((kinetic, 0), (first, 1)):
            whole = sum(float(part.c[0]) for part in state.energies(k, p))
            assert abs(got - whole) <= 1e-13 * (1 + abs(whole))


def test_energies_about_one_axis_are_those_of_the_paper():
    body = {
        "parent": -1,
        "type": "revolute",
        "mass": 2.0,
        "center": [0.3, 0.1, 0.2],
        "inertia": np.diag([0.3, 0.4, 0.5]),
    }
    derivatives = [0.4, 1.1, -0.7, 1.9, -2.3]
    state = State(from_numbers([body]), [motion(derivatives)])
    about_axis = 2.0 * (0.3**2 + 0.1**2) + 0.5
    for p, expected in enumerate(negrean_energies.one_axis(about_axis, *derivatives[1:]), 1):
        assert float(sum(part.c[0] for part in state.energies(0, p))) == pytest.approx(expected, rel=1e-14)
    (force,) = State(state.robot.without_gravity(), [motion([*derivatives, 0.0])]).forces()
    expected = negrean_energies.one_axis_torques(about_axis, *derivatives[2:])
    assert [float(d) for d in force.derivatives()[:3]] == pytest.approx(expected, rel=1e-14)


def test_first_order_energy_about_any_point_is_that_about_the_center():
    rng = np.random.default_rng(5)
    center, acceleration, w, a = rng.normal(size=(4, 3))
    square = rng.normal(size=(3, 3))
    inertia = np.trace(square @ square.T) * np.eye(3) - square @ square.T
    at_origin = inertia + 1.7 * (center @ center * np.eye(3) - np.outer(center, center))
    at_center = acceleration + np.cross(a, center) + np.cross(w, np.cross(w, center))
    expected = negrean_energies.first_order_at_center(1.7, inertia, at_center, w, a)
    assert negrean_energies.first_order(1.7, at_origin, center, acceleration, w, a) == pytest.approx(
        expected, rel=1e-13
    )


def test_printed_energies_of_higher_order_lack_terms():
    inertia, spin = np.diag([0.3, 0.4, 0.5]), np.eye(3)[2]
    w, a, j, s = 1.1, -0.7, 1.9, -2.3
    _, second, third = negrean_energies.one_axis(0.5, w, a, j, s)
    moments = np.trace(inertia) / 2 * np.eye(3) - inertia
    vectors = [x * spin for x in (w, a, j, s)]
    printed = negrean_energies.printed_rotation_second_order(inertia, moments, *vectors[:3])
    assert second - printed == pytest.approx(0.25 * (9 * w**2 * a**2 - 2 * w**3 * j))
    printed = negrean_energies.printed_rotation_third_order(inertia, moments, *vectors)
    assert abs(third - printed) > 0.1 * third


def test_wrench_along_the_axis_is_the_generalized_force():
    state = random_state(6, 5)
    for force, k in zip(state.forces(), state.robot.moving, strict=True):
        body = state.robot.bodies[k]
        along = state.wrench(k)[0 if body.type == "prismatic" else 1]
        for got, expected in zip(dot(along, body.axis).c, force.c, strict=True):
            assert close(got, expected)


def test_external_load_takes_its_power_from_the_joints():
    state = random_state(7, 4)
    load = [[motion(row) for row in np.random.default_rng(8 + k).normal(size=(3, 3))] for k in range(2)]
    changed = [a - b for a, b in zip(state.forces({4: load}), state.forces(), strict=True)]
    n = len(changed[0])
    speeds = [cut(rates([q]), n)[0] for q in state.motions]
    A = [cut(row, n) for row in state.attitude[4]]
    force, moment = (times(A, part) for part in load)
    at_origin = cut(rates(state.point(4)), n)
    power = dot(force, at_origin) + dot(moment, cut(state.angular_velocity(4), n))
    taken = sum((f * v for f, v in zip(changed[1:], speeds[1:], strict=True)), changed[0] * speeds[0])
    assert all(close(a, -b) for a, b in zip(taken.c, power.c, strict=True))


def test_jacobian_times_rates_of_coordinates_is_the_motion_of_the_point():
    state = random_state(9, 5)
    columns = state.jacobian(2, (0.2, -0.3, 0.4))
    speeds = rates(state.motions)
    n = len(speeds[0])
    velocity = [*rates(state.point(2, (0.2, -0.3, 0.4))), *state.angular_velocity(2)]
    for row, expected in enumerate(velocity):
        found = sum((cut([c[row]], n)[0] * v for c, v in zip(columns[1:], speeds[1:], strict=True)), 0 * expected)
        found = found + cut([columns[0][row]], n)[0] * speeds[0]
        assert all(close(a, b) for a, b in zip(found.c, expected.c, strict=True))


def test_file_and_forces_against_pinocchio():
    model = pinocchio.buildModelFromUrdf(str(ROBOTS / "panda.urdf"))
    data = model.createData()
    rng = np.random.default_rng(10)
    derivatives = rng.uniform(-1, 1, size=(3, model.nv))
    robot = mp_urdf.load(ROBOTS / "panda.urdf")
    assert [robot.bodies[k].joint for k in robot.moving] == list(model.names)[1:]
    state = State(robot, [motion(column) for column in derivatives.T])
    expected = pinocchio.rnea(model, data, *derivatives)
    got = floats(force.c[0] for force in state.forces())
    assert np.abs(got - expected).max() <= 1e-14 * np.abs(expected).max()
    center = pinocchio.centerOfMass(model, data, *derivatives)
    assert floats(x.c[0] for x in state.center_of_mass()) == pytest.approx(center, rel=1e-13)


def test_locked_joint_and_rotation_of_rounded_numbers():
    robot = random_robot(11, [-1, 0], ["revolute", "revolute"])
    held = robot.locked({"joint_2"})
    assert held.moving == [0]
    state = State(held, [motion([0.1, 0.2, 0.3])])
    assert close(state.forces()[0].c[0], State(robot, [motion([0.1, 0.2, 0.3]), motion([0, 0, 0])]).forces()[0].c[0])
    R = robot.bodies[0].rotation
    assert all(close(x, y) for x, y in zip(cross(R[0], R[1]), R[2], strict=True))
