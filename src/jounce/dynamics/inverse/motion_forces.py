"""Inverse dynamics of mechanisms: multipliers, driver forces and joint wrenches over a whole motion."""

import copy
import dataclasses
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.dynamics.friction.coupling import check_unique_pressing
from jounce.dynamics.inverse import force_programs as programs, idle_torques, tooth_flanks as teeth
from jounce.dynamics.inverse.finite_forces import check_finite_forces, check_finite_values
from jounce.dynamics.inverse.joint_friction import JointFriction
from jounce.dynamics.inverse.locked_friction import check_not_locked, friction_left_out, without_undetermined_rates
from jounce.dynamics.inverse.meshing import check_meshing
from jounce.dynamics.inverse.redundant_forces import OPEN, OpenMultipliers
from jounce.dynamics.masses import check_loads, gravity_of, masses_of
from jounce.dynamics.motion_values import part_of
from jounce.errors import MechanismError
from jounce.execution.mapped import Mapped, at_lanes
from jounce.jet.algebra import total
from jounce.kinematics import Motion, Status
from jounce.kinematics.continuation.change_points import spoiled, spoiled_nearby
from jounce.mechanism.building.element_indices import ElementIndex, element_indices
from jounce.mechanism.redundant_reactions import resolved_reactions
from jounce.mechanism.system import Group, law_left_out
from jounce.mechanism.transmissions.axis_angles import angles_of, of_one_lane

NOTHING = 1e-9  # fraction of the largest multiplier: less is rounding


class MotionForces:
    """The forces in a motion, computed on request and stored. Sommer 2024, section 7.

    Parameters
    ----------
    motion : Motion
        The motion of a mechanism with masses or applied forces.
    gravity, applied : bool, default True
        Whether to include the weight of the bodies, and the applied forces.
    flanks : bool, default True
        Whether to include the radial forces between teeth, which load the bearings by the pressure angle.
    friction : bool, default True
        Whether to include the joint friction of the mechanism.

    Raises
    ------
    MechanismError
        If there are neither masses nor applied forces, the motion has no accelerations, or the masses are not valid.
    """

    def __init__(
        self, motion: Motion, *, gravity: bool = True, applied: bool = True, flanks: bool = True, friction: bool = True
    ):
        check_loads(motion.mechanism)
        self.motion, self.model = motion, motion.model
        self.pose_type, self.coordinates = motion.poses
        self.levels = len(self.coordinates["position"]) - 2  # of the forces: accelerations use up two
        if self.levels < 1:
            raise MechanismError("forces need a motion solved to order 2 or higher", name="order", value=motion.order)
        mechanism = motion.mechanism
        self.masses = masses_of(mechanism)
        self.gravity = gravity_of(mechanism) * float(gravity)
        self.forces = motion.forces if applied else ()
        self.indices = element_indices(self.model)
        system = self.model.system  # a program without laws serves all laws, also those that a motion has found
        groups = system.groups if friction else map(friction_left_out, system.groups)
        self.joined = dataclasses.replace(system, groups=tuple(map(law_left_out, groups)), outputs=())
        check_unique_pressing(self.model, self.joined)
        self._numbers: dict[tuple[Any, ...], Numbers] = {}
        self.flanks: teeth.Flanks = teeth.either_flank(system.groups, len(motion.time)) if flanks else {}
        self._reversals: dict[int, np.ndarray] = {}
        self.passing: dict[str, np.ndarray] = {}  # instants at which a joint with friction carries no load

    @classmethod
    def of(cls, motion: Motion) -> "MotionForces":
        """Return the forces of a motion; those computed before are reused."""
        if "forces" not in motion.derived:
            motion.derived["forces"] = idle_torques.checked(cls(motion))
        return motion.derived["forces"]

    @cached_property
    def multipliers(self) -> Numbers:
        """Multipliers of the rows of all residuals, as Taylor coefficients, (levels, rows, time).

        For redundant constraints, the multipliers of least norm, or those that the stiffnesses of the mechanism give.
        They are NaN at change points, where they are not determined, and next to them where rounding dominates.
        """
        multipliers = self._balancing[0][:, : len(self.model.rows)]
        passages, time, distances = self.motion.passages, self.motion.time, self.motion.singular_distance
        if passages or distances.min() < 1.0:  # at a distance d, multipliers and their rounding grow as 1 / d
            orders = range(1, len(multipliers) + 1)
            is_unknown = [spoiled(passages, time, order) | spoiled_nearby(distances, order) for order in orders]
            multipliers = np.where(np.array(is_unknown)[:, None], np.nan, multipliers)
        return multipliers

    @cached_property
    def _balancing(self) -> Float[Numbers, "case level row time"]:
        """Multipliers that balance the loads, followed by self-balanced ones if these are needed."""
        if not self.flanks:
            return self._balanced({})
        check_meshing(self.motion, self.joined.groups, self.coordinates_of)
        multipliers, known_flanks, self._reversals = teeth.multipliers_on_flanks(
            self._balanced, self.flanks, self.model, self.motion
        )
        if self._seeks_undetermined:  # undetermined forces load no known flank: random ones show what depends on them
            multipliers = np.stack([multipliers[0], self._balanced(teeth.random_for_flanks(known_flanks))[1]])
        self.flanks = known_flanks
        return multipliers

    def prepare(self) -> None:
        """Compile the program that balances loads, for all motions with the same shapes."""
        cases, rows = 1 + self._seeks_undetermined, len(self.model.rows)
        choice = np.zeros(rows), np.zeros(cases), np.zeros((cases, rows))
        shared = self._balance(None if self.model.system.rank is None else choice)
        max_array = programs.largest_array(self.model)
        programs.balanced.prepare(shared, self.balance, large=max_array, pose_type=self.pose_type)

    def _balanced(self, flanks: teeth.Flanks) -> Float[Numbers, "case level row time"]:
        """Return the multipliers that balance the loads, and self-balanced ones, given the loaded tooth flanks."""
        self.flanks = flanks
        shared = self._balance(None if self.model.system.rank is None else self._choice)
        max_array = programs.largest_array(self.model)
        multipliers, finite = self.along(programs.balanced, shared, self.balance, large=max_array)
        check_finite_forces(self, finite)
        check_not_locked(self.motion, self.joined, multipliers[0])
        check_finite_values(self, multipliers[0])
        return without_undetermined_rates(self, multipliers)

    def _balance(self, choice: tuple[Numbers, Numbers, Numbers] | None) -> Any:
        """Return the arguments of a balance that all instants share, for a choice of redundant multipliers."""
        force_system = programs.without_constraints(self.joined, of_one_lane(self.forces))
        return self.joined, force_system, self.masses, self.gravity, choice

    @property
    def balance(self) -> Any:
        """The arguments of a balance that differ between instants."""
        bodies, angles, instants = self.acting
        return bodies, angles if self.forces else (), tuple(self.flanks.values()), instants

    @property
    def acting(self) -> tuple[Any, tuple[Any, ...], Any]:
        """The coordinates of all bodies, the angles that forces measure, and the time."""
        return self.coordinates_of(None, self.levels + 2), angles_of(self.motion.forces), self.motion.time

    @property
    def _choice(self) -> tuple[Numbers, Numbers, Numbers]:
        """The choice of redundant multipliers: compliance, and for each case weight of the load and misalignment."""
        bends = [np.zeros(len(self.model.rows)), *([self.open.random_right_side()] if self._seeks_undetermined else [])]
        return self.open.compliance, np.array([1.0, 0.0][: len(bends)]), np.array(bends)

    def unique(self, quantity: Callable[["MotionForces"], Numbers], size: float = 1.0) -> Numbers:
        """Return a quantity of the forces, NaN in components that redundant constraints do not determine.

        A component is unique if it vanishes for all self-balanced multipliers (Wojtyra 2005) at all instants.

        Parameters
        ----------
        quantity : callable
            Returns the Taylor coefficients of the quantity, (levels, components, time), from forces; it is linear in
            the multipliers.
        size : float
            Magnitude of the quantity for a unit force: 1 for a force, a length for a torque.
        """
        values = quantity(self)
        if self.undetermined is None:
            return values
        solved = self.motion.status == Status.OK
        sizes = np.abs(quantity(self.undetermined)[..., solved]).max(axis=-1, initial=0.0)
        level_sizes = np.abs(self.undetermined.multipliers[..., solved]).max(axis=-1, initial=0.0) * self.open.weights
        limits = OPEN * size * level_sizes.max(axis=-1)[:, None]
        is_open = sizes > limits
        if np.count_nonzero(solved) > 1:  # a quantity that vanishes at all instants has no rates
            is_open[1:] = is_open[0]
        return np.where(np.logical_or.accumulate(is_open, axis=0)[..., None], np.nan, values)

    @cached_property
    def unique_multipliers(self) -> Numbers:
        """Multipliers, NaN if redundant constraints do not determine them."""
        if self.undetermined is None:
            return self.multipliers
        weights = self.open.weights[:, None]
        return self.unique(lambda forces: forces.multipliers * weights) / weights

    @cached_property
    def undetermined(self) -> "MotionForces | None":
        """Random self-balanced forces, if redundant constraints leave forces undetermined and none are chosen."""
        if not self._seeks_undetermined:
            return None
        twin = copy.copy(self)
        twin._numbers = {}
        multipliers = self._balancing[1]
        solved = self.motion.status == Status.OK
        size = np.abs(multipliers[0][:, solved] * self.open.weights[:, None]).max(initial=0.0)
        twin.__dict__["multipliers"] = multipliers / (size or 1.0)
        twin.flanks = teeth.random_for_flanks(self.flanks)
        return twin

    @property
    def _seeks_undetermined(self) -> bool:
        return self.model.system.rank is not None and self.motion.mechanism.redundant_reactions == "unique"

    @cached_property
    def open(self) -> OpenMultipliers:
        """Forces that redundant constraints do not determine, at the first solved instant."""
        lanes = np.array([np.argmax(self.motion.status == Status.OK)])  # 0 if none is solved
        bodies, instants = at_lanes((self.coordinates_of(None, 1), self.motion.time), lanes)
        scaled = programs.scaled_jacobian(dataclasses.replace(self.joined, forces=()), bodies, instants, self.pose_type)
        mechanism = self.motion.mechanism
        selection = resolved_reactions(mechanism.redundant_reactions, mechanism.parameter_values)
        return OpenMultipliers(self.model, np.asarray(scaled)[..., 0], selection)

    @property
    def friction(self) -> JointFriction:
        """The joints with friction."""
        return JointFriction(self)

    @cached_property
    def rates(self) -> Float[np.ndarray, " time"]:
        """Rates at which the motion changes, 1/s."""
        return teeth.rate_of(self.motion)

    def is_loaded(self, name: str) -> bool:
        """Return whether a joint or driver exerts a force anywhere in the motion."""
        sizes = np.abs(np.nan_to_num(np.asarray(self.multipliers[0])))
        return bool(sizes[list(self.indices[name].own_rows)].max(initial=0.0) > NOTHING * sizes.max(initial=0.0))

    def driver_force(self, name: str) -> Float[Numbers, "order 1 time"]:
        """Return the force of a driver along its prescribed coordinate, as Taylor coefficients."""
        index = self.indices[name]
        driver = law_left_out(self.model.system.groups[index.group], only_if_evaluated=True).element
        lanes = self._poses(index.group), self.motion.time, self._of_group(index)
        forces = self._once(programs.exerted, driver, lanes, index.group)
        return forces[:, index.instance : index.instance + 1]

    def reaction(self, name: str, body: int, frame: int | None, point: Numbers) -> tuple[Any, Any]:
        """Return the force of a joint, driver or applied force on a body, and its moment about a point of the body.

        The forces on all bodies, the ground included, have no resultant. The force on the ground is therefore the
        opposite of the sum of those on the moving bodies, also for residuals that depend on more than relative poses,
        such as a coordinate of one body or a ratio of angles, because these are measured in the frame of the ground.
        The torque on a rotor that stands for the inertia of a coordinate alone is left out: it does not act on the
        ground.

        Parameters
        ----------
        name : str
            Name of the joint, driver or force.
        body, frame : int
            Indices of the body, and of the body along whose axes the result is expressed: 0 is the ground, None global.
        point : array of shape (c,)
            Point in the frame of the body, m.

        Returns
        -------
        tuple of two arrays of shape (levels, components, time)
            Taylor coefficients.
        """
        group, instance = self._member(name)
        element, bodies = group.element, [slot[instance] for slot in group.bodies]  # 0 is the ground
        # the carriage of a joint with a hidden coordinate does not count as a body
        slots = enumerate(bodies[: len(bodies) - bool(getattr(element, "hidden", ()))])
        if body:
            work = total(self._wrench(name, slot) for slot, member in slots if member == body)
            return self._expressed(work, body, frame, point)
        movable = {slot: member for slot, member in slots if member and slot not in getattr(element, "unfelt", ())}
        works = [self._wrench(name, slot) for slot in movable]
        poses = [self.coordinates_of((member,), self.levels) for member in movable.values()]
        work = self.along(programs.transmitted_wrench, point[:, None, None], (works, poses))
        return self._expressed(work, 0, frame, np.zeros(np.shape(point)))

    def point_of(self, name: str, body: int) -> Float[Numbers, " component"]:
        """Return the point of a joint, driver or force on a body; the origin of the body if it has none there."""
        group, instance = self._member(name)
        slots = [slot for slot, indices in enumerate(group.bodies) if indices[instance] == body]
        names = [f"point_{'ijmn'[slot : slot + 1]}" for slot in slots[:1]] + ["point"] * (len(group.bodies) == 1)
        points = [value for key in names if (value := getattr(group.element, key, None)) is not None]
        points += [group.element.first_on(slot) for slot in slots[:1] if hasattr(group.element, "first_on")]
        return points[0].reshape(self.pose_type.shifts, -1)[:, instance] if points else np.zeros(self.pose_type.shifts)

    def _member(self, name: str) -> tuple[Group, int]:
        """Return the group of a joint, driver or force, and its index in the group."""
        if element_index := self.indices.get(name):
            return self.model.system.groups[element_index.group], element_index.instance
        index, instance = self._force_index(name)
        return self.model.system.forces[index], instance

    def _wrench(self, name: str, slot: int) -> Float[Numbers, "order coordinate time"]:
        """Return the wrench of a joint, driver or force on the body in a slot, as Taylor coefficients.

        It consists of the force along the global axes and the moment about the origin of the body along its own axes.
        """
        if place := self.indices.get(name):
            first, group, rubbed = self.friction.first_rows.get(place.group), self.joined.groups[place.group], None
            if first is not None:
                poses = [self.coordinates_of(indices, self.levels + 1) for indices in group.bodies]
                rubbed = poses, self._balancing[0][:, None, first : first + group.instances]
            lanes = *self.joint(place.group), self._of_group(place), rubbed
            options = {"slot": slot, "levels": self.levels}
            wrench = self._once(programs.joint_wrench, group.element, lanes, place.group, **options)
            wrench = wrench[:, :, place.instance]
            return teeth.without_undetermined_rates(wrench, self._reversals.get(place.group), place.instance)
        index, instance = self._force_index(name)
        lanes, options = (*self._acting(index, self.levels), self._sizes(index)), {"slot": slot, "levels": self.levels}
        return self._once(programs.force_wrench, self._free(index), lanes, index, **options)[:, :, instance]

    def applied_force(self, name: str) -> Numbers:
        """Return an applied force, as Taylor coefficients, (levels, components, time)."""
        coefficients = self.applied_coefficients(name)
        check_finite_values(self, coefficients, f"forces.{name}")
        return coefficients

    def applied_coefficients(self, name: str) -> Float[Numbers, "order component time"]:
        """Return an applied force, finite or not, as Taylor coefficients."""
        index, instance = self._force_index(name)
        return self._sizes(index)[:, :, instance]

    def _force_index(self, name: str) -> tuple[int, int]:
        """Return the group of an applied force, and its index in the group."""
        return next((k, names.index(name)) for k, names in enumerate(self.model.forces) if name in names)

    def _sizes(self, index: int) -> Float[Numbers, "order component instance time"]:
        """Return the applied forces of a group, as Taylor coefficients."""
        lanes = self._acting(index, self.levels + 1)
        return self._once(programs.applied, self._free(index), lanes, index, levels=self.levels)

    def _free(self, index: int) -> Group:
        """Return the forces of a group, with angles about axes of one instant."""
        return of_one_lane((self.motion.forces[index],))[0]

    def _acting(self, index: int, levels: int) -> tuple[programs.Acting, Any]:
        """Return the poses of the bodies of forces, the angles about axes between them, and the instants."""
        group = self.motion.forces[index]
        poses = [self.coordinates_of(slot, levels) for slot in group.bodies]
        return (poses, angles_of((group,))), self.motion.time

    def _once(self, program: Mapped, shared: Any, lanes: Any, *key: Any, **static: Any) -> Any:
        """Return the results of a program for all instants, cached by the program, a key and static arguments."""
        key = (program, *key, *static.items())
        if key not in self._numbers:
            self._numbers[key] = self.along(program, shared, lanes, **static)
        return self._numbers[key]

    def along(self, program: Mapped, shared: Any, lanes: Any, **static: Any) -> Any:
        """Return the results of a program for all instants."""
        return program.along(shared, lanes, pose_type=self.pose_type, **static)

    def _expressed(self, work: Numbers, body: int, frame: int | None, point: Numbers) -> tuple[Any, Any]:
        """Return force and moment about a point of a body, as `reaction` does, from a wrench of `_wrench`."""
        bodies = (body,) if frame is None else (body, frame)
        poses = [self.coordinates_of((b,), self.levels) for b in bodies]
        return self.along(programs.expressed, point[:, None, None], (work, poses))

    def coordinates_of(self, bodies: tuple[int, ...] | None, levels: int) -> dict[str, Any]:
        """Return coordinates of bodies, to a number of coefficients, as `part_of` does."""
        return part_of(self.coordinates, bodies, levels)

    def joint(self, index: int) -> tuple[Any, Any, Any]:
        """Return the poses of the bodies of a group, the time, and the loaded tooth flanks or None."""
        return self._poses(index), self.motion.time, self.flanks.get(index)

    def _poses(self, index: int) -> tuple[dict[str, Any], ...]:
        return tuple(self.coordinates_of(slot, self.levels) for slot in self.model.system.groups[index].bodies)

    def _of_group(self, index: ElementIndex) -> Float[Numbers, "order row instance time"]:
        """Return the multipliers of a group."""
        multipliers, group = self.multipliers[:, index.rows], self.model.system.groups[index.group]
        return multipliers.reshape(len(multipliers), -1, group.instances, multipliers.shape[-1])
