"""What an optimization found: the design, what became of it, and how sure that is."""

import dataclasses
from collections.abc import Mapping
from functools import cached_property
from typing import Any

from jounce.base.display import Displayed
from jounce.kinematics import Motion, solve
from jounce.mechanism import Mechanism


@dataclasses.dataclass(frozen=True)
class Comparison:
    """One quantity before and after.

    Attributes
    ----------
    kind : str
        ``"objective"``, ``"condition"`` or ``"parameter"``.
    name : str
        What was asked for, or the name of a parameter.
    before, after : float
        SI; of a condition, the side that is a measure; NaN where the first design locks.
    low, high : float or None
        What it must not be below and above; both the same for what it must be.
    multiplier : float
        How much the objective changes with what bounds it, by one unit; zero where nothing does.
    """

    kind: str
    name: str
    before: float
    after: float
    low: float | None = None
    high: float | None = None
    multiplier: float = 0.0

    @property
    def active(self) -> bool:
        """Whether the objective would change with the bound."""
        return self.multiplier != 0.0


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class OptimizedDesign(Displayed):
    """The design that an optimization found.

    Attributes
    ----------
    mechanism : Mechanism
        With the parameters found; it is what was given otherwise.
    parameters : dict of str to float
        Those that were varied, SI.
    objective : float
        What was to be least, of this design, refined between instants, SI.
    status : str
        ``"optimal"``: no design nearby is better, to the first order, and all conditions hold; ``"feasible"``: all
        conditions hold, and the search ended before no better one was near; ``"infeasible"``: conditions do not hold.
    message : str
        In words.
    comparisons : tuple of Comparison
        Objective, conditions and parameters, before and after.
    smallest_singular_value : float
        Of the scaled Jacobian along the motion; a design locks where it vanishes.
    residual : float
        Of the first-order conditions, relative to the slope of the objective.
    grid_error : float
        By how much objective and conditions differ on a grid four times as fine, relative.
    searches : tuple of float
        The objective that each search ended with; NaN where conditions did not hold.
    evaluations : int
        How many designs were solved with their slopes.
    notes : tuple of str
        What a designer should know besides, such as bounds that no design can be put together at.
    """

    mechanism: Mechanism
    parameters: Mapping[str, float]
    objective: float
    status: str
    message: str
    comparisons: tuple[Comparison, ...]
    smallest_singular_value: float
    residual: float
    grid_error: float
    searches: tuple[float, ...]
    evaluations: int
    notes: tuple[str, ...] = ()

    @property
    def success(self) -> bool:
        """Whether the design is optimal, to the first order, and all conditions hold."""
        return self.status == "optimal"

    @property
    def multipliers(self) -> dict[str, float]:
        """How much the objective changes with what bounds it, by one unit: active conditions and bounds, by name."""
        return {row.name: row.multiplier for row in self.comparisons if row.active}

    @cached_property
    def motion(self) -> Motion:
        """The motion of the design at the instants of the mechanism, to jounce."""
        return solve(self.mechanism)

    def __repr__(self) -> str:
        before = self.comparisons[0].before
        return f"<OptimizedDesign {self.status}: {self.comparisons[0].name} {before:.6g} -> {self.objective:.6g}>"

    @property
    def table(self) -> list[dict[str, Any]]:
        """What became of objective, conditions and parameters, as rows for `pandas.DataFrame` or a printout."""
        return [dataclasses.asdict(row) for row in self.comparisons]
