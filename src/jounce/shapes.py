"""Arrays in annotations: `Float[Numbers, "order 3 *batch"]` is an array of floats with that shape.

A shape stands in an annotation as jaxtyping writes it, and beartype checks it while tests run. Axes are named alike
everywhere: within the library `order` first, components next, `*batch` last; at its doors `*batch` or `time` first,
then `derivative`, then `joint`, `row`, `column` or a component. An axis `order` or `derivative` counts from zero.
"""

from collections.abc import Sequence
from typing import Any

import jax
import numpy as np
from jax.core import Tracer

Numbers = jax.Array | np.ndarray
"""An array of JAX or NumPy."""

ArrayLike = Numbers | Sequence | np.floating | np.integer | float | int
"""What becomes an array of numbers: an array, lists or tuples of numbers in any nesting, a number."""

Real = Numbers | np.floating | np.integer | float | int
"""Real numbers: an array or one number."""

Refused = object
"""Anything else, which a function takes only to refuse it in words: ``int | Refused`` is a whole number."""


def is_traced(values: Any) -> bool:
    """Tell whether JAX traces an array in a pytree: then there are no numbers to check or to choose by."""
    return any(isinstance(x, Tracer) for x in jax.tree.leaves(values))
