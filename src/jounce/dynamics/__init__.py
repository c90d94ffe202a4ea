"""Energies, equations of motion, and the forces of drivers, joints and applied loads, with their rates."""

from jounce.dynamics.energy.balances import (
    gravity_forces as gravity_forces,
    newton_euler as newton_euler,
    virtual_work as virtual_work,
)
from jounce.dynamics.energy.energies import (
    Energy as Energy,
    acceleration_energy as acceleration_energy,
    body_energy as body_energy,
    kinetic_energy as kinetic_energy,
)
from jounce.dynamics.energy.energy_outputs import (
    AccelerationEnergyOutput as AccelerationEnergyOutput,
    BodyAccelerationEnergyOutput as BodyAccelerationEnergyOutput,
    BodyKineticEnergyOutput as BodyKineticEnergyOutput,
    BodyPotentialEnergyOutput as BodyPotentialEnergyOutput,
    KineticEnergyOutput as KineticEnergyOutput,
    PotentialEnergyOutput as PotentialEnergyOutput,
)
from jounce.dynamics.energy.energy_terms import EnergyTerms as EnergyTerms, energy_terms as energy_terms
from jounce.dynamics.energy.equations import (
    catalan as catalan,
    energy_slope as energy_slope,
    gibbs_appell as gibbs_appell,
    higher_order as higher_order,
    lagrange as lagrange,
    mangeron_nielsen as mangeron_nielsen,
    printed_coefficient as printed_coefficient,
)
from jounce.dynamics.energy.potential import potential_energy as potential_energy, stored_energy as stored_energy
from jounce.dynamics.energy.power import power_balance as power_balance
from jounce.dynamics.inverse.constraint_equations import constraint_equations as constraint_equations
from jounce.dynamics.inverse.outputs.cam_outputs import (
    CamForceOutput as CamForceOutput,
    CamTorqueOutput as CamTorqueOutput,
)
from jounce.dynamics.inverse.outputs.cam_springs import ContactSpring as ContactSpring, contact_spring as contact_spring
from jounce.dynamics.inverse.outputs.components import (
    AppliedForceOutput as AppliedForceOutput,
    AppliedTorqueOutput as AppliedTorqueOutput,
    DriverForceOutput as DriverForceOutput,
    DriverTorqueOutput as DriverTorqueOutput,
    GroundForceOutput as GroundForceOutput,
    GroundTorqueOutput as GroundTorqueOutput,
    JointForceOutput as JointForceOutput,
    JointTorqueOutput as JointTorqueOutput,
)
from jounce.dynamics.inverse.outputs.reactions import (
    Reaction as Reaction,
    applied_force as applied_force,
    driver_force as driver_force,
    ground_reaction as ground_reaction,
    joint_reaction as joint_reaction,
)
from jounce.dynamics.limits.check_limits import check_limits as check_limits
from jounce.dynamics.limits.limit_report import LimitReport as LimitReport, LimitRow as LimitRow
from jounce.dynamics.limits.motion_ends import TrajectoryEnd as TrajectoryEnd, trajectory_ends as trajectory_ends
from jounce.dynamics.limits.trajectories import trajectory_torques as trajectory_torques
from jounce.dynamics.statics.holding_forces import holding_forces as holding_forces
from jounce.dynamics.statics.many_equilibria import equilibria as equilibria
from jounce.dynamics.statics.static_equilibrium import Equilibrium as Equilibrium, equilibrium as equilibrium
from jounce.dynamics.vibration.linearization import Linearization as Linearization, StateSpace as StateSpace
from jounce.dynamics.vibration.modes import Modes as Modes
from jounce.dynamics.vibration.small_motions import linearize as linearize
from jounce.settings import compute_under_own_settings as _compute_under_own_settings

_compute_under_own_settings(__name__)
