"""Loads that change along a path: fastest motions of carts on paper, pieces one by one, torques of Pinocchio."""

import dataclasses

import numpy as np
import pytest

import jounce as jn
from jounce.errors import TrajectoryError
from jounce.io import load_limits
from jounce.planning.paths.path import Path
from jounce.planning.paths.paths import Between, path_of
from jounce.robot import CarriedLoad

G = 9.81


def cart(axis=(1, 0, 0), **limits):
    slide = jn.Joint("slide", "base", "cart", "prismatic", axis=axis, limits=jn.Limits(**limits))
    return jn.Robot("cart", [jn.Link("base"), jn.Link("cart", jn.Inertia(1.0))], [slide])


@pytest.mark.slow
def test_a_lift_stops_for_its_load_and_is_as_fast_as_its_force_allows():
    load = CarriedLoad("cart", jn.Inertia(0.5), 2, by="waypoint")
    found = jn.retime(cart((0, 0, 1), effort=30.0), {"slide": [0.0, 1.0, 3.0]}, loads=[load], order=1)

    def least(distance, mass):
        return np.sqrt(2 * distance * (1 / (30 / mass - G) + 1 / (30 / mass + G)))

    assert found.stop == pytest.approx(least(1.0, 1.0) + least(2.0, 1.5), rel=1.5e-2)
    assert found.stop > least(1.0, 1.0) + least(2.0, 1.5)
    (change,) = found.report.loads
    assert change.steps["slide"] == pytest.approx(0.5 * 20.0, rel=1e-2)  # it speeds up by 30 N on 1.5 kg from there
    assert change.speed < 1e-9
    assert found.derivatives([change.time], 0)[0, 0, 0] == pytest.approx(1.0, abs=1e-9)
    slower = found.slower(2.0)
    assert slower.loads[0].start == pytest.approx(2 * change.time, rel=1e-12)


@pytest.mark.slow
def test_a_load_that_is_taken_up_in_motion_is_braked_for_before():
    load = CarriedLoad("cart", jn.Inertia(1.0), 0.5, by="share", moving=True)
    found = jn.retime(cart(effort=1.0), {"slide": [0.0, 2.0]}, loads=[load], order=1)
    # 1 m/s^2 to 0.75 m, braking to 1 m/s at 1 m, then at 0.5 m/s^2 to rest
    assert found.stop == pytest.approx(2 * np.sqrt(1.5) - 1 + 2.0, rel=5e-3)
    (change,) = found.report.loads
    assert change.speed == pytest.approx(1.0, rel=2e-2)
    assert found.report.kept


@pytest.mark.slow
def test_a_repaired_trajectory_carries_too():
    given = jn.JointTrajectory({"slide": "2*(10*(t/2)**3 - 15*(t/2)**4 + 6*(t/2)**5)"}, 0.0, 2.0)  # 2.887 m/s^2 at most
    robot = cart(effort=3.0)
    assert jn.retime(robot, given, repair=True).stop == pytest.approx(2.0, abs=1e-9)
    load = CarriedLoad("cart", jn.Inertia(1.0), 0.2, 1.8)
    found = jn.retime(robot, given, repair=True, loads=[load])
    assert found.stop > 2.1
    at = np.linspace(0.0, found.stop, 5001)
    inside = (at >= found.loads[0].start) & (at < found.loads[0].stop)
    forces = found.derivatives(at, 2)[:, 2, 0] * np.where(inside, 2.0, 1.0)
    assert np.abs(forces).max() <= 3.0 * (1 + 1e-6)
    np.testing.assert_allclose(found.derivatives([found.loads[0].start], 0), given.derivatives([0.2], 0))


def test_places_that_are_not_on_the_path_are_reported():
    path, robot = {"slide": [0.0, 1.0, 3.0]}, cart(effort=30.0)
    for place, words in (
        ({"start": 4, "by": "waypoint"}, "waypoints go from 1 to 3"),
        ({"start": 0.5, "by": "time"}, "nothing of time"),
        ({"start": 1.5, "by": "share"}, "from 0 to 1"),
    ):
        with pytest.raises(TrajectoryError, match=words):
            jn.retime(robot, path, loads=[CarriedLoad("cart", jn.Inertia(0.5), **place)])
    load = CarriedLoad("cart", jn.Inertia(2.0), 0.5, by="share")
    with pytest.raises(TrajectoryError, match="standing still requires a force of 29"):
        jn.retime(cart((0, 0, 1), effort=25.0), path, loads=[load])
    with pytest.raises(TrajectoryError, match="running state"):
        jn.retime(robot, path, loads=[load], state=[[0.0], [0.1]])


@pytest.mark.slow
def test_waypoints_are_counted_on_rounded_lines_too():
    lines = {"slide": [0.0, 1.0, 3.0]}
    load = CarriedLoad("cart", jn.Inertia(0.5), 2, by="waypoint")
    found = jn.retime(cart(effort=30.0), lines, loads=[load], deviation=0.01)
    assert found.derivatives([found.loads[0].start], 0)[0, 0, 0] == pytest.approx(1.0, abs=0.01)


@pytest.mark.slow
def test_an_arm_with_a_load_is_as_fast_as_its_pieces_and_its_torques_are_those_of_pinocchio():
    pinocchio = pytest.importorskip("pinocchio")
    robot = jn.load_robot("examples/robots/panda.urdf")
    limits = load_limits("examples/limits/franka_panda.yaml", robot)
    limits = {name: dataclasses.replace(x, effort=x.effort and 0.75 * x.effort) for name, x in limits.items()}
    names = robot.joint_names[:7]
    points = np.array(
        [
            [0, -0.6, 0, -2.0, 0, 1.6, 0.4],
            [0.6, 0.2, 0.3, -1.6, 0.2, 1.8, 0.7],
            [1.1, 0.5, 0.2, -1.2, 0.1, 1.5, 0.3],
            [0.5, 0.1, -0.4, -1.8, -0.3, 2.0, 0],
            [-0.2, -0.5, 0, -2.1, 0, 1.6, 0.4],
        ]
    )
    held = jn.Inertia(3.0, center_of_mass=[0.02, 0, 0.05])
    load = CarriedLoad("panda_hand", held, 2, 4, by="waypoint")
    found = jn.retime(robot, points, limits, names=names, loads=[load])
    path = path_of(points, names, 2, Between())
    ends = path.points.at[[0, 1, 3, 4]]
    robots = (robot, robot.with_payload("panda_hand", held), robot)
    pieces = [
        jn.retime(own, Path(path.laws, first, last), limits).stop
        for own, first, last in zip(robots, ends[:-1], ends[1:], strict=True)
    ]
    assert sum(pieces) * 0.999 < found.stop < sum(pieces) * 1.01
    model = pinocchio.buildModelFromUrdf("examples/robots/panda.urdf")
    frame = model.frames[model.getFrameId("panda_hand")]
    loaded = model.copy()
    inertia = pinocchio.Inertia(3.0, np.array([0.02, 0, 0.05]), np.zeros((3, 3)))
    loaded.inertias[frame.parentJoint] += frame.placement.act(inertia)
    times = np.linspace(0.0, found.stop, 801)
    motion = found.derivatives(times, 2)
    torques = jn.dynamics.trajectory_torques(robot, found, times=times, loads=found.loads, drives=False)
    start, stop = found.loads[0].start, found.loads[0].stop
    for own, t, (q, v, a) in zip(np.column_stack([torques[n].values[:, 0] for n in names]), times, motion, strict=True):
        used = loaded if start <= t < stop else model
        padded = (np.append(x, np.zeros(used.nv - 7)) for x in (q, v, a))
        tau = pinocchio.rnea(used, used.createData(), *padded)
        np.testing.assert_allclose(own, tau[:7], rtol=0, atol=1e-10)
    driven = jn.dynamics.trajectory_torques(robot, found, times=times, loads=found.loads)  # with damping
    for name in names:
        assert np.abs(driven[name].values[:, 0]).max() <= limits[name].effort * (1 + 1e-9)
