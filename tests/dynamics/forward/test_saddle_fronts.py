"""The equations of motion eliminated body by body: solutions of the whole matrix, and motions as from dense ones."""

import dataclasses
import itertools

import jax
import numpy as np
import pytest

import jounce as jn
from jounce.dynamics.forward.accelerations import expand, inverted
from jounce.dynamics.forward.initial_state import consistent_start
from jounce.dynamics.forward.saddle_fronts import SaddleFronts
from jounce.execution.compilation import compiled
from jounce.mechanism import build
from tests.problems import dynamics

CLOCK = np.zeros((1, 1))
expanded = compiled("order")(expand)


@compiled()
def factored(equations, state):
    """The matrix, its solutions and its inverse."""
    factor, matrix = equations.factored(state, CLOCK), equations.matrix(state, CLOCK)
    return matrix, factor.solve(np.arange(1.0, len(matrix) + 1)[:, None]), factor.inverse()


def start_in_fronts(name, monkeypatch):
    mechanism = getattr(dynamics, name)()
    monkeypatch.setattr("jounce.dynamics.forward.saddle_fronts.FRONT_COST", 0.0)
    start = consistent_start(mechanism, 0.0)
    assert start.equations.saddle is not None
    return start


@pytest.mark.slow
@pytest.mark.parametrize("name", ["free_four_bar", "gear_pair"])
def test_solutions_and_inverses_are_those_of_the_whole_matrix(name, monkeypatch):
    start = start_in_fronts(name, monkeypatch)
    matrix, solution, inverse = (np.asarray(x) for x in factored(start.equations, start.state))
    matrix, inverse = matrix[..., 0], inverse[..., 0]
    size = np.abs(matrix).sum(axis=1).max()
    right = np.arange(1.0, len(matrix) + 1)[:, None]
    assert np.abs(matrix @ solution - right).max() < 1e-14 * size * np.abs(solution).max()
    assert np.abs(matrix @ inverse - np.eye(len(matrix))).max() < 1e-14 * size * np.abs(inverse).max()


@compiled()
def through_fronts(equations, state, right):
    """The matrix, a solution through fronts, and the largest responses to forces and gaps."""
    inverse = inverted(equations.factored(state, CLOCK))
    responses = inverse.responses(equations.system.shape[1])
    return equations.matrix(state, CLOCK), inverse.solve(right), *responses


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    ["free_four_bar", "gear_pair", pytest.param("spatial_double_pendulum", marks=pytest.mark.slow), "chain", "tree"],
)
def test_products_through_fronts_are_those_with_the_inverse_of_the_whole_matrix(name, monkeypatch):
    """A loop, a pair, chains and a tree; the bounds for responses hold, and are met by the most mobile coordinate."""
    monkeypatch.setattr("jounce.dynamics.forward.saddle_fronts.FRONT_COST", 0.0)
    made = {"chain": lambda: pendulums(7), "tree": branches}
    start = consistent_start(made.get(name, getattr(dynamics, name, None))(), 0.0)
    rows, columns = start.equations.system.shape
    right = np.cos(np.arange(rows + columns))[:, None]
    found = (np.asarray(x)[..., 0] for x in through_fronts(start.equations, start.state, right))
    matrix, solution, forces, gaps = found
    inverse = np.linalg.inv(matrix)
    condition = np.linalg.cond(matrix)
    np.testing.assert_allclose(solution, inverse @ right[:, 0], atol=1e-15 * condition * np.abs(solution).max())
    largest = np.abs(inverse[:columns, :columns]).max(axis=0)
    rounding = 1e-15 * condition * np.abs(inverse).max()
    assert (forces >= largest - rounding).all()
    np.testing.assert_allclose(forces.max(), largest.max(), atol=rounding)
    np.testing.assert_allclose(gaps, np.abs(inverse[columns:, columns:]).max(), atol=rounding)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["free_four_bar", "spatial_double_pendulum"])
def test_expansions_are_those_of_dense_elimination(name, monkeypatch):
    start = start_in_fronts(name, monkeypatch)
    dense = dataclasses.replace(start.equations, saddle=None)
    found, expected = (expanded(e, start.state, CLOCK, order=4) for e in (start.equations, dense))
    for x, y in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        np.testing.assert_allclose(x, y, atol=1e-11 * max(1.0, np.abs(y).max()))


def pendulums(count, length=0.1):
    """A chain of uniform rods, each hanging from the one before, at rest and straight, 60 degrees from the vertical."""
    names = ["ground", *(f"rod{k}" for k in range(count))]
    pairs = list(itertools.pairwise(names))
    inertia = 0.1 * length**2 / 3
    rod = {"angle": -np.pi / 6, "mass": 0.1, "inertia": inertia / 4, "center_of_mass": [length / 2, 0]}
    way = length * np.array([np.cos(np.pi / 6), -np.sin(np.pi / 6)])
    return jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        bodies={name: jn.Body((k * way).tolist(), **rod) for k, name in enumerate(names[1:])},
        joints={f"pin{k}": jn.planar.Revolute(pair, [length * (k > 0), 0], [0, 0]) for k, pair in enumerate(pairs)},
        outputs={"tip": jn.outputs.PointOutput(names[-1], [length, 0])},
    )


def branches():
    """A tree: a rod that carries two others, one of which carries two more."""
    rod = {"mass": 0.3, "inertia": 0.002, "center_of_mass": [0.1, 0.0]}
    carried = {"trunk": "ground", "left": "trunk", "right": "trunk", "twig": "left", "leaf": "left"}
    places = {"trunk": (0.0, 0.0, 1.0), "left": (0.2 * np.cos(1.0), 0.2 * np.sin(1.0), 2.0)}
    places["right"] = (*places["left"][:2], 0.3)
    tip = places["left"][0] + 0.2 * np.cos(2.0), places["left"][1] + 0.2 * np.sin(2.0)
    places |= {"twig": (*tip, 2.5), "leaf": (*tip, 0.9)}
    return jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        bodies={name: jn.Body([x, y], angle, **rod) for name, (x, y, angle) in places.items()},
        joints={
            name: jn.planar.Revolute((base, name), [0.2 * (base != "ground"), 0], [0, 0])
            for name, base in carried.items()
        },
    )


@pytest.mark.slow
def test_a_long_chain_goes_through_fronts_and_balances_its_weight():
    count = 30
    mechanism = pendulums(count)
    start = consistent_start(mechanism, 0.0)
    assert start.equations.saddle.fronts.shape[0] == count
    assert start.mobility.startswith("30 degrees of freedom: ")
    found = np.asarray(expanded(start.equations, start.state, CLOCK, order=2).acceleration)[0, :, :, 0]
    # moments about the first pin: those of weight alone, as all other pins act on two rods
    arms = np.arange(count) * 0.1 + 0.05
    acceleration = found[:2] + found[2] * 0.05 * np.array([[0.5], [np.sqrt(3) / 2]])
    moment = arms * (np.cos(np.pi / 6) * acceleration[1] + np.sin(np.pi / 6) * acceleration[0])
    inertia = 0.1 * 0.1**2 / 12 * found[2]
    weight = -9.81 * np.cos(np.pi / 6) * arms
    np.testing.assert_allclose(np.sum(0.1 * moment + inertia), np.sum(0.1 * weight), rtol=1e-11)


def test_where_a_body_has_many_neighbors_the_matrix_stays_dense():
    count = 40
    spokes = {f"rod{k}": jn.Body([0, 0]) for k in range(count)}
    hub = jn.Mechanism(
        space="planar",
        bodies={"hub": jn.Body([0, 0]), **spokes},
        joints={name: jn.planar.Revolute(("hub", name), [0, 0], [0, 0]) for name in spokes},
    )
    assert SaddleFronts.of(build(hub).system.pattern) is None
