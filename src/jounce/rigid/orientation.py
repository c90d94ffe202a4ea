"""Euler angles, their rates and angular velocity, of any order on jets. Negrean 2025, equations 29-30, 36 and 41-42."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jounce.base.shapes import Array, Numbers, is_traced
from jounce.errors import JounceError, SingularityError, check_choice
from jounce.jet import Jet, atan2, cos, cross, dot, matvec, sin, sqrt, stack, transpose
from jounce.jet.algebra import JetLike, total
from jounce.rigid.body_arrays import body_vector
from jounce.rigid.rotations import (
    AXES,
    check_sequence,
    checked_angles,
    is_moving,
    simple_rotations,
    uniform,
)

FRAMES = ("global", "body")

SINGULAR = 1e-8
"""Distance from a singular orientation below which angles and rates lose more than half their digits."""

ORTHONORMAL = 1e-6
"""Largest entry of ``R^T R - I`` of a rotation matrix, which allows for single precision and printed digits."""


def transfer_matrix(sequence: str, angles: JetLike, frame: str = "global") -> Any:
    """Return the angular transfer matrix, which maps rates of Euler angles to the angular velocity.

    ``J_psi = [u, R(u; a) v, R(u; a) R(v; b) w]`` for moving axes u, v, w. Negrean 2025, equation 30.

    Parameters
    ----------
    sequence : str
        One of `SEQUENCES`.
    angles : Jet, array_like of shape (3, ...), or three of either
        Angles in the order of the letters, rad.
    frame : {"global", "body"}, default "global"
        Frame of the components of the angular velocity.

    Returns
    -------
    Jet or array of shape (3, 3, ...)
        Columns in the order of the angles: the axes of their rotations.

    Raises
    ------
    JounceError
        If the sequence or the frame is not known, or there are not three angles.

    Examples
    --------
    >>> import jounce as jn
    >>> jn.rigid.transfer_matrix("ZYX", [0.0, 0.0, 0.5]).tolist()
    [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]
    """
    check_choice("frame", frame, FRAMES, JounceError)
    turns, finish = simple_rotations(sequence, angles)
    axes = [Jet.constant(_basis(letter, turns[0]), turns[0].order) for letter in sequence]
    # in the global frame, an axis is rotated by the rotations before it (moving axes) or after it (fixed axes); in the
    # body
    # frame, by the inverses of the others
    by_preceding = is_moving(sequence) == (frame == "global")
    if frame == "body":
        turns = [transpose(turn) for turn in turns]
    columns = []
    for k, axis in enumerate(axes):
        for turn in turns[:k][::-1] if by_preceding else turns[k + 1 :]:
            axis = matvec(turn, axis)
        columns.append(axis)
    return finish(transpose(stack(columns)))


def angular_velocity_from_angles(sequence: str, angles: JetLike, frame: str = "global") -> Jet:
    """Return the angular velocity of moving Euler angles, with its derivatives. Negrean 2025, equations 41-42.

    Parameters
    ----------
    sequence : str
        One of `SEQUENCES`.
    angles : Jet of shape (3, ...), or three Jet
        Angles in the order of the letters, rad, of order 1 or more.
    frame : {"global", "body"}, default "global"
        Frame of the components.

    Returns
    -------
    Jet of shape (3, ...)
        Angular velocity, rad/s, and its derivatives, one order shorter than the angles.

    Raises
    ------
    JounceError
        If the sequence or the frame is not known, or the angles carry no derivative.

    Examples
    --------
    >>> import jounce as jn
    >>> t = jn.Jet.variable(0.0, order=2)
    >>> jn.rigid.angular_velocity_from_angles("ZYX", [3.0 * t, 2.0 * t, t]).derivatives().tolist()
    [[1.0, 2.0, 3.0], [-6.0, 3.0, -2.0]]
    """
    angles = _moving_jet(checked_angles(angles), "angles")
    return matvec(transfer_matrix(sequence, angles.truncate(angles.order - 1), frame), angles.differentiate())


def angular_velocity(attitude: Float[Jet | Numbers, "3 3 *batch"], frame: str = "global") -> Float[Jet, "3 *batch"]:
    """Return the angular velocity of a moving rotation matrix, ``[w]x = R' R^T``. Negrean 2025, equation 36.

    Parameters
    ----------
    attitude : Jet of shape (3, 3, ...)
        Rotation matrix from the body to the global frame, orthonormal at every order; of order 1 or more.
    frame : {"global", "body"}, default "global"
        Frame of the components; in the body frame, ``[w]x = R^T R'``.

    Returns
    -------
    Jet of shape (3, ...)
        Angular velocity, rad/s, and its derivatives, one order shorter than the attitude.

    Raises
    ------
    JounceError
        If the frame is not known, or the attitude carries no derivative.

    Examples
    --------
    >>> import jounce as jn
    >>> angle = 2.0 * jn.Jet.variable(0.3, order=2)
    >>> jn.rigid.angular_velocity(jn.rigid.simple_rotation("y", angle)).derivatives().round(12).tolist()
    [[0.0, 2.0, 0.0], [0.0, 0.0, 0.0]]
    """
    check_choice("frame", frame, FRAMES, JounceError)
    attitude = _moving_jet(attitude, "attitude")
    # every axis of a triad moves as a' = w x a, and the sum of a x (w x a) over the triad is 2 w
    triad = transpose(attitude) if frame == "global" else attitude
    half = 0.5 if frame == "global" else -0.5
    rates = triad.differentiate()
    return half * total(cross(triad[k], rates[k]) for k in range(3))


def angle_rates(sequence: str, angles: JetLike, angular_velocity: JetLike, frame: str = "global") -> Any:
    """Return the rates of Euler angles from the angular velocity: the inverse of the transfer matrix.

    Parameters
    ----------
    sequence : str
        One of `SEQUENCES`.
    angles : Jet, array_like of shape (3, ...), or three of either
        Angles in the order of the letters, rad. If the angular velocity is a jet, values are sufficient: the
        derivatives of the angles follow from it, order after order.
    angular_velocity : Jet or array_like of shape (3, ...)
        Angular velocity, rad/s.
    frame : {"global", "body"}, default "global"
        Frame of its components.

    Returns
    -------
    Jet or array of shape (3, ...)
        Rates of the angles, rad/s, with their derivatives if the angular velocity has them. In a batch, samples at a
        singular orientation are NaN, and `is_singular_orientation` returns which ones they are.

    Raises
    ------
    JounceError
        If the sequence or the frame is not known, or there are not three angles.
    SingularityError
        If a single orientation is singular: two of the three axes are parallel.

    Examples
    --------
    >>> import jounce as jn
    >>> jn.rigid.angle_rates("ZYX", [0.0, 0.0, 0.0], [1.0, 2.0, 3.0]).tolist()
    [3.0, 2.0, 1.0]
    >>> jn.rigid.angle_rates("ZYX", [0.0, 1.5707963267948966, 0.0], [1.0, 2.0, 3.0])
    Traceback (most recent call last):
    ...
    jounce.errors.SingularityError: ZYX: its first and last axes are parallel where the second angle is ...
    """
    check_choice("frame", frame, FRAMES, JounceError)
    angles = checked_angles(angles)
    value = angles.coefficients[0] if isinstance(angles, Jet) else jnp.asarray(angles, float)
    regular = _regular(sequence, value, singularity_distance(sequence, value))
    # one state may meet a batch: it gets batch axes of length one
    velocity_value = angular_velocity.coefficients[0] if isinstance(angular_velocity, Jet) else angular_velocity
    rank = max(np.ndim(value), np.ndim(velocity_value))
    angular_velocity, value = body_vector(angular_velocity, rank - 1), body_vector(value, rank - 1)
    if isinstance(angles, Jet):
        (angles, velocity), finish = uniform(angles=angles, angular_velocity=angular_velocity)
        return finish(_marked(_solved(transfer_matrix(sequence, angles, frame), velocity), regular))
    (velocity,), finish = uniform(angular_velocity=angular_velocity)
    known_angles = Jet([value])
    while True:
        rates = _solved(transfer_matrix(sequence, known_angles, frame), velocity.truncate(known_angles.order)).dense()
        if rates.order == velocity.order:
            return finish(_marked(rates, regular))
        known_angles = rates.integrate(value)


def singularity_distance(sequence: str, angles: JetLike) -> Array[Numbers, "*batch"]:
    """Return the distance of an orientation from a singular one: the volume spanned by the three axes of rotation.

    Parameters
    ----------
    sequence : str
        One of `SEQUENCES`.
    angles : Jet, array_like of shape (3, ...), or three of either
        Angles in the order of the letters, rad.

    Returns
    -------
    array of shape (...)
        Absolute determinant of the transfer matrix, from 0 at a singular orientation to 1: the cosine of the second
        angle, or its sine if the first and last letters are the same.

    Raises
    ------
    JounceError
        If the sequence is not known, or there are not three angles.

    Examples
    --------
    >>> import jounce as jn
    >>> float(jn.rigid.singularity_distance("ZYX", [0.3, 0.0, 0.2]))
    1.0
    """
    check_sequence(sequence)
    angles = checked_angles(angles)
    second = (angles.coefficients[0] if isinstance(angles, Jet) else jnp.asarray(angles, float))[1]
    return jnp.abs((sin if sequence[0] == sequence[2] else cos)(second))


def is_singular_orientation(sequence: str, angles: JetLike, tolerance: float = SINGULAR) -> Bool[Numbers, "*batch"]:
    """Return whether Euler angles are at a singular orientation (gimbal lock).

    Parameters
    ----------
    sequence : str
        One of `SEQUENCES`.
    angles : Jet, array_like of shape (3, ...), or three of either
        Angles in the order of the letters, rad.
    tolerance : float, default 1e-8
        Largest `singularity_distance` that counts as singular.

    Returns
    -------
    array of bool of shape (...)
        True where the first and last axes are parallel.

    Raises
    ------
    JounceError
        If the sequence is not known, or there are not three angles.

    Examples
    --------
    >>> import jounce as jn
    >>> jn.rigid.is_singular_orientation("ZXZ", [[0.1, 0.1], [0.0, 0.5], [0.2, 0.2]]).tolist()
    [True, False]
    """
    return singularity_distance(sequence, angles) <= tolerance


def euler_angles(sequence: str, attitude: JetLike) -> Any:
    """Return the Euler angles of a rotation matrix, with their derivatives if it is a jet.

    Parameters
    ----------
    sequence : str
        One of `SEQUENCES`.
    attitude : Jet or array_like of shape (3, 3, ...)
        Rotation matrix from the body to the global frame.

    Returns
    -------
    Jet or array of shape (3, ...)
        Angles in the order of the letters, rad: the second one in [0, pi] if the first and last letters are the same,
        else in [-pi/2, pi/2]; the others in [-pi, pi]. In a batch, samples at a singular orientation are NaN.

    Raises
    ------
    JounceError
        If the sequence is not known, or the matrix is not a rotation.
    SingularityError
        If a single orientation is singular: only the sum or the difference of two angles is determined.

    Examples
    --------
    >>> import jounce as jn
    >>> angles = jn.rigid.euler_angles("ZYX", jn.rigid.rotation_matrix("ZYX", [0.3, 0.2, 0.1]))
    >>> [round(float(angle), 12) for angle in angles]
    [0.3, 0.2, 0.1]
    """
    check_sequence(sequence)
    (matrix,), finish = uniform(attitude=attitude)
    check_rotation(matrix.coefficients[0])
    letters = sequence.lower() if is_moving(sequence) else sequence[::-1]
    i, j, k = (AXES.index(letter) for letter in letters)
    remaining = 3 - i - j
    sign = 1.0 if (j - i) % 3 == 1 else -1.0  # whether i, j and the third axis are in cyclic order
    if i == k:
        side = [matrix[j, i], -sign * matrix[remaining, i]]
        end = [matrix[i, j], sign * matrix[i, remaining]]
    else:
        side = [-sign * matrix[j, k], matrix[k, k]]
        end = [-sign * matrix[i, j], matrix[i, i]]
    regular = _regular(sequence, None, jnp.hypot(*(component.coefficients[0] for component in side)))
    distance = sqrt(side[0].square() + side[1].square())
    middle = atan2(distance, matrix[i, i]) if i == k else atan2(sign * matrix[i, k], distance)
    sequence_angles = [atan2(*side), middle, atan2(*end)]
    angles = stack(sequence_angles if is_moving(sequence) else sequence_angles[::-1])
    return finish(_marked(angles, regular))


def check_rotation(matrix: Numbers, name: str = "attitude") -> None:
    """Raise a JounceError unless matrices of shape (3, 3, ...) are rotations; traced values are not checked."""
    if tuple(np.shape(matrix)[:2]) != (3, 3):
        message = "a rotation matrix needs 3 rows and 3 columns on the first axes; batch axes come last"
        raise JounceError(message, name=name, value=f"shape {tuple(np.shape(matrix))}")
    if is_traced(matrix):
        return
    matrices = np.moveaxis(np.asarray(matrix).reshape(3, 3, -1), -1, 0)
    with np.errstate(invalid="ignore"):  # non-finite values show in the result
        errors = np.abs(np.swapaxes(matrices, 1, 2) @ matrices - np.eye(3)).max(axis=(1, 2))
        is_wrong = ~(errors <= ORTHONORMAL) | ~(np.linalg.det(matrices) > 0)
    if is_wrong.any():
        first = int(np.flatnonzero(is_wrong)[0])
        number_text = f" (number {first} of the batch)" if len(matrices) > 1 else ""
        if not np.isfinite(errors[first]):
            fault = "has entries that are not finite"
        elif errors[first] > ORTHONORMAL:
            fault = f"is not orthonormal: an entry of R^T R is {errors[first]:.3g} off, more than {ORTHONORMAL:g}"
        else:
            fault = "is a reflection: its determinant is negative"
        raise JounceError(f"the matrix{number_text} {fault}", name=name, value=matrices[first].tolist())


def _regular(sequence: str, angles: Numbers | None, distance: Numbers) -> Any:
    """Return the mask of regular orientations; raise SingularityError for a single singular one."""
    regular = distance > SINGULAR
    if np.ndim(distance) == 0 and not is_traced(regular) and not bool(regular) and not bool(jnp.isnan(distance)):
        value = "a multiple of pi" if sequence[0] == sequence[2] else "pi/2 and a multiple of pi"
        message = (
            f"its first and last axes are parallel where the second angle is {value}, and this orientation is only "
            f"{float(distance):.3g} away; choose a sequence that is "
            f"{'of three different letters' if sequence[0] == sequence[2] else 'of equal first and last letters'} here"
        )
        if angles is None:
            raise SingularityError(message, name=sequence)
        raise SingularityError(message, name=sequence, value=[float(angle) for angle in angles])
    return regular


def _marked(vector: Float[Jet, "3 *batch"], regular: Numbers) -> Float[Jet, "3 *batch"]:
    """Return a vector with NaN at all orders where the orientation is singular."""
    if not is_traced(regular) and bool(jnp.all(regular)):
        return vector
    mask = jnp.reshape(regular, (1,) * (len(vector.shape) - jnp.ndim(regular)) + jnp.shape(regular))
    return vector.dense().map(lambda c: jnp.where(mask, c, jnp.nan))


def _solved(matrix: Float[Jet, "3 3 *#batch"], vector: Float[Jet, "3 *#batch"]) -> Float[Jet, "3 *#batch"]:
    """Return ``matrix^-1 vector`` by Cramer's rule; the determinant is the singularity distance."""
    a, b, c = transpose(matrix)
    normals = cross(b, c), cross(c, a), cross(a, b)
    volume = dot(a, normals[0])
    return stack([dot(normal, vector) / volume for normal in normals])


def _basis(letter: str, turn: Float[Jet, "3 3 *batch"]) -> Float[Numbers, "3 *batch"]:
    """Return a coordinate axis with the batch axes of a rotation."""
    ones = jnp.ones_like(turn.coefficients[0][0, 0])
    return jnp.stack([ones if u == letter.lower() else 0 * ones for u in AXES])


def _moving_jet(value: JetLike, name: str) -> Jet:
    if not isinstance(value, Jet) or value.order == 0:
        message = "carries no derivative, so there is no angular velocity; give a Jet of order 1 or more"
        raise JounceError(message, name=name)
    return value
