"""Outputs of designs on both sides of breaks of their laws, where an extreme value may be a one-sided limit."""

import dataclasses
from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from jounce.errors import JounceError
from jounce.mechanism import Mechanism
from jounce.mechanism.laws.law_breaks import breaks_depend_on, breaks_of_laws, laws_may_break
from jounce.settings import under_own_settings
from jounce.trajectory.law_checks.breaks import both_sides


@dataclasses.dataclass(frozen=True, eq=False)
class Sides:
    """Outputs of designs on both sides of breaks of their laws; NaN where a design has fewer breaks.

    Attributes
    ----------
    instants : array of shape (designs, sides)
        Instants of the breaks, s.
    values : dict of str to array of shape (designs, sides, order + 1, ...)
    """

    instants: Float[np.ndarray, "design side"]
    values: dict[str, np.ndarray]

    def like(self, values: Mapping[str, np.ndarray]) -> "Sides":
        """Return the sides with the component axes of other values of the same outputs."""
        arrays = {name: array.reshape(*array.shape[:3], *values[name].shape[3:]) for name, array in self.values.items()}
        return dataclasses.replace(self, values=arrays)


@under_own_settings
def sides_of_designs(
    mechanism: Mechanism,
    parameters: Mapping[str, np.ndarray],
    first: float,
    last: float,
    order: int,
    *,
    forces: bool | None = None,
) -> tuple[Float[np.ndarray, "design side"], Float[np.ndarray, "design side"]]:
    """Return the breaks of the laws of each design, and the instants on both sides of them.

    For a design with fewer breaks than others, the first instant fills the rest. `forces` selects laws of forces as in
    `breaks_of_laws`.
    """
    count = len(next(iter(parameters.values())))
    distinct_count = 0
    if laws_may_break(mechanism, forces=forces):
        distinct_count = count if breaks_depend_on(mechanism, parameters) else 1
    sides = []
    for k in range(distinct_count):
        try:
            design = mechanism.with_parameters(**{name: float(values[k]) for name, values in parameters.items()})
            breaks = breaks_of_laws(design, first, last, order, forces=forces)
        except JounceError:  # raised again when the design is solved
            breaks = np.zeros(0)
        instants, indices = both_sides(breaks, first, last)
        sides.append((breaks[indices], instants))
    width = max((len(instants) for _, instants in sides), default=0)
    pairs = np.full((2, count, width), first)
    for k, pair in enumerate(sides * (count // max(distinct_count, 1))):
        pairs[:, k, : len(pair[0])] = pair
    return pairs[0], pairs[1]
