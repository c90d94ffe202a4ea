"""The energy forms of the equations of motion, for comparison. Negrean 2025, equations 126-134.

All give the generalized inertia forces Q_i and their rates, and agree with `virtual_work` and `newton_euler` to
rounding; to compute forces, use `jounce.inverse_dynamics`. Each form is a sum of partial derivatives of energies with
respect to ``q^(m)``, which `slopes` evaluates in closed form: the forms differ only in the weights of the same
products, and products that cancel are not computed. `energy_slope` returns one such derivative. The coordinates are
those of the robot; the laws of the drivers for a driven mechanism (`driver_coordinates`); or the coordinates of the
bodies for a mechanism that moves freely (`body_coordinates`), where ``Q + Phi_q^T lambda`` is the applied force.
"""

import math
from collections.abc import Callable
from fractions import Fraction
from typing import TYPE_CHECKING, Any, overload

from jaxtyping import Float

from jounce.base.shapes import ArrayLike, Numbers
from jounce.dynamics.energy.body_coordinates import in_body_coordinates
from jounce.dynamics.energy.driver_coordinates import in_driver_coordinates, is_driven
from jounce.dynamics.energy.energies import error_for, mass_arrays
from jounce.dynamics.energy.slopes import Columns, Form, Slope, slope_values
from jounce.errors import MechanismError, whole_number
from jounce.kinematics import Motion
from jounce.robot.algorithms.equations_of_motion import partial_velocities
from jounce.robot.model.arguments import checked_coordinates
from jounce.robot.model.tree import Tree
from jounce.robot.recursions.batches import Batched
from jounce.robot.recursions.kinematics import body_frames
from jounce.robot.recursions.tree_scan import Series, to_coordinates
from jounce.robot.robot import Robot

if TYPE_CHECKING:
    import xarray


def catalan(p: int) -> int:
    """Return the Catalan number C_p = 1, 2, 5, 14, 42, ... for p = 1, 2, ...: the correct coefficient of equation 134.

    Examples
    --------
    >>> [catalan(p) for p in range(1, 6)]
    [1, 2, 5, 14, 42]
    """
    return math.comb(2 * p, p) // (p + 1)


def printed_coefficient(p: int) -> int:
    """Return ``p (p + 1) / 2 - delta_p``, the coefficient that equation 134 prints: correct for p <= 3 only.

    Examples
    --------
    >>> [printed_coefficient(p) for p in range(1, 6)]
    [1, 2, 5, 9, 14]
    """
    return p * (p + 1) // 2 - (p > 1)


@Batched
def _of_robot(tree: Tree, arrays: tuple[Series], _: Any, form: Form) -> Any:
    frames = body_frames(tree, arrays[0]).without_base()
    columns = Columns(*partial_velocities(tree, frames.truncate(form.column_order)))
    return to_coordinates(tree, slope_values(form, frames, columns, *mass_arrays(tree)))


def _evaluated(system: Robot | Motion, q: ArrayLike | None, *slopes: Slope, rates: int = 0, power: int = 0) -> Any:
    """Return a sum of slopes for a robot, (..., rates + 1, n), or a labeled one for the drivers or bodies of a motion.

    Its unit is that of force, divided by s^power.

    Raises
    ------
    RobotError, MechanismError
        If q does not fit the robot or has too few derivatives, or the motion has too few.
    """
    form = Form(slopes, rates + 1)
    if isinstance(system, Motion):
        if q is not None:
            raise MechanismError("a motion has its coordinates already", name="q", value=q)
        place = in_driver_coordinates if is_driven(system) else in_body_coordinates
        return place(system, form, power=power)
    return _of_robot(system, (checked_coordinates(system, q, form.order, form.order),), (), (form,))


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

    ``dE_p^(n) / dq^(m)``, where ``E_p^(n)`` is a function of ``q, q', ..., q^(p + 1 + n)``, and all arguments but
    ``q^(m)`` are held constant.

    Parameters
    ----------
    system : Robot or Motion
        A robot, without gravity, or the motion of a mechanism whose bodies have masses. The coordinates of a mechanism
        are the laws of its drivers. Where these do not prescribe the whole motion, as in a simulation, they are those
        of its bodies: global positions of the origins, and angles; in space, small rotations about the body axes.
    q : array_like of shape (..., K + 1, n), optional
        Coordinates of a robot and their derivatives. K = order + rate + rates + 1 suffices; the slope does not depend
        on derivatives beyond 2 order + rate + rates + 2 - m.
    m : int
        Order of the derivative ``q^(m)``; beyond order + rate + 1 all slopes are zero.
    order : int, default 1
        The order p of the energy; 0 is the kinetic energy.
    rate : int, default 0
        The number n of time derivatives of the energy.
    rates : int, default 0
        Number of time derivatives of the slope.

    Returns
    -------
    array of shape (..., rates + 1, n)
        For a motion an `xarray.DataArray` with dimensions time, derivative and driver, and the unit of each driver; in
        body coordinates with dimension column, "BODY.x", ..., as from `constraint_equations`, instead of driver.

    Raises
    ------
    RobotError, MechanismError
        If q does not fit the robot, q or the motion has too few derivatives, or an order is not a whole number.

    Examples
    --------
    >>> import jounce as jn
    >>> slide = jn.robot.JointAxis([1, 0, 0], type="prismatic", inertia=jn.Inertia(2.0))
    >>> robot, q = jn.robot.from_screws([slide]), [[0.0], [3.0], [5.0], [7.0]]
    >>> jn.energy.energy_slope(robot, q, m=2).tolist()  # of half the mass times the square of the acceleration
    [[10.0]]
    >>> jn.energy.energy_slope(robot, q, m=2, rate=1).round(12).tolist()  # of the mass times acceleration and jerk
    [[14.0]]
    """
    numbers = {"m": m, "order": order, "rate": rate, "rates": rates}
    error = error_for(system)
    m, order, rate, rates = (whole_number(name, value, error=error) for name, value in numbers.items())
    return _evaluated(system, q, Slope(order, rate, m), rates=rates, power=2 * order + rate - m)


def lagrange(system: Robot | Motion, q: ArrayLike | None = None, rates: int = 0) -> "Numbers | xarray.DataArray":
    """Return the generalized inertia forces by Lagrange's equations: Negrean 2025, equation 126.

    ``Q_i = d/dt (dE_0 / dq') - dE_0 / dq`` with the kinetic energy E_0.

    Parameters
    ----------
    system : Robot or Motion
        A robot, without gravity, or the motion of a mechanism whose bodies have masses. The coordinates of a mechanism
        are the laws of its drivers, and the forces are those that drivers exert against inertia. Where drivers do not
        prescribe the whole motion, as in a simulation, the coordinates are those of the bodies, and the forces are the
        inertia forces that constraints, weight and applied forces balance: at the body origins, forces in global axes,
        moments in body axes.
    q : array_like of shape (..., K + 1, n), optional
        Coordinates of a robot and their derivatives, K at least rates + 2.
    rates : int, default 0
        Number of rates.

    Returns
    -------
    array of shape (..., rates + 1, n)
        Forces and their rates, N m or N by s. For a motion an `xarray.DataArray` with dimensions time, derivative and
        driver, and the unit of each driver; in body coordinates with dimension column, "BODY.x", ..., as from
        `constraint_equations`, instead of driver.

    Raises
    ------
    RobotError, MechanismError
        If q does not fit the robot or has too few derivatives, or the motion has too few.

    Examples
    --------
    >>> import jounce as jn
    >>> slide = jn.robot.JointAxis([1, 0, 0], type="prismatic", inertia=jn.Inertia(2.0))
    >>> lagrange(jn.robot.from_screws([slide]), [[0.0], [3.0], [5.0], [7.0]], rates=1).round(12).tolist()
    [[10.0], [14.0]]
    """
    rates = whole_number("rates", rates, error=error_for(system))
    return _evaluated(system, q, Slope(0, 0, 1, rate=1), Slope(0, 0, 0, factor=Fraction(-1)), rates=rates)


def mangeron_nielsen(
    system: Robot | Motion, q: ArrayLike | None = None, rates: int = 0, m: int = 1
) -> "Numbers | xarray.DataArray":
    """Return the generalized inertia forces by Mangeron's equations: Negrean 2025, equation 127.

    ``Q_i = 1/m (dE_0^(m) / dq^(m) - (m + 1) dE_0 / dq)``; m = 1 gives Nielsen's equations.

    Parameters
    ----------
    system, q, rates
        As for `lagrange`; derivatives beyond rates + 2 do not enter.
    m : int, default 1
        Order of the derivatives, 1 or more.

    Returns
    -------
    array of shape (..., rates + 1, n)
        Forces and their rates, as from `lagrange`.

    Raises
    ------
    RobotError, MechanismError
        If q does not fit the robot or has too few derivatives, or the motion has too few.

    Examples
    --------
    >>> import jounce as jn
    >>> slide = jn.robot.JointAxis([1, 0, 0], type="prismatic", inertia=jn.Inertia(2.0))
    >>> mangeron_nielsen(jn.robot.from_screws([slide]), [[0.0], [3.0], [5.0], [7.0]], m=2).tolist()
    [[10.0]]
    """
    m, rates = whole_number("m", m, 1, error=error_for(system)), whole_number("rates", rates, error=error_for(system))
    slopes = Slope(0, m, m, factor=Fraction(1, m)), Slope(0, 0, 0, factor=Fraction(-m - 1, m))
    return _evaluated(system, q, *slopes, rates=rates)


def gibbs_appell(
    system: Robot | Motion, q: ArrayLike | None = None, rates: int = 0, m: int = 2
) -> "Numbers | xarray.DataArray":
    """Return the generalized inertia forces by the Gibbs-Appell equations: Negrean 2025, equation 128.

    ``Q_i = dE_1^(m-2) / dq^(m)`` with the acceleration energy E_1 of first order.

    Parameters
    ----------
    system, q, rates
        As for `lagrange`; derivatives beyond rates + 2 do not enter.
    m : int, default 2
        Order of the derivatives, 2 or more.

    Returns
    -------
    array of shape (..., rates + 1, n)
        Forces and their rates, as from `lagrange`.

    Raises
    ------
    RobotError, MechanismError
        If q does not fit the robot or has too few derivatives, or the motion has too few.

    Examples
    --------
    >>> import jounce as jn
    >>> slide = jn.robot.JointAxis([1, 0, 0], type="prismatic", inertia=jn.Inertia(2.0))
    >>> gibbs_appell(jn.robot.from_screws([slide]), [[0.0], [3.0], [5.0], [7.0]], rates=1).round(12).tolist()
    [[10.0], [14.0]]
    """
    m, rates = whole_number("m", m, 2, error=error_for(system)), whole_number("rates", rates, error=error_for(system))
    return _evaluated(system, q, Slope(1, m - 2, m), rates=rates)


def higher_order(
    system: Robot | Motion,
    q: ArrayLike | None = None,
    k: int = 1,
    m: int | None = None,
    coefficients: Callable[[int], float] = catalan,
) -> "Numbers | xarray.DataArray":
    """Return the (k - 1)-th rate of the generalized inertia forces by the higher-order equations.

    Negrean 2025, equations 129-134, corrected: ``Q_i^(k-1) = (k-1)! m! / (m+k-1)! d/dq^(m) sum_p C_p
    E_p^(m+k-2p-1)``, p = 1 to k, with the Catalan numbers C_p. The paper misprints them from p = 4 on.

    Parameters
    ----------
    system, q
        As for `lagrange`, with K at least k + 1; higher derivatives do not enter.
    k : int, default 1
        1 gives the forces, 2 their first rate, and so on.
    m : int, optional
        Order of the derivatives, k + 1 or more; k + 1 by default.
    coefficients : callable, default catalan
        Function from p to C_p, to try other coefficients.

    Returns
    -------
    array of shape (..., n)
        N m or N by s^(k - 1). For a motion an `xarray.DataArray` with dimensions time and driver, or time and column,
        and their units.

    Raises
    ------
    RobotError, MechanismError
        If q does not fit the robot or has too few derivatives, or the motion has too few, or m is too small.

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
    scale = Fraction(math.factorial(k - 1) * math.factorial(m), math.factorial(m + k - 1))
    weights = ((p, Fraction(coefficients(p))) for p in range(1, k + 1))
    slopes = [Slope(p, m + k - 2 * p - 1, m, factor=scale * weight) for p, weight in weights]
    values = _evaluated(system, q, *slopes, power=k - 1)
    return values[:, 0] if isinstance(system, Motion) else values[..., 0, :]
