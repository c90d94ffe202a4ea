"""How a run begins and goes on: one program of each kind."""

from functools import partial

import jax
import numpy as np
import pytest

import jounce as jn
from jounce.dynamics.forward.initial_state import consistent_start
from jounce.integrate.marching.marching import RunLimits, march, unexpanded


def test_what_a_run_begins_with_is_compiled_for_once():
    # the types of its arrays are those of what comes out of its steps, to how strict they are
    mass = jn.Mechanism(
        space="planar",
        bodies={"mass": jn.Body([1, 0], mass=1.0, inertia=1.0)},
        joints={},
        forces={"spring": jn.forces.Spring(("ground", "mass"), [0, 0], [0, 0], 3.0, 0.5)},
    )
    start = consistent_start(mass, 0.0)
    equations, state = start.equations, start.state
    begun = jax.eval_shape(lambda: unexpanded(equations, state, np.zeros(1), order=4))
    going = partial(march.function, method=jn.Taylor(4), count=1)
    onwards = jax.eval_shape(going, equations, begun, RunLimits(1.0, 1e-9, np.inf, 0.0))[0]
    assert jax.tree.structure(begun) == jax.tree.structure(onwards)
    kinds = [[(x.shape, x.dtype, x.weak_type) for x in jax.tree.leaves(part)] for part in (begun, onwards)]
    assert kinds[0] == kinds[1]


@pytest.mark.slow
@pytest.mark.parametrize("order", [4, 5])
def test_series_of_the_lowest_orders_find_the_way_too(order):
    spring = jn.Mechanism(
        space="planar",
        bodies={"mass": jn.Body([1, 0], mass=2.0, inertia=1.0)},
        joints={"rail": jn.planar.Prismatic(("ground", "mass"), [0, 0], [0, 0], [1, 0], [1, 0])},
        forces={"spring": jn.forces.Spring(("ground", "mass"), [-1, 0], [0, 0], 8.0, 1.5)},
        outputs={"x": jn.outputs.PointOutput("mass", [0, 0])},
    )
    found = jn.simulate(spring, [0.0, 0.7], order=2, method=jn.Taylor(order), tolerance=1e-10)
    expected = 0.5 + 0.5 * np.cos(2.0 * 0.7)  # x'' = -4 (x - 0.5) from rest at 1
    np.testing.assert_allclose(found.outputs["x"][-1, 0, 0], expected, atol=1e-7)
