"""The equations of motion from energies, in every form, for a reader to compare. Negrean 2025, equations 126-134.

All give the generalised inertia forces Q_i of a robot and their rates, and agree to rounding with those of
`virtual_work` and `newton_euler`; for work, `jounce.inverse_dynamics` is the one to use. They rest on the partial
derivatives of energies with respect to ``q^(m)``. As a jet has no separate velocity, the series in time of such a
partial derivative is found from perturbations ``s^r / r!`` of the motion itself: to first order they change an energy
by ``sum_r s^(m-r) / (m-r)! dE/dq^(r)``, which is solved for the last term.
"""

import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jounce.dynamics.energies import robot_energy
from jounce.errors import RobotError
from jounce.jet import components
from jounce.jet.algebra import stacked, total
from jounce.robot.batches import Batched, checked
from jounce.robot.kinematics import body_frames
from jounce.robot.robot import Robot
from jounce.robot.tree import Tree


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


def energy_slope(tree: Tree, q: Any, order: int, rate: int, m: int, levels: int) -> Any:
    """Return the series in time of ``dE_p^(n) / dq^(m)``, as Taylor coefficients (levels, coordinates, batch).

    Parameters
    ----------
    tree : Tree
        Arrays of the robot.
    q : array of shape (K + 1, coordinates, batch)
        Taylor coefficients of the coordinates; K at least order + rate + levels.
    order, rate : int
        Order p of the energy, and the number n of its time derivatives.
    m : int
        Which derivative of the coordinates it is differentiated by.
    levels : int
        How many coefficients are wanted; one is the value.
    """
    coordinates = tree.shape.coordinates
    least = max(order + 1 + rate + levels - 1, m)
    q = jnp.concatenate([q, jnp.zeros((max(0, least + 1 - q.shape[0]), *q.shape[1:]))])[: least + 1]

    def energy(q: Any) -> Any:
        frames = body_frames(tree, q).without_base()
        jet = total(total(components(part)) for part in robot_energy(tree, frames, order))
        for _ in range(rate):
            jet = jet.differentiate()
        return stacked(jet.truncate(levels - 1))[:, 0]

    _, slope = jax.linearize(energy, q)
    series = []
    for r in range(m + 1):
        shift = m - r
        if shift >= levels:  # these terms vanish at the instant itself
            continue
        directions = np.zeros((coordinates, *q.shape[:2], 1))
        directions[np.arange(coordinates), r, np.arange(coordinates)] = 1 / math.factorial(r)
        changes = jax.vmap(slope, out_axes=1)(jnp.broadcast_to(directions, (coordinates, *q.shape)))
        series.append((shift, (-1) ** shift / math.factorial(shift) * changes))
    pads = (jnp.concatenate([jnp.zeros((shift, *c.shape[1:])), c[: levels - shift]]) for shift, c in series)
    return total(pads)


@Batched
def _lagrange(tree: Tree, arrays: Any, _: Any, levels: int) -> Any:
    momentum = energy_slope(tree, arrays[0], 0, 0, 1, levels + 1)
    rate = momentum[1:] * np.arange(1.0, levels + 1)[:, None, None]
    return rate - energy_slope(tree, arrays[0], 0, 0, 0, levels)


@Batched
def _mangeron(tree: Tree, arrays: Any, _: Any, levels: int, m: int) -> Any:
    slope = energy_slope(tree, arrays[0], 0, m, m, levels)
    return (slope - (m + 1) * energy_slope(tree, arrays[0], 0, 0, 0, levels)) / m


@Batched
def _gibbs_appell(tree: Tree, arrays: Any, _: Any, levels: int, m: int) -> Any:
    return energy_slope(tree, arrays[0], 1, m - 2, m, levels)


@Batched
def _higher_order(tree: Tree, arrays: Any, _: Any, k: int, m: int, weights: tuple[float, ...]) -> Any:
    q = arrays[0]

    def weighted(highest: Any) -> Any:
        """Return the weighted sum of the rates of energies, as it depends on the m-th coefficients alone."""
        frames = body_frames(tree, jnp.concatenate([q[:m], highest[None], q[m + 1 :]])).without_base()
        terms = []
        for p, weight in enumerate(weights, 1):
            rate = m + k - 2 * p - 1
            scale = weight * math.factorial(rate)
            terms += [scale * part.coefficients[rate] for part in robot_energy(tree, frames, p)]
        return total(components(total(terms)))[0]

    _, slope = jax.linearize(weighted, q[m])
    directions = np.eye(tree.shape.coordinates)[:, :, None] * np.ones(q.shape[-1])
    return (math.factorial(k - 1) / math.factorial(m + k - 1)) * jax.vmap(slope)(directions)[None]


def checked_levels(robot: Robot, q: Any, rates: int, least: int) -> tuple[Any, int]:
    """Return the derivatives of q to order `least`, and how many forces and rates are wanted.

    Raises
    ------
    RobotError
        If q does not fit the robot or has too few derivatives.
    """
    rates = _whole("rates", rates, 0)
    q = checked(robot, q, 0)
    if q.shape[-2] < least + 1:
        message = f"{rates} {'rate' if rates == 1 else 'rates'} in this form need derivatives of q to order {least}"
        raise RobotError(message, name="q", value=q.shape)
    return q[..., : least + 1, :], rates + 1


def lagrange(robot: Robot, q: Any, rates: int = 0) -> Any:
    """Return the generalised inertia forces by Lagrange's equations: Negrean 2025, equation 126.

    ``Q_i = d/dt (dE_0 / dq') - dE_0 / dq`` with the kinetic energy E_0.

    Parameters
    ----------
    robot : Robot
        The robot; gravity does not count.
    q : array_like of shape (..., K + 1, n)
        Coordinates and their derivatives, K at least rates + 2.
    rates : int, default 0
        How many rates are wanted.

    Returns
    -------
    array of shape (..., rates + 1, n)
        Forces and their rates, N m or N by s.

    Raises
    ------
    RobotError
        If q does not fit the robot or has too few derivatives.

    Examples
    --------
    >>> import jounce as jn
    >>> slide = jn.robot.Screw([1, 0, 0], type="prismatic", inertia=jn.Inertia(2.0))
    >>> lagrange(jn.robot.from_screws([slide]), [[0.0], [3.0], [5.0], [7.0]], rates=1).round(12).tolist()
    [[10.0], [14.0]]
    """
    q, levels = checked_levels(robot, q, rates, rates + 2)
    return _lagrange(robot, (q,), (), (levels,))


def mangeron_nielsen(robot: Robot, q: Any, rates: int = 0, m: int = 1) -> Any:
    """Return the generalised inertia forces by Mangeron's equations: Negrean 2025, equation 127.

    ``Q_i = 1/m (dE_0^(m) / dq^(m) - (m + 1) dE_0 / dq)``; m = 1 are Nielsen's equations.

    Parameters
    ----------
    robot, q, rates
        As for `lagrange`, with K at least rates + m + 1.
    m : int, default 1
        Order of the derivatives, 1 or more.

    Returns
    -------
    array of shape (..., rates + 1, n)
        Forces and their rates, N m or N by s.

    Raises
    ------
    RobotError
        If q does not fit the robot or has too few derivatives.

    Examples
    --------
    >>> import jounce as jn
    >>> slide = jn.robot.Screw([1, 0, 0], type="prismatic", inertia=jn.Inertia(2.0))
    >>> mangeron_nielsen(jn.robot.from_screws([slide]), [[0.0], [3.0], [5.0], [7.0]], m=2).tolist()
    [[10.0]]
    """
    m = _whole("m", m, 1)
    q, levels = checked_levels(robot, q, rates, rates + m + 1)
    return _mangeron(robot, (q,), (), (levels, m))


def gibbs_appell(robot: Robot, q: Any, rates: int = 0, m: int = 2) -> Any:
    """Return the generalised inertia forces by the Gibbs-Appell equations: Negrean 2025, equation 128.

    ``Q_i = dE_1^(m-2) / dq^(m)`` with the acceleration energy E_1 of first order.

    Parameters
    ----------
    robot, q, rates
        As for `lagrange`, with K at least rates + m.
    m : int, default 2
        Order of the derivatives, 2 or more.

    Returns
    -------
    array of shape (..., rates + 1, n)
        Forces and their rates, N m or N by s.

    Raises
    ------
    RobotError
        If q does not fit the robot or has too few derivatives.

    Examples
    --------
    >>> import jounce as jn
    >>> slide = jn.robot.Screw([1, 0, 0], type="prismatic", inertia=jn.Inertia(2.0))
    >>> gibbs_appell(jn.robot.from_screws([slide]), [[0.0], [3.0], [5.0], [7.0]], rates=1).round(12).tolist()
    [[10.0], [14.0]]
    """
    m = _whole("m", m, 2)
    q, levels = checked_levels(robot, q, rates, rates + m)
    return _gibbs_appell(robot, (q,), (), (levels, m))


def higher_order(
    robot: Robot, q: Any, k: int, m: int | None = None, coefficients: Callable[[int], float] = catalan
) -> Any:
    """Return the (k - 1)-th rate of the generalised inertia forces by the higher-order equations.

    Negrean 2025, equations 129-134, corrected: ``Q_i^(k-1) = (k-1)! m! / (m+k-1)! d/dq^(m) sum_p C_p
    E_p^(m+k-2p-1)``, p = 1 to k, with the Catalan numbers C_p, which the paper prints wrongly from p = 4 on.

    Parameters
    ----------
    robot : Robot
        The robot; gravity does not count.
    q : array_like of shape (..., K + 1, n)
        Coordinates and their derivatives, K at least m + k - 1.
    k : int
        1 gives the forces, 2 their first rate, and so on.
    m : int, optional
        Order of the derivatives, k + 1 or more; k + 1 unless given.
    coefficients : callable, default catalan
        Maps p to C_p, so that others can be tried.

    Returns
    -------
    array of shape (..., n)
        N m or N by s^(k - 1).

    Raises
    ------
    RobotError
        If q does not fit the robot or has too few derivatives, or m is too small.

    Examples
    --------
    >>> import jounce as jn
    >>> slide = jn.robot.Screw([1, 0, 0], type="prismatic", inertia=jn.Inertia(2.0))
    >>> q = [[0.0], [3.0], [5.0], [7.0], [11.0]]
    >>> higher_order(jn.robot.from_screws([slide]), q, k=2).round(12).tolist()
    [14.0]
    """
    k = _whole("k", k, 1)
    m = k + 1 if m is None else _whole("m", m, k + 1)
    q, _ = checked_levels(robot, q, k - 1, m + k - 1)
    weights = tuple(float(coefficients(p)) for p in range(1, k + 1))
    return _higher_order(robot, (q,), (), (k, m, weights))[..., 0, :]


def _whole(name: str, value: Any, least: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise RobotError(f"must be a whole number, {least} or greater", name=name, value=value)
    return int(value)
