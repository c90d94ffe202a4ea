"""Laws that every joint and driver of the catalogue keeps, and a user's own one too."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce import jet
from jounce.jet import Jet
from jounce.rigid import PlanarPose, SpatialPose
from tests.problems.bank import BODIES, Case, cases, group_of, pose_of, random_motion

CASES = cases()
ORDER = 6
INSTANT = 0.3


@pytest.fixture
def random(request):
    return np.random.default_rng(len(request.node.name))


@pytest.fixture(params=CASES, ids=str)
def case(request) -> Case:
    return request.param


def time_jet(order, batch=1):
    return Jet.variable(jnp.full((1, batch), INSTANT), order)


def residual(group, motion, time=None):
    """Coefficients of the residual on the motion given by coefficients, shape (order + 1, rows, instances, batch)."""
    order = len(motion["position"]) - 1
    time = time_jet(order, motion["position"].shape[-1]) if time is None else time
    return np.array(group.residual(pose_of(motion), time).dense().coefficients)


def coordinates(space):
    return 3 if space == "planar" else 6


def repeated(motion, batch):
    """The motion at order zero, the same in every lane of a batch."""
    return {name: np.repeat(series[:1], batch, axis=-1) for name, series in motion.items()}


def with_unknowns(motion, unknowns):
    """Pose that starts as the motion does, with x[k] = (r[k], phi[k]) or (r[k], w'[k-1] / k) given.

    The unknowns have the shape (order + 1, c, bodies, batch); those of order zero are not used.
    """
    start, shifts = repeated(motion, unknowns.shape[-1]), motion["position"].shape[1]
    position = Jet(map(jnp.asarray, [start["position"][0], *unknowns[1:, :shifts]]))
    if "angle" in motion:
        angle = Jet(map(jnp.asarray, [start["angle"][0], *unknowns[1:, 2]]))
        return PlanarPose.from_jets(position, angle)
    rate = Jet(jnp.asarray(k * x) for k, x in enumerate(unknowns[:, shifts:]) if k)
    quaternion = Jet([jnp.asarray(start["quaternion"][0])])
    return SpatialPose.from_coordinates({"position": position, "quaternion": quaternion, "angular_velocity": rate})


def evaluate(group, pose, time):
    return np.array(group.residual(pose, time).dense().coefficients)


def directions(space):
    """Every coordinate of every moving body in turn, along a batch: shape (c, bodies, batch)."""
    c, moving = coordinates(space), len(BODIES) - 1
    each = np.eye(c * moving).reshape(moving, c, moving * c)
    return np.concatenate([np.zeros((c, 1, moving * c)), np.swapaxes(each, 0, 1)], axis=1)


def displaced(motion, steps):
    """Coefficients of order zero with coordinates changed: shifts, turns about body axes, (c, bodies, batch)."""
    moved = repeated(motion, steps.shape[-1])
    shifts = moved["position"].shape[1]
    moved["position"][0] += steps[:shifts]
    if "angle" in moved:
        moved["angle"][0] += steps[2]
    else:
        angle = np.linalg.norm(steps[3:], axis=0)
        half = np.concatenate([np.cos(angle / 2)[None], steps[3:] * (0.5 * np.sinc(angle / 2 / np.pi))])
        moved["quaternion"][0] = quaternion_product(moved["quaternion"][0], half)
    return moved


def quaternion_product(p, q):
    v = p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:], axis=0)
    return np.concatenate([(p[0] * q[0] - (p[1:] * q[1:]).sum(axis=0))[None], v])


def test_coefficients_are_affine_in_the_unknown_with_the_jacobian_as_slope(case, random):
    """For each order k: the k-th coefficient with the unknown x[k], less that with zero, is the Jacobian times x[k].

    The Jacobian, read off at order one, is that of central differences, and the one that the solver takes in blocks.
    Everything is evaluated side by side: two lanes for each order, then one for each column of the Jacobian.
    """
    group = group_of([case.element(random)], case.space)
    motion, unit = random_motion(random, case.space, 0), directions(case.space)
    unknowns = random.uniform(-1, 1, (ORDER + 1, *unit.shape[:2], 1))
    unknowns[:, :, 0] = 0  # the ground
    lanes = np.repeat(unknowns, 2 * ORDER + unit.shape[-1], axis=-1)
    for k in range(1, ORDER + 1):
        lanes[k, ..., 2 * k - 1] = 0
    lanes[1:, ..., 2 * ORDER :] = 0
    lanes[1, ..., 2 * ORDER :] = unit
    running = jnp.asarray(np.arange(lanes.shape[-1]) < 2 * ORDER, float)[None]
    time = Jet((jnp.full_like(running, INSTANT), running, *[None] * (ORDER - 1)))
    found = evaluate(group, with_unknowns(motion, lanes), time)

    jacobian = found[1, ..., 2 * ORDER :]
    for k in range(1, ORDER + 1):
        change = found[k, ..., 2 * k - 2] - found[k, ..., 2 * k - 1]
        x = np.swapaxes(unknowns[k, :, 1:, 0], 0, 1).reshape(-1)
        np.testing.assert_allclose(change, jacobian @ x, atol=1e-12)

    step = 1e-4
    still = Jet([jnp.full((1, 4 * unit.shape[-1]), INSTANT)])
    moved = displaced(motion, np.concatenate([s * step * unit for s in (2, 1, -1, -2)], axis=-1))
    far, near, behind, far_behind = np.split(residual(group, moved, still)[0], 4, axis=-1)
    np.testing.assert_allclose(jacobian, (-far + 8 * near - 8 * behind + far_behind) / (12 * step), atol=1e-9)
    assert np.abs(jacobian).max() > 0.1
    np.testing.assert_allclose(jacobian_of_blocks(group, motion), jacobian, atol=1e-14)


def jacobian_of_blocks(group, motion):
    """The Jacobian that the solver takes: block by block for the bodies in each slot."""
    pose = pose_of({name: series[:1] for name, series in motion.items()})
    frozen = Jet.constant(jnp.full((1, 1), INSTANT), 1)
    count = coordinates("planar" if "angle" in motion else "spatial")
    blocks = [np.array(block)[..., 0] for block in group.derivative_blocks(pose, frozen, jnp.ones(count))]
    whole = np.zeros((*blocks[0].shape[1:], (len(BODIES) - 1) * count))
    for slot, block in zip(group.moving_slots, blocks, strict=True):
        first = (group.bodies[slot][0] - 1) * count
        whole[..., first : first + count] = np.moveaxis(block, 0, -1)
    return whole


def test_derivatives_along_a_motion_are_those_of_the_residual_as_a_function_of_time(case, random):
    """The residual at order zero on instants around, through which a Chebyshev polynomial is put, judges its jets."""
    group = group_of([case.element(random)], case.space)
    motion = random_motion(random, case.space, 4, degree=3)
    nodes, reach = np.cos(np.pi * (np.arange(40) + 0.5) / 40), 0.5
    steps = reach * nodes
    around = {name: sum(c * steps**k for k, c in enumerate(series))[None] for name, series in motion.items()}
    around["position"][..., 0, :] = 0
    values = residual(group, around, Jet([jnp.asarray(INSTANT + steps)[None]]))[0]
    jets = residual(group, motion)[..., 0]
    period = period_of(case, group.element)
    if period:  # the last row is known up to whole periods
        values[-1] = np.unwrap(values[-1], period=period)
        values[-1] += period * np.round((jets[0, -1] - values[-1, :, [20]]) / period)
    for index in np.ndindex(values.shape[:-1]):
        polynomial = np.polynomial.chebyshev.Chebyshev.fit(steps, values[index], 39, domain=[-reach, reach])
        for k in range(1, 5):
            value = polynomial.deriv(k)(0.0) / np.prod(range(1, k + 1))
            assert jets[(k, *index)] == pytest.approx(value, abs=1e-8 * 10**k)


def period_of(case, element):
    """Period of the last row of a residual that is known up to whole turns, or None."""
    if case.kind.type_name == "rotation":
        return 2 * np.pi
    return float(np.squeeze(element.lead)) if case.kind.type_name == "screw" else None


def moved_together(motion, random, order):
    """The motion as seen after a common rigid motion of all bodies, itself a random function of time."""
    turned = {name: series.copy() for name, series in motion.items()}
    common = random_motion(random, "planar" if "angle" in motion else "spatial", order)
    common = {name: series[..., 1:2, :] for name, series in common.items()}
    if "angle" in motion:
        frame = PlanarPose.from_jets(*(Jet(map(jnp.asarray, common[k])) for k in ("position", "angle")))
        local = Jet(map(jnp.asarray, motion["position"]))
        turned["position"] = np.array(frame.point(local).dense().coefficients)
        turned["angle"] = motion["angle"] + common["angle"]
        return turned
    frame = pose_of(common)
    turned["position"] = np.array(frame.point(Jet(map(jnp.asarray, motion["position"]))).dense().coefficients)
    a, b = ([Jet(jnp.asarray(level[k]) for level in s["quaternion"]) for k in range(4)] for s in (common, motion))
    product = jet.stack(
        [
            a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
            a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
            a[0] * b[2] + a[2] * b[0] + a[3] * b[1] - a[1] * b[3],
            a[0] * b[3] + a[3] * b[0] + a[1] * b[2] - a[2] * b[1],
        ]
    )
    turned["quaternion"] = np.array(product.dense().coefficients)
    return turned


RELATIVE = [case for case in CASES if case.word not in ("x", "y")]  # those are coordinates in the global frame


@pytest.mark.parametrize("case", RELATIVE, ids=str)
def test_common_motion_of_all_bodies_changes_nothing(case, random):
    """A joint between moving bodies knows their relative motion only; vectors of residuals turn with the bodies."""
    element = case.element(random)
    if case.kind.type_name == "coordinate" and case.optional:
        element = case.element(random, values={"ratio": 1.0})
    group = group_of([element], case.space)
    motion = random_motion(random, case.space, 2)
    here, there = residual(group, motion), residual(group, moved_together(motion, random, 2))
    period = period_of(case, element)
    if period:
        np.testing.assert_allclose(here[1:], there[1:], rtol=0, atol=1e-11)
        turns = (here[0] - there[0]) / period
        np.testing.assert_allclose(turns, np.round(turns), atol=1e-12)
    elif here.shape[1] == 1:
        np.testing.assert_allclose(here, there, rtol=0, atol=1e-12)
    else:
        np.testing.assert_allclose(square(here), square(there), rtol=0, atol=1e-11)


def square(rows):
    """Coefficients of the sum of squares of the rows."""
    return np.array([sum((rows[j] * rows[k - j]).sum(axis=0) for j in range(k + 1)) for k in range(len(rows))])


def test_instances_evaluated_together_are_those_evaluated_alone(case, random):
    count = case.kind.body_count
    places = [BODIES[1 : 1 + count], BODIES[4 - count + 1 : 5][::-1], (*BODIES[: count - 1], BODIES[4])]
    elements = [case.element(random, bodies) for bodies in places]
    motion = random_motion(random, case.space, 1, batch=2)
    together = residual(group_of(elements, case.space), motion)
    for k, element in enumerate(elements):
        alone = residual(group_of([element], case.space), motion)
        np.testing.assert_allclose(together[:, :, k], alone[:, :, 0], rtol=1e-15, atol=1e-15)


def test_values_as_expressions_of_parameters_are_the_numbers(case, random):
    plain = case.element(random)
    parameters, replaced = {"unit": 1.0, "law": 0.9}, {}
    for name in (field for field in vars(plain) if field not in ("bodies", "coordinate")):
        value = getattr(plain, name)
        if isinstance(value, float):
            parameters[name] = value / 2
            replaced[name] = f"2*{name}"
        elif isinstance(value, list):
            replaced[name] = [jn.Expression(f"unit*{entry!r}") for entry in value]
        elif isinstance(value, str) and "t" in value:
            replaced[name] = value.replace("0.9", "law")
    assert replaced
    motion = random_motion(random, case.space, 1)
    written = case.kind(plain.bodies, **{k: v for k, v in vars(plain).items() if k != "bodies"} | replaced)
    np.testing.assert_allclose(
        residual(group_of([written], case.space, parameters), motion),
        residual(group_of([plain], case.space), motion),
        rtol=0,
        atol=1e-15,
    )


def test_other_values_compile_nothing_again(case, random):
    calls = []

    @jax.jit
    def evaluated(group, position, time):
        calls.append(None)
        return group.residual(position, time).dense().coefficients

    motion = pose_of(random_motion(random, case.space, 1))
    results = [evaluated(group_of([case.element(random)], case.space), motion, time_jet(1)) for _ in range(2)]
    assert len(calls) == 1
    assert not np.allclose(results[0][0], results[1][0])
