"""The planar oracles, equation by equation, against thirty-digit series of the constraints along random motions."""

import numpy as np
import pytest
from mpmath import mp

from tests.oracles import mp_joints as joints, sommer_planar as planar
from tests.oracles.random_motion import derivatives, planar_body, series_of

SEEDS = range(5)


@pytest.fixture(autouse=True)
def digits():
    with mp.workdps(30):
        yield


class Case:
    """Two or three random bodies with points, vectors and a driver."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        (self.i, self.pose_i), (self.j, self.pose_j), (self.m, self.pose_m) = (planar_body(rng) for _ in range(3))
        self.s_i, self.s_j, self.a_i, self.a_j = rng.normal(size=(4, 2))
        self.f, self.radius, self.ratio, self.offset = rng.normal(size=5), *rng.normal(size=3)
        self.two = (self.i, self.j, self.s_i, self.s_j)

    @property
    def gap(self):
        return joints.gap(self.pose_i, self.pose_j, [self.s_i.tolist(), self.s_j.tolist()])

    def side(self, vector, pose):
        return pose.direction(vector.tolist())


def assert_rows(case, constraint, blocks, bodies, rights, first=1):
    """Check Phi_q q^(k) - rhs = d^k Phi / dt^k for the orders that `rights` holds, one body per block of Phi_q."""
    expected = derivatives(constraint)
    for k, right in enumerate(rights, start=first):
        left = sum(block @ np.append(body.r[k], body.phi[k]) for block, body in zip(blocks, bodies, strict=True))
        scale = 1 + abs(left) + abs(right)
        assert abs(left - right - expected[k]) < 2e-13 * scale, f"order {k}"


@pytest.mark.parametrize("seed", SEEDS)
def test_points_and_relative_vectors(seed):
    case = Case(seed)
    point = np.array([derivatives(x) for x in case.pose_i.point(case.s_i.tolist())]).T
    for k, equation in enumerate(
        (planar.equation_010, planar.equation_011, planar.equation_012, planar.equation_013, planar.equation_014)
    ):
        np.testing.assert_allclose(equation(case.i, case.s_i), point[k], rtol=0, atol=1e-13 * (1 + abs(point[k]).max()))
    gap = np.array([derivatives(x) for x in case.gap]).T
    for k, equation in enumerate((planar.equation_015, planar.equation_016, planar.equation_017, planar.equation_018)):
        np.testing.assert_allclose(equation(*case.two), gap[k], rtol=0, atol=1e-13 * (1 + abs(gap[k]).max()))
    a = [float(x.c[0]) for x in case.side(planar.equation_020(case.s_j, case.s_i), case.pose_i)]
    np.testing.assert_allclose(planar.equation_019(case.i, case.s_j - case.s_i), a, atol=1e-14)


def test_attitude_matrices():
    A, R, B = planar.equation_009(0.3)
    h = 1e-6
    slope = (planar.equation_009(0.3 + h)[0] - planar.equation_009(0.3 - h)[0]) / (2 * h)
    np.testing.assert_allclose(slope, B, atol=1e-9)
    np.testing.assert_allclose(R @ R, -np.eye(2))
    np.testing.assert_allclose(A @ A.T, np.eye(2), atol=1e-15)


@pytest.mark.parametrize("seed", SEEDS)
def test_revolute(seed):
    case = Case(seed)
    gap = case.gap
    rights = [
        np.zeros(2),
        planar.equation_023(*case.two),
        planar.equation_024(*case.two),
        planar.equation_025(*case.two),
    ]
    np.testing.assert_allclose(planar.equation_021(*case.two), [float(x.c[0]) for x in gap], atol=1e-14)
    for n in range(2):
        blocks = [block[n] for block in planar.equation_022(*case.two)]
        assert_rows(case, gap[n], blocks, (case.i, case.j), [right[n] for right in rights])


@pytest.mark.parametrize("seed", SEEDS)
def test_double_revolute_and_distance_driver(seed):
    case = Case(seed)
    d, bodies = case.gap, (case.i, case.j)
    squared, blocks = joints.dot(d, d), planar.equation_027(*case.two)
    rights = [0.0, planar.equation_028(*case.two), planar.equation_029(*case.two), planar.equation_030(*case.two)]
    assert_rows(case, squared, blocks, bodies, rights)
    assert planar.equation_026(*case.two, 0.4) == pytest.approx(float(squared.c[0]) - 0.16, rel=1e-13)
    f = series_of(case.f)
    driven = squared - f * f
    assert planar.equation_053(*case.two, case.f) == pytest.approx(float(driven.c[0]), abs=1e-13)
    assert_rows(case, driven, planar.equation_054(*case.two), bodies, planar.equation_055(*case.two, case.f))


@pytest.mark.parametrize("seed", SEEDS)
def test_parallel_1(seed):
    case = Case(seed)
    two, bodies = (case.i, case.j, case.a_i, case.a_j), (case.i, case.j)
    constraint = joints.cross(case.side(case.a_i, case.pose_i), case.side(case.a_j, case.pose_j))
    assert planar.equation_031(*two) == pytest.approx(float(constraint.c[0]), abs=1e-14)
    rights = [0.0, *planar.equation_033_anywhere(*two)]
    assert_rows(case, constraint, planar.equation_032(*two), bodies, rights)


def test_parallel_1_right_sides_vanish_only_on_the_constraint():
    case = Case(1)
    angle = np.arctan2(*case.a_i[::-1]) - np.arctan2(*case.a_j[::-1]) + case.i.phi[0]
    parallel = planar.Body(case.j.r, np.array([angle, *case.i.phi[1:]]))
    on = planar.equation_033_anywhere(case.i, parallel, case.a_i, case.a_j)
    np.testing.assert_allclose(on, planar.equation_033(), atol=1e-13)
    assert max(abs(x) for x in planar.equation_033_anywhere(case.i, case.j, case.a_i, case.a_j)) > 0.1


@pytest.mark.parametrize("seed", SEEDS)
def test_parallel_2(seed):
    case = Case(seed)
    constraint = joints.cross(case.side(case.a_i, case.pose_i), case.gap)
    three = (*case.two, case.a_i)
    assert planar.equation_034(*three) == pytest.approx(float(constraint.c[0]), abs=1e-13)
    rights = [0.0, planar.equation_036(*three), planar.equation_037(*three), planar.equation_038(*three)]
    assert_rows(case, constraint, planar.equation_035(*three), (case.i, case.j), rights)


@pytest.mark.parametrize("seed", SEEDS)
def test_relative_coordinate_and_gears(seed):
    case = Case(seed)
    angles = [series_of(body.phi) for body in (case.i, case.j, case.m)]
    constraint = angles[1] - case.ratio * angles[0] - case.offset - series_of(case.f)
    value = planar.equation_039(case.i, case.j, case.ratio, case.offset, case.f)
    assert value == pytest.approx(float(constraint.c[0]), abs=1e-14)
    blocks = [np.array([0, 0, -case.ratio]), np.array([0, 0, 1])]
    assert_rows(case, constraint, blocks, (case.i, case.j), planar.equation_040(case.f))
    geared = (angles[1] - angles[2]) - case.ratio * (angles[0] - angles[2]) - case.offset
    value = planar.equation_041(case.i, case.j, case.m, case.ratio, case.offset)
    assert value == pytest.approx(float(geared.c[0]), abs=1e-14)
    assert_rows(case, geared, planar.equation_042(case.ratio), (case.i, case.j, case.m), planar.equation_043())


@pytest.mark.parametrize("seed", SEEDS)
def test_parallel_2_distance_driver(seed):
    case = Case(seed)
    length = mp.sqrt(joints.dot(*[[mp.mpf(float(x)) for x in case.a_i]] * 2))
    constraint = joints.dot(case.side(case.a_i, case.pose_i), case.gap) / length - series_of(case.f)
    four = (*case.two, case.a_i, case.f)
    assert planar.equation_044(*four) == pytest.approx(float(constraint.c[0]), abs=1e-13)
    rights = [
        planar.equation_046(case.f),
        planar.equation_047(*four),
        planar.equation_048(*four),
        planar.equation_049(*four),
    ]
    assert_rows(case, constraint, planar.equation_045(*four[:-1]), (case.i, case.j), rights)


def rolling(case):
    """Return the series of the rolling constraint."""
    length = mp.sqrt(joints.dot(*[[mp.mpf(float(x)) for x in case.a_i]] * 2))
    travel = joints.dot(case.side(case.a_i, case.pose_i), case.gap) / length
    return travel - case.radius * (series_of(case.j.phi) - series_of(case.i.phi)) - case.offset


@pytest.mark.parametrize("seed", SEEDS)
def test_rolling(seed):
    case = Case(seed)
    three, constraint = (*case.two, case.a_i), rolling(case)
    value = planar.equation_050(*three, case.radius, case.offset)
    assert value == pytest.approx(float(constraint.c[0]), abs=1e-13)
    assert_rows(
        case, constraint, planar.equation_051(*three, case.radius), (case.i, case.j), planar.equation_052(*three)
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_rolling_as_printed_fails(seed):
    case = Case(seed)
    three, constraint = (*case.two, case.a_i), rolling(case)
    printed = planar.equation_051_printed(*three, case.radius)
    with pytest.raises(AssertionError, match="order 1"):
        assert_rows(case, constraint, printed, (case.i, case.j), planar.equation_052(*three))
    right = planar.equation_051(*three, case.radius)
    wrong_by = case.radius / np.linalg.norm(case.a_i) - case.radius
    np.testing.assert_allclose(printed[0] - right[0], [0, 0, wrong_by], atol=1e-14)
    unit = case.a_i / np.linalg.norm(case.a_i)
    np.testing.assert_allclose(
        planar.equation_051_printed(*case.two, unit, case.radius),
        planar.equation_051(*case.two, unit, case.radius),
        atol=1e-14,
    )


def test_driver_of_equation_56():
    t, tau = 0.37, 2.0
    time = series_of([t, 1, 0, 0, 0])
    wave = joints.sin(time * (2 * mp.pi / tau)) * 1.1 + 0.5
    np.testing.assert_allclose(planar.equation_056(t, 0.5, 1.1, tau), derivatives(wave), rtol=1e-13)


@pytest.mark.parametrize("equation, order, points", [(planar.equation_057, 2, 3), (planar.equation_058, 4, 5)])
def test_finite_differences_converge(equation, order, points):
    def error(h):
        u = np.sin(0.7 + h * (np.arange(points) - points // 2))
        first, second = equation(u, h)
        return np.array([abs(first - np.cos(0.7)), abs(second + np.sin(0.7))])

    coarse, fine = error(0.1), error(0.05)
    np.testing.assert_allclose(np.log2(coarse / fine), order, atol=0.1)


def test_finite_difference_as_printed_fails():
    h = 1e-3
    u = np.sin(0.7 + h * (np.arange(5) - 2))
    first, _ = planar.equation_058_printed(u, h)
    assert abs(planar.equation_058(u, h)[0] - np.cos(0.7)) < 1e-10
    assert abs(first - np.cos(0.7)) > 100
