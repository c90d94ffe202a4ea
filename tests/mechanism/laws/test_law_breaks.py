"""Where laws of mechanisms jump or bend, those of forces among them: against the instants that they were given."""

import dataclasses

import numpy as np
import pytest

import jounce as jn
from jounce.kinematics.families.design_sides import sides_of_designs
from jounce.mechanism.laws.law_breaks import breaks_of_laws, laws_may_break

PAIR = ("ground", "rod")
RAMP = jn.laws.SegmentedMotion(
    [jn.laws.Segment("dwell", "begin"), jn.laws.Segment("cycloidal", 0.5, by=1.0)], beyond="hold"
)
ROD = jn.Mechanism(
    space="planar",
    parameters={"begin": 0.2, "k": 3.0},
    bodies={"rod": jn.Body([0, 0], mass=1.0, inertia=0.1)},
    joints={"pin": jn.planar.Revolute(PAIR, [0, 0], [0, 0])},
    drivers={"motor": jn.drivers.CoordinateDriver(PAIR, "angle", motion="sin(t)")},
    forces={
        "ramp": jn.forces.Torque(PAIR, law=RAMP),
        "wind": jn.forces.PointForce("rod", [1.0, 0.0], law=["-k*vx*abs(t - 0.5)**3", 3.0]),
        "spring": jn.forces.Torque(PAIR, law="-k*x"),
        "grease": jn.forces.Torque(PAIR, law=lambda x, v, t: -0.1 * v),
    },
    outputs={"torque": jn.outputs.DriverTorqueOutput("motor")},
)
UNSEEN = dataclasses.replace(ROD, outputs={"angle": jn.outputs.AngleOutput("rod")})


def test_laws_of_forces_count_where_forces_are_shown_or_move_the_bodies():
    assert breaks_of_laws(ROD, 0.0, 1.0, 4).tolist() == pytest.approx([0.2, 0.5, 0.7], abs=1e-11)
    assert laws_may_break(ROD)
    assert not len(breaks_of_laws(UNSEEN, 0.0, 1.0, 4))
    assert not laws_may_break(UNSEEN)
    assert len(breaks_of_laws(UNSEEN, 0.0, 1.0, 4, forces=True)) == 3
    assert not len(breaks_of_laws(UNSEEN, 0.0, 1.0, 2, forces=True))  # the force has no corner, its rates have


def test_each_design_has_its_own():
    breaks, sides = sides_of_designs(ROD, {"begin": np.array([0.1, 0.3])}, 0.0, 1.0, 4)
    np.testing.assert_allclose(breaks[:, ::2], [[0.1, 0.5, 0.6], [0.3, 0.5, 0.8]], rtol=0, atol=1e-11)
    np.testing.assert_allclose(sides, breaks, rtol=0, atol=1e-10)
