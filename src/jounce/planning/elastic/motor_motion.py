"""Results of a feedforward: motions, torques and deflections, at instants or along a whole trajectory."""

import dataclasses
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from jounce.base.display import Displayed
from jounce.base.shapes import Array, ArrayLike, seconds
from jounce.dynamics.limits.check_limits import worst_instants
from jounce.dynamics.limits.limit_report import LimitRow, LimitRows
from jounce.errors import TrajectoryError
from jounce.planning.elastic.driven_systems import DrivenSystem
from jounce.planning.elastic.drives import DriveArrays
from jounce.planning.elastic.pieces import resolved
from jounce.planning.elastic.spring_deflection import SpringDeflection
from jounce.trajectory.motion import AbstractMotion
from jounce.units.shown_units import derivatives_of, time_axes

if TYPE_CHECKING:
    import xarray

REST = 1e-9  # fraction of the largest velocity of a motor below which the motor is at rest
INSTANTS = 2000  # least number of instants at which limits are checked before peaks are sought between them
QUANTITIES = ("deflection", "motor velocity", "motor torque")


@dataclasses.dataclass(eq=False)
class MotorMotion:
    """Motions and torques of motors, and the deflections of springs, with their derivatives.

    Attributes
    ----------
    names : tuple of str
        Names of joints or drivers.
    q : array of shape (..., levels, n)
        Coordinates of the links, rad or m by s.
    spring_torque : array of shape (..., levels, n)
        Torques of springs and dampers, or of rigid gears, on the links, N m or N by s.
    deflection : array of shape (..., levels, n)
        Deflections of the springs, ``theta - q``; zero for rigid joints.
    position : array of shape (..., levels, n)
        Positions of the motors, theta, as seen at the joints.
    torque : array of shape (..., levels - 2, n)
        Torques of the motors, u, as seen at the joints.
    motor_position : array of shape (..., levels, n)
        Angles of the motors themselves, through the gear ratios.
    motor_torque : array of shape (..., levels - 2, n)
        Torques of the motors themselves.
    """

    names: tuple[str, ...]
    q: Array[np.ndarray, "*batch level joint"]
    spring_torque: Array[np.ndarray, "*batch level joint"]
    deflection: Array[np.ndarray, "*batch level joint"]
    position: Array[np.ndarray, "*batch level joint"]
    torque: Array[np.ndarray, "*batch torque_level joint"]
    motor_position: Array[np.ndarray, "*batch level joint"]
    motor_torque: Array[np.ndarray, "*batch torque_level joint"]


def motor_motion(
    arrays: DriveArrays,
    q: Float[np.ndarray, "*batch level joint"],
    forces: Float[np.ndarray, "*batch level joint"],
    deflection: Float[np.ndarray, "*batch level joint"],
    rest_speed: Any = 0.0,
) -> MotorMotion:
    """Return the motion of motors: positions from deflections, torques from forces and rotor inertias.

    Parameters
    ----------
    rest_speed : array of shape (joints,)
        Velocities up to which a motor counts as at rest, without friction.
    """
    position = q + deflection
    torque = forces[..., :-2, :] + arrays.inertia * position[..., 2:, :]
    velocity = position[..., 1, :]
    torque[..., 0, :] += arrays.friction * np.where(np.abs(velocity) > rest_speed, np.sign(velocity), 0.0)
    return MotorMotion(
        arrays.names, q, forces, deflection, position, torque, arrays.ratio * position, torque / arrays.ratio
    )


class DriveReport(LimitRows):
    """Margins of springs and motors to their limits: the worst instant of each quantity of each joint.

    Parameters
    ----------
    rows : tuple of LimitRow
        Deflection, for elastic joints only, motor velocity, and motor torque.
    """

    def __init__(self, rows: tuple[LimitRow, ...]):
        self.rows = rows


class Feedforward(MotorMotion, Displayed):
    """Motions and torques of motors along a trajectory, at any of its instants; see `MotorMotion` for the arrays.

    Attributes
    ----------
    time : array of shape (time,)
        Instants, s.
    drives : dict of str to Drive
        The given drives.
    title : str
        Title of the robot or mechanism.
    system : DrivenRobot or DrivenMechanism
        The driven system with its motion.
    """

    def __init__(
        self, system: DrivenSystem, time: np.ndarray, levels: int, springs: SpringDeflection | None, rest: Any = None
    ):
        self.time, self.drives, self.title = time, system.drives, system.title
        self.system, self._arrays = system, system.arrays
        self._levels, self._springs, self._rest = levels, springs, 0.0
        if rest is None and system.arrays.friction.any():
            rest = REST * np.abs(self._motion_at(system.instants).position[:, 1]).max(axis=0)
        self._rest = 0.0 if rest is None else rest
        motion = self._motion_at(time)
        super().__init__(*(getattr(motion, field.name) for field in dataclasses.fields(motion)))

    def __repr__(self) -> str:
        elastic = int(self._arrays.elastic.sum())
        return f"<Feedforward of {self.title}: {len(self.names)} drives, {elastic} elastic, {len(self.time)} instants>"

    def _motion_at(self, times: np.ndarray, *, friction: bool = True) -> MotorMotion:
        q, forces = self.system.moved(times, self._levels)
        deflection = np.zeros_like(q)
        if self._springs is not None:
            deflection[..., self._arrays.elastic] = self._springs.at(times)
        return motor_motion(self._arrays, q, forces, deflection, self._rest if friction else np.inf)

    def at(self, times: ArrayLike) -> "Feedforward":
        """Return the feedforward at other instants of the trajectory, s.

        Raises
        ------
        TrajectoryError
            If an instant lies outside of the trajectory.
        """
        instants, grid = np.atleast_1d(seconds("times", times, TrajectoryError)), self.system.instants
        if not (instants.ndim == 1 and ((instants >= grid[0]) & (instants <= grid[-1])).all()):
            message = f"must be instants from {grid[0]:.9g} to {grid[-1]:.9g} s, where the motion is known"
            raise TrajectoryError(message, name="times", value=instants.tolist()[:5])
        return Feedforward(self.system, instants, self._levels, self._springs, self._rest)

    @cached_property
    def expansion_errors(self) -> Float[np.ndarray, "order joint"]:
        """Errors of the regular expansion of the deflection in D / K, truncated after each order, relative to its peak.

        Row 0 is the error of ``tau / K``; row 1 includes the damping. Zero for joints without damping.
        """
        errors = np.zeros((self._levels, len(self.names)))
        if self._springs is not None:
            damped = self._arrays.time_constant[self._arrays.elastic] > 0
            errors[:, self._arrays.elastic] = np.where(damped, self._springs.expansion_errors(), 0.0)
        return errors

    @property
    def start(self) -> Float[np.ndarray, "2 2 joint"]:
        """Coordinates and rates of the links and of the motors at the start: the state for `simulate_elastic`."""
        motion = self._motion_at(self.system.instants[:1])
        return np.stack([motion.q[0, :2], motion.position[0, :2]])

    @cached_property
    def report(self) -> DriveReport:
        """Deflections, motor velocities and motor torques at their worst instants, with their limits."""
        grid = self.system.instants
        steps = max(1, -(-INSTANTS // (len(grid) - 1)))
        evenly_spaced = grid[:-1, None] + np.diff(grid)[:, None] * (np.arange(steps) / steps)
        grid = np.append(evenly_spaced.reshape(-1), grid[-1])
        rigid = [QUANTITIES.index("deflection")] if not self._arrays.elastic.all() else []
        limited = [
            (quantity, joint)
            for joint in range(len(self.names))
            for quantity in range(len(QUANTITIES))
            if quantity not in rigid or self._arrays.elastic[joint]
        ]
        bounds = _Bounds(self._arrays.limits)
        times, values, _ = worst_instants(self._curves, bounds, grid, self._curves(grid), np.array(limited))
        return DriveReport(
            tuple(
                self._row(quantity, joint, float(time), float(value))
                for (quantity, joint), time, value in zip(limited, times, values, strict=True)
            )
        )

    def _curves(self, times: np.ndarray) -> Float[np.ndarray, "time 3 joint"]:
        motion = self._motion_at(times)
        return np.stack([motion.deflection[:, 0], motion.motor_position[:, 1], motion.motor_torque[:, 0]], axis=1)

    def _row(self, quantity: int, joint: int, time: float, value: float) -> LimitRow:
        limit = float(self._arrays.limits[quantity, joint])
        is_turning = (self._arrays.turning if quantity == 0 else self._arrays.motor_turning)[joint]
        unit = (("m", "m/s", "N"), ("rad", "rad/s", "N m"))[is_turning][quantity]
        quantity_name = QUANTITIES[quantity] if is_turning else QUANTITIES[quantity].replace("torque", "force")
        if np.isnan(limit):
            return LimitRow(self.names[joint], quantity_name, unit, value, time)
        return LimitRow(
            self.names[joint], quantity_name, unit, value, time, np.copysign(limit, value).item(), abs(value) / limit
        )

    def torque_laws(self, *, friction: bool = True) -> dict[str, AbstractMotion]:
        """Return the motor torques, as seen at the joints, as laws of time: piecewise polynomials exact to rounding.

        Parameters
        ----------
        friction : bool, default True
            Whether the torques overcome Coulomb friction, and so jump where a motor reverses.
        """
        return self._laws(lambda times: self._motion_at(times, friction=friction).torque[:, 0])

    def rigid_torque_laws(self, *, friction: bool = True) -> dict[str, AbstractMotion]:
        """Return the motor torques without the acceleration of the deflections, ``tau + B q''``, as laws of time."""

        def torques(times: np.ndarray) -> np.ndarray:
            motion = self._motion_at(times, friction=friction)
            return motion.torque[:, 0] - self._arrays.inertia * motion.deflection[:, 2]

        return self._laws(torques)

    def _laws(self, function: Any) -> dict[str, AbstractMotion]:
        nodes = self.system.instants if self._springs is None else self._springs.pieces.nodes
        size = np.abs(function(nodes)).max(axis=0)
        laws = resolved(function, nodes, 1e-15 * size.max() * np.ones_like(size)).laws
        return dict(zip(self.names, laws, strict=True))

    @property
    def dataset(self) -> "xarray.Dataset":
        """The motion of each joint as an `xarray.Dataset`, with as many rates as the torques have.

        ``JOINT_motor`` is the position of the motor itself, with ``JOINT_motor_velocity``, ``_acceleration`` and
        ``_torque``; ``JOINT_theta`` and ``JOINT_torque`` are the position and torque of the motor as seen at the joint;
        ``JOINT_deflection`` and ``JOINT_spring_torque`` are those of the spring.
        """
        import xarray

        count = self._levels - 2
        axes = time_axes(self.time, count)
        variables: dict[str, Any] = {}
        for k, name in enumerate(self.names):
            length_unit, force = (("m", "N"), ("rad", "N*m"))[self._arrays.turning[k]]
            motor_unit, effort = (("m", "N"), ("rad", "N*m"))[self._arrays.motor_turning[k]]
            table = {
                "motor": (self.motor_position, motor_unit),
                "motor_velocity": (self.motor_position[:, 1:], f"{motor_unit}/s"),
                "motor_acceleration": (self.motor_position[:, 2:], f"{motor_unit}/s**2"),
                "motor_torque": (self.motor_torque, effort),
                "theta": (self.position, length_unit),
                "torque": (self.torque, force),
                "deflection": (self.deflection, length_unit),
                "spring_torque": (self.spring_torque, force),
            }
            for suffix, (values, unit) in table.items():
                attributes = {"units": unit, "long_name": derivatives_of(f"{name}_{suffix}")}
                variables[f"{name}_{suffix}"] = (("time", "derivative"), values[:, :count, k], attributes)
        return xarray.Dataset(variables, coords=axes, attrs={"title": self.title, "source": "jounce"})


class _Bounds:
    """Symmetric limits, in the form for `worst_instants`."""

    def __init__(self, limits: Float[np.ndarray, "3 joint"]):
        self.limits = np.where(np.isnan(limits), 1.0, limits)

    def weights(self, values: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Return ones: all instants have the same weight."""
        del times
        return np.ones_like(values)

    def measure(self, values: np.ndarray, index: Any = ...) -> np.ndarray:
        """Return the magnitudes over their limits."""
        return np.abs(values) / self.limits[index]
