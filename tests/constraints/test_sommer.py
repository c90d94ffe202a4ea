"""Residual, Jacobian and right sides (nu, gamma, eta, sigma) read off jets equal the closed forms of S, one by one.

States are random: not on the constraints, and moving in every coordinate, so that no term can hide.
"""

import numpy as np
import pytest

import jounce as jn
from tests.oracles import sommer_planar as planar, sommer_spatial as spatial
from tests.problems.states import LAW, Reading, attitude, planar_state, spatial_state

SEEDS = pytest.mark.parametrize("seed", range(2))
ROUNDING = 3e-13


def check(reading, residual, blocks, rights):
    """Compare a reading with closed forms: blocks are one (rows, columns) array for each body."""
    np.testing.assert_allclose(reading.residual, np.atleast_1d(residual), rtol=0, atol=1e-14)
    for found, expected in zip(reading.jacobian, blocks, strict=True):
        np.testing.assert_allclose(found, np.atleast_2d(expected), rtol=0, atol=1e-14)
    rights = np.stack([np.broadcast_to(right, reading.residual.shape) for right in rights])
    scale = 1 + np.abs(rights).max()
    np.testing.assert_allclose(reading.rights, rights, rtol=0, atol=ROUNDING * scale)


class Planar:
    """Random bodies, points, vectors and values in the plane."""

    def __init__(self, seed):
        random = np.random.default_rng(seed)
        self.i, self.j, self.m = (planar_state(random) for _ in range(3))
        self.s_i, self.s_j, self.a_i, self.a_j = random.normal(size=(4, 2))
        self.f, (self.radius, self.ratio, self.offset) = random.normal(size=5), random.uniform(0.5, 2, 3)
        self.two = (self.i, self.j, self.s_i, self.s_j)

    def read(self, kind, *values, bodies="ij", **named):
        states = [getattr(self, name) for name in bodies]
        f = self.f if "motion" in kind.__dataclass_fields__ else None
        values = [v.tolist() if isinstance(v, np.ndarray) else v for v in values]
        return Reading(lambda names: kind(names, *values, **named), states, f)


class Spatial(Planar):
    """Random bodies, points, vectors and values in space."""

    def __init__(self, seed):
        random = np.random.default_rng(seed)
        self.state_i, self.state_j = spatial_state(random), spatial_state(random)
        self.i, self.j = self.state_i[0], self.state_j[0]
        self.s_i, self.s_j, self.a_i, self.a_j = random.normal(size=(4, 3))
        self.f, self.length = random.normal(size=5), random.uniform(0.5, 2)
        self.two = (self.i, self.j, self.s_i, self.s_j)

    def read(self, kind, *values, **named):
        f = self.f if "motion" in kind.__dataclass_fields__ else None
        values = [v.tolist() if isinstance(v, np.ndarray) else v for v in values]
        return Reading(lambda names: kind(names, *values, **named), [self.state_i, self.state_j], f)


def joined(positions, rotations):
    """Put the parts of a spatial Jacobian, for r and for pi, together: one block for each body."""
    return [np.hstack([np.atleast_2d(p), np.atleast_2d(q)]) for p, q in zip(positions, rotations, strict=True)]


@SEEDS
def test_equations_021_to_025_revolute(seed):
    case = Planar(seed)
    check(
        case.read(jn.planar.Revolute, case.s_i, case.s_j),
        planar.equation_021(*case.two),
        planar.equation_022(*case.two),
        [0, planar.equation_023(*case.two), planar.equation_024(*case.two), planar.equation_025(*case.two)],
    )


@SEEDS
def test_equations_026_to_030_double_revolute(seed):
    case = Planar(seed)
    check(
        case.read(jn.planar.DoubleRevolute, case.s_i, case.s_j, case.radius),
        planar.equation_026(*case.two, case.radius),
        planar.equation_027(*case.two),
        [0, planar.equation_028(*case.two), planar.equation_029(*case.two), planar.equation_030(*case.two)],
    )


@SEEDS
def test_equations_031_to_033_parallel_1(seed):
    case = Planar(seed)
    reading = case.read(jn.planar.Parallel1, case.a_i, case.a_j)
    vectors = (case.i, case.j, case.a_i, case.a_j)
    rights = [0, *planar.equation_033_anywhere(*vectors)]
    check(reading, planar.equation_031(*vectors), planar.equation_032(*vectors), rights)


@SEEDS
def test_equation_033_parallel_1_on_the_constraint(seed):
    case = Planar(seed)
    case.j = case.i._replace(r=case.j.r)  # the same angle at all orders
    reading = case.read(jn.planar.Parallel1, case.a_i, 2 * case.a_i)
    np.testing.assert_allclose(reading.residual, 0, atol=1e-14)
    np.testing.assert_allclose(reading.rights[1:, 0], planar.equation_033(), atol=1e-12)


@SEEDS
def test_equations_034_to_038_parallel_2(seed):
    case = Planar(seed)
    given = (*case.two, case.a_i)
    check(
        case.read(jn.planar.Parallel2, case.s_i, case.s_j, case.a_i),
        planar.equation_034(*given),
        planar.equation_035(*given),
        [0, planar.equation_036(*given), planar.equation_037(*given), planar.equation_038(*given)],
    )


@SEEDS
def test_equations_031_to_038_prismatic(seed):
    case = Planar(seed)
    vectors, given = (case.i, case.j, case.a_i, case.a_j), (*case.two, case.a_i)
    check(
        case.read(jn.planar.Prismatic, case.s_i, case.s_j, case.a_i, case.a_j),
        [planar.equation_031(*vectors), planar.equation_034(*given)],
        [np.array(rows) for rows in zip(planar.equation_032(*vectors), planar.equation_035(*given), strict=True)],
        [
            0,
            *(
                np.array(pair)
                for pair in zip(
                    planar.equation_033_anywhere(*vectors),
                    [planar.equation_036(*given), planar.equation_037(*given), planar.equation_038(*given)],
                    strict=True,
                )
            ),
        ],
    )


@SEEDS
@pytest.mark.parametrize("coordinate", ["angle", "x", "y"])
def test_equations_039_to_040_coordinate_driver(seed, coordinate):
    """All uses: of an angle relative (K = 1), by a gear (K = -rho_i / rho_j), and rolling along x or y (K = radius)."""
    case = Planar(seed)
    column = ("x", "y", "angle").index(coordinate)
    driven = case.j.phi if coordinate == "angle" else case.j.r[:, column]
    for ratio in (1.0, -case.ratio, 0.0):
        reading = case.read(jn.drivers.CoordinateDriver, coordinate, LAW, ratio, case.offset)
        stand_in = case.j._replace(phi=driven)
        residual = planar.equation_039(case.i, stand_in, ratio, case.offset, case.f)
        check(reading, residual, [[0, 0, -ratio], np.eye(3)[column]], planar.equation_040(case.f))


@SEEDS
def test_equations_039_to_040_coordinate_joint(seed):
    case = Planar(seed)
    reading = case.read(jn.planar.Coordinate, "angle", case.ratio, case.offset)
    residual = planar.equation_039(case.i, case.j, case.ratio, case.offset, np.zeros(5))
    check(reading, residual, [[0, 0, -case.ratio], [0, 0, 1]], planar.equation_040(np.zeros(5)))


@SEEDS
def test_equations_041_to_043_gear_on_a_frame(seed):
    case = Planar(seed)
    check(
        case.read(jn.planar.Gear, case.ratio, case.offset, bodies="ijm"),
        planar.equation_041(case.i, case.j, case.m, case.ratio, case.offset),
        planar.equation_042(case.ratio),
        planar.equation_043(),
    )


@SEEDS
def test_equations_044_to_049_slide_driver(seed):
    case = Planar(seed)
    given = (*case.two, case.a_i)
    check(
        case.read(jn.drivers.SlideDriver, case.s_i, case.s_j, case.a_i, LAW),
        planar.equation_044(*given, case.f),
        planar.equation_045(*given),
        [
            planar.equation_046(case.f),
            *(e(*given, case.f) for e in (planar.equation_047, planar.equation_048, planar.equation_049)),
        ],
    )


@SEEDS
def test_equations_050_to_052_rolling(seed):
    case = Planar(seed)
    given = (*case.two, case.a_i)
    reading = case.read(jn.planar.Rolling, case.s_i, case.s_j, case.a_i, case.radius, case.offset)
    residual = planar.equation_050(*given, case.radius, case.offset)
    check(reading, residual, planar.equation_051(*given, case.radius), planar.equation_052(*given))
    wrong = planar.equation_051_printed(*given, case.radius)
    assert np.abs(reading.jacobian[1] - wrong[1]).max() > 1e-3  # as printed, the radius is divided by L


@SEEDS
def test_equations_053_to_055_distance_driver(seed):
    case = Planar(seed)
    check(
        case.read(jn.drivers.DistanceDriver, case.s_i, case.s_j, LAW),
        planar.equation_053(*case.two, case.f),
        planar.equation_054(*case.two),
        planar.equation_055(*case.two, case.f),
    )


@SEEDS
def test_equations_077_to_082_spherical(seed):
    case = Spatial(seed)
    check(
        case.read(jn.spatial.Spherical, case.s_i, case.s_j),
        spatial.equation_077(*case.two),
        joined(spatial.equation_078(), spatial.equation_079(*case.two)),
        [0, spatial.equation_080(*case.two), spatial.equation_081(*case.two), spatial.equation_082(*case.two)],
    )


@SEEDS
def test_equations_083_to_088_double_spherical(seed):
    case = Spatial(seed)
    check(
        case.read(jn.spatial.DoubleSpherical, case.s_i, case.s_j, case.length),
        spatial.equation_083(*case.two, case.length),
        joined(spatial.equation_084(*case.two), spatial.equation_085(*case.two)),
        [0, spatial.equation_086(*case.two), spatial.equation_087(*case.two), spatial.equation_088(*case.two)],
    )


@SEEDS
def test_equations_089_to_094_dot_1(seed):
    case = Spatial(seed)
    given = (case.i, case.j, case.a_i, case.a_j)
    check(
        case.read(jn.spatial.Dot1, case.a_i, case.a_j),
        spatial.equation_089(*given),
        joined(spatial.equation_090(), spatial.equation_091(*given)),
        [0, spatial.equation_092(*given), spatial.equation_093(*given), spatial.equation_094(*given)],
    )


@SEEDS
def test_equations_095_to_100_dot_2(seed):
    case = Spatial(seed)
    given = (*case.two, case.a_i)
    reading = case.read(jn.spatial.Dot2, case.s_i, case.s_j, case.a_i)
    check(
        reading,
        spatial.equation_095(*given),
        joined(spatial.equation_096(case.i, case.a_i), spatial.equation_097(*given)),
        [0, spatial.equation_098(*given), spatial.equation_099(*given), spatial.equation_100(*given)],
    )
    wrong = spatial.equation_097_printed(*given)
    assert np.abs(reading.jacobian[1][0, 3:] - wrong[1]).max() > 1e-3  # as printed, with a minus


@SEEDS
@pytest.mark.parametrize("half_turns", [0.3, -0.7, 1.4, 1.9])
def test_equations_101_to_103_rotation_driver(seed, half_turns):
    """Body j turns about an axis that it shares with body i, which stands anywhere; the angle may have either sign."""
    random = np.random.default_rng(seed)
    u, f = random.normal(size=3), random.normal(size=5)
    u /= np.linalg.norm(u)
    angle = half_turns * np.pi
    p = np.array([np.cos(angle / 2), *(np.sin(angle / 2) * u)])
    turning = np.outer(random.normal(size=4), u)
    state_i = spatial_state(random, p=random.normal(size=4), w=np.zeros((4, 3)))
    base = state_i[1]
    product = np.array(
        [base[0] * p[0] - base[1:] @ p[1:], *(base[0] * p[1:] + p[0] * base[1:] + np.cross(base[1:], p[1:]))]
    )
    state_j = spatial_state(random, p=product, w=turning)
    np.testing.assert_allclose(state_i[0].A.T @ state_j[0].A, attitude(p), atol=1e-14)
    for axis in (u, 3 * u):
        reading = Reading(
            lambda names, a=axis: jn.drivers.RotationDriver(names, a.tolist(), LAW), [state_i, state_j], f
        )
        residual = spatial.equation_101(p, u, f)
        residual -= 2 * np.pi * np.round(residual / (2 * np.pi))
        block = np.concatenate(spatial.equation_102(u))
        check(reading, residual, [-block, block], spatial.equation_103(f))
    printed = spatial.equation_101_printed(p, u, f)
    lost = abs(np.sin((printed - residual) / 2)) > 1e-3
    assert lost == (np.sin(angle / 2) < 0)  # as printed, the sign of the angle is lost


@SEEDS
def test_equations_104_to_107_spatial_distance_driver(seed):
    case = Spatial(seed)
    check(
        case.read(jn.drivers.SpatialDistanceDriver, case.s_i, case.s_j, LAW),
        spatial.equation_104(*case.two, case.f),
        joined(spatial.equation_105(*case.two), spatial.equation_106(*case.two)),
        spatial.equation_107(*case.two, case.f),
    )


@SEEDS
def test_equations_108_to_111_spatial_slide_driver(seed):
    case = Spatial(seed)
    given = (*case.two, case.a_i)
    check(
        case.read(jn.drivers.SpatialSlideDriver, case.s_i, case.s_j, case.a_i, LAW),
        spatial.equation_108(*given, case.f),
        joined(spatial.equation_109(case.i, case.a_i), spatial.equation_110(*given)),
        spatial.equation_111(*given, case.f),
    )
