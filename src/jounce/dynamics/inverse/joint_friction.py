"""The joints with friction in a driven motion: their names, normal forces and friction power."""

from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.constraints.friction import UnitFriction
from jounce.dynamics.friction.coupling import has_friction, loses_torque
from jounce.dynamics.inverse import force_programs as programs
from jounce.dynamics.motion_values import cut
from jounce.execution.mapped import at_lanes
from jounce.mechanism.system import with_field


class JointFriction:
    """The friction in the joints of a motion.

    Parameters
    ----------
    forces : MotionForces
        The forces of the motion.
    """

    def __init__(self, forces: Any):
        self.forces = forces

    @property
    def first_rows(self) -> dict[int, int]:
        """First rows of the normal forces of groups with friction, below the multipliers, by the index of the group."""
        rubbing = [k for k, group in enumerate(self.forces.joined.groups) if has_friction(group)]
        counts = [self.forces.joined.groups[k].instances for k in rubbing]
        return {k: len(self.forces.model.rows) + sum(counts[:n]) for n, k in enumerate(rubbing)}

    @property
    def names(self) -> list[str]:
        """Names of the joints with friction."""
        return [name for name, place in self.forces.indices.items() if place.group in self.first_rows]

    def resisted(self, index: int) -> Float[Numbers, "order instance time"]:
        """Return the friction power of a group for a unit normal force, as Taylor coefficients."""
        forces, group = self.forces, self.forces.joined.groups[index]
        poses = [forces.coordinates_of(slot, forces.levels + 1) for slot in group.bodies]
        return forces.along(programs.resisted, group.element, poses, levels=forces.levels)

    def pressing_force(
        self, name: str, multipliers: Numbers, lanes: np.ndarray
    ) -> Float[Numbers, "order component time"]:
        """Return the force in a joint for multipliers of all rows, as Taylor coefficients; for gears, their
        multiplier.
        """
        place = self.forces.indices[name]
        group = self.forces.joined.groups[place.group]
        group_multipliers = multipliers[:, place.rows].reshape(len(multipliers), -1, group.instances, len(lanes))
        if loses_torque(group.element):
            return np.asarray(group_multipliers)[:, :, place.instance]
        joint, options = at_lanes(self.forces.joint(place.group), lanes), {"slot": group.moving_slots[-1]}
        arguments = *joint, group_multipliers, None
        works = self.forces.along(programs.joint_wrench, group.element, arguments, levels=self.forces.levels, **options)
        return works[:, : self.forces.pose_type.shifts, place.instance]

    @property
    def coefficients(self) -> Float[np.ndarray, " joint"]:
        """Friction coefficients, for gears the mean share of torque loss, of joints in the order of their groups."""
        return self._of_joints(lambda gear: gear.losses[0], lambda friction: friction.coefficient)

    @property
    def differences(self) -> Float[np.ndarray, " joint"]:
        """Half the difference of the forward and backward loss of gears; zero for other joints."""
        return self._of_joints(lambda gear: gear.losses[1], lambda _: 0.0)

    def _of_joints(self, of_gears: Callable[[Any], Any], of_joints: Callable[[Any], Any]) -> np.ndarray:
        """Return a value of the friction of each joint, in the order of their groups."""
        groups = [self.forces.joined.groups[k] for k in self.first_rows]
        values = [(of_gears if loses_torque(g.element) else of_joints)(g.element.friction) for g in groups]
        pairs = zip(values, groups, strict=True)
        return np.concatenate([np.zeros(0), *(np.broadcast_to(np.ravel(x), g.instances) for x, g in pairs)])

    def directions(self) -> list[int]:
        """Return the joint of each direction of slip, in the order of the joints."""
        joints: list[int] = []
        for index in self.first_rows:
            count = self._slips(index)
            first = joints[-1] + 1 if joints else 0
            joints += [first + k for k in range(self.forces.joined.groups[index].instances) for _ in range(count)]
        return joints

    def _slips(self, index: int) -> int:
        """Return the number of directions in which the joints of a group slip."""
        group = self.forces.joined.groups[index]
        poses = at_lanes([self.forces.coordinates_of(slot, 2) for slot in group.bodies], np.zeros(1, int))
        return programs.slip_directions(group.element, poses, self.forces.pose_type)

    def responses(self) -> Float[np.ndarray, "direction row time"]:
        """Return the multipliers that balance a unit friction force in each direction of slip, at rest."""
        forces = self.forces

        def arguments_of(lanes: np.ndarray) -> Any:
            loads = np.concatenate([self._unit_loads(index, lanes) for index in self.first_rows])
            bodies, _, flanks, instants = at_lanes(forces.balance, lanes)
            return cut(bodies, 0), flanks, instants, loads

        options = {"pose_type": forces.pose_type}
        return programs.responses.at_instants(forces.joined, arguments_of, len(forces.motion.time), **options)[0]

    def _unit_loads(self, index: int, lanes: np.ndarray) -> Float[np.ndarray, "direction coordinate body time"]:
        """Return the wrenches on bodies for a unit friction force in each direction of slip of a group."""
        forces, group = self.forces, self.forces.joined.groups[index]
        poses = at_lanes([forces.coordinates_of(slot, 2) for slot in group.bodies], lanes)
        count, bodies = self._slips(index), len(forces.model.bodies)
        components = forces.pose_type.shifts + forces.pose_type.turns
        loads = np.zeros((group.instances, count, components, bodies + 1, len(lanes)))
        for direction in range(count):
            radius = None if loses_torque(group.element) else group.element.friction.radius
            unit = with_field(group, "friction", UnitFriction(radius, direction)).element
            for slot in group.moving_slots:
                options = {"pose_type": forces.pose_type, "slot": slot, "levels": 1}
                slope = programs.friction_slopes.program(unit, poses, **options)(poses)[0, :, 0]
                for instance, body in enumerate(group.bodies[slot]):
                    loads[instance, direction, :, body] += slope[:, instance]
        return loads[:, :, :, 1:].reshape(-1, components, bodies, len(lanes))

    def pressing(self, multipliers: Float[Numbers, "row time"]) -> Float[np.ndarray, "joint component time"]:
        """Return the components of the normal force of each joint, N, at order zero, padded with zeros.

        For gears, return the transmitted torque, N m.
        """
        forces = self.forces

        components = []
        for index in self.first_rows:
            group = forces.joined.groups[index]
            group_multipliers = multipliers[self._rows(index)].reshape(-1, group.instances, multipliers.shape[-1])
            arguments = *forces.joint(index), group_multipliers
            force = forces.along(programs.pressing, group.element, arguments, slot=group.moving_slots[-1])
            components.append(np.pad(force, [(0, forces.pose_type.shifts - len(force)), (0, 0), (0, 0)]))
        return np.concatenate(components, axis=1).swapaxes(0, 1)

    def _rows(self, index: int) -> slice:
        """Return the rows of a group."""
        return next(place.rows for place in self.forces.indices.values() if place.group == index)

    def normal_force(self, name: str) -> Float[Numbers, "order 1 time"]:
        """Return the normal force between the surfaces of a joint with friction, N, as Taylor coefficients; for gears,
        the torque loss, N m.
        """
        place = self.forces.indices[name]
        row = self.first_rows[place.group] + place.instance
        return self.forces._balancing[0][:, row : row + 1]
