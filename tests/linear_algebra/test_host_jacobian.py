"""The Jacobian on the host, sparse if large, against the singular values of the dense matrix."""

import itertools

import numpy as np
import pytest

import jounce as jn
from jounce.linear_algebra import host_jacobian
from jounce.linear_algebra.host_jacobian import RANK_TOLERANCE, HostJacobian, is_clearly_regular
from tests.linear_algebra.test_frontal import chain

BODIES, WIDTH = 20, 3


def drawn(rows, redundant=0, loose=0, seed=0):
    """Rows on two bodies each, some repeated, and some bodies whose rotation affects no row."""
    random = np.random.default_rng(seed)
    first = np.arange(rows) % BODIES
    bodies = np.stack([first, (first + 1 + random.integers(0, 3, rows)) % BODIES], axis=1)
    blocks = random.standard_normal((rows, 2, WIDTH))
    blocks[..., 2] = np.where(bodies < loose, 0.0, blocks[..., 2])
    twice = np.arange(redundant) * 5
    bodies, blocks = np.concatenate([bodies, bodies[twice]]), np.concatenate([blocks, -2 * blocks[twice]])
    return HostJacobian(bodies, blocks, BODIES)


CASES = [(60,), (52,), (60, 0, 2), (60, 3), (60, 4, 2), (40, 2, 1), (63, 2)]


@pytest.fixture(params=CASES, ids=str)
def jacobian(request, monkeypatch):
    monkeypatch.setattr(host_jacobian, "MOST_DENSE", 10)
    return drawn(*request.param)


def projector(vectors):
    return vectors @ vectors.T


def test_rank_and_null_vectors_are_those_of_the_singular_values(jacobian):
    left, sizes, right = np.linalg.svd(jacobian.dense())
    rank = int(np.sum(sizes > RANK_TOLERANCE * sizes[0]))
    assert jacobian.rank == rank
    np.testing.assert_allclose(projector(jacobian.dependences), projector(left[:, rank:]), atol=1e-8)
    np.testing.assert_allclose(projector(jacobian.free_directions.T), projector(right[rank:].T), atol=1e-8)


def test_steps_are_the_shortest_that_close_what_can_be_closed(jacobian):
    matrix = jacobian.scaled(jacobian.row_scale).dense()
    gap = matrix @ np.random.default_rng(1).standard_normal(matrix.shape[1])
    expected = -np.linalg.pinv(matrix, rcond=1e-10) @ gap
    step = jacobian.step(gap / jacobian.row_scale)
    np.testing.assert_allclose(step, expected, atol=1e-4 * np.abs(expected).max())  # damped where rows are redundant


def test_what_is_not_finite_has_no_step(jacobian):
    assert jacobian.step(np.full(jacobian.shape[0], np.nan)) is None


def test_without_rows_everything_is_free(monkeypatch):
    monkeypatch.setattr(host_jacobian, "MOST_DENSE", 10)
    jacobian = drawn(60).take(np.zeros(60, bool))
    assert jacobian.rank == 0
    np.testing.assert_allclose(projector(jacobian.free_directions.T), np.eye(60), atol=1e-12)


@pytest.mark.parametrize("size", [3, 6, 18])
@pytest.mark.parametrize("smallest", [1.0, 1e-4, 1e-5, 2e-6, 0.5e-6, 1e-8, 2e-9, 0.5e-9, 0.0])
def test_small_singular_values_are_counted_beside_every_tolerance(size, smallest):
    rng, values = np.random.default_rng(size), np.ones(size)
    values[-1] = smallest
    left, right = (np.linalg.qr(rng.standard_normal((size, size)))[0] for _ in range(2))
    blocks = (left * values @ right).reshape(size, size // 3, 3)
    jacobian = HostJacobian(np.tile(np.arange(size // 3), (size, 1)), blocks, size // 3)
    assert jacobian.rank == size - (smallest <= RANK_TOLERANCE)
    assert len(jacobian.smallest[1]) == (smallest <= host_jacobian.SMALL)


def test_only_what_is_large_and_regular_is_called_so():
    size = 2 * host_jacobian.MOST_DENSE
    assert is_clearly_regular(np.eye(size), 1e-12)
    assert not is_clearly_regular(np.diag([*np.ones(size - 1), 0.0]), 1e-12)
    assert not is_clearly_regular(np.diag([*np.ones(size - 1), 1e-13]), 1e-12)
    assert is_clearly_regular(np.eye(3), 1e-12)
    for size in (0.0, 1e-13, np.nan):
        assert not is_clearly_regular(np.diag([1.0, 1.0, size]), 1e-12)


def test_degrees_of_freedom_of_a_long_chain_are_reported_by_body():
    whole = chain(40)
    drivers = {name: driver for name, driver in whole.drivers.items() if name != "turn39"}
    one_free = jn.Mechanism(space="planar", bodies=whole.bodies, joints=whole.joints, drivers=drivers)
    with pytest.raises(jn.errors.MobilityError, match=r"119 equations, 119 of them .* link39"):
        jn.solve(one_free, [0.0])


def test_redundant_joints_of_a_long_chain_are_reported_by_name():
    whole = chain(40)
    again = jn.planar.Revolute(("link19", "link20"), [0.1, 0], [0, 0])
    drivers = {name: driver for name, driver in whole.drivers.items() if name != "turn39"}
    redundant = jn.Mechanism(
        space="planar", bodies=whole.bodies, joints={**whole.joints, "again": again}, drivers=drivers
    )
    message = r"121 equations, 119 of .* with which link39 can .*; joint again repeats 2 equations of pin20"
    with pytest.raises(jn.errors.MobilityError, match=message):
        jn.solve(redundant, [0.0])


def test_a_long_chain_that_cannot_close_is_reported_by_joint():
    whole = chain(40)
    points = [jn.Body([0.1 * k, 0.0]) for k in range(40)]
    far = jn.planar.DoubleRevolute(("ground", "link39"), [0, 0], [0.1, 0], 5.0)
    drivers = dict(itertools.islice(whole.drivers.items(), 39))
    bodies = dict(zip(whole.bodies, points, strict=True))
    mechanism = jn.Mechanism(space="planar", bodies=bodies, joints={**whole.joints, "far": far}, drivers=drivers)
    with pytest.raises(jn.errors.AssemblyError, match=r"joints\.far"):
        jn.solve(mechanism, [0.0])
