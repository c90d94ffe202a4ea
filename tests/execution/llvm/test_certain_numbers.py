"""Which numbers of a program are certain, whatever those are that are not known."""

import jax
import jax.numpy as jnp
import numpy as np

from jounce.base.jax_internals import by_certain_entries
from jounce.execution.llvm.certain_numbers import certain_numbers

NAN = np.nan


def certain(function, *given):
    return certain_numbers(jax.make_jaxpr(function)(*given), given)


def test_what_follows_from_known_numbers_is_certain():
    (found,) = certain(lambda x: jnp.concatenate([x + 1.0, x[:1] * 3.0]), np.array([2.0, NAN]))
    np.testing.assert_array_equal(found, [3.0, NAN, 6.0])


def test_zero_times_what_is_not_known_is_certain_only_where_it_is_an_entry():
    def products(x):
        plain = x * jnp.array([0.0, 0.0])
        with by_certain_entries():
            return plain, x * jnp.array([0.0, 1.0])

    plain, marked = certain(products, np.array([NAN, NAN]))
    np.testing.assert_array_equal(plain, [NAN, NAN])
    np.testing.assert_array_equal(marked, [0.0, NAN])


def test_the_bodies_of_loops_and_of_functions_have_the_mark_of_what_calls_them():
    @jax.jit
    def twice(x, y):
        return jax.lax.fori_loop(0, 2, lambda _, z: z * y, x)

    def function(x):
        with by_certain_entries():
            return twice(jnp.zeros(2), x)

    (found,) = certain(function, np.array([NAN, NAN]))
    np.testing.assert_array_equal(found, [0.0, 0.0])


def test_a_form_is_an_array_of_which_nothing_is_known():
    form = jax.ShapeDtypeStruct((2,), np.int64)
    program = jax.make_jaxpr(lambda n, x: (n.astype(float), x))(form, np.ones(1))
    unknown, known = certain_numbers(program, (form, np.ones(1)))
    np.testing.assert_array_equal(unknown, [NAN, NAN])
    np.testing.assert_array_equal(known, [1.0])
