"""Values as people write them: numbers with units, expressions, their dimensions, and the units of results."""

from jounce.settings import compute_under_own_settings as _compute_under_own_settings
from jounce.units.expression import Expression as Expression
from jounce.units.shown_units import ShownUnits as ShownUnits

_compute_under_own_settings(__name__)
