"""How a program is written: what it calls in its place, and when each variable is read for the last time."""

import jax
import jax.numpy as jnp
import numpy as np

from jounce.execution.llvm.plans import CALLS, plan_of
from jounce.execution.llvm.rules.loops import DEFERRED, READING

TABLE = np.arange(4.0)[:, None]


@jax.jit
def scaled(x):
    return jnp.where(x > 0.0, x * TABLE, -x)


def plan(function, *given):
    return plan_of(jax.make_jaxpr(function)(*given).jaxpr, DEFERRED, READING)


def test_programs_that_are_called_twice_have_names_of_their_own():
    found = plan(lambda x: scaled(x) + scaled(x + 1.0), np.ones((4, 1)))
    names = [operation.primitive.name for operation in found.operations]
    assert not set(names) & set(CALLS)
    assert (names.count("mul"), names.count("select_n"), names.count("neg")) == (2, 2, 2)
    made = [variable for operation in found.operations for variable in operation.outvars]
    assert len(set(made)) == len(made)
    for value in found.constants.values():
        np.testing.assert_array_equal(value, TABLE)


def test_what_is_used_once_is_delayed_and_what_it_reads_stays():
    def function(x, y):
        product = x * y  # 0: used by 2
        twice = x + x  # 1: used twice
        difference = product - y  # 2: used by a sum
        return difference.sum(axis=0), twice, jnp.sort(twice, axis=0)

    found = plan(function, np.ones((4, 1)), np.ones((4, 1)))
    names = [operation.primitive.name for operation in found.operations]
    product, difference, total = names.index("mul"), names.index("sub"), names.index("reduce_sum")
    assert found.delayed == {product: total, difference: total}
    x, y = found.operations[product].invars
    assert (found.last[x], found.last[y]) == (total, total)
    assert {x, y} <= set(found.ends[total])
    doubled = found.operations[names.index("add")].outvars[0]
    assert found.last[doubled] == len(names)  # it is a result


def test_a_result_that_is_read_once_is_delayed_to_the_end():
    found = plan(lambda x: (x * 2.0, x.sum(axis=0)), np.ones((4, 1)))
    names = [operation.primitive.name for operation in found.operations]
    assert found.delayed == {names.index("mul"): len(names)}
