"""The seven simulations of Sommer 2024 (sections 4 and 6), each beside an explicit geometric solution.

H. J. Sommer III, Kinematic jerk and jounce for multibody dynamics with joint constraints, Mechanism and Machine Theory
196 (2024) 105613.
"""

from jounce.papers.sommer_2024.cases import (
    QUANTITIES as QUANTITIES,
    VALIDATION_CASES as VALIDATION_CASES,
    Cycle as Cycle,
    ValidationCase as ValidationCase,
    nominal_cycle as nominal_cycle,
)
from jounce.papers.sommer_2024.differences import (
    backward_difference as backward_difference,
    central_difference as central_difference,
)
from jounce.papers.sommer_2024.measurement import Results as Results, measure as measure
from jounce.papers.sommer_2024.phase_lag import Lag as Lag, lags as lags
from jounce.papers.sommer_2024.reproduction import reproduce as reproduce
from jounce.settings import compute_under_own_settings as _compute_under_own_settings

_compute_under_own_settings(__name__)
