"""Public names of release 0.4 and their replacements from 0.5 on; old names work for one release, with a warning."""

import functools
import sys
import warnings
from collections.abc import Callable, Mapping
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

RENAMED = {
    "optimise": "optimize",
    "linearise": "linearize",
    "OptimisedDesign": "design.OptimizedDesign",
    "Linearisation": "dynamics.Linearization",
}
MOVED = {
    "cams": """
        Extreme OscillatingFollower PlateCam TranslatingFollower Undercut load_cam plate_cam
    """,
    "dynamics": """
        Equilibrium LimitReport Modes Reaction StateSpace applied_force equilibria ground_reaction
    """,
    "energy": """
        Energy EnergyTerms acceleration_energy energy_slope energy_terms kinetic_energy potential_energy
        power_balance
    """,
    "errors": """
        AssemblyError AssemblyWarning ContractError DamageWarning DesignError ExpressionError MachineCodeWarning
        MechanismError MechanismFileError MobilityError OutputError ProgramFolderWarning RobotError RobotFileError
        RobotWarning SampleWarning SingularityError SolveError TrajectoryError UnitError UnitWarning
        UnsupportedError
    """,
    "forces": """
        AbstractForce Law Laws
    """,
    "integrate": """
        Batch JointEvent RobotSimulation Simulation ode_term
    """,
    "io": """
        export_trajectory in_units load_drives load_limits
    """,
    "jet": """
        compose
    """,
    "joints": """
        AbstractConstraint Cam ParametricCurve SampledCurve Scalar Vector rows
    """,
    "kinematics": """
        Assemblies Assembly Branch Curve LimitPosition Mobility
    """,
    "laws": """
        Continuity CycloidalMotion Expression ExpressionMotion FollowingMotion FunctionMotion HermiteMotion
        IntegratedMotion MeasuredMotion OutputMotion PiecewiseMotion PolynomialMotion RestToRestMotion Segment
        SegmentedMotion SplineMotion TrapezoidalMotion continuity motion_profile
    """,
    "outputs": """
        AbstractOutput AccelerationEnergyOutput AngleOutput AngularVelocityOutput AppliedForceOutput
        AppliedTorqueOutput BodyAccelerationEnergyOutput BodyKineticEnergyOutput BodyPotentialEnergyOutput
        CamForceOutput CamTorqueOutput DerivativeOutput DistanceOutput DriverAngleOutput DriverDisplacementOutput
        DriverForceOutput DriverTorqueOutput EulerAnglesOutput EulerParametersOutput GroundForceOutput
        GroundTorqueOutput InstantCenterOutput JointForceOutput JointTorqueOutput KineticEnergyOutput
        ParameterOutput ParametersOutput PlanarRelativeAngleOutput PointOutput PotentialEnergyOutput
        ProjectedAngleOutput RelativeAngleOutput RelativeEulerAnglesOutput RelativeEulerParametersOutput
        RelativeRotationMatrixOutput RollCenterOutput RotationMatrixOutput SpatialInstantCenterOutput
        SymmetricRollCenterOutput
    """,
    "planning": """
        Drive Feedforward JointPoses MotionLimits MotorMotion PointLimits RetimedTrajectory ToolPath ToolPathMotion
        feedforward follow_tool_path simulate_elastic
    """,
    "robot": """
        BaseMotion Closure FrameMotion Mimic Wrench center_of_mass joint_motion joint_wrenches
        operational_accelerations
    """,
}


def new_name(old: str) -> str | None:
    """Return the new name of a public name of release 0.4, such as "outputs.PointOutput"; None for other names."""
    for module, names in MOVED.items():
        if old in names.split():
            return f"{module}.{old}"
    return RENAMED.get(old)


def old_keyword(old: str, new: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator that lets a function accept a keyword of release 0.4, too, with a warning."""

    def accepting(function: Callable[P, R]) -> Callable[P, R]:
        @functools.wraps(function)
        def call(*arguments: P.args, **keywords: P.kwargs) -> R:
            if old in keywords and new not in keywords:
                warnings.warn(f"the keyword {old} is {new} from release 0.5 on", DeprecationWarning, stacklevel=2)
                keywords[new] = keywords.pop(old)
            return function(*arguments, **keywords)

        return call

    return accepting


def renamed(module: str, names: Mapping[str, str]) -> Callable[[str], Any]:
    """Return the `__getattr__` of a module that returns renamed objects for their old names, with a warning."""

    def get(old: str) -> Any:
        if old not in names:
            raise AttributeError(f"module {module!r} has no attribute {old!r}")
        warnings.warn(f"{module}.{old} is {names[old]} from release 0.5 on", DeprecationWarning, stacklevel=2)
        return getattr(sys.modules[module], names[old])

    return get
