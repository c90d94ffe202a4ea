"""The result of an optimization: the design, comparisons with the first one, and checks."""

import dataclasses
from collections.abc import Mapping
from functools import cached_property
from typing import Any

from jounce.base.display import Displayed
from jounce.kinematics import Motion, solve
from jounce.mechanism import Mechanism


@dataclasses.dataclass(frozen=True)
class Comparison:
    """One quantity before and after the optimization.

    Attributes
    ----------
    kind : str
        ``"objective"``, ``"condition"`` or ``"parameter"``.
    name : str
        The text of the objective or condition, or the name of a parameter.
    before, after : float
        Values, SI; for a condition, those of the side that is a measure; NaN if the first design locks.
    low, high : float or None
        Lower and upper bound; the same for an equality.
    multiplier : float
        Change of the objective per unit of the bound; zero if no bound is active.
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
        The given mechanism with the optimized parameters.
    parameters : dict of str to float
        The varied parameters, SI.
    objective : float
        The objective of this design, refined between instants, SI.
    status : str
        ``"optimal"``: to first order no design nearby is better, and all conditions hold; ``"feasible"``: all
        conditions hold, but the search ended before optimality; ``"infeasible"``: conditions do not hold.
    message : str
        The status in words.
    comparisons : tuple of Comparison
        Objective, conditions and parameters, before and after.
    smallest_singular_value : float
        Smallest singular value of the scaled Jacobian along the motion; a design locks where it vanishes.
    residual : float
        Residual of the first-order conditions, relative to the slope of the objective.
    grid_error : float
        Relative difference of objective and conditions on a grid four times as fine.
    searches : tuple of float
        Final objective of each search; NaN if conditions did not hold.
    evaluations : int
        Number of designs solved with their slopes.
    notes : tuple of str
        Remarks for the designer, such as bounds at which no design can be assembled.
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
        """Whether the design is optimal to first order and all conditions hold."""
        return self.status == "optimal"

    @property
    def multipliers(self) -> dict[str, float]:
        """Change of the objective per unit of each active condition or bound, by name."""
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
        """Objective, conditions and parameters before and after, as rows for `pandas.DataFrame` or a printout."""
        return [dataclasses.asdict(row) for row in self.comparisons]
