"""Indices of joints, drivers and forces among the groups and the rows of a system, by name."""

import dataclasses

from jounce.mechanism.building.builder import Model, group_rows


@dataclasses.dataclass(frozen=True)
class ElementIndex:
    """Indices of a joint or driver: its group, its instance in the group, the rows of the group, and its own rows."""

    group: int
    instance: int
    rows: slice
    own_rows: range


def element_indices(model: Model) -> dict[str, ElementIndex]:
    """Return the indices of all joints and drivers, by name."""
    indices = {}
    for index, (group, rows) in enumerate(zip(model.system.groups, group_rows(model), strict=True)):
        for instance, name in enumerate(model.rows[rows][: group.instances]):
            row_range = range(rows.start + instance, rows.stop, group.instances)
            indices[name.partition(".")[2]] = ElementIndex(index, instance, rows, row_range)
    return indices


def force_names(model: Model) -> list[str]:
    """Return the names of the applied forces in the order of the groups of a model."""
    return [name for members in model.forces for name in members]
