"""The seven simulations of Sommer 2024 (sections 4 and 6), each against an explicit geometric solution.

H. J. Sommer III, Kinematic jerk and jounce for multibody dynamics with joint constraints, Mechanism and Machine Theory
196 (2024) 105613.
"""

from jounce.papers.sommer_2024.differences import central_difference as central_difference
from jounce.papers.sommer_2024.reproduce import reproduce as reproduce
from jounce.papers.sommer_2024.simulations import (
    QUANTITIES as QUANTITIES,
    SIMULATIONS as SIMULATIONS,
    Cycle as Cycle,
    Results as Results,
    Simulation as Simulation,
    measure as measure,
    nominal_cycle as nominal_cycle,
)
