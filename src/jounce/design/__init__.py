"""Design: parameters that vary, designs in which something is least, and how tolerances spread."""

from jounce.design.optimise import optimise as optimise
from jounce.design.result import OptimisedDesign as OptimisedDesign
from jounce.design.tolerance import tolerance as tolerance
from jounce.precision import compute_in_double as _compute_in_double

_compute_in_double(__name__)
