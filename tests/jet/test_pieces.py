"""The piece of a law at an instant, against NumPy's search in sorted numbers."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, strategies as st

from jounce.jet.pieces import last_begun

NUMBERS = st.integers(-6, 6).map(float)  # few, so that many are equal


@given(st.lists(NUMBERS, min_size=1, max_size=20), st.lists(NUMBERS, min_size=1, max_size=5))
def test_pieces_are_those_of_a_search(begins, instants):
    begins, instants = np.sort(begins), np.array(instants)
    expected = np.clip(np.searchsorted(begins, instants, side="right") - 1, 0, None)
    np.testing.assert_array_equal(last_begun(begins, instants), expected)


@pytest.mark.parametrize("count", [1, 2, 3, 7, 8, 9, 255, 256, 257])
def test_each_piece_is_found_in_tables_of_any_length(count):
    begins, between = np.arange(float(count)), np.arange(float(count)) + 0.5
    found = jax.jit(last_begun)(begins, np.stack([begins, between]))
    np.testing.assert_array_equal(found, np.stack([np.arange(count)] * 2))


def test_outside_the_pieces_and_where_nothing_is_reported():
    instants = jnp.array([-jnp.inf, -1.0, 99.0, jnp.inf, jnp.nan])
    np.testing.assert_array_equal(last_begun(np.array([0.0, 1.0, 2.0]), instants), [0, 0, 2, 2, 0])
