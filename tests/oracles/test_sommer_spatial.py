"""The spatial oracles, equation by equation, against thirty-digit series of the constraints along random motions."""

import numpy as np
import pytest
from mpmath import mp, mpf

from tests.oracles import mp_joints as joints, sommer_spatial as spatial
from tests.oracles.random_motion import derivatives, series_of, spatial_body

SEEDS = range(5)


@pytest.fixture(autouse=True)
def digits():
    with mp.workdps(30):
        yield


class Case:
    """Two random bodies with points, vectors and a driver."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        (self.i, self.pose_i), (self.j, self.pose_j) = (spatial_body(rng) for _ in range(2))
        self.s_i, self.s_j, self.a_i, self.a_j = rng.normal(size=(4, 3))
        self.f = rng.normal(size=5)
        self.two = (self.i, self.j, self.s_i, self.s_j)

    @property
    def gap(self):
        return joints.gap(self.pose_i, self.pose_j, [self.s_i.tolist(), self.s_j.tolist()])

    @property
    def a(self):
        return self.pose_i.direction(self.a_i.tolist())


def defects(case, constraint, positions, rotations, rights):
    """Return Phi_q q^(k) - rhs - d^k Phi / dt^k, k = 1..4, relative to the size of its terms."""
    expected, out = derivatives(constraint), []
    for k, right in enumerate(rights, start=1):
        left = sum(
            p @ body.r[k] + q @ body.w[k - 1] for p, q, body in zip(positions, rotations, (case.i, case.j), strict=True)
        )
        out.append(abs(left - right - expected[k]) / (1 + abs(left) + abs(right)))
    return out


def close(found, series, k):
    expected = np.array([derivatives(x)[k] for x in series])
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-13 * (1 + abs(expected).max()))


@pytest.mark.parametrize("seed", SEEDS)
def test_points_and_relative_vectors(seed):
    case = Case(seed)
    point = case.pose_i.point(case.s_i.tolist())
    for k, equation in enumerate(
        (spatial.equation_059, spatial.equation_061, spatial.equation_062, spatial.equation_064, spatial.equation_066)
    ):
        close(equation(case.i, case.s_i), point, k)
    for k, equation in enumerate(
        (spatial.equation_067, spatial.equation_068, spatial.equation_069, spatial.equation_070)
    ):
        close(equation(*case.two), case.gap, k)
    close(
        spatial.equation_071(case.i, spatial.equation_072(case.s_j, case.s_i)),
        case.pose_i.direction(list(case.s_j - case.s_i)),
        0,
    )
    np.testing.assert_allclose(spatial.equation_060(case.a_i) @ case.a_j, np.cross(case.a_i, case.a_j), atol=1e-15)


@pytest.mark.parametrize("seed", SEEDS)
def test_relative_acceleration_as_printed_fails(seed):
    case = Case(seed)
    expected = np.array([derivatives(x)[2] for x in case.gap])
    assert abs(spatial.equation_069_printed(*case.two) - expected).max() > 0.1
    still = case.i._replace(w=np.zeros((4, 3)))
    np.testing.assert_allclose(
        spatial.equation_069_printed(still, *case.two[1:]), spatial.equation_069(still, *case.two[1:]), atol=1e-13
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_angular_velocity_between_axes(seed):
    case = Case(seed)
    body, A = case.i, case.i.A
    turning = np.array([derivatives(x) for x in case.pose_i.angular_velocity()]).T
    forward = [
        spatial.equation_073(A, body.w[0]),
        spatial.equation_074(A, body.w[1]),
        spatial.equation_075(A, *body.w[:3]),
        spatial.equation_076(A, *body.w),
    ]
    back = [
        spatial.equation_073(A.T, turning[0]),
        spatial.equation_074(A.T, turning[1]),
        spatial.equation_075(A, *turning[:3], back=True),
        spatial.equation_076(A, *turning, back=True),
    ]
    np.testing.assert_allclose(forward, turning, atol=1e-12)
    np.testing.assert_allclose(back, body.w, atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_spherical(seed):
    case = Case(seed)
    close(spatial.equation_077(*case.two), case.gap, 0)
    rights = [
        np.zeros(3),
        spatial.equation_080(*case.two),
        spatial.equation_081(*case.two),
        spatial.equation_082(*case.two),
    ]
    for n in range(3):
        positions, rotations = [b[n] for b in spatial.equation_078()], [b[n] for b in spatial.equation_079(*case.two)]
        assert max(defects(case, case.gap[n], positions, rotations, [right[n] for right in rights])) < 2e-13


@pytest.mark.parametrize("seed", SEEDS)
def test_double_spherical_and_distance_driver(seed):
    case = Case(seed)
    squared = joints.dot(case.gap, case.gap)
    rights = [0.0, spatial.equation_086(*case.two), spatial.equation_087(*case.two), spatial.equation_088(*case.two)]
    assert max(defects(case, squared, spatial.equation_084(*case.two), spatial.equation_085(*case.two), rights)) < 2e-13
    assert spatial.equation_083(*case.two, 0.4) == pytest.approx(float(squared.c[0]) - 0.16, rel=1e-13)
    f = series_of(case.f)
    driven, rights = squared - f * f, spatial.equation_107(*case.two, case.f)
    assert spatial.equation_104(*case.two, case.f) == pytest.approx(float(driven.c[0]), abs=1e-13)
    assert max(defects(case, driven, spatial.equation_105(*case.two), spatial.equation_106(*case.two), rights)) < 2e-13


@pytest.mark.parametrize("seed", SEEDS)
def test_dot_1(seed):
    case = Case(seed)
    two = (case.i, case.j, case.a_i, case.a_j)
    constraint = joints.dot(case.a, case.pose_j.direction(case.a_j.tolist()))
    assert spatial.equation_089(*two) == pytest.approx(float(constraint.c[0]), abs=1e-13)
    rights = [0.0, spatial.equation_092(*two), spatial.equation_093(*two), spatial.equation_094(*two)]
    assert max(defects(case, constraint, spatial.equation_090(), spatial.equation_091(*two), rights)) < 5e-13


def dot_2(case):
    """Return the constraint and right-hand sides of dot-2."""
    three = (*case.two, case.a_i)
    rights = [0.0, spatial.equation_098(*three), spatial.equation_099(*three), spatial.equation_100(*three)]
    return three, joints.dot(case.a, case.gap), rights


@pytest.mark.parametrize("seed", SEEDS)
def test_dot_2_and_its_distance_driver(seed):
    case = Case(seed)
    three, constraint, rights = dot_2(case)
    assert spatial.equation_095(*three) == pytest.approx(float(constraint.c[0]), abs=1e-13)
    positions = spatial.equation_096(case.i, case.a_i)
    assert max(defects(case, constraint, positions, spatial.equation_097(*three), rights)) < 5e-13
    length = mp.sqrt(mp.fsum(mpf(float(x)) ** 2 for x in case.a_i))
    driven = constraint / length - series_of(case.f)
    assert spatial.equation_108(*three, case.f) == pytest.approx(float(driven.c[0]), abs=1e-13)
    positions, rights = spatial.equation_109(case.i, case.a_i), spatial.equation_111(*three, case.f)
    assert max(defects(case, driven, positions, spatial.equation_110(*three), rights)) < 5e-13


@pytest.mark.parametrize("seed", SEEDS)
def test_dot_2_as_printed_fails(seed):
    case = Case(seed)
    three, constraint, rights = dot_2(case)
    found = defects(
        case, constraint, spatial.equation_096(case.i, case.a_i), spatial.equation_097_printed(*three), rights
    )
    assert min(found) > 1e-3


@pytest.mark.parametrize("theta", [0.4, -0.4, 2.9, -2.9])
def test_fixed_revolute_rotation_driver(theta):
    rng = np.random.default_rng(7)
    u, f, rates = np.array([2.0, -1.0, 2.0]) / 3, rng.normal(size=5), rng.normal(size=4)
    p = np.array([np.cos(theta / 2), *(np.sin(theta / 2) * u)])
    body, pose = spatial_body(rng, p, np.outer(rates, u))
    scalar, along = pose.p[0], joints.dot(u.tolist(), pose.p[1:])
    constraint = 2 * joints.atan2(along, scalar) - series_of(f)
    expected, (position, rotation) = derivatives(constraint), spatial.equation_102(u)
    assert spatial.equation_101(p, u, f) == pytest.approx(expected[0], abs=1e-14)
    assert spatial.equation_101(p, u, f) == pytest.approx(theta - f[0], abs=1e-14)
    for k, right in enumerate(spatial.equation_103(f), start=1):
        assert position @ body.r[k] + rotation @ body.w[k - 1] - right == pytest.approx(expected[k], abs=1e-12)
    printed = spatial.equation_101_printed(p, u, f)
    assert printed == pytest.approx(abs(theta) - f[0], abs=1e-14)
    assert (abs(printed - expected[0]) > 0.5) == (theta < 0)
