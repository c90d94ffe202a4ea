"""Kinetic, potential and acceleration energies, and equations of motion from them."""

from jounce.dynamics import (
    Energy as Energy,
    EnergyTerms as EnergyTerms,
    acceleration_energy as acceleration_energy,
    energy_slope as energy_slope,
    energy_terms as energy_terms,
    gibbs_appell as gibbs_appell,
    higher_order as higher_order,
    kinetic_energy as kinetic_energy,
    lagrange as lagrange,
    mangeron_nielsen as mangeron_nielsen,
    potential_energy as potential_energy,
    power_balance as power_balance,
)
