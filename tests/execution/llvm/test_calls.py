"""Machine code for many instants as part of machine code for one: the same numbers as in calls one after another."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jounce.execution.llvm import modules, programs, self_test
from jounce.execution.llvm.text.values import UnsupportedOperationError

pytestmark = pytest.mark.skipif(
    not self_test.is_usable(), reason="there is no compiler, or a system where it was not tried"
)
LANES = 11  # a vector and a rest


def shifted(shared, lanes):
    """A function of an instant, with an array, a truth value and a whole number among what it is given."""
    (matrix, offset), (x, holds, count) = shared, lanes
    y = jnp.where(holds, matrix @ x, x) + offset
    return y, y[0] > 1.0, count + 1


def by_hand(matrix, offset, x, holds, count):
    y = np.where(holds, matrix @ x, x) + offset
    return y, y[0] > 1.0, count + 1


@pytest.fixture(scope="module")
def program():
    one = (np.zeros((3, 1)), np.zeros(1, bool), np.zeros(1, int))
    given = (np.zeros((3, 3)), np.zeros(())), one
    binary, results = modules.object_file(shifted, *given, {})
    found = programs.Program(binary, given, results)
    found.publish()
    return found


def run_alone(function, *given, large=3):
    """Return the results of machine code for a function of arrays."""
    kinds = [jax.ShapeDtypeStruct(x.shape, x.dtype) for x in given]
    binary, results = modules.object_file(lambda given, _: function(*given), kinds, (), {}, large=large, single=True)
    return programs.Single(binary, kinds, results)(given)


def given():
    random = np.random.default_rng(0)
    x = random.normal(size=(3, LANES))
    return random.normal(size=(3, 3)), x, random.random(LANES) > 0.5, np.arange(LANES)


@pytest.mark.parametrize("large", [0, 3, 1000])
def test_a_call(program, large):
    matrix, x, holds, count = given()

    def function(matrix, x, holds, count):
        return program.in_program((matrix, jnp.sum(matrix[0])), (x, holds, count))

    found = run_alone(function, matrix, x, holds, count, large=large)
    for mine, theirs in zip(found, by_hand(matrix, matrix[0].sum(), x, holds, count), strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-14)
        assert mine.dtype == theirs.dtype


def test_calls_in_a_loop_with_parts_of_arrays_and_what_is_computed_where_it_is_used(program):
    matrix, x, holds, count = given()

    def function(matrix, x, holds, count):
        def turn(k, state):
            x, holds, count = state
            parts = x[::-1] * 0.5, ~holds, count[::-1]  # none of which lies there as it is
            y, above, counted = program.in_program((matrix.T, 0.1 * k), parts)
            return y + x, above, counted

        return jax.lax.fori_loop(0, 7, turn, (x, holds, count))

    found = run_alone(function, matrix, x, holds, count)
    for k in range(7):
        y, holds, count = by_hand(matrix.T, 0.1 * k, 0.5 * x[::-1], ~holds, count[::-1])
        x = y + x
    np.testing.assert_allclose(found[0], x, rtol=1e-12)
    np.testing.assert_array_equal(found[1], holds)
    np.testing.assert_array_equal(found[2], count)


def test_results_are_not_taken_for_each_other(program):
    """Two calls on the same numbers, between which what they are given changes in its place."""
    matrix, x, holds, count = given()

    def function(matrix, x, holds, count):
        def twice(state, _):
            x, total = state
            first, *_ = program.in_program((matrix, np.zeros(())), (x, holds, count))
            second, *_ = program.in_program((matrix, np.ones(())), (first, holds, count))
            return (second, total + first - second), first

        return jax.lax.scan(twice, (x, jnp.zeros_like(x)), None, length=50)

    (found, total), history = run_alone(function, matrix, x, holds, count)
    sums = np.zeros_like(x)
    for step in history:
        first, *_ = by_hand(matrix, 0.0, x, holds, count)
        np.testing.assert_allclose(step, first, rtol=1e-9)
        x, *_ = by_hand(matrix, 1.0, step, holds, count)
        sums += step - x
    np.testing.assert_allclose(found, x, rtol=1e-9)
    np.testing.assert_allclose(total, sums, rtol=1e-9)


def test_programs_are_distinguished_by_arrays_that_their_code_does_not_read():
    """Such as the forces of a mechanism in programs of its positions, in one order or another."""

    def function(shared, lanes):
        return shared[0] + lanes[0]

    made = []
    for sizes in ((3, 1), (1, 3)):
        given = (np.zeros(()), *map(np.zeros, sizes)), [np.zeros((2, 1))]
        binary, results = modules.object_file(function, *given, {})
        made.append((binary, programs.Program(binary, given, results).name))
    (first, name), (second, other) = made
    assert first == second
    assert name != other


def test_what_is_not_published_and_calls_for_many_are_refused(program):
    def unknown(x):
        return jax.ffi.ffi_call("jounce_of_nobody", [jax.ShapeDtypeStruct(x.shape, x.dtype)])(x)

    with pytest.raises(UnsupportedOperationError, match="jounce_of_nobody"):
        run_alone(unknown, np.ones(LANES))
    one = [np.zeros((3, 1)), np.zeros(1, bool), np.zeros(1, int)]

    def within_lanes(shared, lanes):
        parts = [jnp.broadcast_to(x, (*x.shape[:-1], LANES)) for x in lanes]
        return [x[..., :1] for x in program.in_program(shared, parts)]

    with pytest.raises(UnsupportedOperationError, match="a call of"):
        modules.object_file(within_lanes, (np.zeros((3, 3)), np.zeros(())), one, {})
