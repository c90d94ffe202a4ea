"""Functions that JAX cannot trace are refused by name; without traced values, they run within jax.jit."""

import pathlib

import jax
import numpy as np
import pytest

import jounce as jn

FOUR_BAR = jn.load(pathlib.Path(__file__).resolve().parents[3] / "examples" / "four_bar.yaml")
TIME = [0.0, 0.1]


def pendulum(length):
    return jn.Mechanism(
        space="planar",
        bodies={"rod": jn.Body([0, 0], mass=1.0, inertia=0.1, center_of_mass=[length, 0.0])},
        joints={"O": jn.planar.Revolute(("ground", "rod"), [0, 0], [0, 0])},
        outputs={"angle": jn.outputs.AngleOutput("rod")},
        parameters={"tilt": 0.1},
    )


def solved(mechanism, time=TIME, **options):
    return jn.solve(mechanism, time, **{"order": 1, **options}).outputs["psi"][-1, 1]


CASES = {
    "time[1]": lambda x: solved(FOUR_BAR, [0.0, x]),
    "tolerance": lambda x: solved(FOUR_BAR, tolerance=x),
    "parameters.tilt": lambda x: jn.simulate_batch(pendulum(1.0), {"tilt": x}, TIME).outputs["angle"][0, -1, 0],
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("transformed", [jax.grad, jax.jit, lambda f: lambda x: jax.vmap(f)(np.array([x]))])
def test_traced_values_are_refused_by_name(name, transformed):
    with pytest.raises(jn.errors.UnsupportedError) as caught:
        transformed(CASES[name])(0.14)
    assert caught.value.name == name
    assert "jax.grad" in str(caught.value)


@pytest.mark.slow
def test_values_that_are_not_traced_give_constants_within_jit():
    within = jax.jit(lambda x: x * solved(FOUR_BAR))(2.0)
    assert float(within) == pytest.approx(2 * solved(FOUR_BAR), rel=1e-15)
