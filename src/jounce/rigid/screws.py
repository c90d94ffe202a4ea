"""Screw axes and products of their exponentials on jets, of any order. Negrean 2025, equations 31-34."""

import dataclasses
from collections.abc import Sequence
from functools import reduce
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.shapes import ArrayLike, is_traced, real_or_traced
from jounce.errors import JounceError, check_choice
from jounce.jet import Jet, concatenate, cross, dot, matmul, sin, stack
from jounce.jet.algebra import JetLike
from jounce.rigid.rotations import checked_direction, rotation_about, stacked_if_jets, uniform, unit

KINDS = ("revolute", "prismatic")


@dataclasses.dataclass(frozen=True, eq=False)
class ScrewAxis:
    """Screw parameters of a joint: an axis in the frame of the base with all coordinates zero.

    Negrean 2025, equations 31-34.

    Parameters
    ----------
    axis : array_like of shape (3,)
        Direction of the axis, of any nonzero length.
    point : array_like of shape (3,), default zero
        A point on the axis, m.
    kind : {"revolute", "prismatic"}, default "revolute"
        Whether the coordinate is an angle about the axis, rad, or a distance along it, m: the operator Delta of the
        paper, one or zero.
    pitch : float, default 0
        Advance of a revolute axis along itself, m/rad; nonzero for a screw in the narrow sense.

    Raises
    ------
    JounceError
        If the axis has zero length, a number is not finite, or the kind is not known.

    Examples
    --------
    >>> import jounce as jn
    >>> hinge = jn.rigid.ScrewAxis([0, 0, 1], point=[1, 0, 0])
    >>> hinge.transform(0.0).tolist()
    [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
    """

    axis: JetLike
    point: JetLike = (0.0, 0.0, 0.0)
    kind: str = "revolute"
    pitch: float = 0.0

    def __post_init__(self) -> None:
        checked_direction(self.axis, "axis")
        position = real_or_traced("point", self.point, JounceError)
        finite = is_traced(position) or np.isfinite(np.asarray(position, float)).all()
        if np.shape(self.point) != (3,) or not finite:
            raise JounceError("a point needs three finite coordinates", name="point", value=self.point)
        check_choice("kind", self.kind, KINDS, JounceError)
        if not np.isfinite(real_or_traced("pitch", self.pitch, JounceError)):
            raise JounceError("must be a finite number", name="pitch", value=self.pitch)
        if self.kind == "prismatic" and self.pitch != 0:
            message = "a prismatic axis has no pitch; leave it out, or make the axis revolute"
            raise JounceError(message, name="pitch", value=self.pitch)

    def transform(self, coordinate: JetLike) -> Any:
        """Return the homogeneous transform of this axis at a coordinate, as `screw_transform` does."""
        return screw_transform(self.axis, self.point, coordinate, self.kind, self.pitch)


def screw_transform(
    axis: JetLike, point: JetLike, coordinate: JetLike, kind: str = "revolute", pitch: float = 0.0
) -> Any:
    """Return the homogeneous transform of a motion about or along an axis: the exponential of its screw.

    The rotation is `rotation_about` the axis, the displacement is the vector b of Negrean 2025, equation 34:
    ``b = (chi chi^T (q - sin q) + I sin q + [chi]x (1 - cos q)) (p0 x chi + pitch chi)`` for a revolute axis through
    p0, and ``chi q`` for a prismatic one.

    Parameters
    ----------
    axis : array_like of shape (3,)
        Direction of the axis, of any nonzero length.
    point : array_like of shape (3,)
        A point p0 on the axis, m.
    coordinate : Jet or array_like of shape (...)
        Angle about the axis, rad, or distance along it, m.
    kind : {"revolute", "prismatic"}, default "revolute"
        Kind of the coordinate.
    pitch : float, default 0
        Advance of a revolute axis along itself, m/rad.

    Returns
    -------
    Jet or array of shape (4, 4, ...)
        Transform from positions of the body before the motion to those after it; a jet with all derivatives if the
        coordinate is one.

    Raises
    ------
    JounceError
        If the axis has zero length, a number is not finite, or the kind is not known.

    Examples
    --------
    >>> from math import pi
    >>> import jounce as jn
    >>> jn.rigid.screw_transform([0, 0, 1], [1, 0, 0], pi)[:3, 3].round().astype(int).tolist()
    [2, 0, 0]
    """
    ScrewAxis(axis, point, kind, pitch)  # for its checks
    (turn,), finish = uniform(coordinate=coordinate)
    batch = (1,) * len(turn.shape)
    direction = stack(unit(Jet([jnp.asarray(axis, float)]))).coefficients[0].reshape(3, *batch)
    if kind == "prismatic":
        identity = jnp.broadcast_to(jnp.eye(3).reshape(3, 3, *batch), (3, 3, *turn.shape))
        return finish(homogeneous(Jet.constant(identity, turn.order), turn * direction))
    moment = cross(jnp.asarray(point, float).reshape(3, *batch), direction) + pitch * direction
    axial = direction * dot(direction, moment)[None]
    versine = 2.0 * sin(0.5 * turn).square()  # 1 - cos, without cancellation at small angles
    shift = (turn - sin(turn)) * axial + sin(turn) * moment + versine * cross(direction, moment)
    return finish(homogeneous(rotation_about(axis, turn), shift))


def product_of_exponentials(screws: Sequence[ScrewAxis], coordinates: JetLike, home: ArrayLike | None = None) -> Any:
    """Return the transform of a chain of screw axes, ``exp(S1 q1) exp(S2 q2) ... home``. Negrean 2025, equations 31-32.

    Parameters
    ----------
    screws : sequence of n ScrewAxis
        From the base outward, all in the frame of the base with the coordinates zero.
    coordinates : Jet, array_like of shape (n, ...), or n of either
        Angles, rad, and distances, m.
    home : array_like of shape (4, 4), optional
        Transform of the last body with the coordinates zero; the identity by default.

    Returns
    -------
    Jet or array of shape (4, 4, ...)
        Transform from the last body to the base; a jet with all derivatives if the coordinates are one.

    Raises
    ------
    JounceError
        If there is no screw, the numbers of screws and coordinates differ, or `home` is not of shape (4, 4).

    Examples
    --------
    >>> from math import pi
    >>> import jounce as jn
    >>> arm = [jn.rigid.ScrewAxis([0, 0, 1]), jn.rigid.ScrewAxis([0, 0, 1], point=[1, 0, 0])]
    >>> home = [[1, 0, 0, 2], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    >>> jn.rigid.product_of_exponentials(arm, [0.0, pi / 2], home)[:3, 3].round().astype(int).tolist()
    [1, 1, 0]
    """
    coordinates = stacked_if_jets("coordinates", coordinates)
    shape = coordinates.shape if isinstance(coordinates, Jet) else np.shape(coordinates)
    if not screws or shape[:1] != (len(screws),):
        message = (
            f"needs one coordinate along the first axis for each of {len(screws)} screw axes, of which one at least"
        )
        raise JounceError(message, name="coordinates", value=f"shape {tuple(shape)}")
    (q,), finish = uniform(coordinates=coordinates)
    transforms = [screw.transform(coordinate) for screw, coordinate in zip(screws, q, strict=True)]
    if home is not None:
        matrix: Any = real_or_traced("home", home, JounceError)
        if np.shape(matrix) != (4, 4):
            raise JounceError("a transform needs 4 rows and 4 columns", name="home", value=f"shape {np.shape(matrix)}")
        start = jnp.reshape(jnp.asarray(matrix, float), (4, 4, *[1] * (len(shape) - 1)))
        transforms.append(Jet.constant(start, q.order))
    return finish(reduce(matmul, transforms))


def homogeneous(rotation: Float[Jet, "3 3 *batch"], position: Float[Jet, "3 *batch"]) -> Float[Jet, "4 4 *batch"]:
    """Return the transform ``[[R, p], [0, 1]]`` of a rotation, (3, 3, ...), and a position, (3, ...): equation 31."""
    upper = [
        concatenate([row, entry]) for row, entry in zip(rotation, (position[k : k + 1] for k in range(3)), strict=True)
    ]
    lower = jnp.reshape(jnp.asarray([0.0, 0.0, 0.0, 1.0]), (4, *[1] * (len(position.shape) - 1)))
    return stack([*upper, Jet.constant(lower, position.order)])
