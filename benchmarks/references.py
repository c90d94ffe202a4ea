"""What results are compared with, computed without the library: the thirty-digit references of the tests."""

from collections.abc import Callable
from typing import Any

import numpy as np

from tests.problems.mechanisms import reference

KINEMATIC = "thirty digits at eleven instants (tests/problems/references), by the peak of each derivative"


def largest_error(found: Any, expected: Any, axis: int = 1) -> float:
    """Return the largest error of any derivative by its peak; derivatives are along an axis."""
    found, expected = (np.moveaxis(np.asarray(x, float), axis, 0) for x in (found, expected))
    count = len(found)
    away = np.abs(found - expected[:count]).reshape(count, -1).max(axis=1)
    return float((away / np.abs(expected[:count]).reshape(count, -1).max(axis=1)).max())


def error_of(name: str, time: np.ndarray, output: str) -> Callable[[Any], float]:
    """Return the function that gives the error of an output, (instants, derivatives), of a mechanism of the tests.

    The grid has to hold the eleven instants of the reference.
    """
    instants, outputs = reference(name)
    lanes = np.abs(time[:, None] - instants).argmin(axis=0)
    np.testing.assert_allclose(time[lanes], instants, atol=1e-12)
    expected = outputs[output].T
    return lambda found: largest_error(np.asarray(found)[lanes], expected)
