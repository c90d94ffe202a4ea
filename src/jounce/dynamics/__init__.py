"""Energies and equations of motion: kinetic and acceleration energies of any order, generalised forces and rates."""

from jounce.dynamics.balances import (
    gravity_forces as gravity_forces,
    newton_euler as newton_euler,
    virtual_work as virtual_work,
)
from jounce.dynamics.energies import (
    Energy as Energy,
    acceleration_energy as acceleration_energy,
    body_energy as body_energy,
    kinetic_energy as kinetic_energy,
)
from jounce.dynamics.equations import (
    catalan as catalan,
    gibbs_appell as gibbs_appell,
    higher_order as higher_order,
    lagrange as lagrange,
    mangeron_nielsen as mangeron_nielsen,
    printed_coefficient as printed_coefficient,
)
from jounce.dynamics.limits import LimitReport as LimitReport, LimitRow as LimitRow, check_limits as check_limits
