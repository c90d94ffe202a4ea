"""Deflection of damped springs under varying torques: ``K x + D x' = tau``, solved along a trajectory.

Every derivative of the deflection obeys the same equation with the same derivative of the torque. From one node to the
next, the solution is a weighted mean of the past torque, with weights that decay with the time constant D / K. The
integrals of Legendre polynomials with these weights are spherical Bessel functions, so that stiff springs (a time
constant far below the step) are as exact as soft ones. No nearly equal numbers are subtracted.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Array
from jounce.errors import TrajectoryError
from jounce.planning.elastic.pieces import ANALYSIS, POINTS, points_of, resolved
from jounce.units.instants import time_text

ROUNDING = 1e-14  # fraction of the largest torque of all joints, or of its derivative
JUMP = 1e-6  # fraction of the largest value: less is rounding
LARGE = 100.0  # arguments from which the finite sum for Bessel functions of half order is exact

Torques = Callable[[np.ndarray], np.ndarray]
"""Function from instants, (time,), to torques of the springs and their derivatives, (time, levels, joints)."""


class SpringDeflection:
    """The deflections of springs along a trajectory, and their derivatives.

    With damping, solutions differ by a term that decays with the time constant T = D / K. The initial deflection is the
    regular expansion ``(tau - T tau' + T^2 tau'' - ...) / K``, to the order of the derivatives or as long as its terms
    decrease, so that a trajectory that starts at rest starts with a spring at rest.

    Parameters
    ----------
    torques : callable
        See `Torques`.
    stiffness, time_constant : array of shape (joints,)
        Stiffnesses and time constants of the springs.
    nodes : array of shape (nodes,)
        First nodes: increasing instants from the start to the stop, s, which include knots and the instants of results.
    names : tuple of str
        Names of the joints, for messages.

    Raises
    ------
    TrajectoryError
        If a torque, or a derivative below the last, jumps, as the other end of the spring would have to jump too.
    """

    def __init__(
        self,
        torques: Torques,
        stiffness: Float[np.ndarray, " joint"],
        time_constant: Float[np.ndarray, " joint"],
        nodes: Float[np.ndarray, " nodes"],
        names: tuple[str, ...],
    ):
        self.torques, self.stiffness, self.time_constant = torques, stiffness, time_constant
        self.damped = np.flatnonzero(time_constant > 0)
        at_nodes = torques(nodes)
        self.levels = at_nodes.shape[1]
        peaks = np.abs(at_nodes).max(axis=0)
        floor = np.broadcast_to(ROUNDING * peaks.max(axis=1, keepdims=True), peaks.shape)

        def flat(times: np.ndarray) -> np.ndarray:
            return torques(times).reshape(len(times), -1)

        self.pieces = resolved(flat, nodes, floor.reshape(-1))
        self.at_nodes = at_nodes if len(self.pieces.nodes) == len(nodes) else torques(self.pieces.nodes)
        self._check_jumps(names)
        self.solution = self._solved()

    def _check_jumps(self, names: tuple[str, ...]) -> None:
        """Raise TrajectoryError if a derivative is not the integral of the next one."""
        changes = np.diff(self.at_nodes[:, :-1], axis=0)
        integrals = self.pieces.integrals.reshape(len(changes), self.levels, -1)[:, 1:]
        size = np.abs(self.at_nodes[:, :-1]).max(axis=0)
        gap = np.abs(changes - integrals)
        ratios = gap / np.maximum(size + 1e-6 * size.max(axis=1, keepdims=True), 1e-300)
        if (ratios > JUMP).any():
            index, level, joint = np.unravel_index(np.argmax(ratios), ratios.shape)
            time, jump = self.pieces.nodes[index + 1], gap[index, level, joint]
            derivative = ("position", "velocity")[level] if level < 2 else f"derivative {level}"
            need = ("acceleration", "jerk", "jounce")[level] if level < 3 else f"derivative {level + 2}"
            message = (
                f"the {f'rate {level} of the ' if level else ''}torque of the spring jumps by {jump:.3g} near "
                f"t = {time_text(time)} s, and the {derivative} of its motor would have to jump too; "
                "choose a trajectory "
                f"whose derivatives are continuous to {need}"
            )
            raise TrajectoryError(message, name=names[joint])

    def _solved(self) -> Float[np.ndarray, "nodes level joint"]:
        """Return the deflections at the nodes, from one linear recurrence for all joints."""
        from scipy.linalg import solve_banded  # importing SciPy takes half a second

        deflection = self.at_nodes / self.stiffness
        if not len(self.damped):
            return deflection
        constant, stiffness = self.time_constant[self.damped], self.stiffness[self.damped]
        steps = np.diff(self.pieces.nodes)[:, None] / constant
        count, joints = steps.shape
        values = self.pieces.values.reshape(count, POINTS, self.levels, -1)[..., self.damped]
        gained = np.einsum("pjg,pglj->jpl", mean_weights(steps), values) / stiffness[:, None, None]
        right = np.concatenate([self._first()[:, None], gained], axis=1).reshape(-1, self.levels)
        subdiagonal = np.zeros((joints, count + 1))
        subdiagonal[:, :-1] = -np.exp(-steps).T
        bands = np.stack([np.ones(joints * (count + 1)), subdiagonal.reshape(-1)])
        solution = solve_banded((1, 0), bands, right).reshape(joints, count + 1, self.levels)
        deflection[..., self.damped] = np.moveaxis(solution, 0, -1)
        return deflection

    def _first(self) -> Float[np.ndarray, "joint level"]:
        """Return the initial deflections of damped joints: the regular expansion, truncated where its terms grow."""
        constant, stiffness = self.time_constant[self.damped], self.stiffness[self.damped]
        torque = self.at_nodes[0][:, self.damped]
        sizes = np.abs(self.at_nodes[..., self.damped]).max(axis=0) * constant ** np.arange(self.levels)[:, None]
        rising = np.concatenate([sizes[1:] >= sizes[:-1], np.ones((1, len(constant)), bool)])
        last_order = np.argmax(rising, axis=0)  # the last term before the first that is larger
        deflection = np.zeros_like(torque)
        for level in range(self.levels):  # each follows from lower levels
            terms = np.arange(self.levels - level)[:, None]
            is_included = terms <= last_order - level
            expanded = np.sum(np.where(is_included, (-constant) ** terms * torque[level:], 0.0), axis=0) / stiffness
            continued = 0.0 if level == 0 else (torque[level - 1] / stiffness - deflection[level - 1]) / constant
            deflection[level] = np.where(level <= last_order, expanded, continued)
        return deflection.T

    def at(self, times: Array[np.ndarray, " time"]) -> Array[np.ndarray, "time level joint"]:
        """Return the deflections and their derivatives at instants of the trajectory."""
        nodes = self.pieces.nodes
        if not len(self.damped):
            return self.torques(times) / self.stiffness
        cell = np.clip(np.searchsorted(nodes, times, side="right") - 1, 0, len(nodes) - 1)
        deflection = self.solution[cell]
        inner = np.flatnonzero(times > nodes[cell])
        if not len(inner):
            return deflection
        start, stop = nodes[cell[inner]], times[inner]
        constant, stiffness = self.time_constant[self.damped], self.stiffness[self.damped]
        instants = np.concatenate([points_of(start, stop).reshape(-1), stop])
        torques = self.torques(instants)
        values, stop_torques = torques[: -len(stop)].reshape(len(start), POINTS, self.levels, -1), torques[-len(stop) :]
        steps = (stop - start)[:, None] / constant
        gained = np.einsum("pjg,pglj->plj", mean_weights(steps), values[..., self.damped]) / stiffness
        stop_deflection = stop_torques / self.stiffness
        stop_deflection[..., self.damped] = np.exp(-steps)[:, None] * deflection[inner][..., self.damped] + gained
        deflection[inner] = stop_deflection
        return deflection

    def expansion_errors(self) -> Array[np.ndarray, "order joint"]:
        """Return the error of the regular expansion, truncated after each order, relative to the peak deflection."""
        terms = self.at_nodes * (-self.time_constant) ** np.arange(self.levels)[:, None] / self.stiffness
        missed = np.abs(np.cumsum(terms, axis=1) - self.solution[:, :1]).max(axis=0)
        return missed / np.maximum(np.abs(self.solution[:, 0]).max(axis=0), 1e-300)


def mean_weights(steps: Float[np.ndarray, "*shape"]) -> Float[np.ndarray, "*shape points"]:
    """Return the weights of values at the Gauss points in an exponentially weighted mean over the past.

    The mean is the integral of ``exp(-(h - s) / T) f(s) / T`` over a step h. For a Legendre polynomial of degree k it
    is ``h/T exp(-a) i_k(a)``, where a = h / 2T and i_k is the modified spherical Bessel function of the first kind.

    Parameters
    ----------
    steps : array of shape (...)
        h / T, greater than zero.
    """
    from scipy.special import factorial, ive

    a = 0.5 * steps[..., None]
    degrees = np.arange(POINTS)
    bounded = np.minimum(a, LARGE)
    exact = 2.0 * bounded * np.sqrt(np.pi / (2.0 * bounded)) * ive(degrees + 0.5, bounded)
    j = np.arange(POINTS)
    with np.errstate(over="ignore"):
        inverse = 1.0 / (2.0 * np.maximum(a, LARGE))
    factors = np.where(j <= degrees[:, None], factorial(degrees[:, None] + j) / factorial(j), 0.0)
    factors = factors / factorial(np.maximum(degrees[:, None] - j, 0))
    asymptotic = np.sum(factors * (-inverse[..., None]) ** j, axis=-1)
    return np.where(a < LARGE, exact, asymptotic) @ ANALYSIS
