"""Composite joints: how many directions they bind, and which relative motions they leave free, at all orders."""

import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce import jet, planar, spatial
from jounce.jet import Jet
from jounce.testing.samples import BODIES, group_of, pose_of, random_motion
from tests.problems.bank import cases

pytestmark = pytest.mark.long

ORDER = 4
RANKS = {
    "planar": {
        "revolute": 2,
        "double_revolute": 1,
        "parallel1": 1,
        "parallel2": 1,
        "prismatic": 2,
        "fixed": 3,
        "curve": 4,
        "coordinate": 1,
        "gear": 1,
        "rolling": 1,
        "belt": 1,
        "rope": 1,
        "slide": 1,
        "distance": 1,
        "point_on_parabola": 1,
    },
    "spatial": {
        "spherical": 3,
        "double_spherical": 1,
        "dot1": 1,
        "dot2": 1,
        "universal": 4,
        "revolute": 5,
        "cylindrical": 4,
        "prismatic": 5,
        "screw": 5,
        "planar": 3,
        "fixed": 6,
        "constant_velocity": 4,
        "tripod": 3,
        "oldham": 4,
        "rolling": 1,
        "curve": 8,
        "surface": 7,
        "gear": 1,
        "rope": 1,
        "rotation": 1,
        "slide": 1,
        "distance": 1,
    },
}


def test_table_of_ranks_names_the_whole_catalogue():
    for space, ranks in RANKS.items():
        assert {case.kind.type_name for case in cases() if case.space == space} == set(ranks)


@pytest.mark.parametrize("case", cases(), ids=str)
def test_rows_and_rank(case):
    """As many independent rows as the joint removes degrees of freedom (at a state where nothing is special)."""
    random = np.random.default_rng(3)
    group = group_of([case.element(random)], case.space)
    pose = pose_of(random_motion(random, case.space, 0))
    count = 3 if case.space == "planar" else 6
    frozen = Jet.constant(jnp.zeros((1, 1)), 1)
    blocks = group.derivative_blocks(pose, frozen, jnp.ones(count))
    jacobian = np.concatenate([np.array(b)[:, :, 0, 0] for b in blocks]).T
    expected = RANKS[case.space][case.kind.type_name]
    assert jacobian.shape == (expected, count * len(group.bodies))
    assert np.linalg.matrix_rank(jacobian, tol=1e-9) == expected


T = Jet.variable(jnp.asarray(0.0), ORDER)
TURN = 0.4 + 0.7 * T - 0.3 * T**2  # laws of relative motion, in rad and in m
OTHER = -0.3 + 0.5 * T + 0.2 * T**3
TRAVEL = 0.2 - 0.6 * T + 0.4 * T**2
STILL = 0.0 * T
LEAD, LENGTH, RADIUS = 0.35, 0.8, 0.6


def about(axis, angle):
    """Euler parameters, as jets, of a turn about x, y or z."""
    parts = [jet.cos(0.5 * angle), STILL, STILL, STILL]
    parts["xyz".index(axis) + 1] = jet.sin(0.5 * angle)
    return parts


def product(p, q):
    """Quaternion product."""
    return [
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + q[0] * p[1] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] + q[0] * p[2] + p[3] * q[1] - p[1] * q[3],
        p[0] * q[3] + q[0] * p[3] + p[1] * q[2] - p[2] * q[1],
    ]


def matrix(p):
    """Rotation matrix of unit Euler parameters."""
    e = np.asarray(p[1:])
    return np.array([v + 2 * np.cross(e, np.cross(e, v) + p[0] * v) for v in np.eye(3)]).T


def coefficients(jets):
    """Coefficients of a list of jets of numbers, shape (order + 1, components)."""
    return np.array([np.array(x.dense().coefficients) for x in jets]).T


class SpatialCouple:
    """Body i moves at random; body j relative to it, by a shift and a turn in the frame of the joint.

    The joint frame stands at random in both bodies, so that nothing is aligned with a body frame.
    """

    def __init__(self, seed=0):
        random = np.random.default_rng(seed)
        self.p_i, self.p_j = random.normal(size=(2, 3))
        self.q_i, self.q_j = (q / np.linalg.norm(q) for q in random.normal(size=(2, 4)))
        self.C_i, self.C_j = matrix(self.q_i), matrix(self.q_j)
        self.motion = random_motion(random, "spatial", ORDER)

    def residual(self, kind, values, shift, turn):
        i = BODIES.index("one")
        q = [Jet(jnp.asarray(c[k, i, 0]) for c in self.motion["quaternion"]) for k in range(4)]
        q = product(product(product(q, list(self.q_i)), turn), self.back)
        motion = {name: series.copy() for name, series in self.motion.items()}
        motion["quaternion"][:, :, 2, 0] = coefficients(q)
        motion["position"][:, :, 2] = 0
        pose = pose_of(motion)
        body_i, body_j = pose.take((1,)), pose.take((2,))
        local = jet.stack(
            [sum((float(self.C_i[r, c]) * shift[c] for c in range(3)), STILL) + self.p_i[r] for r in range(3)]
        )
        at = body_i.position + jet.matvec(body_i.attitude, local.map(lambda c: c[:, None, None]))
        position = (at - body_j.direction(self.p_j[:, None, None])).dense()
        motion["position"][:, :, 2] = np.array(position.coefficients)[:, :, 0]
        group = group_of([kind(("one", "two"), **values)], "spatial")
        time = Jet.variable(jnp.zeros((1, 1)), ORDER)
        return np.array(group.residual(pose_of(motion), time).dense().coefficients)[:, :, 0, 0]

    @property
    def twist(self):
        """Angle of ``A_i^T A_j`` about the joint axis where the frames of the joint coincide."""
        q = product(self.back, list(self.q_i))
        return 2 * np.arctan2(q[3], q[0])

    @property
    def twist_along_axes(self):
        """The same with the frame of body j turned on by the shortest tilt between the components of the axis."""
        u, v = self.C_i[:, 2], self.C_j[:, 2]
        tilt = np.array([1.0 + u @ v, *np.cross(u, v)])  # takes the components on i to those on j
        q = product(product(list(self.q_i), self.back), list(tilt / np.linalg.norm(tilt)))
        return 2 * np.arctan2(u @ np.array(q[1:]), q[0])

    @property
    def back(self):
        return [self.q_j[0], *(-self.q_j[1:])]

    @property
    def points(self):
        return {"point_i": self.p_i.tolist(), "point_j": self.p_j.tolist()}

    def pair(self, name, first="z", second=None):
        """Values of a joint that are axes of the joint frame, one in each body."""
        columns = ["xyz".index(axis) for axis in (first, second or first)]
        return {
            f"{name}_i": (1.3 * self.C_i[:, columns[0]]).tolist(),
            f"{name}_j": (0.7 * self.C_j[:, columns[1]]).tolist(),
        }


def spatial_joints(c):
    """Per joint: class, values, relative motions that it allows, and some that it must not allow."""
    none, tilt, screwed = [STILL] * 3, about("x", OTHER), LEAD / (2 * np.pi) * TURN
    ball = product(product(about("x", TURN), about("y", OTHER)), about("z", TRAVEL))
    spin, still = about("z", TURN), about("z", STILL)
    up, aside = [STILL, STILL, TRAVEL], [TRAVEL, STILL, STILL]
    far = [LENGTH * jet.cos(TURN), STILL, LENGTH * jet.sin(TURN)]
    return {
        "spherical": (spatial.Spherical, c.points, [(none, ball)], [(aside, ball), (up, still)]),
        "double_spherical": (spatial.DoubleSpherical, c.points | {"length": LENGTH}, [(far, ball)], [(up, ball)]),
        "dot1": (spatial.Dot1, c.pair("vector", "x", "y"), [(aside, spin_of("x", "y"))], [(none, spin)]),
        "dot2": (
            spatial.Dot2,
            c.points | {"vector_i": c.C_i[:, 2].tolist()},
            [([TRAVEL, OTHER, STILL], ball)],
            [(up, ball)],
        ),
        "universal": (
            spatial.Universal,
            c.points | c.pair("vector", "x", "y"),
            [(none, spin_of("x", "y"))],
            [(none, spin), (up, still)],
        ),
        "revolute": (
            spatial.Revolute,
            c.points | c.pair("axis"),
            [(none, spin)],
            [(up, spin), (aside, spin), (none, tilt)],
        ),
        "cylindrical": (
            spatial.Cylindrical,
            c.points | c.pair("axis"),
            [(up, spin), (up, still)],
            [(aside, spin), (none, tilt)],
        ),
        "prismatic": (
            spatial.Prismatic,
            c.points | c.pair("axis") | c.pair("normal", "x"),
            [(up, still)],
            [(none, spin), (aside, still), (none, tilt)],
        ),
        "screw": (
            spatial.Screw,
            c.points | c.pair("axis") | {"lead": LEAD, "offset": -LEAD / (2 * np.pi) * c.twist},
            [([STILL, STILL, screwed], spin)],
            [(up, still), (none, spin), (none, tilt)],
        ),
        "rolling": (
            spatial.Rolling,
            c.points
            | c.pair("axis")
            | {"vector_i": (0.6 * c.C_i[:, 0]).tolist(), "radius": RADIUS, "offset": -RADIUS * c.twist},
            [([RADIUS * TURN, OTHER, TRAVEL], spin)],
            [(aside, still), (none, spin)],
        ),
        "planar": (
            spatial.PlaneOnPlane,
            c.points | c.pair("axis"),
            [([TRAVEL, OTHER, STILL], spin)],
            [(up, spin), (none, tilt)],
        ),
        "fixed": (
            spatial.Fixed,
            c.points | c.pair("axis") | c.pair("normal", "x"),
            [(none, still)],
            [(none, spin), (aside, still), (up, still), (none, tilt)],
        ),
        "constant_velocity": (
            spatial.ConstantVelocity,
            c.points | c.pair("axis") | {"offset": c.twist_along_axes},
            [(none, shortest_tilt())],
            [(none, spin), (aside, still), (up, still)],
        ),
        "tripod": (
            spatial.Tripod,
            c.points | c.pair("axis") | c.pair("normal", "x") | {"radius": RADIUS},
            [(up, still)],
            [(none, spin), (aside, still)],
        ),
        "oldham": (
            spatial.Oldham,
            c.points | c.pair("axis") | c.pair("vector", "x", "y"),
            [([TRAVEL, OTHER, STILL], still)],
            [(none, spin), (up, still), (none, tilt)],
        ),
    }


def shortest_tilt():
    """A turn about an axis across the axis of the joint, which moves too: the balls stay in the plane between."""
    half = 0.5 * OTHER
    return [jet.cos(half), jet.sin(half) * jet.cos(TURN), jet.sin(half) * jet.sin(TURN), STILL]


def spin_of(first, second):
    """A turn about one axis of the frame, then about another as it has been turned."""
    return product(about(first, TURN), about(second, OTHER))


@pytest.mark.parametrize("name", sorted(spatial_joints(SpatialCouple())))
def test_spatial_joint_allows_its_motions_and_no_others(name):
    couple = SpatialCouple()
    kind, values, allowed, forbidden = spatial_joints(couple)[name]
    for shift, turn in allowed:
        np.testing.assert_allclose(couple.residual(kind, values, shift, turn), 0, atol=1e-13)
    for shift, turn in forbidden:
        residual = couple.residual(kind, values, shift, turn)
        assert np.abs(residual[0]).max() > 1e-2
        assert np.abs(residual[1:]).max() > 1e-2


class PlanarCouple:
    """The same in the plane."""

    def __init__(self, seed=0):
        random = np.random.default_rng(seed)
        self.p_i, self.p_j = random.normal(size=(2, 2))
        self.a_i, self.a_j = random.uniform(-2, 2, 2)
        self.motion = random_motion(random, "planar", ORDER)

    def residual(self, kind, values, shift, turn):
        motion = {name: series.copy() for name, series in self.motion.items()}
        relative = coefficients([self.a_i - self.a_j + turn])[:, 0]
        motion["angle"][:, 2, 0] = motion["angle"][:, 1, 0] + relative
        motion["position"][:, :, 2] = 0
        pose = pose_of(motion)
        body_i, body_j = pose.take((1,)), pose.take((2,))
        c, s = np.cos(self.a_i), np.sin(self.a_i)
        x, y = c * shift[0] - s * shift[1] + self.p_i[0], s * shift[0] + c * shift[1] + self.p_i[1]
        local = [w.map(lambda v: v[None, None]) for w in (x, y)]
        seen = jet.stack(
            [body_i.cosine * local[0] - body_i.sine * local[1], body_i.sine * local[0] + body_i.cosine * local[1]]
        )
        position = (body_i.position + seen - body_j.direction(self.p_j[:, None, None])).dense()
        motion["position"][:, :, 2] = np.array(position.coefficients)[:, :, 0]
        group = group_of([kind(("one", "two"), **values)], "planar")
        time = Jet.variable(jnp.zeros((1, 1)), ORDER)
        return np.array(group.residual(pose_of(motion), time).dense().coefficients)[:, :, 0, 0]

    @property
    def points(self):
        return {"point_i": self.p_i.tolist(), "point_j": self.p_j.tolist()}

    def along(self, *names):
        a, b = ([1.4 * np.cos(x), 1.4 * np.sin(x)] for x in (self.a_i, self.a_j))
        return {"vector_i": a, "vector_j": b} if len(names) == 2 else {"vector_i": a}


def planar_joints(c):
    """Per joint: class, values, relative motions that it allows, and some that it must not allow."""
    none, along, across = [STILL, STILL], [TRAVEL, STILL], [STILL, TRAVEL]
    circle, rolled = [LENGTH * jet.cos(OTHER), LENGTH * jet.sin(OTHER)], [RADIUS * TURN, OTHER]
    offset = {"radius": RADIUS, "offset": -RADIUS * (c.a_i - c.a_j)}
    return {
        "revolute": (planar.Revolute, c.points, [(none, TURN)], [(along, TURN), (across, TURN)]),
        "double_revolute": (planar.DoubleRevolute, c.points | {"length": LENGTH}, [(circle, TURN)], [(along, TURN)]),
        "parallel1": (planar.Parallel1, c.along("i", "j"), [([TRAVEL, OTHER], STILL)], [(none, TURN)]),
        "parallel2": (planar.Parallel2, c.points | c.along("i"), [(along, TURN)], [(across, TURN)]),
        "prismatic": (
            planar.Prismatic,
            c.points | c.along("i", "j"),
            [(along, STILL)],
            [(across, STILL), (along, TURN)],
        ),
        "fixed": (
            planar.Fixed,
            c.points | {"offset": c.a_i - c.a_j},
            [(none, STILL)],
            [(along, STILL), (across, STILL), (none, TURN)],
        ),
        "rolling": (planar.Rolling, c.points | c.along("i") | offset, [(rolled, TURN)], [(along, STILL), (none, TURN)]),
    }


@pytest.mark.parametrize("name", sorted(planar_joints(PlanarCouple())))
@pytest.mark.parametrize("seed", [0, 1])
def test_planar_joint_allows_its_motions_and_no_others(name, seed):
    couple = PlanarCouple(seed)
    kind, values, allowed, forbidden = planar_joints(couple)[name]
    for shift, turn in allowed:
        np.testing.assert_allclose(couple.residual(kind, values, shift, turn), 0, atol=1e-13)
    for shift, turn in forbidden:
        residual = couple.residual(kind, values, shift, turn)
        assert np.abs(residual[0]).max() > 1e-2
        assert np.abs(residual[1:]).max() > 1e-2


def test_screw_and_rotation_driver_hold_after_whole_turns():
    """Their last row is known up to whole turns: it vanishes again after each, and nowhere between."""
    couple = SpatialCouple(2)
    kind, values, _, _ = spatial_joints(couple)["screw"]
    for turns in (1, -3, 20):
        angle = TURN + 2 * np.pi * turns
        advance = [STILL, STILL, LEAD / (2 * np.pi) * angle]
        np.testing.assert_allclose(couple.residual(kind, values, advance, about("z", angle)), 0, atol=1e-12)
    rotation = {"axis_i": couple.C_i[:, 2].tolist(), "motion": "0.4 + 0.7*t - 0.3*t**2 + 6*pi"}
    vectors = {"vector_i": couple.C_i[:, 0].tolist(), "vector_j": couple.C_j[:, 0].tolist()}
    found = couple.residual(jn.drivers.RotationDriver, rotation | vectors, [STILL] * 3, about("z", TURN))
    np.testing.assert_allclose(found, 0, atol=1e-13)


class TestConstruction:
    """Wrong words and bodies are refused when the joint is written down."""

    def test_number_of_bodies(self):
        with pytest.raises(jn.errors.MechanismError, match="revolute joins 2 bodies"):
            planar.Revolute(("a", "b", "c"), [0, 0], [0, 0])

    def test_a_body_with_itself(self):
        with pytest.raises(jn.errors.MechanismError, match="not a body with itself"):
            planar.Revolute(("a", "a"), [0, 0], [0, 0])

    def test_gear_needs_its_frame(self):
        with pytest.raises(jn.errors.MechanismError, match="the third body is the frame that carries both"):
            planar.Gear(("a", "b"), -0.5)

    def test_unknown_coordinate(self):
        with pytest.raises(jn.errors.MechanismError, match="angle, x, y"):
            jn.drivers.CoordinateDriver(("a", "b"), "z", "t")

    def test_one_vector_of_two(self):
        with pytest.raises(jn.errors.MechanismError, match="two vectors"):
            jn.drivers.RotationDriver(("a", "b"), [0, 0, 1], "t", vector_i=[1, 0, 0])

    def test_a_joint_without_a_residual_is_abstract(self):
        class Nothing(jn.joints.AbstractConstraint):
            pass

        with pytest.raises(TypeError, match="abstract"):
            Nothing(("a", "b"))
