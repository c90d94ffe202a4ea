"""The limited quantities of a driven mechanism on the path of its drivers: motion, force, yank, and outputs.

The inertial part of the force of a driver is m s'' + c s'^2 at any speed; two motions of the mechanism without forces
determine it. The rest may depend on the speed in any way. It is expanded about a time law from three motions, at the
speed of the law, slightly slower and slightly faster, and expanded again about the law found with it.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.dynamics import driver_force
from jounce.errors import MechanismError, check_name
from jounce.jet import Jet
from jounce.kinematics import Motion, solve
from jounce.mechanism import Mechanism
from jounce.mechanism.laws.angle_laws import settle
from jounce.mechanism.laws.driver_outputs import is_turning
from jounce.mechanism.time import instants_of
from jounce.planning.paths.path import Path
from jounce.planning.retiming.quantities.path_quantities import Labels, PathQuantities, Quantity
from jounce.planning.retiming.rates.rate_law import RateLaw
from jounce.planning.retiming.rates.rate_motion import RateMotion
from jounce.robot.model.links_and_joints import Limits
from jounce.trajectory import AbstractMotion, Expression, ExpressionMotion, FollowingMotion
from jounce.units.instants import time_text

SAMPLES = 2001
SPEEDS = np.array([0.95, 1.0, 1.05])  # factors of the time law about which forces are expanded
SLOW = 1e-3  # fraction of the mean rate below which a force counts as one at rest
ORDER = 3
TURN = {"velocity": "rad/s", "acceleration": "rad/s^2", "jerk": "rad/s^3", "torque": "N m", "torque rate": "N m/s"}
SLIDE = {"velocity": "m/s", "acceleration": "m/s^2", "jerk": "m/s^3", "force": "N", "force rate": "N/s"}

_Points = Float[np.ndarray, " _"]


class MechanismQuantities:
    """The limited quantities of a mechanism at points of the path of its drivers.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism; the laws of its drivers over its time are the path.
    limits : dict of str to Limits
        Limits of drivers and outputs by name: velocity, acceleration, jerk of drivers and scalar outputs, and effort
        and effort_rate (yank) of drivers.

    Raises
    ------
    MechanismError
        If the mechanism has no driver, or a limit names neither a driver nor an output.
    """

    def __init__(self, mechanism: Mechanism, limits: Mapping[str, Limits]):
        if not mechanism.drivers:
            raise MechanismError("a mechanism without a driver has no motion to be retimed", name="drivers")
        self.limits = dict(limits)
        self.changes = np.zeros(0)  # no quantity jumps along the path
        for name, entry in self.limits.items():
            check_name(
                "driver or output", name, [*mechanism.drivers, *mechanism.outputs], MechanismError, name="limits"
            )
            if not isinstance(entry, Limits):
                raise MechanismError("must be Limits", name=f"limits.{name}", value=entry)
        instants = np.asarray(instants_of(mechanism.time, mechanism.parameter_values), float)
        start, stop = float(instants[0]), float(instants[-1])
        outputs = {name: mechanism.outputs[name] for name in self.limits if name in mechanism.outputs}
        reduced = dataclasses.replace(mechanism, outputs=outputs)
        grid = np.linspace(start, stop, SAMPLES)
        motion = solve(reduced, grid, ORDER + 2)
        self.mechanism = motion.actuated
        self.laws = {name: _law_of(self.mechanism, name) for name in self.mechanism.drivers}
        self.path = Path(self.laws, start, stop)
        self.drivers, self.outputs = list(self.mechanism.drivers), list(outputs)
        self.loaded = [k for k in self.drivers if self._has(k, "effort", "effort_rate")]
        self.scalar = [k for k in self.outputs if motion.outputs[k].ndim == 2]
        self.vector = [k for k in self.outputs if k not in self.scalar]
        values = [motion.outputs[name] for name in self.scalar]
        driver_values = [np.asarray(motion.driver(name).values) for name in self.drivers]
        self.numbers = [*self.drivers, *self.scalar]
        columns = [x[:, : ORDER + 1] for x in (*driver_values, *values)]
        vectors = [motion.outputs[name][:, 1:3].reshape(SAMPLES, -1) for name in self.vector]
        self.motions = _Table(grid, np.stack(columns, axis=-1))
        self.sizes = [x.shape[1] // 2 for x in vectors]
        self.vectors = _Table(grid, np.concatenate([*vectors, np.zeros((SAMPLES, 0))], axis=1))
        if self.loaded:
            self.inertia = self._inertial(grid)
        self.forces: _Table | None = None
        self.labels = self._labels()

    def refer_to(self, law: RateLaw | None) -> None:
        """Expand the forces of the drivers about a time law, or about the times of the mechanism without a law."""
        if not self.loaded:
            return
        if law is None:
            length = self.path.stop - self.path.start
            progress: AbstractMotion = ExpressionMotion("start + t*1", {"start": self.path.start})
            duration = length
        else:
            motion = rate_motion(law, exact=False)  # always equally many pieces, so that one program serves all
            progress, duration = FollowingMotion(law.parameter, motion), motion.duration
        times = np.linspace(0.0, duration, SAMPLES)
        s, s1, s2 = np.asarray(progress(Jet.variable(jnp.asarray(times), 2)).dense().derivatives())
        forces = [self._forces(_Scaled(progress, k), times / k, self.mechanism) for k in SPEEDS]
        m, c, m1, c1 = np.moveaxis(self.inertia(np.clip(s, self.path.start, self.path.stop)), 1, 0)
        k = SPEEDS[:, None, None]
        s1, s2 = s1[:, None], s2[:, None]
        remainder = np.stack([x[0] for x in forces]) - k**2 * (m * s2 + c * s1**2)
        inertial = k**3 * ((m1 + 2 * c) * s1 * s2 + c1 * s1**3)
        third = np.asarray(progress(Jet.variable(jnp.asarray(times), 3)).dense().derivatives())[3][:, None]
        rates = np.stack([x[1] for x in forces]) - inertial - k**3 * m * third
        g, d, c_rest = np.einsum("ij,jpn->ipn", np.linalg.inv(np.vander(SPEEDS, increasing=True)), remainder)
        slow = s1 < SLOW * s1.mean()
        safe = np.where(slow, 1.0, s1)
        d, c_rest = np.where(slow, 0.0, d / safe), np.where(slow, 0.0, c_rest / safe**2)
        g = np.where(slow, remainder[1], g)
        rates = rates - k**2 * d * s2 - k**3 * 2 * c_rest * s1 * s2
        g1, d1, c1_rest = np.einsum("ij,jpn->ipn", np.linalg.inv(SPEEDS[:, None] ** [1, 2, 3]), rates)
        d1, c1_rest = np.where(slow, 0.0, d1 / safe**2), np.where(slow, 0.0, c1_rest / safe**3)
        g1 = np.where(slow, 0.0, g1 / safe)
        coefficients = np.stack([m, c + c_rest, d, g, m1, c1 + c1_rest, d1, g1], axis=1)
        increases = np.append(True, np.diff(s) > 0)
        self.forces = _Table(s[increases], coefficients[increases])

    def __call__(self, s: _Points) -> PathQuantities:
        """Return the quantities at values of s."""
        motion = self.motions(s)
        _, q1, q2, q3 = np.moveaxis(motion, 1, 0)
        vectors = np.split(self.vectors(s), np.cumsum([2 * n for n in self.sizes])[:-1], axis=1) if self.sizes else []
        curves = [np.moveaxis(x.reshape(len(s), 2, -1), 1, -1) for x in vectors]
        vector = np.zeros((len(s), len(curves), 3, 2))
        for k, curve in enumerate(curves):
            vector[:, k, : curve.shape[1]] = curve
        first = np.concatenate([q1, np.linalg.norm(vector[..., 0], axis=-1)], axis=1)
        nothing = np.zeros_like(q1)
        second = np.stack([q1, q2, nothing, nothing, q2, q3, nothing, nothing], axis=-1)
        names = self.numbers
        upper, rates = self._bounds(names, "acceleration", s), self._bounds(names, "jerk", s)
        if self.loaded and self.forces is not None:
            second = np.concatenate([second, np.moveaxis(self.forces(s), 1, -1)], axis=1)
            upper = np.concatenate([upper, self._bounds(self.loaded, "effort", s)], axis=1)
            rates = np.concatenate([rates, self._bounds(self.loaded, "effort_rate", s)], axis=1)
        speeds = self._bounds([*names, *self.vector], "velocity", s)
        accelerations = self._bounds(self.vector, "acceleration", s)
        empty = np.zeros((len(s), 0))
        fourth = np.zeros((len(s), 0, 4))
        return PathQuantities(first, speeds, second, -upper, upper, -rates, rates, vector, accelerations, fourth, empty)

    def location(self, s: float) -> str:
        """Return a description of a place on the path for messages."""
        values = self.motions(np.array([s]))[0, 0, : len(self.drivers)]
        listed = ", ".join(f"{name} = {x:.5g}" for name, x in zip(self.drivers, values, strict=True))
        return f"t = {time_text(s)} s of the mechanism ({listed})"

    def ratios_of(self, progress: AbstractMotion, times: _Points) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return values, bounds and ratios of all quantities in a motion, from a solution without expansions."""
        motion = solve(_following(self.mechanism, self.laws, progress), times, ORDER + 2)
        s = np.asarray(progress(Jet.variable(jnp.asarray(times), 0)).derivatives())[0]
        numbers = [np.asarray(motion.driver(name).values) for name in self.drivers]
        numbers += [np.asarray(motion.outputs[name]) for name in self.scalar]
        vectors = [np.asarray(motion.outputs[name]) for name in self.vector]
        forces = [np.asarray(driver_force(motion, name).values) for name in self.loaded]

        def column(arrays: Sequence[Any], level: int) -> np.ndarray:
            columns = [x[:, level] if x.ndim == 2 else np.linalg.norm(x[:, level], axis=-1) for x in arrays]
            return np.stack([*columns, np.zeros(len(times))], axis=1)[:, : len(columns)]

        values = np.concatenate(
            [
                column([*numbers, *vectors], 1),
                np.concatenate([column(numbers, 2), column(forces, 0)], axis=1),
                np.concatenate([column(numbers, 3), column(forces, 1)], axis=1),
                column(vectors, 2),
            ],
            axis=1,
        )
        quantities = self(s)
        bounds = np.concatenate(
            [quantities.first_bounds, quantities.upper, quantities.rate_upper, quantities.vector_bounds], axis=1
        )
        return values, bounds, np.abs(values) / bounds

    def _inertial(self, grid: _Points) -> "_Table":
        """Return the table of m, c and their derivatives along the path: the inertial part of the driver forces."""
        unloaded = dataclasses.replace(self.mechanism, forces={}, gravity=None, outputs={})
        start, length = self.path.start, self.path.stop - self.path.start
        even = ExpressionMotion("start + t*1", {"start": start})
        c, c1 = self._forces(even, grid - start, unloaded)
        slope = 1 / length  # the rate of s grows from 1/2, and its square linearly in s
        grown = ExpressionMotion("start + t/2 + slope*t**2/2", {"start": start, "slope": slope})
        square = (0.25 + 2 * slope * (grid - start))[:, None]
        times = (np.sqrt(square[:, 0]) - 0.5) / slope
        force, rate = self._forces(grown, times, unloaded)
        m = (force - c * square) / slope
        w = np.sqrt(square)
        m1 = (rate - c1 * w**3) / (w * slope) - 2 * c
        return _Table(grid, np.stack([m, c, m1, c1], axis=1))

    def _forces(self, progress: AbstractMotion, times: _Points, mechanism: Mechanism) -> tuple[np.ndarray, np.ndarray]:
        """Return the forces of drivers with force limits, and their rates."""
        reduced = dataclasses.replace(mechanism, outputs={})
        motion: Motion = solve(_following(reduced, self.laws, progress), times, ORDER)
        forces = [np.asarray(driver_force(motion, name).values) for name in self.loaded]
        return np.stack([x[:, 0] for x in forces], axis=1), np.stack([x[:, 1] for x in forces], axis=1)

    def _has(self, name: str, *fields: str) -> bool:
        return name in self.limits and any(getattr(self.limits[name], field) is not None for field in fields)

    def _bounds(self, names: Sequence[str], field: str, s: _Points) -> Float[np.ndarray, "point name"]:
        bounds = [getattr(self.limits[name], field) if name in self.limits else None for name in names]
        return np.tile([np.inf if x is None else x for x in bounds], (len(s), 1)).astype(float).reshape(len(s), -1)

    def _labels(self) -> Labels:
        def turns(name: str) -> bool:
            if name in self.mechanism.drivers:
                return is_turning(self.mechanism.drivers[name])
            return str(getattr(self.mechanism.outputs[name], "unit", "m")).startswith("rad")

        def label(name: str, quantity_name: str) -> Quantity:
            force = quantity_name in ("force", "force rate")
            is_angle = turns(name)
            quantity = quantity_name.replace("force", "torque") if force and is_angle else quantity_name
            return Quantity(name, quantity, (TURN if is_angle else SLIDE)[quantity])

        first = [*(label(x, "velocity") for x in self.numbers), *(Quantity(x, "speed", "m/s") for x in self.vector)]
        second = [*(label(x, "acceleration") for x in self.numbers), *(label(x, "force") for x in self.loaded)]
        rates = [*(label(x, "jerk") for x in self.numbers), *(label(x, "force rate") for x in self.loaded)]
        vectors = [Quantity(x, "acceleration", "m/s^2") for x in self.vector]
        return Labels(tuple(first), tuple(second), tuple(rates), tuple(vectors), ())


class _Scaled(AbstractMotion):
    """A motion with its time scaled by a factor."""

    motion: AbstractMotion
    factor: Any

    def __call__(self, time: Jet) -> Jet:
        """Return the jet of the motion."""
        return self.motion(time * self.factor)


class _Table:
    """Values over s, interpolated by monotone cubic splines (PCHIP)."""

    def __init__(self, s: _Points, values: np.ndarray):
        from scipy.interpolate import PchipInterpolator

        self.first, self.last = float(s[0]), float(s[-1])
        self.spline = PchipInterpolator(s, values, axis=0)

    def __call__(self, s: _Points) -> np.ndarray:
        return self.spline(np.clip(s, self.first, self.last))


def rate_motion(law: RateLaw, *, exact: bool = True) -> RateMotion:
    """Return the motion of u over time of a law."""
    return RateMotion(np.linspace(0.0, 1.0, law.basis.cells + 1), law.basis.pieces(law.coefficients), exact=exact)


def _law_of(mechanism: Mechanism, name: str) -> AbstractMotion:
    """Return the law of a driver with its parameters replaced by numbers."""
    driver: Any = mechanism.drivers[name]
    law, values = driver.motion, mechanism.parameter_values
    if isinstance(law, AbstractMotion):
        return law.resolved(values)
    expression = law if isinstance(law, Expression) else Expression(str(law))
    return ExpressionMotion(expression, {key: values[key] for key in sorted(expression.names - {"t"})})


def _following(mechanism: Mechanism, laws: Mapping[str, AbstractMotion], progress: AbstractMotion) -> Mechanism:
    """Return a mechanism whose drivers follow their laws with another progress."""
    drivers = {
        name: dataclasses.replace(driver, motion=FollowingMotion(laws[name], progress))
        for name, driver in mechanism.drivers.items()
    }
    for driver in drivers.values():
        settle(driver)  # the first solve already warned of their units
    return dataclasses.replace(mechanism, drivers=drivers)
