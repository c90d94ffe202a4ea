"""Reactions that grow without bound toward the change points of a motion are told of; those that do not are not."""

import numpy as np
import pytest

import jounce as jn
from jounce.dynamics import DriverTorqueOutput, JointForceOutput
from jounce.reporting.facts.motion_facts import motion_facts


def parallelogram(law):
    """A parallelogram with a coupler of mass m alone, its center a quarter of its length b from the crank.

    The rocker has no mass, so the force on it is along it. Across the coupler, which does not turn, it is a quarter of
    m times the acceleration of the crank's pin that way. Where the angle of the crank is zero or half a turn, the force
    along the coupler is infinite, unless that acceleration is zero there, as with constant speed.
    """
    pin = jn.planar.Revolute
    return jn.Mechanism(
        space="planar",
        bodies={
            "crank": jn.Body([0, 0], angle=0.5, mass=0.0),
            "coupler": jn.Body([np.cos(0.5), np.sin(0.5)], mass=2.0, inertia=0.1, center_of_mass=[0.5, 0.0]),
            "rocker": jn.Body([2, 0], angle=0.5, mass=0.0),
        },
        joints={
            "A": pin(("ground", "crank"), [0, 0], [0, 0]),
            "B": pin(("crank", "coupler"), [1, 0], [0, 0]),
            "C": pin(("coupler", "rocker"), [2, 0], [1, 0]),
            "D": pin(("ground", "rocker"), [2, 0], [0, 0]),
        },
        drivers={"turn": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", motion=law)},
        outputs={
            "force": JointForceOutput("C"),
            "torque": DriverTorqueOutput("turn"),
            "angle": jn.outputs.AngleOutput("rocker"),
        },
    )


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 4])
def test_a_pole_at_a_change_point_is_reported_whatever_the_order(order):
    motion = jn.solve(parallelogram("0.5 + t + t**2/2"), np.linspace(0.0, 2.9, 59), order=order)
    (remark,) = motion_facts(motion)["remarks"]
    assert remark.startswith("force: ")  # and of no other output
    for angle in (np.pi, 2 * np.pi):
        assert f"{np.sqrt(2 * angle) - 1:g} s" in remark


@pytest.mark.slow
def test_a_force_that_stays_finite_there_is_not_reported():
    motion = jn.solve(parallelogram("0.5 + 2*t"), np.linspace(0.0, 2.9, 59), order=1)
    assert motion.change_points.size
    assert not motion_facts(motion)["remarks"]
    assert np.nanmax(np.abs(motion.outputs["force"][:, 0])) < 10
