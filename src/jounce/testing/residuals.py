"""Contracts of residuals: derivatives by coordinates and time, frames, instances, expressions, compilation."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jounce.constraints.facts import field_kinds
from jounce.jet import Jet
from jounce.mechanism.system import Group
from jounce.testing.samples import (
    BODIES,
    INSTANT,
    Motion,
    coordinates_of,
    directions,
    displaced,
    group_of,
    lanes_of,
    pose_of,
    random_motion,
    seen_from_moving_frame,
    time_jet,
    widened,
    with_unknowns,
)
from jounce.testing.subject import Broken, SkippedContract, Subject, evaluated, residual
from jounce.trajectory import Expression

NODES = 40  # nodes of an interpolating polynomial
REACHES = (0.5, 0.25, 0.125)  # s, half widths of the interval around an instant


def jacobian(subject: Subject) -> None:
    """Check that coefficients are affine in the unknown, with the Jacobian as slope.

    For each order k, the k-th coefficient with the unknown x[k] minus that with zero is the Jacobian times x[k]. The
    Jacobian from order one agrees with central differences and with the Jacobian of the solver, in blocks. One
    evaluation covers all cases: two lanes for each order, then one lane for each column of the Jacobian.
    """
    random, order = subject.random(), subject.order
    group = group_of([subject.samples.element(random)], subject.space)
    motion, unit = random_motion(random, subject.space, 0), directions(subject.space)
    unknowns = random.uniform(-1, 1, (order + 1, *unit.shape[:2], 1))
    unknowns[:, :, 0] = 0  # the ground
    lanes = np.repeat(unknowns, 2 * order + unit.shape[-1], axis=-1)
    for k in range(1, order + 1):
        lanes[k, ..., 2 * k - 1] = 0
    lanes[1:, ..., 2 * order :] = 0
    lanes[1, ..., 2 * order :] = unit
    count = lanes.shape[-1]
    lanes = widened(lanes, lanes_of(subject.space))
    running = jnp.asarray(np.arange(lanes.shape[-1]) < 2 * order, float)[None]
    time = Jet((jnp.full_like(running, INSTANT), running, *[None] * (order - 1)))
    derivative = evaluated(group, with_unknowns(motion, lanes), time)[..., :count]

    slopes = derivative[1, ..., 2 * order :]
    for k in range(1, order + 1):
        change = derivative[k, ..., 2 * k - 2] - derivative[k, ..., 2 * k - 1]
        x = np.swapaxes(unknowns[k, :, 1:, 0], 0, 1).reshape(-1)
        message = f"coefficient {k} of the residual is not its Jacobian by the coordinates times theirs of that order"
        subject.same(change, slopes @ x, 1e-12, message)

    step = 1e-4
    times = np.full(4 * unit.shape[-1], INSTANT)
    displaced_motion = displaced(motion, np.concatenate([s * step * unit for s in (2, 1, -1, -2)], axis=-1))
    far, near, behind, far_behind = np.split(residual(group, displaced_motion, times)[0], 4, axis=-1)
    differences = (-far + 8 * near - 8 * behind + far_behind) / (12 * step)
    subject.same(slopes, differences, 1e-9, "the Jacobian is not that of differences of the residual")
    if np.abs(slopes).max() <= 1e-9:
        raise Broken("the residual does not depend on the poses of its bodies")
    subject.same(jacobian_of_blocks(group, motion), slopes, 1e-14, "the Jacobian is not that in blocks")


def jacobian_of_blocks(group: Group, motion: Motion) -> np.ndarray:
    """Return the Jacobian of the solver: block by block for the bodies in each slot."""
    pose = pose_of({name: series[:1] for name, series in motion.items()})
    frozen = Jet.constant(jnp.full((1, 1), INSTANT), 1)
    count = coordinates_of("planar" if "angle" in motion else "spatial")
    blocks = [np.array(block)[..., 0] for block in group.derivative_blocks(pose, frozen, jnp.ones(count))]
    matrix = np.zeros((*blocks[0].shape[1:], (len(BODIES) - 1) * count))
    for slot, block in zip(group.moving_slots, blocks, strict=True):
        column = (group.bodies[slot][0] - 1) * count
        matrix[..., column : column + count] = np.moveaxis(block, 0, -1)
    return matrix


def derivatives(subject: Subject) -> None:
    """Check that derivatives along a motion are those of the residual as a function of time.

    A Chebyshev polynomial through the residual of order zero at neighboring instants is the reference for the jets.
    """
    random = subject.random()
    group = group_of([subject.samples.element(random)], subject.space)
    motion = random_motion(random, subject.space, 4, degree=3)
    jets = residual(group, motion)[..., 0]
    for reach in REACHES:
        steps, values = _around(subject, group, motion, jets, reach)
        fits = [
            np.polynomial.chebyshev.Chebyshev.fit(steps, row, NODES - 1, domain=[-reach, reach])
            for row in values.reshape(-1, NODES)
        ]
        sizes = [np.abs(fit.coef) for fit in fits]
        if all(size[-NODES // 4 :].max() <= 1e-13 * max(size.max(), subject.scale) for size in sizes):
            break
    else:
        raise Broken(
            "the residual is not smooth along a random motion, as with abs, floor or a step: no polynomial follows "
            "it; write it without them, or give `values` with which it is smooth"
        )
    for k in range(1, 5):
        exact = [fit.deriv(k)(0.0) / np.prod(range(1, k + 1)) for fit in fits]
        message = (
            f"derivative {k} along a motion is not that of the residual as a function of time; compute it from the "
            "jets of bodies and time alone"
        )
        subject.same(jets[k].reshape(-1), exact, 1e-8 * 10**k, message)


def _around(subject: Subject, group: Group, motion: Motion, jets: Any, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Return neighboring instants relative to the instant, and their residuals, shape (rows, instances, instants)."""
    steps = reach * np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)
    powers = steps ** np.arange(len(motion["position"]))[:, None]
    moved = {
        name: (series * powers.reshape(-1, *[1] * (series.ndim - 2), NODES)).sum(axis=0)[None]
        for name, series in motion.items()
    }
    moved["position"][..., 0, :] = 0
    values = residual(group, moved, INSTANT + steps)[0]
    if period := subject.period_of(group):
        values[-1] = np.unwrap(values[-1], period=period)
        values[-1] += period * np.round((jets[0, -1] - values[-1, :, [NODES // 2]]) / period)
    return steps, values


def frames(subject: Subject) -> None:
    """Check that a common motion of all bodies does not change the residual.

    A joint between moving bodies depends on their relative motion only; vectors of residuals turn with the bodies.
    """
    if not subject.relative:
        raise SkippedContract("it is said to depend on the global frame")
    random = subject.random()
    group = group_of([subject.samples.element(random)], subject.space)
    motion = random_motion(random, subject.space, 2)
    seen = seen_from_moving_frame(motion, random, 2)
    if subject.samples.kind.hidden:  # its coordinates, those of the last body, are not a position in space
        for name, series in seen.items():
            series[..., -1, :] = motion[name][..., -1, :]
    before, after = residual(group, motion), residual(group, seen)
    message = (
        "the residual changes where all bodies are moved together; take components along directions of a body, not of "
        "the global frame, or state relative=False where that is meant"
    )
    if period := subject.period_of(group):
        subject.same(before[1:], after[1:], 1e-11, message)
        turns = (before[0] - after[0]) / period
        subject.same(turns, np.round(turns), 1e-12, message)
    elif before.shape[1] == 1:
        subject.same(before, after, 1e-12, message)
    else:
        subject.same(_square(before), _square(after), 1e-11, message)


def _square(rows: np.ndarray) -> np.ndarray:
    """Return coefficients of the sum of squares of the rows."""
    return np.array([sum((rows[j] * rows[k - j]).sum(axis=0) for j in range(k + 1)) for k in range(len(rows))])


def instances(subject: Subject) -> None:
    """Check that joints evaluated together have the same residuals as each joint by itself."""
    random, samples = subject.random(), subject.samples
    count = samples.count
    slots = [BODIES[1 : 1 + count], BODIES[4 - count + 1 : 5][::-1], (*BODIES[: count - 1], BODIES[4])]
    elements = [samples.element(random, bodies) for bodies in slots]
    motion = random_motion(random, subject.space, 1, batch=2)
    group_residual = residual(group_of(elements, subject.space), motion)
    for k, element in enumerate(elements):
        single = residual(group_of([element], subject.space), motion)
        bound = 1e-15 * (1.0 + np.abs(single[:, :, 0]))
        message = "the residual of a joint among others is not that of the joint by itself"
        subject.same(group_residual[:, :, k] / bound, single[:, :, 0] / bound, 1.0, message)


def expressions(subject: Subject) -> None:
    """Check that values from expressions of parameters equal the numbers."""
    random = subject.random()
    element = subject.samples.element(random)
    parameters, replaced = {"unit": 1.0, "law": 0.9}, {}
    for name, kind in field_kinds(type(element)).items():
        value = getattr(element, name)
        if kind == "scalar" and isinstance(value, float):
            parameters[name] = value / 2
            replaced[name] = f"2*{name}"
        elif kind == "vector" and value is not None:
            replaced[name] = [Expression(f"unit*{float(entry)!r}") for entry in value]
        elif kind == "points" and value is not None:
            replaced[name] = [[Expression(f"unit*{float(entry)!r}") for entry in point] for point in value]
        elif kind == "motion" and isinstance(value, str):
            replaced[name] = value.replace("0.9", "law")
    if not replaced:
        raise SkippedContract("it has no numbers")
    motion = random_motion(random, subject.space, 1)
    expressed = subject.samples.element(subject.random(), values={**_values(element), **replaced})
    values = residual(group_of([expressed], subject.space, parameters), motion)
    expected = residual(group_of([element], subject.space), motion)
    subject.same(values, expected, 1e-15, "values given as expressions of parameters are not the numbers")


def _values(element: Any) -> dict[str, Any]:
    return {name: getattr(element, name) for name in field_kinds(type(element))}


def one_program(subject: Subject) -> None:
    """Check that other values need no further compilation."""
    random, calls = subject.random(), []

    @jax.jit
    def run(group: Any, pose: Any, time: Any) -> Any:
        calls.append(None)
        return group.residual(pose, time).dense().coefficients

    pose = pose_of(random_motion(random, subject.space, 1))
    elements = [subject.samples.element(random) for _ in range(2)]
    first, second = (run(group_of([element], subject.space), pose, time_jet(1)) for element in elements)
    if len(calls) > 1:
        raise Broken(
            "the residual is compiled anew for other values: it turns them into numbers of Python, or decides by them; "
            "use operators and functions of jounce.jet instead"
        )
    numbers = [kind in ("scalar", "vector", "points") for kind in field_kinds(subject.samples.kind).values()]
    if any(numbers) and not subject.samples.given and np.array_equal(first[0], second[0]):
        raise Broken("the residual does not depend on the values of its fields")
