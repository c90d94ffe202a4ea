"""Exact time derivatives of any order of mechanisms and robots: jerk, jounce and beyond, torques and their rates.

Importing this package switches JAX to double precision (``jax_enable_x64``); it has no other side effect but a
mark that a process gets when it is forked, see `jounce.mechanism.preconditions`.
"""

from jounce.interrupts import end_on_signals as _end_on_signals, is_command as _is_command

if _is_command():  # before the libraries, which take a second
    _end_on_signals()

import jax as _jax

_jax.config.update("jax_enable_x64", True)

from jounce import (  # noqa: E402 - after the switch
    dynamics as dynamics,
    forces as forces,
    jet as jet,
    rigid as rigid,
    robot as robot,
)
from jounce.constraints import (  # noqa: E402
    AbstractConstraint as AbstractConstraint,
    Scalar as Scalar,
    Vector as Vector,
    drivers as drivers,
    planar as planar,
    rows as rows,
    spatial as spatial,
)
from jounce.dynamics import (  # noqa: E402
    AccelerationEnergyOutput as AccelerationEnergyOutput,
    AppliedForceOutput as AppliedForceOutput,
    AppliedTorqueOutput as AppliedTorqueOutput,
    BodyAccelerationEnergyOutput as BodyAccelerationEnergyOutput,
    BodyKineticEnergyOutput as BodyKineticEnergyOutput,
    BodyPotentialEnergyOutput as BodyPotentialEnergyOutput,
    DriverForceOutput as DriverForceOutput,
    DriverTorqueOutput as DriverTorqueOutput,
    Energy as Energy,
    EnergyTerms as EnergyTerms,
    JointForceOutput as JointForceOutput,
    JointTorqueOutput as JointTorqueOutput,
    KineticEnergyOutput as KineticEnergyOutput,
    LimitReport as LimitReport,
    PotentialEnergyOutput as PotentialEnergyOutput,
    Reaction as Reaction,
    acceleration_energy as acceleration_energy,
    applied_force as applied_force,
    check_limits as check_limits,
    constraint_equations as constraint_equations,
    driver_force as driver_force,
    energy_slope as energy_slope,
    energy_terms as energy_terms,
    joint_reaction as joint_reaction,
    kinetic_energy as kinetic_energy,
    potential_energy as potential_energy,
    power_balance as power_balance,
)
from jounce.errors import (  # noqa: E402
    AssemblyError as AssemblyError,
    ExpressionError as ExpressionError,
    JounceError as JounceError,
    MechanismError as MechanismError,
    MechanismFileError as MechanismFileError,
    MobilityError as MobilityError,
    OutputError as OutputError,
    RobotError as RobotError,
    RobotFileError as RobotFileError,
    RobotWarning as RobotWarning,
    SampleWarning as SampleWarning,
    SingularityError as SingularityError,
    SolveError as SolveError,
    TrajectoryError as TrajectoryError,
    UnitError as UnitError,
    UnitWarning as UnitWarning,
    UnsupportedError as UnsupportedError,
)
from jounce.forces import AbstractForce as AbstractForce, Law as Law, Laws as Laws  # noqa: E402
from jounce.integrate import (  # noqa: E402
    Batch as Batch,
    Event as Event,
    Obreshkov as Obreshkov,
    Simulation as Simulation,
    Taylor as Taylor,
    ode_term as ode_term,
    simulate as simulate,
    simulate_batch as simulate_batch,
)
from jounce.io import (  # noqa: E402
    load as load,
    load_limits as load_limits,
    load_robot as load_robot,
    load_trajectory as load_trajectory,
    write_mechanism as write_mechanism,
)
from jounce.jet import Jet as Jet, compose as compose  # noqa: E402
from jounce.kinematics import Motion as Motion, Status as Status, solve as solve  # noqa: E402
from jounce.mechanism import (  # noqa: E402
    AbstractOutput as AbstractOutput,
    AngleOutput as AngleOutput,
    AngularVelocityOutput as AngularVelocityOutput,
    Body as Body,
    DistanceOutput as DistanceOutput,
    EulerAnglesOutput as EulerAnglesOutput,
    EulerParametersOutput as EulerParametersOutput,
    Mechanism as Mechanism,
    PlanarRelativeAngleOutput as PlanarRelativeAngleOutput,
    PointOutput as PointOutput,
    RelativeAngleOutput as RelativeAngleOutput,
    RelativeEulerAnglesOutput as RelativeEulerAnglesOutput,
    RelativeEulerParametersOutput as RelativeEulerParametersOutput,
    RelativeRotationMatrixOutput as RelativeRotationMatrixOutput,
    RotationMatrixOutput as RotationMatrixOutput,
    TimeGrid as TimeGrid,
)
from jounce.robot import (  # noqa: E402
    Closure as Closure,
    FrameMotion as FrameMotion,
    Inertia as Inertia,
    Joint as Joint,
    Limits as Limits,
    Link as Link,
    Mimic as Mimic,
    Robot as Robot,
    Wrench as Wrench,
    bias_forces as bias_forces,
    center_of_mass as center_of_mass,
    forward_kinematics as forward_kinematics,
    inverse_dynamics as inverse_dynamics,
    jacobian as jacobian,
    joint_motion as joint_motion,
    joint_wrenches as joint_wrenches,
    mass_matrix as mass_matrix,
    operational_accelerations as operational_accelerations,
)
from jounce.trajectory import (  # noqa: E402
    CycloidalMotion as CycloidalMotion,
    Expression as Expression,
    ExpressionMotion as ExpressionMotion,
    FunctionMotion as FunctionMotion,
    JointTrajectory as JointTrajectory,
    MeasuredMotion as MeasuredMotion,
    PolynomialMotion as PolynomialMotion,
    RestToRestMotion as RestToRestMotion,
    SplineMotion as SplineMotion,
    TrapezoidalMotion as TrapezoidalMotion,
    motion_profile as motion_profile,
)
from jounce.trajectory.units import elsewhere as _elsewhere  # noqa: E402

__version__ = "0.4.0"


def _asked_of_pint(name: str) -> object:
    """Look a unit up that is not in the table."""
    from jounce.io.files.units import ask_pint

    return ask_pint(name)


_elsewhere.append(_asked_of_pint)  # type: ignore[arg-type]
