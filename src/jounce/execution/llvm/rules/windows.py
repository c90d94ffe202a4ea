"""The windows of an array that gathers read and scatters write, from JAX's dimension numbers."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from jax.lax import GatherScatterMode


class Windows(NamedTuple):
    """Windows of an array, one for each index along the batch axes of the array of all windows.

    Attributes
    ----------
    named : tuple of int
        Axes of the array that the indices refer to, in their order.
    batching : dict of int to int
        Axes of the array with a window of length one for each element, and the axes of the windows that count them.
    sizes : tuple of int
        Size of a window along each axis of the array.
    remaining : tuple of int
        Axes of the array that a window keeps.
    offsets, batch : tuple of int
        Positions of these axes in the array of all windows, and its other axes.
    drop : bool
        Whether windows that are not inside are dropped; otherwise they are clamped.
    """

    named: tuple[int, ...]
    batching: dict[int, int]
    sizes: tuple[int, ...]
    remaining: tuple[int, ...]
    offsets: tuple[int, ...]
    batch: tuple[int, ...]
    drop: bool

    def positions(self, indices: np.ndarray, shape: Sequence[int]) -> np.ndarray:
        """Return the flat indices of the elements in the windows of an array, -1 for a dropped window.

        The starts of the windows are given by constant indices, (windows..., index).
        """
        batch = indices.shape[:-1]
        starts = np.zeros((*batch, len(shape)), int)
        starts[..., list(self.named)] = indices
        for axis, index in self.batching.items():
            starts[..., axis] = np.arange(shape[axis]).reshape([-1 if k == index else 1 for k in range(len(batch))])
        inside = starts.clip(0, np.subtract(shape, self.sizes))
        strides = np.array([int(np.prod(shape[axis + 1 :])) for axis in range(len(shape))], int)
        offsets = np.tensordot(strides, np.indices(self.sizes), 1)
        result = (inside @ strides)[(..., *[None] * len(shape))] + offsets
        if self.drop:
            result = np.where((inside == starts).all(axis=-1)[(..., *[None] * len(shape))], result, -1)
        result = result.squeeze(tuple(len(batch) + axis for axis in range(len(shape)) if axis not in self.remaining))
        return np.moveaxis(result, range(len(batch), result.ndim), self.offsets)


def windows_of(equation: Any) -> Windows:
    """Return the windows that a gather reads, or that a scatter writes."""
    p, numbers = equation.params, equation.params["dimension_numbers"]
    (array, *_, updates), result = [x.aval.shape for x in equation.invars], equation.outvars[0].aval.shape
    if equation.primitive.name == "gather":
        axes = numbers.offset_dims, numbers.collapsed_slice_dims, numbers.start_index_map
        shape, index_axes = result, numbers.start_indices_batching_dims
    else:
        axes = numbers.update_window_dims, numbers.inserted_window_dims, numbers.scatter_dims_to_operand_dims
        shape, index_axes = updates, numbers.scatter_indices_batching_dims
    offsets, left_out, named = (tuple(map(int, dims)) for dims in axes)
    batching = {int(axis): int(k) for axis, k in zip(numbers.operand_batching_dims, index_axes, strict=True)}
    remaining = tuple(axis for axis in range(len(array)) if axis not in (*left_out, *batching))
    of_window = dict(zip(remaining, (shape[k] for k in offsets), strict=True))
    sizes = tuple(of_window.get(axis, 1) for axis in range(len(array)))
    batch = tuple(k for k in range(len(shape)) if k not in offsets)
    return Windows(named, batching, sizes, remaining, offsets, batch, p["mode"] == GatherScatterMode.FILL_OR_DROP)
