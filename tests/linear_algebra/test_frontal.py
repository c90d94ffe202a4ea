"""Elimination body by body: against NumPy on random patterns, and as the factorization of mechanisms."""

import functools
import itertools
from collections import OrderedDict

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce.linear_algebra.frontal import FrontalFactor
from jounce.linear_algebra.fronts import Fronts
from jounce.linear_algebra.pattern import Pattern
from jounce.mechanism import build
from jounce.mechanism.building import builder
from tests.problems.small import four_bar

LANES = 5


def random_pattern(random, count, width, redundant=0):
    """Bodies of each row, or `count`: a tree of joints of width - 1 rows, and a row from each body to any other."""
    joints = [((k - 1 - int(random.integers(0, min(k, 3))), k) if k else (0, count), width - 1) for k in range(count)]
    joints += [((k, int(random.integers(0, count))), 1) for k in range(count)]
    joints += [((int(random.integers(0, count)), int(random.integers(0, count))), 1) for _ in range(redundant)]
    bodies = np.array([(i, j if j != i else count) for (i, j), rows in joints for _ in range(rows)])
    return bodies[random.permutation(len(bodies))]


def dense(bodies, places, entries, count):
    rows, _, width = places.shape
    matrix = np.zeros((rows, count, width, entries.shape[-1]))
    for row, slot in itertools.product(range(rows), range(2)):
        if bodies[row, slot] < count:
            matrix[row, bodies[row, slot]] = entries[places[row, slot]]
    return np.moveaxis(matrix.reshape(rows, count * width, -1), -1, 0)


SQUARE = [(1, 3, 0), (2, 3, 0), (6, 3, 0), (5, 6, 0)]  # bodies, columns of each, more rows than columns
REDUNDANT = [(9, 3, 4), (4, 6, 7)]


@pytest.fixture(params=SQUARE + REDUNDANT, ids=str)
def case(request):
    return drawn(*request.param)


@pytest.fixture(params=SQUARE, ids=str)
def square(request):
    return drawn(*request.param)


@functools.cache
def drawn(count, width, redundant):
    """A random matrix, right-hand sides, and the solutions of both systems by its factors, in one program."""
    random = np.random.default_rng(count + width)
    bodies = random_pattern(random, count, width, redundant)
    places = random.permutation(bodies.size * width).reshape(*bodies.shape, width)
    entries = random.standard_normal((places.size, LANES))
    fronts = Fronts.of(Pattern(bodies, places, count, places.size))
    matrix, scale = dense(bodies, places, entries, count), random.uniform(0.5, 2.0, (len(bodies), 1))

    @jax.jit
    def found(entries, scale, right, transposed):
        factor = FrontalFactor.of(fronts, entries, scale)
        return factor.solve(right), factor.solve_transposed(transposed), factor.sign()

    right, transposed = (random.standard_normal((size, LANES)) for size in matrix.shape[1:])
    return scale * matrix, right, transposed, [np.asarray(x) for x in found(entries, scale, right, transposed)]


def bound(matrix):
    return 1e-14 * np.linalg.cond(matrix).max() ** 2  # of least squares; of square matrices the first power would do


def test_solutions_are_those_of_least_squares(case):
    matrix, right, _, (found, _, _) = case
    expected = np.stack([np.linalg.lstsq(a, b, rcond=None)[0] for a, b in zip(matrix, right.T, strict=True)], axis=-1)
    np.testing.assert_allclose(found, expected, atol=bound(matrix) * np.abs(expected).max())


def test_residuals_of_square_systems_are_rounding(square):
    matrix, right, _, (found, _, _) = square
    residual = np.einsum("bij,jb->ib", matrix, found) - right
    assert np.abs(residual).max() < 1e-14 * np.abs(matrix).sum(axis=2).max() * np.abs(found).max()


def test_transposed_systems_have_the_solution_of_least_norm(case):
    matrix, _, right, (_, found, _) = case
    expected = np.stack([np.linalg.lstsq(a.T, b, rcond=None)[0] for a, b in zip(matrix, right.T, strict=True)], axis=-1)
    np.testing.assert_allclose(found, expected, atol=bound(matrix) * np.abs(expected).max())


def test_transposed_systems_of_many_bodies_sort_nothing():
    """Machine code sorts few numbers only; of more, XLA would compute the whole balance of forces."""
    bodies = random_pattern(np.random.default_rng(0), 20, 3)
    places = np.arange(bodies.size * 3).reshape(*bodies.shape, 3)
    fronts = Fronts.of(Pattern(bodies, places, 20, places.size))

    def solved(entries, right):
        return FrontalFactor.of(fronts, entries, np.ones((len(bodies), 1))).solve_transposed(right)

    program = str(jax.make_jaxpr(solved)(np.ones((places.size, 1)), np.ones((60, 1))))
    assert "scan[" in program
    assert " sort[" not in program


def test_signs_are_those_of_the_determinants_or_all_turned_round(square):
    matrix, _, _, (_, _, sign) = square
    product = sign * np.linalg.slogdet(matrix)[0]
    assert np.abs(product.sum()) == LANES


def test_what_is_singular_is_reported():
    bodies, places = np.array([[0, 1]] * 3), np.stack([np.arange(9).reshape(3, 3), np.full((3, 3), 9)], axis=1)
    singular, regular = np.array([[1.0, 2, 3], [2, 4, 6], [1, 1, 1]]), np.eye(3)
    entries = jnp.asarray(np.stack([singular.ravel(), regular.ravel()], axis=-1))
    factor = FrontalFactor.of(Fronts.of(Pattern(bodies, places, 1, 9)), entries, jnp.ones((3, 1)))
    ratio = np.asarray(factor.pivot_ratio())
    assert ratio[0] < 1e-15
    np.testing.assert_allclose(ratio[1], 1.0)


def chain(links, law="0.4*sin(t)"):
    """An open chain of links of 0.1 m, each driven by one law relative to the one before."""
    names = ["ground", *(f"link{k}" for k in range(links))]
    pairs = list(itertools.pairwise(names))
    return jn.Mechanism(
        space="planar",
        bodies={name: jn.Body([0.1 * k, 0.0]) for k, name in enumerate(names[1:])},
        joints={f"pin{k}": jn.planar.Revolute(pair, [0.1 * (k > 0), 0], [0, 0]) for k, pair in enumerate(pairs)},
        drivers={f"turn{k}": jn.drivers.CoordinateDriver(pair, "angle", law) for k, pair in enumerate(pairs)},
        outputs={"tip": jn.outputs.PointOutput(names[-1], [0.1, 0])},
    )


@pytest.mark.slow
def test_a_long_chain_is_eliminated_by_bodies_and_moves_in_closed_form():
    links, time = 40, np.linspace(0, 3, 7)
    mechanism = chain(links)
    assert build(mechanism).system.fronts.shape == (links, 4, 6)  # from its free end, a pin and a driver at a time
    found = jn.solve(mechanism, time, order=2).outputs["tip"]
    angle, rate, second = 0.4 * np.sin(time), 0.4 * np.cos(time), -0.4 * np.sin(time)
    k = np.arange(1, links + 1)[:, None]
    link = 0.1 * np.exp(1j * k * angle)
    truth = [link, 1j * k * rate * link, (1j * k * second - (k * rate) ** 2) * link]
    for derivative, terms in enumerate(truth):
        tip = terms.sum(axis=0)
        size = np.abs(terms).sum(axis=0).max()
        np.testing.assert_allclose(found[:, derivative], np.stack([tip.real, tip.imag], axis=-1), atol=1e-13 * size)


@pytest.fixture(params=[0.0, np.inf])
def cost(request, monkeypatch):
    """Set the cost of fronts by which the elimination is chosen; choices made before, and with it, are forgotten."""
    monkeypatch.setattr("jounce.linear_algebra.fronts.FRONT_COST", request.param)
    monkeypatch.setattr("jounce.mechanism.building.contents._results", OrderedDict())
    builder._layout.cache_clear()
    yield request.param
    builder._layout.cache_clear()


@pytest.mark.slow
def test_a_dead_point_is_reported_whichever_way_the_jacobian_is_eliminated(cost):
    rocker = four_bar("60*deg", "150*deg", "60*deg + t", AD=0.2, AB=0.2, BC=0.15, CD=0.1)
    assert (build(rocker).system.fronts is None) == bool(cost)
    motion = jn.solve(rocker, np.linspace(0, 2, 21), order=1, strict=False)
    # B and D are as far apart as BC and CD together reach, where the crank has this angle
    end = np.arccos((0.2**2 + 0.2**2 - 0.25**2) / (2 * 0.2 * 0.2)) - np.pi / 3
    reached = np.linspace(0, 2, 21) < end
    np.testing.assert_array_equal(motion.status == 0, reached)
