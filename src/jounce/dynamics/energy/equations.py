"""The equations of motion from energies, in every form, for a reader to compare. Negrean 2025, equations 126-134.

All give the generalised inertia forces Q_i of a robot and their rates, and agree to rounding with those of
`virtual_work` and `newton_euler`; for work, `jounce.inverse_dynamics` is the one to use. They rest on the partial
derivatives of energies with respect to ``q^(m)``. As a jet has no separate velocity, the series in time of such a
partial derivative is found from perturbations ``s^r / r!`` of the motion itself: to first order they change an energy
by ``sum_r s^(m-r) / (m-r)! dE/dq^(r)``, which is solved for the last term. The coordinates are those of a robot, or the
laws of the drivers of a mechanism (`driver_coordinates`).
"""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, overload

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.dynamics.energy.driver_coordinates import in_driver_coordinates
from jounce.dynamics.energy.energies import differentiated, error_for, robot_energy
from jounce.errors import whole_number
from jounce.jet import Jet, components
from jounce.jet.algebra import stacked, total
from jounce.kinematics import Motion
from jounce.robot.model.arguments import checked_coordinates
from jounce.robot.model.tree import Tree
from jounce.robot.recursions.batches import Batched
from jounce.robot.recursions.kinematics import body_frames
from jounce.robot.recursions.tree_scan import Series
from jounce.robot.robot import Robot
from jounce.shapes import ArrayLike, Numbers

if TYPE_CHECKING:
    import xarray


def catalan(p: int) -> int:
    """Return the Catalan number C_p = 1, 2, 5, 14, 42, ... for p = 1, 2, ...: what equation 134 should have.

    Examples
    --------
    >>> [catalan(p) for p in range(1, 6)]
    [1, 2, 5, 14, 42]
    """
    return math.comb(2 * p, p) // (p + 1)


def printed_coefficient(p: int) -> int:
    """Return ``p (p + 1) / 2 - delta_p`` as equation 134 is printed: right to p = 3 only.

    Examples
    --------
    >>> [printed_coefficient(p) for p in range(1, 6)]
    [1, 2, 5, 9, 14]
    """
    return p * (p + 1) // 2 - (p > 1)


Energies = Callable[[Series, int], Jet]
"""What maps Taylor coefficients of coordinates and p to the energy E_p, (batch,)."""

Slope = Float[Numbers, "{levels} coordinate batch"]
"""Taylor coefficients of a derivative with respect to the coordinates."""


def slope_series(energy: Callable[[Series], Float[Numbers, "levels batch"]], q: Series, m: int, levels: int) -> Slope:
    """Return the series in time of the derivative of a quantity with respect to ``q^(m)``.

    Parameters
    ----------
    energy : callable
        Maps Taylor coefficients of the coordinates to those of the quantity, (levels, batch).
    q : array of shape (K + 1, coordinates, batch)
        Taylor coefficients of the coordinates.
    m : int
        Which derivative of the coordinates it is differentiated by.
    levels : int
        How many coefficients are wanted; one is the value.

    Returns
    -------
    array of shape (levels, coordinates, batch)
        Taylor coefficients.
    """
    lowest, coordinates = max(0, m + 1 - levels), q.shape[1]  # terms below vanish at the instant itself
    q = jnp.concatenate([q, jnp.zeros((max(0, m + 1 - q.shape[0]), *q.shape[1:]))])
    below, varied, above = q[:lowest], q[lowest : m + 1], q[m + 1 :]
    _, slope = jax.linearize(lambda part: energy(jnp.concatenate([below, part, above])), varied)
    series = []
    for row in range(len(varied)):
        shift = m - lowest - row
        directions = np.zeros((coordinates, *varied.shape[:2], 1))
        directions[np.arange(coordinates), row, np.arange(coordinates)] = 1 / math.factorial(lowest + row)
        changes = jax.vmap(slope, out_axes=1)(jnp.broadcast_to(directions, (coordinates, *varied.shape)))
        changes = changes * ((-1) ** shift / math.factorial(shift))
        series.append(jnp.concatenate([jnp.zeros((shift, *changes.shape[1:])), changes[: levels - shift]]))
    return total(series)


def _slope(energies: Energies, q: Series, levels: int, order: int, rate: int, m: int) -> Slope:
    """Return the series of ``dE_p^(n) / dq^(m)`` for order p and rate n."""

    def energy(q: Any) -> Any:
        return stacked(differentiated(energies(q, order), rate).truncate(levels - 1))

    return slope_series(energy, q[: max(order + rate + levels, m) + 1], m, levels)


def _lagrange(energies: Energies, q: Series, levels: int) -> Slope:
    momentum = _slope(energies, q, levels + 1, 0, 0, 1)
    rate = momentum[1:] * np.arange(1.0, levels + 1)[:, None, None]
    return rate - _slope(energies, q, levels, 0, 0, 0)


def _mangeron(energies: Energies, q: Series, levels: int, m: int) -> Slope:
    return (_slope(energies, q, levels, 0, m, m) - (m + 1) * _slope(energies, q, levels, 0, 0, 0)) / m


def _gibbs_appell(energies: Energies, q: Series, levels: int, m: int) -> Slope:
    return _slope(energies, q, levels, 1, m - 2, m)


def _higher_order(
    energies: Energies, q: Series, k: int, m: int, weights: tuple[float, ...]
) -> Float[Numbers, "1 coordinate batch"]:
    def weighted(q: Any) -> Any:
        terms = []
        for p, weight in enumerate(weights, 1):
            rate = m + k - 2 * p - 1
            terms.append(weight * math.factorial(rate) * energies(q, p).dense().coefficients[rate])
        return total(terms)[None]

    return (math.factorial(k - 1) * math.factorial(m) / math.factorial(m + k - 1)) * slope_series(weighted, q, m, 1)


@Batched
def _of_robot(tree: Tree, arrays: tuple[Series], _: Any, form: Callable[..., Any], static: tuple[Any, ...]) -> Any:
    def energies(q: Any, order: int) -> Jet:
        frames = body_frames(tree, q).without_base()
        return total(total(components(part)) for part in robot_energy(tree, frames, order))[0]

    return form(energies, arrays[0], *static)


def _evaluated(
    system: Robot | Motion, q: ArrayLike | None, least: int, form: Callable[..., Any], *static: Any, power: int = 0
) -> Any:
    """Return what a form gives for a robot, (..., levels, n), or for the drivers of a motion, labelled.

    It is in units of forces, divided by a power of s.

    Raises
    ------
    RobotError, MechanismError
        If q does not fit the robot or has too few derivatives, or the motion is not that of a driven mechanism.
    """
    if isinstance(system, Motion):
        return in_driver_coordinates(system, q, least, form, static, power=power)
    return _of_robot(system, (checked_coordinates(system, q, least, least),), (), (form, static))


@overload
def energy_slope(
    system: Robot, q: ArrayLike, *, m: int, order: int = 1, rate: int = 0, rates: int = 0
) -> Float[Numbers, "*batch derivative joint"]: ...
@overload
def energy_slope(
    system: Motion, q: None = None, *, m: int, order: int = 1, rate: int = 0, rates: int = 0
) -> "xarray.DataArray": ...
def energy_slope(
    system: Robot | Motion, q: ArrayLike | None = None, *, m: int, order: int = 1, rate: int = 0, rates: int = 0
) -> "Numbers | xarray.DataArray":
    """Return the derivative of a rate of an energy with respect to ``q^(m)``: the terms of Negrean 2025, 126-134.

    ``dE_p^(n) / dq^(m)``, where ``E_p^(n)`` is a function of ``q, q', ..., q^(p + 1 + n)`` and all but one of them are
    held.

    Parameters
    ----------
    system : Robot or Motion
        A robot; gravity does not count. Or the motion of a mechanism whose bodies have masses: its coordinates are the
        laws of its drivers.
    q : array_like of shape (..., K + 1, n), optional
        Coordinates of a robot and their derivatives, K at least order + rate + rates + 1.
    m : int
        Which derivative of the coordinates it is differentiated by; beyond order + rate + 1 all slopes are zero.
    order : int, default 1
        The order p of the energy; 0 is the kinetic energy.
    rate : int, default 0
        The number n of time derivatives of the energy.
    rates : int, default 0
        How many rates in time of the slope itself are wanted.

    Returns
    -------
    array of shape (..., rates + 1, n)
        For a motion an `xarray.DataArray` of dimensions time, derivative and driver, with the unit of each driver.

    Raises
    ------
    RobotError, MechanismError
        If q does not fit the robot or has too few derivatives, the mechanism is not driven in all that can move, or a
        number is none.

    Examples
    --------
    >>> import jounce as jn
    >>> slide = jn.robot.JointAxis([1, 0, 0], type="prismatic", inertia=jn.Inertia(2.0))
    >>> robot, q = jn.robot.from_screws([slide]), [[0.0], [3.0], [5.0], [7.0]]
    >>> jn.energy_slope(robot, q, m=2).tolist()  # of half the mass times the square of the acceleration
    [[10.0]]
    >>> jn.energy_slope(robot, q, m=2, rate=1).round(12).tolist()  # of the mass times acceleration and jerk
    [[14.0]]
    """
    numbers = {"m": m, "order": order, "rate": rate, "rates": rates}
    error = error_for(system)
    m, order, rate, rates = (whole_number(name, value, error=error) for name, value in numbers.items())
    least, power = order + rate + rates + 1, 2 * order + rate - m
    return _evaluated(system, q, least, _slope, rates + 1, order, rate, m, power=power)


def lagrange(system: Robot | Motion, q: ArrayLike | None = None, rates: int = 0) -> Any:
    """Return the generalised inertia forces by Lagrange's equations: Negrean 2025, equation 126.

    ``Q_i = d/dt (dE_0 / dq') - dE_0 / dq`` with the kinetic energy E_0.

    Parameters
    ----------
    system : Robot or Motion
        A robot; gravity does not count. Or the motion of a mechanism whose bodies have masses: its coordinates are the
        laws of its drivers, and the forces are those that the inertia of all bodies asks of the drivers.
    q : array_like of shape (..., K + 1, n), optional
        Coordinates of a robot and their derivatives, K at least rates + 2.
    rates : int, default 0
        How many rates are wanted.

    Returns
    -------
    array of shape (..., rates + 1, n)
        Forces and their rates, N m or N by s. For a motion an `xarray.DataArray` of dimensions time, derivative and
        driver, with the unit of each driver.

    Raises
    ------
    RobotError, MechanismError
        If q does not fit the robot or has too few derivatives, or the motion is not that of a driven mechanism.

    Examples
    --------
    >>> import jounce as jn
    >>> slide = jn.robot.JointAxis([1, 0, 0], type="prismatic", inertia=jn.Inertia(2.0))
    >>> lagrange(jn.robot.from_screws([slide]), [[0.0], [3.0], [5.0], [7.0]], rates=1).round(12).tolist()
    [[10.0], [14.0]]
    """
    rates = whole_number("rates", rates, error=error_for(system))
    return _evaluated(system, q, rates + 2, _lagrange, rates + 1)


def mangeron_nielsen(system: Robot | Motion, q: ArrayLike | None = None, rates: int = 0, m: int = 1) -> Any:
    """Return the generalised inertia forces by Mangeron's equations: Negrean 2025, equation 127.

    ``Q_i = 1/m (dE_0^(m) / dq^(m) - (m + 1) dE_0 / dq)``; m = 1 are Nielsen's equations.

    Parameters
    ----------
    system, q, rates
        As for `lagrange`, with K at least rates + m + 1.
    m : int, default 1
        Order of the derivatives, 1 or more.

    Returns
    -------
    array of shape (..., rates + 1, n)
        Forces and their rates, N m or N by s. For a motion an `xarray.DataArray` of dimensions time, derivative and
        driver, with the unit of each driver.

    Raises
    ------
    RobotError, MechanismError
        If q does not fit the robot or has too few derivatives, or the motion is not that of a driven mechanism.

    Examples
    --------
    >>> import jounce as jn
    >>> slide = jn.robot.JointAxis([1, 0, 0], type="prismatic", inertia=jn.Inertia(2.0))
    >>> mangeron_nielsen(jn.robot.from_screws([slide]), [[0.0], [3.0], [5.0], [7.0]], m=2).tolist()
    [[10.0]]
    """
    m, rates = whole_number("m", m, 1, error=error_for(system)), whole_number("rates", rates, error=error_for(system))
    return _evaluated(system, q, rates + m + 1, _mangeron, rates + 1, m)


def gibbs_appell(system: Robot | Motion, q: ArrayLike | None = None, rates: int = 0, m: int = 2) -> Any:
    """Return the generalised inertia forces by the Gibbs-Appell equations: Negrean 2025, equation 128.

    ``Q_i = dE_1^(m-2) / dq^(m)`` with the acceleration energy E_1 of first order.

    Parameters
    ----------
    system, q, rates
        As for `lagrange`, with K at least rates + m.
    m : int, default 2
        Order of the derivatives, 2 or more.

    Returns
    -------
    array of shape (..., rates + 1, n)
        Forces and their rates, N m or N by s. For a motion an `xarray.DataArray` of dimensions time, derivative and
        driver, with the unit of each driver.

    Raises
    ------
    RobotError, MechanismError
        If q does not fit the robot or has too few derivatives, or the motion is not that of a driven mechanism.

    Examples
    --------
    >>> import jounce as jn
    >>> slide = jn.robot.JointAxis([1, 0, 0], type="prismatic", inertia=jn.Inertia(2.0))
    >>> gibbs_appell(jn.robot.from_screws([slide]), [[0.0], [3.0], [5.0], [7.0]], rates=1).round(12).tolist()
    [[10.0], [14.0]]
    """
    m, rates = whole_number("m", m, 2, error=error_for(system)), whole_number("rates", rates, error=error_for(system))
    return _evaluated(system, q, rates + m, _gibbs_appell, rates + 1, m)


def higher_order(
    system: Robot | Motion,
    q: ArrayLike | None = None,
    k: int = 1,
    m: int | None = None,
    coefficients: Callable[[int], float] = catalan,
) -> Any:
    """Return the (k - 1)-th rate of the generalised inertia forces by the higher-order equations.

    Negrean 2025, equations 129-134, corrected: ``Q_i^(k-1) = (k-1)! m! / (m+k-1)! d/dq^(m) sum_p C_p
    E_p^(m+k-2p-1)``, p = 1 to k, with the Catalan numbers C_p, which the paper prints wrongly from p = 4 on.

    Parameters
    ----------
    system, q
        As for `lagrange`, with K at least m + k - 1.
    k : int, default 1
        1 gives the forces, 2 their first rate, and so on.
    m : int, optional
        Order of the derivatives, k + 1 or more; k + 1 unless given.
    coefficients : callable, default catalan
        Maps p to C_p, so that others can be tried.

    Returns
    -------
    array of shape (..., n)
        N m or N by s^(k - 1). For a motion an `xarray.DataArray` of dimensions time and driver, with
        the unit of each driver.

    Raises
    ------
    RobotError, MechanismError
        If q does not fit the robot or has too few derivatives, the motion is not that of a driven mechanism, or m is
        too small.

    Examples
    --------
    >>> import jounce as jn
    >>> slide = jn.robot.JointAxis([1, 0, 0], type="prismatic", inertia=jn.Inertia(2.0))
    >>> q = [[0.0], [3.0], [5.0], [7.0], [11.0]]
    >>> higher_order(jn.robot.from_screws([slide]), q, k=2).round(12).tolist()
    [14.0]
    """
    k = whole_number("k", k, 1, error=error_for(system))
    m = k + 1 if m is None else whole_number("m", m, k + 1, error=error_for(system))
    weights = tuple(float(coefficients(p)) for p in range(1, k + 1))
    values = _evaluated(system, q, m + k - 1, _higher_order, k, m, weights, power=k - 1)
    return values[:, 0] if isinstance(system, Motion) else values[..., 0, :]
