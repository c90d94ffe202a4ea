"""Values along a motion: evaluation in chunks of instants, conversion to plain derivatives, and labels."""

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.errors import MechanismError
from jounce.execution.device import on_processor
from jounce.jet import Jet
from jounce.jet.derivatives import plain_derivatives
from jounce.kinematics import Motion, Status
from jounce.rigid.pose import Pose
from jounce.units.shown_units import time_axes

if TYPE_CHECKING:
    import xarray

Coordinates = Mapping[str, Float[Numbers, "_ ... _"]]
"""Taylor coefficients of the coordinates of poses by name, as in `Motion.poses`."""

Values = TypeVar("Values")


def check_motion(motion: object) -> None:
    """Raise MechanismError unless this is a motion."""
    if not isinstance(motion, Motion):
        raise MechanismError("must be a jn.Motion, as jn.solve and jn.simulate give it", name="motion", value=motion)


def in_small_chunks(function: Callable[..., Values], size: int, *arrays: Any) -> Values:
    """Return the result of a function of arrays with the instants last, evaluated in small chunks of instants.

    A factorization reads its matrices many times; those of a small chunk stay in the processor's cache.

    Parameters
    ----------
    function : callable
        Function from pytrees of arrays to a pytree of arrays, with the instants last in all arrays.
    size : int
        Number of instants in a chunk; a GPU evaluates all instants together.
    *arrays : pytree of array
        Arrays with the same number of instants.
    """
    count = jax.tree.leaves(arrays)[0].shape[-1]
    if count <= size or not on_processor():
        return function(*arrays)
    chunk_count = -(-count // size)
    filled = np.minimum(np.arange(chunk_count * size), count - 1)

    def chunked(array: Any) -> Any:
        padded = array if count % size == 0 else array[..., filled]
        return jnp.moveaxis(padded.reshape(*array.shape[:-1], chunk_count, size), -2, 0)

    def unchunked(chunks: Any) -> Any:
        return jnp.moveaxis(chunks, 0, -2).reshape(*chunks.shape[1:-1], chunk_count * size)[..., :count]

    return jax.tree.map(unchunked, jax.lax.map(lambda chunk: function(*chunk), jax.tree.map(chunked, arrays)))


def pose_of(coordinates: Coordinates, pose_type: type[Pose], order: int | None = None) -> Any:
    """Return the pose of bodies; if its order is below `order`, the bodies are at rest."""
    pose = pose_type.from_coordinates({name: Jet(tuple(c)) for name, c in coordinates.items()})
    if order is None:
        return pose
    if pose.order < order:
        return jax.tree.map(
            lambda j: Jet.constant(j.coefficients[0], order), pose, is_leaf=lambda x: isinstance(x, Jet)
        )
    return jax.lax.optimization_barrier(pose)  # or XLA computes it again in everything that uses it


def cut(coordinates: Coordinates, order: int) -> dict[str, Any]:
    """Return coordinates to an order of the pose; angular velocities have one coefficient less, and none at order 0."""
    counts = {name: order + 1 - (name == "angular_velocity") for name in coordinates}
    return {name: values[: counts[name]] for name, values in coordinates.items() if counts[name]}


def part_of(coordinates: Coordinates, bodies: tuple[int, ...] | None, levels: int) -> dict[str, Any]:
    """Return coordinates of some bodies, or of all for None, to a number of coefficients.

    The ground alone has one coefficient, as it never moves.
    """
    if bodies is not None and not any(bodies):
        levels = 1
    coordinates_of_level = cut(coordinates, levels - 1)
    return (
        coordinates_of_level
        if bodies is None
        else {name: values[..., np.array(bodies), :] for name, values in coordinates_of_level.items()}
    )


def derivatives_along(motion: Motion, coefficients: Float[Numbers, "order *shape time"]) -> Numbers:
    """Return plain derivatives from Taylor coefficients, the time first; NaN at instants that were not solved."""
    if motion.traced:
        values: Any = jnp.moveaxis(plain_derivatives(coefficients), -1, 0)
        solved = (motion.status == Status.OK).reshape(-1, *[1] * (values.ndim - 1))
        return jnp.where(solved, values, jnp.nan)
    values = np.moveaxis(np.asarray(plain_derivatives(np.asarray(coefficients))), -1, 0)
    values[motion.status != Status.OK] = np.nan
    return values


def labeled(
    motion: Motion,
    coefficients: Float[Numbers, "order *shape time"],
    units: str | None = None,
    **axes: Iterable[str],
) -> "xarray.DataArray":
    """Return plain derivatives as an xarray.DataArray with dimensions time, derivative, and the named axes."""
    import xarray

    values = derivatives_along(motion, coefficients)
    coordinates = time_axes(motion.time, values.shape[1])
    coordinates |= {axis: list(labels) for axis, labels in axes.items()}
    return xarray.DataArray(values, coordinates, tuple(coordinates), attrs={"units": units} if units else None)
