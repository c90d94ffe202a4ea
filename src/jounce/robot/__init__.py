"""Serial and tree robots in joint coordinates: kinematics, Jacobians, torques, reactions, with rates of any order."""

from jounce.rigid.inertia import Inertia as Inertia
from jounce.robot.algorithms.base_motion import BaseMotion as BaseMotion
from jounce.robot.algorithms.carried_loads import (
    CarriedLoad as CarriedLoad,
    LoadChange as LoadChange,
    LoadedRobot as LoadedRobot,
)
from jounce.robot.algorithms.equations_of_motion import bias_forces as bias_forces, mass_matrix as mass_matrix
from jounce.robot.algorithms.forward_dynamics import forward_dynamics as forward_dynamics
from jounce.robot.algorithms.inverse_dynamics import (
    inverse_dynamics as inverse_dynamics,
    joint_wrenches as joint_wrenches,
)
from jounce.robot.algorithms.jacobian import (
    jacobian as jacobian,
    operational_accelerations as operational_accelerations,
    point_slope as point_slope,
)
from jounce.robot.algorithms.joint_motion import JointMotion as JointMotion, joint_motion as joint_motion
from jounce.robot.algorithms.wrenches import Wrench as Wrench
from jounce.robot.closed_loops.closed_loop import body_point as body_point
from jounce.robot.closed_loops.closures import LinkClosure as LinkClosure, closure_wrenches as closure_wrenches
from jounce.robot.closed_loops.coupling import CoupledJoints as CoupledJoints, SlideOutput as SlideOutput
from jounce.robot.construct import (
    DenavitHartenberg as DenavitHartenberg,
    JointAxis as JointAxis,
    from_denavit_hartenberg as from_denavit_hartenberg,
    from_screws as from_screws,
)
from jounce.robot.model.couplings import BallDrive as BallDrive, Tendon as Tendon
from jounce.robot.model.links_and_joints import (
    Closure as Closure,
    Joint as Joint,
    Limits as Limits,
    Link as Link,
)
from jounce.robot.model.mimics import Mimic as Mimic
from jounce.robot.recursions.kinematics import (
    FrameMotion as FrameMotion,
    center_of_mass as center_of_mass,
    forward_kinematics as forward_kinematics,
)
from jounce.robot.robot import Robot as Robot
from jounce.settings import compute_under_own_settings as _compute_under_own_settings

_compute_under_own_settings(__name__)
