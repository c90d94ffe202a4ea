"""Design: parameter variations, design optimization, and the spread of outputs by tolerances."""

from jounce.design.optimization.optimize import optimize as optimize
from jounce.design.optimization.result import OptimizedDesign as OptimizedDesign
from jounce.design.tolerances.spread import tolerance as tolerance
from jounce.settings import compute_under_own_settings as _compute_under_own_settings

_compute_under_own_settings(__name__)
