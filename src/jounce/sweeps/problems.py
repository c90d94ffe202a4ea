"""Problems of a sweep: motions and simulations of a mechanism, and torques of a robot on a trajectory."""

import abc
import dataclasses
import functools
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import jax
import numpy as np
from jaxtyping import Float, Int

from jounce.base.shapes import seconds
from jounce.design.tolerances.variations import Reader, reader_of
from jounce.dynamics.limits.trajectories import FollowedTrajectory
from jounce.errors import MechanismError, RobotError, check_name
from jounce.integrate import simulate_batch
from jounce.integrate.steps.methods import AbstractMethod
from jounce.integrate.steps.options import checked_options, instants_of
from jounce.kinematics import Status, solve
from jounce.kinematics.families.design_sides import Sides, sides_of_designs
from jounce.kinematics.families.known_outputs import with_outputs
from jounce.kinematics.families.solve_batch import solve_with_sides
from jounce.kinematics.position_analysis.solve import checked_settings
from jounce.kinematics.results.pose_outputs import output_group
from jounce.mechanism import (
    AbstractMotionOutput,
    AbstractOutput,
    Mechanism,
    build,
    check_mechanism,
    time_grid,
    with_output_drivers,
)
from jounce.mechanism.building.starting_guess import pose_at
from jounce.rigid.inertia import Inertia
from jounce.robot.robot import Robot
from jounce.trajectory.joint_trajectory import JointTrajectory
from jounce.trajectory.law_checks.breaks import both_sides, law_breaks
from jounce.units.values import parse_value

Designs = Mapping[str, Float[np.ndarray, " design"]]
MORE_INSTANTS = 4  # largest ratio of simulated to requested instants of designs side by side


@dataclasses.dataclass(frozen=True)
class Quantity:
    """A quantity computed for every design: its name, unit and, unless it is a scalar, its axes.

    Attributes
    ----------
    axes : tuple of pairs
        Name and labels of each axis after time and derivative.
    """

    name: str
    units: str
    axes: tuple[tuple[str, tuple[str, ...]], ...] = ()

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of components along each axis."""
        return tuple(len(labels) for _, labels in self.axes)


@dataclasses.dataclass(frozen=True)
class Histories:
    """The quantities of some designs at all instants.

    Attributes
    ----------
    values : dict of str to array of shape (designs, time, order + 1, ...)
        Values, SI; NaN where unknown.
    status : array of int, shape (designs, time)
        See `Status`.
    pace : array of shape (designs,), optional
        Factor by which each design moves faster than at the instants.
    sides : Sides, optional
        The quantities on both sides of jumps and kinks of laws, at the pace of the instants.
    """

    values: dict[str, Float[np.ndarray, "design time derivative *axes"]]
    status: Int[np.ndarray, "design time"]
    pace: Float[np.ndarray, " design"] | None = None
    sides: Sides | None = None


class Problem(abc.ABC):
    """The computation for every design of a sweep."""

    @property
    @abc.abstractmethod
    def instants(self) -> Float[np.ndarray, " time"]:
        """Instants, s."""

    @property
    @abc.abstractmethod
    def levels(self) -> int:
        """Number of levels: the quantity itself and its derivatives."""

    @property
    @abc.abstractmethod
    def nominal(self) -> Mapping[str, float]:
        """Nominal values of the parameters that may vary, SI."""

    @property
    @abc.abstractmethod
    def reader(self) -> Reader:
        """Function that reads values of parameters, and refuses unknown names."""

    @abc.abstractmethod
    def quantities(self) -> tuple[Quantity, ...]:
        """Return the quantities."""

    @abc.abstractmethod
    def options(self) -> dict[str, Any]:
        """Return the settings other than the model, in words and numbers."""

    @abc.abstractmethod
    def histories(self, designs: Designs, threads: int) -> Histories:
        """Return the histories of some designs, computed side by side."""


class _OfMechanism(Problem):
    """A problem whose parameters are those of a mechanism."""

    mechanism: Mechanism
    order: int

    @property
    def levels(self) -> int:
        """Number of levels: the quantity itself and its derivatives."""
        return self.order + 1

    @property
    def nominal(self) -> Mapping[str, float]:
        """Values of the parameters, SI."""
        return self.mechanism.parameter_values

    @property
    def reader(self) -> Reader:
        """Function that reads values of parameters, with or without units."""
        return reader_of(self.mechanism)

    def quantities(self) -> tuple[Quantity, ...]:
        """Return the outputs of the mechanism."""
        return outputs_of(self.mechanism, self.instants, self.order)


@dataclasses.dataclass(frozen=True, eq=False)
class Motions(_OfMechanism):
    """The driven motion of a mechanism in every design; see `jounce.solve_batch`."""

    mechanism: Mechanism
    time: Any = None
    order: int = 4
    tolerance: float = 1e-12

    def __post_init__(self) -> None:
        checked_settings(self.mechanism, self.order, self.tolerance)

    @functools.cached_property
    def instants(self) -> Float[np.ndarray, " time"]:
        """Instants, s."""
        return time_grid(self.mechanism.time if self.time is None else self.time, self.mechanism.parameter_values)

    def options(self) -> dict[str, Any]:
        """Return the order and the tolerance."""
        return {"kind": "motions", "order": self.order, "tolerance": self.tolerance}

    def histories(self, designs: Designs, threads: int) -> Histories:
        """Return the histories of some designs, solved side by side."""
        settings = {"tolerance": self.tolerance, "threads": threads}
        family, sides = solve_with_sides(self.mechanism, designs, self.instants, self.order, **settings)
        values = {str(name): array.values for name, array in family.data_vars.items() if name != "status"}
        return Histories(values, family["status"].values, sides=sides.like(values))


@dataclasses.dataclass(frozen=True, eq=False)
class Simulations(_OfMechanism):
    """The motion of a mechanism under its forces in every design; see `jounce.simulate_batch`."""

    mechanism: Mechanism
    time: Any = None
    order: int = 4
    tolerance: float = 1e-15
    method: AbstractMethod | None = None
    longest_step: float = np.inf

    def __post_init__(self) -> None:
        check_mechanism(self.mechanism)
        checked_options(self.order, self.method, self.tolerance, self.longest_step)
        for name, output in self.mechanism.outputs.items():
            if isinstance(output, AbstractMotionOutput):
                message = "forces and energies are not computed in batches of simulations; leave this output out"
                raise MechanismError(message, name=f"outputs.{name}")

    @functools.cached_property
    def instants(self) -> Float[np.ndarray, " time"]:
        """Instants, s."""
        return instants_of(self.mechanism.time if self.time is None else self.time, self.mechanism.parameter_values)

    def options(self) -> dict[str, Any]:
        """Return the order, the tolerance and the method."""
        longest_step = None if np.isinf(self.longest_step) else float(self.longest_step)
        method = "Taylor()" if self.method is None else repr(self.method)
        chosen = {"order": self.order, "tolerance": self.tolerance, "method": method, "longest_step": longest_step}
        return {"kind": "simulations", **chosen}

    def histories(self, designs: Designs, threads: int) -> Histories:
        """Return the histories of some designs, simulated side by side with a thread for each core."""
        del threads
        start, stop = sorted((float(self.instants[0]), float(self.instants[-1])))
        breaks, side_times = sides_of_designs(self.mechanism, designs, start, stop, self.order, forces=True)
        results = [
            self._simulated({name: values[chunk] for name, values in designs.items()}, side_times[chunk])
            for chunk in _chunks(side_times, MORE_INSTANTS * len(self.instants))
        ]
        values, side_values, status = zip(*results, strict=True)
        return Histories(_joined(values), np.concatenate(status), sides=Sides(breaks, _joined(side_values)))

    def _simulated(
        self, designs: Designs, side_times: Float[np.ndarray, "design side"]
    ) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], Int[np.ndarray, "design time"]]:
        """Return the outputs at the instants and on both sides of breaks of laws, and the status at the instants."""
        settings = {"method": self.method, "tolerance": self.tolerance, "longest_step": self.longest_step}
        instants, is_forward = np.union1d(self.instants, side_times), self.instants[0] <= self.instants[-1]
        grid = instants if is_forward else instants[::-1]
        simulated = simulate_batch(self.mechanism, designs, grid, self.order, **settings)
        indices, side_indices = (np.searchsorted(instants, x) for x in (self.instants, side_times))
        if not is_forward:
            indices, side_indices = len(instants) - 1 - indices, len(instants) - 1 - side_indices
        shapes = {quantity.name: quantity.shape for quantity in self.quantities()}
        values = {name: x.reshape(*x.shape[:3], *shapes[name]) for name, x in simulated.outputs.items()}
        is_unknown = simulated.status != Status.OK
        for array in values.values():
            array[is_unknown] = np.nan
        side_values = {name: array[np.arange(len(side_times))[:, None], side_indices] for name, array in values.items()}
        return {name: array[:, indices] for name, array in values.items()}, side_values, simulated.status[:, indices]


def _chunks(side_times: Float[np.ndarray, "design side"], max_instants: int) -> Iterator[slice]:
    """Yield batches of designs to simulate together, limited so that the union of their instants stays small."""
    start, instants = 0, set()
    for k, design_times in enumerate(side_times.tolist()):
        instants.update(design_times)
        if k > start and len(instants) > max_instants:
            yield slice(start, k)
            start, instants = k, set(design_times)
    yield slice(start, len(side_times))


def _joined(mappings: Sequence[Mapping[str, np.ndarray]]) -> dict[str, np.ndarray]:
    return {name: np.concatenate([mapping[name] for mapping in mappings]) for name in mappings[0]}


def outputs_of(mechanism: Mechanism, instants: Float[np.ndarray, " time"], order: int) -> tuple[Quantity, ...]:
    """Return the outputs of a mechanism as quantities; forces and energies require a solution."""
    if not mechanism.outputs:
        raise MechanismError("the mechanism has no outputs, so that there is nothing to keep", name="outputs")
    model = build(with_output_drivers(mechanism))
    pose = pose_at(model.guess, model.pose_type)
    zeros = np.zeros_like(pose.position.coefficients[0])
    pose = pose.extended(zeros, None if mechanism.space == "planar" else zeros)  # for outputs that are rates
    of_motion = any(isinstance(output, AbstractMotionOutput) for output in mechanism.outputs.values())
    motion_values = with_outputs(solve(mechanism, instants, order, strict=False))[1] if of_motion else {}
    outputs = []
    for name, output in mechanism.outputs.items():
        if isinstance(output, AbstractMotionOutput):
            values = motion_values[name]
            count = values.shape[2] if values.ndim == 3 else 1
        elif getattr(output, "turning", False):  # counted from the assembled configuration
            count = 1
        else:
            assert isinstance(output, AbstractOutput)
            group = output_group(output, mechanism, name=name)
            count = jax.eval_shape(lambda g=group: g.evaluate(pose).coefficients[0]).shape[0]
        axes = output.axes or (("component", tuple(output.labels[:count])),)
        outputs.append(Quantity(name, output.unit, axes if count > 1 else ()))
    return tuple(outputs)


DRIVES = ("armature", "damping", "friction")
_PARAMETER = re.compile(rf"(payload|{'|'.join(DRIVES)})\.(.+)")


@dataclasses.dataclass(frozen=True, eq=False)
class Torques(Problem):
    """The torques of the joints of a robot on a trajectory, with rates, for many loads, drives and speeds.

    Parameters are ``payload.LINK``, a point mass in the origin of a link, kg; ``armature.JOINT``, ``damping.JOINT`` and
    ``friction.JOINT``, which replace those of the robot; and ``speed``, a factor of the speed of the trajectory.
    """

    robot: Robot
    trajectory: JointTrajectory
    time: Any = None
    rates: int = 2

    @functools.cached_property
    def instants(self) -> Float[np.ndarray, " time"]:
        """Instants of the trajectory at its own speed, s."""
        return self.trajectory.times if self.time is None else np.atleast_1d(seconds("time", self.time, RobotError))

    @property
    def levels(self) -> int:
        """Number of levels: the torque itself and its rates."""
        return self.rates + 1

    @property
    def nominal(self) -> Mapping[str, float]:
        """Nominal loads, drives and speed of the robot, SI."""
        drives = {f"{kind}.{n}": getattr(self.robot.joints[n], kind) for n in self.robot.joint_names for kind in DRIVES}
        return {"speed": 1.0, **{f"payload.{link}": 0.0 for link in self.robot.links}, **drives}

    @property
    def reader(self) -> Reader:
        """Function that reads values of parameters, with or without units."""

        def read(name: str, text: str) -> float:
            check_name("parameter of a robot", name, tuple(self.nominal), RobotError, name="vary")
            value = parse_value(text, "mass" if name.startswith("payload.") else "any").value
            if not isinstance(value, float):
                raise RobotError("must be a number, with or without a unit", value=text)
            return value

        return read

    def quantities(self) -> tuple[Quantity, ...]:
        """Return the torques of all joints."""
        return tuple(Quantity(n, "N*m" if self.robot.joints[n].turning else "N") for n in self.robot.joint_names)

    def options(self) -> dict[str, Any]:
        """Return the number of rates."""
        return {"kind": "torques", "rates": self.rates}

    def histories(self, designs: Designs, threads: int) -> Histories:
        """Return the histories of some designs, from one robot for each load and drive, in which torques are linear.

        Raises
        ------
        RobotError
            If a speed is not greater than zero, or another value is negative.
        """
        del threads
        count = len(next(iter(designs.values())))
        for name, values in designs.items():
            if (values < 0).any() or (name == "speed" and not values.all()):
                message = "must be above zero" if name == "speed" else "must be zero or greater"
                raise RobotError(message, name=f"vary {name}", value=float(values.min()))
        linear = [name for name in designs if name != "speed"]
        speed = np.unique(designs["speed"]) if "speed" in designs else np.ones(1)
        speed_index = np.searchsorted(speed, designs["speed"]) if "speed" in designs else np.zeros(count, int)
        unloaded = _with(dict.fromkeys(linear, 0.0), self.robot)
        base = self._torques(unloaded, speed)
        torques = base[speed_index]
        for name in linear:
            slope = self._torques(_with({name: 1.0}, unloaded), speed) - base
            torques = torques + designs[name][:, None, None, None] * slope[speed_index]
        instant_count, breaks = len(self.instants), self._instants_looked_at[1]
        values = {name: torques[:, :instant_count, :, k] for k, name in enumerate(self.robot.joint_names)}
        one_sided = {name: torques[:, instant_count:, :, k] for k, name in enumerate(self.robot.joint_names)}
        status = np.full((count, instant_count), int(Status.OK))
        sides = Sides(np.broadcast_to(breaks, (count, len(breaks))), one_sided)
        return Histories(values, status, designs.get("speed"), sides)

    @functools.cached_property
    def _instants_looked_at(self) -> tuple[Float[np.ndarray, " look"], Float[np.ndarray, " side"]]:
        """Return the instants, then those on both sides of breaks of laws, and the breaks of the latter."""
        start, stop = float(self.instants[0]), float(self.instants[-1])
        breaks = law_breaks(self.trajectory.laws.values(), start, stop, self.rates + 2)
        sides, indices = both_sides(breaks, start, stop)
        return np.concatenate([self.instants, sides]), breaks[indices]

    def _torques(self, robot: Robot, speed: Float[np.ndarray, " speed"]) -> Float[np.ndarray, "speed look rate joint"]:
        followed = FollowedTrajectory(robot, self.trajectory)
        orders = np.arange(self.rates + 3)
        looks = self._instants_looked_at[0]
        q = followed.coordinates(looks, self.rates + 2) * (speed[:, None, None, None] ** orders[:, None])
        flat = q.reshape(-1, *q.shape[2:])
        torques = followed.torques(flat, np.tile(looks, len(speed)), True)
        return torques.reshape(len(speed), len(looks), *torques.shape[1:])


def _with(values: Mapping[str, float], robot: Robot) -> Robot:
    """Return a robot with other loads and drives; a load of zero is omitted."""
    joints = dict(robot.joints)
    for name, value in values.items():
        match = _PARAMETER.fullmatch(name)
        assert match is not None
        kind, owner = match.groups()
        if kind == "payload":
            robot = robot.with_payload(owner, Inertia(value)) if value else robot
        else:
            joints[owner] = dataclasses.replace(joints[owner], **{kind: value})
    return robot.changed(joints=list(joints.values()))
