"""The joints with friction of a driven motion: which they are, what presses them, and the power that they take."""

from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.dynamics.friction.coupling import rubs
from jounce.dynamics.inverse import force_programs as programs

__all__ = ["JointFriction"]


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
        """Where the normal forces of groups with friction begin, below the multipliers, by the index of the group."""
        rubbing = [k for k, group in enumerate(self.forces._joined.groups) if rubs(group)]
        counts = [self.forces._joined.groups[k].instances for k in rubbing]
        return {k: len(self.forces.model.rows) + sum(counts[:n]) for n, k in enumerate(rubbing)}

    def slopes(self, index: int, lanes: np.ndarray) -> programs.Rubbed:
        """Return what is to be known of the friction of a group at some instants."""
        group = self.forces._joined.groups[index]
        moving = [self.forces.coordinates_at(slot, lanes, self.forces.levels + 1) for slot in group.bodies]
        slots = group.moving_slots
        slopes = [
            programs.friction_slopes(group.element, moving, self.forces.pose_type, s, self.forces.levels) for s in slots
        ]
        return slopes, self.forces._poses(index, lanes)

    @property
    def names(self) -> list[str]:
        """The names of the joints with friction."""
        return [name for name, place in self.forces.indices.items() if place.group in self.first_rows]

    def resisted(self, index: int, lanes: np.ndarray) -> Float[Numbers, "order instance time"]:
        """Return the power that friction takes for a normal force of one, of a group at some instants."""
        group = self.forces._joined.groups[index]
        moving = [self.forces.coordinates_at(slot, lanes, self.forces.levels + 1) for slot in group.bodies]
        return programs.resisted(group.element, moving, self.forces.pose_type, self.forces.levels)

    def pressing_force(
        self, name: str, multipliers: Numbers, lanes: np.ndarray
    ) -> Float[Numbers, "order component time"]:
        """Return what multipliers of all rows exert in a joint on one of its bodies, as Taylor coefficients."""
        place = self.forces.indices[name]
        group = self.forces._joined.groups[place.group]
        own = multipliers[:, place.rows].reshape(len(multipliers), -1, group.instances, len(lanes))
        works = programs.wrenches(self.forces._slopes(place.group, group.moving_slots[-1], lanes), own)
        return np.asarray(works)[:, : self.forces.pose_type.shifts, place.instance]

    def normal_force(self, name: str) -> Float[Numbers, "order 1 time"]:
        """Return what presses the surfaces of a joint with friction together, N, as Taylor coefficients."""
        place = self.forces.indices[name]
        row = self.first_rows[place.group] + place.instance
        return self.forces._balancing[0][:, row : row + 1]
