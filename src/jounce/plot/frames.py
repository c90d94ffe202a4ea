"""Where bodies and their points are: in a motion, put together at the start, at the starting guess."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jounce.errors import MechanismError, check_name
from jounce.jet import Jet
from jounce.jet.algebra import stacked
from jounce.kinematics.assembly import assemble
from jounce.kinematics.compilation import compiled
from jounce.mechanism import build, time_grid
from jounce.mechanism.builder import starting_guess
from jounce.mechanism.mechanism import GROUND
from jounce.mechanism.system import POSITION_COMPONENTS
from jounce.rigid import PlanarPose, SpatialPose

__all__ = ["assembled", "frames", "guessed", "placed"]

ASSEMBLY_TOLERANCE = 1e-10  # rad, or sizes of the mechanism


def assembled(mechanism: Any) -> dict[str, np.ndarray]:
    """Return the frames of all bodies put together near the starting guess, at the first instant.

    Degrees of freedom may be left; initial conditions count as drivers.

    Returns
    -------
    dict of str to numpy.ndarray of shape (1, components, 1 + components)
        For each body, the ground first: its origin, m, and its axes, in columns.

    Raises
    ------
    AssemblyError
        The bodies cannot be put together.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot.frames import assembled
    >>> assembled(jn.load("examples/four_bar.yaml"))["crank"][0, :, 1].round(6).tolist()  # x axis
    [0.866025, 0.5]
    """
    started = dataclasses.replace(mechanism, drivers={**mechanism.drivers, **mechanism.initial}, initial={})
    first = 0.0
    if mechanism.time is not None:
        first = float(time_grid(mechanism.time, mechanism.parameter_values)[0])
    model, coordinates = assemble(build(started), first, ASSEMBLY_TOLERANCE, free=True)
    whole = np.asarray(_frames(model.pose_type, {name: (value,) for name, value in coordinates.items()}))
    return {body: np.moveaxis(whole[0, :, :, k], -1, 0) for k, body in enumerate((GROUND, *mechanism.bodies))}


def guessed(mechanism: Any) -> dict[str, Any]:
    """Return for each body the function that takes points of its frame, (n, components), to the starting guess, m.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot.frames import guessed
    >>> guessed(jn.load("examples/four_bar.yaml"))["rocker"]([[0.0, 0.0]]).round(6).tolist()
    [[0.1321, 0.0]]
    """
    components = POSITION_COMPONENTS[mechanism.space]
    guess = starting_guess(mechanism, mechanism.parameter_values, components)
    whole = np.asarray(_frames(PlanarPose if components == 2 else SpatialPose, {k: (v,) for k, v in guess.items()}))

    def function(frame: np.ndarray) -> Any:
        return lambda points: frame[:, 0] + np.asarray(points, float).reshape(-1, components) @ frame[:, 1:].T

    return {body: function(whole[0, :, :, k, 0]) for k, body in enumerate((GROUND, *mechanism.bodies))}


@compiled("pose_type")
def _frames(pose_type: Any, coordinates: Mapping[str, Any]) -> Any:
    """Return origin and axes of all bodies, shape (order + 1, components, 1 + components, bodies, time)."""
    import jax.numpy as jnp

    pose = pose_type.from_coordinates({name: Jet(tuple(c)) for name, c in coordinates.items()})
    columns = [pose.position, *(pose.direction(unit) for unit in np.eye(pose_type.shifts))]
    return jnp.stack([stacked(column) for column in columns], axis=2)


def placed(motion: Any, body: str, points: Any, order: int = 0) -> np.ndarray:
    """Return where points of a body are in the global frame, and their derivatives, at all instants.

    Parameters
    ----------
    motion : Motion
        At instants that were not solved the result is NaN.
    body : str
        Name of the body, ``"ground"`` included.
    points : array_like of shape (n, components)
        In the frame of the body, m.
    order : int, default 0
        Highest derivative.

    Returns
    -------
    numpy.ndarray of shape (time, order + 1, n, components)
        m, m/s, ...

    Raises
    ------
    MechanismError
        No body has the name, the points are no vectors, or the order is above that of the motion.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot.frames import placed
    >>> motion = jn.solve(jn.load("examples/four_bar.yaml"), [0.0], order=1)
    >>> placed(motion, "crank", [[0.0, 0.0], [0.04, 0.0]], order=1)[0, 0].round(5).tolist()
    [[0.0, 0.0], [0.03464, 0.02]]
    """
    names, components = (GROUND, *motion.mechanism.bodies), POSITION_COMPONENTS[motion.mechanism.space]
    check_name("body", body, names, MechanismError, name="body")
    local = np.asarray(points, float)
    if local.ndim != 2 or local.shape[1] != components:
        raise MechanismError(f"must be a list of vectors of {components} numbers", name="points", value=local.tolist())
    if not 0 <= order <= motion.order:
        message = f"the motion has derivatives up to order {motion.order}; solve it with a higher order"
        raise MechanismError(message, name="order", value=order)
    frame = _all_frames(motion, order)[..., names.index(body), :]
    found = frame[:, :, 0, None, :] + np.einsum("kcdt,nd->kcnt", frame[:, :, 1:], local)
    found = np.moveaxis(found, (3, 0, 2, 1), (0, 1, 2, 3))
    found[:, 1:] += 0.0  # no negative zeros
    return np.where((np.asarray(motion.status) == 0)[:, None, None, None], found, np.nan)


def frames(motion: Any) -> dict[str, np.ndarray]:
    """Return where all bodies of a motion are: for each, the ground first, its origin, m, and its axes in columns.

    Each has the shape (time, components, 1 + components); NaN at instants that were not solved.
    """
    whole = np.where(np.asarray(motion.status) == 0, _all_frames(motion, 0)[0], np.nan)
    names = (GROUND, *motion.mechanism.bodies)
    return {body: np.moveaxis(whole[:, :, k], -1, 0) for k, body in enumerate(names)}


def _all_frames(motion: Any, order: int) -> np.ndarray:
    """Return derivatives of the frames of all bodies; kept with the motion."""
    known = motion.derived.get("frames")
    if known is None or len(known) <= order:
        pose_type, coordinates = motion.poses
        cut = {name: tuple(c[: order + 1]) for name, c in coordinates.items()}
        known = np.array(_frames(pose_type, cut))
        sizes: Sequence[float] = np.cumprod([1.0, *range(1, order + 1)]).tolist()
        known *= np.array(sizes).reshape(-1, *[1] * (known.ndim - 1))
        motion.derived["frames"] = known
    return known[: order + 1]
