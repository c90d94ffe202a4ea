"""Programs of users' functions are equal where the functions do the same with the same arguments."""

import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce.jet.programs.captured import captured_function

TIME = jnp.zeros(())


@pytest.mark.parametrize("others", [(jnp.zeros(2),), (jnp.zeros(2), jnp.zeros(3))])
def test_arguments_that_a_function_does_not_read_are_arguments(others):
    functions = {"alone": lambda t: 2.75 * t, "among": lambda t, *_: 2.75 * t, "last": lambda *x: 2.75 * x[-1]}
    examples = {"alone": (TIME,), "among": (TIME, *others), "last": (*others, TIME)}
    read = {name: captured_function(function, *examples[name]) for name, function in functions.items()}
    assert len({its.program for its in read.values()}) == 3
    for name, its in read.items():
        arguments = [jnp.full(x.shape, 2.0) for x in examples[name]]
        np.testing.assert_array_equal(its.program(its.captured, *arguments)[0], 5.5)


def test_a_law_follows_a_feedback_that_reads_time_alone():
    captured_function(lambda t, q, rate: t * t - 4.0 * t, TIME, jnp.zeros(2), jnp.zeros(2))
    law = jn.laws.FunctionMotion(lambda t: t * t - 4.0 * t)
    assert [float(x) for x in law(jn.Jet.variable(3.0, 2)).derivatives()] == [-3.0, 2.0, 2.0]
