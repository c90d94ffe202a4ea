"""Arrays in annotations: `Float[Numbers, "order 3 *batch"]` is an array of floats with that shape.

A shape stands in an annotation as jaxtyping writes it, and beartype checks it while tests run. Axes are named alike
everywhere: within the library `order` first, components next, `*batch` last; at its doors `*batch` or `time` first,
then `derivative`, then `joint`, `row`, `column` or a component. An axis `order` or `derivative` counts from zero.
"""

from collections.abc import Callable, Iterable, Sequence
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


def real_numbers(name: str, values: Any, error: Callable[..., Exception]) -> np.ndarray:
    """Return values as an array of double precision, the same one if they are one.

    Raises
    ------
    Exception
        That given, if they are no numbers in one rectangular array, or complex ones: NumPy would drop the imaginary
        parts with no more than a warning.
    """
    try:
        if not np.iscomplexobj(values):
            return np.asarray(values, float)
    except (TypeError, ValueError):
        pass
    raise error("must be real numbers", name=name, value=values)


def not_complex(derivatives: Iterable[Any]) -> list[Any]:
    """Return derivatives as a list; a ValueError if one is complex, since JAX would drop its imaginary part."""
    given = list(derivatives)
    if any(np.issubdtype(getattr(x, "dtype", float), np.complexfloating) for x in given):
        raise ValueError("derivatives must be real numbers, got complex ones")
    return given
