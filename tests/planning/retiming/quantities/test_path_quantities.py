"""What is limited along a path, against the motion that a time law makes of it: torques and rates, exact."""

import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce.planning.paths.paths import path_of
from jounce.planning.retiming.quantities.limits import MotionLimits, PointLimits
from jounce.planning.retiming.quantities.path_quantities import Curves
from jounce.planning.retiming.quantities.robot_quantities import RobotQuantities
from jounce.planning.retiming.rates.rate_law import RateLaw
from jounce.planning.retiming.rates.rate_motion import RateMotion
from jounce.planning.retiming.rates.rate_spline import Parametrization, RateBasis


@pytest.mark.slow
def test_curves_are_the_torques_rates_and_jounces_of_the_motion():
    robot = jn.load_robot("examples/robots/panda.urdf")
    names = robot.joint_names[:7]
    rng = np.random.default_rng(4)
    path = path_of(rng.uniform(-1, 1, (6, 7)), names)
    every = jn.Limits(velocity=1.0, acceleration=1.0, jerk=1.0, effort=1.0, effort_rate=1.0)
    limits = MotionLimits(
        dict.fromkeys(names, every), dict.fromkeys(names, 1.0), points=(PointLimits("panda_hand", 1.0, 1.0),)
    )
    source = RobotQuantities(robot, path, limits)
    share = np.linspace(0, 1, 51)
    parameter = Parametrization(share, share**2 * (3 - 2 * share), (3, 3))
    basis = RateBasis(30, 4)
    law = RateLaw(parameter, basis, rng.uniform(0.2, 0.5, basis.count))
    motion = RateMotion(np.linspace(0, 1, 31), basis.pieces(law.coefficients))
    times = np.linspace(0.05, 0.95, 23) * motion.duration
    u = np.asarray(motion(jn.Jet.variable(jnp.asarray(times), 0)).derivatives())[0]
    shape = parameter.derivatives(u, 4)
    first, second, rates, points, jounce = Curves(source(shape[0]), shape).values(law.at(u))
    progress = jn.laws.FollowingMotion(parameter, motion)
    moved = jn.JointTrajectory(
        {n: jn.laws.FollowingMotion(x, progress) for n, x in path.laws.items()}, 0.0, motion.duration
    )
    q = np.concatenate([moved.derivatives(times, 4), np.zeros((len(times), 5, 1))], axis=2)
    torques = jn.inverse_dynamics(robot, q[:, :4], drives=True)
    hand = jn.forward_kinematics(robot, q[:, :3], "panda_hand").position

    def close(found, expected):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())

    close(first[:, :7], np.abs(q[:, 1, :7]))
    close(second[:, :7], q[:, 2, :7])
    close(rates[:, :7], q[:, 3, :7])
    close(jounce, q[:, 4, :7])
    close(second[:, 7:14], torques[:, 0, :7])
    close(rates[:, 7:14], torques[:, 1, :7])
    close(first[:, 7], np.linalg.norm(hand[:, 1], axis=-1))
    close(points[:, 0], np.linalg.norm(hand[:, 2], axis=-1))
