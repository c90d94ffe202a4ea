"""Conversion between plain derivatives and Taylor coefficients of whole arrays, order first."""

import math
from functools import lru_cache

import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Numbers


def taylor_coefficients(derivatives: Float[Numbers, "order *shape"]) -> Float[Numbers, "order *shape"]:
    """Return Taylor coefficients from plain derivatives along the leading axis."""
    scale = np.array([1 / math.factorial(k) for k in range(derivatives.shape[0])])
    return derivatives * scale.reshape(-1, *[1] * (derivatives.ndim - 1))


def plain_derivatives(
    coefficients: Float[Numbers, "order *shape"], out: Float[np.ndarray, "order *shape"] | None = None
) -> Float[Numbers, "order *shape"]:
    """Return plain derivatives from Taylor coefficients along the leading axis, in a given array or a new one."""
    scale = _factorials(coefficients.shape[0]).reshape(-1, *[1] * (coefficients.ndim - 1))
    return coefficients * scale if out is None else np.multiply(coefficients, scale, out=out)


@lru_cache(maxsize=64)
def _factorials(count: int) -> Float[np.ndarray, " order"]:
    return np.array([float(math.factorial(k)) for k in range(count)])
