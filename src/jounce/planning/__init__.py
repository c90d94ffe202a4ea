"""Planning: commands for a controller from a path or a task: time laws, joint motion of tool paths, feedforward."""

from jounce.planning.elastic.drives import Drive as Drive
from jounce.planning.elastic.feedforward import feedforward as feedforward
from jounce.planning.elastic.link_errors import LinkErrors as LinkErrors, link_errors as link_errors
from jounce.planning.elastic.motor_motion import (
    DriveReport as DriveReport,
    Feedforward as Feedforward,
    MotorMotion as MotorMotion,
)
from jounce.planning.elastic.robot import elastic_robot as elastic_robot
from jounce.planning.elastic.simulation import simulate_elastic as simulate_elastic
from jounce.planning.elastic.spring_deflection import SpringDeflection as SpringDeflection
from jounce.planning.retiming.quantities.limits import MotionLimits as MotionLimits, PointLimits as PointLimits
from jounce.planning.retiming.retime import retime as retime
from jounce.planning.retiming.retimed import RetimedTrajectory as RetimedTrajectory
from jounce.planning.smoothing.smooth import (
    SmoothedJoint as SmoothedJoint,
    SmoothedTrajectory as SmoothedTrajectory,
    smooth as smooth,
)
from jounce.planning.tool_paths.follow_tool_path import follow_tool_path as follow_tool_path
from jounce.planning.tool_paths.inverse_kinematics import inverse_kinematics as inverse_kinematics
from jounce.planning.tool_paths.joint_poses import JointPoses as JointPoses
from jounce.planning.tool_paths.tool_path import ToolPath as ToolPath
from jounce.planning.tool_paths.tool_path_motion import ToolPathMotion as ToolPathMotion
from jounce.settings import compute_under_own_settings as _compute_under_own_settings

_compute_under_own_settings(__name__)
