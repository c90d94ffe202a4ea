"""Simple rotations, rotations about any axis, and Euler sequences on jets. Negrean 2025, equations 11-22."""

from collections.abc import Sequence
from functools import reduce
from typing import Any

import jax.numpy as jnp
import numpy as np

from jounce.base.shapes import is_traced, real_or_traced
from jounce.errors import JounceError, check_choice
from jounce.jet import Jet, components, cos, matmul, sin, sqrt, stack
from jounce.jet.algebra import JetLike, total

AXES = "xyz"

MOVING_SEQUENCES = tuple(u + v + w for u in "XYZ" for v in "XYZ" for w in "XYZ" if v not in (u, w))
"""The twelve Euler sequences about moving axes."""

FIXED_SEQUENCES = tuple(sequence.lower() for sequence in MOVING_SEQUENCES)
"""The twelve Euler sequences about fixed axes."""

SEQUENCES = MOVING_SEQUENCES + FIXED_SEQUENCES
"""All Euler sequences: upper-case letters for moving axes, lower-case for fixed axes, as in SciPy."""


def simple_rotation(axis: str, angle: JetLike) -> Any:
    """Return the matrix of a rotation about a coordinate axis. Negrean 2025, equations 11-18.

    One formula serves the three axes: a diagonal of cosines, and the skew-symmetric matrix of a vector of sines, in
    which operators Delta, one or zero by the axis, switch the angle on or off.

    Parameters
    ----------
    axis : {"x", "y", "z"}
        Axis of rotation, in lower or upper case.
    angle : Jet or array_like of shape (...)
        Angle, rad, by the right-hand rule.

    Returns
    -------
    Jet or array of shape (3, 3, ...)
        Matrix from the rotated frame to the original one; a jet if the angle is one.

    Raises
    ------
    JounceError
        If the axis does not exist.

    Examples
    --------
    >>> from math import pi
    >>> import jounce as jn
    >>> jn.rigid.simple_rotation("z", pi / 2).round().astype(int).tolist()
    [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    >>> angle = jn.Jet.variable(0.0, order=1)
    >>> jn.rigid.simple_rotation("z", angle)[1, 0].derivatives().tolist()
    [0.0, 1.0]
    """
    letter = str(axis).lower()
    check_choice("axis", letter, tuple(AXES), JounceError)
    (turn,), finish = uniform(angle=angle)
    delta = [int(letter == u) for u in AXES]  # Delta_u of equation 14; Delta_vw of equation 13 is 1 - Delta_u
    ones = Jet.constant(jnp.ones_like(turn.coefficients[0]), turn.order)
    zeros = ones.map(jnp.zeros_like)
    cosine, sine = cos(turn), sin(turn)
    c = [ones if selected else cosine for selected in delta]  # cos(angle Delta_vw)
    s = [sine if selected else zeros for selected in delta]  # sin(angle Delta_u)
    return finish(_rows([[c[0], -s[2], s[1]], [s[2], c[1], -s[0]], [-s[1], s[0], c[2]]]))


def rotation_about(axis: JetLike, angle: JetLike) -> Any:
    """Return the matrix of a rotation about any axis: the exponential of its skew-symmetric matrix times the angle.

    ``R = chi chi^T (1 - cos) + I cos + [chi]x sin`` with the unit vector chi of the axis. Negrean 2025, equations
    19 and 21.

    Parameters
    ----------
    axis : Jet or array_like of shape (3,) or (3, ...)
        Direction of the axis, of any nonzero length; it may move.
    angle : Jet or array_like of shape (...)
        Angle, rad, by the right-hand rule.

    Returns
    -------
    Jet or array of shape (3, 3, ...)
        Matrix of the rotation; a jet if the axis or the angle is one.

    Raises
    ------
    JounceError
        If the axis does not have three finite components, or has zero length.

    Examples
    --------
    >>> from math import pi
    >>> import jounce as jn
    >>> jn.rigid.rotation_about([1, 1, 1], 2 * pi / 3).round().astype(int).tolist()
    [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    """
    (chi, turn), finish = uniform(axis=checked_direction(axis), angle=angle)
    x, y, z = unit(chi)
    c, s = cos(turn), sin(turn)
    versine = 2.0 * sin(0.5 * turn).square()  # 1 - cos, without cancellation at small angles
    return finish(
        _rows(
            [
                [x * x * versine + c, x * y * versine - z * s, x * z * versine + y * s],
                [x * y * versine + z * s, y * y * versine + c, y * z * versine - x * s],
                [x * z * versine - y * s, y * z * versine + x * s, z * z * versine + c],
            ]
        )
    )


def rotation_matrix(sequence: str, angles: JetLike) -> Any:
    """Return the rotation matrix of Euler angles, a product of three exponentials. Negrean 2025, equations 20-22.

    Parameters
    ----------
    sequence : str
        Three letters, neighbors different. Upper case ("ZXZ"): each rotation is about an axis moved by the rotations
        before. Lower case ("zxz"): about fixed axes.
    angles : Jet, array_like of shape (3, ...), or three of either
        Angles in the order of the letters, rad.

    Returns
    -------
    Jet or array of shape (3, 3, ...)
        Matrix from body to global components; a jet with all derivatives if an angle is one.

    Raises
    ------
    JounceError
        If the sequence is not one of `SEQUENCES`, or there are not three angles.

    See Also
    --------
    euler_angles : The inverse function.

    Examples
    --------
    >>> import jounce as jn
    >>> t = jn.Jet.variable(0.0, order=1)
    >>> jn.rigid.rotation_matrix("ZYX", [3.0 * t, 2.0 * t, t]).derivatives()[1].tolist()
    [[0.0, -3.0, 2.0], [3.0, 0.0, -1.0], [-2.0, 1.0, 0.0]]
    """
    turns, finish = simple_rotations(sequence, angles)
    return finish(reduce(matmul, turns if is_moving(sequence) else turns[::-1]))


def simple_rotations(sequence: str, angles: JetLike) -> tuple[list[Jet], Any]:
    """Return the three rotations of a sequence as jets, in the order of its letters, and the function of `uniform`."""
    check_sequence(sequence)
    (angles,), finish = uniform(angles=checked_angles(angles))
    return [simple_rotation(axis, angle) for axis, angle in zip(sequence, angles, strict=True)], finish


def is_moving(sequence: str) -> bool:
    """Return whether a sequence rotates about moving axes."""
    return sequence.isupper()


def check_sequence(sequence: str, error: type[JounceError] = JounceError, name: str | None = "sequence") -> None:
    """Raise an error unless the sequence is one of the 24."""
    if sequence not in SEQUENCES:
        message = (
            "not an Euler sequence; write three letters with neighbors different, such as ZXZ (moving axes) or zxz "
            "(fixed axes)"
        )
        raise error(message, name=name, value=sequence)


def stacked_if_jets(name: str, values: JetLike) -> Any:
    """Return a sequence with jets in it as one jet, others unchanged; raise a JounceError unless numbers are real."""
    if isinstance(values, Jet):
        return values
    if isinstance(values, Sequence) and any(isinstance(value, Jet) for value in values):
        return stack([x if isinstance(x, Jet) else jnp.asarray(_real(name, x), float) for x in values])
    return _real(name, values)


def _real(name: str, values: Any) -> Any:
    return real_or_traced(name, values, JounceError)


def checked_angles(angles: JetLike) -> Any:
    """Return three angles as one jet or array of shape (3, ...)."""
    angles = stacked_if_jets("angles", angles)
    shape = angles.shape if isinstance(angles, Jet) else np.shape(angles)
    if shape[:1] != (3,):
        message = "needs three angles along the first axis; batch axes come last"
        raise JounceError(message, name="angles", value=f"shape {tuple(shape)}")
    return angles


def checked_direction(axis: JetLike, name: str = "axis") -> Any:
    """Return the direction of an axis after checking its shape, and its length if the values are known."""
    axis = axis if isinstance(axis, Jet) else _real(name, axis)
    shape = axis.shape if isinstance(axis, Jet) else np.shape(axis)
    if shape[:1] != (3,):
        message = "an axis needs three components along the first axis"
        raise JounceError(message, name=name, value=f"shape {tuple(shape)}")
    value = axis.coefficients[0] if isinstance(axis, Jet) else axis
    if not is_traced(value):
        length = np.linalg.norm(np.asarray(value, float), axis=0)
        if not (np.isfinite(length) & (length > 0)).all():
            message = "the direction of an axis must be finite and not of zero length"
            raise JounceError(message, name=name, value=np.asarray(value).tolist())
    return axis


def unit(vector: Jet) -> list[Jet]:
    """Return the components, each of the batch's shape, of a vector scaled to unit length."""
    coordinates = [coordinate[0] for coordinate in components(vector)]
    length = sqrt(total(coordinate.square() for coordinate in coordinates))
    return [coordinate / length for coordinate in coordinates]


def uniform(**arguments: JetLike) -> tuple[list[Jet], Any]:
    """Return arguments as jets of one order, and a function that converts the result for the caller.

    If no argument is a jet, the result becomes an array of values. Batch axes of all arguments must agree or be
    missing, and are last. A JounceError names an argument that is not made of real numbers.
    """
    orders = [argument.order for argument in arguments.values() if isinstance(argument, Jet)]
    order = min(orders, default=0)
    jets = [
        x.truncate(order) if isinstance(x, Jet) else Jet.constant(jnp.asarray(_real(name, x), float), order)
        for name, x in arguments.items()
    ]
    return jets, (lambda jet: jet) if orders else (lambda jet: jet.coefficients[0])


def _rows(rows: list[list[Jet]]) -> Jet:
    return stack([stack(row) for row in rows])
